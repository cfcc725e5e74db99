// Where lines cross a section, and what can be read there.

import type { Points } from "../app/api";
import { aboveKnown } from "../controls/colours";
import type { Line, Place, Vertex } from "../app/documents";

// A vertical plane through `at`, across `heading_deg`: x to the right of the heading, y along it, z up
export interface Plane {
  at: Place;
  heading_deg: number;
}

export interface SectionNode {
  line: Line;
  after: number; // vertex before the section
  vertex: number | null; // the vertex that is moved; null: there is none here, one is inserted
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

// `near_m`: a vertex so near the section is what a person means to move
export function nodesIn(plane: Plane, lines: Iterable<Line>, half_width_m: number, near_m: number): SectionNode[] {
  const nodes: SectionNode[] = [];
  for (const line of lines) {
    if (line.review === "rejected") continue;
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

// Height of the road under a place of the slice: what the points nearest to it across say; null: none knows
export function roadAt(points: Points, x: number): number | null {
  const near: [distance: number, z: number][] = [];
  for (let i = 0; i < points.n; i++) {
    const above_cm = points.above_cm[i]!;
    if (!aboveKnown(above_cm)) continue;
    const distance = Math.abs(points.xyz[3 * i]! - x);
    if (distance < 1) near.push([distance, points.xyz[3 * i + 2]! - above_cm / 100]);
  }
  if (near.length === 0) return null;
  const nearest = near.sort((a, b) => a[0] - b[0]).slice(0, 31).map(([, z]) => z);
  return points.origin[2] + nearest.sort((a, b) => a - b)[nearest.length >> 1]!;
}

// The point of the slice that looks nearest to a place, where `far` measures how it looks
export function pointAt(
  points: Points, far: (x: number, z: number) => number, most: number,
): { x: number; z: number } | null {
  let best: { x: number; z: number } | null = null;
  let least = most;
  for (let i = 0; i < points.n; i++) {
    const [x, z] = [points.xyz[3 * i]!, points.origin[2] + points.xyz[3 * i + 2]!];
    const distance = far(x, z);
    if (distance <= least) [best, least] = [{ x, z }, distance];
  }
  return best;
}

export interface Reading {
  id: string;
  kind: string;
  offset_m: number;
  above_m: number | null;
  words: string; // "kerb 0.12 m", "rail 0.75 m": heights that a surveyor asks for
}

export function readingsOf(nodes: readonly SectionNode[], points: Points | null): Reading[] {
  return nodes
    .map((node) => {
      const road = points && roadAt(points, node.x);
      const above_m = road === null ? null : node.z - road;
      return { id: node.line.id, kind: node.line.kind, offset_m: node.x, above_m, words: wordsOf(node, nodes, above_m) };
    })
    .sort((a, b) => a.offset_m - b.offset_m);
}

function wordsOf(node: SectionNode, nodes: readonly SectionNode[], above_m: number | null): string {
  if (node.line.kind === "kerb_top") {
    const feet = nodes.filter((other) => other.line.kind === "road_boundary" && Math.abs(other.x - node.x) < 0.6);
    const foot = feet.sort((a, b) => Math.abs(a.x - node.x) - Math.abs(b.x - node.x))[0];
    return foot ? `kerb ${(node.z - foot.z).toFixed(3)} m` : "";
  }
  if (above_m === null) return "";
  if (["guardrail", "barrier", "fence"].includes(node.line.kind)) return `rail ${above_m.toFixed(2)} m`;
  return node.line.kind === "cable" ? `clearance ${above_m.toFixed(2)} m` : "";
}
