// The line being followed: the request, the line so far, the nodes removed from it, and what can be done next.
// There is one at a time, on the page as on the server. Plan, stereo and 3-D views show `growth`.

import { Follower } from "./api";
import type { Changed, Edit, FollowMessage, FollowRequest, Line, Place } from "./documents";

export type End = "start" | "end";

export interface Growth {
  state: "idle" | "growing" | "stopped" | "refused";
  trace: string; // the server's id of the followed line
  lines: Line[]; // first the followed line as it would be kept, then the lines beside it
  area: Place[]; // corners of the search area
  pair: number | null; // the stereo pair it was picked in
  sighting: { pair: number; left: [number, number][]; right: [number, number][] } | null; // pixels in the last pair
  stops: [string, string]; // why it stopped at the start and at the end
  choices: [string[], string[]];
  distance_m: number;
  interrupted: boolean;
  unseen: string[]; // nodes of the template that the points show nowhere
  left_out: string; // the template that was interrupted
  at: Place | null; // the last click
  continueFrom: { id: string; end: End } | null; // the next click continues there; id "": the followed line itself
  refusal: { reason: string; advice: string; works: Place | null; works_px: [number, number] | null } | null;
}

const IDLE: Growth = {
  state: "idle", trace: "", lines: [], area: [], pair: null, sighting: null, stops: ["", ""], choices: [[], []],
  distance_m: 0, interrupted: false, unseen: [], left_out: "", at: null, continueFrom: null, refusal: null,
};

// What the page does for the follower
export interface FollowingCallbacks {
  template(): string; // followed beside the line; "": none
  kind(): string; // the kind to follow; "": the server chooses by the place
  save(edit: Edit, shape: Line): Promise<Changed | null | "refused">;
  select(ids: string[]): void;
  received(message: FollowMessage): void;
  changed(growth: Growth): void;
  problem(error: Error): void;
}

export class Following {
  growth: Growth = IDLE;
  private grown: Line[] = []; // as the server grew it
  private removed: [number, number] = [0, 0]; // nodes removed at the start and at the end
  private request: FollowRequest | null = null;
  private continues: { id: string; end: End } | null = null;
  private whenStopped: (() => void)[] = [];
  private readonly finished = new Set<string>(); // late messages about these traces are dropped
  private readonly follower: Follower;

  constructor(private readonly page: FollowingCallbacks) {
    this.follower = new Follower((message) => this.receive(message), () => this.disconnected());
  }

  // Follow the feature at a place; with `continues`, from one end of a saved line
  async pick(at: Place, continues?: { id: string; end: End }, toward?: Place): Promise<void> {
    await this.keepPending();
    this.continues = continues ?? null;
    const template = this.page.template();
    const request: FollowRequest = { type: "pick", at, kind: this.page.kind() };
    this.start({ ...request, ...(template && { template }), ...(toward && { toward }), ...(continues && { continues }) }, at);
  }

  async pickInImage(pair: number, side: "left" | "right", at_px: [number, number]): Promise<void> {
    await this.keepPending();
    this.continues = null;
    this.start({ type: "pick_image", pair, side, at_px, kind: this.page.kind() }, null, pair);
  }

  // Let the next click continue from an end of a saved line or, without an id, of the line that has stopped
  continueFrom(end: End, id = ""): void {
    this.update({ continueFrom: { id, end } });
  }

  // A click with the Follow tool: start a new line, or continue one
  async click(at: Place): Promise<void> {
    const { continueFrom } = this.growth;
    if (continueFrom === null) return this.pick(at);
    const id = continueFrom.id || (await this.keep());
    if (id) await this.pick(at, { id, end: continueFrom.end });
  }

  // Whether a refusal came with a place where following would work
  hasSuggestion(): boolean {
    const refusal = this.growth.state === "refused" ? this.growth.refusal : null;
    return (refusal?.works ?? refusal?.works_px ?? null) !== null;
  }

  async followSuggestion(): Promise<void> {
    const refusal = this.growth.refusal;
    if (refusal === null || this.request === null) return;
    if (this.request.type === "pick" && refusal.works) await this.pick(refusal.works, this.continues ?? undefined);
    if (this.request.type === "pick_image" && refusal.works_px)
      await this.pickInImage(this.request.pair, this.request.side, refusal.works_px);
  }

  // Follow on beyond the gap at an end
  bridge(end: End): void {
    if (!this.canBridge(end)) return;
    this.update({ state: "growing", stops: ["", ""], choices: [[], []] });
    const template = this.page.template();
    this.follower.send({ type: "bridge", trace: this.growth.trace, end, ...(template && { template }) });
  }

  canBridge(end: End): boolean {
    const at = end === "start" ? 0 : 1;
    return this.growth.state === "stopped" && this.removed[at] === 0 && this.growth.choices[at].includes("bridge");
  }

