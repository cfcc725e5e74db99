// The attributes of the selected lines: measured values, commands, and what the user sets - kind, role, pattern, form,
// condition and note.

import type { App } from "../app/app";
import type { Pane } from "../controls/tabs";
import { element } from "../controls/element";
import { keyButton } from "../controls/keyboard";
import type { Command } from "../editing/line-commands";
import type { Line } from "../app/documents";

type Column = keyof App["survey"]["choices"];

export class AttributesPane implements Pane {
  readonly element = element("section", { class: "attributes", "aria-label": "Attributes of the selected lines" });
  private readonly title = element("h2", { role: "status" });
  private readonly facts = element("dl", { class: "facts" });
  private readonly commandRow = element("div", { class: "commands" });
  private readonly kinds = element("details", { class: "kinds", open: window.innerHeight > SHORT_PX });
  private readonly choices = element("div", { class: "choices" });
  private readonly note = element("input", { name: "note", "aria-label": "Note", maxlength: 200, placeholder: "Note" });

  constructor(private readonly app: App, private readonly commands: Command[]) {
    this.commandRow.append(...commands.map(({ title, key, run }) => keyButton(key, title, run)));
    this.kinds.append(element("summary", {}, "Kind"), this.kindRow());
    this.choices.append(this.kinds, ...(Object.keys(app.survey.choices) as Column[]).map((column) => this.column(column)));
    this.note.addEventListener("change", () => this.set("note", this.note.value));
    this.element.append(this.title, this.facts, this.commandRow, this.choices, this.note);
    app.on("selection", () => this.draw());
    app.on("lines", () => this.draw());
    this.draw();
  }

  private get lines(): Line[] {
    return this.app.selection.flatMap((id) => this.app.lines.get(id) ?? []);
  }

  private kindRow(): HTMLElement {
    const buttons = this.app.survey.kinds.map(({ kind, title, colour }, i) => {
      const run = () => void this.app.change({ action: "kind", ids: this.app.selection, kind });
      const made = this.value(KIND_KEYS[i] ?? "", title, "kind", kind, run);
      made.style.setProperty("--kind", colour);
      return made;
    });
    return this.row("Kind", buttons);
  }

  private column(column: Column): HTMLElement {
    const keys = valueKeys(this.app.survey.choices);
    const buttons = this.app.survey.choices[column].map((value) =>
      this.value(keys.get(`${column} ${value}`) ?? "", value, column, value, () => this.set(column, value)));
    const row = this.row(column.charAt(0).toUpperCase() + column.slice(1), buttons);
    row.dataset.column = column;
    return row;
  }

  private value(key: string, title: string, column: string, value: string, run: () => void): HTMLButtonElement {
    if (key)
      this.app.keyboard.bind({
        keys: [key], title: column === "kind" ? title : `${column}: ${title}`, group: "Attributes",
        when: () => this.app.selection.length > 0, run,
      });
    return keyButton(key, title, run, { "data-column": column, "data-value": value });
  }

  private row(title: string, buttons: HTMLElement[]): HTMLElement {
    return element("div", { class: `choice ${title.toLowerCase()}`, role: "group", "aria-label": title },
      element("h3", {}, title), element("div", {}, ...buttons));
  }

  // Setting the same value again clears it
  private set(column: string, value: string): void {
    const ids = this.app.selection;
    if (ids.length === 0) return;
    const isSet = column !== "note" && this.lines.every((line) => line[column as Column] === value);
    void this.app.change({ action: "set", ids, column, value: isSet ? "" : value });
  }

  private draw(): void {
    const lines = this.lines;
    const [line] = lines;
    this.element.dataset.selected = this.app.selection.join(" ");
    this.title.textContent = line === undefined ? "Nothing selected" : lines.length === 1 ? this.app.title(line.kind) : `${lines.length} lines`;
    const kinds = new Set(lines.map(({ kind }) => kind.replace(/_stereo$/, "")));
    const summary = this.kinds.querySelector("summary");
    if (summary) summary.textContent = `Kind: ${kinds.size === 1 && line ? this.app.title(line.kind) : "several"} (1 to 9)`;
    this.showFitting(kinds);
    this.facts.replaceChildren(...(line ? factsOf(lines) : [hint()]));
    const buttons = this.commandRow.querySelectorAll("button");
    this.commands.forEach(({ can }, i) => buttons[i]?.toggleAttribute("disabled", !can()));
    for (const one of this.choices.querySelectorAll<HTMLButtonElement>("button")) {
      const column = one.dataset.column as Column | "kind";
      one.disabled = lines.length === 0;
      one.setAttribute("aria-pressed", String(lines.length > 0 && lines.every((each) => each[column] === one.dataset.value)));
    }
    this.note.disabled = lines.length === 0;
    if (document.activeElement !== this.note) this.note.value = lines.length === 1 ? (line?.note ?? "") : "";
  }

