// The images along a stretch: a thumbnail of every pair that looks at it, where it looks.

import * as api from "../app/api";
import type { App } from "../app/app";
import type { Pair } from "../app/documents";
import { element } from "../controls/element";
import { roadAhead } from "../stereo/drive";
import type { Axis } from "./axis";
import { LEFT_PX, type Strips } from "./strips";

const THUMB_PX = 96; // width of a thumbnail, at least
const REACH_M = 20; // of an image beside the axis

export class ImageStrip {
  readonly element = element("div", { class: "image-strip", role: "group", "aria-label": "Images along the stretch" });
  private pairs: Promise<Pair[]> | null = null;
  private latest = 0;

  constructor(private readonly app: App) {
    this.element.hidden = app.survey.n_pairs === 0;
  }

  async show(axis: Axis, strips: Strips): Promise<void> {
    if (this.element.hidden) return;
    const request = (this.latest += 1);
    this.pairs ??= api.pairs();
    const pairs = await this.pairs.catch((error: unknown) => {
      this.pairs = null;
      this.app.reportProblem(error);
      return [];
    });
    if (request !== this.latest) return;
    let free_px = LEFT_PX;
    const shown = pairs
      .flatMap((pair) => {
        const at = axis.straightened(roadAhead(pair), REACH_M);
        return at && at.s >= strips.from_m && at.s <= strips.to_m ? [{ pair, s: at.s }] : [];
      })
      .sort((a, b) => a.s - b.s)
      .flatMap(({ pair, s }) => {
        const left = Math.max(LEFT_PX, strips.x(s) - THUMB_PX / 2);
        if (left < free_px || left + THUMB_PX > strips.width) return [];
        free_px = left + THUMB_PX + 2;
        return [this.thumbnail(pair, left)];
      });
    this.element.replaceChildren(...(shown.length > 0 ? shown : [element("p", { class: "empty" }, "No image looks at this stretch.")]));
    this.element.dataset["images"] = String(shown.length);
  }

  private thumbnail(pair: Pair, left_px: number): HTMLElement {
    const title = `Show pair ${pair.number}, ${pair.chainage_m.toFixed(1)} m along the drive`;
    const made = element("button", {
      type: "button", title, "aria-label": title, "data-pair": pair.number, click: () => {
        this.app.emit("pair", pair.number);
        this.app.emit("look", { at: roadAhead(pair), by: "straightened" });
      },
    }, element("img", { src: api.thumbnailUrl(pair.number), alt: "", width: THUMB_PX, draggable: "false" }));
    made.style.left = `${left_px}px`;
    return made;
  }
}
