// The keyboard shortcuts: one table that runs them, labels the buttons and fills the help.

import { element } from "./element";

export interface KeyBinding {
  keys: string[]; // "n", "Shift+Backspace", "Ctrl+z", "?"; the first is the main one
  title: string;
  group: string;
  when?: () => boolean; // of several bindings of a key, the first that applies runs
  run: () => void;
}

const SHOWN: Record<string, string> = {
  " ": "Space", Escape: "Esc", Delete: "Del", ArrowLeft: "←", ArrowRight: "→", ArrowUp: "↑", ArrowDown: "↓", PageUp: "Page ↑", PageDown: "Page ↓",
};

// The name of a key event, such as "Ctrl+Shift+z"; "Shift" only where the character does not imply it
export function nameOf(event: KeyboardEvent): string {
  const letter = event.key.length === 1;
  const key = letter ? event.key.toLowerCase() : event.key;
  const shift = event.shiftKey && (!letter || /[a-z ]/.test(key));
  return `${event.ctrlKey || event.metaKey ? "Ctrl+" : ""}${event.altKey ? "Alt+" : ""}${shift ? "Shift+" : ""}${key}`;
}

export function shownKey(key: string): string {
  if (key === "+") return key;
  return key.split("+").map((part) => SHOWN[part] ?? (part.length === 1 ? part.toUpperCase() : part)).join(" ");
}

function isTyping(target: EventTarget | null): boolean {
  if (!(target instanceof HTMLElement)) return false;
  if (target instanceof HTMLInputElement) return !["checkbox", "radio", "button", "range"].includes(target.type);
  return target instanceof HTMLTextAreaElement || target instanceof HTMLSelectElement || target.isContentEditable;
}

export class Keyboard {
  readonly bindings: KeyBinding[] = [];
  // Groups whose keys are active now; null: all groups
  only: () => readonly string[] | null = () => null;

  constructor() {
    window.addEventListener("keydown", (event) => this.pressed(event));
  }

  bind(binding: KeyBinding): void {
    this.bindings.push(binding);
  }

  private pressed(event: KeyboardEvent): void {
    if (event.defaultPrevented || isTyping(event.target)) return;
    const name = nameOf(event);
    const only = this.only();
    const isActive = ({ keys, group, when }: KeyBinding) =>
      keys.includes(name) && (only?.includes(group) ?? true) && (when?.() ?? true);
    const found = this.bindings.find(isActive);
    if (found === undefined) return;
    // Space and Enter press a focused button, except the tab that is shown; every other key means the same everywhere
    const focused = event.target instanceof HTMLElement && event.target.closest("button:not([aria-selected=true]), a, summary");
    if (focused && (name === " " || name === "Enter")) return;
    event.preventDefault();
    found.run();
  }
}

// A button labelled with its key
export function keyButton(
  key: string, title: string, click: () => void, attributes: Record<string, string | boolean> = {},
): HTMLButtonElement {
  return element(
    "button", { type: "button", ...attributes, click }, element("span", {}, title), element("kbd", {}, shownKey(key).replace("Shift ", "⇧")),
  );
}
