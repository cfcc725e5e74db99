// The lines of the 3-D view: coloured by kind, bridged stretches dashed, selected lines wider.

import { Color, Group } from "three";
import { LineMaterial } from "three/addons/lines/LineMaterial.js";
import { LineSegments2 } from "three/addons/lines/LineSegments2.js";
import { LineSegmentsGeometry } from "three/addons/lines/LineSegmentsGeometry.js";

import { brightened, CANVAS } from "../controls/colours";
import type { Line, Place, Vertex } from "../app/documents";
import { REJECTED } from "../app/filter";

const DRAW_RADIUS_M = 250; // lines farther away would be a few pixels
const MOST_SEGMENTS = 40_000; // without a graphics card 400,000 took 5 s a frame; 20 lines over 500 m have some 20,000
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
  near = 0; // lines within the radius; those drawn are the selected and the nearest of them

  show(
    lines: Iterable<Line>, growing: readonly Line[], path: readonly Vertex[], selectedIds: readonly string[], at: Place,
    origin: Vertex, colourOf: (kind: string) => string,
  ): void {
    const parts = { solid: part(), dashed: part(), halo: part(), selected: part(), selectedDashed: part() };
    const selected = new Set(selectedIds);
    const near = [...lines]
      .filter((line) => line.review !== REJECTED)
      .map((line) => ({ line, away_m: distanceTo(line, at), isSelected: selected.has(line.id) }))
      .filter(({ away_m }) => away_m < DRAW_RADIUS_M);
    this.near = near.length;
    this.drawn = nearest(near);
    for (const line of this.drawn) {
      const isSelected = selected.has(line.id);
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

// Along east or north, of the nearest vertex
function distanceTo(line: Line, at: Place): number {
  let least = Infinity;
  for (const [e, n] of line.xyz) least = Math.min(least, Math.max(Math.abs(e - at[0]), Math.abs(n - at[1])));
  return least;
}

// The selected lines, then the nearest, as many as have `MOST_SEGMENTS` together, and the first in any case
function nearest(lines: { line: Line; away_m: number; isSelected: boolean }[]): Line[] {
  const sorted = [...lines].sort((a, b) => Number(b.isSelected) - Number(a.isSelected) || a.away_m - b.away_m);
  let segments = 0;
  const beyond = sorted.findIndex(({ line }, i) => (segments += line.xyz.length - 1) > MOST_SEGMENTS && i > 0);
  return sorted.slice(0, beyond < 0 ? sorted.length : beyond).map(({ line }) => line);
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
