// Snapping while drawing: the edge under the cursor, as the points show it, with a mark of what it is.

import Feature from "ol/Feature";
import Point from "ol/geom/Point";
import VectorLayer from "ol/layer/Vector";
import VectorSource from "ol/source/Vector";
import Fill from "ol/style/Fill";
import RegularShape from "ol/style/RegularShape";
import Stroke from "ol/style/Stroke";
import Style from "ol/style/Style";
import Text from "ol/style/Text";
import * as api from "../app/api";
import type { App } from "../app/app";
import type { Place, Snapped } from "../app/documents";
import { LatestTask } from "../controls/visibility";

const REACH_PX = 12; // how far off the edge a click may be on the screen
const REACH_M = { least: 0.1, most: 0.3 }; // a hand is no steadier, and edges farther away are others

export const EDGE_TITLES: Record<Snapped["edge"], string> = {
  foot: "foot of the kerb", top: "top of the kerb", break: "break of slope", shade: "change of brightness",
  stripe: "paint", rail: "rail", wire: "wire",
};

export class Snapping {
  readonly layer: VectorLayer;
  isOn = true;
  private readonly mark = new Feature<Point>();
  private readonly hovering = new LatestTask();
  private hides = 0;

  constructor(private readonly app: App, private readonly resolution: () => number) {
    this.layer = new VectorLayer({ source: new VectorSource({ features: [this.mark] }), updateWhileInteracting: true });
    app.keyboard.bind({ keys: ["Shift+e"], title: "Snap to edges while drawing: on or off (Alt and a click: not this once)", group: "Draw", run: () => this.toggle() });
    app.on("tool", (tool) => tool !== "draw" && this.hide());
  }

  // The edge near a place; null: none is seen, or nobody wants it
  private async find(place: Place, heading_deg: number | null): Promise<Snapped | null> {
    if (!this.isOn || this.app.survey.n_points === 0) return null;
    const reach = Math.min(REACH_M.most, Math.max(REACH_M.least, REACH_PX * this.resolution()));
    try {
      return (await api.snap(this.app.followKind, place, reach, heading_deg)).found;
    } catch {
      return null; // drawing goes on without
    }
  }

  // The edge that a click here would snap to is marked
  hover(place: Place, heading_deg: number | null): void {
    if (!this.isOn || this.app.followKind === "") return this.hide();
    const { hides } = this;
    void this.hovering.run(async () => void (hides === this.hides && (await this.marked(place, heading_deg))));
  }

  // The place on the edge that a click means, marked unless the mark was hidden meanwhile
  async marked(place: Place, heading_deg: number | null): Promise<Snapped | null> {
    const { hides } = this;
    const found = await this.find(place, heading_deg);
    if (hides === this.hides) this.show(found);
    return found;
  }

  // Answers that come later do not show it again
  hide(): void {
    this.hides += 1;
    this.show(null);
  }

  private show(found: Snapped | null): void {
    this.mark.setGeometry(found ? new Point(found.at) : undefined);
    if (found) this.mark.setStyle(styleOf(EDGE_TITLES[found.edge]));
    // For scripts and tests, and those who read the page by ear
    document.body.dataset.snap = found ? found.edge : "";
  }

  private toggle(): void {
    this.isOn = !this.isOn;
    this.hide();
    const text = this.isOn ? "Drawing snaps to edges: Alt and a click leaves one out." : "Drawing does not snap to edges.";
    this.app.emit("message", { text, kind: "info" });
  }
}

function styleOf(title: string): Style[] {
  const square = { points: 4, radius: 10, angle: Math.PI / 4 };
  return [
    new Style({ image: new RegularShape({ ...square, stroke: new Stroke({ color: "#000000", width: 4 }) }) }),
    new Style({
      image: new RegularShape({ ...square, stroke: new Stroke({ color: "#ffe14d", width: 2 }) }),
      text: new Text({
        text: title, offsetX: 14, offsetY: -14, textAlign: "left", font: "600 12px system-ui, sans-serif",
        fill: new Fill({ color: "#ffffff" }), stroke: new Stroke({ color: "#000000", width: 3 }),
      }),
    }),
  ];
}
