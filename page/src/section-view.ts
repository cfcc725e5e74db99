// Cross-section: the points near a vertical plane across the road, and the lines that go through it.

import "./section-view.css";

import { headingOf, nearestOn, type Station, stationAt } from "./along-line";
import * as api from "./api";
import type { App, Pane } from "./app";
import { Bar } from "./bar";
import { element } from "./element";
import { bright, type Colouring, COLOURINGS } from "./ink";
import { drawSection, Frame, type Handle } from "./section-drawing";
import { inSection, inWorld, nodesIn, type Plane, pointAt, readingsOf, roadAt, type SectionNode } from "./section-nodes";
import { sectionTable } from "./section-table";
import { Latest, Shown } from "./shown";
import type { Line, Place } from "./types";

const NAME = "section";
const GRAB_PX = 12;
const STEP_M = 0.5;
const LEAP_M = 5;
// A line so far from where one looks is not what one looks at
const BESIDE_M = 15;

interface Drag {
  node: SectionNode;
  x: number;
  z: number;
}

export class SectionView implements Pane {
  private readonly canvas = element("canvas", { "aria-label": "Cross-section" });
  private readonly readout = element("p", { class: "section-readout" });
  private readonly table = element("div", { class: "section-table" });
  readonly element: HTMLElement;
  private readonly where: HTMLElement;
  private readonly half: HTMLInputElement;
  private readonly thick: HTMLInputElement;
  private readonly shown: Shown;
  private readonly loading = new Latest();
  private station: Station | null = null;
  private points: api.Points | null = null;
  private half_width_m = 4;
  private thickness_m = 0.3;
  private tall = 1;
  private colouring: Colouring = "intensity";
  private centre: [x: number, z: number] = [0, 0];
  private follows = false;
  private drag: Drag | null = null;
  private pan: { px: number; py: number; centre: [number, number] } | null = null;
  private chosen: SectionNode | null = null;

  constructor(private readonly app: App) {
    const bar = new Bar();
    bar.button("◀", "Back along the line (Down)", () => this.step(-STEP_M));
    bar.button("▶", "On along the line (Up)", () => this.step(STEP_M));
    this.half = bar.number("±", "Half width (wheel)", "m", { value: 4, least: 0.5, most: 30, step: 0.5 },
      (value) => this.widen(value, this.thickness_m));
    this.thick = bar.number("thick", "Thickness of the slice (Shift + wheel)", "m",
      { value: 0.3, least: 0.05, most: 5, step: 0.05 }, (value) => this.widen(this.half_width_m, value));
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
    this.element = element("div", { class: "section-view", tabindex: 0 }, bar.element, this.canvas, this.readout, this.table);
    this.shown = new Shown(this.canvas, () => this.load(), () => this.draw());
    this.listen();
    this.begin();
  }

  resized(): void {
    this.draw();
  }

  private listen(): void {
    const { app, canvas } = this;
    app.on("look", ({ at, by }) => by !== NAME && this.goTo(at));
    app.on("cursor", (cursor) => this.follows && cursor && cursor.by !== NAME && this.goTo(cursor.at));
    app.on("selection", ([id]) => this.onLine(id));
    app.on("lines", () => this.draw());
    canvas.addEventListener("pointerdown", (event) => this.press(event));
    canvas.addEventListener("pointermove", (event) => this.move(event));
    canvas.addEventListener("pointerup", () => void this.release());
    canvas.addEventListener("pointercancel", () => this.let_go());
    canvas.addEventListener("wheel", (event) => this.wheel(event), { passive: false });
    this.element.addEventListener("keydown", (event) => this.key(event));
  }

  // The section is somewhere from the start: in the middle of the drive
  private begin(): void {
    const { path, bounds } = this.app.survey;
    const middle = path[path.length >> 1];
    this.goTo(middle ? [middle[0], middle[1]] : [(bounds[0] + bounds[2]) / 2, (bounds[1] + bounds[3]) / 2]);
  }

  private get line(): Line | undefined {
    return this.app.lines.get(this.app.selection[0] ?? "");
  }

  private get plane(): Plane | null {
    return this.station && { at: this.station.at, heading_deg: this.station.heading_deg };
  }

  private onLine(id: string | undefined): void {
    const line = this.app.lines.get(id ?? "");
    const here = line && this.station && nearestOn(line.xyz, this.station.at);
    if (here && here.distance_m > BESIDE_M) this.put(here.station);
    else this.draw();
  }

