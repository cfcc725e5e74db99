// The lines of the 3-D view: coloured by kind, bridged stretches dashed, selected lines wider.

import { Color, Group } from "three";
import { LineMaterial } from "three/addons/lines/LineMaterial.js";
import { LineSegments2 } from "three/addons/lines/LineSegments2.js";
import { LineSegmentsGeometry } from "three/addons/lines/LineSegmentsGeometry.js";

import { brightened, CANVAS } from "../controls/colours";
import type { Line, Place, Vertex } from "../app/documents";
import { REJECTED } from "../app/filter";

const DRAW_RADIUS_M = 250; // lines farther away would be a few pixels
const GROWING = CANVAS.followed;
const ORDER = ["solid", "dashed", "halo", "selected", "selectedDashed"]; // later ones are drawn over earlier ones

type Part = { positions: number[]; colours: number[] };

export class Lines3D {
  readonly group = new Group();
  // Drawn over the points: paint lies among the points of the road and would flicker
  private readonly materials = {
    solid: material(2.5, false),
    dashed: material(2.5, true),
    halo: material(8, false), // around the selected lines
    selected: material(4.5, false),
    selectedDashed: material(4.5, true),
  };
  drawn: Line[] = [];

  show(
    lines: Iterable<Line>, growing: readonly Line[], path: readonly Vertex[], selectedIds: readonly string[], at: Place,
    origin: Vertex, colourOf: (kind: string) => string,
  ): void {
    const parts = { solid: part(), dashed: part(), halo: part(), selected: part(), selectedDashed: part() };
    this.drawn = [...lines].filter((line) => line.review !== REJECTED && isNear(line, at));
    for (const line of this.drawn) {
      const isSelected = selectedIds.includes(line.id);
      const colour = new Color(brightened(colourOf(line.kind)));
      if (isSelected) addRun(line.xyz, new Color(CANVAS.selected), origin, parts.halo);
      add(line, colour, origin, isSelected ? parts.selected : parts.solid, isSelected ? parts.selectedDashed : parts.dashed);
    }
    for (const line of growing) add(line, new Color(GROWING), origin, parts.selected, parts.selectedDashed);
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

function isNear(line: Line, at: Place): boolean {
  return line.xyz.some(([e, n]) => Math.abs(e - at[0]) < DRAW_RADIUS_M && Math.abs(n - at[1]) < DRAW_RADIUS_M);
}

function add(line: Line, colour: Color, origin: Vertex, solid: Part, dashed: Part): void {
  for (let i = 1; i < line.xyz.length; i++) {
    const isBridged = line.bridged.some(([first, last]) => first <= i - 1 && i <= last);
    addRun(line.xyz.slice(i - 1, i + 1), colour, origin, isBridged ? dashed : solid);
  }
}

function addRun(xyz: readonly Vertex[], colour: Color, origin: Vertex, target: Part): void {
  for (let i = 1; i < xyz.length; i++) {
    for (const vertex of [xyz[i - 1]!, xyz[i]!]) {
      target.positions.push(vertex[0] - origin[0], vertex[1] - origin[1], vertex[2] - origin[2]);
      target.colours.push(colour.r, colour.g, colour.b);
    }
  }
}
