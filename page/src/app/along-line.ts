// Places along a line: plan lengths (chainage) from its first vertex, headings clockwise from north.

import type { Place, Vertex } from "./documents";

export interface Station {
  at: Place;
  z: number;
  heading_deg: number;
  chainage_m: number;
}

export function headingOf(a: Place | Vertex, b: Place | Vertex): number {
  return ((Math.atan2(b[0] - a[0], b[1] - a[1]) * 180) / Math.PI + 360) % 360;
}

export function chainagesOf(xyz: readonly Vertex[]): number[] {
  const along = [0];
  for (let i = 1; i < xyz.length; i++) {
    const [a, b] = [xyz[i - 1]!, xyz[i]!];
    along.push(along[i - 1]! + Math.hypot(b[0] - a[0], b[1] - a[1]));
  }
  return along;
}

// The place so far along; before the start and after the end: the start and the end
export function stationAt(xyz: readonly Vertex[], chainage_m: number): Station | null {
  if (xyz.length < 2) return null;
  const along = chainagesOf(xyz);
  const most = along[along.length - 1]!;
  const wanted = Math.min(most, Math.max(0, chainage_m));
  let i = 1;
  while (i < xyz.length - 1 && along[i]! < wanted) i++;
  const [a, b] = [xyz[i - 1]!, xyz[i]!];
  const length = along[i]! - along[i - 1]!;
  const share = length > 0 ? (wanted - along[i - 1]!) / length : 0;
  return {
    at: [a[0] + (b[0] - a[0]) * share, a[1] + (b[1] - a[1]) * share],
    z: a[2] + (b[2] - a[2]) * share,
    heading_deg: headingOf(a, b),
    chainage_m: wanted,
  };
}

// The place of the line nearest in plan
export function nearestOn(xyz: readonly Vertex[], place: Place): { station: Station; distance_m: number } | null {
  let best: { chainage_m: number; distance_m: number } | null = null;
  const along = chainagesOf(xyz);
  for (let i = 1; i < xyz.length; i++) {
    const [a, b] = [xyz[i - 1]!, xyz[i]!];
    const [dx, dy] = [b[0] - a[0], b[1] - a[1]];
    const squared = dx * dx + dy * dy;
    const share = squared > 0 ? ((place[0] - a[0]) * dx + (place[1] - a[1]) * dy) / squared : 0;
    const inside = Math.min(1, Math.max(0, share));
    const distance_m = Math.hypot(a[0] + dx * inside - place[0], a[1] + dy * inside - place[1]);
    if (best === null || distance_m < best.distance_m) {
      best = { chainage_m: along[i - 1]! + inside * Math.sqrt(squared), distance_m };
    }
  }
  const station = best && stationAt(xyz, best.chainage_m);
  return best && station ? { station, distance_m: best.distance_m } : null;
}
