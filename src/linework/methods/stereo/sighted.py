"""What a pair has seen of lines on the road: places every half a metre, with their standard deviations."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from linework.arrays import FloatArray, IntArray
from linework.kernels.images.link_stripes import fit_at
from linework.kernels.images.row_stripes import COL, LEVEL, ROW, STRIPE_CONTRAST, STRIPE_SIGMA, WIDTH
from linework.methods.stereo.road_plane import PLANE_AHEAD_M, RoadShape
from linework.methods.stereo.stripes import LEAST_STRIPE_SIGMA_PX, StripeConfig, StripeLines
from linework.model.camera import RectifiedRig
from linework.model.images import RectifiedPair
from linework.model.sightings import Sightings

#: Places on a line stand about so far apart. [m]
SIGHTING_SPACING_M = 0.5
#: Paint in fewer rows, or shorter, shows no line.
LEAST_ROWS, LEAST_LENGTH_M = 3, 0.3
#: Of a line so many of the stripes have a partner in the other image.
LEAST_MATCHED = 0.4
#: A line is straight over so much of it across the image, its distance changes as the road's over so much. [m]
STRAIGHT_PIECE_M, SMOOTH_DISTANCE_M = 0.6, 3.0
#: Both edges of paint are parallel: widths differ by no more than this share (median), blur apart. [1, pixels]
RAGGED, WIDTH_BLUR_PX = 0.5, 0.35
#: Steps of this length turn little from one to the next [m, rad], as in a bend of 5 m radius, and where paint is worn
#: to one side by this share of its width: blades of grass and the grain of asphalt, linked by chance, wind about.
WINDING_STEP_M, WINDING_RAD, WORN_SHARE = 0.5, 0.12, 0.5
#: Paint is flat on the road: what stands up from it by this share of upright is a post or a wheel.
STEEP_PAINT = 0.5
#: Paint is on the road's surface within the shape of gutters, ruts and crowns; kerbs stand higher. [m]
UNDER_M, OVER_M = 0.15, 0.10
#: So far to the sides roads fall away from their crown; what is higher there is a kerb. [m, m]
CROWN_ASIDE_M, OVER_ASIDE_M = 2.5, 0.05
#: Of crests and sags within the reach of the cameras the shape of the road misses those of this radius. [m]
BEND_M = 1500.0
#: Paint is flat: of a kerb stone the one edge is at its foot. [m]
EDGE_STEP_M = 0.04
#: Paint is brighter than the road. Where so large a share of the road (none, fully) is as bright as this share of
#: the stripe's grey value, the stripe may be road in the sun between shadows.
LIGHT, LIGHT_SHARE = 0.9, (0.03, 0.10)
#: Half the width before the cameras that is road for sure, as the van drives on it. [m]
OWN_LANE_M = 1.5


@dataclass(frozen=True, slots=True)
class _Line:
    """One line of a pair: its stripes, and what they say together."""

    at: IntArray
    along_m: FloatArray
    slope: float
    score: float


def sightings_of(pair: RectifiedPair, road: RoadShape, lines: StripeLines, config: StripeConfig) -> Sightings:
    """Return the places on those lines of stripes that are paint on the road."""
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
    """Return a line of stripes if they are those of paint on the road."""
    matched = np.isfinite(lines.disparity[at])
    if matched.sum() < max(LEAST_ROWS, LEAST_MATCHED * len(at)):
        return None
    # From the first to the last stripe that both images show
    both = np.flatnonzero(matched)
    at, matched = at[both[0] : both[-1] + 1], matched[both[0] : both[-1] + 1]
    t, surface = lines.table[at], lines.road_disparity[at]
    per_px = rig.base_m / surface
    across, ahead = (t[:, COL] - rig.cx) * per_px, rig.focal_px * per_px
    along = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(across), np.diff(ahead)))])
    if along[-1] < LEAST_LENGTH_M:
        return None
    slope = _slope(ahead, across)
    # Across the line, not across the view
    width_m = t[:, WIDTH] * per_px / math.hypot(1.0, slope)
    width = float(np.median(width_m))
    ragged = float(np.median(np.abs(width_m - width))) - WIDTH_BLUR_PX * float(np.median(per_px))
    if not config.least_width_m <= width <= config.largest_width_m or ragged > RAGGED * width:
        return None
    if _turning(across, ahead, along) > WINDING_RAD + WORN_SHARE * width / WINDING_STEP_M:
        return None
    height = road.plane.camera_height_m(rig) * (1.0 - surface / lines.disparity[at])
    # What stands upright has one distance in all its rows: it would rise to the camera's height at no distance
    lean = _slope(ahead[matched], height[matched]) * float(np.median(ahead)) / road.plane.camera_height_m(rig)
    sigma = float(np.median(height_sigma(rig, lines, at[matched]))) / math.sqrt(matched.sum())
    middle = float(np.median(height[matched]))
    crest = float(np.median(ahead)) ** 2 / (2.0 * BEND_M)
    aside = abs(float(np.median(across))) > CROWN_ASIDE_M
    over = (OVER_ASIDE_M if aside else OVER_M) + crest + 2.0 * sigma
    if abs(lean) > STEEP_PAINT or not -UNDER_M - crest - 2.0 * sigma < middle < over:
        return None
    # A footway may have passed for the road's shape; it is higher than the lane that the van drives on
    lane = road.level_disparity(rig, t[:, COL], t[:, ROW])
    if (
        aside
        and road.plane.camera_height_m(rig) * float(np.nanmedian(1.0 - lane / lines.disparity[at])) > over
    ):
        return None
    # How much higher the one edge is than the other
    step = road.plane.camera_height_m(rig) * lines.widening[at] / surface
    if abs(float(np.nanmedian(step))) > EDGE_STEP_M + 2.0 * sigma:
        return None
    score = float(matched.mean()) * (1.0 - max(ragged, 0.0) / (2.0 * RAGGED * width))
    score *= min(1.0, 0.5 + along[-1] / 4.0)
    # Where the road itself is as bright, in the sun, this may be a strip of light
    paint = LIGHT * float(np.median(t[:, LEVEL] + t[:, STRIPE_CONTRAST]))
    as_bright = 1.0 - np.searchsorted(greys, paint) / max(len(greys), 1)
    score *= 1.0 - 0.5 * min(max((as_bright - LIGHT_SHARE[0]) / (LIGHT_SHARE[1] - LIGHT_SHARE[0]), 0.0), 1.0)
    return _Line(at, along, slope, score)


def _road_greys(pair: RectifiedPair, road: RoadShape) -> FloatArray:
    """Return the grey values of the road before the van, in ascending order."""
    rig = pair.rig
    row, col = (v.ravel() for v in np.mgrid[0 : rig.height : 4, 0 : rig.width : 8])
    d = road.plane.disparity(rig, col, row)
    near = (d > rig.focal_px * rig.base_m / PLANE_AHEAD_M) & (
        np.abs(col - rig.cx) * rig.base_m < OWN_LANE_M * d
    )
    return np.sort(pair.left[row[near], col[near]]).astype(np.float64)


def _turning(across: FloatArray, ahead: FloatArray, along: FloatArray) -> float:
    """Return by how much a line typically turns from one step of `WINDING_STEP_M` to the next. [rad]"""  # noqa: D400
    n = int(along[-1] / WINDING_STEP_M) + 1
    if n < 3:
        return 0.0
    where = np.linspace(0.0, along[-1], n)
    heading = np.arctan2(np.diff(np.interp(where, along, across)), np.diff(np.interp(where, along, ahead)))
    return float(np.quantile(np.abs(np.diff(heading)), 0.75))


def _slope(x: FloatArray, y: FloatArray) -> float:
    """Return the slope of a straight line, robustly: the median over pairs half of the places apart."""
    half = max(len(x) // 2, 1)
    step = x[half:] - x[:-half]
    good = np.abs(step) > 1e-9
    return float(np.median((y[half:] - y[:-half])[good] / step[good])) if good.any() else 0.0


def height_sigma(rig: RectifiedRig, lines: StripeLines, at: IntArray) -> FloatArray:
    """Return the standard deviation of the height of single stripes above the road's plane. [m]"""  # noqa: D400
    per_px = rig.base_m / lines.road_disparity[at]
    below = np.maximum(lines.table[at, ROW] - rig.cy, 1.0) * per_px
    return np.asarray(below * lines.sigma_disparity[at] / lines.road_disparity[at])


