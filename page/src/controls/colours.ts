// Colours of points. Views of points are dark in both themes, as paint is bright.

export type Colouring = "intensity" | "above" | "height";
export type Rgb = [number, number, number];

export const COLOURINGS: [Colouring, string][] = [
  ["intensity", "Intensity"],
  ["above", "Height above road"],
  ["height", "Height"],
];

export const INK = {
  canvas: "#12161b",
  grid: "#262d36",
  axis: "#56616e",
  text: "#c9d1da",
  chosen: "#ffffff",
  problem: "#ff6b60",
  seen: "#ffd54a",
} as const;

// From low to high: every step is told apart in shades of grey too
const RAMP: Rgb[] = [[62, 74, 137], [38, 130, 142], [53, 183, 121], [180, 222, 44], [253, 231, 37], [255, 250, 205]];
const UNKNOWN_CM = 32767;
// Kerbs are centimetres high and rails decimetres: heights above the road are told apart best near it
const ABOVE_M = 3;

export function ramp(share: number): Rgb {
  const at = Math.min(1, Math.max(0, share)) * (RAMP.length - 1);
  const i = Math.min(Math.floor(at), RAMP.length - 2);
  const low = RAMP[i]!;
  const high = RAMP[i + 1]!;
  return [0, 1, 2].map((k) => low[k]! + (high[k]! - low[k]!) * (at - i)) as Rgb;
}

// Dark points are still seen: asphalt is not black
export function grey(intensity: number): Rgb {
  const value = 55 + 200 * (intensity / 255) ** 0.8;
  return [value, value, value];
}

export function inkOf(colouring: Colouring, intensity: number, above_cm: number, z: number, heights: [number, number]): Rgb {
  if (colouring === "intensity") return grey(intensity);
  if (colouring === "height") return ramp((z - heights[0]) / Math.max(1, heights[1] - heights[0]));
  if (above_cm === UNKNOWN_CM) return [90, 98, 108];
  return ramp(Math.sqrt(Math.max(0, above_cm / 100) / ABOVE_M));
}

export const aboveKnown = (above_cm: number): boolean => above_cm !== UNKNOWN_CM;

// Lines a person cannot miss on a dark ground: dark colours are made lighter
export function bright(hex: string): string {
  const parts = [1, 3, 5].map((at) => Number.parseInt(hex.slice(at, at + 2), 16));
  const light = (parts[0]! * 2 + parts[1]! * 5 + parts[2]!) / 8;
  if (light >= 110) return hex;
  const toWhite = (110 - light) / (255 - light);
  return `#${parts.map((part) => Math.round(part + (255 - part) * toWhite).toString(16).padStart(2, "0")).join("")}`;
}
