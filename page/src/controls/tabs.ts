// Several panes in one place: a row of tabs and the selected pane.

import { button, element } from "./element";

// A part of the page, created once and placed by the shell
export interface Pane {
  readonly element: HTMLElement;
  resized?(): void;
}

export class Tabs implements Pane {
  readonly element: HTMLElement;
  readonly row: HTMLElement;
  private readonly panes = new Map<string, { tab: HTMLButtonElement; pane: Pane }>();
  private shown = "";
  private isChosen = false; // by the user

  constructor(readonly name: string) {
    this.row = element("div", { class: "tabs", role: "tablist", "aria-label": name });
    this.element = element("div", { class: "tab-group", "data-group": name }, this.row);
    new ResizeObserver(() => this.resized()).observe(this.element);
    this.row.addEventListener("keydown", (event) => this.arrow(event));
  }

  add(title: string, pane: Pane): void {
    const id = `pane-${title.toLowerCase().replace(/[^a-z0-9]+/g, "-")}`;
    const tab = button(title, title, () => this.choose(title), { role: "tab", "aria-controls": id });
    tab.removeAttribute("title");
    pane.element.id = id;
    pane.element.classList.add("pane");
    pane.element.setAttribute("role", "tabpanel");
    pane.element.setAttribute("aria-label", title);
    this.panes.set(title, { tab, pane });
    this.row.append(tab);
    this.element.append(pane.element);
    this.show(this.shown || title);
  }

  private choose(title: string): void {
    this.isChosen = true;
    this.show(title);
  }

  // Show a pane that something else asks for, unless the user has chosen one
  offer(title: string): void {
    if (!this.isChosen && this.panes.has(title)) this.show(title);
  }

  show(title: string): void {
    this.shown = title;
    for (const [name, { tab, pane }] of this.panes) {
      tab.setAttribute("aria-selected", String(name === title));
      tab.tabIndex = name === title ? 0 : -1;
      pane.element.hidden = name !== title;
    }
    this.element.dataset.shown = title;
    this.resized();
  }

  resized(): void {
    this.panes.get(this.shown)?.pane.resized?.();
  }

  private arrow(event: KeyboardEvent): void {
    const step = event.key === "ArrowRight" ? 1 : event.key === "ArrowLeft" ? -1 : 0;
    if (step === 0) return;
    const names = [...this.panes.keys()];
    const next = names[(names.indexOf(this.shown) + step + names.length) % names.length];
    if (next === undefined) return;
    this.choose(next);
    this.panes.get(next)?.tab.focus();
    event.preventDefault();
  }
}
