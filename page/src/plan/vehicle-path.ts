// The vehicle's path, with arrows in the direction of travel.

import Feature from "ol/Feature";
import LineString from "ol/geom/LineString";
import Point from "ol/geom/Point";
import VectorLayer from "ol/layer/Vector";
import VectorSource from "ol/source/Vector";
import RegularShape from "ol/style/RegularShape";
import Fill from "ol/style/Fill";
import Stroke from "ol/style/Stroke";
import Style from "ol/style/Style";
import type { Vertex } from "../app/documents";

const ARROW_PX = 160; // between two arrows

export function vehiclePath(path: Vertex[]): VectorLayer {
  const line = new Feature(new LineString(path.map(([east, north]) => [east, north])));
  return new VectorLayer({
    source: new VectorSource({ features: path.length > 1 ? [line] : [] }),
    style: (_, resolution) => [
      new Style({ stroke: new Stroke({ color: "rgba(0, 0, 0, 0.35)", width: 3 }) }),
      new Style({ stroke: new Stroke({ color: "#c9b8ff", width: 1.2, lineDash: [10, 6] }) }),
      ...arrows(path, ARROW_PX * resolution),
    ],
  });
}

export function arrows(path: readonly (readonly number[])[], apart_m: number, colour = "#c9b8ff"): Style[] {
  const made: Style[] = [];
  let next_m = apart_m / 2;
  let along_m = 0;
  path.forEach(([east = 0, north = 0], i) => {
    const [e = 0, n = 0] = path[i - 1] ?? [east, north];
    const length_m = Math.hypot(east - e, north - n);
    while (length_m > 0 && along_m + length_m >= next_m && made.length < 200) {
      const share = (next_m - along_m) / length_m;
      made.push(arrow([e + (east - e) * share, n + (north - n) * share], Math.atan2(east - e, north - n), colour));
      next_m += apart_m;
    }
    along_m += length_m;
  });
  return made;
}

export function arrow(at: [number, number], heading: number, colour: string): Style {
  return new Style({
    geometry: new Point(at),
    image: new RegularShape({
      points: 3, radius: 6, rotation: heading, rotateWithView: true,
      fill: new Fill({ color: colour }), stroke: new Stroke({ color: "rgba(0, 0, 0, 0.6)", width: 1 }),
    }),
    zIndex: 3,
  });
}
