// The bar between the plan and the other views: dragged, or moved by the arrow keys.

import { element } from "../controls/element";

const NARROWEST_PX = 240;

export function splitter(work: HTMLElement): HTMLElement {
  const bar = element("div", {
    class: "splitter", role: "separator", tabindex: 0, "aria-orientation": "vertical", "aria-label": "Width of the views",
  });
  const set = (width_px: number) => {
    const most = work.clientWidth - 280 - NARROWEST_PX;
    work.style.setProperty("--views-width", `${Math.round(Math.min(Math.max(width_px, NARROWEST_PX), most))}px`);
  };
  const width = () => work.getBoundingClientRect().right - bar.getBoundingClientRect().right;
  bar.addEventListener("pointerdown", (event) => {
    bar.setPointerCapture(event.pointerId);
    bar.onpointermove = (move) => set(work.getBoundingClientRect().right - move.clientX);
  });
  bar.addEventListener("pointerup", () => (bar.onpointermove = null));
  bar.addEventListener("keydown", (event) => {
    const step = event.key === "ArrowLeft" ? 40 : event.key === "ArrowRight" ? -40 : 0;
    if (step !== 0) set(width() + step);
  });
  return bar;
}
