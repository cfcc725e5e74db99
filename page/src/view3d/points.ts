// Points around a place: dense near it and coarser farther out, so that a browser can draw them smoothly.

import { BufferAttribute, BufferGeometry, Group, Points, PointsMaterial } from "three";

import * as api from "../app/api";
import { type Colouring, pointColour } from "../controls/colours";
import type { Place, Vertex } from "../app/documents";
import type { Projection } from "./pick";

// Half width and point limit of each square ring; 150,000 points in all
const RINGS = [
  { half_m: 12, max: 60_000 },
  { half_m: 40, max: 50_000 },
  { half_m: 130, max: 40_000 },
] as const;
export const RELOAD_M = 6; // reload once the view is this far from the centre of the dense ring

interface Ring {
  points: api.Points;
  cloud: Points<BufferGeometry, PointsMaterial>;
}

export class PointRings {
  readonly group = new Group();
  private rings: Ring[] = [];
  private readonly material = new PointsMaterial({ size: 2, sizeAttenuation: false, vertexColors: true });
  at: Place | null = null;

  constructor(private readonly heights: [number, number]) {}

  get n(): number {
    return this.rings.reduce((sum, { points }) => sum + points.n, 0);
  }

  // Load the rings around a place, innermost first; `shown` is called after each
  async load(at: Place, origin: Vertex, colouring: Colouring, shown: () => void): Promise<void> {
    this.at = at;
    const rings: Ring[] = [];
    let inner: Bounds | null = null;
    for (const { half_m, max } of RINGS) {
      const bounds: Bounds = [at[0] - half_m, at[1] - half_m, at[0] + half_m, at[1] + half_m];
      const points: api.Points = without(await api.points(bounds, max), inner);
      rings.push({ points, cloud: this.cloud(points, origin, colouring) });
      inner = bounds;
      this.replace(rings);
      shown();
    }
  }

  colour(colouring: Colouring): void {
    for (const { points, cloud } of this.rings) {
      cloud.geometry.setAttribute("color", this.colours(points, colouring));
    }
  }

  resize(pixels: number): void {
    this.material.size = pixels;
  }

  // The point nearest to the camera among those within a few pixels
  nearest(project: Projection, within_px: number): { at: Vertex; depth: number } | null {
    let best: { at: Vertex; depth: number } | null = null;
    for (const { points, cloud } of this.rings) {
      const { x, y, z } = cloud.position;
      for (let i = 0; i < points.n; i++) {
        const [px, py, pz] = [points.xyz[3 * i]!, points.xyz[3 * i + 1]!, points.xyz[3 * i + 2]!];
        const hit = project(x + px, y + py, z + pz);
        if (!hit || hit.distance_px > within_px || (best && hit.depth >= best.depth)) continue;
        best = { at: [points.origin[0] + px, points.origin[1] + py, points.origin[2] + pz], depth: hit.depth };
      }
    }
    return best;
  }

  private cloud(points: api.Points, origin: Vertex, colouring: Colouring): Ring["cloud"] {
    const geometry = new BufferGeometry();
    geometry.setAttribute("position", new BufferAttribute(points.xyz, 3));
    geometry.setAttribute("color", this.colours(points, colouring));
    const cloud = new Points(geometry, this.material);
    // Subtracted in float64: coordinates of millions of metres do not fit a float32
    cloud.position.set(points.origin[0] - origin[0], points.origin[1] - origin[1], points.origin[2] - origin[2]);
    return cloud;
  }

  private colours(points: api.Points, colouring: Colouring): BufferAttribute {
    const colours = new Uint8Array(3 * points.n);
    for (let i = 0; i < points.n; i++) {
      const z = points.origin[2] + points.xyz[3 * i + 2]!;
      colours.set(pointColour(colouring, points.intensity[i]!, points.above_cm[i]!, z, this.heights), 3 * i);
    }
    return new BufferAttribute(colours, 3, true);
  }

  private replace(rings: Ring[]): void {
    for (const ring of this.rings) if (!rings.includes(ring)) ring.cloud.geometry.dispose();
    this.rings = [...rings];
    this.group.clear();
    this.group.add(...rings.map(({ cloud }) => cloud));
  }
}

type Bounds = [number, number, number, number];

// Leaves out the points that the next inner ring shows
function without(points: api.Points, bounds: Bounds | null): api.Points {
  if (!bounds) return points;
  const [west, south, east, north] = bounds;
  const { origin } = points;
  const kept: number[] = [];
  for (let i = 0; i < points.n; i++) {
    const [e, n] = [origin[0] + points.xyz[3 * i]!, origin[1] + points.xyz[3 * i + 1]!];
    if (e < west || e >= east || n < south || n >= north) kept.push(i);
  }
  const xyz = new Float32Array(3 * kept.length);
  kept.forEach((i, at) => xyz.set(points.xyz.subarray(3 * i, 3 * i + 3), 3 * at));
  return {
    n: kept.length,
    origin,
    xyz,
    intensity: Uint8Array.from(kept, (i) => points.intensity[i]!),
    above_cm: Int16Array.from(kept, (i) => points.above_cm[i]!),
  };
}
