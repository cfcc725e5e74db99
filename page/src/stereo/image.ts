// One image of a pair on a canvas, with what is drawn over it. All places are pixels of the image as it was taken.

import { element } from "../controls/element";
import { INK } from "../controls/colours";

export type Px = [number, number];

// Which pixel is in the middle, and how large a pixel is; both images of a pair share one
export interface Sight {
  centre: Px;
  scale: number;
}

export interface Stroke {
  id: string;
  colour: string;
  runs: Px[][];
  bridged: boolean[];
  chosen: boolean;
}

export interface Overlay {
  strokes: Stroke[];
  seen: Px[];
  refused: Px | null; // where it does not work
  works: Px | null; // where it would
}

const NOTHING: Overlay = { strokes: [], seen: [], refused: null, works: null };
const NEAR_PX = 7;

export class StereoImage {
  readonly canvas = element("canvas");
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

  // The sight in which the whole image is seen
  whole(): Sight {
    const [width, height] = this.size;
    const { clientWidth, clientHeight } = this.canvas;
    const scale = Math.min(clientWidth / Math.max(1, width), clientHeight / Math.max(1, height));
    return { centre: [width / 2, height / 2], scale: scale > 0 ? scale : 1 };
  }

  // Integer pixels are the middles of pixels, as everywhere with images
  pixelAt(event: MouseEvent, sight: Sight): Px {
    const box = this.canvas.getBoundingClientRect();
    return [
      sight.centre[0] + (event.clientX - box.left - box.width / 2) / sight.scale - 0.5,
      sight.centre[1] + (event.clientY - box.top - box.height / 2) / sight.scale - 0.5,
    ];
  }

  holds([x, y]: Px): boolean {
    const [width, height] = this.size;
    return x >= -0.5 && y >= -0.5 && x <= width - 0.5 && y <= height - 0.5;
  }

  // The line that is drawn under a pixel
  lineAt(pixel: Px, sight: Sight): string | null {
    let best: string | null = null;
    let least = NEAR_PX / sight.scale;
    for (const { id, runs } of this.overlay.strokes) {
      for (const run of runs) {
        for (let i = 1; i < run.length; i++) {
          const distance = fromSegment(pixel, run[i - 1]!, run[i]!);
          if (distance <= least) [best, least] = [id, distance];
        }
      }
    }
    return best;
  }

  draw(sight: Sight): void {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    const ratio = window.devicePixelRatio;
    this.canvas.width = Math.round(width * ratio);
    this.canvas.height = Math.round(height * ratio);
    const context = this.canvas.getContext("2d")!;
    context.scale(ratio, ratio);
    context.fillStyle = INK.canvas;
    context.fillRect(0, 0, width, height);
    context.translate(width / 2, height / 2);
    context.scale(sight.scale, sight.scale);
    context.translate(-sight.centre[0], -sight.centre[1]);
    context.imageSmoothingEnabled = sight.scale < 4; // pixels are told apart when they are large
    if (this.image) context.drawImage(this.image, 0, 0);
    context.translate(0.5, 0.5);
    for (const stroke of this.overlay.strokes) drawStroke(context, stroke, 1 / sight.scale);
    this.drawMarks(context, 1 / sight.scale);
  }

  private drawMarks(context: CanvasRenderingContext2D, px: number): void {
    const { seen, refused, works } = this.overlay;
    context.fillStyle = INK.seen;
    for (const [x, y] of seen) context.fillRect(x - 2 * px, y - 2 * px, 4 * px, 4 * px);
    context.lineWidth = 2 * px;
    if (works) {
      context.strokeStyle = INK.seen;
      context.beginPath();
      context.arc(...works, 9 * px, 0, 2 * Math.PI);
      context.stroke();
    }
    if (refused) {
      const [x, y] = refused;
      context.strokeStyle = INK.problem;
      context.beginPath();
      for (const way of [1, -1]) {
        context.moveTo(x - 6 * px, y - 6 * px * way);
        context.lineTo(x + 6 * px, y + 6 * px * way);
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
    // A dark edge keeps the line readable on paint and on sky
    context.lineWidth = (stroke.chosen ? 6 : 3.5) * px;
    context.strokeStyle = stroke.chosen ? INK.chosen : "rgb(0 0 0 / 45%)";
    context.stroke();
    context.lineWidth = (stroke.chosen ? 3 : 2) * px;
    context.strokeStyle = stroke.colour;
    context.stroke();
  });
  context.setLineDash([]);
}

function fromSegment([x, y]: Px, a: Px, b: Px): number {
  const [dx, dy] = [b[0] - a[0], b[1] - a[1]];
  const squared = dx * dx + dy * dy;
  const share = squared > 0 ? Math.min(1, Math.max(0, ((x - a[0]) * dx + (y - a[1]) * dy) / squared)) : 0;
  return Math.hypot(a[0] + share * dx - x, a[1] + share * dy - y);
}
