// Dragging in a section: a node of a line, or what is in sight.

import type { Points } from "../app/api";
import type { Frame } from "./drawing";
import { inWorld, type Plane, pointAt, roadAt, type SectionNode } from "./nodes";
import type { Edit } from "../app/documents";

const GRAB_PX = 12;
// Less is a click
const MOVED_M = 0.001;

type Drag =
  | { what: "node"; node: SectionNode; x: number; z: number; grip: [number, number] }
  | { what: "sight"; px: number; py: number; centre: [number, number] };

export class SectionDrag {
  private drag: Drag | null = null;

  // The node that is dragged, where it is now
  get node(): (SectionNode & { from: SectionNode }) | null {
    if (this.drag?.what !== "node") return null;
    const { node, x, z } = this.drag;
    return { ...node, x, z, from: node };
  }

  press(frame: Frame, nodes: readonly SectionNode[], [px, py]: [number, number], first: string): void {
    const node = nodeAt(frame, nodes, [px, py], first);
    if (node) {
      const [x, z] = frame.fromPx(px, py);
      this.drag = { what: "node", node, x: node.x, z: node.z, grip: [node.x - x, node.z - z] };
    } else this.drag = { what: "sight", px, py, centre: [frame.x0, frame.z0] };
  }

  // Returns the new middle of the sight, if that is what is dragged. With `snaps` a node goes to the nearest point.
  move(frame: Frame, [px, py]: [number, number], points: Points | null, snaps: boolean): [number, number] | null {
    const { drag } = this;
    if (drag?.what === "sight") {
      return [drag.centre[0] - (px - drag.px) / frame.scale, drag.centre[1] + (py - drag.py) / (frame.scale * frame.tall)];
    }
    if (!drag) return null;
    const far = (x: number, z: number): number => {
      const [x1, y1] = frame.toPx(x, z);
      return Math.hypot(x1 - px, y1 - py);
    };
    const point = snaps && points ? pointAt(points, far, 2 * GRAB_PX) : null;
    const [x, z] = frame.fromPx(px, py);
    Object.assign(drag, point ?? { x: x + drag.grip[0], z: z + drag.grip[1] });
    return null;
  }

  get is(): boolean {
    return this.drag !== null;
  }

  end(): void {
    this.drag = null;
  }

  // What the drag of a node means; null: it was a click
  edit(plane: Plane): Edit | null {
    const { node } = this;
    if (!node || Math.hypot(node.x - node.from.x, node.z - node.from.z) < MOVED_M) return null;
    const to: [number, number, number] = [...inWorld(plane, node.x, node.y), node.z];
    const { id } = node.line;
    return node.vertex === null
      ? { action: "insert", id, after: node.after, to }
      : { action: "move", id, vertex: node.vertex, to };
  }

  words(points: Points | null, title: (kind: string) => string): string {
    const { node } = this;
    if (!node) return "";
    const road = points && roadAt(points, node.x);
    const above = road === null ? "" : `, ${(node.z - road).toFixed(3)} m above the road`;
    const moved = `moved ${signed(node.x - node.from.x)} m across, ${signed(node.z - node.from.z)} m up`;
    return `${title(node.line.kind)}: offset ${signed(node.x)} m${above}; ${moved}`;
  }
}

// The node that is grabbed at a pixel; `first`: of nodes at one place this line's is meant
export function nodeAt(
  frame: Frame, nodes: readonly SectionNode[], [px, py]: [number, number], first: string,
): SectionNode | null {
  const far = (node: SectionNode): number => {
    const [x, y] = frame.toPx(node.x, node.z);
    return Math.hypot(x - px, y - py) - (node.line.id === first ? 2 : 0);
  };
  const nearest = [...nodes].sort((a, b) => far(a) - far(b))[0];
  return nearest && far(nearest) <= GRAB_PX ? nearest : null;
}

export const sameNode = (a: SectionNode, b: SectionNode): boolean =>
  a.line.id === b.line.id && a.after === b.after && a.vertex === b.vertex;

const signed = (value: number): string => `${value < 0 ? "−" : "+"}${Math.abs(value).toFixed(3)}`;
