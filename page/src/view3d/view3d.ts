// The 3-D view: points around a place, and the lines. Drawn only when something changes, never in a loop: without a
// graphics card a frame takes 0.1 s.

import "./view3d.css";
import { Color, ColorManagement, LinearSRGBColorSpace, PerspectiveCamera, Scene, Vector3, WebGLRenderer } from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";
import { nearestOn } from "../app/geometry";
import type { App } from "../app/app";
import type { Pane } from "../controls/tabs";
import { Bar } from "../controls/bar";
import { element } from "../controls/element";
import { type Colouring, COLOURINGS, CANVAS } from "../controls/colours";
import { LatestTask, Visibility } from "../controls/visibility";
import { Lines3D } from "./lines";
import { lineAt, projectionAt } from "./pick";
import { PointRings, RELOAD_M } from "./points";
import type { Line, Place, Vertex } from "../app/documents";

// Draw colours as given, without colour conversion
ColorManagement.enabled = false;

const NAME = "3-D";
const CLICK_PX = 4;
const PICK_RADIUS_PX = 8;
const ALONG_M = 8; // the camera stands about 15 m away: a growing end farther than this from its target leaves the picture

export class View3D implements Pane {
  readonly element: HTMLElement;
  private readonly canvas = element("canvas", { role: "img", "aria-label": "3-D view", tabindex: 0 });
  private readonly status: HTMLElement;
  private readonly shown: Visibility;
  private readonly loading = new LatestTask();
  private readonly scene = new Scene();
  private readonly camera = new PerspectiveCamera(50, 1, 0.3, 2000);
  private readonly points: PointRings;
  private readonly lines = new Lines3D();
  private readonly origin: Vertex; // coordinates of the scene are relative to it
  private readonly focus = new Vector3(); // the camera's target, relative to the origin
  private renderer: WebGLRenderer | null = null;
  private controls: OrbitControls | null = null;
  private colouring: Colouring = "intensity";
  private growing: Line[] = [];
  private isFrameRequested = false;
  private pressed: [number, number] | null = null;

  constructor(private readonly app: App) {
    const { heights, middle } = app.survey;
    this.origin = [...middle] as Vertex;
    this.points = new PointRings(heights);
    const bar = new Bar();
    bar.choice("Colour of the points", COLOURINGS, (value) => this.colour(value as Colouring));
    bar.choice("Size of the points", [["1", "1 px"], ["2", "2 px"], ["3", "3 px"], ["5", "5 px"]], (value) => {
      this.points.resize(Number(value));
      this.draw();
    }).value = "2";
    bar.button("Selection", "Look at the selected line", () => this.toSelection());
    bar.button("From above", "Look straight down", () => this.placeCamera(new Vector3(0, -0.01, 25)));
    bar.button("Along", "Look along the drive", () => this.alongDrive());
    this.status = bar.status();
    this.element = element("div", { class: "three-view" }, bar.element, this.canvas);
    this.scene.background = new Color(CANVAS.background);
    this.scene.add(this.points.group, this.lines.group);
    this.camera.up.set(0, 0, 1);
    this.shown = new Visibility(this.canvas, () => this.appeared(), () => this.resized());
    this.alongDrive();
    this.listen();
  }

  resized(): void {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    if (!this.renderer || width === 0 || height === 0) return;
    this.renderer.setPixelRatio(window.devicePixelRatio);
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    this.lines.resized(width, height);
    this.draw();
  }

  private listen(): void {
    const { app, canvas } = this;
    const deferral = new Deferral(app);
    app.on("look", ({ at, by }) => {
      const isPick = by === "plan" && app.tool === "follow"; // a line is about to grow there
      if (by !== NAME) deferral.run("look", () => this.lookAt([at[0], at[1], this.groundHeight(at)]), isPick);
    });
    app.on("selection", () => this.showLines());
    app.on("lines", () => this.showLines());
    app.on("growth", ({ lines }) =>
      deferral.run("growth", () => {
        this.followGrowth(lines);
        this.growing = lines;
        this.showLines();
      }),
    );
    canvas.addEventListener("pointerdown", (event) => (this.pressed = [event.clientX, event.clientY]));
    canvas.addEventListener("pointerup", (event) => this.release(event));
  }

  // The WebGL context is created when the view first appears; without WebGL the rest of the page still works
  private appeared(): void {
    if (!this.renderer) {
      try {
        this.renderer = new WebGLRenderer({ canvas: this.canvas, antialias: true });
        this.renderer.outputColorSpace = LinearSRGBColorSpace;
      } catch {
        this.status.textContent = "The 3-D view needs WebGL, which this browser does not provide.";
        return;
      }
      this.controls = new OrbitControls(this.camera, this.canvas);
      this.controls.target = this.focus;
      this.controls.update();
      this.controls.zoomToCursor = true;
      this.controls.maxDistance = 400;
      this.controls.minDistance = 0.5;
      this.controls.addEventListener("change", () => this.moved());
    }
    this.resized();
    this.showLines();
    this.load();
  }

  private get target(): Vertex {
    const { x, y, z } = this.focus;
    return [this.origin[0] + x, this.origin[1] + y, this.origin[2] + z];
  }

  private groundHeight(place: Place): number {
    return nearestOn(this.app.survey.path, place)?.station.z ?? this.origin[2];
  }