  // Across the selected line if it is near, else across the van's way
  private goTo(place: Place): void {
    const onLine = this.line && nearestOn(this.line.xyz, place);
    if (onLine && onLine.distance_m <= BESIDE_M) return this.put(onLine.station);
    const onPath = nearestOn(this.app.survey.path, place);
    this.put({ at: place, z: onPath?.station.z ?? 0, heading_deg: onPath?.station.heading_deg ?? 0, chainage_m: 0 });
  }

  private step(by_m: number): void {
    if (!this.station) return;
    const line = this.line && nearestOn(this.line.xyz, this.station.at);
    const next = this.line && line && line.distance_m < 1
      ? stationAt(this.line.xyz, line.station.chainage_m + by_m)
      : this.freely(this.station, by_m);
    if (!next) return;
    this.put(next);
    this.app.emit("look", { at: next.at, by: NAME });
  }

  private freely(station: Station, by_m: number): Station {
    const at = inWorld(station, 0, by_m);
    const path = nearestOn(this.app.survey.path, at);
    return { ...station, at, heading_deg: path?.station.heading_deg ?? station.heading_deg };
  }

  private toVertex(way: 1 | -1): void {
    const { line, plane } = this;
    if (!line || !plane) return;
    const places = line.xyz.map((vertex, i) => ({ i, y: inSection(plane, vertex)[1] * way }));
    const next = places.filter(({ y }) => y > 0.01).sort((a, b) => a.y - b.y)[0];
    if (!next) return;
    const [e, n, z] = line.xyz[next.i]!;
    const [a, b] = [line.xyz[Math.max(0, next.i - 1)]!, line.xyz[Math.min(line.xyz.length - 1, next.i + 1)]!];
    this.put({ at: [e, n], z, heading_deg: headingOf(a, b), chainage_m: 0 });
    this.app.emit("look", { at: [e, n], by: NAME });
  }

  private put(station: Station): void {
    this.station = station;
    this.chosen = null;
    this.centre = [0, station.z + (this.line?.kind === "cable" ? 0 : 0.5)];
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
    const { plane } = this;
    if (!plane || !this.shown.is || this.app.survey.n_points === 0) return;
    void this.loading.ask(async () => {
      try {
        this.points = await api.section(plane.at, plane.heading_deg, this.half_width_m, this.thickness_m);
      } catch (error) {
        this.points = null;
        this.app.problem(error);
      }
      this.draw();
    });
  }

  private frame(): Frame {
    const { clientWidth, clientHeight } = this.canvas;
    return new Frame(clientWidth, clientHeight, ...this.centre, this.half_width_m, this.tall);
  }

  private nodes(): SectionNode[] {
    return this.plane ? nodesIn(this.plane, this.app.lines.values(), this.half_width_m, this.thickness_m / 2) : [];
  }

