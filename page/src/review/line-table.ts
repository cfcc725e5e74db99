// The table of lines: those that the filter shows, sorted by a column. A row selects its line; what is done to the
// selection (accept, reject, kind, role ...) is done to all selected rows at once.

import "./line-table.css";
import type { App } from "../app/app";
import { type Limits, medianOf, REJECTED, sigmaOf } from "../app/filter";
import type { Line } from "../app/documents";
import { Bar, fill } from "../controls/bar";
import { element } from "../controls/element";
import type { Pane } from "../controls/tabs";
import { Visibility } from "../controls/visibility";

const ROW_PX = 24; // as in line-table.css
const BEYOND = 8; // rows drawn above and below the view, for scrolling

interface Column {
  name: string;
  title: string;
  value: (line: Line, app: App) => number | string; // by which it is sorted
  text?: (line: Line) => string;
}

const centimetres = (value: number | null) => (value === null ? "" : (100 * value).toFixed(1));

const COLUMNS: Column[] = [
  { name: "kind", title: "Kind", value: (line, app) => app.title(line.kind) },
  { name: "length", title: "Length m", value: (line) => line.length_m, text: (line) => line.length_m.toFixed(1) },
  { name: "confidence", title: "Conf.", value: (line) => line.confidence, text: (line) => line.confidence.toFixed(2) },
  { name: "sigma", title: "σ cm", value: (line) => sigmaOf(line) ?? Infinity, text: (line) => centimetres(sigmaOf(line)) },
  { name: "sigma-z", title: "σ z cm", value: (line) => medianOf(line.sigma_z_m) ?? Infinity, text: (line) => centimetres(medianOf(line.sigma_z_m)) },
  { name: "bridged", title: "Bridged m", value: (line) => line.bridged_m, text: (line) => (line.bridged_m > 0 ? line.bridged_m.toFixed(1) : "") },
  { name: "review", title: "Review", value: (line) => line.review },
  { name: "role", title: "Role", value: (line) => line.role },
  { name: "pattern", title: "Pattern", value: (line) => line.pattern },
  { name: "form", title: "Form", value: (line) => line.form },
  { name: "note", title: "Note", value: (line) => line.note },
];
const NUMBERS = new Set(["length", "confidence", "sigma", "sigma-z", "bridged"]);

export class LineTable implements Pane {
  readonly element: HTMLElement;
  private listed: Line[] = [];
  private readonly bar = new Bar();
  private readonly head = element("div", { class: "head", role: "row" });
  private readonly rows = element("div", { class: "rows", role: "rowgroup" });
  private readonly grid: HTMLElement;
  private readonly scroll: HTMLElement;
  private readonly visibility: Visibility;
  private readonly status: HTMLElement;
  private sorted = { by: "kind", descending: false };
  private anchor = 0; // row from which Shift extends the selection
  private at = 0; // row of the keyboard
  private isStale = true;

  constructor(private readonly app: App) {
    this.grid = element("div", {
      class: "grid", role: "grid", "aria-label": "Lines", "aria-multiselectable": "true",
    }, element("div", { role: "rowgroup" }, this.head), this.rows);
    this.scroll = element("div", { class: "scroll", role: "region", tabindex: 0, "aria-label": "Table of lines" }, this.grid);
    this.addControls();
    this.status = this.bar.status();
    this.element = element("div", { class: "line-table" }, this.bar.element, this.scroll);
    this.head.append(...COLUMNS.map((column, i) => this.heading(column, i)));
    this.scroll.addEventListener("scroll", () => this.draw());
    this.scroll.addEventListener("keydown", (event) => this.pressed(event));
    this.rows.addEventListener("click", (event) => this.clicked(event));
    this.visibility = new Visibility(this.element, () => this.refresh(), () => this.draw());
    for (const event of ["lines", "filter"] as const) app.on(event, () => this.outdated());
    app.on("selection", (ids) => this.showSelection(ids));
  }

  // The lines that the filter shows, also while the table is hidden
  shown(): Line[] {
    return [...this.app.lines.values()].filter((line) => this.app.filter.shows(line));
  }

