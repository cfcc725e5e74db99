// A path of clicks with a line to the mouse: shared by drawing and measuring.

import Feature from "ol/Feature";
import LineString from "ol/geom/LineString";
import MultiPoint from "ol/geom/MultiPoint";
import VectorLayer from "ol/layer/Vector";
import VectorSource from "ol/source/Vector";
import CircleStyle from "ol/style/Circle";
import Fill from "ol/style/Fill";
import Stroke from "ol/style/Stroke";
import Style from "ol/style/Style";
import type { Place } from "../app/documents";

export class ClickPath {
  places: Place[] = [];
  private readonly line = new Feature<LineString>();
  private readonly nodes = new Feature<MultiPoint>();
  readonly layer = new VectorLayer({ source: new VectorSource({ features: [this.line, this.nodes] }) });

  constructor(private colour: string, private readonly changed: () => void) {
    this.recolour(colour);
  }

  recolour(colour: string): void {
    this.colour = colour;
    this.line.setStyle([
      new Style({ stroke: new Stroke({ color: "rgba(0, 0, 0, 0.55)", width: 5 }) }),
      new Style({ stroke: new Stroke({ color: this.colour, width: 2.5 }) }),
    ]);
    this.nodes.setStyle(new Style({
      image: new CircleStyle({
        radius: 4.5, fill: new Fill({ color: "#ffffff" }), stroke: new Stroke({ color: this.colour, width: 2 }),
      }),
    }));
  }

  add(place: Place): void {
    this.places = [...this.places, place];
    this.drawTo(null);
  }

  // Another place for a vertex, if it is still there
  replace(old: Place, place: Place): void {
    this.places = this.places.map((one) => (one === old ? place : one));
    this.drawTo(null);
  }

  removeLast(): void {
    this.places = this.places.slice(0, -1);
    this.drawTo(null);
  }

  clear(): void {
    this.places = [];
    this.drawTo(null);
  }

  hover(place: Place): void {
    if (this.places.length > 0) this.drawTo(place);
  }

  private drawTo(mouse: Place | null): void {
    this.line.setGeometry(new LineString(mouse === null ? this.places : [...this.places, mouse]));
    this.nodes.setGeometry(new MultiPoint(this.places));
    if (mouse === null) this.changed();
  }
}
