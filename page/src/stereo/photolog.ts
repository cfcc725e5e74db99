// Photolog: the drive by chainage, a picture for each place, and the keys that the operator pressed there.

import "./photolog.css";

import * as api from "../app/api";
import type { App, Pane } from "../app/app";
import { Bar, fill } from "../controls/bar";
import { element } from "../controls/element";
import { type DriveRow, nearestRow, rowsOf } from "./photolog-rows";
import { Shown } from "../controls/visibility";
import type { OperatorKey, Pair } from "../app/documents";

const NAME = "photolog";
// All rows are as high, so that only those in sight need to be there
const ROW_PX = 66;
const ALL = "";
const ANY = "any";

export class Photolog implements Pane {
  readonly element: HTMLElement;
  private readonly filter: HTMLSelectElement;
  private readonly words: HTMLElement;
  private readonly list = element("div", { class: "photolog-list", tabindex: 0, role: "listbox", "aria-label": "Drive" });
  private readonly room = element("div", { class: "photolog-room" });
  private readonly shown: Shown;
  private pairs: Pair[] = [];
  private keys: OperatorKey[] = [];
  private rows: DriveRow[] = [];
  private current = -1;
  private isLoaded = false;

  constructor(private readonly app: App) {
    const bar = new Bar();
    this.filter = bar.choice("Operator's keys", [[ALL, "Whole drive"]], () => this.filtered());
    bar.number("go to", "Chainage", "m", { value: 0, least: 0, most: 1e7, step: 10 }, (chainage_m) => this.goTo(chainage_m));
    this.words = bar.words();
    this.list.append(this.room);
    this.element = element("div", { class: "photolog" }, bar.element, this.list);
    this.shown = new Shown(this.list, () => void this.appeared(), () => this.draw());
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
        return this.app.problem(error);
      }
      const counts = new Map<string, number>();
      for (const { key } of this.keys) counts.set(key, (counts.get(key) ?? 0) + 1);
      const each = [...counts].sort().map(([key, n]): [string, string] => [`key ${key}`, `${key} (${n})`]);
      fill(this.filter, [[ALL, "Whole drive"], [ANY, `Any key (${this.keys.length})`], ...each]);
    }
    this.filtered();
  }

  private filtered(): void {
    const { value } = this.filter;
    this.rows = rowsOf(this.pairs, this.keys).filter(
      ({ keys }) => value === ALL || keys.some(({ key }) => value === ANY || value === `key ${key}`),
    );
    this.room.style.height = `${this.rows.length * ROW_PX}px`;
    this.words.textContent = `${this.rows.length} of ${this.pairs.length} pairs`;
    this.draw();
  }

  // Rows in sight, and some above and below
  private draw(): void {
    if (!this.shown.is) return;
    const first = Math.max(0, Math.floor(this.list.scrollTop / ROW_PX) - 2);
    const last = Math.ceil((this.list.scrollTop + this.list.clientHeight) / ROW_PX) + 2;
    const there = new Map([...this.room.children].map((child) => [(child as HTMLElement).dataset["row"] ?? "", child]));
    const wanted = this.rows.slice(first, last).map((row, i) => {
      const made = there.get(row.name) ?? this.row(row);
      (made as HTMLElement).style.top = `${(first + i) * ROW_PX}px`;
      made.setAttribute("aria-selected", String(row.pair?.number === this.current));
      return made;
    });
    this.room.replaceChildren(...wanted);
  }

  private row(row: DriveRow): HTMLElement {
    const { pair, keys } = row;
    const picture = pair
      ? element("img", { src: api.thumbnailUrl(pair.number), alt: `Pair ${pair.number}`, decoding: "async" })
      : element("span", { class: "no-picture" }, "no images");
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
    this.bringInSight(this.rows.findIndex(({ pair }) => pair?.number === number));
    this.draw();
  }

  private bringInSight(i: number): void {
    const { scrollTop, clientHeight } = this.list;
    if (i < 0 || !this.shown.is) return;
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
