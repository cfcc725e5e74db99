// The axis of the straightened view: a line or the van's path, along which places are given by chainage and offset. As on
// the server, it goes on straight beyond its ends.

import { type Box, boxOf, chainagesOf, nearestOnSegment } from "../app/geometry";
import type { Place, Vertex } from "../app/documents";

export const BEYOND_M = 20;
const LEAST_STEP_M = 1e-6; // vertices nearer than this are one place

export interface Straightened {
  s: number; // chainage; the first vertex is at 0
  o: number; // offset, positive to the right
}

export class Axis {
  // null: a line without length cannot be unrolled
  static of(xyz: readonly Vertex[]): Axis | null {
    const path: Place[] = [];
    for (const [e, n] of xyz) {
      const last = path.at(-1);
      if (!last || Math.hypot(e - last[0], n - last[1]) > LEAST_STEP_M) path.push([e, n]);
    }
    if (path.length < 2) return null;
    const longer = [beyond(path[1]!, path[0]!), ...path, beyond(path.at(-2)!, path.at(-1)!)];
    const chainages = chainagesOf(longer).map((chainage) => chainage - BEYOND_M);
    return new Axis(longer, chainages, chainages.at(-2)!);
  }

  readonly box: Box;

  private constructor(
    private readonly path: readonly Place[], private readonly chainages: readonly number[], readonly length_m: number,
  ) {
    this.box = boxOf(path)!;
  }

  // The part of the axis over a stretch, in which places are found faster
  over(from_m: number, to_m: number): Axis {
    const after = this.chainages.findIndex((chainage) => chainage > from_m);
    const first = Math.max(0, (after < 0 ? this.path.length - 1 : after) - 1);
    const end = this.chainages.findIndex((chainage) => chainage >= to_m);
    const last = Math.max(first + 2, end < 0 ? this.path.length : end + 1);
    return new Axis(this.path.slice(first, last), this.chainages.slice(first, last), this.length_m);
  }

  // The nearest place on the axis; null farther from it than `within_m`
  straightened(place: Place, within_m: number): Straightened | null {
    const [west, south, east, north] = this.box;
    const isFar = place[0] < west - within_m || place[0] > east + within_m || place[1] < south - within_m || place[1] > north + within_m;
    if (isFar) return null;
    let best: Straightened | null = null;
    let least = within_m;
    for (let i = 1; i < this.path.length; i++) {
      const [a, b] = [this.path[i - 1]!, this.path[i]!];
      const { share, distance } = nearestOnSegment(place, a, b);
      if (distance > least) continue;
      least = distance;
      const side = (place[0] - a[0]) * (b[1] - a[1]) - (place[1] - a[1]) * (b[0] - a[0]);
      const from = this.chainages[i - 1]!;
      best = { s: from + share * (this.chainages[i]! - from), o: Math.sign(side) * distance };
    }
    return best;
  }

  inWorld({ s, o }: Straightened): Place {
    let i = 1;
    while (i < this.path.length - 1 && this.chainages[i]! < s) i++;
    const [a, b] = [this.path[i - 1]!, this.path[i]!];
    const length = this.chainages[i]! - this.chainages[i - 1]!;
    const [e, n] = [(b[0] - a[0]) / length, (b[1] - a[1]) / length];
    const along = s - this.chainages[i - 1]!;
    return [a[0] + along * e + o * n, a[1] + along * n - o * e];
  }
}

function beyond(from: Place, to: Place): Place {
  const length = Math.hypot(to[0] - from[0], to[1] - from[1]);
  return [to[0] + (BEYOND_M * (to[0] - from[0])) / length, to[1] + (BEYOND_M * (to[1] - from[1])) / length];
}
