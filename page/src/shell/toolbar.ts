// The bar above: the tools and the kind they work with, undo and redo, where to look, light and dark, help.

import type { App, Tool } from "../app/app";
import { element } from "../controls/element";
import { goToField } from "./go-to";
import { helpDialog } from "../controls/help";
import { keyButton } from "../controls/key-button";
import type { PlanView } from "../plan/plan-view";
import { applyTheme, switchTheme } from "./theme";

const TOOLS: { tool: Tool; title: string; key: string; says: string }[] = [
  { tool: "select", title: "Select", key: "v", says: "Select and edit lines" },
  { tool: "follow", title: "Follow", key: "f", says: "Click beside a line: it is followed" },
  { tool: "draw", title: "Draw", key: "d", says: "Draw a line by hand" },
  { tool: "measure", title: "Measure", key: "m", says: "Measure distances and height differences" },
];

export class Toolbar {
  readonly element = element("div", { class: "toolbar" });

  constructor(private readonly app: App, private readonly plan: PlanView) {
    const help = helpDialog(app.keyboard);
    document.body.append(help);
    const group = "Page";
    app.keyboard.bind({ keys: ["?"], title: "This help", group, run: () => help.showModal() });
    applyTheme(() => plan.restyle());
    this.element.append(
      element("strong", { class: "name", title: app.survey.lines_file }, app.survey.name),
      this.tools(),
      this.kinds(),
      this.undo(),
      this.looks(),
      element("span", { class: "space" }),
      goToField(app, (place) => plan.goTo(place)),
      element("button", {
        type: "button", title: "Light or dark", "aria-label": "Light or dark", click: () => switchTheme(),
      }, "◐"),
      keyButton("?", "Help", () => help.showModal()),
    );
  }

  private tools(): HTMLElement {
    const { app } = this;
    const row = element("div", { class: "group", role: "group", "aria-label": "Tool" });
    const buttons = TOOLS.map(({ tool, title, key, says }) => {
      app.keyboard.bind({ keys: [key], title: says, group: "Tools", run: () => app.setTool(tool) });
      return keyButton(key, title, () => app.setTool(tool), { "data-tool": tool, title: says });
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
      const kinds = app.survey.kinds.filter((kind) => app.tool === "draw" || kind.picked || kind.picked_in_images);
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

  private looks(): HTMLElement {
    const { plan } = this;
    const { keyboard } = this.app;
    const group = "Plan";
    keyboard.bind({ keys: ["Home", "0"], title: "Show everything", group, run: () => plan.fitAll() });
    keyboard.bind({ keys: ["."], title: "Show what is selected", group, run: () => plan.fitSelection() });
    keyboard.bind({ keys: ["+", "="], title: "Nearer", group, run: () => plan.zoom(1) });
    keyboard.bind({ keys: ["-"], title: "Farther", group, run: () => plan.zoom(-1) });
    return element("div", { class: "group" }, keyButton("0", "Fit all", () => plan.fitAll()));
  }
}
