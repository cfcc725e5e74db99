"""Sightings of one pair: which lines of stripes are paint on the road, and places on them every half a metre."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from linework.arrays import FloatArray, IntArray, distance_along
from linework.kernels.images.link_stripes import fit_at
from linework.kernels.images.row_stripes import COL, LEVEL, ROW, STRIPE_CONTRAST, STRIPE_SIGMA, WIDTH
from linework.methods.stereo.fitted import (
    BRIGHT_ROAD_FACTOR,
    EDGE_STEP_M,
    LEAST_MATCHED,
    LEAST_STRIPE_SIGMA_PX,
    LIGHT,
    LIGHT_SHARE,
    OVER_ASIDE_M,
    OVER_M,
    RAGGED,
    SHORT_LINE_SCORE,
    SHORT_LINE_SLOPE_M,
    STEEP_PAINT,
    TURNING_QUANTILE,
    UNDER_M,
    WIDTH_BLUR_PX,
    WINDING_RAD,
    WINDING_STEP_M,
    WORN_SHARE,
)
from linework.methods.stereo.road_plane import PLANE_AHEAD_M, RoadShape
from linework.methods.stereo.stripes import StripeConfig, StripeLines
from linework.model.camera import RectifiedRig
from linework.model.images import RectifiedPair
from linework.model.sightings import Sightings

#: Distance between sightings on a line. [m]
SIGHTING_SPACING_M = 0.5
#: Fewest rows and shortest length of a line: fewer places have no direction. [rows, m]
LEAST_ROWS, LEAST_LENGTH_M = 3, 0.3
#: Half window of the local straight line through the columns of a line [m], and its smallest value [rows].
STRAIGHT_PIECE_M, LEAST_PIECE_ROWS = 0.6, 2.5
#: Half window over which the disparity above that of the road changes linearly [m], and its smallest value [rows].
SMOOTH_DISTANCE_M, LEAST_SMOOTH_ROWS = 3.0, 4.5
#: Half the width of a lane: farther to the sides roads fall away from their crown. [m]
CROWN_ASIDE_M = 2.5
#: Radius of crests and sags that the shape of the road misses within the range of the cameras. [m]
BEND_M = 1500.0
#: Half the width in front of the cameras that is certainly road, because the van drives on it. [m]
OWN_LANE_M = 1.5
#: Spacing of the pixels whose grey values are those of the road: enough for a quantile. [rows, columns]
GREY_ROWS, GREY_COLS = 4, 8
#: Standard deviations by which a measured height may exceed its limit.
SIGHTED_HEIGHT_SIGMAS = 2.0


@dataclass(frozen=True, slots=True)
class _Line:
    """One line of a pair that is paint: rows of its stripes, distance along it [m], slope across over ahead, score."""

    at: IntArray
    along_m: FloatArray
    slope: float
    score: float


def sightings_of(pair: RectifiedPair, road: RoadShape, lines: StripeLines, config: StripeConfig) -> Sightings:
    """Return the sightings of those lines of stripes that are paint on the road, in the vehicle frame."""
    if not len(lines.line):
        return Sightings.empty()
    rig = pair.rig
    kept = []
    greys = _road_greys(pair, road)
    order = np.argsort(lines.line, kind="stable")
    numbers, first = np.unique(lines.line[order], return_index=True)
    for number, at in zip(numbers.tolist(), np.split(order, first[1:]), strict=True):
        if number >= 0 and len(at) >= LEAST_ROWS:
            line = _judged(lines, at, rig, road, config, greys)
            if line is not None:
                kept.append(line)
    parts = [_places(line, lines, pair, i) for i, line in enumerate(kept)]
    return Sightings.concatenate(parts)


def _judged(
    lines: StripeLines,
    at: IntArray,
    rig: RectifiedRig,
    road: RoadShape,
    config: StripeConfig,
    greys: FloatArray,
) -> _Line | None:
    """Return a line of stripes that is paint on the road, else None.

    Parameters
    ----------
    at
        (k,) int64: stripes of the line.
    greys
        (m,) grey values of the road, ascending.
    """
    matched = np.isfinite(lines.disparity[at])
    if matched.sum() < max(LEAST_ROWS, LEAST_MATCHED * len(at)):
        return None
    # Cut to the stripes between the first and the last that both images show
    both = np.flatnonzero(matched)
    at, matched = at[both[0] : both[-1] + 1], matched[both[0] : both[-1] + 1]
    t, surface = lines.table[at], lines.road_disparity[at]
    per_px = rig.base_m / surface
    across, ahead = (t[:, COL] - rig.cx) * per_px, rig.focal_px * per_px
    along = distance_along(np.stack([across, ahead], axis=1))
    if along[-1] < LEAST_LENGTH_M:
        return None
    slope = _slope(ahead, across)
    # Width across the line, not along the row
    width_m = t[:, WIDTH] * per_px / math.hypot(1.0, slope)
    width = float(np.median(width_m))
    ragged = float(np.median(np.abs(width_m - width))) - WIDTH_BLUR_PX * float(np.median(per_px))
    if not config.least_width_m <= width <= config.largest_width_m or ragged > RAGGED * width:
        return None
    if _turning(across, ahead, along) > WINDING_RAD + WORN_SHARE * width / WINDING_STEP_M:
        return None
    height = road.plane.camera_height_m(rig) * (1.0 - surface / lines.disparity[at])
    # Lean: 0 for paint; an upright object has one distance in all its rows and appears to rise with it
    lean = _slope(ahead[matched], height[matched]) * float(np.median(ahead)) / road.plane.camera_height_m(rig)
    sigma = float(np.median(height_sigma(rig, lines, at[matched]))) / math.sqrt(matched.sum())
    middle = float(np.median(height[matched]))
    crest = float(np.median(ahead)) ** 2 / (2.0 * BEND_M)
    aside = abs(float(np.median(across))) > CROWN_ASIDE_M
    over = (OVER_ASIDE_M if aside else OVER_M) + crest + SIGHTED_HEIGHT_SIGMAS * sigma
    if abs(lean) > STEEP_PAINT or not -UNDER_M - crest - SIGHTED_HEIGHT_SIGMAS * sigma < middle < over:
        return None
    # The shape of the road may follow a footway, which is higher than the lane that the van drives on
    lane = road.level_disparity(rig, t[:, COL], t[:, ROW])
    if (
        aside
        and road.plane.camera_height_m(rig) * float(np.nanmedian(1.0 - lane / lines.disparity[at])) > over
    ):
        return None
    # Height of one edge above the other
    step = road.plane.camera_height_m(rig) * lines.widening[at] / surface
    if abs(float(np.nanmedian(step))) > EDGE_STEP_M + SIGHTED_HEIGHT_SIGMAS * sigma:
        return None
    score = float(matched.mean()) * (1.0 - max(ragged, 0.0) / (2.0 * RAGGED * width))
    score *= min(1.0, SHORT_LINE_SCORE + along[-1] / SHORT_LINE_SLOPE_M)
    # Where the road itself is as bright, the stripe may be a strip of sunlight
    paint = LIGHT * float(np.median(t[:, LEVEL] + t[:, STRIPE_CONTRAST]))
    as_bright = 1.0 - np.searchsorted(greys, paint) / max(len(greys), 1)
    sunlit = min(max((as_bright - LIGHT_SHARE[0]) / (LIGHT_SHARE[1] - LIGHT_SHARE[0]), 0.0), 1.0)
    score *= 1.0 - BRIGHT_ROAD_FACTOR * sunlit
    return _Line(at, along, slope, score)


def _road_greys(pair: RectifiedPair, road: RoadShape) -> FloatArray:
    """Return (m,) grey values of the road in front of the van, in ascending order."""
    rig = pair.rig
    row, col = (v.ravel() for v in np.mgrid[0 : rig.height : GREY_ROWS, 0 : rig.width : GREY_COLS])
    d = road.plane.disparity(rig, col, row)
    near = (d > rig.focal_px * rig.base_m / PLANE_AHEAD_M) & (
        np.abs(col - rig.cx) * rig.base_m < OWN_LANE_M * d
    )
    return np.sort(pair.left[row[near], col[near]]).astype(np.float64)


def _turning(across: FloatArray, ahead: FloatArray, along: FloatArray) -> float:
    """Return the upper quartile of a line's turns from one step of `WINDING_STEP_M` to the next. [rad]"""  # noqa: D400
    n = int(along[-1] / WINDING_STEP_M) + 1
    if n < 3:
        return 0.0
    where = np.linspace(0.0, along[-1], n)
    heading = np.arctan2(np.diff(np.interp(where, along, across)), np.diff(np.interp(where, along, ahead)))
    return float(np.quantile(np.abs(np.diff(heading)), TURNING_QUANTILE))


