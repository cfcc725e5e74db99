// What an edit taught: the lines in which the same fault may be, to look at one by one, take in or leave out, and mend
// together as one edit.

import * as api from "../app/api";
import type { App } from "../app/app";
import type { AlikeItem, AlikeLines, Edit } from "../app/documents";
import type { Box } from "../app/geometry";
import { element } from "../controls/element";
import { keyButton } from "../controls/keyboard";
import type { Pane } from "../controls/tabs";
import { LatestTask } from "../controls/visibility";

const TEACHING = ["reject", "delete", "kind", "set"]; // actions that can be repeated on other lines

export class AlikePane implements Pane {
  readonly element = element("div", { class: "queue-pane alike-pane" });
  private readonly list = element("ol", { class: "queue", "aria-label": "Lines that may have the same fault, most alike first" });
  private readonly progress = element("p", { class: "progress", role: "status" });
  private readonly asking = new LatestTask();
  private found: AlikeLines | null = null;
  private readonly taken = new Set<string>();
  private examples = new Set<string>();
  private current = "";

  constructor(private readonly app: App, private readonly view: (box: Box) => void, private readonly showPane: () => void) {
    this.element.append(this.progress, this.buttons(), this.list);
    app.on("edited", ({ edit, number }) => this.learn(edit, number));
    app.on("lines", () => this.draw());
    // The edit that taught it is taken back: nothing is taught any more
    app.on("reverted", (lines) => {
      if (lines.some(({ id }) => this.examples.has(id))) this.found = null;
      this.draw();
    });
    this.draw();
  }

  private buttons(): HTMLElement {
    const when = () => this.items().length > 0;
    const actions: [string, string, string, () => void][] = [
      ["Shift+n", "Look", "Look at the next line that may have the same fault", () => this.step()],
      ["Shift+a", "Take in", "Take it in, or leave it out", () => this.turn(this.current)],
      ["Shift+m", "Mend", "Mend all that are taken in, as one edit", () => void this.mend()],
    ];
    return element("div", { class: "actions" }, ...actions.map(([key, title, help, run]) => {
      this.app.keyboard.bind({ keys: [key], title: help, group: "The same fault elsewhere", when, run });
      return keyButton(key, title, run, { title: help, "data-action": title.toLowerCase() });
    }));
  }

  // Lines that are gone or decided meanwhile are no longer listed
  private items(): AlikeItem[] {
    return this.found?.items.filter(({ id }) => this.app.lines.get(id)?.review === "" && this.app.lines.get(id)?.kind === this.found?.kind) ?? [];
  }

  private learn(edit: Edit, number: number): void {
    if (!TEACHING.includes(edit.action)) return;
    void this.asking.run(async () => {
      try {
        const found = await api.alike(number);
        if (found.mend === null) return;
        this.found = found;
        this.examples = new Set("ids" in edit ? edit.ids : []);
        this.current = "";
        this.taken.clear();
        this.draw();
        const n = this.items().length;
        if (n > 0) this.app.emit("message", { text: `${n === 1 ? "1 other line" : `${n} other lines`} like this: Shift N looks at ${n === 1 ? "it" : "them"}.`, kind: "info" });
      } catch (error) {
        this.app.reportProblem(error);
      }
    });
  }

  private step(): void {
    const items = this.items();
    const at = items.findIndex(({ id }) => id === this.current);
    const next = items[(at + 1) % items.length];
    if (next) this.look(next);
  }

  private look(item: AlikeItem): void {
    this.showPane();
    this.current = item.id;
    if (this.app.tool !== "select") this.app.setTool("select");
    this.app.select([item.id]);
    this.view(item.box);
    this.app.emit("look", { at: item.at, by: "alike" });
    this.draw();
  }

  private turn(id: string): void {
    if (!this.items().some((item) => item.id === id)) return this.step();
    if (!this.taken.delete(id)) this.taken.add(id);
    this.draw();
  }

  private async mend(): Promise<void> {
    const ids = this.items().map(({ id }) => id).filter((id) => this.taken.has(id));
    const mend = this.found?.mend;
    if (ids.length === 0 || !mend) return this.app.emit("message", { text: "Take lines in first: Shift N looks at the next, Shift A takes it in.", kind: "info" });
    if ((await this.app.submit({ ...mend, ids })) === "refused") return;
    this.app.emit("message", { text: `${ids.length === 1 ? "1 line" : `${ids.length} lines`} mended as one edit: Ctrl Z takes it back.`, kind: "info" });
  }

  private draw(): void {
    const items = this.items();
    const n = items.filter(({ id }) => this.taken.has(id)).length;
    this.progress.textContent = this.found === null
      ? "Nothing taught yet: reject a line, or change its kind or an attribute, and lines like it are listed here."
      : items.length === 0
        ? `No other line like it among ${this.found.n_looked} of its kind.`
        : `${items.length} others like it, ${n} taken in. To ${this.mendText()}. A list to look at: not all have the fault.`;
    this.element.dataset.left = String(items.length);
    this.element.dataset.taken = String(n);
    this.element.dataset.current = this.current;
    this.element.dataset.edit = String(this.found?.edit ?? 0);
    for (const button of this.element.querySelectorAll<HTMLButtonElement>(".actions button")) button.disabled = items.length === 0;
    this.list.replaceChildren(...items.map((item) => this.row(item)));
    this.list.querySelector("[aria-current]")?.scrollIntoView({ block: "nearest" });
  }

  private mendText(): string {
    const mend = this.found?.mend;
    if (mend?.action === "kind") return `change to ${this.app.title(mend.kind)}`;
    if (mend?.action === "set") return `set ${mend.column} to ${mend.value === "" ? "none" : String(mend.value)}`;
    return mend?.action ?? "";
  }

  private row(item: AlikeItem): HTMLElement {
    const kind = this.found?.kind ?? "";
    const title = `${this.app.title(kind)}, ${item.length_m.toFixed(1)} m, ${item.reason}`;
    const box = element("input", { type: "checkbox", "aria-label": `Take in: ${title}`, change: () => this.turn(item.id) });
    box.checked = this.taken.has(item.id);
    const row = element("button", { type: "button", class: "item", "data-id": item.id, click: () => this.look(item) },
      element("span", { class: "what" }, `${this.app.title(kind)}${item.is_very ? " (very much alike)" : ""}`),
      element("span", { class: "length" }, `${item.length_m.toFixed(1)} m`),
      element("span", { class: "reason" }, item.reason),
    );
    if (item.id === this.current) row.setAttribute("aria-current", "true");
    return element("li", {}, box, row);
  }
}
