// Lines in space: by the colour of their kind, bridged stretches dashed, the selected wider.

import { Color, Group } from "three";
import { LineMaterial } from "three/addons/lines/LineMaterial.js";
import { LineSegments2 } from "three/addons/lines/LineSegments2.js";
import { LineSegmentsGeometry } from "three/addons/lines/LineSegmentsGeometry.js";

import { bright, INK } from "../controls/colours";
import type { Line, Place, Vertex } from "../app/documents";

// Lines so far away are a few pixels
const REACH_M = 250;
const GROWING = INK.seen;
const ORDER = ["solid", "dashed", "halo", "chosen", "chosenDashed"]; // the later over the earlier

type Part = { positions: number[]; colours: number[] };

export class SpaceLines {
  readonly group = new Group();
  // Not hidden by points: paint lies among the points of the road, and would flicker
  private readonly materials = {
    solid: material(2.5, false),
    dashed: material(2.5, true),
    halo: material(8, false), // around what is selected
    chosen: material(4.5, false),
    chosenDashed: material(4.5, true),
  };
  drawn: Line[] = [];

  show(
    lines: Iterable<Line>, growing: readonly Line[], path: readonly Vertex[], chosen: readonly string[], at: Place,
    origin: Vertex, colour: (kind: string) => string,
  ): void {
    const parts = { solid: part(), dashed: part(), halo: part(), chosen: part(), chosenDashed: part() };
    this.drawn = [...lines].filter((line) => line.review !== "rejected" && near(line, at));
    for (const line of this.drawn) {
      const wide = chosen.includes(line.id);
      const ink = new Color(bright(colour(line.kind)));
      if (wide) addRun(line.xyz, new Color(INK.chosen), origin, parts.halo);
      add(line, ink, origin, wide ? parts.chosen : parts.solid, wide ? parts.chosenDashed : parts.dashed);
    }
    for (const line of growing) add(line, new Color(GROWING), origin, parts.chosen, parts.chosenDashed);
    addRun(path, new Color("#4a5563"), origin, parts.solid);
    this.clear();
    for (const [name, { positions, colours }] of Object.entries(parts) as [keyof typeof parts, Part][]) {
      if (positions.length === 0) continue;
      const geometry = new LineSegmentsGeometry();
      geometry.setPositions(positions);
      geometry.setColors(colours);
      const object = new LineSegments2(geometry, this.materials[name]);
      object.computeLineDistances();
      object.renderOrder = ORDER.indexOf(name) + 1;
      object.frustumCulled = false;
      this.group.add(object);
    }
  }

  resized(width: number, height: number): void {
    for (const one of Object.values(this.materials)) one.resolution.set(width, height);
  }

  private clear(): void {
    for (const child of this.group.children) (child as LineSegments2).geometry.dispose();
    this.group.clear();
  }
}

function material(linewidth: number, dashed: boolean): LineMaterial {
  const made = new LineMaterial({ linewidth, dashed, dashSize: 0.5, gapSize: 0.4, vertexColors: true });
  made.depthTest = false;
  made.depthWrite = false;
  return made;
}

const part = (): Part => ({ positions: [], colours: [] });

function near(line: Line, at: Place): boolean {
  return line.xyz.some(([e, n]) => Math.abs(e - at[0]) < REACH_M && Math.abs(n - at[1]) < REACH_M);
}

function add(line: Line, ink: Color, origin: Vertex, solid: Part, dashed: Part): void {
  for (let i = 1; i < line.xyz.length; i++) {
    const isBridged = line.bridged.some(([first, last]) => first <= i - 1 && i <= last);
    addRun(line.xyz.slice(i - 1, i + 1), ink, origin, isBridged ? dashed : solid);
  }
}

function addRun(xyz: readonly Vertex[], ink: Color, origin: Vertex, into: Part): void {
  for (let i = 1; i < xyz.length; i++) {
    for (const vertex of [xyz[i - 1]!, xyz[i]!]) {
      into.positions.push(vertex[0] - origin[0], vertex[1] - origin[1], vertex[2] - origin[2]);
      into.colours.push(ink.r, ink.g, ink.b);
    }
  }
}
