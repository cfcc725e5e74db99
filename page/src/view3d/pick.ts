// What a click in the 3-D view hits, computed from coordinates, so that it does not depend on the graphics card.

import type { PerspectiveCamera } from "three";

import type { Line, Vertex } from "../app/documents";

// The distance of a projected point from a pixel, and its depth; null: behind the camera
export type Projection = (x: number, y: number, z: number) => { distance_px: number; depth: number } | null;

// The projection for pixel (px, py) of a canvas; points are relative to the scene's origin
export function projectionAt(camera: PerspectiveCamera, box: DOMRect, px: number, py: number): Projection {
  camera.updateMatrixWorld();
  const m = camera.projectionMatrix.clone().multiply(camera.matrixWorldInverse);
  const e = m.elements;
  return (x, y, z) => {
    const w = e[3]! * x + e[7]! * y + e[11]! * z + e[15]!;
    if (w <= 0) return null;
    const sx = ((e[0]! * x + e[4]! * y + e[8]! * z + e[12]!) / w / 2 + 0.5) * box.width;
    const sy = (0.5 - (e[1]! * x + e[5]! * y + e[9]! * z + e[13]!) / w / 2) * box.height;
    return { distance_px: Math.hypot(sx - px, sy - py), depth: w };
  };
}

// Segments are sampled, because one near the camera may be many pixels long
const STEP_M = 0.25;
const MAX_STEPS = 40;

export function lineAt(lines: readonly Line[], origin: Vertex, project: Projection, within_px: number): Line | null {
  let best: Line | null = null;
  let least = within_px;
  for (const line of lines) {
    for (let i = 1; i < line.xyz.length; i++) {
      const [a, b] = [line.xyz[i - 1]!, line.xyz[i]!];
      const length = Math.hypot(b[0] - a[0], b[1] - a[1], b[2] - a[2]);
      const steps = Math.min(MAX_STEPS, Math.max(1, Math.ceil(length / STEP_M)));
      for (let step = 0; step <= steps; step++) {
        const [x, y, z] = [0, 1, 2].map((k) => a[k]! + ((b[k]! - a[k]!) * step) / steps - origin[k]!);
        const distance = project(x!, y!, z!)?.distance_px ?? Infinity;
        if (distance < least) [best, least] = [line, distance];
      }
    }
  }
  return best;
}
