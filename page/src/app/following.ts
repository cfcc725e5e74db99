// The line that is being followed: what was asked, how far it has grown, what is left of it, and what can be done next.
// Plan view, stereo view and 3-D view ask here and show `growth`; there is one at a time, as at the server.

import { Follower } from "./api";
import type { App } from "./app";
import type { FollowNews, FollowOrder, Line, Place } from "./documents";

export type End = "start" | "end";

export interface Growth {
  state: "idle" | "growing" | "stopped" | "refused";
  trace: string;
  lines: Line[]; // the followed line as it would be kept (first), and what runs beside it
  area: Place[]; // corners of the search area
  pair: number | null; // the pair it was picked in
  seen: { pair: number; left: [number, number][]; right: [number, number][] } | null; // pixels, of the last pair
  stops: [string, string];
  choices: [string[], string[]];
  distance_m: number;
  interrupted: boolean;
  at: Place | null; // where the last click was
  goesOn: { id: string; end: End } | null; // the next click goes on from there; id "": from the line that is followed
  refusal: { reason: string; advice: string; works: Place | null; works_px: [number, number] | null } | null;
}

const IDLE: Growth = {
  state: "idle", trace: "", lines: [], area: [], pair: null, seen: null, stops: ["", ""], choices: [[], []],
  distance_m: 0, interrupted: false, at: null, goesOn: null, refusal: null,
};

export class Following {
  growth: Growth = IDLE;
  private whole: Line[] = []; // as the server grew it
  private off: [number, number] = [0, 0]; // nodes taken off at the start and at the end
  private order: FollowOrder | null = null;
  private continues: { id: string; end: End } | null = null;
  private whenStopped: (() => void)[] = []; // called when it grows no more
  private readonly past = new Set<string>(); // traces that are done with: late news of them are not of the next
  private readonly follower: Follower;

  constructor(private readonly app: App) {
    this.follower = new Follower((news) => this.heard(news), () => this.lost());
    app.on("order", (order) => void this.ordered(order));
  }

  // What another pane asks for
  private async ordered(order: FollowOrder): Promise<void> {
    if (order.type === "pick") await this.pick(order.at, order.continues, order.toward);
    else if (order.type === "pick_image") await this.pickImage(order.pair, order.side, order.at_px);
    else if (order.type === "bridge") this.bridge(order.end);
    else this.interrupt();
  }

  // Follow what is at a place; with `continues`: from an end of a saved line on
  async pick(at: Place, continues?: { id: string; end: End }, toward?: Place): Promise<void> {
    await this.settle();
    this.continues = continues ?? null;
    this.begin({ type: "pick", at, kind: this.app.followKind, ...(toward && { toward }), ...(continues && { continues }) }, at);
  }

  // The next click goes on from an end: of a saved line, or (no id) of the one that has stopped
  goOnFrom(end: End, id = ""): void {
    this.show({ goesOn: { id, end } });
  }

  // A click of the person who follows: a new line, or farther along the one that goes on
  async click(at: Place): Promise<void> {
    const { goesOn } = this.growth;
    if (goesOn === null) return this.pick(at);
    const id = goesOn.id || (await this.keep());
    if (id) await this.pick(at, { id, end: goesOn.end });
  }

  async pickImage(pair: number, side: "left" | "right", at_px: [number, number]): Promise<void> {
    await this.settle();
    this.continues = null;
    this.begin({ type: "pick_image", pair, side, at_px, kind: this.app.followKind }, null, pair);
  }

  canGoThere(): boolean {
    const refusal = this.growth.state === "refused" ? this.growth.refusal : null;
    return (refusal?.works ?? refusal?.works_px ?? null) !== null;
  }

  // Go where a refusal said that it works
  async goThere(): Promise<void> {
    const refusal = this.growth.refusal;
    if (refusal === null || this.order === null) return;
    if (this.order.type === "pick" && refusal.works) await this.pick(refusal.works, this.continues ?? undefined);
    if (this.order.type === "pick_image" && refusal.works_px)
      await this.pickImage(this.order.pair, this.order.side, refusal.works_px);
  }

  // Go on beyond the gap at an end
  bridge(end: End): void {
    if (!this.canBridge(end)) return;
    this.show({ state: "growing", stops: ["", ""], choices: [[], []] });
    this.follower.say({ type: "bridge", trace: this.growth.trace, end });
  }

  canBridge(end: End): boolean {
    const at = end === "start" ? 0 : 1;
    return this.growth.state === "stopped" && this.off[at] === 0 && this.growth.choices[at].includes("bridge");
  }

  interrupt(): void {
    if (this.growth.state === "growing") this.follower.say({ type: "interrupt" });
  }

