// The review queue, the most important items first, worked with the keyboard: next, accept, reject, take the proposal.

import * as api from "../app/api";
import type { App } from "../app/app";
import { actionTitle } from "./action-titles";
import { itemTitle } from "./item-titles";
import type { Pane } from "../controls/tabs";
import { element } from "../controls/element";
import { keyButton } from "../controls/keyboard";
import type { Box } from "../app/geometry";
import type { Edit, Line, Place, QueueItem } from "../app/documents";

const LOOKING = "Looking through the lines for what to review …";
const FAILED = "What to review could not be found: reload the page.";

export class QueuePane implements Pane {
  readonly element = element("div", { class: "queue-pane" });
  private readonly list = element("ol", { class: "queue", "aria-label": "Review items, most important first" });
  private readonly progress = element("p", { class: "progress", role: "status" });
  private items: QueueItem[] = [];
  private current = "";
  private initial_m = 0; // the longest total length since the page was opened
  private latest = 0; // number of the newest request; older answers are dropped
  private state = LOOKING; // until an answer has come: of many lines it takes seconds

  constructor(private readonly app: App, private readonly show: (box: Box) => void) {
    this.element.append(this.progress, this.buttons(), this.list);
    app.on("lines", () => void this.refresh());
    this.element.dataset.current = "";
  }

  private buttons(): HTMLElement {
    const group = "Review";
    const actions: [string, string, string, () => void][] = [
      ["n", "Next", "Next item", () => this.step(1)],
      ["p", "Back", "Previous item", () => this.step(-1)],
      ["a", "Accept", "Accept the lines; next item", () => void this.decide("accept")],
      ["x", "Reject", "Reject the lines; next item", () => void this.decide("reject")],
      ["y", "Take it", "Take the proposal; next item", () => void this.propose()],
      ["q", "Dismiss", "Dismiss the item; next item", () => void this.dismiss()],
      ["Shift+f", "Follow", "Follow the missing line; Enter keeps it", () => void this.follow()],
    ];
    return element("div", { class: "actions" }, ...actions.map(([key, title, help, run]) => {
      this.app.keyboard.bind({ keys: [key], title: help, group, run });
      return keyButton(key, title, run, { title: help, "data-action": title.toLowerCase() });
    }));
  }

  private get item(): QueueItem | null {
    return this.items.find(({ key }) => key === this.current) ?? null;
  }

  private async refresh(): Promise<void> {
    const request = (this.latest += 1);
    if (this.state) this.progress.textContent = this.state = LOOKING;
    try {
      const items = await api.queue();
      if (request !== this.latest) return;
      this.state = "";
      this.items = items;
      this.draw();
    } catch (error) {
      if (request !== this.latest) return;
      if (this.state) this.progress.textContent = this.state = FAILED;
      this.app.reportProblem(error);
    }
  }

  private step(by: number): void {
    if (this.items.length === 0) return this.inform(this.state || "Nothing left to review.");
    const at = this.items.findIndex(({ key }) => key === this.current);
    const next = at < 0 ? (by > 0 ? 0 : this.items.length - 1) : (at + by + this.items.length) % this.items.length;
    const item = this.items[next];
    if (item) this.look(item);
  }

  private look(item: QueueItem): void {
    const { app } = this;
    this.current = item.key;
    this.draw();
    if (app.following.growth.state === "refused") app.following.cancel(); // of the previous item
    if (app.tool !== "select") app.setTool("select");
    app.select(item.ids);
    this.app.emit("item", item);
    this.show(item.box);
    this.app.emit("look", { at: item.at, by: "queue" });
  }

  // Accept or reject the selected lines, which are usually the item's own
  private async decide(action: "accept" | "reject"): Promise<void> {
    const ids = this.app.selection;
    if (ids.length === 0) return this.inform("Select a line, or press N for the next item.");
    const isItem = this.item !== null && ids.every((id) => this.item?.ids.includes(id));
    if (isItem) await this.resolve({ action, ids });
    else await this.app.change({ action, ids });
  }

