// The map of the plan view: the survey's own coordinates in metres, north up, with zoom limits.

import { defaults as controls } from "ol/control/defaults";
import ScaleLine from "ol/control/ScaleLine";
import { defaults as interactions } from "ol/interaction/defaults";
import OlMap from "ol/Map";
import Projection from "ol/proj/Projection";
import View from "ol/View";
import type { Survey } from "../app/documents";
import { expanded } from "../app/geometry";

const FINEST_M = 0.002; // metres per pixel when zoomed in fully: finer than any sensor resolves
const MOVED_PX = 3; // a shorter drag is a click
const COARSEST_SCREENS = 4; // how many times the survey fits into the view when zoomed out fully

function metres(survey: Survey): Projection {
  // Coordinates are never transformed: a metre of the survey is a metre on the map
  return new Projection({ code: "survey", units: "m", extent: expanded(survey.bounds, 1000), getPointResolution: (r) => r });
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
    moveTolerance: MOVED_PX,
    controls: controls({ attribution: false, rotate: false, zoom: false }).extend([new ScaleLine({ minWidth: 80 })]),
    // Shift-drag selects, double-clicks belong to the tools, and keys go through the keyboard table
    interactions: interactions({
      altShiftDragRotate: false, pinchRotate: false, shiftDragZoom: false, doubleClickZoom: false, keyboard: false,
    }),
  });
}
