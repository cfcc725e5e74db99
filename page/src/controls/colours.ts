// Colours of the views of points and images. They are dark in both themes, because paint is bright.

export type Colouring = "intensity" | "above" | "height";
export type Rgb = [number, number, number];

export const COLOURINGS: [Colouring, string][] = [
  ["intensity", "Intensity"],
  ["above", "Height above road"],
  ["height", "Height"],
];

export const CANVAS = {
  background: "#12161b",
  grid: "#262d36",
  axis: "#56616e",
  text: "#c9d1da",
  selected: "#ffffff",
  problem: "#ff6b60",
  followed: "#ffd54a",
} as const;

// From low to high; lightness increases too, so the ramp also reads in greyscale
const RAMP: Rgb[] = [[62, 74, 137], [38, 130, 142], [53, 183, 121], [180, 222, 44], [253, 231, 37], [255, 250, 205]];
const UNKNOWN_CM = 32767;
// Top of the ramp of heights above the road [m]. Kerbs are centimetres high and rails decimetres: most of the ramp is near 0
const ABOVE_M = 3;

export function ramp(share: number): Rgb {
  const position = Math.min(1, Math.max(0, share)) * (RAMP.length - 1);
  const i = Math.min(Math.floor(position), RAMP.length - 2);
  const low = RAMP[i]!;
  const high = RAMP[i + 1]!;
  return [0, 1, 2].map((k) => low[k]! + (high[k]! - low[k]!) * (position - i)) as Rgb;
}

// Starts above black, so that dark asphalt stays visible
export function grey(intensity: number): Rgb {
  const value = 55 + 200 * (intensity / 255) ** 0.8;
  return [value, value, value];
}

export function pointColour(colouring: Colouring, intensity: number, above_cm: number, z: number, heights: [number, number]): Rgb {
  if (colouring === "intensity") return grey(intensity);
  if (colouring === "height") return ramp((z - heights[0]) / Math.max(1, heights[1] - heights[0]));
  if (above_cm === UNKNOWN_CM) return [90, 98, 108];
  return ramp(Math.sqrt(Math.max(0, above_cm / 100) / ABOVE_M));
}

export const isAboveKnown = (above_cm: number): boolean => above_cm !== UNKNOWN_CM;

// A line's colour, lightened if it would be hard to see on the dark background
export function brightened(hex: string): string {
  const parts = [1, 3, 5].map((position) => Number.parseInt(hex.slice(position, position + 2), 16));
  const luminance = (parts[0]! * 2 + parts[1]! * 5 + parts[2]!) / 8;
  if (luminance >= 110) return hex;
  const share = (110 - luminance) / (255 - luminance);
  return `#${parts.map((part) => Math.round(part + (255 - part) * share).toString(16).padStart(2, "0")).join("")}`;
}
