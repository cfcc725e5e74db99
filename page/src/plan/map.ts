// The map of the plan view: the survey's own metres, north up, and where one may go in it.

import { defaults as controls } from "ol/control/defaults";
import ScaleLine from "ol/control/ScaleLine";
import { defaults as interactions } from "ol/interaction/defaults";
import OlMap from "ol/Map";
import Projection from "ol/proj/Projection";
import View from "ol/View";
import type { Place, Survey } from "../app/documents";

const FINEST_M = 0.002; // a pixel: finer than any sensor here sees
const COARSEST_SCREENS = 4; // how many times the survey fits into the view when it is farthest away

export type Box = [number, number, number, number];

export function metres(survey: Survey): Projection {
  // Nothing is ever transformed: a metre of the survey is a metre of the plan
  return new Projection({ code: "survey", units: "m", extent: grown(survey.bounds, 1000), getPointResolution: (r) => r });
}

export function planMap(target: HTMLElement, survey: Survey): OlMap {
  const [west, south, east, north] = survey.bounds;
  const view = new View({
    projection: metres(survey),
    center: [(west + east) / 2, (south + north) / 2],
    resolution: Math.max(east - west, north - south, 10) / 600,
    minResolution: FINEST_M,
    maxResolution: (Math.max(east - west, north - south, 10) / 400) * COARSEST_SCREENS,
    enableRotation: false,
    showFullExtent: true,
    smoothResolutionConstraint: false,
  });
  return new OlMap({
    target,
    view,
    controls: controls({ attribution: false, rotate: false, zoom: false }).extend([new ScaleLine({ minWidth: 80 })]),
    // Shift and a drag select; a double click belongs to the tools; keys have a table of their own
    interactions: interactions({
      altShiftDragRotate: false, pinchRotate: false, shiftDragZoom: false, doubleClickZoom: false, keyboard: false,
    }),
  });
}

export function grown([west, south, east, north]: Box, by_m: number): Box {
  return [west - by_m, south - by_m, east + by_m, north + by_m];
}

export function boxOf(places: readonly (readonly number[])[]): Box | null {
  let [west, south, east, north] = [Infinity, Infinity, -Infinity, -Infinity];
  for (const [e = NaN, n = NaN] of places) {
    [west, east] = [Math.min(west, e), Math.max(east, e)];
    [south, north] = [Math.min(south, n), Math.max(north, n)];
  }
  return west <= east && south <= north ? [west, south, east, north] : null;
}

export function placeOf(coordinate: readonly number[]): Place {
  return [coordinate[0] ?? NaN, coordinate[1] ?? NaN];
}
