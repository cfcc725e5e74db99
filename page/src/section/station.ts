// Where the section is: across the selected line if that is near, else across the vehicle's path.

import { headingOf, nearestOn, type Station, stationAt } from "../app/geometry";
import { inSection, inWorld } from "./nodes";
import type { Line, Place, Survey } from "../app/documents";

const NEAR_M = 15; // a selected line farther than this from the place is ignored
const ON_M = 1; // a section within this distance of the line steps along it

export function startOf({ middle }: Survey): Place {
  return [middle[0], middle[1]];
}

export function stationFor(survey: Survey, line: Line | undefined, place: Place): Station {
  const onLine = line && nearestOn(line.xyz, place);
  if (onLine && onLine.distance_m <= NEAR_M) return onLine.station;
  const onPath = nearestOn(survey.path, place)?.station;
  return { at: place, z: onPath?.z ?? survey.middle[2], heading_deg: onPath?.heading_deg ?? 0, chainage_m: 0 };
}

// Where to move when a line is selected; null: the section is near it already
export function stationOnto(line: Line, station: Station): Station | null {
  const here = nearestOn(line.xyz, station.at);
  return here && here.distance_m > NEAR_M ? here.station : null;
}

// The station `by_m` farther along the line, or along the path
export function stepped(survey: Survey, line: Line | undefined, station: Station, by_m: number): Station {
  const onLine = line && nearestOn(line.xyz, station.at);
  if (line && onLine && onLine.distance_m < ON_M) {
    const backwards = Math.cos(((onLine.station.heading_deg - station.heading_deg) * Math.PI) / 180) < 0;
    const next = stationAt(line.xyz, onLine.station.chainage_m + (backwards ? -by_m : by_m));
    if (next) return next;
  }
  const at = inWorld(station, 0, by_m);
  const heading_deg = nearestOn(survey.path, at)?.station.heading_deg ?? station.heading_deg;
  return { ...station, at, heading_deg };
}

// The next vertex of the line, ahead (1) or behind (-1)
export function nextVertex(line: Line, station: Station, direction: 1 | -1): Station | null {
  const ahead = line.xyz.map((vertex, i) => ({ i, y: inSection(station, vertex)[1] * direction }));
  const next = ahead.filter(({ y }) => y > 0.01).sort((a, b) => a.y - b.y)[0];
  if (!next) return null;
  const [east, north, z] = line.xyz[next.i]!;
  const [a, b] = [line.xyz[Math.max(0, next.i - 1)]!, line.xyz[Math.min(line.xyz.length - 1, next.i + 1)]!];
  return { at: [east, north], z, heading_deg: headingOf(a, b), chainage_m: 0 };
}
