// Which lines are shown: the same in the plan, in the table of lines and in an export of what is listed.

import type { Line } from "./documents";

export const REJECTED = "rejected";

export interface Limits {
  role: string; // "": all
  review: string; // "": all; "none": not reviewed
  least_confidence: number;
  greatest_sigma_m: number; // of the median of the vertices, in plan; Infinity: no limit
  bridged: boolean; // only lines with bridged stretches
}

const NO_LIMITS: Limits = { role: "", review: "", least_confidence: 0, greatest_sigma_m: Infinity, bridged: false };

export class LineFilter {
  readonly hidden = new Set<string>(); // kinds, and "rejected"
  private limits: Limits = NO_LIMITS;

  constructor(private readonly changed: () => void) {}

  get now(): Limits {
    return this.limits;
  }

  shows(line: Line): boolean {
    const { role, review, least_confidence, greatest_sigma_m, bridged } = this.limits;
    if (this.hidden.has(line.kind) || (line.review === REJECTED && this.hidden.has(REJECTED))) return false;
    if (role !== "" && line.role !== role) return false;
    if (review !== "" && line.review !== (review === "none" ? "" : review)) return false;
    if (line.confidence < least_confidence || (bridged && line.bridged_m === 0)) return false;
    // A line of unknown accuracy is not within a limit
    return greatest_sigma_m === Infinity || (sigmaOf(line) ?? Infinity) <= greatest_sigma_m;
  }

  limit(limits: Partial<Limits>): void {
    this.limits = { ...this.limits, ...limits };
    this.changed();
  }

  hide(name: string, hidden: boolean): void {
    if (hidden) this.hidden.add(name);
    else this.hidden.delete(name);
    this.changed();
  }

  // Show only these kinds, of all; rejected lines stay as they are
  only(kinds: readonly string[], all: readonly string[]): void {
    for (const kind of all)
      if (kinds.includes(kind)) this.hidden.delete(kind);
      else this.hidden.add(kind);
    this.changed();
  }

  // Show everything
  clear(): void {
    this.hidden.clear();
    this.limits = NO_LIMITS;
    this.changed();
  }
}

const sigmas = new WeakMap<Line, number | null>();

// The median standard deviation of a line's vertices in plan [m]; null: unknown
export function sigmaOf(line: Line): number | null {
  let found = sigmas.get(line);
  if (found === undefined) sigmas.set(line, (found = medianOf(line.sigma_xy_m)));
  return found;
}

export function medianOf(values: readonly (number | null)[]): number | null {
  const known = values.filter((value) => value !== null).sort((a, b) => a - b);
  return known[Math.floor(known.length / 2)] ?? null;
}
