// The cross-section view: the points near a vertical plane across the road, and the lines that cross it.

import "./section-view.css";

import { nearestOn, type Station } from "../app/geometry";
import * as api from "../app/api";
import type { App } from "../app/app";
import type { Pane } from "../controls/tabs";
import { Bar } from "../controls/bar";
import { element } from "../controls/element";
import { brightened, type Colouring, COLOURINGS } from "../controls/colours";
import { editOf, nodeAt, sameNode, SectionDrag } from "./drag";
import { EdgeSnap } from "./edge-snap";
import { drawSection, Frame, GROUND_SHARE, type Handle, MIDDLE_SHARE } from "./rendering";
import { nodesIn, type SectionNode } from "./nodes";
import { readingsOf, sectionTable } from "./readings";
import { stationOnto, startOf, nextVertex, stationFor, stepped } from "./station";
import { TemplateMaker } from "./template-maker";
import { LatestTask, Visibility } from "../controls/visibility";
import type { Line } from "../app/documents";

const NAME = "section";
const STEP_M = 0.5;
const PAGE_STEP_M = 5;
const HALF_WIDTH_M = { value: 6, min: 0.5, max: 30, step: 0.5 };
const THICKNESS_M = { value: 0.3, min: 0.05, max: 5, step: 0.05 };

export class SectionView implements Pane {
  readonly element: HTMLElement;
  private readonly canvas = element("canvas", { role: "img", "aria-label": "Cross-section" });
  private readonly readout = element("p", { class: "section-readout" });
  private readonly table = element("div", { class: "section-table" });
  private readonly where: HTMLElement;
  private readonly half: HTMLInputElement;
  private readonly thickness: HTMLInputElement;
  private readonly shown: Visibility;
  private readonly loading = new LatestTask();
  private readonly drag = new SectionDrag();
  private readonly edge = new EdgeSnap();
  private readonly maker: TemplateMaker;
  private station: Station;
  private points: api.Points | null = null;
  private half_width_m = HALF_WIDTH_M.value;
  private thickness_m = THICKNESS_M.value;
  private exaggeration = 1;
  private colouring: Colouring = "intensity";
  private centre: [x: number, z: number] = [0, 0];
  private followsCursor = false;
  private presses = 0; // drags begun, and given up or done
  private drops = 0;

  constructor(private readonly app: App) {
    this.maker = new TemplateMaker(app, () => this.draw());
    const bar = new Bar();
    bar.button("◀", "Step back along the line (Down; Page Down: 5 m)", () => this.step(-STEP_M));
    bar.button("▶", "Step forward along the line (Up; Page Up: 5 m)", () => this.step(STEP_M));
    this.half = bar.number("±", "Half width (wheel)", "m", HALF_WIDTH_M, (value) => this.widen(value, this.thickness_m));
    this.thickness = bar.number("slice", "Thickness of the slice (Shift + wheel)", "m", THICKNESS_M,
      (value) => this.widen(this.half_width_m, value));
    bar.choice("Vertical scale", [["1", "1 : 1"], ["2", "2 × vertical"], ["5", "5 × vertical"]], (value) => {
      this.exaggeration = Number(value);
      this.draw();
    });
    bar.choice("Colour of the points", COLOURINGS, (value) => {
      this.colouring = value as Colouring;
      this.draw();
    });
    bar.checkbox("follow cursor", "The section follows the mouse over the plan", (value) => (this.followsCursor = value));
    bar.button("Template", "Make a template of this cross-section: nodes beside the selected line", () => this.makeTemplate());
    this.where = bar.status();
    this.element = element(
      "div", { class: "section-view", tabindex: 0 }, bar.element,
      element("div", { class: "section-picture" }, this.canvas, this.readout), this.maker.element, this.table,
    );
    this.station = stationFor(app.survey, undefined, startOf(app.survey));
    this.shown = new Visibility(this.canvas, () => this.place(this.station), () => this.draw());
    this.listen();
  }

  resized(): void {
    this.draw();
  }

