// The stereo pairs in the order of the drive: the pair that sees a place, the next pair, and playback.

import * as api from "../app/api";
import type { Pair, Place } from "../app/documents";

const MAX_CACHED = 12; // images

export class StereoDrive {
  pairs: Pair[] = [];
  playing = false;
  perSecond = 2;
  private readonly cached = new Map<string, Promise<HTMLImageElement>>();

  // `show` resolves when the pair is on the screen
  constructor(private readonly show: (pair: Pair) => Promise<void>, private readonly stopped: () => void) {}

  async load(): Promise<void> {
    this.pairs = await api.pairs();
  }

  at(number: number): Pair | undefined {
    return this.pairs.find((pair) => pair.number === number);
  }

  // The pair `by` places farther along the drive; undefined beyond its ends
  beside(number: number, by: number): Pair | undefined {
    const i = this.pairs.findIndex((pair) => pair.number === number);
    return i < 0 ? undefined : this.pairs[i + by];
  }

  // The pair that sees a place best: ahead of the cameras, not far, and within the field of view; otherwise the nearest
  seeing(place: Place): Pair | undefined {
    let best: Pair | undefined;
    let least = Infinity;
    for (const pair of this.pairs) {
      const heading = (pair.heading_deg * Math.PI) / 180;
      const [de, dn] = [place[0] - pair.at[0], place[1] - pair.at[1]];
      const ahead = de * Math.sin(heading) + dn * Math.cos(heading);
      const lateral = Math.abs(de * Math.cos(heading) - dn * Math.sin(heading));
      // About 8 m ahead the road fills the lower half of the image; beyond 45 degrees off axis nothing is visible
      const cost = Math.abs(ahead - 8) + (ahead < lateral || ahead < 4 ? 30 : 0);
      if (cost < least) [best, least] = [pair, cost];
    }
    return best;
  }

  // The left and right image of a pair; requesting them early avoids a wait when they are shown
  images(number: number): Promise<[HTMLImageElement, HTMLImageElement]> {
    return Promise.all([this.image(number, "left"), this.image(number, "right")]);
  }

  image(number: number, side: "left" | "right"): Promise<HTMLImageElement> {
    const url = api.imageUrl(number, side);
    const cached = this.cached.get(url);
    if (cached) return cached;
    const image = loaded(url);
    this.cached.set(url, image);
    image.catch(() => this.cached.delete(url));
    const oldest = this.cached.keys().next().value;
    if (this.cached.size > MAX_CACHED && oldest !== undefined) this.cached.delete(oldest);
    return image;
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
    image.onerror = () => failed(new Error("This stereo image cannot be read."));
    image.src = src;
  });
}

// What the images show: the road ahead, not the vehicle
export function roadAhead(pair: Pair): Place {
  const heading = (pair.heading_deg * Math.PI) / 180;
  return [pair.at[0] + 8 * Math.sin(heading), pair.at[1] + 8 * Math.cos(heading)];
}

