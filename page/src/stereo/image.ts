// One image of a pair on a canvas, with its overlay. Coordinates are pixels of the raw (distorted) image.

import { nearestOnSegment } from "../app/geometry";
import { element } from "../controls/element";
import { CANVAS } from "../controls/colours";

export type Px = [number, number];

// The pixel at the centre of the canvas, and canvas pixels per image pixel; shared by both images of a pair
export interface Viewport {
  centre: Px;
  scale: number;
}

export interface Stroke {
  id: string;
  colour: string;
  runs: Px[][];
  bridged: boolean[];
  selected: boolean;
}

export interface Overlay {
  strokes: Stroke[];
  sighting: Px[]; // of the line being followed
  refused: Px | null; // a pick that was refused
  suggestion: Px | null; // where following would work
}

const NOTHING: Overlay = { strokes: [], sighting: [], refused: null, suggestion: null };
const PICK_RADIUS_PX = 7;

export class StereoImage {
  readonly canvas = element("canvas", { role: "img" });
  overlay: Overlay = NOTHING;
  private image: HTMLImageElement | null = null;

  constructor(readonly side: "left" | "right") {
    this.canvas.setAttribute("aria-label", `${side} image`);
    this.canvas.dataset["side"] = side;
  }

  take(image: HTMLImageElement): void {
    this.image = image;
    this.canvas.dataset["shown"] = image.src.split("/").slice(-2).join("/");
  }

  get size(): Px {
    return this.image ? [this.image.naturalWidth, this.image.naturalHeight] : [0, 0];
  }

  // The viewport that shows the whole image
  whole(): Viewport {
    const [width, height] = this.size;
    const { clientWidth, clientHeight } = this.canvas;
    const scale = Math.min(clientWidth / Math.max(1, width), clientHeight / Math.max(1, height));
    return { centre: [width / 2, height / 2], scale: scale > 0 ? scale : 1 };
  }

  // Integer coordinates are pixel centres, as everywhere with images
  pixelAt(event: MouseEvent, viewport: Viewport): Px {
    const box = this.canvas.getBoundingClientRect();
    return [
      viewport.centre[0] + (event.clientX - box.left - box.width / 2) / viewport.scale - 0.5,
      viewport.centre[1] + (event.clientY - box.top - box.height / 2) / viewport.scale - 0.5,
    ];
  }

  contains([x, y]: Px): boolean {
    const [width, height] = this.size;
    return x >= -0.5 && y >= -0.5 && x <= width - 0.5 && y <= height - 0.5;
  }

  // The line that is drawn under a pixel
  lineAt(pixel: Px, viewport: Viewport): string | null {
    let best: string | null = null;
    let least = PICK_RADIUS_PX / viewport.scale;
    for (const { id, runs } of this.overlay.strokes) {
      for (const run of runs) {
        for (let i = 1; i < run.length; i++) {
          const distance = nearestOnSegment(pixel, run[i - 1]!, run[i]!).distance;
          if (distance <= least) [best, least] = [id, distance];
        }
      }
    }
    return best;
  }

  draw(viewport: Viewport): void {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    const ratio = window.devicePixelRatio;
    this.canvas.width = Math.round(width * ratio);
    this.canvas.height = Math.round(height * ratio);
    const context = this.canvas.getContext("2d")!;
    context.scale(ratio, ratio);
    context.fillStyle = CANVAS.background;
    context.fillRect(0, 0, width, height);
    context.translate(width / 2, height / 2);
    context.scale(viewport.scale, viewport.scale);
    context.translate(-viewport.centre[0], -viewport.centre[1]);
    context.imageSmoothingEnabled = viewport.scale < 4; // show single pixels when zoomed in
    if (this.image) context.drawImage(this.image, 0, 0);
    context.translate(0.5, 0.5);
    for (const stroke of this.overlay.strokes) drawStroke(context, stroke, 1 / viewport.scale);
    this.drawMarks(context, 1 / viewport.scale);
  }

  private drawMarks(context: CanvasRenderingContext2D, px: number): void {
    const { sighting, refused, suggestion } = this.overlay;
    context.fillStyle = CANVAS.followed;
    for (const [x, y] of sighting) context.fillRect(x - 2 * px, y - 2 * px, 4 * px, 4 * px);
    context.lineWidth = 2 * px;
    if (suggestion) {
      context.strokeStyle = CANVAS.followed;
      context.beginPath();
      context.arc(...suggestion, 9 * px, 0, 2 * Math.PI);
      context.stroke();
    }
    if (refused) {
      const [x, y] = refused;
      context.strokeStyle = CANVAS.problem;
      context.beginPath();
      for (const sign of [1, -1]) {
        context.moveTo(x - 6 * px, y - 6 * px * sign);
        context.lineTo(x + 6 * px, y + 6 * px * sign);
      }
      context.stroke();
    }
  }
}

function drawStroke(context: CanvasRenderingContext2D, stroke: Stroke, px: number): void {
  stroke.runs.forEach((run, i) => {
    context.beginPath();
    run.forEach(([x, y], at) => (at === 0 ? context.moveTo(x, y) : context.lineTo(x, y)));
    context.setLineDash(stroke.bridged[i] ? [7 * px, 5 * px] : []);
    // A dark casing keeps the line visible on paint and sky
    context.lineWidth = (stroke.selected ? 6 : 3.5) * px;
    context.strokeStyle = stroke.selected ? CANVAS.selected : "rgb(0 0 0 / 45%)";
    context.stroke();
    context.lineWidth = (stroke.selected ? 3 : 2) * px;
    context.strokeStyle = stroke.colour;
    context.stroke();
  });
  context.setLineDash([]);
}