def _slope(x: FloatArray, y: FloatArray) -> float:
    """Return the slope of a straight line as the median over pairs of places half the line apart."""
    half = max(len(x) // 2, 1)
    step = x[half:] - x[:-half]
    good = np.abs(step) > 1e-9
    return float(np.median((y[half:] - y[:-half])[good] / step[good])) if good.any() else 0.0


def height_sigma(rig: RectifiedRig, lines: StripeLines, at: IntArray) -> FloatArray:
    """Return (k,) standard deviations of the heights of the stripes `at` (k,) above the road. [m]"""  # noqa: D400
    per_px = rig.base_m / lines.road_disparity[at]
    below = np.maximum(lines.table[at, ROW] - rig.cy, 1.0) * per_px
    return np.asarray(below * lines.sigma_disparity[at] / lines.road_disparity[at])


def _places(line: _Line, lines: StripeLines, pair: RectifiedPair, number: int) -> Sightings:
    """Return the sightings of a line, from local straight lines through its stripes in both images."""
    rig, at = pair.rig, line.at
    t = lines.table[at]
    s = line.along_m
    n = max(math.ceil(s[-1] / SIGHTING_SPACING_M), 1) + 1
    where = np.linspace(0.0, s[-1], n)
    # Windows are in rows: a straight line in space is straight in the image
    v = -t[:, ROW]
    row = np.interp(where, s, t[:, ROW])
    step = np.abs(np.interp(where + 0.5, s, t[:, ROW]) - np.interp(where - 0.5, s, t[:, ROW]))
    rows_per_m = np.maximum(step, 0.5)
    sigma = np.maximum(t[:, STRIPE_SIGMA], LEAST_STRIPE_SIGMA_PX)
    col, sigma_col = fit_at(
        v, t[:, COL], sigma, -row, np.maximum(STRAIGHT_PIECE_M * rows_per_m, LEAST_PIECE_ROWS)
    )
    rest, sigma_d = fit_at(
        v, lines.disparity[at] - lines.road_disparity[at], np.nan_to_num(lines.sigma_disparity[at], nan=1.0),
        -row, np.maximum(SMOOTH_DISTANCE_M * rows_per_m, LEAST_SMOOTH_ROWS),
    )  # fmt: skip
    road = np.interp(where, s, lines.road_disparity[at])
    disparity = road + rest
    return Sightings(
        xyz=rig.intersect(col, row, disparity),
        pair=np.full(n, pair.number), line=np.full(n, number),
        col=col, row=row, disparity=disparity,
        sigma_px=np.hypot(sigma_col, LEAST_STRIPE_SIGMA_PX), sigma_disparity_px=np.hypot(sigma_d, LEAST_STRIPE_SIGMA_PX),
        width_m=np.full(n, np.median(t[:, WIDTH] * rig.base_m / lines.road_disparity[at]))
        / math.hypot(1.0, line.slope),
        contrast=np.full(n, np.median(t[:, STRIPE_CONTRAST])), score=np.full(n, line.score),
    )  # fmt: skip
