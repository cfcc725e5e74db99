// The rows of the photolog: a pair and the keys pressed nearest to it; without images the keys alone.

import type { OperatorKey, Pair, Vertex } from "../app/documents";

export interface DriveRow {
  name: string;
  chainage_m: number;
  time_s: number;
  at: Vertex;
  pair: Pair | null;
  keys: OperatorKey[];
}

export function rowsOf(pairs: readonly Pair[], keys: readonly OperatorKey[]): DriveRow[] {
  const rows = pairs.map((pair): DriveRow => ({ ...placeOf(pair), name: `pair ${pair.number}`, pair, keys: [] }));
  rows.sort((a, b) => a.time_s - b.time_s);
  keys.forEach((key, i) => {
    const beside = rows[nearestTime(rows, key.time_s)];
    if (beside?.pair) beside.keys.push(key);
    else rows.push({ ...placeOf(key), name: `key ${i}`, pair: null, keys: [key] });
  });
  return rows;
}

function placeOf({ chainage_m, time_s, at }: Pair | OperatorKey): Pick<DriveRow, "chainage_m" | "time_s" | "at"> {
  return { chainage_m, time_s, at };
}

// By time, not chainage: a drive may pass a place twice
function nearestTime(rows: readonly DriveRow[], time_s: number): number {
  return nearest(rows, (row) => Math.abs(row.time_s - time_s));
}

export function nearestRow(rows: readonly DriveRow[], chainage_m: number): number {
  return nearest(rows, (row) => Math.abs(row.chainage_m - chainage_m));
}

function nearest(rows: readonly DriveRow[], far: (row: DriveRow) => number): number {
  let best = -1;
  let least = Infinity;
  rows.forEach((row, i) => {
    const distance = far(row);
    if (distance < least) [best, least] = [i, distance];
  });
  return best;
}
