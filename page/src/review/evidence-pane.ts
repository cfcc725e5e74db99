// The evidence of the queue's item: what the points show across and along its line, with a fit and what it leaves, and the
// images that see it. The keys of the queue decide.

import "./evidence-pane.css";

import * as api from "../app/api";
import type { App } from "../app/app";
import type { Across, Along, Evidence, Pair, PairLine, QueueItem } from "../app/documents";
import { brightened, CANVAS } from "../controls/colours";
import { element } from "../controls/element";
import type { Pane } from "../controls/tabs";
import { LatestTask, Visibility } from "../controls/visibility";
import { StereoDrive } from "../stereo/drive";
import { Chart } from "./chart";
import { decisionText, itemTitle } from "./item-titles";

const MOST_IMAGES = 3;
const IMAGE_PX = 720; // width of the canvas of an image
// Of an image about the item's lines: least share of its width that is shown, and margin on each side as a share of theirs
const LEAST_SHARE = 1 / 3;
const MARGIN = 0.2;

interface Part {
  x: number;
  y: number;
  width: number;
  height: number;
}

export class EvidencePane implements Pane {
  readonly element = element("div", { class: "evidence-pane", tabindex: 0 });
  private readonly shown: Visibility;
  private readonly loading = new LatestTask();
  private readonly drive = new StereoDrive(() => Promise.resolve(), () => undefined);
  private item: QueueItem | null = null;

  constructor(private readonly app: App) {
    app.on("item", (item) => {
      this.item = item;
      this.load();
    });
    app.on("lines", () => this.load());
    this.shown = new Visibility(this.element, () => this.load(), () => undefined);
    this.clear();
  }

  private clear(): void {
    delete this.element.dataset["key"];
    this.fill(element("p", { class: "empty" }, "Press N for the first item of the queue: what the points and images show of it appears here."));
  }

  private load(): void {
    const { item } = this;
    if (!this.shown.visible) return;
    if (item === null) return this.clear();
    if (this.element.dataset["key"] !== item.key) this.announce(item);
    void this.loading.run(async () => {
      if (this.item !== item) return;
      const line = item.type === "boundary" ? "" : (item.ids[0] ?? "");
      if (line !== "" && !this.app.lines.has(line)) return this.say("This line is no longer there.");
      try {
        const found = item.type === "stretch" ? null : await api.evidence(item.kind, item.at, line, item.type === "gap");
        if (this.item !== item) return;
        this.show(item, found);
        // The next item does not wait for them
        void this.showImages(item).catch((error: unknown) => this.app.reportProblem(error));
      } catch (error) {
        if (this.item === item) this.say("What the points and images show could not be loaded.");
        this.app.reportProblem(error);
      }
    });
  }

  private say(text: string): void {
    const status = this.element.querySelector("[role=status]");
    if (status) status.textContent = text;
  }

  // At once: the keys decide on this item, so nothing of the one before may be seen
  private announce(item: QueueItem): void {
    delete this.element.dataset["key"];
    this.fill(
      element("h3", {}, itemTitle(this.app, item)),
      factList([["Why it is here", item.reason]]),
      element("p", { class: "empty", role: "status" }, "Loading what the points and images show …"),
      element("p", { class: "decide" }, decisionText(item)),
    );
  }

  private show(item: QueueItem, found: Evidence | null): void {
    const { across, along, facts } = found ?? { across: null, along: null, facts: [["What to look for", "lines that are wrong, missing, or end too early"]] };
    const title = itemTitle(this.app, item);
    const line = this.app.lines.get(item.ids[0] ?? "");
    const bridged = line && line.bridged_m > 0 ? [["Bridged", `${line.bridged_m.toFixed(1)} of ${line.length_m.toFixed(1)} m: nothing was measured there`]] : [];
    // A key decides on all of them
    const others = isOfMany(item) ? [["Shown here", `the first of ${item.ids.length} lines`]] : [];
    const isOfImages = across === null && this.app.survey.n_points === 0;
    this.fill(
      element("h3", {}, title),
      factList([["Why it is here", item.reason], ...others, ...facts, ...bridged]),
      ...(across ? [acrossChart(across)] : found === null || isOfImages ? [] : [element("p", { class: "empty" }, "This survey has no points here.")]),
      ...(along && along.values.length > 1 ? [alongChart(along)] : []),
      element("div", { class: isOfImages ? "evidence-images large" : "evidence-images" }),
      element("p", { class: "decide" }, decisionText(item)),
    );
    this.element.dataset["key"] = item.key;
  }

  private fill(...children: HTMLElement[]): void {
    this.element.replaceChildren(...children);
  }

  // The images that see the place best, with the item's lines in them
  private async showImages(item: QueueItem): Promise<void> {
    const row = this.element.querySelector(".evidence-images");
    if (this.app.survey.n_pairs === 0 || row === null) return;
    if (this.drive.pairs.length === 0) await this.drive.load();
    if (this.item !== item) return;
    const best = this.drive.seeing(item.at);
    if (!best) return;
    const at = this.drive.pairs.indexOf(best);
    const pairs = this.drive.pairs.slice(Math.max(0, at - 1), at - 1 + MOST_IMAGES);
    // One after the other: a browser makes six requests at a time, and the next item needs some
    const images: HTMLElement[] = [];
    for (const pair of pairs) {
      images.push(await this.image(pair, item));
      if (this.item !== item) return;
    }
    row.replaceChildren(...images);
  }

