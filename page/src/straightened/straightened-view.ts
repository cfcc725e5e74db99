// The straightened view: the selected line, or the road, unrolled by chainage. Its strips show the points in plan and in
// height, the images, the accuracy, bridged stretches and the height of kerb, rail or wire; nodes moved here move the line.

import "./straightened.css";

import * as api from "../app/api";
import type { App } from "../app/app";
import type { Line, Place } from "../app/documents";
import { Bar } from "../controls/bar";
import { brightened, type Colouring, COLOURINGS } from "../controls/colours";
import { element } from "../controls/element";
import type { Pane } from "../controls/tabs";
import { LatestTask, Visibility } from "../controls/visibility";
import { Axis } from "./axis";
import { ImageStrip } from "./image-strip";
import { type LineAlong, linesAlong, type LinePlace } from "./lines-along";
import { type Measures, measuresOf } from "./measures";
import { NodeEdit } from "./node-edit";
import { referenceFor, stripsFor, type View } from "./layout";
import { drawStrips, type Strips } from "./strips";

const NAME = "straightened";
const SPACE_M = 20;
const NUDGE_M = 0.01;
const NEAR_M = 30; // a place farther from the axis is not looked at here
const MOVED_PX = 3; // a shorter drag is a click
const HALF_WIDTH_M = { value: 3, min: 0.5, max: 30, step: 0.5 };
const SLICE_M = { value: 0.3, min: 0.05, max: 5, step: 0.05 };

export class StraightenedView implements Pane {
  readonly element: HTMLElement;
  private readonly canvas = element("canvas", { role: "img", "aria-label": "The line unrolled by chainage" });
  private readonly readout = element("p", { class: "section-readout", role: "status" });
  private readonly images: ImageStrip;
  private readonly status: HTMLElement;
  private readonly shown: Visibility;
  private readonly loading = new LatestTask();
  private readonly view: View = { from_m: 0, window_m: 40, half_width_m: HALF_WIDTH_M.value, slice_m: SLICE_M.value, zoom: 1 };
  private alongRoad = false;
  private colouring: Colouring = "intensity";
  private axis: Axis | null = null;
  private axisLine: Line | null = null; // that the axis was made from; null: the van's path
  private points: api.Points | null = null;
  private nearby: LineAlong[] | null = null;
  private measures: Measures | null = null;
  private strips: Strips | null = null;
  private edit: NodeEdit | null = null;
  private press: { px: [number, number]; from_m: number; moved: boolean } | null = null;
  private active: number | null = null; // vertex of the selected line
  private here: Place | null = null;

  constructor(private readonly app: App) {
    this.images = new ImageStrip(app);
    const bar = new Bar();
    bar.button("◀", "20 m back (Shift Space)", () => this.step(-SPACE_M));
    bar.button("▶", "20 m on (Space)", () => this.step(SPACE_M));
    bar.choice("Unroll", [["line", "Selected line"], ["road", "The road"]], (value) => {
      this.alongRoad = value === "road";
      this.renew(true);
    });
    const windows = bar.choice("Length of the stretch", [["20", "20 m"], ["40", "40 m"], ["80", "80 m"], ["160", "160 m"]], (value) => {
      this.view.window_m = Number(value);
      this.load();
    });
    windows.value = "40";
    bar.number("±", "Half width (wheel over the plan strip)", "m", HALF_WIDTH_M, (value) => this.change({ half_width_m: value }));
    bar.number("slice", "Width of the slice of which heights are shown", "m", SLICE_M, (value) => this.change({ slice_m: value }));
    bar.choice("Colour of the points in the strips", COLOURINGS, (value) => {
      this.colouring = value as Colouring;
      this.draw();
    });
    this.status = bar.status();
    this.element = element(
      "div", { class: "straightened-view", tabindex: 0 }, bar.element,
      element("div", { class: "strips" }, this.canvas, this.readout), this.images.element,
    );
    this.shown = new Visibility(this.canvas, () => this.renew(false), () => this.draw());
    this.listen();
  }

  resized(): void {
    this.draw();
  }

