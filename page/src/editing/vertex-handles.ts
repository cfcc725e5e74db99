// The vertices of the one selected line: which of them are shown at this scale, and what is under the mouse.

import type OlMap from "ol/Map";
import type { Line, Place } from "../app/documents";

const APART_PX = 18; // handles nearer together than this would hide the line
const REACH_PX = 8;

export interface Hold {
  vertex: number; // the vertex itself, or the one before the place on a segment
  on: "vertex" | "segment";
  at: Place;
}

export function handlesOf(line: Line, resolution: number): number[] {
  const apart_m = APART_PX * resolution;
  const shown: number[] = [];
  let last: readonly number[] | null = null;
  line.xyz.forEach((vertex, i) => {
    const isEnd = i === 0 || i === line.xyz.length - 1;
    const [east = NaN, north = NaN] = last ?? [];
    if (!isEnd && Math.hypot(vertex[0] - east, vertex[1] - north) < apart_m) return;
    shown.push(i);
    last = vertex;
  });
  return shown;
}

// What is under a place: a vertex, shown or not, before a segment
export function holdAt(line: Line, place: Place, map: OlMap): Hold | null {
  const reach_m = REACH_PX * (map.getView().getResolution() ?? 1);
  let best: Hold | null = null;
  let least = reach_m;
  line.xyz.forEach((vertex, i) => {
    const away = Math.hypot(vertex[0] - place[0], vertex[1] - place[1]);
    if (away < least) [best, least] = [{ vertex: i, on: "vertex", at: [vertex[0], vertex[1]] }, away];
  });
  return best ?? segmentAt(line, place, reach_m);
}

function segmentAt(line: Line, place: Place, reach_m: number): Hold | null {
  let best: Hold | null = null;
  let least = reach_m;
  for (let i = 1; i < line.xyz.length; i++) {
    const [a, b] = [line.xyz[i - 1]!, line.xyz[i]!];
    const [de, dn] = [b[0] - a[0], b[1] - a[1]];
    const squared = de * de + dn * dn;
    const share = squared > 0 ? ((place[0] - a[0]) * de + (place[1] - a[1]) * dn) / squared : 0;
    if (share <= 0 || share >= 1) continue;
    const at: Place = [a[0] + de * share, a[1] + dn * share];
    const away = Math.hypot(at[0] - place[0], at[1] - place[1]);
    if (away < least) [best, least] = [{ vertex: i - 1, on: "segment", at }, away];
  }
  return best;
}
