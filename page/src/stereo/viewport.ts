// Panning and zooming both images together, and telling clicks from drags.

import type { Px, StereoImage, Viewport } from "./image";

const CLICK_PX = 4;
const MAX_SCALE = 16; // canvas pixels per image pixel
const ZOOM_STEP = 1.25; // per notch of the wheel

export class SharedViewport {
  private chosen: Viewport | null = null; // null: the whole image
  private drag: { px: Px; viewport: Viewport; moved: boolean } | null = null;

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

  get current(): Viewport {
    return this.chosen ?? this.images[0].whole();
  }

  show(viewport: Viewport | null): void {
    this.chosen = viewport;
    this.changed();
  }

  private press(event: PointerEvent, image: StereoImage): void {
    this.drag = { px: [event.clientX, event.clientY], viewport: this.current, moved: false };
    image.canvas.setPointerCapture(event.pointerId);
  }

  private move(event: PointerEvent): void {
    if (!this.drag) return;
    const { px, viewport } = this.drag;
    const [dx, dy] = [event.clientX - px[0], event.clientY - px[1]];
    if (!this.drag.moved && Math.hypot(dx, dy) < CLICK_PX) return;
    this.drag.moved = true;
    this.show({ scale: viewport.scale, centre: [viewport.centre[0] - dx / viewport.scale, viewport.centre[1] - dy / viewport.scale] });
  }

  private release(event: PointerEvent, image: StereoImage): void {
    const { drag } = this;
    this.drag = null;
    if (drag && !drag.moved && event.button === 0) this.clicked(image.pixelAt(event, drag.viewport), image);
  }

  // The pixel under the mouse stays in place
  private wheel(event: WheelEvent, image: StereoImage): void {
    event.preventDefault();
    const before = this.current;
    const minScale = this.images[0].whole().scale;
    const scale = Math.min(MAX_SCALE, Math.max(minScale, before.scale * (event.deltaY > 0 ? 1 / ZOOM_STEP : ZOOM_STEP)));
    if (scale === minScale) return this.show(null);
    const [x, y] = image.pixelAt(event, before);
    const fixed = (pixel: number, centre: number): number => pixel + ((centre - pixel) * before.scale) / scale;
    this.show({ scale, centre: [fixed(x + 0.5, before.centre[0]), fixed(y + 0.5, before.centre[1])] });
  }
}
