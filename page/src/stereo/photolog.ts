// Photolog: the drive by chainage, with an image for each pair and the keys that the operator pressed there.

import "./photolog.css";
import * as api from "../app/api";
import type { App } from "../app/app";
import type { Pane } from "../controls/tabs";
import { Bar, fill } from "../controls/bar";
import { element } from "../controls/element";
import { Visibility } from "../controls/visibility";
import type { OperatorKey, Pair, Vertex } from "../app/documents";

const NAME = "photolog";
const ROW_PX = 66; // fixed, so that only visible rows need to exist; as in photolog.css
const WHOLE_DRIVE = "";
const ANY_KEY = "any";

export class Photolog implements Pane {
  readonly element: HTMLElement;
  private readonly filter: HTMLSelectElement;
  private readonly status: HTMLElement;
  private readonly list = element("div", { class: "photolog-list", tabindex: 0, role: "listbox", "aria-label": "Drive" });
  private readonly scrolled = element("div", { class: "photolog-room" });
  private readonly shown: Visibility;
  private pairs: Pair[] = [];
  private keys: OperatorKey[] = [];
  private rows: DriveRow[] = [];
  private current = -1;
  private isLoaded = false;

  constructor(private readonly app: App) {
    const bar = new Bar();
    this.filter = bar.choice("Operator keys", [[WHOLE_DRIVE, "Whole drive"]], () => this.filterRows());
    bar.number("go to", "Chainage", "m", { value: 0, min: 0, max: 1e7, step: 10 }, (chainage_m) => this.goTo(chainage_m));
    this.status = bar.status();
    this.list.append(this.scrolled);
    this.element = element("div", { class: "photolog" }, bar.element, this.list);
    this.shown = new Visibility(this.list, () => void this.appeared(), () => this.draw());
    this.list.addEventListener("scroll", () => this.draw());
    this.list.addEventListener("keydown", (event) => this.key(event));
    app.on("pair", (number) => this.mark(number));
  }

  resized(): void {
    this.draw();
  }

  private async appeared(): Promise<void> {
    if (!this.isLoaded) {
      try {
        [this.pairs, this.keys] = await Promise.all([api.pairs(), api.keys()]);
        this.isLoaded = true;
      } catch (error) {
        return this.app.reportProblem(error);
      }
      const counts = new Map<string, number>();
      for (const { key } of this.keys) counts.set(key, (counts.get(key) ?? 0) + 1);
      const each = [...counts].sort().map(([key, n]): [string, string] => [`key ${key}`, `${key} (${n})`]);
      fill(this.filter, [[WHOLE_DRIVE, "Whole drive"], [ANY_KEY, `Any key (${this.keys.length})`], ...each]);
    }
    this.filterRows();
  }

  private filterRows(): void {
    const { value } = this.filter;
    this.rows = rowsOf(this.pairs, this.keys).filter(
      ({ keys }) => value === WHOLE_DRIVE || keys.some(({ key }) => value === ANY_KEY || value === `key ${key}`),
    );
    this.scrolled.style.height = `${this.rows.length * ROW_PX}px`;
    this.status.textContent = `${this.rows.length} of ${this.pairs.length} pairs`;
    this.draw();
  }

  // The visible rows, and a few above and below
  private draw(): void {
    if (!this.shown.visible) return;
    const first = Math.max(0, Math.floor(this.list.scrollTop / ROW_PX) - 2);
    const last = Math.ceil((this.list.scrollTop + this.list.clientHeight) / ROW_PX) + 2;
    const existing = new Map([...this.scrolled.children].map((child) => [(child as HTMLElement).dataset["row"] ?? "", child]));
    const visible = this.rows.slice(first, last).map((row, i) => {
      const rowElement = existing.get(row.name) ?? this.row(row);
      (rowElement as HTMLElement).style.top = `${(first + i) * ROW_PX}px`;
      rowElement.setAttribute("aria-selected", String(row.pair?.number === this.current));
      return rowElement;
    });
    this.scrolled.replaceChildren(...visible);
  }

