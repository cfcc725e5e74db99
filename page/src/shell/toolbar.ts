// The toolbar: tools and the kind they work on, undo and redo, zoom, the search field, light or dark theme, help.

import type { App, Tool } from "../app/app";
import { element } from "../controls/element";
import { helpDialog } from "../controls/help";
import { keyButton } from "../controls/keyboard";
import type { PlanView } from "../plan/plan-view";
import type { Kind, Place } from "../app/documents";

const TOOLS: { tool: Tool; title: string; key: string; help: string }[] = [
  { tool: "select", title: "Select", key: "v", help: "Select and edit lines" },
  { tool: "follow", title: "Follow", key: "f", help: "Follow a line from a click" },
  { tool: "draw", title: "Draw", key: "d", help: "Draw a line by hand" },
  { tool: "measure", title: "Measure", key: "m", help: "Measure distances and height differences" },
];

export class Toolbar {
  readonly element = element("div", { class: "toolbar" });

  constructor(private readonly app: App, private readonly plan: PlanView) {
    const help = helpDialog(app.keyboard);
    document.body.append(help);
    const group = "Page";
    app.keyboard.bind({ keys: ["?", "F1"], title: "Help: all keys, and how to", group, run: () => help.showModal() });
    applyTheme(() => plan.restyle());
    this.element.append(
      element("strong", { class: "name", title: app.survey.lines_file }, app.survey.name),
      this.tools(),
      this.kinds(),
      this.templates(),
      this.undo(),
      this.zoomButtons(),
      element("span", { class: "space" }),
      goToField(app, (place) => plan.goTo(place)),
      element("button", {
        type: "button", title: "Light or dark theme", "aria-label": "Light or dark theme", click: () => switchTheme(),
      }, "◐"),
      keyButton("?", "Help", () => help.showModal()),
    );
  }

  private tools(): HTMLElement {
    const { app } = this;
    const row = element("div", { class: "group", role: "group", "aria-label": "Tool" });
    const buttons = TOOLS.map(({ tool, title, key, help }) => {
      app.keyboard.bind({ keys: [key], title: help, group: "Tools", run: () => app.setTool(tool) });
      return keyButton(key, title, () => app.setTool(tool), { "data-tool": tool, title: help });
    });
    const press = (tool: Tool) => {
      for (const one of buttons) one.setAttribute("aria-pressed", String(one.dataset.tool === tool));
    };
    app.on("tool", press);
    press(app.tool);
    row.append(...buttons);
    return row;
  }

  private kinds(): HTMLElement {
    const { app } = this;
    const choice = element("select", {
      name: "kind", "aria-label": "Kind of line to follow or draw",
      change: () => {
        app.followKind = choice.value;
        app.emit("tool", app.tool);
      },
    });
    const fill = () => {
      const { n_points, n_pairs } = app.survey;
      const canFollow = (kind: Kind): boolean => (kind.picked && n_points > 0) || (kind.picked_in_images && n_pairs > 0);
      const kinds = app.survey.kinds.filter((kind) => app.tool === "draw" || canFollow(kind));
      if (!kinds.some(({ kind }) => kind === app.followKind)) app.followKind = "";
      choice.replaceChildren(
        element("option", { value: "" }, app.tool === "draw" ? "Choose a kind" : "Any kind"),
        ...kinds.map(({ kind, title }) => element("option", { value: kind }, title)),
      );
      choice.value = app.followKind;
      choice.hidden = app.tool !== "follow" && app.tool !== "draw";
    };
    app.on("tool", fill);
    fill();
    return choice;
  }

