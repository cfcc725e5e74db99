// One table of keys: what a key does, and where it does it. The help shows the same table.

export interface KeyBinding {
  keys: string[]; // "n", "Shift+Backspace", "Ctrl+z", "?": the first is shown
  title: string;
  group: string;
  when?: () => boolean; // the first binding of a key that applies runs
  run: () => void;
}

const SHOWN: Record<string, string> = { " ": "Space", Escape: "Esc", Delete: "Del" };

// "Ctrl+Shift+z" of an event; Shift only where the key itself does not say it
export function nameOf(event: KeyboardEvent): string {
  const letter = event.key.length === 1;
  const key = letter ? event.key.toLowerCase() : event.key;
  const shift = event.shiftKey && (!letter || /[a-z]/.test(key));
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
  // Groups whose keys work just now; null: all of them
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
    const works = ({ keys, group, when }: KeyBinding) =>
      keys.includes(name) && (only?.includes(group) ?? true) && (when?.() ?? true);
    const found = this.bindings.find(works);
    if (found === undefined) return;
    // A focused button is pressed by Space and Enter; every other key means the same everywhere
    const focused = event.target instanceof HTMLElement && event.target.closest("button, a, summary, [role=tab]");
    if (focused && (name === " " || name === "Enter")) return;
    event.preventDefault();
    found.run();
  }
}