  // Moves the camera's target, keeping distance and direction
  private lookAt(vertex: Vertex): void {
    const to = this.local(vertex);
    this.camera.position.add(to.clone().sub(this.focus));
    this.focus.copy(to);
    this.controls?.update();
    this.moved();
  }

  // Follows the growing end of a line
  private followGrowth([line]: Line[]): void {
    const before = this.growing[0]?.xyz ?? [];
    const ends = [line?.xyz[0], line?.xyz[line.xyz.length - 1]] as const;
    const [moved] = [...ends.entries()]
      .map(([i, end]) => ({ end, by: planDistance(end, before[i === 0 ? 0 : before.length - 1]) }))
      .sort((a, b) => b.by - a.by);
    if (moved?.end && moved.by > 0 && planDistance(moved.end, this.target) > ALONG_M) this.lookAt(moved.end);
  }

  private local(vertex: Vertex): Vector3 {
    return new Vector3(vertex[0] - this.origin[0], vertex[1] - this.origin[1], vertex[2] - this.origin[2]);
  }

  private placeCamera(from: Vector3): void {
    this.camera.position.copy(this.focus).add(from);
    this.controls?.update();
    this.draw();
  }

  private alongDrive(): void {
    const station = nearestOn(this.app.survey.path, [this.target[0], this.target[1]])?.station;
    const heading = ((station?.heading_deg ?? 0) * Math.PI) / 180;
    this.placeCamera(new Vector3(-14 * Math.sin(heading), -14 * Math.cos(heading), 7));
  }

  private toSelection(): void {
    const line = this.app.lines.get(this.app.selection[0] ?? "");
    const here = line && nearestOn(line.xyz, [this.target[0], this.target[1]]);
    if (!here) return;
    this.lookAt([...here.station.at, here.station.z]);
    this.app.emit("look", { at: here.station.at, by: NAME });
  }

  private moved(): void {
    const [e, n] = this.target;
    const { at } = this.points;
    if (!at || Math.hypot(e - at[0], n - at[1]) > RELOAD_M) this.load();
    this.draw();
  }

  private load(): void {
    if (!this.shown.visible || !this.renderer) return;
    const [e, n] = this.target;
    void this.loading.run(async () => {
      try {
        await this.points.load([e, n], this.origin, this.colouring, () => this.draw());
      } catch (error) {
        this.app.reportProblem(error);
      }
      this.showLines();
    });
  }

  private colour(colouring: Colouring): void {
    this.colouring = colouring;
    this.points.colour(colouring);
    this.draw();
  }

  private showLines(): void {
    if (!this.shown.visible || !this.renderer) return;
    const { app } = this;
    const [e, n] = this.target;
    this.lines.show(
      app.lines.values(), this.growing, app.survey.path, app.selection, [e, n], this.origin, (kind) => app.colour(kind),
    );
    this.element.dataset["lines"] = String(this.lines.drawn.length);
    this.draw();
  }

  // At most once per frame
  private draw(): void {
    if (this.isFrameRequested || !this.shown.visible) return;
    this.isFrameRequested = true;
    requestAnimationFrame(() => {
      this.isFrameRequested = false;
      this.renderer?.render(this.scene, this.camera);
      this.element.dataset["points"] = String(this.points.n);
      this.status.textContent = `${this.points.n.toLocaleString("en")} points${this.leftOut()}`;
    });
  }

  private leftOut(): string {
    const { drawn, near } = this.lines;
    return drawn.length < near ? `, the nearest ${drawn.length.toLocaleString("en")} of ${near.toLocaleString("en")} lines` : "";
  }

  private release(event: PointerEvent): void {
    const { pressed } = this;
    this.pressed = null;
    if (!pressed || event.button !== 0) return;
    if (Math.hypot(event.clientX - pressed[0], event.clientY - pressed[1]) > CLICK_PX) return;
    const box = this.canvas.getBoundingClientRect();
    const project = projectionAt(this.camera, box, event.clientX - box.left, event.clientY - box.top);
    const line = lineAt(this.lines.drawn, this.origin, project, PICK_RADIUS_PX);
    if (line) return this.app.select([line.id]);
    const point = this.points.nearest(project, PICK_RADIUS_PX);
    if (!point) return this.app.select([]);
    this.lookAt(point.at);
    this.app.emit("look", { at: [point.at[0], point.at[1]], by: NAME });
  }
}

function planDistance(a?: Vertex, b?: Vertex): number {
  return a && b ? Math.hypot(a[0] - b[0], a[1] - b[1]) : 0;
}

const MAX_DEFERRAL_MS = 1500; // a line that grows for long is still drawn now and then

// Puts off redrawing while a line grows: drawing 150,000 points without a graphics card took 0.6 s of the 0.8 s to the
// first metres of the line.
class Deferral {
  private readonly waiting = new Map<string, () => void>();
  private timer = 0;

  constructor(private readonly app: App) {
    app.on("growth", ({ state }) => {
      if (state !== "growing") this.runAll();
    });
  }

  // Run a task now or, while a line grows, later; of the tasks of one name only the last is run
  run(name: string, task: () => void, isGrowthExpected = false): void {
    if (!isGrowthExpected && this.app.following.growth.state !== "growing") return task();
    this.waiting.set(name, task);
    this.timer ||= window.setTimeout(() => this.runAll(), MAX_DEFERRAL_MS);
  }

  private runAll(): void {
    window.clearTimeout(this.timer);
    this.timer = 0;
    const tasks = [...this.waiting.values()];
    this.waiting.clear();
    for (const task of tasks) task();
  }
}
