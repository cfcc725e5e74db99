// Draws the strips of the straightened view one below the other, with one chainage axis: plan, heights, accuracy, height.

import type { Points } from "../app/api";
import { CANVAS, type Colouring, pointColour } from "../controls/colours";
import type { LineAlong, LinePlace } from "./lines-along";
import type { Measures, Series } from "./measures";

export const LEFT_PX = 46; // of the labels
const FOOT_PX = 18; // of the chainages
const GAP_PX = 5;
const STEPS = [0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50];

export type StripName = "plan" | "heights" | "accuracy" | "height";

// A strip from `top` to `bottom` pixels; `high` is at its top
export interface Strip {
  name: StripName;
  label: string;
  top: number;
  bottom: number;
  low: number;
  high: number;
}

// Maps chainages and a strip's values to pixels of the canvas
export class Strips {
  constructor(
    readonly width: number, readonly height: number, readonly from_m: number, readonly to_m: number,
    readonly all: readonly Strip[],
  ) {}

  get scale(): number {
    return (this.width - LEFT_PX) / (this.to_m - this.from_m);
  }

  x(s: number): number {
    return LEFT_PX + (s - this.from_m) * this.scale;
  }

  chainage(px: number): number {
    return this.from_m + (px - LEFT_PX) / this.scale;
  }

  y({ top, bottom, low, high }: Strip, value: number): number {
    return top + ((high - value) / (high - low)) * (bottom - top);
  }

  value({ top, bottom, low, high }: Strip, py: number): number {
    return high - ((py - top) / (bottom - top)) * (high - low);
  }

  at(py: number): Strip | null {
    return this.all.find(({ top, bottom }) => py >= top && py <= bottom) ?? null;
  }

  named(name: StripName): Strip | undefined {
    return this.all.find((strip) => strip.name === name);
  }
}

// Lays out strips by their shares of the height
export function laidOut(
  width: number, height: number, stretch: [number, number], wanted: readonly (Omit<Strip, "top" | "bottom"> & { share: number })[],
): Strips {
  const total = wanted.reduce((sum, { share }) => sum + share, 0);
  const free = Math.max(1, height - FOOT_PX - GAP_PX * wanted.length);
  let top = GAP_PX;
  const all = wanted.map(({ share, ...strip }) => {
    const bottom = top + (free * share) / total;
    const placed = { ...strip, top, bottom };
    top = bottom + GAP_PX;
    return placed;
  });
  return new Strips(width, height, ...stretch, all);
}

export interface Shown {
  points: Points | null;
  colouring: Colouring;
  heights: [number, number]; // of the survey, for colours
  reference: (s: number) => number; // height at 0 of the strip of heights
  inSlice: (s: number, o: number) => boolean; // points of the strip of heights
  lines: readonly { along: LineAlong; colour: string; selected: boolean }[];
  nodes: readonly LinePlace[]; // of the selected line, as drawn now
  active: number | null;
  measures: Measures | null;
  ends_m: [number, number]; // of the axis; it goes on straight beyond
  here_m: number | null; // where the other views look
}

export function drawStrips(context: CanvasRenderingContext2D, strips: Strips, shown: Shown): void {
  context.fillStyle = CANVAS.background;
  context.fillRect(0, 0, strips.width, strips.height);
  const clipped = (strip: Strip, draw: () => void): void => {
    context.save();
    context.beginPath();
    context.rect(LEFT_PX, strip.top, strips.width - LEFT_PX, strip.bottom - strip.top);
    context.clip();
    draw();
    context.restore();
  };
  for (const strip of strips.all) drawGrid(context, strips, strip);
  const [plan, heights] = [strips.named("plan"), strips.named("heights")];
  for (const strip of [plan, heights]) {
    if (!strip) continue;
    clipped(strip, () => {
      if (shown.points) drawPoints(context, strips, strip, shown);
      drawEnds(context, strips, strip, shown.ends_m);
      drawLines(context, strips, strip, shown);
    });
  }
  const { measures } = shown;
  const [accuracy, height] = [strips.named("accuracy"), strips.named("height")];
  if (measures && accuracy) clipped(accuracy, () => drawAccuracy(context, strips, accuracy, measures));
  if (measures && height) clipped(height, () => drawSeries(context, strips, height, measures.height.values, "#7fd4ff"));
  drawChainages(context, strips);
  if (shown.here_m !== null) vertical(context, strips.x(shown.here_m), 0, strips.height - FOOT_PX, "#ffb000");
  drawLabels(context, strips, measures);
}

