// A line followed from a pixel: its sightings pair by pair, and where a pick was refused.

import type { App } from "../app/app";
import type { Px } from "./image";
import type { FollowMessage } from "../app/documents";

type Side = "left" | "right";

interface Refusal {
  pair: number;
  side: Side;
  at: Px;
  suggestion: Px | null; // where it would work
}

export class ImageFollowing {
  refusalText = "";
  private sightings = new Map<number, Record<Side, Px[]>>();
  private picked: Omit<Refusal, "suggestion"> | null = null;
  private refusal: Refusal | null = null;

  // `reached` reports the pair in which the line is now visible; `changed` asks for a redraw
  constructor(
    private readonly app: App, private readonly reached: (pair: number) => void, private readonly changed: () => void,
  ) {
    app.on("followMessage", (message) => this.receive(message));
    // Another line is being followed, or none
    app.on("growth", ({ state, lines, sighting }) => {
      if (state === "idle" || (state === "growing" && lines.length === 0 && sighting === null)) this.clear();
    });
  }

  // Whether a line is growing from a pixel: the view then follows it from pair to pair
  get isGrowing(): boolean {
    const { state, pair } = this.app.following.growth;
    return state === "growing" && pair !== null;
  }

  pick(pair: number, side: Side, at: Px): void {
    this.picked = { pair, side, at };
    void this.app.following.pickInImage(pair, side, at);
  }

  sightingIn(pair: number, side: Side): Px[] {
    return this.sightings.get(pair)?.[side] ?? [];
  }

  refusedIn(pair: number, side: Side): Refusal | null {
    return this.refusal?.pair === pair && this.refusal.side === side ? this.refusal : null;
  }

  private receive(message: FollowMessage): void {
    if (message.type === "seen") {
      this.sightings.set(message.pair, { left: message.left, right: message.right });
      if (this.isGrowing) this.reached(message.pair);
      this.changed();
    }
    if (message.type === "stopped") this.picked = null;
    if (message.type !== "refused" || !this.picked) return;
    this.refusal = { ...this.picked, suggestion: message.works_px };
    this.picked = null;
    this.refusalText = [message.reason, message.advice].filter(Boolean).join("; ");
    this.changed();
  }

  private clear(): void {
    if (this.sightings.size === 0 && this.refusal === null) return;
    this.sightings = new Map();
    this.refusal = null;
    this.refusalText = "";
    this.changed();
  }
}