  private listen(): void {
    const { app, canvas } = this;
    const group = "Straightened";
    const when = (): boolean => this.shown.visible && this.axis !== null;
    app.keyboard.bind({ keys: [" "], title: "20 m on", group, when, run: () => this.step(SPACE_M) });
    app.keyboard.bind({ keys: ["Shift+ "], title: "20 m back", group, when, run: () => this.step(-SPACE_M) });
    app.on("look", ({ at, by }) => by !== NAME && this.seek(at));
    app.on("selection", () => this.selected());
    app.on("lines", () => this.renew(false));
    app.on("filter", () => this.changed());
    canvas.addEventListener("pointerdown", (event) => this.pressed(event));
    canvas.addEventListener("pointermove", (event) => this.moved(event));
    canvas.addEventListener("pointerup", (event) => void this.released(event));
    canvas.addEventListener("pointercancel", () => this.drop());
    canvas.addEventListener("pointerleave", () => app.emit("cursor", null));
    canvas.addEventListener("wheel", (event) => this.wheel(event), { passive: false });
    this.element.addEventListener("keydown", (event) => this.key(event));
  }

  // The line whose nodes can be moved
  private get line(): Line | null {
    const [id, ...others] = this.app.selection;
    return others.length > 0 ? null : (this.app.lines.get(id ?? "") ?? null);
  }

  private get target(): LineAlong | null {
    return this.nearby?.find(({ line }) => line === this.line) ?? null;
  }

  private selected(): void {
    this.active = null;
    this.edit = null;
    if (!this.alongRoad && this.line !== null && this.line !== this.axisLine) this.renew(true);
    else this.changed();
  }

  // The axis as the lines are now; `seeks`: show the stretch about the place where the other views look
  private renew(seeks: boolean): void {
    if (!this.shown.visible) return;
    const kept = this.axisLine && (this.app.lines.get(this.axisLine.id) ?? null);
    const line = this.alongRoad ? null : (this.line ?? kept);
    const isOther = line?.id !== this.axisLine?.id;
    if (this.axis === null || isOther || line !== this.axisLine || seeks) {
      this.axisLine = line;
      this.axis = Axis.of(line?.xyz ?? this.app.survey.path);
      if (isOther || seeks) this.view.from_m = -1;
      if (this.here) this.centre(this.here);
    }
    this.load();
  }

  private seek(at: Place): void {
    this.here = at;
    if (!this.shown.visible) return;
    if (this.centre(at)) this.load();
    else this.draw();
  }

  // Whether the stretch was moved, so that a place is in it
  private centre(at: Place): boolean {
    const place = this.axis?.straightened(at, NEAR_M);
    const { from_m, window_m } = this.view;
    if (!place || (place.s >= from_m && place.s <= from_m + window_m)) return false;
    this.view.from_m = Math.max(-1, place.s - window_m / 2);
    return true;
  }

  private step(by_m: number): void {
    const { axis, view } = this;
    if (!axis) return;
    const last_m = Math.max(-1, axis.length_m + 1 - view.window_m);
    view.from_m = Math.min(last_m, Math.max(-1, view.from_m + by_m));
    this.load();
    this.here = axis.inWorld({ s: view.from_m + view.window_m / 2, o: 0 });
    this.app.emit("look", { at: this.here, by: NAME });
  }

  private change(view: Partial<View>): void {
    Object.assign(this.view, view);
    this.load();
  }

  private load(): void {
    this.changed();
    const { axis, axisLine, view } = this;
    if (!this.shown.visible || !axis || this.app.survey.n_points === 0) return;
    void this.loading.run(async () => {
      try {
        const stretch = [view.from_m, view.from_m + view.window_m] as const;
        this.points = await api.straightened(axisLine?.id ?? "", ...stretch, view.half_width_m);
      } catch (error) {
        this.points = null;
        this.app.reportProblem(error);
      }
      this.measures = null;
      this.draw();
    });
  }

  // Lines or the selection are others: what was derived of them is found again
  private changed(): void {
    this.nearby = null;
    this.measures = null;
    this.draw();
  }

