// What of the images is in sight: moved and zoomed in both together; and clicks, which are no drags.

import { type Px, type Sight, type StereoImage } from "./image";

const CLICK_PX = 4;
const MOST_SCALE = 16;
const STEP = 1.25;

export class SharedSight {
  private own: Sight | null = null; // null: the whole image
  private drag: { px: Px; sight: Sight; moved: boolean } | null = null;

  constructor(
    private readonly images: readonly [StereoImage, StereoImage],
    private readonly changed: () => void,
    private readonly clicked: (at: Px, image: StereoImage) => void,
  ) {
    for (const image of images) {
      const { canvas } = image;
      canvas.addEventListener("pointerdown", (event) => this.press(event, image));
      canvas.addEventListener("pointermove", (event) => this.move(event));
      canvas.addEventListener("pointerup", (event) => this.release(event, image));
      canvas.addEventListener("pointercancel", () => (this.drag = null));
      canvas.addEventListener("wheel", (event) => this.wheel(event, image), { passive: false });
    }
  }

  get now(): Sight {
    return this.own ?? this.images[0].whole();
  }

  look(sight: Sight | null): void {
    this.own = sight;
    this.changed();
  }

  private press(event: PointerEvent, image: StereoImage): void {
    this.drag = { px: [event.clientX, event.clientY], sight: this.now, moved: false };
    image.canvas.setPointerCapture(event.pointerId);
  }

  private move(event: PointerEvent): void {
    if (!this.drag) return;
    const { px, sight } = this.drag;
    const [dx, dy] = [event.clientX - px[0], event.clientY - px[1]];
    if (!this.drag.moved && Math.hypot(dx, dy) < CLICK_PX) return;
    this.drag.moved = true;
    this.look({ scale: sight.scale, centre: [sight.centre[0] - dx / sight.scale, sight.centre[1] - dy / sight.scale] });
  }

  private release(event: PointerEvent, image: StereoImage): void {
    const { drag } = this;
    this.drag = null;
    if (drag && !drag.moved && event.button === 0) this.clicked(image.pixelAt(event, drag.sight), image);
  }

  // What is under the mouse stays there
  private wheel(event: WheelEvent, image: StereoImage): void {
    event.preventDefault();
    const before = this.now;
    const least = this.images[0].whole().scale;
    const scale = Math.min(MOST_SCALE, Math.max(least, before.scale * (event.deltaY > 0 ? 1 / STEP : STEP)));
    if (scale === least) return this.look(null);
    const [x, y] = image.pixelAt(event, before);
    const kept = (pixel: number, centre: number): number => pixel + ((centre - pixel) * before.scale) / scale;
    this.look({ scale, centre: [kept(x + 0.5, before.centre[0]), kept(y + 0.5, before.centre[1])] });
  }
}
