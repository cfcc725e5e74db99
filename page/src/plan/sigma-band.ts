// The band in which a line lies: so many sigmas to either side of every vertex, across the line.

import type { Line, Place } from "../app/documents";

// The ring of the band, closed; empty where the line has no sigmas
export function sigmaBand(line: Line, sigmas: number): Place[] {
  const left: Place[] = [];
  const right: Place[] = [];
  line.xyz.forEach(([east, north], i) => {
    const sigma_m = line.sigma_xy_m[i] ?? null;
    const [across_e, across_n] = acrossAt(line, i);
    if (sigma_m === null || Number.isNaN(across_e)) return;
    left.push([east + across_e * sigma_m * sigmas, north + across_n * sigma_m * sigmas]);
    right.push([east - across_e * sigma_m * sigmas, north - across_n * sigma_m * sigmas]);
  });
  const first = left[0];
  return first === undefined || left.length < 2 ? [] : [...left, ...right.reverse(), first];
}

// Unit vector to the left of the line's direction at a vertex
function acrossAt(line: Line, i: number): Place {
  const before = line.xyz[Math.max(i - 1, 0)];
  const after = line.xyz[Math.min(i + 1, line.xyz.length - 1)];
  if (before === undefined || after === undefined) return [NaN, NaN];
  const [east, north] = [after[0] - before[0], after[1] - before[1]];
  const length = Math.hypot(east, north);
  return length > 0 ? [-north / length, east / length] : [NaN, NaN];
}