  private draw(): void {
    if (!this.shown.is) return;
    const frame = this.frame();
    const context = this.sized(frame);
    const nodes = this.nodes();
    const handles: Handle[] = nodes.map((node) => {
      const dragged = this.drag !== null && same(node, this.drag.node);
      const [x, z] = dragged ? [this.drag!.x, this.drag!.z] : [node.x, node.z];
      const chosen = dragged || (this.chosen !== null && same(node, this.chosen)) || node.line.id === this.line?.id;
      return { node, colour: bright(this.app.colour(node.line.kind)), x, z, chosen };
    });
    drawSection(context, frame, this.points, this.colouring, this.app.survey.heights, handles);
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

  private tell(nodes: SectionNode[]): void {
    const moved = nodes.map((node) => this.drag && same(node, this.drag.node) ? { ...node, ...this.place(this.drag) } : node);
    this.table.replaceChildren(sectionTable(readingsOf(moved, this.points), this.app));
    if (this.station) {
      const [east, north] = this.station.at;
      this.where.textContent = `E ${east.toFixed(2)}  N ${north.toFixed(2)}`;
    }
    this.readout.textContent = this.drag ? this.dragWords(this.drag) : this.points?.n === 0 ? "No points here." : "";
  }

  private place(drag: Drag): { x: number; z: number } {
    return { x: drag.x, z: drag.z };
  }

  private dragWords({ node, x, z }: Drag): string {
    const road = this.points && roadAt(this.points, x);
    const above = road === null ? "" : `, ${(z - road).toFixed(3)} m above the road`;
    const moved = `moved ${signed(x - node.x)} m across, ${signed(z - node.z)} m up`;
    return `${node.line.kind}: offset ${signed(x)} m${above}; ${moved}`;
  }

  private at(event: MouseEvent): [number, number] {
    const box = this.canvas.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  }

  private press(event: PointerEvent): void {
    if (event.button !== 0) return;
    const [px, py] = this.at(event);
    const frame = this.frame();
    const far = (node: SectionNode): number => {
      const [x, y] = frame.toPx(node.x, node.z);
      // Of nodes at one place the selected line's is meant
      return Math.hypot(x - px, y - py) - (node.line.id === this.line?.id ? 1 : 0);
    };
    const grabbed = this.nodes().sort((a, b) => far(a) - far(b))[0];
    this.canvas.setPointerCapture(event.pointerId);
    if (grabbed && far(grabbed) <= GRAB_PX) {
      this.drag = { node: grabbed, x: grabbed.x, z: grabbed.z };
      this.chosen = grabbed;
    } else {
      this.pan = { px, py, centre: this.centre };
    }
    this.draw();
  }

  private move(event: PointerEvent): void {
    const [px, py] = this.at(event);
    const frame = this.frame();
    if (this.drag) {
      const [x, z] = frame.fromPx(px, py);
      const far = (x1: number, z1: number): number => {
        const [x2, y2] = frame.toPx(x1, z1);
        return Math.hypot(x2 - px, y2 - py);
      };
      const snapped = event.shiftKey && this.points ? pointAt(this.points, far, GRAB_PX) : null;
      this.drag = { node: this.drag.node, ...(snapped ?? { x, z }) };
    } else if (this.pan) {
      const [x, z] = this.pan.centre;
      const [px0, py0] = [this.pan.px, this.pan.py];
      this.centre = [x - (px - px0) / frame.scale, z + (py - py0) / (frame.scale * frame.tall)];
    } else return;
    this.draw();
  }

  private async release(): Promise<void> {
    const { drag, plane } = this;
    this.pan = null;
    if (!drag || !plane) return this.let_go();
    const { node, x, z } = drag;
    if (Math.hypot(x - node.x, z - node.z) < 0.001) {
      this.let_go();
      this.app.select([node.line.id]);
      return;
    }
    const to: [number, number, number] = [...inWorld(plane, x, node.y), z];
    const { id } = node.line;
    await this.app.change(
      node.vertex === null
        ? { action: "insert", id, after: node.after, to }
        : { action: "move", id, vertex: node.vertex, to },
    );
    this.let_go();
  }

  private let_go(): void {
    this.drag = null;
    this.pan = null;
    this.draw();
  }

  private wheel(event: WheelEvent): void {
    event.preventDefault();
    // With Shift some browsers turn the wheel sideways
    const turned = (event.deltaY || event.deltaX) > 0 ? 1.2 : 1 / 1.2;
    const limited = (value: number, least: number, most: number): number => Math.min(most, Math.max(least, value));
    if (event.shiftKey) this.widen(this.half_width_m, limited(this.thickness_m * turned, 0.05, 5));
    else this.widen(limited(this.half_width_m * turned, 0.5, 30), this.thickness_m);
  }

  private key(event: KeyboardEvent): void {
    if (event.target instanceof HTMLInputElement || event.target instanceof HTMLSelectElement) return;
    const does: Record<string, () => void> = {
      ArrowUp: () => this.step(STEP_M),
      ArrowDown: () => this.step(-STEP_M),
      PageUp: () => this.step(LEAP_M),
      PageDown: () => this.step(-LEAP_M),
      ArrowRight: () => this.toVertex(1),
      ArrowLeft: () => this.toVertex(-1),
    };
    const done = event.ctrlKey || event.altKey || event.metaKey ? undefined : does[event.key];
    if (event.key === "Escape" && this.drag) this.let_go();
    else if (done) done();
    else return;
    event.preventDefault();
    event.stopPropagation();
  }
}

const same = (a: SectionNode, b: SectionNode): boolean =>
  a.line.id === b.line.id && a.after === b.after && a.vertex === b.vertex;

const signed = (value: number): string => `${value < 0 ? "−" : "+"}${Math.abs(value).toFixed(3)}`;
