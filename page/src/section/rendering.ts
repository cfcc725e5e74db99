// Draws a section: points, a grid in metres, and the nodes of lines.

import type { Points } from "../app/api";
import { type Colouring, CANVAS, pointColour } from "../controls/colours";
import type { SectionNode } from "./nodes";

// Where the station's height lies in the picture, as a share from the top: a road needs room above it, a cable on both sides
export const GROUND_SHARE = 0.75;
export const MIDDLE_SHARE = 0.5;

// Maps metres (x across, z up) to canvas pixels: (x0, z0) lies in the middle of the width and at share `down` of the height
export class Frame {
  constructor(
    readonly width: number, readonly height: number, readonly x0: number, readonly z0: number,
    readonly half_width_m: number, readonly exaggeration: number, readonly down: number,
  ) {}

  get scale(): number {
    return this.width / (2 * this.half_width_m);
  }

  toPx(x: number, z: number): [number, number] {
    return [this.width / 2 + (x - this.x0) * this.scale, this.height * this.down - (z - this.z0) * this.scale * this.exaggeration];
  }

  fromPx(px: number, py: number): [x: number, z: number] {
    return [
      this.x0 + (px - this.width / 2) / this.scale,
      this.z0 - (py - this.height * this.down) / (this.scale * this.exaggeration),
    ];
  }
}

export interface Handle {
  node: SectionNode;
  colour: string;
  selected: boolean;
}

const STEPS_M = [0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10];
const HANDLE_PX = 6;

export function drawSection(
  context: CanvasRenderingContext2D, frame: Frame, points: Points | null, colouring: Colouring,
  heights: [number, number], handles: readonly Handle[],
): void {
  context.fillStyle = CANVAS.background;
  context.fillRect(0, 0, frame.width, frame.height);
  drawGrid(context, frame);
  if (points) drawPoints(context, frame, points, colouring, heights);
  for (const handle of handles) drawHandle(context, frame, handle);
}

function gridStep(pixels: number): number {
  return STEPS_M.find((step) => step * pixels >= 50) ?? 20;
}

function drawGrid(context: CanvasRenderingContext2D, frame: Frame): void {
  const [left, top] = frame.fromPx(0, 0);
  const [right, bottom] = frame.fromPx(frame.width, frame.height);
  context.font = "11px system-ui, sans-serif";
  context.lineWidth = 1;
  const across = gridStep(frame.scale);
  for (let i = Math.ceil(left / across); i <= right / across; i++) {
    const px = Math.round(frame.toPx(i * across, 0)[0]) + 0.5;
    stroke(context, i === 0 ? CANVAS.axis : CANVAS.grid, px, 0, px, frame.height);
    label(context, `${round(i * across)}`, px + 3, frame.height - 5);
  }
  const up = gridStep(frame.scale * frame.exaggeration);
  for (let i = Math.ceil(bottom / up); i <= top / up; i++) {
    const py = Math.round(frame.toPx(0, i * up)[1]) + 0.5;
    stroke(context, CANVAS.grid, 0, py, frame.width, py);
    if (py < frame.height - 24) label(context, `${round(i * up)}`, 4, py - 3);
  }
}

const round = (value: number): string => String(Math.round(value * 100) / 100);

function label(context: CanvasRenderingContext2D, text: string, px: number, py: number): void {
  context.fillStyle = CANVAS.text;
  context.fillText(text, px, py);
}

function stroke(
  context: CanvasRenderingContext2D, colour: string, x0: number, y0: number, x1: number, y1: number,
): void {
  context.strokeStyle = colour;
  context.beginPath();
  context.moveTo(x0, y0);
  context.lineTo(x1, y1);
  context.stroke();
}

function drawPoints(
  context: CanvasRenderingContext2D, frame: Frame, points: Points, colouring: Colouring, heights: [number, number],
): void {
  // Setting the colour costs more than drawing, so points are drawn colour by colour
  const byColour = new Map<string, number[]>();
  for (let i = 0; i < points.n; i++) {
    const z = points.origin[2] + points.xyz[3 * i + 2]!;
    const rgb = pointColour(colouring, points.intensity[i]!, points.above_cm[i]!, z, heights);
    const colour = `rgb(${rgb.map((part) => Math.round(part / 16) * 16).join(" ")})`;
    const same = byColour.get(colour);
    if (same) same.push(i);
    else byColour.set(colour, [i]);
  }
  const size = points.n > 4000 ? 2 : 3;
  for (const [colour, some] of byColour) {
    context.fillStyle = colour;
    for (const i of some) {
      const [px, py] = frame.toPx(points.xyz[3 * i]!, points.origin[2] + points.xyz[3 * i + 2]!);
      context.fillRect(px - size / 2, py - size / 2, size, size);
    }
  }
}

function drawHandle(context: CanvasRenderingContext2D, frame: Frame, handle: Handle): void {
  const [px, py] = frame.toPx(handle.node.x, handle.node.z);
  context.beginPath();
  context.arc(px, py, handle.selected ? HANDLE_PX + 2 : HANDLE_PX, 0, 2 * Math.PI);
  context.lineWidth = 2;
  context.strokeStyle = handle.selected ? CANVAS.selected : "rgb(0 0 0 / 60%)";
  context.fillStyle = handle.colour;
  // Hollow where the line has no vertex: a drag inserts one
  if (handle.node.vertex !== null || handle.selected) context.fill();
  else context.strokeStyle = handle.colour;
  context.stroke();
}