  private addControls(): void {
    const { app, bar } = this;
    const kind = bar.choice("Kind", [], (chosen) => app.showOnly(chosen === "" ? null : [chosen]));
    const role = bar.choice("Role", [["", "All roles"], ...app.survey.choices.role.map((each) => [each, each] as const)], (chosen) =>
      app.filter.limit({ role: chosen }));
    const review = bar.choice("Review", [
      ["", "All"], ["none", "Not reviewed"], ["accepted", "Accepted"], ["edited", "Edited"], ["drawn", "Drawn"], [REJECTED, "Rejected"],
    ], (chosen) => app.filter.limit({ review: chosen }));
    const confidence = element("input", { type: "range", min: 0, max: 1, step: 0.01, value: 0, name: "least-confidence", "aria-label": "Least confidence" });
    const least = element("output", {}, "0.00");
    confidence.addEventListener("input", () => app.filter.limit({ least_confidence: confidence.valueAsNumber }));
    bar.element.append(element("label", { title: "Lines of at least this confidence" }, "Confidence ≥", confidence, least));
    const sigma = element("input", { type: "number", min: 0, step: 0.5, name: "greatest-sigma", placeholder: "any", "aria-label": "Greatest standard deviation in plan, cm" });
    sigma.addEventListener("change", () =>
      app.filter.limit({ greatest_sigma_m: Number.isFinite(sigma.valueAsNumber) ? sigma.valueAsNumber / 100 : Infinity }));
    bar.element.append(element("label", { title: "Lines of at most this standard deviation in plan" }, "σ ≤", sigma, "cm"));
    const bridged = bar.checkbox("bridged", "Only lines with bridged stretches", (chosen) => app.filter.limit({ bridged: chosen }));
    bar.button("All", "Select all listed lines", () => app.select(this.listed.map(({ id }) => id)));
    bar.button("Reset", "Show all lines again", () => app.filter.clear());
    // Kinds of lines made by other programs or from images come with the lines
    const fillKinds = () => {
      const kinds = app.kinds();
      const shown = kinds.filter((each) => !app.filter.hidden.has(each));
      fill(kind, [["", "All kinds"], ...kinds.map((each) => [each, app.title(each)] as const)]);
      kind.value = shown.length === 1 ? shown[0]! : "";
    };
    app.on("lines", fillKinds);
    app.on("filter", (limits: Limits) => {
      fillKinds();
      [role.value, review.value, bridged.checked] = [limits.role, limits.review, limits.bridged];
      confidence.value = String(limits.least_confidence);
      least.textContent = limits.least_confidence.toFixed(2);
      sigma.value = limits.greatest_sigma_m === Infinity ? "" : String(Number((100 * limits.greatest_sigma_m).toFixed(3)));
    });
  }

  private heading({ name, title }: Column, i: number): HTMLElement {
    const sort = element("button", { type: "button", title: `Sort by ${title}`, click: () => this.sort(name) }, title);
    return element("div", { role: "columnheader", "aria-colindex": i + 1, "data-column": name, class: NUMBERS.has(name) ? "number" : "" }, sort);
  }

  private sort(by: string): void {
    this.sorted = { by, descending: this.sorted.by === by && !this.sorted.descending };
    this.outdated();
  }

  private outdated(): void {
    this.isStale = true;
    if (this.visibility.visible) this.refresh();
  }

  private refresh(): void {
    if (!this.isStale) return this.draw();
    this.isStale = false;
    const { by, descending } = this.sorted;
    const { value } = COLUMNS.find(({ name }) => name === by)!;
    const keyed = this.shown().map((line) => ({ line, key: value(line, this.app) }));
    const sign = descending ? -1 : 1;
    keyed.sort((a, b) => sign * (a.key < b.key ? -1 : a.key > b.key ? 1 : 0) || (a.line.id < b.line.id ? -1 : 1));
    this.listed = keyed.map(({ line }) => line);
    for (const cell of this.head.children)
      cell.setAttribute("aria-sort", (cell as HTMLElement).dataset.column !== by ? "none" : descending ? "descending" : "ascending");
    this.grid.setAttribute("aria-rowcount", String(this.listed.length + 1));
    this.rows.style.height = `${this.listed.length * ROW_PX}px`;
    const length_m = this.listed.reduce((sum, line) => sum + line.length_m, 0);
    this.status.textContent = `${this.listed.length.toLocaleString("en")} of ${this.app.lines.size.toLocaleString("en")} lines, ${length_m.toFixed(0)} m`;
    this.element.dataset.listed = String(this.listed.length);
    this.at = Math.min(this.at, Math.max(this.listed.length - 1, 0));
    this.draw();
  }

