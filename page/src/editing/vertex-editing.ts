// Vertices of the selected line in plan: drag one, click or drag a segment to insert one, the last clicked is active.

import Feature from "ol/Feature";
import LineString from "ol/geom/LineString";
import MultiPoint from "ol/geom/MultiPoint";
import Point from "ol/geom/Point";
import PointerInteraction from "ol/interaction/Pointer";
import VectorLayer from "ol/layer/Vector";
import type MapBrowserEvent from "ol/MapBrowserEvent";
import type OlMap from "ol/Map";
import VectorSource from "ol/source/Vector";
import CircleStyle from "ol/style/Circle";
import Fill from "ol/style/Fill";
import Stroke from "ol/style/Stroke";
import Style from "ol/style/Style";
import type { App } from "../app/app";
import { placeOf } from "../app/geometry";
import type { Edit, Line, Place } from "../app/documents";
import { handlesOf, type Hold, holdAt } from "./vertex-handles";

const MOVED_PX = 3; // less is a click

export class VertexEditing extends PointerInteraction {
  active: number | null = null; // a vertex of the selected line
  private readonly handles = new Feature<MultiPoint>();
  private readonly one = new Feature<Point>();
  private readonly preview = new Feature<LineString>();
  readonly layer = new VectorLayer({
    source: new VectorSource({ features: [this.preview, this.handles, this.one] }), updateWhileInteracting: true,
  });
  private hold: Hold | null = null;
  private from_px: readonly number[] = [0, 0];

  constructor(private readonly app: App, private readonly map: OlMap) {
    super();
    this.handles.setStyle(dot(4, "#ffffff", "#16202c"));
    this.preview.setStyle(new Style({ stroke: new Stroke({ color: "#ffb000", width: 2, lineDash: [6, 4] }) }));
    app.on("selection", () => this.begin());
    app.on("lines", () => this.begin());
    app.on("tool", () => this.begin());
    map.on("moveend", () => this.draw());
  }

  // The line that can be edited: the only selected one
  get line(): Line | null {
    const [id, ...others] = this.app.selection;
    if (id === undefined || others.length > 0 || this.app.tool !== "select") return null;
    const line = this.app.lines.get(id);
    return line === undefined || line.review === "rejected" ? null : line;
  }

  activate(vertex: number | null): void {
    this.active = vertex;
    this.draw();
  }

  removeActive(): boolean {
    const [line, vertex] = [this.line, this.active];
    if (line === null || vertex === null) return false;
    this.active = null;
    void this.app.change({ action: "remove", id: line.id, vertex });
    return true;
  }

  private begin(): void {
    if (this.active !== null && this.active >= (this.line?.xyz.length ?? 0)) this.active = null;
    if (this.line === null) this.active = null;
    this.preview.setGeometry(undefined);
    this.draw();
  }

  private draw(): void {
    const line = this.line;
    const shown = line ? handlesOf(line, this.map.getView().getResolution() ?? 1) : [];
    const at = (i: number): Place[] => (line?.xyz[i] ? [placeOf(line.xyz[i])] : []);
    this.handles.setGeometry(new MultiPoint(shown.flatMap(at)));
    const [place] = this.active === null ? [] : at(this.active);
    this.mark(place ?? null, "active");
  }

  private mark(place: Place | null, as: "active" | "vertex" | "segment"): void {
    this.one.setGeometry(place ? new Point(place) : undefined);
    this.one.setStyle(as === "segment" ? dot(5, "rgba(255, 255, 255, 0.6)", "#ffb000") : dot(6, "#ffb000", "#16202c"));
  }

  override handleMoveEvent(event: MapBrowserEvent): void {
    const line = this.line;
    const hold = line && !event.originalEvent.shiftKey ? holdAt(line, placeOf(event.coordinate), this.map) : null;
    this.map.getTargetElement()?.classList.toggle("on-vertex", hold !== null);
    if (hold) this.mark(hold.at, hold.on);
    else this.draw();
  }

  override handleDownEvent(event: MapBrowserEvent): boolean {
    const line = this.line;
    if (line === null || event.originalEvent.shiftKey || (event.originalEvent as PointerEvent).button !== 0) return false;
    this.hold = holdAt(line, placeOf(event.coordinate), this.map);
    this.from_px = event.pixel;
    return this.hold !== null;
  }

  override handleDragEvent(event: MapBrowserEvent): void {
    const [line, hold] = [this.line, this.hold];
    if (line === null || hold === null || !this.moved(event)) return;
    const place = placeOf(event.coordinate);
    const next = line.xyz[hold.vertex + 1];
    const before = hold.on === "vertex" ? line.xyz[hold.vertex - 1] : line.xyz[hold.vertex];
    const part = [...(before ? [placeOf(before)] : []), place, ...(next ? [placeOf(next)] : [])];
    this.preview.setGeometry(new LineString(part));
    this.mark(place, hold.on);
  }

  override handleUpEvent(event: MapBrowserEvent): boolean {
    const [line, hold] = [this.line, this.hold];
    this.hold = null;
    if (line === null || hold === null) return false;
    const to = this.moved(event) ? placeOf(event.coordinate) : hold.at;
    if (hold.on === "segment") void this.save({ action: "insert", id: line.id, after: hold.vertex, to }, hold.vertex + 1);
    else if (this.moved(event)) void this.save({ action: "move", id: line.id, vertex: hold.vertex, to }, hold.vertex);
    else this.activate(hold.vertex);
    return false;
  }

  private async save(edit: Edit, vertex: number): Promise<void> {
    const changed = await this.app.change(edit);
    this.preview.setGeometry(undefined);
    this.activate(changed ? vertex : this.active);
  }

  private moved({ pixel }: MapBrowserEvent): boolean {
    return Math.hypot(pixel[0]! - this.from_px[0]!, pixel[1]! - this.from_px[1]!) > MOVED_PX;
  }
}

function dot(radius: number, fill: string, edge: string): Style {
  return new Style({
    image: new CircleStyle({ radius, fill: new Fill({ color: fill }), stroke: new Stroke({ color: edge, width: 1.5 }) }),
  });
}