  private draw(): void {
    if (!this.shown.visible) return;
    const { axis, view, app, canvas } = this;
    const { from_m, window_m } = view;
    this.element.dataset["axis"] = axis ? (this.axisLine?.id ?? "road") : "";
    if (!axis) return this.empty();
    this.nearby ??= linesAlong(
      axis.over(from_m, from_m + window_m), app.lines.values(), view.half_width_m,
      (line) => line === this.axisLine || app.selection.includes(line.id) || app.filter.shows(line),
    );
    const { target } = this;
    this.measures ??= target && measuresOf(target, this.nearby, this.points);
    const reference = referenceFor(target, this.points);
    const strips = (this.strips = stripsFor(canvas, view, target, this.measures, reference, this.points !== null));
    const context = this.sized(strips);
    const middle = target ?? this.nearby.find(({ line }) => line === this.axisLine) ?? null;
    drawStrips(context, strips, {
      points: this.points, colouring: this.colouring, heights: app.survey.heights, reference,
      inSlice: sliceAround(middle, view),
      lines: this.nearby.map((along) => ({
        along, colour: brightened(app.colour(along.line.kind)), selected: app.selection.includes(along.line.id),
      })),
      nodes: this.nodes(target), active: this.active, measures: this.measures,
      ends_m: [0, axis.length_m], here_m: this.here && (axis.straightened(this.here, NEAR_M)?.s ?? null),
    });
    void this.images.show(axis, strips);
    this.describe(strips, axis, target, reference);
  }

  private nodes(target: LineAlong | null): LinePlace[] {
    const { edit } = this;
    const nodes = (target?.nodes ?? []).map((node) => (edit && node.vertex === edit.from.vertex ? edit.now : node));
    return edit && edit.from.vertex === null ? [...nodes, edit.now] : nodes;
  }

  private empty(): void {
    this.sized({ width: this.canvas.clientWidth, height: this.canvas.clientHeight });
    this.status.textContent = "";
    this.readout.textContent = this.alongRoad
      ? "This survey has no trajectory: select a line to unroll it." : "Select a line to unroll it, or choose “The road”.";
  }

  private sized({ width, height }: { width: number; height: number }): CanvasRenderingContext2D {
    const ratio = window.devicePixelRatio;
    this.canvas.width = Math.round(width * ratio);
    this.canvas.height = Math.round(height * ratio);
    const context = this.canvas.getContext("2d", { willReadFrequently: true })!;
    context.scale(ratio, ratio);
    return context;
  }

  private describe(strips: Strips, axis: Axis, target: LineAlong | null, reference: (s: number) => number): void {
    const { from_m, to_m } = strips;
    const name = this.axisLine ? this.app.title(this.axisLine.kind) : "Road";
    this.status.textContent = `${name} · ${Math.max(0, from_m).toFixed(0)} to ${Math.min(to_m, axis.length_m).toFixed(0)} of ${axis.length_m.toFixed(0)} m`;
    const node = this.edit?.now ?? target?.nodes.find(({ vertex }) => vertex === this.active);
    this.readout.textContent = this.edit?.text || (node && target ? `Node ${node.vertex! + 1} of ${target.line.xyz.length} at ${node.s.toFixed(2)} m` : "");
    this.canvas.setAttribute("aria-label", `${this.status.textContent}. ${this.heightText}`);
    // For scripts and tests: what is shown, and where the nodes are drawn
    const { dataset } = this.canvas;
    dataset["stretch"] = `${from_m},${to_m}`;
    dataset["points"] = String(this.points?.n ?? 0);
    dataset["lines"] = JSON.stringify(this.nearby?.map(({ line }) => line.id) ?? []);
    const places = (strip: "plan" | "heights"): unknown[] => {
      const band = strips.named(strip);
      return !band ? [] : this.nodes(target).map((place) => ({
        vertex: place.vertex, px: [strips.x(place.s), strips.y(band, strip === "plan" ? -place.o : place.z - reference(place.s))],
      }));
    };
    dataset["nodes"] = JSON.stringify({ plan: places("plan"), heights: places("heights") });
    dataset["scales"] = JSON.stringify(strips.all.map(({ name: strip, top, bottom, low, high }) => ({ strip, perM: (bottom - top) / (high - low) })));
    dataset["height"] = this.heightText;
  }

