// What is known of a line along an axis: standard deviations, bridged stretches, and the height that a surveyor asks for.

import type { Points } from "../app/api";
import { isAboveKnown } from "../controls/colours";
import type { LineAlong, LinePlace } from "./lines-along";
import { lineAt } from "./lines-along";

export type Series = [s: number, value: number][];

export interface Measures {
  sigma_xy_cm: Series;
  sigma_z_cm: Series;
  bridged: [from: number, to: number][];
  height: { title: string; values: Series }; // [m]
}

const STEP_M = 1; // stations of the height
const BESIDE_M = 0.6; // a kerb's top lies this near to its foot, at most

export function measuresOf(target: LineAlong, all: readonly LineAlong[], points: Points | null): Measures {
  const { line, nodes } = target;
  const series = (values: readonly (number | null)[]): Series =>
    nodes.flatMap(({ s, vertex }) => {
      const value = values[vertex ?? -1];
      return typeof value === "number" ? [[s, 100 * value] as [number, number]] : [];
    });
  return {
    sigma_xy_cm: series(line.sigma_xy_m),
    sigma_z_cm: series(line.sigma_z_m),
    bridged: bridgedOf(target),
    height: heightOf(target, all, points),
  };
}

function bridgedOf({ line, runs }: LineAlong): [number, number][] {
  return line.bridged.flatMap(([first, last]) => {
    const inside = runs.flat().filter((place) => isWithin(place, first, last)).map(({ s }) => s);
    return inside.length > 0 ? [[Math.min(...inside), Math.max(...inside)] as [number, number]] : [];
  });
}

function isWithin({ vertex, after }: LinePlace, first: number, last: number): boolean {
  return vertex === null ? after >= first && after < last : vertex >= first && vertex <= last;
}

function heightOf(target: LineAlong, all: readonly LineAlong[], points: Points | null): Measures["height"] {
  const { kind } = target.line;
  const stations = stationsOf(target);
  if (kind === "kerb_top" || kind === "road_boundary") {
    const partners = all.filter(({ line }) => line.kind === (kind === "kerb_top" ? "road_boundary" : "kerb_top"));
    const values = stations.flatMap(([s, here]): Series => {
      const beside = partners.map((other) => lineAt(other, s)).filter((at) => at !== null && Math.abs(at.o - here.o) < BESIDE_M);
      const [z] = beside.map((at) => at!.z);
      return z === undefined ? [] : [[s, kind === "kerb_top" ? here.z - z : z - here.z]];
    });
    if (values.length > 0) return { title: "Kerb", values };
  }
  const road = roadHeights(points);
  const values = stations.flatMap(([s, { z }]): Series => {
    const ground = road.get(Math.round(s / STEP_M));
    return ground === undefined ? [] : [[s, z - ground]];
  });
  return { title: kind === "cable" ? "Clearance" : "Above road", values };
}

function stationsOf(target: LineAlong): [number, { o: number; z: number }][] {
  const places = target.runs.flat().map(({ s }) => s);
  const found: [number, { o: number; z: number }][] = [];
  for (let i = Math.ceil(Math.min(...places) / STEP_M); i * STEP_M <= Math.max(...places); i++) {
    const at = lineAt(target, i * STEP_M);
    if (at) found.push([i * STEP_M, at]);
  }
  return found;
}

// Height of the road by station, the median of the points that know their height above it
export function roadHeights(points: Points | null): Map<number, number> {
  const heights = new Map<number, number[]>();
  for (let i = 0; points && i < points.n; i++) {
    const above_cm = points.above_cm[i]!;
    if (!isAboveKnown(above_cm)) continue;
    const station = Math.round((points.origin[0] + points.xyz[3 * i]!) / STEP_M);
    const z = points.origin[2] + points.xyz[3 * i + 2]! - above_cm / 100;
    const same = heights.get(station);
    if (same) same.push(z);
    else heights.set(station, [z]);
  }
  return new Map([...heights].map(([station, all]) => [station, all.sort((a, b) => a - b)[all.length >> 1]!]));
}
