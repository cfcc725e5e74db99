"""What the points about a line say of it, in figures that lines of a kind can be compared by.

Separate from `evidence`, which shows them about one place: here each line has a row, measured once.
"""

from __future__ import annotations

import numpy as np

from linework.arrays import FloatArray, distance_along
from linework.model.lines import LineSet
from linework.workbench.review.fits import middle_of_points, step_across, stripe_across
from linework.workbench.views.patches import PatchReader
from linework.workbench.views.straightened import StraightAxis, points_along
from linework.workbench.views.tiles import patch_reader
from linework.workbench.worker.session import SurveySession

#: Length about the middle of a line in which the points are looked at, and the distance to each side. [m]
LOOKED_AT_M, LOOKED_ACROSS_M = 20.0, 0.6
#: Points that are looked at for a line, at most: a mean of more is no better for what a fit tells.
_MOST_POINTS = 20_000
#: Half of the height within which points belong to a line. [m]
_NEAR_M = 0.5
#: As in `evidence`: distance within which points belong to what stands or hangs [m]; asphalt, and the brightest paint by it.
_BELONGS_M, _ASPHALT, _BRIGHTEST = 0.20, 1000.0, 6.0
_PAINTED = ("lane_marking", "lane_marking_dash", "road_marking_other")
_STEPS = ("road_boundary", "kerb_top", "edge_other")
#: Names of what the points say.
POINT_MEASURES = (
    "number of points", "height above the road", "contrast of paint", "what the stripe explains", "step", "what the step explains",
    "spread of the points",
)  # fmt: skip


class PointsOfLines:
    """What the points say of lines, measured once for each shape of a line."""

    def __init__(self) -> None:
        self._known: dict[int, tuple[float, ...]] = {}

    def of(self, session: SurveySession, lines: LineSet) -> dict[str, FloatArray]:
        """Return the measures of `POINT_MEASURES` by name, (n,) each; NaN where there are no points.

        A line that is not known takes a hundredth of a second.
        """
        reader = patch_reader(session)
        rows = np.full((len(lines), len(POINT_MEASURES)), np.nan)
        if reader is not None:
            for i in range(len(lines)):
                xyz = lines[i].xyz
                shape = hash((str(lines.kind[i]), xyz.tobytes()))
                if shape not in self._known:
                    self._known[shape] = point_measures(reader, str(lines.kind[i]), xyz)
                rows[i] = self._known[shape]
        return dict(zip(POINT_MEASURES, rows.T, strict=True))


def point_measures(reader: PatchReader, kind: str, xyz: FloatArray) -> tuple[float, ...]:
    """Return what the points about the middle of a line (n, 3) [m, world] say, in the order of `POINT_MEASURES`."""
    plain = kind.removesuffix("_stereo")
    along_m = distance_along(xyz[:, :2])
    length_m = float(along_m[-1])
    if length_m <= 0.0:
        return (np.nan,) * len(POINT_MEASURES)
    middle = 0.5 * length_m
    stretch = max(middle - 0.5 * LOOKED_AT_M, 0.0), min(middle + 0.5 * LOOKED_AT_M, length_m)
    parts = points_along(reader, StraightAxis.of(xyz), stretch, LOOKED_ACROSS_M, _MOST_POINTS)
    points = np.concatenate([np.zeros((0, 3)), *(part.xyz.astype(np.float64) for part in parts)])
    above = np.concatenate([np.zeros(0), *(part.above.astype(np.float64) for part in parts)])
    bright = np.concatenate([np.zeros(0), *(part.intensity.astype(np.float64) for part in parts)])
    rise = points[:, 2] + reader.z0_m - np.interp(points[:, 0] + stretch[0], along_m, xyz[:, 2])
    near = np.isfinite(rise) & (np.abs(rise) <= _NEAR_M)
    offset = points[near, 1]
    road_m = above[near] - rise[near]
    contrast = explains = step = step_explains = spread = np.nan
    if plain in _PAINTED:
        fit = stripe_across(offset, np.minimum(bright[near] / _ASPHALT, _BRIGHTEST))
        contrast, explains = (0.0, 0.0) if fit is None else (fit.size, fit.explained)
    elif plain in _STEPS:
        found = step_across(offset, rise[near])
        step, step_explains = (0.0, 0.0) if found is None else (abs(found.size), found.explained)
    else:
        own, off_m, up_m = middle_of_points(offset, rise[near], _BELONGS_M)
        if own.any():
            spread = float(np.sqrt(np.mean((offset[own] - off_m) ** 2 + (rise[near][own] - up_m) ** 2)))
    height_m = float(np.median(road_m[np.isfinite(road_m)])) if np.isfinite(road_m).any() else np.nan
    per_m = float(near.sum()) / (stretch[1] - stretch[0])
    return per_m, height_m, contrast, explains, step, step_explains, spread