  interrupt(): void {
    if (this.growth.state === "growing") this.follower.send({ type: "interrupt" });
  }

  removeNode(end: End): void {
    const line = this.grown[0];
    if (line === undefined || this.growth.state === "idle") return;
    this.interrupt();
    if (line.xyz.length - this.removed[0] - this.removed[1] <= 2) return this.cancel();
    this.removed[end === "start" ? 0 : 1] += 1;
    this.update({ lines: this.remaining() });
  }

  // Save the line; returns the id it was saved under, or null
  async keep(): Promise<string | null> {
    // The edit names vertices of the server's line, so wait for its final state
    if (this.growth.state === "growing") {
      this.interrupt();
      await new Promise<void>((done) => this.whenStopped.push(done));
    }
    const { trace } = this.growth;
    const line = this.grown[0];
    if (line === undefined || trace === "") return null;
    const continues = this.continues;
    const [first, last] = [this.removed[0], line.xyz.length - 1 - this.removed[1]];
    const { growth, grown, removed } = this;
    this.clear();
    const edit: Edit = { action: "keep", trace, first, last, ...(continues && { continues: continues.id }) };
    const changed = await this.page.save(edit, line);
    if (changed === "refused") {
      // Restore it: it may still be kept with fewer nodes, or as a line of its own
      if (this.growth.state === "idle") {
        this.finished.delete(trace);
        Object.assign(this, { growth, grown, removed });
        this.publish();
      }
      return null;
    }
    const kept = changed?.lines.find((one) => one.kind === line.kind) ?? changed?.lines[0];
    if (kept) this.page.select([kept.id]);
    return kept?.id ?? null;
  }

  cancel(): void {
    this.interrupt();
    this.clear();
  }

  // Keep what has been followed so far before following something else: a click never loses work
  private async keepPending(): Promise<void> {
    if (this.growth.state === "stopped" || this.growth.state === "growing") await this.keep();
  }

  private start(request: FollowRequest, at: Place | null, pair: number | null = null): void {
    if (this.growth.trace !== "") this.finished.add(this.growth.trace);
    this.request = request;
    this.grown = [];
    this.removed = [0, 0];
    this.growth = { ...IDLE, state: "growing", at, pair };
    this.publish();
    this.follower.send(request);
  }

  private receive(message: FollowMessage): void {
    if (this.growth.state === "idle" || this.request === null) return; // cancelled
    if ("trace" in message && this.finished.has(message.trace)) return;
    this.page.received(message);
    if (message.type === "area") return this.update({ area: message.corners });
    if (message.type === "refused")
      return this.update({ state: "refused", refusal: { ...message }, area: this.growth.area });
    if (message.type === "seen") return this.update({ trace: message.trace, sighting: { ...message } });
    this.grown = message.lines;
    if (message.type === "grown") return this.update({ trace: message.trace, lines: this.remaining() });
    const { trace, stops, choices, distance_m, interrupted, unseen = [], left_out = "" } = message;
    this.update({ state: "stopped", trace, lines: this.remaining(), stops, choices, distance_m, interrupted, unseen, left_out });
  }

  private disconnected(): void {
    if (this.growth.state !== "growing") return;
    if (this.grown.length > 0) return this.update({ state: "stopped", stops: ["", "the connection was lost"] });
    this.clear();
    this.page.problem(new Error("Following was interrupted: the workbench does not answer. Click again once it is back."));
  }

  // The grown lines, without the nodes removed from the first
  private remaining(): Line[] {
    const [line, ...beside] = this.grown;
    if (line === undefined) return [];
    const [first, end] = [this.removed[0], line.xyz.length - this.removed[1]];
    if (first === 0 && end === line.xyz.length) return this.grown;
    const bridged = line.bridged
      .map(([from, to]): [number, number] => [Math.max(from - first, 0), Math.min(to, end - 1) - first])
      .filter(([from, to]) => to >= from);
    const part = { ...line, xyz: line.xyz.slice(first, end), bridged };
    part.sigma_xy_m = line.sigma_xy_m.slice(first, end);
    part.sigma_z_m = line.sigma_z_m.slice(first, end);
    return [part, ...beside];
  }

  private clear(): void {
    if (this.growth.trace !== "") this.finished.add(this.growth.trace);
    this.growth = IDLE;
    this.grown = [];
    this.removed = [0, 0];
    this.continues = null;
    this.publish();
  }

  private update(part: Partial<Growth>): void {
    this.growth = { ...this.growth, ...part };
    this.publish();
  }

  private publish(): void {
    this.page.changed(this.growth);
    if (this.growth.state !== "growing") for (const stopped of this.whenStopped.splice(0)) stopped();
  }
}
