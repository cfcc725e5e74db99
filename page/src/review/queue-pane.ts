// The review queue: what matters most first. Next, look, accept, reject or take the proposal: by keys alone.

import * as api from "../app/api";
import type { App, Pane } from "../app/app";
import { element } from "../controls/element";
import { keyButton } from "../controls/key-button";
import type { Box } from "../plan/map";
import type { Edit, Line, Place, QueueItem } from "../app/documents";

const TITLES = {
  line: "Unsure line", gap: "Gap", boundary: "No boundary", dashes: "Missing dashes",
};

export class QueuePane implements Pane {
  readonly element = element("div", { class: "queue-pane" });
  private readonly list = element("ol", { class: "queue", "aria-label": "What to look at, most important first" });
  private readonly progress = element("p", { class: "progress", role: "status" });
  private items: QueueItem[] = [];
  private current = "";
  private most = 0; // metres, when the page opened
  private asked = 0;

  constructor(private readonly app: App, private readonly show: (box: Box) => void) {
    this.element.append(this.progress, this.buttons(), this.list);
    app.on("lines", () => void this.refresh());
    this.element.dataset.current = "";
  }

  private buttons(): HTMLElement {
    const group = "Review";
    const actions: [string, string, string, () => void][] = [
      ["n", "Next", "Next in the queue", () => this.step(1)],
      ["p", "Back", "Previous in the queue", () => this.step(-1)],
      ["a", "Accept", "Accept the lines, go on", () => void this.settle("accept")],
      ["x", "Reject", "Reject the lines, go on", () => void this.settle("reject")],
      ["y", "Take it", "Take the proposal, go on", () => void this.propose()],
      ["q", "Dismiss", "Nothing to do here, go on", () => void this.dismiss()],
      ["Shift+f", "Follow", "Follow what is there, then Enter", () => void this.follow()],
    ];
    return element("div", { class: "actions" }, ...actions.map(([key, title, says, run]) => {
      this.app.keyboard.bind({ keys: [key], title: says, group, run });
      return keyButton(key, title, run, { title: says, "data-action": title.toLowerCase() });
    }));
  }

  private get item(): QueueItem | null {
    return this.items.find(({ key }) => key === this.current) ?? null;
  }

  private async refresh(): Promise<void> {
    const asked = (this.asked += 1);
    try {
      const items = await api.queue();
      if (asked !== this.asked) return;
      this.items = items;
      this.draw();
    } catch (error) {
      if (asked === this.asked) this.app.problem(error);
    }
  }

  private step(by: number): void {
    if (this.items.length === 0) return;
    const at = this.items.findIndex(({ key }) => key === this.current);
    const next = at < 0 ? (by > 0 ? 0 : this.items.length - 1) : (at + by + this.items.length) % this.items.length;
    const item = this.items[next];
    if (item) this.look(item);
  }

  private look(item: QueueItem): void {
    const { app } = this;
    this.current = item.key;
    this.draw();
    if (app.following.growth.state === "refused") app.following.cancel(); // it was about the one before
    if (app.tool !== "select") app.setTool("select");
    app.select(item.ids);
    this.show(item.box);
    this.app.emit("look", { at: item.at, by: "queue" });
  }

  // Accept or reject what is selected: mostly the item's own lines
  private async settle(action: "accept" | "reject"): Promise<void> {
    const ids = this.app.selection;
    if (ids.length === 0) return this.say("Select a line, or press N for the next in the queue.");
    const isItem = this.item !== null && ids.every((id) => this.item?.ids.includes(id));
    if (isItem) await this.done({ action, ids });
    else await this.app.change({ action, ids });
  }

  private async propose(): Promise<void> {
    const proposal = this.item?.proposal ?? null;
    if (proposal === null) return this.say("There is no proposal here: follow it with Shift F, or edit the line.");
    await this.done(proposal);
  }

  private async dismiss(): Promise<void> {
    if (this.item !== null) await this.done({ action: "dismiss", key: this.item.key });
  }

  // Follow what the item says is missing, from the end of its line on if it has one; Enter keeps it
  private async follow(): Promise<void> {
    const item = this.item;
    if (item === null) return this.say("Press N for the next in the queue.");
    const line = item.type === "gap" ? this.app.lines.get(item.ids[0] ?? "") : undefined;
    this.app.followKind = item.kind;
    this.app.setTool("follow");
    await this.app.following.pick(item.at, line && { id: line.id, end: nearerEnd(line, item.at) });
  }

  // Save what settles the current item, and go on to what came after it: the queue is another one then
  private async done(edit: Edit): Promise<void> {
    const at = this.items.findIndex(({ key }) => key === this.current);
    const after = this.items[at + 1]?.key;
    if ((await this.app.change(edit)) === null) return;
    await this.refresh();
    const next = this.items.find(({ key }) => key === after) ?? this.items[Math.max(at, 0)] ?? this.items[0];
    if (next) return this.look(next);
    this.current = "";
    this.draw();
  }

  private say(text: string): void {
    this.app.emit("message", { text, kind: "info" });
  }

  private draw(): void {
    const left_m = this.items.reduce((sum, { length_m }) => sum + length_m, 0);
    this.most = Math.max(this.most, left_m);
    this.progress.textContent = this.items.length === 0
      ? "Nothing is left to look at."
      : `${this.items.length} to look at, ${left_m.toFixed(0)} m`;
    this.progress.style.setProperty("--done", `${100 * (1 - left_m / Math.max(this.most, 1e-9))}%`);
    this.element.dataset.left = String(this.items.length);
    this.element.dataset.current = this.current;
    this.list.replaceChildren(...this.items.map((item) => this.row(item)));
    this.list.querySelector("[aria-current]")?.scrollIntoView({ block: "nearest" });
    const item = this.item;
    const take = this.element.querySelector<HTMLButtonElement>("[data-action='take it']");
    if (take) take.disabled = item === null || item.proposal === null;
  }

  private row(item: QueueItem): HTMLElement {
    const kind = this.app.title(item.kind);
    const swatch = element("span", { class: "swatch" });
    swatch.style.backgroundColor = this.app.colour(item.kind);
    const row = element("button", { type: "button", class: "item", "data-key": item.key, click: () => this.look(item) },
      swatch,
      element("span", { class: "what" }, `${TITLES[item.type]}: ${kind}`),
      element("span", { class: "length" }, `${item.length_m.toFixed(1)} m`),
      element("span", { class: "reason" }, item.reason),
      ...(item.proposal ? [element("span", { class: "proposal" }, `Proposal: ${item.proposal.action}`)] : []),
    );
    if (item.key === this.current) row.setAttribute("aria-current", "true");
    return element("li", {}, row);
  }
}

function nearerEnd(line: Line, at: Place): "start" | "end" {
  const away = (vertex: readonly number[] | undefined) => Math.hypot((vertex?.[0] ?? 0) - at[0], (vertex?.[1] ?? 0) - at[1]);
  return away(line.xyz[0]) < away(line.xyz.at(-1)) ? "start" : "end";
}
