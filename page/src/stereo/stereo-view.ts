// The stereo view: both raw images of a pair, the lines in them, and following a line from a pixel.

import "./stereo-view.css";

import * as api from "../app/api";
import type { App } from "../app/app";
import type { Pane } from "../controls/tabs";
import { Bar } from "../controls/bar";
import { element } from "../controls/element";
import { brightened } from "../controls/colours";
import { LatestTask, Visibility } from "../controls/visibility";
import { roadAhead, StereoDrive } from "./drive";
import { ImageFollowing } from "./following";
import { type Px, StereoImage, type Stroke } from "./image";
import { SharedViewport } from "./viewport";
import type { Pair, PairLine, PairLines, Place } from "../app/documents";

const NAME = "stereo";
const SPEEDS = [["1", "1 pair/s"], ["2", "2 pairs/s"], ["5", "5 pairs/s"], ["10", "10 pairs/s"]] as const;
type Side = "left" | "right";

export class StereoView implements Pane {
  readonly element: HTMLElement;
  private readonly images: Record<Side, StereoImage> = { left: new StereoImage("left"), right: new StereoImage("right") };
  private readonly play: HTMLButtonElement;
  private readonly status: HTMLElement;
  private readonly refusal = element("p", { class: "stereo-answer", role: "status" });
  private readonly drive: StereoDrive;
  private readonly viewport: SharedViewport;
  private readonly following: ImageFollowing;
  private readonly shown: Visibility;
  private readonly loading = new LatestTask();
  private pair: Pair | null = null;
  private requested = -1; // number of the pair to show
  private loaded = -1; // number of the pair whose images are on the canvases
  private place: Place | null = null; // where the other views look
  private lines: PairLines | null = null;

  constructor(private readonly app: App) {
    this.drive = new StereoDrive((pair) => this.go(pair), () => this.updatePlayButton());
    const { left, right } = this.images;
    this.viewport = new SharedViewport([left, right], () => this.draw(), (at, image) => this.clicked(at, image));
    this.following = new ImageFollowing(app, (number) => void this.showPair(number), () => this.draw());
    const bar = new Bar();
    bar.button("◀", "Previous pair (Left)", () => this.step(-1));
    this.play = bar.button("▶▶", "Play the drive (Shift P)", () => this.toggle());
    bar.button("▶", "Next pair (Right)", () => this.step(1));
    const speed = bar.choice("Pairs per second", SPEEDS, (value) => (this.drive.perSecond = Number(value)));
    speed.value = "2";
    bar.button("Fit", "Show the whole images (double-click)", () => this.viewport.show(null));
    this.status = bar.status();
    const both = element("div", { class: "stereo-images" }, left.canvas, right.canvas);
    this.element = element("div", { class: "stereo-view", tabindex: 0 }, bar.element, both, this.refusal);
    this.shown = new Visibility(both, () => void this.appeared(), () => this.draw());
    this.listen();
  }

  resized(): void {
    this.draw();
  }

  private listen(): void {
    const { app } = this;
    app.on("look", ({ at, by }) => by !== NAME && by !== "photolog" && this.seek(at));
    app.on("pair", (number) => void this.showPair(number));
    app.on("lines", () => this.loadLines());
    app.on("selection", () => this.draw());
    for (const { canvas } of Object.values(this.images)) {
      canvas.addEventListener("dblclick", () => app.tool !== "follow" && this.viewport.show(null));
    }
    this.element.addEventListener("keydown", (event) => this.key(event));
  }

  private async appeared(): Promise<void> {
    try {
      if (this.drive.pairs.length === 0) await this.drive.load();
      const pair = this.drive.at(this.requested) ?? (this.place && this.drive.seeing(this.place)) ?? this.drive.pairs[0];
      if (pair) await this.showPair(pair.number);
    } catch (error) {
      this.app.reportProblem(error);
    }
  }

  private async seek(place: Place): Promise<void> {
    this.place = place;
    if (this.drive.playing || this.following.isGrowing) return;
    const pair = this.drive.seeing(place);
    if (pair) await this.showPair(pair.number);
  }