const step = (pixels: number, least_px: number): number => STEPS.find((one) => one * pixels >= least_px) ?? 100;
const rounded = (value: number): string => String(Number(value.toFixed(2)) + 0);

function drawGrid(context: CanvasRenderingContext2D, strips: Strips, strip: Strip): void {
  context.strokeStyle = CANVAS.grid;
  context.strokeRect(LEFT_PX, strip.top, strips.width - LEFT_PX, strip.bottom - strip.top);
  context.font = "10px system-ui, sans-serif";
  context.fillStyle = CANVAS.text;
  context.textAlign = "right";
  const by = step((strip.bottom - strip.top) / (strip.high - strip.low), 22);
  for (let i = Math.ceil(strip.low / by); i <= strip.high / by; i++) {
    const py = Math.round(strips.y(strip, i * by)) + 0.5;
    line(context, [[LEFT_PX, py], [strips.width, py]], i === 0 ? CANVAS.axis : CANVAS.grid, 1);
    // In plan the left is up, and offsets are positive to the right, as in sections
    const value = strip.name === "plan" ? -i * by : i * by;
    if (py > strip.top + 4 && py < strip.bottom - 2) context.fillText(rounded(value), LEFT_PX - 4, py + 3);
  }
  context.textAlign = "left";
}

function drawChainages(context: CanvasRenderingContext2D, strips: Strips): void {
  const by = step(strips.scale, 55);
  context.font = "11px system-ui, sans-serif";
  context.fillStyle = CANVAS.text;
  for (let i = Math.ceil(strips.from_m / by); i <= strips.to_m / by; i++) {
    const px = strips.x(i * by);
    for (const { top, bottom } of strips.all) vertical(context, px, top, bottom, "rgb(255 255 255 / 8%)");
    context.fillText(`${rounded(i * by)} m`, px + 2, strips.height - 5);
  }
}

function drawLabels(context: CanvasRenderingContext2D, strips: Strips, measures: Measures | null): void {
  context.font = "11px system-ui, sans-serif";
  for (const strip of strips.all) {
    const text = strip.name === "accuracy" && measures ? `${strip.label}${accuracyText(measures)}` : strip.label;
    const width = context.measureText(text).width;
    context.fillStyle = "rgb(0 0 0 / 60%)";
    context.fillRect(LEFT_PX + 3, strip.top + 2, width + 6, 15);
    context.fillStyle = "#ffffff";
    context.fillText(text, LEFT_PX + 6, strip.top + 13);
  }
}

function accuracyText({ sigma_xy_cm, sigma_z_cm, bridged }: Measures): string {
  const unknown = sigma_xy_cm.length === 0 && sigma_z_cm.length === 0 ? ": unknown" : "";
  return bridged.length > 0 ? `${unknown}; hatched: bridged` : unknown;
}

function drawPoints(context: CanvasRenderingContext2D, strips: Strips, strip: Strip, shown: Shown): void {
  const { points, colouring, heights, reference, inSlice } = shown;
  if (!points) return;
  const isPlan = strip.name === "plan";
  const ratio = context.getTransform().a;
  const [left, top] = [Math.round(LEFT_PX * ratio), Math.round(strip.top * ratio)];
  const [width, height] = [Math.round((strips.width - LEFT_PX) * ratio), Math.round((strip.bottom - strip.top) * ratio)];
  if (width < 1 || height < 1) return;
  // Pixel by pixel: there are more points than a canvas fills rectangles in a frame
  const image = context.getImageData(left, top, width, height);
  const size = Math.max(1, Math.round((isPlan ? 1.5 : 2) * ratio));
  for (let i = 0; i < points.n; i++) {
    const [s, o] = [points.origin[0] + points.xyz[3 * i]!, points.xyz[3 * i + 1]!];
    if (!isPlan && !inSlice(s, o)) continue;
    const z = points.origin[2] + points.xyz[3 * i + 2]!;
    const px = Math.round((strips.x(s) - LEFT_PX) * ratio);
    const py = Math.round((strips.y(strip, isPlan ? -o : z - reference(s)) - strip.top) * ratio);
    const [red, green, blue] = pointColour(colouring, points.intensity[i]!, points.above_cm[i]!, z, heights);
    for (let x = px; x < px + size; x++)
      for (let y = py; y < py + size; y++) {
        if (x < 0 || y < 0 || x >= width || y >= height) continue;
        const k = 4 * (y * width + x);
        [image.data[k], image.data[k + 1], image.data[k + 2], image.data[k + 3]] = [red, green, blue, 255];
      }
  }
  context.putImageData(image, left, top);
}

