// The lines along an axis: their vertices and segments by chainage, offset and height.

import type { Line, Vertex } from "../app/documents";
import { REJECTED } from "../app/filter";
import type { Axis, Straightened } from "./axis";

// A place of a line along the axis; `vertex` is null between vertices, `after` the vertex before it
export interface LinePlace extends Straightened {
  z: number;
  vertex: number | null;
  after: number;
}

export interface LineAlong {
  line: Line;
  runs: LinePlace[][]; // its stretches near the axis
  nodes: LinePlace[]; // its vertices there
}

const STEP_M = 1; // places on long segments, which may lead past a bend of the axis

export function linesAlong(axis: Axis, lines: Iterable<Line>, within_m: number, shows: (line: Line) => boolean): LineAlong[] {
  const found: LineAlong[] = [];
  for (const line of lines) {
    if (line.review === REJECTED || !shows(line)) continue;
    const runs = runsOf(axis, line.xyz, within_m);
    if (runs.length > 0) found.push({ line, runs, nodes: runs.flat().filter(({ vertex }) => vertex !== null) });
  }
  return found;
}

function runsOf(axis: Axis, xyz: readonly Vertex[], within_m: number): LinePlace[][] {
  const runs: LinePlace[][] = [];
  let run: LinePlace[] | null = null;
  const add = (place: Straightened | null, z: number, vertex: number | null, after: number): void => {
    if (place === null) return void (run = null);
    if (run === null) runs.push((run = []));
    run.push({ ...place, z, vertex, after });
  };
  for (let i = 0; i < xyz.length; i++) {
    const [b, a] = [xyz[i]!, xyz[i - 1]];
    const length = a ? Math.hypot(b[0] - a[0], b[1] - a[1]) : 0;
    const n = a && mayBeNear(axis, a, b, within_m) ? Math.ceil(length / STEP_M) : 1;
    for (let k = 1; a && k < n; k++) {
      const at = (j: 0 | 1 | 2): number => a[j] + ((b[j] - a[j]) * k) / n;
      add(axis.straightened([at(0), at(1)], within_m), at(2), null, i - 1);
    }
    add(axis.straightened([b[0], b[1]], within_m), b[2], i, i);
  }
  return runs;
}

function mayBeNear(axis: Axis, a: Vertex, b: Vertex, within_m: number): boolean {
  const [west, south, east, north] = axis.box;
  return Math.max(a[0], b[0]) > west - within_m && Math.min(a[0], b[0]) < east + within_m
    && Math.max(a[1], b[1]) > south - within_m && Math.min(a[1], b[1]) < north + within_m;
}

// Offset and height of a line at a chainage, from the place before and the place after it; null where it is not
export function lineAt({ runs }: LineAlong, s: number): { o: number; z: number } | null {
  for (const run of runs) {
    for (let i = 1; i < run.length; i++) {
      const [a, b] = [run[i - 1]!, run[i]!];
      if (a.s > s === b.s > s || a.s === b.s) continue;
      const share = (s - a.s) / (b.s - a.s);
      return { o: a.o + share * (b.o - a.o), z: a.z + share * (b.z - a.z) };
    }
  }
  return null;
}