def _places(line: _Line, lines: StripeLines, pair: RectifiedPair, number: int) -> Sightings:
    """Return the places of a line: local straight lines through the stripes of both images."""
    rig, at = pair.rig, line.at
    t = lines.table[at]
    s = line.along_m
    n = max(math.ceil(s[-1] / SIGHTING_SPACING_M), 1) + 1
    where = np.linspace(0.0, s[-1], n)
    # Windows in rows: a straight line in space is one in the image
    v = -t[:, ROW]
    row = np.interp(where, s, t[:, ROW])
    step = np.abs(np.interp(where + 0.5, s, t[:, ROW]) - np.interp(where - 0.5, s, t[:, ROW]))
    rows_per_m = np.maximum(step, 0.5)
    sigma = np.maximum(t[:, STRIPE_SIGMA], LEAST_STRIPE_SIGMA_PX)
    col, sigma_col = fit_at(v, t[:, COL], sigma, -row, np.maximum(STRAIGHT_PIECE_M * rows_per_m, 2.5))
    rest, sigma_d = fit_at(
        v, lines.disparity[at] - lines.road_disparity[at], np.nan_to_num(lines.sigma_disparity[at], nan=1.0),
        -row, np.maximum(SMOOTH_DISTANCE_M * rows_per_m, 4.5),
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