  private async showPair(number: number): Promise<void> {
    this.requested = number;
    const pair = this.drive.at(number);
    if (!pair) return; // pairs not loaded yet: shown when the view appears
    this.pair = pair;
    if (!this.shown.visible) return;
    await this.loading.run(async () => {
      try {
        await this.loadImages(pair);
        this.draw();
        this.lines = await api.pairLines(pair.number);
      } catch (error) {
        this.app.reportProblem(error);
      }
      this.draw();
    });
  }

  private async loadImages(pair: Pair): Promise<void> {
    if (this.loaded === pair.number) return;
    const [left, right] = await this.drive.images(pair.number);
    this.lines = null;
    this.images.left.take(left);
    this.images.right.take(right);
    this.loaded = pair.number;
    const next = this.drive.beside(pair.number, 1);
    if (next && this.drive.playing) void this.drive.images(next.number).catch(() => undefined);
  }

  private loadLines(): void {
    const { pair } = this;
    if (!pair || !this.shown.visible) return;
    void this.loading.run(async () => {
      this.lines = await api.pairLines(pair.number).catch(() => null);
      this.draw();
    });
  }

  // Show a pair and move the other views there
  private async go(pair: Pair): Promise<void> {
    await this.showPair(pair.number);
    this.app.emit("pair", pair.number);
    this.app.emit("look", { at: roadAhead(pair), by: NAME });
  }

  private step(by: number): void {
    this.drive.pause();
    const next = this.pair && this.drive.beside(this.pair.number, by);
    if (next) void this.go(next);
  }

  private toggle(): void {
    if (this.drive.playing) this.drive.pause();
    else if (this.pair) void this.drive.play(this.pair.number);
    this.updatePlayButton();
  }

  private updatePlayButton(): void {
    this.play.textContent = this.drive.playing ? "❚❚" : "▶▶";
    this.play.setAttribute("aria-pressed", String(this.drive.playing));
  }

  private draw(): void {
    if (!this.shown.visible) return;
    const number = this.pair?.number ?? -1;
    for (const image of Object.values(this.images)) {
      const refusal = this.following.refusedIn(number, image.side);
      image.overlay = {
        strokes: this.strokes(this.lines?.number === number ? this.lines[image.side] : []),
        sighting: this.following.sightingIn(number, image.side),
        refused: refusal?.at ?? null,
        suggestion: refusal?.suggestion ?? null,
      };
      image.draw(this.viewport.current);
    }
    this.describe();
  }

  private strokes(lines: readonly PairLine[]): Stroke[] {
    const strokes = lines.map((line) => ({
      id: line.id,
      colour: brightened(this.app.colour(line.kind)),
      runs: line.runs,
      bridged: line.bridged,
      selected: this.app.selection.includes(line.id),
    }));
    return strokes.sort((a, b) => Number(a.selected) - Number(b.selected));
  }

  private describe(): void {
    const { pair } = this;
    const nth = this.drive.pairs.findIndex(({ number }) => number === pair?.number) + 1;
    this.status.textContent = pair ? `${pair.chainage_m.toFixed(1)} m · pair ${nth} of ${this.drive.pairs.length}` : "";
    this.status.title = pair ? `${pair.left}, ${pair.right}` : "";
    this.element.dataset["pair"] = String(pair?.number ?? "");
    const overlays = Object.values(this.images).map(({ overlay }) => overlay);
    this.element.dataset["strokes"] = String(Math.min(...overlays.map(({ strokes }) => strokes.length)));
    this.element.dataset["seen"] = String(overlays.reduce((sum, { sighting }) => sum + sighting.length, 0));
    this.refusal.textContent = this.following.refusalText;
  }

  private clicked(at: Px, image: StereoImage): void {
    this.element.focus({ preventScroll: true });
    if (this.app.tool === "follow") {
      if (!this.pair || !image.contains(at)) return;
      this.drive.pause();
      this.following.pick(this.pair.number, image.side, at);
      return;
    }
    const id = image.lineAt(at, this.viewport.current);
    this.app.select(id ? [id] : []);
  }

  private key(event: KeyboardEvent): void {
    if (event.target instanceof HTMLSelectElement || event.ctrlKey || event.altKey || event.metaKey) return;
    const actions: Record<string, () => void> = {
      ArrowLeft: () => this.step(-1),
      ArrowRight: () => this.step(1),
      P: () => this.toggle(),
    };
    const action = actions[event.key];
    if (!action) return;
    action();
    event.preventDefault();
    event.stopPropagation();
  }
}
