// How the straightened view is laid out: its strips with their ranges, and the height from which heights are shown.

import type { Points } from "../app/api";
import type { LineAlong } from "./lines-along";
import { type Measures, roadHeights, type Series } from "./measures";
import { laidOut, type Strips } from "./strips";

export interface View {
  from_m: number;
  window_m: number;
  half_width_m: number;
  slice_m: number;
  zoom: number; // of the strip of heights
}

// Around a line on the ground, and around one that stands or hangs, whose foot may be shown too [m]
const ON_GROUND_M = 0.3;
const ABOVE_GROUND_M = 1.2;
const STANDS = ["guardrail", "barrier", "fence", "cable", "pole"];

// The straight grade through the line, or through the road where no line is selected: what differs from it is seen
export function referenceFor(target: LineAlong | null, points: Points | null): (s: number) => number {
  const places: Series = target ? target.runs.flat().map(({ s, z }) => [s, z]) : [...roadHeights(points)];
  if (places.length === 0) return () => 0;
  const mean = (of: (place: [number, number]) => number): number => places.reduce((sum, place) => sum + of(place), 0) / places.length;
  const [s0, z0] = [mean(([s]) => s), mean(([, z]) => z)];
  const squares = mean(([s]) => (s - s0) ** 2);
  const grade = squares > 0 ? mean(([s, z]) => (s - s0) * (z - z0)) / squares : 0;
  return (s) => z0 + grade * (s - s0);
}

export function stripsFor(
  canvas: HTMLElement, view: View, target: LineAlong | null, measures: Measures | null, reference: (s: number) => number,
  hasPoints: boolean,
): Strips {
  const { from_m, window_m, half_width_m, zoom } = view;
  const margin_m = zoom * (STANDS.includes(target?.line.kind ?? "") ? ABOVE_GROUND_M : ON_GROUND_M);
  const off = (target?.runs.flat() ?? []).map(({ s, z }) => z - reference(s));
  const heights: [number, number] = [Math.min(0, ...off) - margin_m, Math.max(0, ...off) + margin_m];
  const sigmas = [...(measures?.sigma_xy_cm ?? []), ...(measures?.sigma_z_cm ?? [])].map(([, value]) => value);
  const values = (measures?.height.values ?? []).map(([, value]) => value);
  const strips = [
    { name: "plan" as const, label: "Offset [m]: left above, right below", share: 5, low: -half_width_m, high: half_width_m },
    {
      name: "heights" as const, label: target ? "Height from the line's mean grade [m]" : "Height from the road's mean grade [m]",
      share: hasPoints || target ? 4 : 1, low: heights[0], high: heights[1],
    },
  ];
  if (!measures) return laidOut(canvas.clientWidth, canvas.clientHeight, [from_m, from_m + window_m], strips);
  const known = values.length > 0;
  return laidOut(canvas.clientWidth, canvas.clientHeight, [from_m, from_m + window_m], [
    ...strips,
    { name: "accuracy", label: "σ plan (yellow), σ height (violet) [cm]", share: 2, low: 0, high: Math.max(2, ...sigmas) * 1.1 },
    {
      name: "height", label: known ? `${measures.height.title} [m]` : `${measures.height.title}: not known here`, share: 2,
      low: Math.min(0, ...values), high: known ? Math.max(0.1, ...values) * 1.25 : 1,
    },
  ]);
}
