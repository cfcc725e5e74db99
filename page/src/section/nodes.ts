// Where lines cross a section, and the point nearest to a place in it.

import type { Points } from "../app/api";
import type { Line, Place, Vertex } from "../app/documents";
import { REJECTED } from "../app/filter";

// A vertical plane through `at`, perpendicular to `heading_deg`: x to the right of the heading, y along it, z up
export interface Plane {
  at: Place;
  heading_deg: number;
}

export interface SectionNode {
  line: Line;
  after: number; // vertex before the section
  vertex: number | null; // the vertex that a drag moves; null: none here, a drag inserts one
  x: number;
  y: number;
  z: number;
}

export function inSection(plane: Plane, place: Place | Vertex): [x: number, y: number] {
  const heading = (plane.heading_deg * Math.PI) / 180;
  const [de, dn] = [place[0] - plane.at[0], place[1] - plane.at[1]];
  const [sin, cos] = [Math.sin(heading), Math.cos(heading)];
  return [de * cos - dn * sin, de * sin + dn * cos];
}

export function inWorld(plane: Plane, x: number, y: number): Place {
  const heading = (plane.heading_deg * Math.PI) / 180;
  const [sin, cos] = [Math.sin(heading), Math.cos(heading)];
  return [plane.at[0] + x * cos + y * sin, plane.at[1] - x * sin + y * cos];
}

// A vertex within `near_m` of the plane counts as being in it
export function nodesIn(plane: Plane, lines: Iterable<Line>, half_width_m: number, near_m: number): SectionNode[] {
  const nodes: SectionNode[] = [];
  for (const line of lines) {
    if (line.review === REJECTED) continue;
    const places = line.xyz.map((vertex) => inSection(plane, vertex));
    const own: SectionNode[] = [];
    for (let i = 1; i < places.length; i++) {
      const [a, b] = [places[i - 1]!, places[i]!];
      if (a[1] > 0 === b[1] > 0) continue;
      const nearer = Math.abs(a[1]) <= Math.abs(b[1]) ? i - 1 : i;
      if (Math.abs(places[nearer]![1]) <= near_m) own.push(atVertex(line, nearer, places[nearer]!));
      else own.push(between(line, i, a, b));
    }
    for (const end of [0, places.length - 1]) {
      const here = places[end];
      if (here && Math.abs(here[1]) <= near_m && own.length === 0) own.push(atVertex(line, end, here));
    }
    nodes.push(...own.filter((node) => Math.abs(node.x) <= half_width_m));
  }
  return nodes;
}

function atVertex(line: Line, vertex: number, [x, y]: [number, number]): SectionNode {
  return { line, after: vertex, vertex, x, y, z: line.xyz[vertex]![2] };
}

function between(line: Line, i: number, a: [number, number], b: [number, number]): SectionNode {
  const share = a[1] / (a[1] - b[1]);
  const [low, high] = [line.xyz[i - 1]![2], line.xyz[i]![2]];
  return { line, after: i - 1, vertex: null, x: a[0] + share * (b[0] - a[0]), y: 0, z: low + share * (high - low) };
}

// The point of the slice nearest by `distanceTo` (on the screen), at most `limit` away
export function pointAt(
  points: Points, distanceTo: (x: number, z: number) => number, limit: number,
): { x: number; z: number } | null {
  let best: { x: number; z: number } | null = null;
  let least = limit;
  for (let i = 0; i < points.n; i++) {
    const [x, z] = [points.xyz[3 * i]!, points.origin[2] + points.xyz[3 * i + 2]!];
    const distance = distanceTo(x, z);
    if (distance <= least) [best, least] = [{ x, z }, distance];
  }
  return best;
}
