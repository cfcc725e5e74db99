// Editing the vertices of the selected line with OpenLayers' Modify: drag a vertex to move it, click or drag a segment to
// insert one, click a vertex to make it active. Modify changes a copy of the line; the resulting edit goes to the server.

import type { Coordinate } from "ol/coordinate";
import Collection from "ol/Collection";
import { noModifierKeys, primaryAction } from "ol/events/condition";
import Feature from "ol/Feature";
import LineString from "ol/geom/LineString";
import MultiPoint from "ol/geom/MultiPoint";
import Point from "ol/geom/Point";
import Modify from "ol/interaction/Modify";
import VectorLayer from "ol/layer/Vector";
import type OlMap from "ol/Map";
import VectorSource from "ol/source/Vector";
import CircleStyle from "ol/style/Circle";
import Fill from "ol/style/Fill";
import Stroke from "ol/style/Stroke";
import Style from "ol/style/Style";
import type { App } from "../app/app";
import type { Edit, Line, Place } from "../app/documents";
import { REJECTED } from "../app/filter";
import { placeOf } from "../app/geometry";

const REACH_PX = 8; // how near to a vertex or a segment the mouse has to be
const APART_PX = 18; // vertices shown closer together would hide the line

export class VertexEditing {
  active: number | null = null; // the vertex of the selected line that was clicked last
  private shown: Line | null = null; // the line that `copy` was made from
  private readonly copy = new Feature<LineString>();
  readonly layer = new VectorLayer({
    source: new VectorSource({ features: [this.copy] }), updateWhileInteracting: true,
    style: (_, resolution) => this.styles(resolution),
  });
  private readonly modify = new Modify({
    features: new Collection([this.copy]),
    pixelTolerance: REACH_PX,
    condition: (event) => noModifierKeys(event) && primaryAction(event), // Shift selects
    deleteCondition: () => false, // the Delete key removes the active vertex
    style: (vertex) => (vertex.get("existing") ? HOVERED : INSERTED),
  });
  private before: Coordinate[] | null = null; // coordinates of the copy when the drag began; null: no drag
  private saving = 0; // edits in flight

  constructor(private readonly app: App, map: OlMap) {
    map.addInteraction(this.modify);
    this.modify.on("modifystart", () => (this.before = this.coordinates));
    this.modify.on("modifyend", () => void this.save());
    const setCursor = (onVertex: boolean) => map.getTargetElement()?.classList.toggle("on-vertex", onVertex);
    this.modify.getOverlay().getSource()?.on("addfeature", () => setCursor(true));
    this.modify.getOverlay().getSource()?.on("removefeature", () => setCursor(false));
    map.on("click", () => this.activate(this.vertexAt(this.modify.getPoint())));
    for (const event of ["selection", "lines", "tool"] as const) app.on(event, () => this.update());
  }

  // The line that can be edited: the only one selected
  get line(): Line | null {
    const [id, ...others] = this.app.selection;
    if (id === undefined || others.length > 0 || this.app.tool !== "select") return null;
    const line = this.app.lines.get(id);
    return line === undefined || line.review === REJECTED ? null : line;
  }

  removeActive(): boolean {
    const [line, vertex] = [this.line, this.active];
    if (line === null || vertex === null) return false;
    this.active = null;
    void this.app.change({ action: "remove", id: line.id, vertex });
    return true;
  }

  private get coordinates(): Coordinate[] {
    return this.copy.getGeometry()?.getCoordinates() ?? [];
  }

  private activate(vertex: number | null): void {
    this.active = vertex;
    this.layer.changed();
  }

  private vertexAt(point: Coordinate | null): number | null {
    const found = point === null ? -1 : this.coordinates.findIndex(([e, n]) => e === point[0] && n === point[1]);
    return found < 0 ? null : found;
  }

  // Copy the selected line as the server has it, unless the copy is up to date or an edit of it is under way
  private update(isSaved = false): void {
    const { line, shown } = this;
    const isSame = line?.id === shown?.id;
    if (this.before !== null || (line === shown && !isSaved) || (isSame && this.saving > 0)) return;
    if (!isSame || (this.active ?? 0) >= (line?.xyz.length ?? 0)) this.active = null;
    this.shown = line;
    this.copy.setGeometry(line ? new LineString(line.xyz.map(placeOf)) : undefined);
  }

  private async save(): Promise<void> {
    const { before, shown } = this;
    this.before = null;
    const edit = shown && before && editBetween(shown.id, before, this.coordinates);
    if (!edit) return this.update();
    this.saving += 1;
    const changed = await this.app.change(edit);
    this.saving -= 1;
    if (shown.id !== this.shown?.id) return;
    this.active = changed === null ? null : edit.action === "insert" ? edit.after + 1 : edit.vertex;
    this.update(true); // the server may have refused the edit
  }

  private styles(resolution: number): Style[] {
    const { coordinates } = this;
    if (coordinates.length === 0) return [];
    const active = this.active === null ? undefined : coordinates[this.active];
    return [
      ...(this.before === null && this.saving === 0 ? [] : [CHANGING]),
      handles(spaced(coordinates, APART_PX * resolution)),
      ...(active ? [new Style({ image: ACTIVE, geometry: new Point(active) })] : []),
    ];
  }
}

// The one vertex that was moved or inserted
function editBetween(
  id: string, before: Coordinate[], after: Coordinate[],
): Extract<Edit, { action: "move" | "insert" }> | null {
  const vertex = after.findIndex(([e, n], i) => e !== before[i]?.[0] || n !== before[i]?.[1]);
  if (vertex < 0) return null;
  const to: Place = placeOf(after[vertex]!);
  return after.length > before.length ? { action: "insert", id, after: vertex - 1, to } : { action: "move", id, vertex, to };
}

// The ends, and the vertices between them that are at least `apart_m` apart
function spaced(coordinates: Coordinate[], apart_m: number): Coordinate[] {
  const shown: Coordinate[] = [];
  coordinates.forEach((vertex, i) => {
    const last = shown.at(-1);
    const isNear = last && Math.hypot(vertex[0]! - last[0]!, vertex[1]! - last[1]!) < apart_m;
    if (!isNear || i === coordinates.length - 1) shown.push(vertex);
  });
  return shown;
}

function circle(radius: number, fill: string, edge: string): CircleStyle {
  return new CircleStyle({ radius, fill: new Fill({ color: fill }), stroke: new Stroke({ color: edge, width: 1.5 }) });
}

const HANDLE = circle(4, "#ffffff", "#16202c");
const ACTIVE = circle(6, "#ffb000", "#16202c");
const HOVERED = new Style({ image: ACTIVE });
const INSERTED = new Style({ image: circle(5, "rgba(255, 255, 255, 0.6)", "#ffb000") });
const CHANGING = new Style({ stroke: new Stroke({ color: "#ffb000", width: 2, lineDash: [6, 4] }) });

function handles(coordinates: Coordinate[]): Style {
  return new Style({ image: HANDLE, geometry: new MultiPoint(coordinates) });
}