  // The template that is followed with a line
  private templates(): HTMLElement {
    const { app } = this;
    const choice = element("select", {
      name: "template", "aria-label": "Template followed with the line", title: "Template of a cross-section, made in the section view",
      change: () => app.templates.choose(choice.value),
    });
    const show = () => {
      const names = app.templates.all.map(({ name }) => name);
      choice.replaceChildren(
        element("option", { value: "" }, "No template"), ...names.map((name) => element("option", { value: name }, name)),
      );
      choice.value = app.templates.chosen;
      choice.hidden = app.tool !== "follow" || names.length === 0;
    };
    app.on("tool", show);
    app.templates.onChange(show);
    show();
    void app.templates.load().catch((error: unknown) => app.reportProblem(error));
    return choice;
  }

  private undo(): HTMLElement {
    const { app } = this;
    const undo = element("button", { type: "button", title: "Undo (Ctrl Z)", disabled: true, click: () => void app.undo() }, "↶ Undo");
    const redo = element("button", { type: "button", title: "Redo (Ctrl Shift Z)", disabled: true, click: () => void app.redo() }, "↷ Redo");
    app.on("undo", ({ can_undo, can_redo }) => {
      undo.disabled = !can_undo;
      redo.disabled = !can_redo;
    });
    return element("div", { class: "group" }, undo, redo);
  }

  private zoomButtons(): HTMLElement {
    const { plan } = this;
    const { keyboard } = this.app;
    const group = "Plan";
    keyboard.bind({ keys: ["Home", "0"], title: "Zoom to everything", group, run: () => plan.fitAll() });
    keyboard.bind({ keys: ["."], title: "Zoom to the selection", group, run: () => plan.fitSelection() });
    keyboard.bind({ keys: ["+", "="], title: "Zoom in", group, run: () => plan.zoom(1) });
    keyboard.bind({ keys: ["-"], title: "Zoom out", group, run: () => plan.zoom(-1) });
    return element("div", { class: "group" }, keyButton("0", "Fit all", () => plan.fitAll()));
  }
}

// Coordinates as typed: "691000.5, 5335000" or "691000.5 5335000"; with decimal commas: "691000,5; 5335000" or "691000,5 5335000"
function parsePlace(text: string): Place | null {
  const parts = text.trim().split(/\s*[;\s]\s*|,\s+/).filter(Boolean);
  const numbers = (parts.length === 2 ? parts : text.trim().split(",")).map((part) => Number(part.replace(/,$/, "").replace(",", ".")));
  const [east = NaN, north = NaN] = numbers;
  return numbers.length === 2 && Number.isFinite(east) && Number.isFinite(north) ? [east, north] : null;
}

// The search field
function goToField(app: App, go: (place: Place) => void): HTMLElement {
  const field = element("input", {
    type: "search", name: "go-to", placeholder: "Go to EAST, NORTH", "aria-label": "Go to EAST, NORTH", size: 20,
    autocomplete: "off",
  });
  app.keyboard.bind({ keys: ["/"], title: "Go to coordinates", group: "Plan", run: () => field.focus() });
  return element("form", {
    class: "go-to",
    submit: (event) => {
      event.preventDefault();
      const place = parsePlace(field.value);
      if (place === null)
        return app.emit("message", { text: `“${field.value}” is not a pair of coordinates: enter EAST, NORTH in metres.`, kind: "problem" });
      go(place);
      field.blur();
    },
  }, field);
}

type Theme = "light" | "dark";

const THEME_KEY = "linework theme";
const dark = matchMedia("(prefers-color-scheme: dark)");

// The user's choice, else that of the system
function theme(): Theme {
  const chosen = localStorage.getItem(THEME_KEY);
  return chosen === "light" || chosen === "dark" ? chosen : dark.matches ? "dark" : "light";
}

// Apply the theme now and after every change
function applyTheme(changed: () => void): void {
  const apply = () => {
    document.documentElement.dataset.theme = theme();
    changed();
  };
  dark.addEventListener("change", apply);
  window.addEventListener("linework-theme", apply);
  apply();
}

function switchTheme(): void {
  localStorage.setItem(THEME_KEY, theme() === "dark" ? "light" : "dark");
  window.dispatchEvent(new Event("linework-theme"));
}