  private async propose(): Promise<void> {
    const proposal = this.item?.proposal ?? null;
    if (proposal === null) return this.inform("This item has no proposal: follow the line with Shift F, or edit it.");
    await this.resolve(proposal);
  }

  private async dismiss(): Promise<void> {
    if (this.item !== null) await this.resolve({ action: "dismiss", key: this.item.key });
  }

  // Follow the line that the item reports missing; of a gap, from the end of its line
  private async follow(): Promise<void> {
    const item = this.item;
    if (item === null) return this.inform("Press N for the next item.");
    const line = item.type === "gap" ? this.app.lines.get(item.ids[0] ?? "") : undefined;
    this.app.followKind = item.kind;
    this.app.setTool("follow");
    if (item.type === "stretch") return this.inform("Click beside the line that is missing.");
    await this.app.following.pick(item.at, line && { id: line.id, end: nearerEnd(line, item.at) });
  }

  // Save the edit that resolves the item, then go to the item after it in the renewed queue
  private async resolve(edit: Edit): Promise<void> {
    const at = this.items.findIndex(({ key }) => key === this.current);
    const after = this.items[at + 1]?.key;
    if ((await this.app.change(edit)) === null) return;
    await this.refresh();
    const next = this.items.find(({ key }) => key === after) ?? this.items[Math.max(at, 0)] ?? this.items[0];
    if (next) return this.look(next);
    this.current = "";
    this.app.emit("item", null);
    this.draw();
  }

  private inform(text: string): void {
    this.app.emit("message", { text, kind: "info" });
  }

  private draw(): void {
    const left_m = this.items.reduce((sum, { length_m }) => sum + length_m, 0);
    this.initial_m = Math.max(this.initial_m, left_m);
    this.progress.textContent = this.items.length === 0
      ? this.app.lines.size === 0
        ? "No lines yet: extract them (Extract), or follow one (F)."
        : "Nothing left to review."
      : `${this.items.length} to review, ${left_m.toFixed(0)} m`;
    this.progress.style.setProperty("--done", `${100 * (1 - left_m / Math.max(this.initial_m, 1e-9))}%`);
    this.element.dataset.left = String(this.items.length);
    this.element.dataset.current = this.current;
    this.list.replaceChildren(...this.items.map((item) => this.row(item)));
    this.list.querySelector("[aria-current]")?.scrollIntoView({ block: "nearest" });
    const item = this.item;
    const takeButton = this.element.querySelector<HTMLButtonElement>("[data-action='take it']");
    if (takeButton) takeButton.disabled = item === null || item.proposal === null;
  }

  private row(item: QueueItem): HTMLElement {
    const what = itemTitle(this.app, item);
    const swatch = element("span", { class: "swatch" });
    if (item.kind !== "") swatch.style.backgroundColor = this.app.colour(item.kind);
    const row = element("button", { type: "button", class: "item", "data-key": item.key, click: () => this.look(item) },
      swatch,
      element("span", { class: "what" }, what),
      element("span", { class: "length" }, item.type === "sure" ? "" : `${item.length_m.toFixed(1)} m`),
      element("span", { class: "reason" }, item.reason),
      ...(item.proposal ? [element("span", { class: "proposal" }, `Proposal: ${actionTitle(item.proposal.action)}`)] : []),
    );
    if (item.key === this.current) row.setAttribute("aria-current", "true");
    return element("li", {}, row);
  }
}

function nearerEnd(line: Line, at: Place): "start" | "end" {
  const distanceTo = (vertex: readonly number[] | undefined) => Math.hypot((vertex?.[0] ?? 0) - at[0], (vertex?.[1] ?? 0) - at[1]);
  return distanceTo(line.xyz[0]) < distanceTo(line.xyz.at(-1)) ? "start" : "end";
}
