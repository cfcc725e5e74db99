// The plan view: the background image, the lines over it, the tools that work on them, and the map's controls.

import type OlMap from "ol/Map";
import type MapBrowserEvent from "ol/MapBrowserEvent";
import type { App } from "../app/app";
import type { Pane } from "../controls/tabs";
import { Drawing } from "../editing/drawing";
import { element } from "../controls/element";
import { GrowthCard } from "./growth-card";
import { GrowthLayer } from "./growth-layer";
import { ImageLayer, imageSwitch } from "./image-layer";
import { legend } from "./legend";
import { bindCommands, type Command, lineCommands } from "../editing/line-commands";
import { LineLayer } from "./line-layer";
import { Measuring } from "../editing/measuring";
import { MarkLayer } from "./mark-layer";
import { type Box, boxOf, crosses, expanded, placeOf } from "../app/geometry";
import { planMap } from "./map";
import { Selecting } from "./selecting";
import type { Place } from "../app/documents";
import { vehiclePath } from "./vehicle-path";
import { VertexEditing } from "../editing/vertex-editing";

const PAN_PX = 60; // of a press of an arrow key
const GO_TO_RADIUS_M = 20; // shown around a place that the view is sent to

export class PlanView implements Pane {
  readonly element = element("div", { class: "plan-view" });
  readonly map: OlMap;
  readonly commands: Command[];
  private readonly target = element("div", {
    class: "map", tabindex: 0, role: "application", "aria-roledescription": "map",
    "aria-label": "Plan view: arrow keys move it, Ctrl Enter clicks in its middle",
  });
  private readonly lines: LineLayer;
  private readonly selecting: Selecting;
  private readonly measuring: Measuring;
  private readonly drawing: Drawing;
  private cursor: Place | null = null;

  constructor(private readonly app: App) {
    this.element.append(this.target);
    this.map = planMap(this.target, app.survey);
    const image = new ImageLayer(app.survey, this.map.getView().getProjection());
    app.on("tiles", ({ done, total }) => done >= total && image.reload());
    app.on("lines", () => image.linesChanged());
    const path = vehiclePath(app.survey.path);
    this.lines = new LineLayer(app);
    this.measuring = new Measuring(app);
    this.drawing = new Drawing(app, () => this.map.getView().getResolution() ?? 1);
    this.selecting = new Selecting(app, this.map, this.lines);
    const editing = new VertexEditing(app, this.map);
    const marks = new MarkLayer(app);
    for (const layer of [
      image.layer, path, this.lines.bands, this.lines.layer, marks.layer, new GrowthLayer(app, this.map).layer,
      editing.layer, this.measuring.path.layer, this.drawing.path.layer,
      this.drawing.snapping.layer,
    ]) this.map.addLayer(layer);
    this.commands = lineCommands(app, editing, () => this.cursor);
    this.element.append(
      imageSwitch(app.survey, (name) => image.show(name)),
      element("div", { class: "north", role: "img", "aria-label": "North is up" }, "N"),
      legend(app, this.lines, (visible) => path.setVisible(visible)),
      new GrowthCard(app).element,
    );
    bindCommands(app, this.commands);
    this.bindKeys();
    this.listen();
  }

  resized(): void {
    this.map.updateSize();
  }

  goTo(place: Place): void {
    const view = this.map.getView();
    const [width = 1, height = 1] = this.map.getSize() ?? [];
    view.setCenter(place);
    view.setResolution((2 * GO_TO_RADIUS_M) / Math.min(width, height));
    this.app.emit("look", { at: place, by: "plan" });
  }

  fit(box: Box): void {
    this.map.getView().fit(box, { padding: [50, 60, 90, 60], maxZoom: 40 });
  }

  fitAll(): void {
    const places = [...this.app.lines.values()].flatMap((line) => line.xyz);
    this.fit(boxOf([...places, ...this.app.survey.path]) ?? this.app.survey.bounds);
  }

  fitSelection(): void {
    const box = boxOf(this.app.selection.flatMap((id) => this.app.lines.get(id)?.xyz ?? []));
    if (box) this.fit(expanded(box, 5));
  }

  zoom(by: number): void {
    const view = this.map.getView();
    view.setZoom((view.getZoom() ?? 0) + by);
  }

