// The line being followed, on the map: the search area, the line so far, why it stopped at each end, a refusal.

import Feature from "ol/Feature";
import Point from "ol/geom/Point";
import Polygon from "ol/geom/Polygon";
import VectorLayer from "ol/layer/Vector";
import type OlMap from "ol/Map";
import VectorSource from "ol/source/Vector";
import CircleStyle from "ol/style/Circle";
import Fill from "ol/style/Fill";
import RegularShape from "ol/style/RegularShape";
import Stroke from "ol/style/Stroke";
import Style from "ol/style/Style";
import Text from "ol/style/Text";
import type { App } from "../app/app";
import type { Growth } from "../app/following";
import { geometriesOf } from "./line-layer";
import { faded, palette } from "./line-styles";
import type { Line, Place, Vertex } from "../app/documents";

const INSIDE = 0.7; // the growing end is kept within this share of the view

export class GrowthLayer {
  private readonly source = new VectorSource();
  readonly layer = new VectorLayer({ source: this.source, updateWhileInteracting: true, updateWhileAnimating: true });
  private ends: [Vertex | null, Vertex | null] = [null, null];

  constructor(private readonly app: App, private readonly map: OlMap) {
    app.on("growth", (growth) => this.show(growth));
  }

  private show(growth: Growth): void {
    const features: Feature[] = [];
    if (growth.area.length > 2) features.push(area(growth.area, growth.state === "refused"));
    for (const line of growth.lines) features.push(...this.lineOf(line, line === growth.lines[0]));
    const first = growth.lines[0];
    if (first) features.push(...endsOf(first, growth));
    if (growth.at && !first) features.push(mark(growth.at, growth.state === "refused"));
    if (growth.refusal?.works) features.push(suggestion(growth.refusal.works));
    this.source.clear(true);
    this.source.addFeatures(features);
    if (growth.state === "growing" && first) this.follow(first);
    if (growth.state === "idle") this.ends = [null, null];
  }

  // Moves the view with the growing end
  private follow(line: Line): void {
    const ends: [Vertex | null, Vertex | null] = [line.xyz[0] ?? null, line.xyz.at(-1) ?? null];
    const moved = ([0, 1] as const).filter((i) => String(ends[i]) !== String(this.ends[i]));
    this.ends = ends;
    const tip = ends[moved.includes(1) ? 1 : 0];
    const view = this.map.getView();
    const size = this.map.getSize();
    if (tip === null || moved.length === 0 || size === undefined || view.getInteracting()) return;
    const box = view.calculateExtent([(size[0] ?? 0) * INSIDE, (size[1] ?? 0) * INSIDE]);
    const [west = 0, south = 0, east = 0, north = 0] = box;
    if (tip[0] < west || tip[0] > east || tip[1] < south || tip[1] > north) view.setCenter([tip[0], tip[1]]);
  }

  private lineOf(line: Line, isFirst: boolean): Feature[] {
    const { measured, bridged } = geometriesOf(line);
    const colour = this.app.colour(line.kind);
    const width = isFirst ? 4 : 2;
    const feature = (geometry: typeof measured, dash?: number[]) => {
      const made = new Feature(geometry);
      made.setStyle([
        new Style({ stroke: new Stroke({ color: palette().selected, width: width + 5, ...(dash && { lineDash: dash }) }) }),
        new Style({ stroke: new Stroke({ color: colour, width, ...(dash && { lineDash: dash }) }) }),
      ]);
      return made;
    };
    return [feature(measured), feature(bridged, [4, 8])];
  }
}

function area(corners: Place[], refused: boolean): Feature {
  const [first] = corners;
  const made = new Feature(new Polygon([first ? [...corners, first] : corners]));
  const colour = refused ? palette().rejected : palette().edited;
  made.setStyle(new Style({
    stroke: new Stroke({ color: colour, width: 1.5, lineDash: [6, 4] }), fill: new Fill({ color: faded(colour, 0.12) }),
  }));
  return made;
}

function mark([east, north]: Place, refused: boolean): Feature {
  const made = new Feature(new Point([east, north]));
  const shape = { points: 4, radius: 8, radius2: 0, angle: refused ? Math.PI / 4 : 0 };
  made.setStyle([
    new Style({ image: new RegularShape({ ...shape, stroke: new Stroke({ color: "#000000", width: 5 }) }) }),
    new Style({ image: new RegularShape({ ...shape, stroke: new Stroke({ color: refused ? "#ff6b5e" : "#ffffff", width: 2.5 }) }) }),
  ]);
  return made;
}

function suggestion([east, north]: Place): Feature {
  const made = new Feature(new Point([east, north]));
  made.setStyle(new Style({
    image: new CircleStyle({
      radius: 7, fill: new Fill({ color: "rgba(47, 191, 113, 0.6)" }), stroke: new Stroke({ color: "#ffffff", width: 2 }),
    }),
  }));
  return made;
}

// Both ends, each with the reason why it stopped there
function endsOf(line: Line, growth: Growth): Feature[] {
  return ([line.xyz[0], line.xyz.at(-1)] as const).flatMap((end, i) => {
    if (end === undefined) return [];
    const made = new Feature(new Point([end[0], end[1]]));
    const reason = growth.stops[i === 0 ? 0 : 1];
    made.setStyle(new Style({
      image: new CircleStyle({
        radius: 5, fill: new Fill({ color: "#ffffff" }), stroke: new Stroke({ color: "#000000", width: 1.5 }),
      }),
      ...(reason && {
        text: new Text({
          text: reason, offsetY: -16, font: "12px system-ui, sans-serif", padding: [2, 5, 2, 5], overflow: true,
          fill: new Fill({ color: "#ffffff" }), backgroundFill: new Fill({ color: "rgba(17, 22, 29, 0.85)" }),
        }),
      }),
    }));
    return [made];
  });
}