  // Only what lines of all these kinds can have; a row without any is hidden
  private showFitting(kinds: Set<string>): void {
    for (const row of this.choices.querySelectorAll<HTMLElement>(".choice[data-column]")) {
      const of = this.app.survey.choices_of[row.dataset.column ?? ""];
      const buttons = [...row.querySelectorAll<HTMLButtonElement>("button")];
      for (const one of buttons) one.hidden = kinds.size === 0 || ![...kinds].every((kind) => of?.[kind]?.includes(one.dataset.value ?? "") ?? false);
      row.hidden = buttons.every((one) => one.hidden);
    }
  }
}

function hint(): HTMLElement {
  return element("p", { class: "hint" }, "Click a line in the plan. Shift-click adds lines; Shift-drag selects a box.");
}

function factsOf(lines: Line[]): HTMLElement[] {
  const [line] = lines;
  const sum = (of: (line: Line) => number) => lines.reduce((total, each) => total + of(each), 0);
  const facts: [string, string][] = [["Length", `${sum((each) => each.length_m).toFixed(2)} m`]];
  const bridged_m = sum((each) => each.bridged_m);
  if (bridged_m > 0) facts.push(["Bridged", `${bridged_m.toFixed(2)} m`]);
  if (line && lines.length === 1) facts.push(...detailsOf(line));
  return facts.map(([name, value]) =>
    element("div", { title: `${name}: ${value}`, class: name === "From" || name === "ID" ? "wide" : "" }, element("dt", {}, name), element("dd", {}, value)));
}

function detailsOf(line: Line): [string, string][] {
  const metres = (value: number | null) => (value === null ? "" : `${value.toFixed(2)} m`);
  const facts: [string, string][] = [
    ["Width", metres(line.width_m)], ["Height", metres(line.height_m)], ["Clearance", metres(line.clearance_m)],
    ["σ plan", medianOf(line.sigma_xy_m)], ["σ height", medianOf(line.sigma_z_m)],
    ["Confidence", line.confidence.toFixed(2)], ["Review", line.review || "not reviewed"],
    ["From", [line.method, line.source].filter(Boolean).join(", ")], ["ID", line.id],
  ];
  return facts.filter(([, value]) => value !== "");
}

function medianOf(values: (number | null)[]): string {
  const known = values.filter((value) => value !== null).sort((a, b) => a - b);
  const middle = known[Math.floor(known.length / 2)];
  return middle === undefined ? "" : `± ${(middle * 100).toFixed(1)} cm`;
}

const SHORT_PX = 900; // in a lower window the buttons of kinds are folded; their keys work all the same
// One key, one value, as on the touch screen in the van. The key is shown on the button.
const KIND_KEYS = ["1", "2", "3", "4", "5", "6", "7", "8", "9"];

const VALUE_KEYS: Record<string, string> = {
  "role edge": "e", "role lane": "l", "role centre": "i",
  "pattern solid": "s", "pattern dashed": "h",
  "form kerb": "k", "form edge": "g", "form barrier": "w",
  "condition good": "o", "condition worn": "z", "condition damaged": "u", "condition missing": ";",
};
// For values that a newer server may add
const SPARE = ["[", "]", "'", ",", "Shift+1", "Shift+2", "Shift+3", "Shift+4", "Shift+5", "Shift+6"];

function valueKeys(choices: Record<string, string[]>): Map<string, string> {
  const keys = new Map<string, string>();
  const spare = [...SPARE];
  for (const [column, values] of Object.entries(choices))
    for (const value of values) {
      const key = VALUE_KEYS[`${column} ${value}`] ?? spare.shift();
      if (key !== undefined) keys.set(`${column} ${value}`, key);
    }
  return keys;
}