  private get heightText(): string {
    const { height } = this.measures ?? {};
    if (!height || height.values.length === 0) return "";
    const sorted = height.values.map(([, value]) => value).sort((a, b) => a - b);
    return `${height.title} ${sorted[sorted.length >> 1]!.toFixed(2)} m`;
  }

  private at(event: MouseEvent): [number, number] {
    const box = this.canvas.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  }

  private pressed(event: PointerEvent): void {
    if (event.button !== 0 || !this.strips) return;
    this.element.focus({ preventScroll: true });
    this.canvas.setPointerCapture(event.pointerId);
    this.press = { px: this.at(event), from_m: this.view.from_m, moved: false };
    this.edit = this.under(this.at(event), true);
    if (this.edit) this.active = this.edit.from.vertex;
    this.draw();
  }

  private under(px: [number, number], inserts: boolean): NodeEdit | null {
    const { strips, target } = this;
    const strip = strips?.at(px[1]);
    return strips && strip && target ? NodeEdit.under(strips, strip, target, px, referenceFor(target, this.points), inserts) : null;
  }

  private moved(event: PointerEvent): void {
    const { strips, press, edit, axis } = this;
    const px = this.at(event);
    if (!strips || !axis) return;
    if (!press || event.buttons === 0) {
      this.canvas.classList.toggle("over-node", this.under(px, false) !== null);
      const strip = strips.at(px[1]);
      const o = strip?.name === "plan" ? -strips.value(strip, px[1]) : 0;
      return this.app.emit("cursor", { at: axis.inWorld({ s: strips.chainage(px[0]), o }), by: NAME });
    }
    if (Math.hypot(px[0] - press.px[0], px[1] - press.px[1]) >= MOVED_PX) press.moved = true;
    if (!press.moved) return;
    if (edit) {
      const strip = strips.named(edit.strip);
      if (strip) edit.move(strips, strip, px, referenceFor(this.target, this.points));
      return this.draw();
    }
    this.view.from_m = Math.min(Math.max(-1, press.from_m - (px[0] - press.px[0]) / strips.scale), Math.max(-1, axis.length_m - 1));
    this.changed();
  }

  private async released(event: PointerEvent): Promise<void> {
    const { press, edit, strips, axis } = this;
    this.press = null;
    if (!press || !strips || !axis) return;
    if (press.moved && edit) return this.save();
    this.edit = null;
    if (press.moved) return this.load();
    if (edit?.from.vertex === null || !edit) {
      const px = this.at(event);
      const strip = strips.at(px[1]);
      const reference = referenceFor(this.target, this.points);
      const hit = strip && this.nearby?.find((along) => NodeEdit.under(strips, strip, along, px, reference, true) !== null);
      if (hit && hit.line !== this.line) this.app.select([hit.line.id]);
      this.here = axis.inWorld({ s: strips.chainage(px[0]), o: 0 });
      this.app.emit("look", { at: this.here, by: NAME });
    }
    this.draw();
  }

  // Save the moved node; it stays active, so that it can be moved on
  private async save(): Promise<void> {
    const { edit, axis } = this;
    const change = edit && axis && edit.edit(axis);
    if (change) {
      const inserted = change.action === "insert" ? change.after + 1 : this.active;
      this.active = (await this.app.change(change)) === null ? this.active : inserted;
    }
    this.drop();
  }

  private drop(): void {
    this.edit = null;
    this.press = null;
    this.draw();
  }

  private wheel(event: WheelEvent): void {
    event.preventDefault();
    const strip = this.strips?.at(this.at(event)[1]);
    const factor = event.deltaY > 0 ? 1.2 : 1 / 1.2;
    if (strip?.name === "plan")
      this.change({ half_width_m: Math.min(HALF_WIDTH_M.max, Math.max(HALF_WIDTH_M.min, this.view.half_width_m * factor)) });
    else {
      this.view.zoom = Math.min(10, Math.max(0.1, this.view.zoom * factor));
      this.draw();
    }
  }