  // Take the last node off an end
  takeOff(end: End): void {
    const line = this.whole[0];
    if (line === undefined || this.growth.state === "idle") return;
    this.interrupt();
    if (line.xyz.length - this.off[0] - this.off[1] <= 2) return this.cancel();
    this.off[end === "start" ? 0 : 1] += 1;
    this.show({ lines: this.left() });
  }

  // Save it. The answer tells the id of the line that it became.
  async keep(): Promise<string | null> {
    // What is kept is what the server has then, vertex by vertex: it says so when it has stopped
    if (this.growth.state === "growing") {
      this.interrupt();
      await new Promise<void>((done) => this.whenStopped.push(done));
    }
    const { trace } = this.growth;
    const line = this.whole[0];
    if (line === undefined || trace === "") return null;
    const continues = this.continues;
    const [first, last] = [this.off[0], line.xyz.length - 1 - this.off[1]];
    const { growth, whole, off } = this;
    this.clear();
    const changed = await this.app.tried({
      action: "keep", trace, first, last, ...(continues && { continues: continues.id }),
    }, line);
    if (changed === "refused") {
      // It can still be kept otherwise: with fewer nodes, or by itself
      if (this.growth.state === "idle") {
        this.past.delete(trace);
        Object.assign(this, { growth, whole, off });
        this.tell();
      }
      return null;
    }
    const kept = changed?.lines.find((one) => one.kind === line.kind) ?? changed?.lines[0];
    if (kept) this.app.select([kept.id]);
    return kept?.id ?? null;
  }

  cancel(): void {
    this.interrupt();
    this.clear();
  }

  // Before something else is followed, what has been followed is saved: a click never loses work
  private async settle(): Promise<void> {
    if (this.growth.state === "stopped" || this.growth.state === "growing") await this.keep();
  }

  private begin(order: FollowOrder, at: Place | null, pair: number | null = null): void {
    if (this.growth.trace !== "") this.past.add(this.growth.trace);
    this.order = order;
    this.whole = [];
    this.off = [0, 0];
    this.growth = { ...IDLE, state: "growing", at, pair };
    this.tell();
    this.follower.say(order);
  }

  private heard(news: FollowNews): void {
    if (this.growth.state === "idle" || this.order === null) return; // cancelled: what still comes is not wanted
    if ("trace" in news && this.past.has(news.trace)) return;
    this.app.emit("follow", news);
    if (news.type === "area") return this.show({ area: news.corners });
    if (news.type === "refused")
      return this.show({ state: "refused", refusal: { ...news }, area: this.growth.area });
    if (news.type === "seen") return this.show({ trace: news.trace, seen: { ...news } });
    this.whole = news.lines;
    if (news.type === "grown") return this.show({ trace: news.trace, lines: this.left() });
    const { trace, stops, choices, distance_m, interrupted } = news;
    this.show({ state: "stopped", trace, lines: this.left(), stops, choices, distance_m, interrupted });
  }

  private lost(): void {
    if (this.growth.state !== "growing") return;
    if (this.whole.length > 0) return this.show({ state: "stopped", stops: ["", "the workbench went away"] });
    this.clear();
    this.app.problem(new Error("Following was cut off: the workbench does not answer. Click again when it is back."));
  }

  // The lines, less the nodes that were taken off the first
  private left(): Line[] {
    const [line, ...beside] = this.whole;
    if (line === undefined) return [];
    const [first, end] = [this.off[0], line.xyz.length - this.off[1]];
    if (first === 0 && end === line.xyz.length) return this.whole;
    const bridged = line.bridged
      .map(([from, to]): [number, number] => [Math.max(from - first, 0), Math.min(to, end - 1) - first])
      .filter(([from, to]) => to >= from);
    const part = { ...line, xyz: line.xyz.slice(first, end), bridged };
    part.sigma_xy_m = line.sigma_xy_m.slice(first, end);
    part.sigma_z_m = line.sigma_z_m.slice(first, end);
    return [part, ...beside];
  }

  private clear(): void {
    if (this.growth.trace !== "") this.past.add(this.growth.trace);
    this.growth = IDLE;
    this.whole = [];
    this.off = [0, 0];
    this.continues = null;
    this.tell();
  }

  private show(part: Partial<Growth>): void {
    this.growth = { ...this.growth, ...part };
    this.tell();
  }

  private tell(): void {
    const { state, lines, area, pair } = this.growth;
    this.app.emit("growth", this.growth);
    this.app.emit("growing", { lines, area, ...(pair !== null && { pair }) });
    if (state !== "growing") for (const stopped of this.whenStopped.splice(0)) stopped();
  }
}
