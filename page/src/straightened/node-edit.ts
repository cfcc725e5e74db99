// Moving a node in the straightened view, with the mouse or the arrow keys: in plan across and along, in the strip of
// heights up and down. The edit goes to the line in world coordinates.

import type { Edit, Line } from "../app/documents";
import type { Axis } from "./axis";
import type { LineAlong, LinePlace } from "./lines-along";
import type { Strip, Strips } from "./strips";

const GRAB_PX = 10;
const MOVED_M = 0.001; // a shorter move is a click

export class NodeEdit {
  private constructor(
    readonly line: Line, readonly from: LinePlace, readonly strip: "plan" | "heights", private grip: [number, number],
    public now: LinePlace,
  ) {}

  // The node under the mouse; with `inserts`, also a place between nodes, where one is inserted
  static under(
    strips: Strips, strip: Strip, { line, nodes, runs }: LineAlong, [px, py]: [number, number], reference: (s: number) => number,
    inserts: boolean,
  ): NodeEdit | null {
    if (strip.name !== "plan" && strip.name !== "heights") return null;
    const name = strip.name;
    const at = (place: LinePlace): [number, number] => [strips.x(place.s), strips.y(strip, valueOf(name, place, reference))];
    const apart = (place: LinePlace): number => Math.hypot(at(place)[0] - px, at(place)[1] - py);
    const node = [...nodes].sort((a, b) => apart(a) - apart(b))[0];
    if (node && apart(node) <= GRAB_PX) return new NodeEdit(line, node, name, [at(node)[0] - px, at(node)[1] - py], node);
    if (!inserts) return null;
    for (const run of runs)
      for (let i = 1; i < run.length; i++) {
        const [a, b] = [run[i - 1]!, run[i]!];
        const share = (strips.chainage(px) - a.s) / (b.s - a.s);
        if (!(share >= 0 && share <= 1)) continue;
        const mix = (key: "s" | "o" | "z"): number => a[key] + share * (b[key] - a[key]);
        const place: LinePlace = { s: mix("s"), o: mix("o"), z: mix("z"), vertex: null, after: a.vertex ?? a.after };
        if (apart(place) <= GRAB_PX) return new NodeEdit(line, place, name, [at(place)[0] - px, at(place)[1] - py], place);
      }
    return null;
  }

  // A node to be moved by keys
  static of(line: Line, node: LinePlace, strip: "plan" | "heights"): NodeEdit {
    return new NodeEdit(line, node, strip, [0, 0], node);
  }

  move(strips: Strips, strip: Strip, [px, py]: [number, number], reference: (s: number) => number): void {
    const [x, y] = [px + this.grip[0], py + this.grip[1]];
    const value = strips.value(strip, y);
    if (this.strip === "heights") this.now = { ...this.now, z: value + reference(this.now.s) };
    else this.now = { ...this.now, s: strips.chainage(x), o: -value };
  }

  nudge(by: Partial<Record<"s" | "o" | "z", number>>): void {
    const { now } = this;
    this.now = { ...now, s: now.s + (by.s ?? 0), o: now.o + (by.o ?? 0), z: now.z + (by.z ?? 0) };
  }

  // null: it was not moved. In plan the height is measured anew, unless it was moved by keys too
  edit(axis: Axis): Edit | null {
    const { from, now, line } = this;
    if (Math.hypot(now.s - from.s, now.o - from.o, now.z - from.z) < MOVED_M) return null;
    const [east, north] = this.strip === "heights" && from.vertex !== null && now.s === from.s && now.o === from.o
      ? line.xyz[from.vertex]! // to the last digit where it was
      : axis.inWorld(now);
    const to: [number, number] | [number, number, number] = now.z === from.z ? [east, north] : [east, north, now.z];
    return from.vertex === null
      ? { action: "insert", id: line.id, after: from.after, to }
      : { action: "move", id: line.id, vertex: from.vertex, to };
  }

  get text(): string {
    const { from, now } = this;
    const parts = [[now.s - from.s, "along"], [now.o - from.o, "to the right"], [now.z - from.z, "up"]] as const;
    return parts.filter(([by]) => Math.abs(by) >= 0.0005).map(([by, way]) => `${by < 0 ? "−" : "+"}${Math.abs(by).toFixed(3)} m ${way}`).join(", ");
  }
}

export function valueOf(strip: "plan" | "heights", { s, o, z }: LinePlace, reference: (s: number) => number): number {
  return strip === "plan" ? -o : z - reference(s);
}
