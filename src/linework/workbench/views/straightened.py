"""Requests to the pictures worker: the points along a line or the road, by chainage and offset.

Separate from `points`, which shows places as they lie: here the line is unrolled.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from linework.arrays import FloatArray, distance_along
from linework.errors import UsageError
from linework.model.grid import Bounds
from linework.workbench.server.pictures import FARTHEST_OFFSET_M
from linework.workbench.views.patches import PatchReader
from linework.workbench.views.points import (
    MOST_SECTION_POINTS,
    SampledPoints,
    lies_inside,
    packed_points,
    sample_points,
    within_share,
)
from linework.workbench.views.tiles import patch_reader
from linework.workbench.worker.session import SurveySession

#: How far an axis goes on straight beyond its ends: what lies there shows whether a line should. [m]
BEYOND_M = 20.0
#: Longest stretch. [m]
LONGEST_STRETCH_M = 400.0
#: Length of axis whose points are read together: the rectangle around a longer one holds many others. [m]
_PIECE_M = 16.0
#: Distance of the places on the axis among which the nearest is looked for. [m]
_STATION_M = 0.5
#: Vertices nearer than this are one place. [m]
_LEAST_STEP_M = 1e-6


@dataclass(frozen=True, slots=True)
class StraightAxis:
    """An axis in plan with chainage and offset, extended straight beyond its ends.

    Parameters
    ----------
    xy
        (n, 2) vertices, one more at each end `BEYOND_M` away. [m, world]
    along_m
        (n,) chainage of the vertices; the line's first vertex is at 0. [m]
    """

    xy: FloatArray
    along_m: FloatArray
    _stations: FloatArray = field(init=False, repr=False, compare=False)
    _tree: Any = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        stations = np.arange(self.along_m[0], self.along_m[-1] + _STATION_M, _STATION_M)
        object.__setattr__(self, "_stations", stations)
        object.__setattr__(self, "_tree", cKDTree(self.places(stations) - self.xy[0]))

    @classmethod
    def of(cls, path: FloatArray) -> StraightAxis:
        """Return the axis along a line or path (n, 2 or 3). [m, world]

        Raises
        ------
        UsageError
            It has no length in plan.
        """  # noqa: D400
        xy = np.asarray(path, dtype=np.float64)[:, :2]
        if len(xy):
            apart = np.r_[True, np.hypot(*np.diff(xy, axis=0).T) > _LEAST_STEP_M]
            xy = xy[apart]
        if len(xy) < 2:
            raise UsageError("a line without length cannot be unrolled", advice="choose another line")
        first, last = (step / np.hypot(*step) for step in (xy[0] - xy[1], xy[-1] - xy[-2]))
        longer = np.vstack([xy[0] + BEYOND_M * first, xy, xy[-1] + BEYOND_M * last])
        return cls(longer, distance_along(longer) - BEYOND_M)

    def places(self, chainage_m: FloatArray) -> FloatArray:
        """Return the places (k, 2) of the axis at chainages (k,). [m, world]"""  # noqa: D400
        return np.stack([np.interp(chainage_m, self.along_m, column) for column in self.xy.T], axis=1)

    def on_axis(self, xy: FloatArray, within_m: float) -> tuple[FloatArray, FloatArray]:
        """Return chainage and offset to the right (n,) of places (n, 2) [m]; NaN farther from it than `within_m`.

        The foot of a place is the nearest on the segments beside its nearest station.
        """
        chainage, offset = np.full(len(xy), np.nan), np.full(len(xy), np.nan)
        if len(xy) == 0:
            return chainage, offset
        _, nearest = self._tree.query(xy - self.xy[0], distance_upper_bound=within_m + _STATION_M)
        near = np.flatnonzero(nearest < len(self._stations))
        segment = np.searchsorted(self.along_m, self._stations[nearest[near]], side="right") - 1
        least = np.full(len(near), np.inf)
        for beside in (-1, 0, 1):
            k = np.clip(segment + beside, 0, len(self.xy) - 2)
            start, length = self.xy[k], self.along_m[k + 1] - self.along_m[k]
            way = (self.xy[k + 1] - start) / length[:, None]
            step = xy[near] - start
            foot = np.clip((step * way).sum(axis=1), 0.0, length)
            apart = np.hypot(*(step - foot[:, None] * way).T)
            side = np.sign(step[:, 0] * way[:, 1] - step[:, 1] * way[:, 0])
            closer = apart < least
            least = np.where(closer, apart, least)
            chainage[near] = np.where(closer, self.along_m[k] + foot, chainage[near])
            offset[near] = np.where(closer, side * apart, offset[near])
        far = ~(np.abs(offset) <= within_m)
        chainage[far], offset[far] = np.nan, np.nan
        return chainage, offset


def straightened_points(
    session: SurveySession, path: FloatArray, from_m: float, to_m: float, half_width_m: float
) -> bytes:
    """Return the points along a stretch of a line in the page's format: x the chainage, y the offset to the right, z up.

    Parameters
    ----------
    path
        (n, 2 or 3) vertices of the line or the van's path. [m, world]
    from_m, to_m
        The stretch; it may begin and end `BEYOND_M` beyond the line. [m]

    Raises
    ------
    UsageError
        The stretch is empty or too long, or the line has no length.
    """
    if not 0.0 < to_m - from_m <= LONGEST_STRETCH_M or not 0.0 < half_width_m <= FARTHEST_OFFSET_M:
        raise UsageError(
            f"a stretch from {from_m:g} to {to_m:g} m, {half_width_m:g} m to each side",
            advice=f"up to {LONGEST_STRETCH_M:g} m, and {FARTHEST_OFFSET_M:g} m to each side can be shown",
        )
    axis, reader = StraightAxis.of(path), patch_reader(session)
    origin = (from_m, 0.0, reader.z0_m if reader else 0.0)
    found: list[SampledPoints] = []
    if reader is not None:
        found = points_along(reader, axis, (from_m, to_m), half_width_m, MOST_SECTION_POINTS)
    return packed_points(origin, found, session, MOST_SECTION_POINTS)


def points_along(
    reader: PatchReader, axis: StraightAxis, stretch: tuple[float, float], half_width_m: float, most: int
) -> list[SampledPoints]:
    """Return the points along a stretch of an axis, a random share of them where they are more than four times `most`.

    Their x is the chainage from the start of the stretch, y the offset to the right, z as in the patches. [m]
    """
    found: list[SampledPoints] = []
    share = 1.0
    for start, end, bounds in _pieces(axis, stretch, half_width_m):
        # Relative to a corner nearby, so that float32 holds millimetres
        origin = (math.floor(bounds.west), math.floor(bounds.south), reader.z0_m)
        for patch in reader.patches(bounds):
            part = sample_points(patch, lies_inside(patch, bounds), share, origin)
            xy = part.xyz[:, :2].astype(np.float64) + origin[:2]
            chainage, offset = axis.on_axis(xy, half_width_m)
            kept = (chainage >= start) & (chainage < end)
            placed = np.stack([chainage - stretch[0], offset, part.xyz[:, 2]], axis=1).astype(np.float32)[
                kept
            ]
            part = replace(
                part, xyz=placed, above=part.above[kept], intensity=part.intensity[kept], lots=part.lots[kept]
            )
            found, share = within_share([*found, part], share, most)
    return found


def _pieces(
    axis: StraightAxis, stretch: tuple[float, float], half_width_m: float
) -> Iterator[tuple[float, float, Bounds]]:
    """Yield start, end and surroundings of the pieces of a stretch; none beyond the axis."""
    first, last = max(stretch[0], float(axis.along_m[0])), min(stretch[1], float(axis.along_m[-1]))
    for k in range(math.ceil((last - first) / _PIECE_M)):
        start, end = first + k * _PIECE_M, min(first + (k + 1) * _PIECE_M, last)
        inside = axis.along_m[(axis.along_m > start) & (axis.along_m < end)]
        places = axis.places(np.concatenate([[start], inside, [end]]))
        yield start, end, Bounds(*places.min(axis=0), *places.max(axis=0)).grown(half_width_m)