function drawEnds(context: CanvasRenderingContext2D, strips: Strips, { top, bottom }: Strip, ends_m: [number, number]): void {
  context.fillStyle = "rgb(0 0 0 / 45%)";
  const [first, last] = [strips.x(ends_m[0]), strips.x(ends_m[1])];
  if (first > LEFT_PX) context.fillRect(LEFT_PX, top, first - LEFT_PX, bottom - top);
  if (last < strips.width) context.fillRect(last, top, strips.width - last, bottom - top);
}

function drawLines(context: CanvasRenderingContext2D, strips: Strips, strip: Strip, shown: Shown): void {
  const place = ({ s, o, z }: LinePlace): [number, number] =>
    [strips.x(s), strips.y(strip, strip.name === "plan" ? -o : z - shown.reference(s))];
  for (const { along, colour, selected } of [...shown.lines].sort((a, b) => Number(a.selected) - Number(b.selected)))
    for (const run of along.runs) line(context, run.map(place), colour, selected ? 2.5 : 1.5);
  for (const node of shown.nodes) {
    const [px, py] = place(node);
    context.beginPath();
    context.arc(px, py, node.vertex === shown.active ? 6 : 4, 0, 2 * Math.PI);
    context.fillStyle = node.vertex === shown.active ? "#ffb000" : "#ffffff";
    context.fill();
    context.lineWidth = 1.5;
    context.strokeStyle = "#16202c";
    context.stroke();
  }
}

function drawAccuracy(context: CanvasRenderingContext2D, strips: Strips, strip: Strip, measures: Measures): void {
  for (const [from, to] of measures.bridged) {
    const [left, right] = [strips.x(from), Math.max(strips.x(to), strips.x(from) + 3)];
    context.fillStyle = "rgb(255 107 96 / 25%)";
    context.fillRect(left, strip.top, right - left, strip.bottom - strip.top);
    for (let px = left; px < right; px += 6) line(context, [[px, strip.bottom], [Math.min(px + 8, right), strip.top]], CANVAS.problem, 1);
  }
  drawSeries(context, strips, strip, measures.sigma_xy_cm, "#ffd54a");
  drawSeries(context, strips, strip, measures.sigma_z_cm, "#c9a2ff", [4, 3]);
}

const FAR_M = 3; // values farther apart are not joined: nothing was measured between them

function drawSeries(
  context: CanvasRenderingContext2D, strips: Strips, strip: Strip, values: Series, colour: string, dash: number[] = [],
): void {
  let run: [number, number][] = [];
  let last = -Infinity;
  context.setLineDash(dash);
  for (const [s, value] of values) {
    if (s - last > FAR_M) {
      line(context, run, colour, 1.5);
      run = [];
    }
    run.push([strips.x(s), strips.y(strip, value)]);
    last = s;
  }
  line(context, run, colour, 1.5);
  context.setLineDash([]);
}

function line(context: CanvasRenderingContext2D, places: readonly [number, number][], colour: string, width: number): void {
  if (places.length === 0) return;
  context.strokeStyle = colour;
  context.lineWidth = width;
  context.beginPath();
  places.forEach(([px, py], i) => (i === 0 ? context.moveTo(px, py) : context.lineTo(px, py)));
  context.stroke();
}

function vertical(context: CanvasRenderingContext2D, px: number, top: number, bottom: number, colour: string): void {
  if (px >= LEFT_PX) line(context, [[Math.round(px) + 0.5, top], [Math.round(px) + 0.5, bottom]], colour, 1);
}
