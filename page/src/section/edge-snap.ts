// Snapping a dragged node to the edge near it in the section, as the points show it, with a mark of what it is.

import * as api from "../app/api";
import type { Place } from "../app/documents";
import { LatestTask } from "../controls/visibility";
import { EDGE_TITLES } from "../editing/snapping";
import { inSection, inWorld, type Plane } from "./nodes";
import type { Frame } from "./rendering";

const REACH_M = 0.3;
const MARK_PX = 8;

interface Found { x: number; z: number; title: string }
interface Sought { kind: string; plane: Plane; x: number; answer?: Promise<Found | null> }

export class EdgeSnap {
  private readonly seeking = new LatestTask();
  private sought: Sought | null = null;
  private found: Found | null = null;

  // Looks for the edge near an offset of the plane; `taken` is called with it, unless another was asked for meanwhile
  seek(kind: string, plane: Plane, x: number, taken: (x: number, z: number) => void): void {
    const sought: Sought = { kind, plane, x };
    this.sought = sought;
    void this.seeking.run(async () => {
      if (sought !== this.sought) return;
      const found = await answerTo(sought);
      if (sought !== this.sought || !found) return;
      this.found = found;
      taken(found.x, found.z);
    });
  }

  // The edge near the offset that was last asked for: asked at once if it still waits. null: none is seen, or none was asked for
  async last(): Promise<Found | null> {
    return this.sought && answerTo(this.sought);
  }

  clear(): void {
    this.sought = null;
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

// The server is asked once
const answerTo = (sought: Sought): Promise<Found | null> => (sought.answer ??= ask(sought));

async function ask({ kind, plane, x }: Sought): Promise<Found | null> {
  const place: Place = inWorld(plane, x, 0);
  try {
    const { found } = await api.snap(kind, place, REACH_M, plane.heading_deg);
    return found && { x: inSection(plane, found.at)[0], z: found.up, title: EDGE_TITLES[found.edge] };
  } catch {
    return null; // dragging goes on without
  }
}
