// Points around a place: dense near it, coarser around, so that there are never more than a browser draws at ease.

import { BufferAttribute, BufferGeometry, Group, Points, PointsMaterial } from "three";

import * as api from "../app/api";
import { type Colouring, inkOf } from "../controls/colours";
import type { Place, Vertex } from "../app/documents";

// Half the width of each ring, and the most points in it; 150 000 all in all
const RINGS = [
  { half_m: 12, most: 60_000 },
  { half_m: 40, most: 50_000 },
  { half_m: 130, most: 40_000 },
] as const;
// Farther than so from where they were loaded, what one looks at is not dense any more
export const RELOAD_M = 6;

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

  // Load what is around a place, the near first; `shown` is called after each ring
  async load(at: Place, origin: Vertex, colouring: Colouring, shown: () => void): Promise<void> {
    this.at = at;
    const rings: Ring[] = [];
    let inner: Bounds | null = null;
    for (const { half_m, most } of RINGS) {
      const bounds: Bounds = [at[0] - half_m, at[1] - half_m, at[0] + half_m, at[1] + half_m];
      const points: api.Points = without(await api.points(bounds, most), inner);
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

  // The place seen nearest to the eye within a few pixels; `seen` is the pixel distance and depth of a local place
  nearest(
    seen: (x: number, y: number, z: number) => { far: number; depth: number } | null, within_px: number,
  ): { at: Vertex; depth: number } | null {
    let best: { at: Vertex; depth: number } | null = null;
    for (const { points, cloud } of this.rings) {
      const { x, y, z } = cloud.position;
      for (let i = 0; i < points.n; i++) {
        const [px, py, pz] = [points.xyz[3 * i]!, points.xyz[3 * i + 1]!, points.xyz[3 * i + 2]!];
        const here = seen(x + px, y + py, z + pz);
        if (!here || here.far > within_px || (best && here.depth >= best.depth)) continue;
        best = { at: [points.origin[0] + px, points.origin[1] + py, points.origin[2] + pz], depth: here.depth };
      }
    }
    return best;
  }

  private cloud(points: api.Points, origin: Vertex, colouring: Colouring): Ring["cloud"] {
    const geometry = new BufferGeometry();
    geometry.setAttribute("position", new BufferAttribute(points.xyz, 3));
    geometry.setAttribute("color", this.colours(points, colouring));
    const cloud = new Points(geometry, this.material);
    // Subtracted in double: coordinates of millions of metres do not fit a float32
    cloud.position.set(points.origin[0] - origin[0], points.origin[1] - origin[1], points.origin[2] - origin[2]);
    return cloud;
  }

  private colours(points: api.Points, colouring: Colouring): BufferAttribute {
    const colours = new Uint8Array(3 * points.n);
    for (let i = 0; i < points.n; i++) {
      const z = points.origin[2] + points.xyz[3 * i + 2]!;
      colours.set(inkOf(colouring, points.intensity[i]!, points.above_cm[i]!, z, this.heights), 3 * i);
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

// What a ring inside shows already is left out
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