  private key(event: KeyboardEvent): void {
    if (event.target instanceof HTMLInputElement || event.target instanceof HTMLSelectElement || event.metaKey) return;
    const nudge = (by: Partial<Record<"s" | "o" | "z", number>>, strip: "plan" | "heights") => () => this.nudge(by, strip);
    const actions: Record<string, () => void> = {
      ArrowRight: () => this.toNode(1),
      ArrowLeft: () => this.toNode(-1),
      "Shift+ArrowUp": nudge({ o: -NUDGE_M }, "plan"),
      "Shift+ArrowDown": nudge({ o: NUDGE_M }, "plan"),
      "Shift+ArrowRight": nudge({ s: NUDGE_M }, "plan"),
      "Shift+ArrowLeft": nudge({ s: -NUDGE_M }, "plan"),
      "Alt+ArrowUp": nudge({ z: NUDGE_M }, "heights"),
      "Alt+ArrowDown": nudge({ z: -NUDGE_M }, "heights"),
      Home: () => this.step(-Infinity),
      End: () => this.step(Infinity),
      ...(this.edit && { Enter: () => void this.save(), Escape: () => this.drop() }),
      ...(this.active !== null && { Delete: () => this.removeActive() }),
    };
    const action = actions[`${event.altKey ? "Alt+" : ""}${event.shiftKey ? "Shift+" : ""}${event.key}`];
    if (!action || event.ctrlKey) return;
    action();
    event.preventDefault();
    event.stopPropagation();
  }

  private nudge(by: Partial<Record<"s" | "o" | "z", number>>, strip: "plan" | "heights"): void {
    const node = this.target?.nodes.find(({ vertex }) => vertex === this.active);
    if (!node || !this.target) return this.app.emit("message", { text: "Choose a node with Left or Right first.", kind: "info" });
    this.edit ??= NodeEdit.of(this.target.line, node, strip);
    this.edit.nudge(by);
    this.draw();
  }

  private toNode(direction: 1 | -1): void {
    const { line, axis } = this;
    if (!line || !axis) return;
    this.edit = null;
    const first = this.target?.nodes[direction > 0 ? 0 : this.target.nodes.length - 1]?.vertex ?? 0;
    const next = this.active === null ? first : Math.min(line.xyz.length - 1, Math.max(0, this.active + direction));
    this.active = next;
    const [east, north] = line.xyz[next]!;
    this.here = [east, north];
    if (this.centre(this.here)) this.load();
    else this.draw();
    this.app.emit("look", { at: this.here, by: NAME });
  }

  private removeActive(): void {
    const { line, active } = this;
    if (!line || active === null) return;
    this.active = null;
    void this.app.change({ action: "remove", id: line.id, vertex: active });
  }
}

// The points whose heights are shown: near the line, else near the axis
function sliceAround(middle: LineAlong | null, { slice_m, from_m, window_m }: View): (s: number, o: number) => boolean {
  const STATIONS_PER_M = 4;
  const offsets = new Float64Array(Math.ceil(window_m * STATIONS_PER_M) + 2).fill(middle ? NaN : 0);
  for (const run of middle?.runs ?? [])
    for (let i = 1; i < run.length; i++) {
      const [a, b] = run[i - 1]!.s < run[i]!.s ? [run[i - 1]!, run[i]!] : [run[i]!, run[i - 1]!];
      const [low, high] = [(a.s - from_m) * STATIONS_PER_M, (b.s - from_m) * STATIONS_PER_M];
      for (let k = Math.max(0, Math.floor(low)); k <= Math.min(offsets.length - 1, Math.ceil(high)); k++)
        offsets[k] = high > low ? a.o + Math.min(1, Math.max(0, (k - low) / (high - low))) * (b.o - a.o) : a.o;
    }
  return (s, o) => Math.abs(o - offsets[Math.round((s - from_m) * STATIONS_PER_M)]!) <= slice_m / 2;
}
