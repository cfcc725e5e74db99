// The stereo pairs in the order of the drive: which is near a place, which comes next, playing them one after another.

import * as api from "../app/api";
import type { Pair, Place } from "../app/documents";

const MOST_KEPT = 6;

export class StereoDrive {
  pairs: Pair[] = [];
  playing = false;
  perSecond = 2;
  private readonly kept = new Map<number, Promise<[HTMLImageElement, HTMLImageElement]>>();

  // `show` shows a pair and comes back when it is seen
  constructor(private readonly show: (pair: Pair) => Promise<void>, private readonly stopped: () => void) {}

  async load(): Promise<void> {
    this.pairs = await api.pairs();
  }

  at(number: number): Pair | undefined {
    return this.pairs.find((pair) => pair.number === number);
  }

  // The pair `by` further along the drive; none beyond its ends
  beside(number: number, by: number): Pair | undefined {
    const i = this.pairs.findIndex((pair) => pair.number === number);
    return i < 0 ? undefined : this.pairs[i + by];
  }

  // The pair that sees a place best: the place is ahead of the camera, not far, and not to the side of its view.
  // Where none sees it, the nearest.
  seeing(place: Place): Pair | undefined {
    let best: Pair | undefined;
    let least = Infinity;
    for (const pair of this.pairs) {
      const heading = (pair.heading_deg * Math.PI) / 180;
      const [de, dn] = [place[0] - pair.at[0], place[1] - pair.at[1]];
      const ahead = de * Math.sin(heading) + dn * Math.cos(heading);
      const aside = Math.abs(de * Math.cos(heading) - dn * Math.sin(heading));
      // Some 8 m ahead the road fills the lower half of an image; beyond 45 degrees nothing is in it
      const cost = Math.abs(ahead - 8) + (ahead < aside || ahead < 4 ? 30 : 0);
      if (cost < least) [best, least] = [pair, cost];
    }
    return best;
  }

  // Left and right image of a pair; asked for early, they are there when they are shown
  images(number: number): Promise<[HTMLImageElement, HTMLImageElement]> {
    const kept = this.kept.get(number);
    if (kept) return kept;
    const both = Promise.all([loaded(api.imageUrl(number, "left")), loaded(api.imageUrl(number, "right"))]);
    this.kept.set(number, both);
    both.catch(() => this.kept.delete(number));
    const oldest = this.kept.keys().next().value;
    if (this.kept.size > MOST_KEPT && oldest !== undefined) this.kept.delete(oldest);
    return both;
  }

  async play(from: number): Promise<void> {
    if (this.playing) return;
    this.playing = true;
    let number = from;
    while (this.playing) {
      const next = this.beside(number, 1);
      if (next === undefined) break;
      const due = performance.now() + 1000 / this.perSecond;
      await this.show(next);
      number = next.number;
      await new Promise((done) => setTimeout(done, Math.max(0, due - performance.now())));
    }
    this.playing = false;
    this.stopped();
  }

  pause(): void {
    this.playing = false;
  }
}

function loaded(src: string): Promise<HTMLImageElement> {
  return new Promise((done, failed) => {
    const image = new Image();
    image.onload = () => done(image);
    image.onerror = () => failed(new Error("This image of the drive cannot be read."));
    image.src = src;
  });
}
