// Cross-section: the points near a vertical plane across the road, and the lines that go through it.

import "./section-view.css";

import type { Station } from "../app/along-line";
import * as api from "../app/api";
import type { App, Pane } from "../app/app";
import { Bar } from "../controls/bar";
import { element } from "../controls/element";
import { bright, type Colouring, COLOURINGS } from "../controls/colours";
import { nodeAt, sameNode, SectionDrag } from "./drag";
import { drawSection, Frame, GROUND_SHARE, type Handle, MIDDLE_SHARE } from "./drawing";
import { nodesIn, readingsOf, type SectionNode } from "./nodes";
import { farFrom, middleOf, nextVertex, stationFor, stepped } from "./station";
import { sectionTable } from "./table";
import { Latest, Shown } from "../controls/visibility";
import type { Line } from "../app/documents";

const NAME = "section";
const STEP_M = 0.5;
const LEAP_M = 5;
const WIDTHS = { value: 6, least: 0.5, most: 30, step: 0.5 };
const THICKNESSES = { value: 0.3, least: 0.05, most: 5, step: 0.05 };

export class SectionView implements Pane {
  readonly element: HTMLElement;
  private readonly canvas = element("canvas", { "aria-label": "Cross-section" });
  private readonly readout = element("p", { class: "section-readout" });
  private readonly table = element("div", { class: "section-table" });
  private readonly where: HTMLElement;
  private readonly half: HTMLInputElement;
  private readonly thick: HTMLInputElement;
  private readonly shown: Shown;
  private readonly loading = new Latest();
  private readonly drag = new SectionDrag();
  private station: Station;
  private points: api.Points | null = null;
  private half_width_m = WIDTHS.value;
  private thickness_m = THICKNESSES.value;
  private tall = 1;
  private colouring: Colouring = "intensity";
  private centre: [x: number, z: number] = [0, 0];
  private follows = false;

  constructor(private readonly app: App) {
    const bar = new Bar();
    bar.button("◀", "Back along the line (Down; Page Down: 5 m)", () => this.step(-STEP_M));
    bar.button("▶", "On along the line (Up; Page Up: 5 m)", () => this.step(STEP_M));
    this.half = bar.number("±", "Half width (wheel)", "m", WIDTHS, (value) => this.widen(value, this.thickness_m));
    this.thick = bar.number("thick", "Thickness of the slice (Shift + wheel)", "m", THICKNESSES,
      (value) => this.widen(this.half_width_m, value));
    bar.choice("Vertical scale", [["1", "1 : 1"], ["2", "2 × height"], ["5", "5 × height"]], (value) => {
      this.tall = Number(value);
      this.draw();
    });
    bar.choice("Colour of the points", COLOURINGS, (value) => {
      this.colouring = value as Colouring;
      this.draw();
    });
    bar.tick("at cursor", "The section goes with the mouse over the plan", (value) => (this.follows = value));
    this.where = bar.words();
    this.element = element(
      "div", { class: "section-view", tabindex: 0 }, bar.element,
      element("div", { class: "section-picture" }, this.canvas, this.readout), this.table,
    );
    this.station = stationFor(app.survey, undefined, middleOf(app.survey));
    this.shown = new Shown(this.canvas, () => this.put(this.station), () => this.draw());
    this.listen();
  }

  resized(): void {
    this.draw();
  }

  private listen(): void {
    const { app, canvas } = this;
    app.on("look", ({ at, by }) => by !== NAME && this.put(stationFor(app.survey, this.line, at)));
    app.on("cursor", (cursor) => {
      if (this.follows && cursor && cursor.by !== NAME) this.put(stationFor(app.survey, this.line, cursor.at));
    });
    app.on("selection", () => {
      const elsewhere = this.line && farFrom(this.line, this.station);
      if (elsewhere) this.put(elsewhere);
      else this.draw();
    });
    app.on("lines", () => this.draw());
    canvas.addEventListener("pointerdown", (event) => this.press(event));
    canvas.addEventListener("pointermove", (event) => this.move(event));
    canvas.addEventListener("pointerup", () => void this.release());
    canvas.addEventListener("pointercancel", () => this.letGo());
    canvas.addEventListener("wheel", (event) => this.wheel(event), { passive: false });
    this.element.addEventListener("keydown", (event) => this.key(event));
  }

  private get line(): Line | undefined {
    return this.app.lines.get(this.app.selection[0] ?? "");
  }

  private step(by_m: number): void {
    this.goAlong(stepped(this.app.survey, this.line, this.station, by_m));
  }

  private toVertex(way: 1 | -1): void {
    const next = this.line && nextVertex(this.line, this.station, way);
    if (next) this.goAlong(next);
  }

  private goAlong(station: Station): void {
    this.put(station);
    this.app.emit("look", { at: station.at, by: NAME });
  }

  private put(station: Station): void {
    this.station = station;
    this.drag.end();
    this.centre = [0, station.z];
    this.load();
  }

  private widen(half_width_m: number, thickness_m: number): void {
    [this.half_width_m, this.thickness_m] = [half_width_m, thickness_m];
    this.half.value = String(Math.round(half_width_m * 100) / 100);
    this.thick.value = String(Math.round(thickness_m * 100) / 100);
    this.load();
  }