  private listen(): void {
    const { app, canvas } = this;
    app.on("look", ({ at, by }) => by !== NAME && this.place(stationFor(app.survey, this.line, at)));
    app.on("cursor", (cursor) => {
      if (this.followsCursor && cursor && cursor.by !== NAME) this.place(stationFor(app.survey, this.line, cursor.at));
    });
    app.on("selection", () => {
      const { line, station } = this;
      const target = line && stationOnto(line, station);
      if (target) return this.place(target);
      // A wire selected from the road below it comes into view, and the road again after it
      if (line) this.centre = [0, nearestOn(line.xyz, station.at)?.station.z ?? station.z];
      this.draw();
    });
    app.on("lines", () => {
      this.maker.moved(this.nodes(), this.station);
      this.draw();
    });
    canvas.addEventListener("pointerdown", (event) => this.press(event));
    canvas.addEventListener("pointermove", (event) => this.move(event));
    canvas.addEventListener("pointerup", () => void this.release());
    canvas.addEventListener("pointercancel", () => this.drop());
    canvas.addEventListener("wheel", (event) => this.wheel(event), { passive: false });
    this.element.addEventListener("keydown", (event) => this.key(event));
  }

  private get line(): Line | undefined {
    return this.app.lines.get(this.app.selection[0] ?? "");
  }

  // The section goes across the selected line, so that the nodes are where its direction has them
  private makeTemplate(): void {
    const { line, station } = this;
    const onto = line && nearestOn(line.xyz, station.at)?.station;
    if (onto) this.moveTo(onto);
    this.maker.start(this.nodes().find((node) => node.line.id === line?.id), this.station);
  }

  private step(by_m: number): void {
    this.moveTo(stepped(this.app.survey, this.line, this.station, by_m));
  }

  private toVertex(direction: 1 | -1): void {
    const next = this.line && nextVertex(this.line, this.station, direction);
    if (next) this.moveTo(next);
  }

  private moveTo(station: Station): void {
    this.place(station);
    this.app.emit("look", { at: station.at, by: NAME });
  }

  private place(station: Station): void {
    this.station = station;
    this.drag.end();
    this.centre = [0, station.z];
    this.maker.moved(this.nodes(), this.station);
    this.load();
  }

  private widen(half_width_m: number, thickness_m: number): void {
    [this.half_width_m, this.thickness_m] = [half_width_m, thickness_m];
    this.half.value = String(Math.round(half_width_m * 100) / 100);
    this.thickness.value = String(Math.round(thickness_m * 100) / 100);
    this.load();
  }

  private load(): void {
    this.draw();
    if (!this.shown.visible || this.app.survey.n_points === 0) return;
    const { station, half_width_m, thickness_m } = this;
    void this.loading.run(async () => {
      try {
        this.points = await api.section(station.at, station.heading_deg, half_width_m, thickness_m);
      } catch (error) {
        this.points = null;
        this.app.reportProblem(error);
      }
      this.draw();
    });
  }

  private frame(): Frame {
    const { clientWidth, clientHeight } = this.canvas;
    const down = this.line?.kind === "cable" ? MIDDLE_SHARE : GROUND_SHARE;
    return new Frame(clientWidth, clientHeight, ...this.centre, this.half_width_m, this.exaggeration, down);
  }

  private nodes(): SectionNode[] {
    return nodesIn(this.station, this.app.lines.values(), this.half_width_m, this.thickness_m / 2);
  }

  private draw(): void {
    if (!this.shown.visible) return;
    const frame = this.frame();
    const dragged = this.drag.node;
    const nodes = this.nodes().map((node) => (dragged && sameNode(node, dragged.from) ? dragged : node));
    const handles = nodes.map((node): Handle => ({
      node,
      colour: brightened(this.app.colour(node.line.kind)),
      selected: node === dragged || node.line.id === this.line?.id,
    }));
    const context = this.sized(frame);
    drawSection(context, frame, this.points, this.colouring, this.app.survey.heights, handles);
    this.maker.draw(context, frame);
    this.edge.draw(context, frame);
    this.canvas.dataset["snap"] = this.edge.title;
    this.table.hidden = this.maker.isActive;
    // For scripts and tests: where the nodes are drawn
    const places = nodes.map(({ line, vertex, x, z }) => ({ id: line.id, kind: line.kind, vertex, px: frame.toPx(x, z) }));
    this.canvas.dataset["nodes"] = JSON.stringify(places);
    this.describe(nodes);
  }

  private sized(frame: Frame): CanvasRenderingContext2D {
    const ratio = window.devicePixelRatio;
    this.canvas.width = Math.round(frame.width * ratio);
    this.canvas.height = Math.round(frame.height * ratio);
    const context = this.canvas.getContext("2d")!;
    context.scale(ratio, ratio);
    return context;
  }