  // Only the rows in view exist
  private draw(): void {
    if (!this.visibility.visible) return;
    const first = Math.max(Math.floor(this.scroll.scrollTop / ROW_PX) - BEYOND, 0);
    const last = Math.min(first + Math.ceil(this.scroll.clientHeight / ROW_PX) + 2 * BEYOND, this.listed.length);
    const selected = new Set(this.app.selection);
    this.rows.replaceChildren(...this.listed.slice(first, last).map((line, i) => this.row(line, first + i, selected.has(line.id))));
  }

  private row(line: Line, i: number, isSelected: boolean): HTMLElement {
    const cells = COLUMNS.map(({ name, value, text }, column) => {
      const shown = text ? text(line) : String(value(line, this.app));
      const cell = element("div", { role: "gridcell", "aria-colindex": column + 1, title: shown, class: NUMBERS.has(name) ? "number" : "" });
      if (column === 0) {
        const swatch = element("span", { class: "swatch" });
        swatch.style.backgroundColor = this.app.colour(line.kind);
        cell.append(swatch);
      }
      cell.append(shown);
      return cell;
    });
    const row = element("div", {
      class: "row", role: "row", "data-id": line.id, "data-row": i, "aria-rowindex": i + 2, "aria-selected": String(isSelected),
    }, ...cells);
    row.style.transform = `translateY(${i * ROW_PX}px)`;
    if (i === this.at) row.classList.add("current");
    return row;
  }

  private clicked(event: MouseEvent): void {
    const row = (event.target as HTMLElement).closest<HTMLElement>(".row");
    if (row === null) return;
    this.go(Number(row.dataset.row), event.shiftKey ? "extend" : event.ctrlKey || event.metaKey ? "toggle" : "only");
  }

  private pressed(event: KeyboardEvent): void {
    const page = Math.max(Math.floor(this.scroll.clientHeight / ROW_PX) - 2, 1);
    const last = this.listed.length - 1;
    const to: Record<string, number> = {
      ArrowDown: this.at + 1, ArrowUp: this.at - 1, PageDown: this.at + page, PageUp: this.at - page, Home: 0, End: last,
    };
    const next = to[event.key];
    if (next !== undefined && last >= 0) this.go(Math.min(Math.max(next, 0), last), event.shiftKey ? "extend" : "only");
    else if (event.key === "a" && (event.ctrlKey || event.metaKey)) this.app.select(this.listed.map(({ id }) => id));
    else return;
    event.preventDefault();
  }

  // Select a row and look at its line
  private go(to: number, how: "only" | "toggle" | "extend"): void {
    const line = this.listed[to];
    if (line === undefined) return;
    this.at = to;
    if (how !== "extend") this.anchor = to;
    const between = () => this.listed.slice(Math.min(this.anchor, to), Math.max(this.anchor, to) + 1).map(({ id }) => id);
    const toggled = () => {
      const ids = new Set(this.app.selection);
      if (!ids.delete(line.id)) ids.add(line.id);
      return [...ids];
    };
    this.app.select(how === "only" ? [line.id] : how === "extend" ? between() : toggled());
    this.reveal(to);
    const middle = line.xyz[Math.floor(line.xyz.length / 2)];
    if (middle) this.app.emit("look", { at: [middle[0], middle[1]], by: "table" });
  }

  private reveal(row: number): void {
    const head_px = this.head.offsetHeight;
    const [top, height] = [row * ROW_PX, this.scroll.clientHeight - head_px];
    if (top < this.scroll.scrollTop) this.scroll.scrollTop = top;
    else if (top + ROW_PX > this.scroll.scrollTop + height) this.scroll.scrollTop = top + ROW_PX - height;
    this.draw();
  }

  // A line selected elsewhere: its row comes into view
  private showSelection(ids: string[]): void {
    if (!this.visibility.visible) return;
    const i = ids.length === 1 ? this.listed.findIndex(({ id }) => id === ids[0]) : -1;
    if (i < 0) return this.draw();
    this.at = this.anchor = i;
    this.reveal(i);
  }
}
