// Snapping a dragged node to the edge near it in the section, as the points show it, with a mark of what it is.

import * as api from "../app/api";
import type { Place } from "../app/documents";
import { EDGE_TITLES } from "../editing/snapping";
import { inSection, inWorld, type Plane } from "./nodes";
import type { Frame } from "./rendering";

const REACH_M = 0.3;
const MARK_PX = 8;

export class EdgeSnap {
  private asked = 0;
  private pending: Promise<void> = Promise.resolve();
  private found: { x: number; z: number; title: string } | null = null;

  // Looks for the edge near an offset of the plane; `taken` is called with it, unless another was asked for meanwhile
  seek(kind: string, plane: Plane, x: number, taken: (x: number, z: number) => void): void {
    const number = ++this.asked;
    const place: Place = inWorld(plane, x, 0);
    this.pending = api.snap(kind, place, REACH_M, plane.heading_deg).then(
      ({ found }) => {
        if (number !== this.asked || !found) return;
        this.found = { x: inSection(plane, found.at)[0], z: found.up, title: EDGE_TITLES[found.edge] };
        taken(this.found.x, this.found.z);
      },
      () => undefined, // dragging goes on without
    );
  }

  // The answer to what was last asked for is there
  settled(): Promise<void> {
    return this.pending;
  }

  clear(): void {
    this.asked += 1;
    this.found = null;
  }

  draw(context: CanvasRenderingContext2D, frame: Frame): void {
    if (!this.found) return;
    const [px, py] = frame.toPx(this.found.x, this.found.z);
    for (const [colour, width] of [["#000000", 4], ["#ffe14d", 2]] as const) {
      [context.strokeStyle, context.lineWidth] = [colour, width];
      context.strokeRect(px - MARK_PX, py - MARK_PX, 2 * MARK_PX, 2 * MARK_PX);
    }
    context.font = "600 12px system-ui, sans-serif";
    [context.strokeStyle, context.lineWidth, context.fillStyle] = ["#000000", 3, "#ffffff"];
    context.strokeText(this.found.title, px + 14, py - 12);
    context.fillText(this.found.title, px + 14, py - 12);
  }

  get title(): string {
    return this.found?.title ?? "";
  }
}
