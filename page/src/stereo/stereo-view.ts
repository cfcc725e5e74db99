// Stereo view: both images of a pair as they were taken, the lines in them, and picking an edge in one of them.

import "./stereo-view.css";

import * as api from "../app/api";
import type { App, Pane } from "../app/app";
import { Bar } from "../controls/bar";
import { element } from "../controls/element";
import { bright } from "../controls/colours";
import { Latest, Shown } from "../controls/visibility";
import { StereoDrive } from "./drive";
import { ImageFollowing } from "./following";
import { type Px, StereoImage, type Stroke } from "./image";
import { SharedSight } from "./viewport";
import type { Pair, PairLine, PairLines, Place } from "../app/documents";

const NAME = "stereo";
const SPEEDS = [["1", "1 / s"], ["2", "2 / s"], ["5", "5 / s"], ["10", "10 / s"]] as const;
type Side = "left" | "right";

export class StereoView implements Pane {
  readonly element: HTMLElement;
  private readonly images: Record<Side, StereoImage> = { left: new StereoImage("left"), right: new StereoImage("right") };
  private readonly play: HTMLButtonElement;
  private readonly words: HTMLElement;
  private readonly answer = element("p", { class: "stereo-answer", role: "status" });
  private readonly drive: StereoDrive;
  private readonly sight: SharedSight;
  private readonly following: ImageFollowing;
  private readonly shown: Shown;
  private readonly loading = new Latest();
  private pair: Pair | null = null;
  private wanted = -1; // number of the pair that is asked for
  private loaded = -1; // number of the pair whose images are drawn
  private place: Place | null = null; // where one looks
  private lines: PairLines | null = null;