  private async image(pair: Pair, item: QueueItem): Promise<HTMLElement> {
    const [left, { left: lines, width, height }] = await Promise.all([this.drive.image(pair.number, "left"), api.pairLines(pair.number)]);
    const shown = isOfMany(item) ? item.ids.slice(0, 1) : item.ids;
    const own = lines.filter(({ id }) => shown.includes(id));
    const part = partAbout(own, width, height);
    const scale = IMAGE_PX / part.width;
    const canvas = element("canvas", { width: IMAGE_PX, height: Math.round(part.height * scale) });
    const context = canvas.getContext("2d")!;
    context.drawImage(left, part.x, part.y, part.width, part.height, 0, 0, canvas.width, canvas.height);
    for (const line of own) drawLine(context, line, part, scale, brightened(this.app.colour(line.kind)));
    const title = `Show pair ${pair.number}, ${pair.chainage_m.toFixed(1)} m along the drive`;
    canvas.setAttribute("role", "img");
    canvas.dataset["part"] = [part.x, part.y, part.width, part.height].map(Math.round).join(" ");
    canvas.setAttribute("aria-label", `${itemTitle(this.app, item)} in pair ${pair.number}`);
    return element("button", { type: "button", title, "aria-label": title, click: () => this.app.emit("pair", pair.number) }, canvas);
  }
}

function isOfMany({ type, ids }: QueueItem): boolean {
  return ["rest", "sure"].includes(type) && ids.length > 1;
}

function factList(facts: string[][]): HTMLElement {
  return element("dl", { class: "evidence-facts" }, ...facts.map(([name, value]) =>
    element("div", {}, element("dt", {}, name!), element("dd", {}, value!))));
}

// The part of an image that shows lines, in the image's proportions; all of it where none is in it
function partAbout(lines: PairLine[], width: number, height: number): Part {
  const places = lines.flatMap(({ runs }) => runs.flat());
  if (places.length === 0) return { x: 0, y: 0, width, height };
  const [xs, ys] = [places.map(([x]) => x), places.map(([, y]) => y)];
  const [west, east, top, foot] = [Math.min(...xs), Math.max(...xs), Math.min(...ys), Math.max(...ys)];
  const share = Math.min(1, Math.max(LEAST_SHARE, (1 + 2 * MARGIN) * Math.max((east - west) / width, (foot - top) / height)));
  const within = (middle: number, size: number): number => Math.min(Math.max(middle - (share * size) / 2, 0), (1 - share) * size);
  return { x: within((west + east) / 2, width), y: within((top + foot) / 2, height), width: share * width, height: share * height };
}

function drawLine(context: CanvasRenderingContext2D, line: PairLine, part: Part, scale: number, colour: string): void {
  line.runs.forEach((run, i) => {
    context.setLineDash(line.bridged[i] ? [6, 5] : []);
    context.strokeStyle = colour;
    context.lineWidth = 2;
    context.beginPath();
    run.forEach(([x, y], k) => {
      const at: [number, number] = [(x - part.x) * scale, (y - part.y) * scale];
      if (k === 0) context.moveTo(...at);
      else context.lineTo(...at);
    });
    context.stroke();
  });
}

function acrossChart({ label, points, bins, fit, residuals, middle }: Across): HTMLElement {
  const values = [...points, ...fit].map(([, value]) => value).sort((a, b) => a - b);
  // Stray points must not flatten the rest
  const [low, high] = [values[Math.floor(values.length * 0.01)] ?? 0, values[Math.ceil(values.length * 0.99) - 1] ?? 1];
  const margin = Math.max(0.15 * (high - low), 0.02);
  const offsets = [...points, ...bins].map(([offset]) => offset);
  const range: [number, number] = [Math.min(-0.1, ...offsets), Math.max(0.1, ...offsets)];
  const chart = new Chart(`${label} across the line; offset [m], right positive`, 130, range, [low - margin, high + margin]);
  chart.dots(points, CANVAS.axis);
  chart.vertical(0, "#ffb000");
  chart.dots(bins, CANVAS.text, 2);
  chart.path(fit, "#7fd4ff");
  if (middle) chart.cross(middle, "#7fd4ff");
  if (residuals.length === 0) return chart.element;
  const greatest = Math.max(0.001, ...residuals.map(([, value]) => Math.abs(value)));
  const rest = new Chart("What the fit leaves", 56, range, [-greatest * 1.2, greatest * 1.2]);
  rest.path(residuals, "#ff9d94");
  return element("div", {}, chart.element, rest.element);
}

function alongChart({ label, values, stretch }: Along): HTMLElement {
  const all = values.map(([, value]) => value);
  const [low, high] = [Math.min(0, ...all), Math.max(0, ...all)];
  const margin = Math.max(0.1 * (high - low), 0.02);
  const chart = new Chart(`${label}, by chainage [m]`, 80, stretch, [low - margin, high + margin]);
  chart.path(values, "#ffd54a", 2.5);
  chart.dots(values, "#ffd54a", 2);
  return chart.element;
}
