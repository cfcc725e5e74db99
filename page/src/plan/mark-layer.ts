// Marks over the lines: the direction of the selected lines, and the cursor of another pane.

import Feature from "ol/Feature";
import LineString from "ol/geom/LineString";
import Point from "ol/geom/Point";
import VectorLayer from "ol/layer/Vector";
import VectorSource from "ol/source/Vector";
import RegularShape from "ol/style/RegularShape";
import Stroke from "ol/style/Stroke";
import Style from "ol/style/Style";
import type { App } from "../app/app";
import { arrow, arrows } from "./vehicle-path";
import type { Line, Place } from "../app/documents";

const ARROW_PX = 120;

export class MarkLayer {
  private readonly source = new VectorSource();
  private readonly cross = new Feature<Point>();
  readonly layer = new VectorLayer({ source: this.source, updateWhileInteracting: true });

  constructor(private readonly app: App) {
    this.cross.setStyle(crossStyle());
    app.on("selection", () => this.draw());
    app.on("lines", () => this.draw());
    app.on("cursor", (cursor) => {
      this.cross.setGeometry(cursor && cursor.by !== "plan" ? new Point(cursor.at) : undefined);
    });
    this.draw();
  }

  private draw(): void {
    const features = this.app.selection.flatMap((id) => {
      const line = this.app.lines.get(id);
      return line && line.xyz.length > 1 ? [directionOf(line)] : [];
    });
    this.source.clear(true);
    this.source.addFeatures([this.cross, ...features]);
  }
}

// Arrows along the line, and one at its end
function directionOf(line: Line): Feature {
  const path = line.xyz.map(([east, north]): Place => [east, north]);
  const made = new Feature(new LineString(path));
  const [before, last] = [path.at(-2)!, path.at(-1)!];
  const heading = Math.atan2(last[0] - before[0], last[1] - before[1]);
  made.setStyle((_, resolution) => [...arrows(path, ARROW_PX * resolution, "#ffffff"), arrow(last, heading, "#ffb000")]);
  return made;
}

function crossStyle(): Style[] {
  const shape = { points: 4, radius: 9, radius2: 0 };
  return [
    new Style({ image: new RegularShape({ ...shape, stroke: new Stroke({ color: "#000000", width: 4 }) }) }),
    new Style({ image: new RegularShape({ ...shape, stroke: new Stroke({ color: "#ffffff", width: 1.5 }) }) }),
  ];
}
