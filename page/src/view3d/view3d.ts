// 3-D view: points around where one looks, and the lines. Drawn when something changes, never in an endless loop:
// where there is no graphics card, a picture takes a tenth of a second.

import "./view3d.css";

import { Color, ColorManagement, LinearSRGBColorSpace, PerspectiveCamera, Scene, Vector3, WebGLRenderer } from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";

import { nearestOn } from "../app/along-line";
import type { App, Pane } from "../app/app";
import { Bar } from "../controls/bar";
import { element } from "../controls/element";
import { type Colouring, COLOURINGS, INK } from "../controls/colours";
import { Latest, Shown } from "../controls/visibility";
import { Calm } from "./deferral";
import { SpaceLines } from "./lines";
import { lineAt, seenFrom } from "./pick";
import { PointRings, RELOAD_M } from "./points";
import type { Line, Place, Vertex } from "../app/documents";

// Colours are drawn as they are given
ColorManagement.enabled = false;

const NAME = "3-D";
const CLICK_PX = 4;
const NEAR_PX = 8;
const ALONG_M = 8; // the eye stands some 15 m away: what is farther from where it looks leaves the picture

export class ThreeView implements Pane {
  readonly element: HTMLElement;
  private readonly canvas = element("canvas", { "aria-label": "3-D view", tabindex: 0 });
  private readonly words: HTMLElement;
  private readonly shown: Shown;
  private readonly loading = new Latest();
  private readonly scene = new Scene();
  private readonly camera = new PerspectiveCamera(50, 1, 0.3, 2000);
  private readonly points: PointRings;
  private readonly lines = new SpaceLines();
  private readonly origin: Vertex; // what is drawn is measured from here
  private readonly focus = new Vector3(); // what the eye turns about, from the origin
  private renderer: WebGLRenderer | null = null;
  private controls: OrbitControls | null = null;
  private colouring: Colouring = "intensity";
  private growing: Line[] = [];
  private asked = false;
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
    bar.button("From above", "Look straight down", () => this.eye(new Vector3(0, -0.01, 25)));
    bar.button("Along", "Look along the drive", () => this.alongDrive());
    this.words = bar.words();
    this.element = element("div", { class: "three-view" }, bar.element, this.canvas);
    this.scene.background = new Color(INK.canvas);
    this.scene.add(this.points.group, this.lines.group);
    this.camera.up.set(0, 0, 1);
    this.shown = new Shown(this.canvas, () => this.appeared(), () => this.resized());
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
    const calm = new Calm(app, () => app.following.growth.state === "growing");
    app.on("look", ({ at, by }) => {
      const isPick = by === "plan" && app.tool === "follow"; // a line is about to grow there
      if (by !== NAME) calm.when("look", () => this.lookAt([at[0], at[1], this.ground(at)]), isPick || undefined);
    });
    app.on("selection", () => this.showLines());
    app.on("lines", () => this.showLines());
    app.on("growing", ({ lines }) =>
      calm.when("growing", () => {
        this.goAlong(lines);
        this.growing = lines;
        this.showLines();
      }),
    );
    canvas.addEventListener("pointerdown", (event) => (this.pressed = [event.clientX, event.clientY]));
    canvas.addEventListener("pointerup", (event) => this.release(event));
  }

  // The context is made when the view is first seen; where there is no WebGL the page goes on without it
  private appeared(): void {
    if (!this.renderer) {
      try {
        this.renderer = new WebGLRenderer({ canvas: this.canvas, antialias: true });
        this.renderer.outputColorSpace = LinearSRGBColorSpace;
      } catch {
        this.words.textContent = "This browser has no WebGL: there is no 3-D view.";
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

  private ground(place: Place): number {
    return nearestOn(this.app.survey.path, place)?.station.z ?? this.origin[2];
  }

  // The eye goes along, at its distance and direction
  private lookAt(vertex: Vertex): void {
    const to = this.local(vertex);
    this.camera.position.add(to.clone().sub(this.focus));
    this.focus.copy(to);
    this.controls?.update();
    this.moved();
  }

  // Where a line grows, the view goes along with its end
  private goAlong([line]: Line[]): void {
    const before = this.growing[0]?.xyz ?? [];
    const ends = [line?.xyz[0], line?.xyz[line.xyz.length - 1]] as const;
    const [moved] = [...ends.entries()]
      .map(([i, end]) => ({ end, by: apart(end, before[i === 0 ? 0 : before.length - 1]) }))
      .sort((a, b) => b.by - a.by);
    if (moved?.end && moved.by > 0 && apart(moved.end, this.target) > ALONG_M) this.lookAt(moved.end);
  }

  private local(vertex: Vertex): Vector3 {
    return new Vector3(vertex[0] - this.origin[0], vertex[1] - this.origin[1], vertex[2] - this.origin[2]);
  }

  private eye(from: Vector3): void {
    this.camera.position.copy(this.focus).add(from);
    this.controls?.update();
    this.draw();
  }

  private alongDrive(): void {
    const station = nearestOn(this.app.survey.path, [this.target[0], this.target[1]])?.station;
    const heading = ((station?.heading_deg ?? 0) * Math.PI) / 180;
    this.eye(new Vector3(-14 * Math.sin(heading), -14 * Math.cos(heading), 7));
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
    if (!this.shown.is || !this.renderer) return;
    const [e, n] = this.target;
    void this.loading.ask(async () => {
      try {
        await this.points.load([e, n], this.origin, this.colouring, () => this.draw());
      } catch (error) {
        this.app.problem(error);
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
    if (!this.shown.is || !this.renderer) return;
    const { app } = this;
    const [e, n] = this.target;
    this.lines.show(
      app.lines.values(), this.growing, app.survey.path, app.selection, [e, n], this.origin, (kind) => app.colour(kind),
    );
    this.element.dataset["lines"] = String(this.lines.drawn.length);
    this.draw();
  }

  // Once per picture, however often it is asked for
  private draw(): void {
    if (this.asked || !this.shown.is) return;
    this.asked = true;
    requestAnimationFrame(() => {
      this.asked = false;
      this.renderer?.render(this.scene, this.camera);
      this.element.dataset["points"] = String(this.points.n);
      this.words.textContent = `${this.points.n.toLocaleString("en")} points`;
    });
  }

  private release(event: PointerEvent): void {
    const { pressed } = this;
    this.pressed = null;
    if (!pressed || event.button !== 0) return;
    if (Math.hypot(event.clientX - pressed[0], event.clientY - pressed[1]) > CLICK_PX) return;
    const box = this.canvas.getBoundingClientRect();
    const seen = seenFrom(this.camera, box, event.clientX - box.left, event.clientY - box.top);
    const line = lineAt(this.lines.drawn, this.origin, seen, NEAR_PX);
    if (line) return this.app.select([line.id]);
    const point = this.points.nearest(seen, NEAR_PX);
    if (!point) return this.app.select([]);
    this.lookAt(point.at);
    this.app.emit("look", { at: [point.at[0], point.at[1]], by: NAME });
  }
}

function apart(a?: Vertex, b?: Vertex): number {
  return a && b ? Math.hypot(a[0] - b[0], a[1] - b[1]) : 0;
}