  constructor(private readonly app: App) {
    this.drive = new StereoDrive((pair) => this.go(pair), () => this.tellPlay());
    const { left, right } = this.images;
    this.sight = new SharedSight([left, right], () => this.draw(), (at, image) => this.clicked(at, image));
    this.following = new ImageFollowing(app, (number) => void this.showPair(number), () => this.draw());
    const bar = new Bar();
    bar.button("◀", "Pair before (Left)", () => this.step(-1));
    this.play = bar.button("▶▶", "Play along the drive (Shift P)", () => this.toggle());
    bar.button("▶", "Next pair (Right)", () => this.step(1));
    const speed = bar.choice("Pairs per second", SPEEDS, (value) => (this.drive.perSecond = Number(value)));
    speed.value = "2";
    bar.button("Whole", "Whole images (double click)", () => this.sight.look(null));
    this.words = bar.words();
    const both = element("div", { class: "stereo-images" }, left.canvas, right.canvas);
    this.element = element("div", { class: "stereo-view", tabindex: 0 }, bar.element, both, this.answer);
    this.shown = new Shown(both, () => void this.appeared(), () => this.draw());
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
      canvas.addEventListener("dblclick", () => app.tool !== "follow" && this.sight.look(null));
    }
    this.element.addEventListener("keydown", (event) => this.key(event));
  }

  private async appeared(): Promise<void> {
    try {
      if (this.drive.pairs.length === 0) await this.drive.load();
      const wanted = this.drive.at(this.wanted) ?? (this.place && this.drive.seeing(this.place)) ?? this.drive.pairs[0];
      if (wanted) await this.showPair(wanted.number);
    } catch (error) {
      this.app.problem(error);
    }
  }

  private async seek(place: Place): Promise<void> {
    this.place = place;
    if (this.drive.playing || this.following.is) return;
    const pair = this.drive.seeing(place);
    if (pair) await this.showPair(pair.number);
  }

  private async showPair(number: number): Promise<void> {
    this.wanted = number;
    const pair = this.drive.at(number);
    if (!pair) return; // not loaded yet: it is shown when the view is
    this.pair = pair;
    if (!this.shown.is) return;
    await this.loading.ask(async () => {
      try {
        await this.loadImages(pair);
        this.draw();
        this.lines = await api.pairLines(pair.number);
      } catch (error) {
        this.app.problem(error);
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
    if (!pair || !this.shown.is) return;
    void this.loading.ask(async () => {
      this.lines = await api.pairLines(pair.number).catch(() => null);
      this.draw();
    });
  }

  // Show a pair and take the plan along
  private async go(pair: Pair): Promise<void> {
    await this.showPair(pair.number);
    this.app.emit("pair", pair.number);
    this.app.emit("look", { at: ahead(pair), by: NAME });
  }

  private step(by: number): void {
    this.drive.pause();
    const next = this.pair && this.drive.beside(this.pair.number, by);
    if (next) void this.go(next);
  }

  private toggle(): void {
    if (this.drive.playing) this.drive.pause();
    else if (this.pair) void this.drive.play(this.pair.number);
    this.tellPlay();
  }

  private tellPlay(): void {
    this.play.textContent = this.drive.playing ? "❚❚" : "▶▶";
    this.play.setAttribute("aria-pressed", String(this.drive.playing));
  }

  private draw(): void {
    if (!this.shown.is) return;
    const number = this.pair?.number ?? -1;
    for (const image of Object.values(this.images)) {
      const here = this.following.refusedIn(number, image.side);
      image.overlay = {
        strokes: this.strokes(this.lines?.number === number ? this.lines[image.side] : []),
        seen: this.following.seenIn(number, image.side),
        refused: here?.at ?? null,
        works: here?.works ?? null,
      };
      image.draw(this.sight.now);
    }
    this.tell();
  }

  private strokes(lines: readonly PairLine[]): Stroke[] {
    const strokes = lines.map((line) => ({
      id: line.id,
      colour: bright(this.app.colour(line.kind)),
      runs: line.runs,
      bridged: line.bridged,
      chosen: this.app.selection.includes(line.id),
    }));
    return strokes.sort((a, b) => Number(a.chosen) - Number(b.chosen));
  }

  private tell(): void {
    const { pair } = this;
    const nth = this.drive.pairs.findIndex(({ number }) => number === pair?.number) + 1;
    this.words.textContent = pair ? `${pair.chainage_m.toFixed(1)} m · pair ${nth} of ${this.drive.pairs.length}` : "";
    this.words.title = pair ? `${pair.left}, ${pair.right}` : "";
    this.element.dataset["pair"] = String(pair?.number ?? "");
    const overlays = Object.values(this.images).map(({ overlay }) => overlay);
    this.element.dataset["strokes"] = String(Math.min(...overlays.map(({ strokes }) => strokes.length)));
    this.element.dataset["seen"] = String(overlays.reduce((sum, { seen }) => sum + seen.length, 0));
    this.answer.textContent = this.following.answer;
  }

  private clicked(at: Px, image: StereoImage): void {
    this.element.focus({ preventScroll: true });
    if (this.app.tool === "follow") {
      if (!this.pair || !image.holds(at)) return;
      this.drive.pause();
      this.following.pick(this.pair.number, image.side, at);
      return;
    }
    const id = image.lineAt(at, this.sight.now);
    this.app.select(id ? [id] : []);
  }

  private key(event: KeyboardEvent): void {
    if (event.target instanceof HTMLSelectElement || event.ctrlKey || event.altKey || event.metaKey) return;
    const does: Record<string, () => void> = {
      ArrowLeft: () => this.step(-1),
      ArrowRight: () => this.step(1),
      P: () => this.toggle(),
    };
    const done = does[event.key];
    if (!done) return;
    done();
    event.preventDefault();
    event.stopPropagation();
  }
}

// Where the images look: the road ahead, not the van
function ahead(pair: Pair): Place {
  const heading = (pair.heading_deg * Math.PI) / 180;
  return [pair.at[0] + 8 * Math.sin(heading), pair.at[1] + 8 * Math.cos(heading)];
}

