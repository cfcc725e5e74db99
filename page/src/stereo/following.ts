// A line that is followed from a pixel: what was seen of it, pair by pair, and where it was refused.

import type { App } from "../app/app";
import type { Px } from "./image";
import type { FollowNews } from "../app/documents";

type Side = "left" | "right";

interface Refusal {
  pair: number;
  side: Side;
  at: Px;
  works: Px | null; // where it would work
}

export class ImageFollowing {
  answer = ""; // why not
  private seen = new Map<number, Record<Side, Px[]>>();
  private picked: Omit<Refusal, "works"> | null = null;
  private refusal: Refusal | null = null;

  // `went`: it is seen in this pair now; `changed`: something else is to be drawn
  constructor(private readonly app: App, private readonly went: (pair: number) => void, private readonly changed: () => void) {
    app.on("follow", (news) => this.heard(news));
    // Another line is followed now, or none
    app.on("growth", ({ state, lines, seen }) => {
      if (state === "idle" || (state === "growing" && lines.length === 0 && seen === null)) this.forget();
    });
  }

  // The images go along with a line that grows from a pixel
  get is(): boolean {
    const { state, pair } = this.app.following.growth;
    return state === "growing" && pair !== null;
  }

  pick(pair: number, side: Side, at: Px): void {
    this.picked = { pair, side, at };
    this.app.emit("order", { type: "pick_image", pair, side, at_px: at, kind: this.app.followKind });
  }

  seenIn(pair: number, side: Side): Px[] {
    return this.seen.get(pair)?.[side] ?? [];
  }

  refusedIn(pair: number, side: Side): Refusal | null {
    return this.refusal?.pair === pair && this.refusal.side === side ? this.refusal : null;
  }

  private heard(news: FollowNews): void {
    if (news.type === "seen") {
      this.seen.set(news.pair, { left: news.left, right: news.right });
      if (this.is) this.went(news.pair);
      this.changed();
    }
    if (news.type === "stopped") this.picked = null;
    if (news.type !== "refused" || !this.picked) return;
    this.refusal = { ...this.picked, works: news.works_px };
    this.picked = null;
    this.answer = `${news.reason} ${news.advice}`.trim();
    this.changed();
  }

  private forget(): void {
    if (this.seen.size === 0 && this.refusal === null) return;
    this.seen = new Map();
    this.refusal = null;
    this.answer = "";
    this.changed();
  }
}
