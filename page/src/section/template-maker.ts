// Making a template in the section: each click beside the selected line is a node, named and typed in the rows below.

import "./template-maker.css";

import type { App } from "../app/app";
import type { TemplateNode } from "../app/documents";
import { EDGES } from "../app/templates";
import { fill } from "../controls/bar";
import { button, element } from "../controls/element";
import { inSection, type Plane, type SectionNode } from "./nodes";
import { CANVAS } from "../controls/colours";
import type { Frame } from "./rendering";

const SAME_M = 0.1; // a click this near to a crossing line is a node of its kind
const DECIMALS = 3;
const EDGE_OF: Record<string, string> = {
  road_boundary: "foot", kerb_top: "top", lane_marking: "stripe", guardrail: "rail", barrier: "rail", fence: "rail", cable: "wire",
};

export class TemplateMaker {
  readonly element = element("form", { class: "template-maker", "aria-label": "Template of a cross-section", hidden: true });
  private readonly name = element("input", { name: "template-name", "aria-label": "Name of the template", placeholder: "Name, such as kerb 12 cm", maxlength: 40, autocomplete: "off" });
  private readonly rows = element("tbody", {});
  private readonly words = element("p", { class: "quiet", role: "status" });
  private nodes: TemplateNode[] = [];
  private origin: SectionNode | null = null;
  private side: 1 | -1 = 1; // -1: the line runs against the direction that the section looks in

  constructor(private readonly app: App, private readonly changed: () => void) {
    const heads = ["Node", "Edge", "Across [m]", "Up [m]", "Kind", "Role", ""].map((text) => element("th", {}, text));
    this.element.append(
      element("div", { class: "row" }, element("strong", {}, "Template"), this.name,
        button("Add a node at the line; set its distances in the row", "Add node", () => this.add(0, 0, [])),
        element("button", { type: "submit", class: "main" }, "Save"),
        button("Close without saving", "Close", () => this.end())),
      this.words,
      element("table", {}, element("thead", {}, element("tr", {}, ...heads)), this.rows),
      element("datalist", { id: "template-roles" }, ...app.survey.choices.role.map((value) => element("option", { value }))),
    );
    this.element.addEventListener("submit", (event) => {
      event.preventDefault();
      void this.save();
    });
    this.element.addEventListener("keydown", (event) => {
      event.stopPropagation(); // keys typed here move no section
      if (event.key === "Escape") this.end();
    });
  }

  get isActive(): boolean {
    return this.origin !== null;
  }

  // `origin`: where the section crosses the line that the nodes are measured from
  start(origin: SectionNode | undefined, plane: Plane): void {
    if (!origin)
      return this.app.emit("message", { text: "Select the line that the template is to be followed with (the foot of a kerb, say), where the section crosses it.", kind: "info" });
    this.measureFrom(origin, plane);
    this.nodes = [];
    this.name.value = "";
    this.element.hidden = false;
    this.say(`Click the nodes beside the ${this.app.title(origin.line.kind).toLowerCase()} in the section, then name them; ⤢ makes room.`);
    this.show();
    this.name.focus();
  }

  // The section has moved, or its lines have changed: nodes are measured from where it crosses the same line now
  moved(crossing: readonly SectionNode[], plane: Plane): void {
    const { origin } = this;
    if (!origin) return;
    const here = crossing.filter(({ line }) => line.id === origin.line.id).sort((a, b) => Math.abs(a.x) - Math.abs(b.x))[0];
    if (here) return this.measureFrom(here, plane);
    this.end();
    this.app.emit("message", { text: "The template is closed: the section does not cross its line here.", kind: "info" });
  }

  // Nodes are to the right of the line's own direction
  private measureFrom(origin: SectionNode, plane: Plane): void {
    const { line, after } = origin;
    const first = Math.min(after, line.xyz.length - 2);
    const [a, b] = [line.xyz[first]!, line.xyz[first + 1]!];
    this.origin = origin;
    this.side = inSection(plane, b)[1] < inSection(plane, a)[1] ? -1 : 1;
  }

  end(): void {
    this.origin = null;
    this.element.hidden = true;
    this.changed();
  }

  // A node at a click in the section; `crossing`: the lines that cross it
  click(x: number, z: number, crossing: readonly SectionNode[]): void {
    const { origin } = this;
    if (origin) this.add(this.side * (x - origin.x), z - origin.z, crossing.filter((node) => node.line.id !== origin.line.id));
  }

