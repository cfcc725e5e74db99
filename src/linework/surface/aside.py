"""Smooth ground beside the roads that was not taken for road: what was not looked at for markings and boundaries."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from scipy.ndimage import label

from linework.arrays import AnyArray, BoolArray, FloatArray
from linework.kernels.cells.nearest import nearest_known_squared
from linework.surface.regions import MIN_ROAD_M2

#: Beside a road: a lane, a verge and a footway. [m]
BESIDE_M = 15.0
#: Half of the narrowest lane, 2.75 m (German guideline RAS-Q 96, section 2): what is narrower is a footway or a kerb. [m]
_HALF_LANE_M = 1.375
#: Share of the points beside a road from which it is said that they were not looked at.
_SAID_SHARE = 0.1


class RoadAside(NamedTuple):
    """Totals of road, and of smooth ground within 15 m of it that is as wide as a lane and not road.

    Parameters
    ----------
    road_m2, aside_m2
        Areas of the measured cells. [m2]
    near_points, aside_points
        Points on all cells within 15 m of a road, the road itself among them, and on the ground that is not road.
    aside_m
        Length of that ground: its area over its mean width. [m]
    """

    road_m2: float = 0.0
    aside_m2: float = 0.0
    near_points: int = 0
    aside_points: int = 0
    aside_m: float = 0.0

    @classmethod
    def added(cls, parts: Iterable[RoadAside]) -> RoadAside:
        """Return the totals of several windows, in their order.

        >>> RoadAside.added([RoadAside(1.0, 2.0, 3, 4, 5.0), RoadAside(1.0, 0.0, 1, 0, 0.5)])
        RoadAside(road_m2=2.0, aside_m2=2.0, near_points=4, aside_points=4, aside_m=5.5)
        """
        listed = [cls(), *parts]
        road_m2, aside_m2, near_points, aside_points, aside_m = (
            sum(column) for column in zip(*listed, strict=True)
        )
        return cls(float(road_m2), float(aside_m2), int(near_points), int(aside_points), float(aside_m))

    @property
    def warning(self) -> str:
        """One line if more than 10 % of the points beside the roads were not looked at; else empty."""
        share = self.aside_points / max(self.near_points, 1)
        if share <= _SAID_SHARE:
            return ""
        return (
            f"{100.0 * share:.0f} % of the points within {BESIDE_M:.0f} m of a road lie on smooth ground that was not taken"
            f" for road ({self.aside_m2:,.0f} m2, {self.aside_m:,.0f} m): no markings and boundaries are looked for there"
        )


def smooth_aside(
    is_road: BoolArray, is_smooth: BoolArray, count: AnyArray, inner: tuple[slice, slice], cell_m: float
) -> RoadAside:
    """Return what is road and what is not in the inner part of a window.

    Parameters
    ----------
    is_road, is_smooth, count
        (rows, cols) of the window with at least 15 m around its inner part: road, smooth cells, points in each cell.
    inner
        The part that is counted.
    cell_m
        Side of a cell. [m]
    """
    if not is_road.any():
        return RoadAside()
    # Around the cells that say anything: a road crosses its tile, and most of it is empty
    box = _box_of(is_road | is_smooth | (count > 0))
    inner = _shared(inner[0], box[0], len(is_road)), _shared(inner[1], box[1], is_road.shape[1])
    is_road, is_smooth, count = np.ascontiguousarray(is_road[box]), is_smooth[box], count[box]
    reach = math.floor(BESIDE_M / cell_m)
    beside = nearest_known_squared(is_road, reach, 0)[1] <= reach * reach
    points = count[inner]
    found = RoadAside(
        road_m2=float((is_road[inner] & (points > 0)).sum()) * cell_m**2,
        near_points=int(points[beside[inner]].sum()),
    )
    other = is_smooth & ~is_road
    if not (other & beside)[inner].any():
        return found
    # From the middle of a cell to that of the nearest one outside; fields are as deep as a road reaches
    square = nearest_known_squared(np.pad(~other, 1, constant_values=True), reach, 1)[1]
    number, n = label(other)
    cells = np.bincount(number[other], minlength=n + 1)
    deepest = np.zeros(n + 1, dtype=square.dtype)
    np.maximum.at(deepest, number[other], square[other])
    is_wide = (_depth_m(deepest, cell_m) >= _HALF_LANE_M) & (cells * cell_m**2 >= MIN_ROAD_M2)
    own = (is_wide[number] & beside)[inner]
    if not own.any():
        return found
    area = float(own.sum()) * cell_m**2
    # Of a strip, the mean depth is a quarter of the width
    length = area / (4.0 * float(_depth_m(square[inner][own], cell_m).mean()))
    return found._replace(aside_m2=area, aside_points=int(points[own].sum()), aside_m=length)


def _depth_m(square: AnyArray, cell_m: float) -> FloatArray:
    """Return how far cells lie from the edge of what they belong to, by their squared distance in cells."""
    return np.asarray((np.sqrt(square) - 0.5) * cell_m)


def _box_of(wanted: BoolArray) -> tuple[slice, slice]:
    """Return the rows and columns that hold all wanted cells, of which there is at least one."""
    rows, cols = (np.flatnonzero(wanted.any(axis=axis)) for axis in (1, 0))
    return slice(int(rows[0]), int(rows[-1]) + 1), slice(int(cols[0]), int(cols[-1]) + 1)


def _shared(one: slice, box: slice, n: int) -> slice:
    """Return the part of a slice of `n` rows or columns within a box, counted from the box."""
    start, stop, _ = one.indices(n)
    first = max(start - box.start, 0)
    return slice(first, max(min(stop, box.stop) - box.start, first))