  // After a change of theme
  restyle(): void {
    this.lines.restyle();
  }

  private listen(): void {
    const { app, map } = this;
    map.on("click", (event) => this.clicked(event));
    // The browser's event: OpenLayers takes any two clicks within 250 ms for a double-click, wherever they are
    this.target.addEventListener("dblclick", () => void (app.tool === "draw" && this.drawing.doubleClick()));
    map.on("pointermove", (event) => this.moved(placeOf(event.coordinate), event.originalEvent.altKey));
    this.target.addEventListener("pointerleave", () => this.left());
    app.on("reverted", (lines) => {
      const [west = 0, south = 0, east = 0, north = 0] = map.getView().calculateExtent(map.getSize());
      const isInView = lines.some(({ xyz }) => crosses(xyz, [west, south, east, north]));
      const first = lines[0]?.xyz[0];
      if (first && !isInView) app.emit("look", { at: placeOf(first), by: "undo" });
    });
    app.on("look", ({ at, by }) => {
      if (by !== "plan") this.lookAt(at);
    });
    const { dataset } = this.element;
    app.on("growth", ({ state }) => (dataset.state = state === "idle" ? "ready" : state));
    app.on("lines", () => (dataset.revision = String(app.revision)));
    app.on("tool", (tool) => (dataset.tool = tool));
    map.on("moveend", () => {
      const view = map.getView();
      dataset.view = [...(view.getCenter() ?? []), view.getResolution()].join(",");
    });
    [dataset.state, dataset.tool] = ["ready", app.tool];
  }

  // The plan without a mouse: arrow keys move it, and its middle is clicked
  private bindKeys(): void {
    const group = "Plan";
    const when = () => document.activeElement === this.target;
    const view = this.map.getView();
    const middle = (): Place => placeOf(view.getCenter() ?? []);
    this.app.keyboard.bind({ keys: ["Ctrl+Enter"], title: "Click in the middle of the plan", group, run: () => this.click(middle(), false) });
    const steps = { ArrowUp: [0, 1], ArrowDown: [0, -1], ArrowLeft: [-1, 0], ArrowRight: [1, 0] } as const;
    for (const [key, [right, up]] of Object.entries(steps)) {
      const move = (by_px: number): void => {
        const step = by_px * (view.getResolution() ?? 1);
        const [east, north] = middle();
        view.setCenter([east + right * step, north + up * step]);
        this.moved(middle());
      };
      const title = `Move the plan ${key.slice("Arrow".length).toLowerCase()} (Shift: by a pixel)`;
      this.app.keyboard.bind({ keys: [key], title, group, when, run: () => move(PAN_PX) });
      this.app.keyboard.bind({ keys: [`Shift+${key}`], title: `${title.split(" (")[0]} by a pixel`, group, when, run: () => move(1) });
    }
  }

  private clicked(event: MapBrowserEvent): void {
    this.target.focus({ preventScroll: true });
    this.click(placeOf(event.coordinate), event.originalEvent.shiftKey, event.originalEvent.altKey);
  }

  private click(place: Place, withShift: boolean, withAlt = false): void {
    const { app } = this;
    if (app.tool === "select") this.selecting.click(place, withShift);
    if (app.tool === "follow") void app.following.click(place);
    if (app.tool === "draw") this.drawing.click(place, withAlt);
    if (app.tool === "measure") void this.measuring.click(place);
    app.emit("look", { at: place, by: "plan" });
  }

  private moved(at: Place, withAlt = false): void {
    this.cursor = at;
    if (this.app.tool === "measure") this.measuring.path.hover(at);
    if (this.app.tool === "draw") this.drawing.hover(at, withAlt);
    this.app.emit("cursor", { at, by: "plan" });
  }

  private left(): void {
    this.cursor = null;
    this.drawing.snapping.hide();
    this.app.emit("cursor", null);
  }

  // Another pane looks at a place: centre the plan there unless it is well inside the view
  private lookAt([east, north]: Place): void {
    const [west = 0, south = 0, right = 0, top = 0] = this.map.getView().calculateExtent(this.map.getSize());
    const [dx, dy] = [(right - west) / 8, (top - south) / 8];
    const isInside = east > west + dx && east < right - dx && north > south + dy && north < top - dy;
    if (!isInside) this.map.getView().setCenter([east, north]);
  }
}
