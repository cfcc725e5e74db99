// Dragging in a section: moves a node of a line, or pans.

import type { Points } from "../app/api";
import type { Frame } from "./rendering";
import { inWorld, type Plane, pointAt, type SectionNode } from "./nodes";
import { roadAt } from "./readings";
import type { Edit } from "../app/documents";

const GRAB_PX = 12;
const MOVED_M = 0.001; // a shorter drag is a click

export type DraggedNode = SectionNode & { from: SectionNode };

// `hand`: where the pointer is, in the window, which stays where it is when the section is laid out anew under it; `free`:
// where the node would be without snapping
type Drag =
  | { what: "node"; node: SectionNode; x: number; z: number; free: [number, number]; hand: [number, number] }
  | { what: "pan"; hand: [number, number]; centre: [number, number] };

export class SectionDrag {
  private drag: Drag | null = null;

  // The dragged node at its present position; `from` is where it was
  get node(): DraggedNode | null {
    if (this.drag?.what !== "node") return null;
    const { node, x, z } = this.drag;
    return { ...node, x, z, from: node };
  }

  press(node: SectionNode | null, centre: [number, number], hand: [number, number]): void {
    this.drag = node ? { what: "node", node, x: node.x, z: node.z, free: [node.x, node.z], hand } : { what: "pan", hand, centre };
  }

  // Returns the new centre when panning. With `snaps`, a node snaps to the nearest point.
  move(frame: Frame, hand: [number, number], points: Points | null, snaps: boolean): [number, number] | null {
    const { drag } = this;
    if (!drag) return null;
    // Step by step, as the scale may change between two: by the wheel, or where the section becomes narrower
    const [right_px, down_px] = [hand[0] - drag.hand[0], hand[1] - drag.hand[1]];
    const [right_m, up_m] = [right_px / frame.scale, -down_px / (frame.scale * frame.exaggeration)];
    drag.hand = hand;
    if (drag.what === "pan") return (drag.centre = [drag.centre[0] - right_m, drag.centre[1] - up_m]);
    drag.free = [drag.free[0] + right_m, drag.free[1] + up_m];
    const [x, z] = drag.free;
    const [px, py] = frame.toPx(x, z);
    const distance = (x: number, z: number): number => {
      const [x1, y1] = frame.toPx(x, z);
      return Math.hypot(x1 - px, y1 - py);
    };
    const point = snaps && points ? pointAt(points, distance, 2 * GRAB_PX) : null;
    Object.assign(drag, point ?? { x, z });
    return null;
  }

  // Puts the dragged node onto an edge
  put(x: number, z: number): void {
    if (this.drag?.what === "node") Object.assign(this.drag, { x, z });
  }

  get isActive(): boolean {
    return this.drag !== null;
  }

  end(): void {
    this.drag = null;
  }

  readout(points: Points | null, title: (kind: string) => string): string {
    const { node } = this;
    if (!node) return "";
    const road = points && roadAt(points, node.x);
    const above = road === null ? "" : `, ${signed(node.z - road)} m from the road`;
    const moved = `moved ${signed(node.x - node.from.x)} m across, ${signed(node.z - node.from.z)} m up`;
    return `${title(node.line.kind)}: offset ${signed(node.x)} m${above}; ${moved}`;
  }
}

// The edit that the drag of a node amounts to; null: it was a click
export function editOf(node: DraggedNode, plane: Plane): Edit | null {
  if (Math.hypot(node.x - node.from.x, node.z - node.from.z) < MOVED_M) return null;
  const to: [number, number, number] = [...inWorld(plane, node.x, node.y), node.z];
  const { id } = node.line;
  return node.vertex === null
    ? { action: "insert", id, after: node.after, to }
    : { action: "move", id, vertex: node.vertex, to };
}

// The node within reach of a pixel; of nodes in one place, the one of line `preferred`
export function nodeAt(
  frame: Frame, nodes: readonly SectionNode[], [px, py]: [number, number], preferred: string,
): SectionNode | null {
  const distance = (node: SectionNode): number => {
    const [x, y] = frame.toPx(node.x, node.z);
    return Math.hypot(x - px, y - py) - (node.line.id === preferred ? 2 : 0);
  };
  const nearest = [...nodes].sort((a, b) => distance(a) - distance(b))[0];
  return nearest && distance(nearest) <= GRAB_PX ? nearest : null;
}

export const sameNode = (a: SectionNode, b: SectionNode): boolean =>
  a.line.id === b.line.id && a.after === b.after && a.vertex === b.vertex;

// What rounds to nothing has no minus
const signed = (value: number): string => `${value <= -0.0005 ? "−" : "+"}${Math.abs(value).toFixed(3)}`;
