// Readings of a section - offsets, heights above the road, heights of kerbs, rails and wires - and their table.

import type { Points } from "../app/api";
import type { App } from "../app/app";
import { element } from "../controls/element";
import { isAboveKnown } from "../controls/colours";
import type { SectionNode } from "./nodes";

// Height of the road at an offset, from the median of the nearest points; null: no point knows its height above the road
export function roadAt(points: Points, x: number): number | null {
  const near: [distance: number, z: number][] = [];
  for (let i = 0; i < points.n; i++) {
    const above_cm = points.above_cm[i]!;
    if (!isAboveKnown(above_cm)) continue;
    const distance = Math.abs(points.xyz[3 * i]! - x);
    if (distance < 1) near.push([distance, points.xyz[3 * i + 2]! - above_cm / 100]);
  }
  if (near.length === 0) return null;
  const nearest = near.sort((a, b) => a[0] - b[0]).slice(0, 31).map(([, z]) => z);
  return points.origin[2] + nearest.sort((a, b) => a - b)[nearest.length >> 1]!;
}

export interface Reading {
  id: string;
  kind: string;
  offset_m: number;
  above_m: number | null;
  remark: string; // "kerb 0.12 m", "rail 0.75 m": the height a surveyor asks for
}

export function readingsOf(nodes: readonly SectionNode[], points: Points | null): Reading[] {
  return nodes
    .map((node) => {
      const road = points && roadAt(points, node.x);
      const above_m = road === null ? null : node.z - road;
      return { id: node.line.id, kind: node.line.kind, offset_m: node.x, above_m, remark: remarkOf(node, nodes, above_m) };
    })
    .sort((a, b) => a.offset_m - b.offset_m);
}

function remarkOf(node: SectionNode, nodes: readonly SectionNode[], above_m: number | null): string {
  if (node.line.kind === "kerb_top") {
    const feet = nodes.filter((other) => other.line.kind === "road_boundary" && Math.abs(other.x - node.x) < 0.6);
    const foot = feet.sort((a, b) => Math.abs(a.x - node.x) - Math.abs(b.x - node.x))[0];
    return foot ? `kerb ${fixed(node.z - foot.z)} m` : "";
  }
  if (above_m === null) return "";
  if (["guardrail", "barrier", "fence"].includes(node.line.kind)) return `rail ${above_m.toFixed(2)} m`;
  return node.line.kind === "cable" ? `clearance ${above_m.toFixed(2)} m` : "";
}

export function sectionTable(readings: readonly Reading[], app: App): HTMLTableElement {
  const heads = ["Line", "Offset [m]", "Above road [m]", ""].map((text) => element("th", {}, text));
  const rows = readings.map((reading) => rowOf(reading, app));
  return element("table", {}, element("thead", {}, element("tr", {}, ...heads)), element("tbody", {}, ...rows));
}

// Millimetres; what rounds to nothing has no sign
function fixed(value: number): string {
  const text = value.toFixed(3);
  return Number(text) === 0 ? "0.000" : text;
}

function rowOf(reading: Reading, app: App): HTMLTableRowElement {
  const swatch = element("i", { class: "swatch" });
  swatch.style.background = app.colour(reading.kind);
  const title = app.title(reading.kind);
  const cells = [fixed(reading.offset_m), reading.above_m === null ? "–" : fixed(reading.above_m), reading.remark];
  return element(
    "tr",
    {
      "data-id": reading.id,
      class: app.selection.includes(reading.id) ? "chosen" : "",
      tabindex: 0,
      "aria-label": [title, ...cells].filter(Boolean).join(", "),
      click: () => app.select([reading.id]),
      keydown: (event) => {
        if ((event as KeyboardEvent).key !== "Enter") return;
        app.select([reading.id]);
        event.stopPropagation();
      },
    },
    element("td", {}, swatch, title),
    ...cells.map((text) => element("td", {}, text)),
  );
}
