"""Bright stripes in the rows of both images of a pair, linked into lines and matched from left to right.

Beyond the bright lines of the paper (He and Novak 1992, 3.1): a stripe is compared with the road beside it, not with
the whole row; the width of paint follows from the plane of the road; the middle is half-way between two edges at half
contrast (T. Veit et al. 2008, doi:10.1109/ITSC.2008.4732564, compare such detectors and find local thresholds best).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from linework.arrays import AnyArray, FloatArray, IntArray
from linework.kernels.images.link_stripes import link, partners
from linework.kernels.images.row_stripes import (
    COL,
    ROW,
    STRIPE_CONTRAST,
    STRIPE_SIGMA,
    WIDTH,
    stripes_of_rows,
)
from linework.methods.stereo.fitted import LEAST_STRIPE_SIGMA_PX
from linework.methods.stereo.road_plane import RoadPlane, RoadShape
from linework.model.camera import RectifiedRig
from linework.model.images import RectifiedPair
from linework.model.settings import Settings, setting

#: Largest angle between a line and the direction of view: rows do not cut a more oblique one. [rad]
STEEPEST_RAD = math.radians(65.0)
#: Longest gap in a line where paint is worn or covered; dashes are farther apart. [m, rows]
GAP = (0.6, 2)
#: Largest distance of paint from the plane of the road: noise of the plane, and the radius of crests and sags. [m]
OFF_PLANE_M, CREST_M = 0.15, 750.0
#: Half width of the smallest gate of disparities. [pixels]
LEAST_GATE_PX = 1.0
#: Smallest disparity that a distance is computed from, against division by zero at the horizon. [pixels]
LEAST_DISPARITY_PX = 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class StripeConfig(Settings):
    """Settings of the detection of stripes of paint."""

    least_width_m: float = setting(
        0.07, unit="m", reason="the narrowest lane lines are 0.10 m, worn at their edges", low=0.02, high=1
    )
    largest_width_m: float = setting(
        0.60, unit="m", reason="the widest lines, of motorways and bus lanes, are 0.50 m", low=0.05, high=2
    )
    least_contrast_sigmas: float = setting(
        4.0, unit="", reason="of the noise of a row: less occurs by chance in every row", low=1, high=20
    )
    least_contrast: float = setting(
        0.06, unit="", reason="of the road beside it: repairs and stains differ by as much", low=0, high=2
    )
    farthest_m: float = setting(
        35.0,
        unit="m",
        reason="a row covers a metre of road there; nearer pairs show it better",
        low=5,
        high=200,
    )


@dataclass(frozen=True, slots=True)
class Stripes:
    """Stripes of one image in order of rows, the lowest first.

    Parameters
    ----------
    table
        (n, 6): columns of `linework.kernels.images.row_stripes`.
    first
        (n_rows + 1,) int64: first stripe of each row.
    disparity
        (n,) disparity of the road at each stripe. [pixels]
    """

    table: FloatArray
    first: IntArray
    disparity: FloatArray


@dataclass(frozen=True, slots=True)
class StripeLines:
    """Stripes of the left image with their lines and their partners in the right image.

    Parameters
    ----------
    table
        (n, 6) stripes of the left image: columns of `linework.kernels.images.row_stripes`.
    line
        (n,) int64: number of the line, -1 for none.
    disparity, sigma_disparity
        (n,) disparity and its standard deviation; NaN without a partner. [pixels]
    widening
        (n,) width in the left image, as the right one should show it, less the width there. [pixels]
    road_disparity
        (n,) disparity of the road's surface. [pixels]
    """

    table: FloatArray
    line: IntArray
    disparity: FloatArray
    sigma_disparity: FloatArray
    widening: FloatArray
    road_disparity: FloatArray


def find_stripe_lines(pair: RectifiedPair, road: RoadShape, config: StripeConfig) -> StripeLines:
    """Return the lines of stripes in the left image of a pair, matched with the stripes of the right one."""
    rig, plane = pair.rig, road.plane
    left = find_stripes(pair.left, rig, plane, config)
    right = find_stripes(pair.right, rig, plane.in_right(), config)
    n_rows = len(left.first) - 1
    # Link on the plane of the road, where lines are straight or bend gently whatever the perspective
    per_px = rig.base_m / left.disparity
    depth = rig.focal_px * per_px
    sigma = np.maximum(left.table[:, STRIPE_SIGMA], LEAST_STRIPE_SIGMA_PX)
    across = (left.table[:, COL] - rig.cx) * per_px
    places = np.column_stack([across, depth, left.table[:, WIDTH] * per_px, sigma * per_px])
    line = link(places, left.first, n_rows, math.tan(STEEPEST_RAD), GAP)
    # Match with the stripes in the same row of the right image, near the disparity of the road
    gate = _gates(left, rig, plane)
    expected = road.disparity(rig, left.table[:, COL], left.table[:, ROW])
    match = partners(
        np.column_stack([left.table[:, (COL, WIDTH, STRIPE_CONTRAST)], expected]), left.first,
        np.column_stack([right.table[:, (COL, WIDTH, STRIPE_CONTRAST)], right.disparity]), right.first,
        n_rows, gate,
    )  # fmt: skip
    found = match >= 0
    disparity, sigma_d, widening = (np.full(len(line), np.nan) for _ in range(3))
    disparity[found] = left.table[found, COL] - right.table[match[found], COL]
    own = np.maximum(right.table[match[found], STRIPE_SIGMA], LEAST_STRIPE_SIGMA_PX)
    sigma_d[found] = np.hypot(sigma[found], own)
    widening[found] = left.table[found, WIDTH] * (1.0 - plane.du) - right.table[match[found], WIDTH]
    return StripeLines(left.table, line, disparity, sigma_d, widening, expected)


def find_stripes(image: AnyArray, rig: RectifiedRig, plane: RoadPlane, config: StripeConfig) -> Stripes:
    """Return the stripes of an image (height, width) uint8 that are as wide as paint on the plane of the road."""
    at_zero = np.array([plane.d0 - plane.du * rig.cx - plane.dv * rig.cy, plane.du, plane.dv])
    nearest = rig.focal_px * rig.base_m / config.farthest_m
    top = int(np.ceil(rig.cy + (nearest - plane.d0) / plane.dv))
    rows = (rig.height - 1, min(max(top, 0), rig.height - 1) - 1)
    widths = config.least_width_m, config.largest_width_m / math.cos(STEEPEST_RAD)
    gates = config.least_contrast_sigmas, config.least_contrast
    table, first = stripes_of_rows(image, at_zero, 1.0 / rig.base_m, rows, widths, gates)
    first = first[: rows[0] - rows[1] + 1]
    return Stripes(table, first, plane.disparity(rig, table[:, COL], table[:, ROW]))


def _gates(stripes: Stripes, rig: RectifiedRig, plane: RoadPlane) -> FloatArray:
    """Return (n_rows,) the largest difference between the disparities of paint and the road. [pixels]"""  # noqa: D400
    n_rows = len(stripes.first) - 1
    row = rig.height - 1.0 - np.arange(n_rows, dtype=np.float64)
    d = plane.disparity(rig, np.full(n_rows, rig.cx), row)
    d = np.maximum(d, LEAST_DISPARITY_PX)
    off_m = OFF_PLANE_M + (rig.focal_px * rig.base_m / d) ** 2 / (2.0 * CREST_M)
    return np.asarray(np.maximum(d * off_m / plane.camera_height_m(rig), LEAST_GATE_PX))