  private row(row: DriveRow): HTMLElement {
    const { pair, keys } = row;
    const picture = pair
      ? element("img", { src: api.thumbnailUrl(pair.number), alt: `Pair ${pair.number}`, decoding: "async" })
      : element("span", { class: "no-picture" }, "no image");
    const chips = keys.map(({ key, note }) => element("span", { class: "key" }, element("kbd", {}, key), note));
    const place = element("span", { class: "chainage" }, `${row.chainage_m.toFixed(1)} m`);
    const time = element("span", { class: "time" }, `${row.time_s.toFixed(2)} s`);
    return element(
      "div", { class: "photolog-row", role: "option", "data-row": row.name, click: () => this.show(row) },
      picture, element("div", {}, element("div", {}, place, time), ...chips),
    );
  }

  private show(row: DriveRow): void {
    if (row.pair) {
      this.mark(row.pair.number);
      this.app.emit("pair", row.pair.number);
    }
    this.app.emit("look", { at: [row.at[0], row.at[1]], by: NAME });
  }

  private mark(number: number): void {
    this.current = number;
    this.scrollTo(this.rows.findIndex(({ pair }) => pair?.number === number));
    this.draw();
  }

  private scrollTo(i: number): void {
    const { scrollTop, clientHeight } = this.list;
    if (i < 0 || !this.shown.visible) return;
    if (i * ROW_PX < scrollTop) this.list.scrollTop = i * ROW_PX;
    else if ((i + 1) * ROW_PX > scrollTop + clientHeight) this.list.scrollTop = (i + 1) * ROW_PX - clientHeight;
  }

  private goTo(chainage_m: number): void {
    const row = this.rows[nearestRow(this.rows, chainage_m)];
    if (row) this.show(row);
  }

  private key(event: KeyboardEvent): void {
    const by = { ArrowUp: -1, ArrowDown: 1, PageUp: -5, PageDown: 5 }[event.key];
    if (by === undefined) return;
    const at = this.rows.findIndex(({ pair }) => pair?.number === this.current);
    const row = this.rows[Math.min(this.rows.length - 1, Math.max(0, at + by))];
    if (row) this.show(row);
    event.preventDefault();
    event.stopPropagation();
  }
}

// A pair and the operator keys nearest to it in time; in a survey without images, a key alone
interface DriveRow {
  name: string;
  chainage_m: number;
  time_s: number;
  at: Vertex;
  pair: Pair | null;
  keys: OperatorKey[];
}

function rowsOf(pairs: readonly Pair[], keys: readonly OperatorKey[]): DriveRow[] {
  const rows = pairs.map((pair): DriveRow => ({ ...positionOf(pair), name: `pair ${pair.number}`, pair, keys: [] }));
  rows.sort((a, b) => a.time_s - b.time_s);
  keys.forEach((key, i) => {
    const nearby = rows[nearestTime(rows, key.time_s)];
    if (nearby?.pair) nearby.keys.push(key);
    else rows.push({ ...positionOf(key), name: `key ${i}`, pair: null, keys: [key] });
  });
  return rows;
}

function positionOf({ chainage_m, time_s, at }: Pair | OperatorKey): Pick<DriveRow, "chainage_m" | "time_s" | "at"> {
  return { chainage_m, time_s, at };
}

// By time, not by chainage: a drive may pass a place twice
function nearestTime(rows: readonly DriveRow[], time_s: number): number {
  return nearest(rows, (row) => Math.abs(row.time_s - time_s));
}

function nearestRow(rows: readonly DriveRow[], chainage_m: number): number {
  return nearest(rows, (row) => Math.abs(row.chainage_m - chainage_m));
}

function nearest(rows: readonly DriveRow[], distanceTo: (row: DriveRow) => number): number {
  let best = -1;
  let least = Infinity;
  rows.forEach((row, i) => {
    const distance = distanceTo(row);
    if (distance < least) [best, least] = [i, distance];
  });
  return best;
}
