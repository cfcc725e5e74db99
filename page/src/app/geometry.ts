// Plane geometry of lines: chainages, headings, nearest places, bounding boxes. World coordinates, in metres.

import type { Place, Vertex } from "./documents";

export type Box = [west: number, south: number, east: number, north: number];

// A place on a line or on the vehicle's path
export interface Station {
  at: Place;
  z: number;
  heading_deg: number; // clockwise from north
  chainage_m: number; // plan length from the first vertex
}

export function placeOf(coordinate: readonly number[]): Place {
  return [coordinate[0] ?? NaN, coordinate[1] ?? NaN];
}

export function headingOf(a: Place | Vertex, b: Place | Vertex): number {
  return ((Math.atan2(b[0] - a[0], b[1] - a[1]) * 180) / Math.PI + 360) % 360;
}

// Plan length from the first vertex to each vertex
export function chainagesOf(path: readonly (Place | Vertex)[]): number[] {
  const chainages = [0];
  for (let i = 1; i < path.length; i++) {
    const [a, b] = [path[i - 1]!, path[i]!];
    chainages.push(chainages[i - 1]! + Math.hypot(b[0] - a[0], b[1] - a[1]));
  }
  return chainages;
}

export function planLength(path: readonly (Place | Vertex)[]): number {
  return chainagesOf(path).at(-1)!;
}

// The station at a chainage, clamped to the ends of the line
export function stationAt(xyz: readonly Vertex[], chainage_m: number): Station | null {
  if (xyz.length < 2) return null;
  const chainages = chainagesOf(xyz);
  const clamped = Math.min(chainages.at(-1)!, Math.max(0, chainage_m));
  let i = 1;
  while (i < xyz.length - 1 && chainages[i]! < clamped) i++;
  const [a, b] = [xyz[i - 1]!, xyz[i]!];
  const length = chainages[i]! - chainages[i - 1]!;
  const share = length > 0 ? (clamped - chainages[i - 1]!) / length : 0;
  return {
    at: [a[0] + (b[0] - a[0]) * share, a[1] + (b[1] - a[1]) * share],
    z: a[2] + (b[2] - a[2]) * share,
    heading_deg: headingOf(a, b),
    chainage_m: clamped,
  };
}

// How far along a segment its nearest place is, as a share of its length, and the distance to that place
export function nearestOnSegment(
  place: Place, a: Place | Vertex, b: Place | Vertex,
): { share: number; distance: number } {
  const [dx, dy] = [b[0] - a[0], b[1] - a[1]];
  const squared = dx * dx + dy * dy;
  const along = squared > 0 ? ((place[0] - a[0]) * dx + (place[1] - a[1]) * dy) / squared : 0;
  const share = Math.min(1, Math.max(0, along));
  return { share, distance: Math.hypot(a[0] + share * dx - place[0], a[1] + share * dy - place[1]) };
}

// The station on a line that is nearest to a place in plan
export function nearestOn(xyz: readonly Vertex[], place: Place): { station: Station; distance_m: number } | null {
  let best: { chainage_m: number; distance_m: number } | null = null;
  const chainages = chainagesOf(xyz);
  for (let i = 1; i < xyz.length; i++) {
    const { share, distance } = nearestOnSegment(place, xyz[i - 1]!, xyz[i]!);
    if (best !== null && distance >= best.distance_m) continue;
    const length = chainages[i]! - chainages[i - 1]!;
    best = { chainage_m: chainages[i - 1]! + share * length, distance_m: distance };
  }
  const station = best && stationAt(xyz, best.chainage_m);
  return best && station ? { station, distance_m: best.distance_m } : null;
}

export function boxOf(places: readonly (readonly number[])[]): Box | null {
  let [west, south, east, north] = [Infinity, Infinity, -Infinity, -Infinity];
  for (const [e = NaN, n = NaN] of places) {
    [west, east] = [Math.min(west, e), Math.max(east, e)];
    [south, north] = [Math.min(south, n), Math.max(north, n)];
  }
  return west <= east && south <= north ? [west, south, east, north] : null;
}

export function expanded([west, south, east, north]: Box, by_m: number): Box {
  return [west - by_m, south - by_m, east + by_m, north + by_m];
}

// Whether any segment of a line has a part inside a box (clipped to it: Liang and Barsky 1984)
export function crosses(xyz: readonly Vertex[], [west, south, east, north]: Box): boolean {
  return xyz.slice(1).some(([e, n], i) => {
    const [from_e, from_n] = xyz[i]!;
    let [first, last] = [0, 1];
    for (const [from, to, low, high] of [[from_e, e, west, east], [from_n, n, south, north]] as const) {
      const step = to - from;
      if (step === 0 && (from < low || from > high)) return false;
      if (step === 0) continue;
      const [a, b] = [(low - from) / step, (high - from) / step];
      [first, last] = [Math.max(first, Math.min(a, b)), Math.min(last, Math.max(a, b))];
    }
    return first <= last;
  });
}