  draw(context: CanvasRenderingContext2D, frame: Frame): void {
    const { origin } = this;
    if (!origin) return;
    context.font = "12px system-ui, sans-serif";
    for (const node of this.nodes) {
      const [px, py] = frame.toPx(origin.x + this.side * node.across_m, origin.z + node.up_m);
      context.strokeStyle = CANVAS.selected;
      context.lineWidth = 2;
      context.strokeRect(px - 5, py - 5, 10, 10);
      context.fillStyle = CANVAS.text;
      context.fillText(node.name, px + 9, py - 7);
    }
  }

  private add(across_m: number, up_m: number, crossing: readonly SectionNode[]): void {
    const { origin } = this;
    if (!origin) return;
    const near = crossing.find((node) => Math.hypot(node.x - origin.x - this.side * across_m, node.z - origin.z - up_m) < SAME_M);
    const kind = near?.line.kind.replace(/_stereo$/, "") ?? "edge_other";
    const edge = EDGE_OF[kind] ?? "break";
    const name = this.freeName(near ? edge : "node");
    this.nodes.push({ name, edge, across_m: rounded(across_m), up_m: rounded(up_m), kind, role: near?.line.role ?? "" });
    this.show();
  }

  private freeName(wanted: string): string {
    const taken = new Set(this.nodes.map(({ name }) => name));
    for (let i = 1; ; i++) {
      const name = i === 1 && wanted !== "node" ? wanted : `${wanted} ${i}`;
      if (!taken.has(name)) return name;
    }
  }

  private show(): void {
    this.rows.replaceChildren(...this.nodes.map((node, i) => this.row(node, i)));
    this.changed();
  }

  private row(node: TemplateNode, i: number): HTMLTableRowElement {
    const { app } = this;
    const of = `of node ${i + 1}`;
    const text = (name: "name" | "role", title: string): HTMLInputElement => {
      const input = element("input", { name, value: node[name], "aria-label": `${title} ${of}`, maxlength: 40, autocomplete: "off" });
      input.addEventListener("input", () => this.set(node, { [name]: input.value.trim() }));
      return input;
    };
    const metres = (name: "across_m" | "up_m", title: string): HTMLInputElement => {
      const input = element("input", { name, type: "number", step: 0.001, value: node[name], "aria-label": `${title} ${of}, metres` });
      input.addEventListener("input", () => Number.isFinite(input.valueAsNumber) && this.set(node, { [name]: input.valueAsNumber }));
      return input;
    };
    const choice = (name: "edge" | "kind", title: string, choices: readonly (readonly [string, string])[]): HTMLSelectElement => {
      const select = element("select", { name, "aria-label": `${title} ${of}` });
      fill(select, choices);
      select.value = node[name];
      select.addEventListener("change", () => this.set(node, { [name]: select.value }));
      return select;
    };
    const role = text("role", "Role");
    role.setAttribute("list", "template-roles");
    const cells = [
      text("name", "Name"), choice("edge", "Edge", EDGES), metres("across_m", "Distance across"), metres("up_m", "Height"),
      choice("kind", "Kind of line", app.survey.kinds.map(({ kind, title }) => [kind, title] as const)), role,
      button(`Remove node ${i + 1}`, "✕", () => {
        this.nodes = this.nodes.filter((other) => other !== node);
        this.show();
      }),
    ];
    return element("tr", {}, ...cells.map((cell) => element("td", {}, cell)));
  }

  private set(node: TemplateNode, part: Partial<TemplateNode>): void {
    Object.assign(node, part);
    this.changed();
  }

  private async save(): Promise<void> {
    const name = this.name.value.trim();
    if (name === "" || this.nodes.length === 0)
      return this.say(name === "" ? "Give the template a name." : "Click at least one node in the section.");
    try {
      await this.app.templates.save({ name, nodes: this.nodes });
    } catch (error) {
      return this.say(error instanceof Error ? error.message : String(error));
    }
    this.end();
    this.app.emit("message", { text: `Template ${name} is saved: it is followed with the next line; Shift T finds it beside the selected one.`, kind: "info" });
  }

  private say(text: string): void {
    this.words.textContent = text;
  }
}

function rounded(value: number): number {
  return Number(value.toFixed(DECIMALS));
}
