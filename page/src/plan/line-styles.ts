// How a line is drawn: its colour shows its kind, its casing its review state, dots where it is bridged; dashed lines are
// broken, and their dashes wide.

import type Feature from "ol/Feature";
import type Geometry from "ol/geom/Geometry";
import { asArray } from "ol/color";
import Fill from "ol/style/Fill";
import Stroke from "ol/style/Stroke";
import Style from "ol/style/Style";
import type { Line } from "../app/documents";
import { REJECTED } from "../app/filter";

const FAR_M = 0.6; // metres per pixel from which lines are drawn without a casing

export interface Palette {
  edge: string; // casing of a line that has not been reviewed
  accepted: string;
  edited: string;
  rejected: string;
  selected: string;
}

// The colours of the current theme
export function palette(): Palette {
  const style = getComputedStyle(document.documentElement);
  const colour = (name: string) => style.getPropertyValue(name).trim();
  return {
    edge: colour("--line-edge"),
    accepted: colour("--good"),
    edited: colour("--accent"),
    rejected: colour("--rejected"),
    selected: colour("--selected"),
  };
}

export function faded(colour: string, alpha: number): string {
  const [red = 0, green = 0, blue = 0] = asArray(colour);
  return `rgba(${red}, ${green}, ${blue}, ${alpha})`;
}

// Black wires need a light casing to stand out from a dark image
function isDark(colour: string): boolean {
  const [red = 0, green = 0, blue = 0] = asArray(colour);
  return 0.299 * red + 0.587 * green + 0.114 * blue < 70;
}

const measured = (feature: Feature | unknown) => (feature as Feature).get("measured") as Geometry;
const bridged = (feature: Feature | unknown) => (feature as Feature).get("bridged") as Geometry;

export class LineStyles {
  private colours = palette();
  private readonly made = new Map<string, Style[]>();

  constructor(private readonly colour: (kind: string) => string) {}

  // After a change of theme
  reset(): void {
    this.colours = palette();
    this.made.clear();
  }

  of(line: Line, selected: boolean, resolution: number): Style[] {
    const far = resolution > FAR_M;
    const key = `${line.kind}|${line.pattern}|${line.review}|${selected}|${far}`;
    const known = this.made.get(key) ?? this.make(line, selected, far);
    this.made.set(key, known);
    return known;
  }

  private make(line: Line, selected: boolean, far: boolean): Style[] {
    if (line.review === REJECTED) return this.rejected(selected);
    const isDash = line.kind === "lane_marking_dash";
    const isDashed = line.kind === "lane_marking" && line.pattern === "dashed";
    const width = isDash ? 5 : far || isDashed ? 2 : 3;
    const colour = this.colour(line.kind);
    const styles = [
      new Style({
        // A dashed line is thin and broken under its dashes, which are wide and end squarely
        stroke: new Stroke({ color: colour, width, lineDash: isDashed ? [12, 6] : [], lineCap: isDash || isDashed ? "butt" : "round" }),
        geometry: measured, zIndex: isDash ? 3 : 2,
      }),
      new Style({
        stroke: new Stroke({ color: colour, width, lineDash: [3, 7], lineCap: "round" }), geometry: bridged, zIndex: 2,
      }),
    ];
    const edge = this.edgeOf(line);
    if (!far || line.review !== "") {
      styles.unshift(
        new Style({ stroke: new Stroke({ color: edge, width: width + (line.review ? 4 : 2) }), geometry: measured, zIndex: 1 }),
        new Style({
          stroke: new Stroke({ color: faded(edge, 0.45), width: width + 2, lineDash: [3, 7], lineCap: "round" }),
          geometry: bridged, zIndex: 1,
        }),
      );
    }
    if (selected) styles.unshift(this.halo());
    return styles;
  }

  private rejected(selected: boolean): Style[] {
    const style = new Style({ stroke: new Stroke({ color: this.colours.rejected, width: 1.5, lineDash: [8, 4] }) });
    return selected ? [this.halo(), style] : [style];
  }

  private halo(): Style {
    return new Style({ stroke: new Stroke({ color: this.colours.selected, width: 11 }), zIndex: 0 });
  }

  private edgeOf(line: Line): string {
    if (line.review === "accepted") return this.colours.accepted;
    if (line.review !== "") return this.colours.edited;
    return isDark(this.colour(line.kind)) ? "#ffffff" : this.colours.edge;
  }

  band(kind: string): Style {
    const colour = this.colour(kind);
    return new Style({
      fill: new Fill({ color: faded(colour, 0.28) }), stroke: new Stroke({ color: faded(colour, 0.6), width: 1 }),
    });
  }
}
