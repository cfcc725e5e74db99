// Selecting lines on the map: by click, Shift-click or Shift-drag of a box.

import DragBox from "ol/interaction/DragBox";
import type OlMap from "ol/Map";
import { nearestOn } from "../app/geometry";
import type { App } from "../app/app";
import type { LineLayer } from "./line-layer";
import type { Place } from "../app/documents";
import { REJECTED } from "../app/filter";

const REACH_PX = 9;

export class Selecting {
  constructor(private readonly app: App, private readonly map: OlMap, private readonly lines: LineLayer) {
    const box = new DragBox({
      condition: ({ originalEvent }) => app.tool === "select" && originalEvent.shiftKey, className: "select-box",
    });
    box.on("boxend", () => this.box(box.getGeometry().getExtent(), box.getGeometry().getArea()));
    map.addInteraction(box);
    app.keyboard.bind({
      keys: ["Escape"], title: "Clear the selection", group: "Edit the selected line",
      when: () => app.selection.length > 0 && app.following.growth.state === "idle", run: () => app.select([]),
    });
    app.keyboard.bind({
      keys: ["Ctrl+a"], title: "Select all lines in view", group: "Edit the selected line",
      run: () => this.box(map.getView().calculateExtent(map.getSize()), Infinity),
    });
  }

  // The line nearest to a place, within reach of the mouse; a rejected line only if there is no other
  lineAt(place: Place): string | null {
    const reach_m = REACH_PX * (this.map.getView().getResolution() ?? 1);
    const [east, north] = place;
    let [best, least]: [string | null, number] = [null, Infinity];
    const around = [east - reach_m, north - reach_m, east + reach_m, north + reach_m];
    this.lines.source.forEachFeatureInExtent(around, (feature) => {
      const line = this.app.lines.get(String(feature.getId()));
      if (line === undefined || !this.lines.isShown(line)) return;
      const distance = nearestOn(line.xyz, place)?.distance_m ?? Infinity;
      const rank = distance + (line.review === REJECTED ? reach_m : 0);
      if (distance < reach_m && rank < least) [best, least] = [line.id, rank];
    });
    return best;
  }

  click(place: Place, extend: boolean): void {
    const id = this.lineAt(place);
    const known = this.app.selection;
    if (id === null) return extend ? undefined : this.app.select([]);
    if (!extend) this.app.select([id]);
    else this.app.select(known.includes(id) ? known.filter((one) => one !== id) : [...known, id]);
  }

  private box(extent: number[], area_m2: number): void {
    if (area_m2 === 0) return; // a Shift-click
    const ids = new Set(this.app.selection);
    this.lines.source.forEachFeatureIntersectingExtent(extent, (feature) => {
      const line = this.app.lines.get(String(feature.getId()));
      if (line && this.lines.isShown(line)) ids.add(line.id);
    });
    this.app.select([...ids]);
  }
}