  private load(): void {
    this.draw();
    if (!this.shown.is || this.app.survey.n_points === 0) return;
    const { station, half_width_m, thickness_m } = this;
    void this.loading.ask(async () => {
      try {
        this.points = await api.section(station.at, station.heading_deg, half_width_m, thickness_m);
      } catch (error) {
        this.points = null;
        this.app.problem(error);
      }
      this.draw();
    });
  }

  private frame(): Frame {
    const { clientWidth, clientHeight } = this.canvas;
    const down = this.line?.kind === "cable" ? MIDDLE_SHARE : GROUND_SHARE;
    return new Frame(clientWidth, clientHeight, ...this.centre, this.half_width_m, this.tall, down);
  }

  private nodes(): SectionNode[] {
    return nodesIn(this.station, this.app.lines.values(), this.half_width_m, this.thickness_m / 2);
  }

  private draw(): void {
    if (!this.shown.is) return;
    const frame = this.frame();
    const dragged = this.drag.node;
    const nodes = this.nodes().map((node) => (dragged && sameNode(node, dragged.from) ? dragged : node));
    const handles = nodes.map((node): Handle => ({
      node,
      colour: bright(this.app.colour(node.line.kind)),
      chosen: node === dragged || node.line.id === this.line?.id,
    }));
    drawSection(this.sized(frame), frame, this.points, this.colouring, this.app.survey.heights, handles);
    // Where nodes are drawn, for whoever works the page by script
    const places = nodes.map(({ line, vertex, x, z }) => ({ id: line.id, kind: line.kind, vertex, px: frame.toPx(x, z) }));
    this.canvas.dataset["nodes"] = JSON.stringify(places);
    this.tell(nodes);
  }

  private sized(frame: Frame): CanvasRenderingContext2D {
    const ratio = window.devicePixelRatio;
    this.canvas.width = Math.round(frame.width * ratio);
    this.canvas.height = Math.round(frame.height * ratio);
    const context = this.canvas.getContext("2d")!;
    context.scale(ratio, ratio);
    return context;
  }

  private tell(nodes: readonly SectionNode[]): void {
    this.table.replaceChildren(sectionTable(readingsOf(nodes, this.points), this.app));
    const [east, north] = this.station.at;
    this.where.textContent = `E ${east.toFixed(2)}  N ${north.toFixed(2)}`;
    const title = (kind: string): string => this.app.title(kind);
    this.readout.textContent = this.drag.words(this.points, title) || (this.points?.n === 0 ? "No points here." : "");
  }

  private at(event: MouseEvent): [number, number] {
    const box = this.canvas.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  }

  private press(event: PointerEvent): void {
    if (event.button !== 0) return;
    this.element.focus({ preventScroll: true });
    this.canvas.setPointerCapture(event.pointerId);
    this.drag.press(this.frame(), this.nodes(), this.at(event), this.line?.id ?? "");
    this.draw();
  }

  private move(event: PointerEvent): void {
    if (event.buttons === 0) {
      const over = nodeAt(this.frame(), this.nodes(), this.at(event), this.line?.id ?? "");
      this.canvas.classList.toggle("over-node", over !== null);
      return;
    }
    if (!this.drag.is) return;
    this.centre = this.drag.move(this.frame(), this.at(event), this.points, event.shiftKey) ?? this.centre;
    this.draw();
  }

  private async release(): Promise<void> {
    const { node } = this.drag;
    const edit = this.drag.edit(this.station);
    if (edit) await this.app.change(edit);
    else if (node) this.app.select([node.line.id]);
    this.letGo();
  }

  private letGo(): void {
    this.drag.end();
    this.draw();
  }

  private wheel(event: WheelEvent): void {
    event.preventDefault();
    // With Shift some browsers turn the wheel sideways
    const turned = (event.deltaY || event.deltaX) > 0 ? 1.2 : 1 / 1.2;
    const inside = (value: number, { least, most }: typeof WIDTHS): number => Math.min(most, Math.max(least, value));
    if (event.shiftKey) this.widen(this.half_width_m, inside(this.thickness_m * turned, THICKNESSES));
    else this.widen(inside(this.half_width_m * turned, WIDTHS), this.thickness_m);
  }

  private key(event: KeyboardEvent): void {
    if (event.target instanceof HTMLInputElement || event.target instanceof HTMLSelectElement) return;
    if (event.ctrlKey || event.altKey || event.metaKey) return;
    const does: Record<string, () => void> = {
      ArrowUp: () => this.step(STEP_M),
      ArrowDown: () => this.step(-STEP_M),
      PageUp: () => this.step(LEAP_M),
      PageDown: () => this.step(-LEAP_M),
      ArrowRight: () => this.toVertex(1),
      ArrowLeft: () => this.toVertex(-1),
    };
    const done = event.key === "Escape" && this.drag.is ? () => this.letGo() : does[event.key];
    if (!done) return;
    done();
    event.preventDefault();
    event.stopPropagation();
  }
}
