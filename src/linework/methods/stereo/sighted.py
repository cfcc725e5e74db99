"""What a pair has seen of lines on the road: places every half a metre, with their standard deviations."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from linework.kernels.local_lines import fit_at
from linework.methods.stereo.road_plane import RoadPlane
from linework.methods.stereo.stripes import COL, CONTRAST, LEAST_SIGMA_PX, ROW, SIGMA, WIDTH, StripeConfig, StripeLines
from linework.model.arrays import FloatArray, IntArray
from linework.model.camera import RectifiedRig
from linework.model.images import RectifiedPair
from linework.model.sightings import Sightings

#: Places on a line stand about so far apart. [m]
SPACING_M = 0.5
#: Paint in fewer rows, or shorter, shows no line.
LEAST_ROWS, LEAST_LENGTH_M = 4, 0.4
#: Of a line so many of the stripes have a partner in the other image.
LEAST_MATCHED = 0.5
#: A line is straight over so much of it across the image, its distance changes as the road's over so much. [m]
STRAIGHT_M, SMOOTH_M = 0.6, 3.0
#: Both edges of paint are parallel: widths differ by no more than this share (median), blur apart. [1, pixels]
RAGGED, BLUR_PX = 0.25, 0.35
#: Paint is flat on the road: what stands up from its plane more steeply is a post or a wheel.
STEEP = 0.12
#: Paint is on the road's surface within the shape of gutters, ruts and crowns; kerbs stand higher. [m]
ON_ROAD_M = 0.10


@dataclass(frozen=True, slots=True)
class _Line:
    """One line of a pair: its stripes, and what they say together."""

    at: IntArray
    along_m: FloatArray
    height_m: FloatArray
    slope: float
    score: float


def sightings_of(pair: RectifiedPair, plane: RoadPlane, lines: StripeLines, config: StripeConfig) -> Sightings:
    """Return the places on those lines of stripes that are paint on the road."""
    rig = pair.rig
    kept = []
    order = np.argsort(lines.line, kind="stable")
    numbers, first = np.unique(lines.line[order], return_index=True)
    for number, at in zip(numbers.tolist(), np.split(order, first[1:]), strict=True):
        if number >= 0 and len(at) >= LEAST_ROWS:
            line = _judged(lines, at, rig, plane, config)
            if line is not None:
                kept.append(line)
    kept = _on_one_surface(kept, lines, rig)
    parts = [_places(line, lines, pair, i) for i, line in enumerate(kept)]
    return Sightings.concatenate(parts)


def _judged(
    lines: StripeLines, at: IntArray, rig: RectifiedRig, plane: RoadPlane, config: StripeConfig
) -> _Line | None:
    """Return a line of stripes if they are those of paint on the road."""
    matched = np.isfinite(lines.disparity[at])
    if matched.sum() < max(LEAST_ROWS, LEAST_MATCHED * len(at)):
        return None
    t, road = lines.table[at], lines.road_disparity[at]
    per_px = rig.base_m / road
    across, ahead = (t[:, COL] - rig.cx) * per_px, rig.focal_px * per_px
    along = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(across), np.diff(ahead)))])
    if along[-1] < LEAST_LENGTH_M:
        return None
    slope = _slope(ahead, across)
    # Across the line, not across the view
    width_m = t[:, WIDTH] * per_px / math.hypot(1.0, slope)
    width = float(np.median(width_m))
    ragged = float(np.median(np.abs(width_m - width))) - BLUR_PX * float(np.median(per_px))
    if not config.least_width_m <= width <= config.largest_width_m or ragged > RAGGED * width:
        return None
    height = plane.camera_height_m(rig) * (1.0 - road / lines.disparity[at])
    lean = _slope(along[matched], height[matched]) if along[-1] > 1.0 else 0.0
    if abs(lean) > STEEP:
        return None
    score = float(matched.mean()) * (1.0 - max(ragged, 0.0) / (2.0 * RAGGED * width))
    return _Line(at, along, height, slope, score * min(1.0, 0.5 + along[-1] / 4.0))


def _slope(x: FloatArray, y: FloatArray) -> float:
    """Return the slope of a straight line, robustly: the median over pairs half of the places apart."""
    half = max(len(x) // 2, 1)
    step = x[half:] - x[:-half]
    good = np.abs(step) > 1e-9
    return float(np.median((y[half:] - y[:-half])[good] / step[good])) if good.any() else 0.0


def _on_one_surface(kept: list[_Line], lines: StripeLines, rig: RectifiedRig) -> list[_Line]:
    """Return the lines that lie on the surface that most of them lie on: crossfall, grade, one bend of the profile."""
    if not kept:
        return kept
    at = np.concatenate([line.at for line in kept])
    height = np.concatenate([line.height_m for line in kept])
    owner = np.repeat(np.arange(len(kept)), [len(line.at) for line in kept])
    good = np.isfinite(height)
    per_px = rig.base_m / lines.road_disparity[at]
    ahead, across = rig.focal_px * per_px, (lines.table[at, COL] - rig.cx) * per_px
    sigma = height_sigma(rig, lines, at)
    design = np.column_stack([np.ones(len(at)), across, ahead, ahead**2])
    # The plane of the road has been measured, too: without lines it stays
    prior = np.diag([1.0 / 0.05, 1.0 / 0.02, 1.0 / 0.01, 2.0 * 400.0])
    p = np.zeros(4)
    for _ in range(6):
        off = np.abs(height - design @ p) / np.hypot(0.03, sigma)
        weight = np.where(good, np.minimum(1.0, 2.0 / np.maximum(np.nan_to_num(off, nan=1.0), 1e-9)), 0.0)
        weight = np.sqrt(weight / (0.03**2 + np.nan_to_num(sigma, nan=1.0) ** 2) / 10.0)
        a = np.vstack([design * weight[:, None], prior])
        p = np.linalg.lstsq(a, np.concatenate([np.nan_to_num(height) * weight, np.zeros(4)]), rcond=None)[0]
    residual = height - design @ p
    out = []
    for i, line in enumerate(kept):
        own = (owner == i) & good
        allowed = ON_ROAD_M + 2.0 * float(np.median(sigma[own])) / math.sqrt(own.sum())
        if abs(float(np.median(residual[own]))) <= allowed:
            out.append(line)
    return out


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
    n = max(int(math.ceil(s[-1] / SPACING_M)), 1) + 1
    where = np.linspace(0.0, s[-1], n)
    # Windows in rows: a straight line in space is one in the image
    v = -t[:, ROW]
    row = np.interp(where, s, t[:, ROW])
    step = np.abs(np.interp(where + 0.5, s, t[:, ROW]) - np.interp(where - 0.5, s, t[:, ROW]))
    rows_per_m = np.maximum(step, 0.5)
    sigma = np.maximum(t[:, SIGMA], LEAST_SIGMA_PX)
    col, sigma_col = fit_at(v, t[:, COL], sigma, -row, np.maximum(STRAIGHT_M * rows_per_m, 2.5))
    rest, sigma_d = fit_at(
        v, lines.disparity[at] - lines.road_disparity[at], np.nan_to_num(lines.sigma_disparity[at], nan=1.0),
        -row, np.maximum(SMOOTH_M * rows_per_m, 4.5),
    )  # fmt: skip
    road = np.interp(where, s, lines.road_disparity[at])
    disparity = road + rest
    per_px = rig.base_m / disparity
    floor = LEAST_SIGMA_PX
    return Sightings(
        xyz=rig.intersect(col, row, disparity),
        pair=np.full(n, pair.number), line=np.full(n, number),
        col=col, row=row, disparity=disparity,
        sigma_px=np.hypot(sigma_col, floor), sigma_disparity_px=np.hypot(sigma_d, floor),
        width_m=np.full(n, np.median(t[:, WIDTH] * per_px.mean() * 0.0 + t[:, WIDTH] * rig.base_m / lines.road_disparity[at]))
        / math.hypot(1.0, line.slope),
        contrast=np.full(n, np.median(t[:, CONTRAST])), score=np.full(n, line.score),
    )  # fmt: skip
