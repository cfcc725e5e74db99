// Where the section is: across the selected line if that is near, else across the van's way.

import { headingOf, nearestOn, type Station, stationAt } from "../app/along-line";
import { inSection, inWorld } from "./nodes";
import type { Line, Place, Survey } from "../app/documents";

// A line so far from where one looks is not what one looks at
const BESIDE_M = 15;
// The section is on the line, and stays on it
const ON_M = 1;

export function middleOf({ middle }: Survey): Place {
  return [middle[0], middle[1]];
}

export function stationFor(survey: Survey, line: Line | undefined, place: Place): Station {
  const onLine = line && nearestOn(line.xyz, place);
  if (onLine && onLine.distance_m <= BESIDE_M) return onLine.station;
  const onPath = nearestOn(survey.path, place)?.station;
  return { at: place, z: onPath?.z ?? survey.middle[2], heading_deg: onPath?.heading_deg ?? 0, chainage_m: 0 };
}

// The place on the line to go to when it is selected; null: the section is near it already
export function farFrom(line: Line, station: Station): Station | null {
  const here = nearestOn(line.xyz, station.at);
  return here && here.distance_m > BESIDE_M ? here.station : null;
}

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
export function nextVertex(line: Line, station: Station, way: 1 | -1): Station | null {
  const ahead = line.xyz.map((vertex, i) => ({ i, y: inSection(station, vertex)[1] * way }));
  const next = ahead.filter(({ y }) => y > 0.01).sort((a, b) => a.y - b.y)[0];
  if (!next) return null;
  const [east, north, z] = line.xyz[next.i]!;
  const [a, b] = [line.xyz[Math.max(0, next.i - 1)]!, line.xyz[Math.min(line.xyz.length - 1, next.i + 1)]!];
  return { at: [east, north], z, heading_deg: headingOf(a, b), chainage_m: 0 };
}