  private describe(nodes: readonly SectionNode[]): void {
    const readings = readingsOf(nodes, this.points);
    this.table.replaceChildren(sectionTable(readings, this.app));
    const said = readings.map(({ kind, offset_m, remark }) => `${this.app.title(kind)} at ${offset_m.toFixed(2)} m${remark ? `, ${remark}` : ""}`);
    this.canvas.setAttribute("aria-label", `Cross-section: ${said.join("; ") || "no line"}`);
    const [east, north] = this.station.at;
    this.where.textContent = `E ${east.toFixed(2)}  N ${north.toFixed(2)}`;
    const title = (kind: string): string => this.app.title(kind);
    this.readout.textContent = this.drag.readout(this.points, title) || (this.points?.n === 0 ? "No points here." : "");
  }

  private at(event: MouseEvent): [number, number] {
    const box = this.canvas.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  }

  private press(event: PointerEvent): void {
    if (event.button !== 0) return;
    this.element.focus({ preventScroll: true });
    if (this.maker.isActive) return this.maker.click(...this.frame().fromPx(...this.at(event)), this.nodes());
    this.presses += 1;
    this.edge.clear();
    this.canvas.setPointerCapture(event.pointerId);
    const node = nodeAt(this.frame(), this.nodes(), this.at(event), this.line?.id ?? "");
    this.drag.press(node, this.centre, [event.clientX, event.clientY]);
    this.draw();
  }

  private move(event: PointerEvent): void {
    if (event.buttons === 0) {
      const over = nodeAt(this.frame(), this.nodes(), this.at(event), this.line?.id ?? "");
      this.canvas.classList.toggle("over-node", over !== null);
      return;
    }
    if (!this.drag.isActive) return;
    this.centre = this.drag.move(this.frame(), [event.clientX, event.clientY], this.points, event.shiftKey) ?? this.centre;
    this.edge.clear();
    if (event.shiftKey) this.snap();
    this.draw();
  }

  // With Shift: onto the edge near the node; where none is seen it stays at the nearest point
  private snap(): void {
    const { node } = this.drag;
    if (!node) return;
    this.edge.seek(node.line.kind, this.station, node.x, (x, z) => {
      this.drag.put(x, z);
      this.draw();
    });
  }

  private async release(): Promise<void> {
    // What is dragged next, and another place of the section, leave this node as it was let go
    const { station, presses, drops } = this;
    const { node } = this.drag;
    const edge = node && (await this.edge.last());
    if (drops !== this.drops) return;
    const edit = node && editOf({ ...node, ...(edge && { x: edge.x, z: edge.z }) }, station);
    if (edit) await this.app.change(edit);
    else if (node) this.app.select([node.line.id]);
    if (presses === this.presses) this.drop();
  }

  private drop(): void {
    this.drops += 1;
    this.edge.clear();
    this.drag.end();
    this.draw();
  }

  private wheel(event: WheelEvent): void {
    event.preventDefault();
    // Some browsers report the wheel as horizontal while Shift is held
    const factor = (event.deltaY || event.deltaX) > 0 ? 1.2 : 1 / 1.2;
    const clamped = (value: number, { min, max }: typeof HALF_WIDTH_M): number => Math.min(max, Math.max(min, value));
    if (event.shiftKey) this.widen(this.half_width_m, clamped(this.thickness_m * factor, THICKNESS_M));
    else this.widen(clamped(this.half_width_m * factor, HALF_WIDTH_M), this.thickness_m);
  }

  private key(event: KeyboardEvent): void {
    if (event.target instanceof HTMLInputElement || event.target instanceof HTMLSelectElement) return;
    if (event.ctrlKey || event.altKey || event.metaKey) return;
    const actions: Record<string, () => void> = {
      ArrowUp: () => this.step(STEP_M),
      ArrowDown: () => this.step(-STEP_M),
      PageUp: () => this.step(PAGE_STEP_M),
      PageDown: () => this.step(-PAGE_STEP_M),
      ArrowRight: () => this.toVertex(1),
      ArrowLeft: () => this.toVertex(-1),
    };
    const action = event.key === "Escape" && this.drag.isActive ? () => this.drop() : actions[event.key];
    if (!action) return;
    action();
    event.preventDefault();
    event.stopPropagation();
  }
}
