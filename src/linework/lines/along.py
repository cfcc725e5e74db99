"""Evenly spaced positions along lines, stretches of lines, and positions beside the driven path."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from linework.arrays import BoolArray, FloatArray, IntArray, distance_along
from linework.model.lines import LINE_COLUMNS, VERTEX_COLUMNS, LineSet

#: Distance of compared positions along a line. [m]
PLACE_STEP_M = 0.25


@dataclass(frozen=True, slots=True)
class LinePlaces:
    """Evenly spaced positions along lines, see `places_along`.

    Parameters
    ----------
    xyz
        (k, 3) positions. [m, world]
    way
        (k, 2) unit directions of the line in plan.
    line
        (k,) int64 index of the line.
    chainage_m, sigma_m
        (k,) distance along the line in plan, and standard deviation in plan. [m]
    """

    xyz: FloatArray
    way: FloatArray
    line: IntArray
    chainage_m: FloatArray
    sigma_m: FloatArray


def places_along(lines: LineSet) -> LinePlaces:
    """Return positions every `PLACE_STEP_M` along each line, its ends included; at least one line."""
    found = []
    for i in range(len(lines)):
        xyz, sigma = lines[i].xyz, lines.sigma_xy_m[lines.offsets[i] : lines.offsets[i + 1]]
        along = distance_along(xyz[:, :2], in_space=True)
        n = max(int(np.ceil(along[-1] / PLACE_STEP_M)), 1) + 1
        at = np.linspace(0.0, along[-1], n)
        place = np.stack([np.interp(at, along, column) for column in xyz.T], axis=1)
        way = np.gradient(place[:, :2], axis=0)
        way /= np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-12)
        found.append((place, way, np.full(n, i), at, np.interp(at, along, sigma)))
    xyz, way, line, at, sigma = (np.concatenate(column) for column in zip(*found, strict=True))
    return LinePlaces(xyz, way, line.astype(np.int64), at, sigma)


def runs_of(mask: BoolArray) -> list[tuple[int, int]]:
    """Return the first and last index of each run of True in a mask (n,).

    >>> runs_of(np.array([True, False, True, True]))
    [(0, 0), (2, 3)]
    """
    edges = np.flatnonzero(np.diff(np.concatenate([[0], mask.astype(np.int8), [0]])))
    return [(int(a), int(b) - 1) for a, b in edges.reshape(-1, 2)]


def line_stretch(line: LineSet, start_m: float, end_m: float) -> LineSet:
    """Return a single line cut from one chainage to another [m]: its vertices between, and new ones at both ends."""
    along = distance_along(line.xyz[:, :2], in_space=True)
    inside = np.flatnonzero((along > start_m + 1e-6) & (along < end_m - 1e-6))
    at = np.concatenate([[start_m], along[inside], [end_m]])
    xyz = np.stack([np.interp(at, along, column) for column in line.xyz.T], axis=1)
    nearest = np.clip(np.searchsorted(along, at), 0, len(along) - 1)
    columns = {name: getattr(line, name)[nearest] for name in VERTEX_COLUMNS}
    columns |= {name: getattr(line, name) for name in LINE_COLUMNS}
    return LineSet.from_lines([xyz], crs=line.crs, **columns)


# The driven path, and positions beside it

#: Distance of positions along the path. [m]
PATH_STEP_M = 1.0
#: A path that returns within this distance of itself is on the same road. [m]
SAME_ROAD_M = 12.0
#: Length driven before a path can return. [m]
_AWAY_M = 60.0
#: Distance ahead and behind over which the direction of the path is taken. [m]
_SMOOTH_M = 3.0


@dataclass(frozen=True, slots=True)
class DrivenPath:
    """The driven path without repeated passes: every road once.

    Parameters
    ----------
    xy
        (k, 2) positions every `PLACE_STEP_M`. [m, world]
    left
        (k, 2) unit vectors to the left.
    is_start
        (k,) bool: does not continue the position before.
    tree
        k-d tree of the positions, relative to the first.
    """

    xy: FloatArray
    left: FloatArray
    is_start: BoolArray
    tree: Any = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "tree", _tree_of(self.xy) if len(self.xy) else None)

    @classmethod
    def of(cls, path: FloatArray) -> DrivenPath:
        """Return the path along positions (n, 2 or 3) [m, world], without later passes over the same road."""
        xy = path[:, :2]
        along = distance_along(xy)
        if len(xy) < 2 or along[-1] < PATH_STEP_M:
            return cls(np.zeros((0, 2)), np.zeros((0, 2)), np.zeros(0, dtype=np.bool_))
        at = np.arange(0.0, along[-1], PATH_STEP_M)
        places = np.stack([np.interp(at, along, column) for column in xy.T], axis=1)
        n = max(int(_SMOOTH_M / PATH_STEP_M), 1)
        ahead = np.minimum(np.arange(len(at)) + n, len(at) - 1)
        behind = np.maximum(np.arange(len(at)) - n, 0)
        way = places[ahead] - places[behind]
        way /= np.maximum(np.hypot(*way.T), 1e-9)[:, None]
        first = _first_time(places, way)
        is_start = np.concatenate([[True], np.diff(np.flatnonzero(first)) > 1])
        left = np.stack([-way[:, 1], way[:, 0]], axis=1)
        return cls(places[first], left[first], is_start)

    def __len__(self) -> int:
        return len(self.xy)

    @property
    def pieces(self) -> list[tuple[int, int]]:
        """First and last index of each continuous stretch."""
        first = np.flatnonzero(self.is_start).tolist()
        return list(zip(first, [*(k - 1 for k in first[1:]), len(self) - 1], strict=True))

    def offsets(self, xy: FloatArray, within_m: float) -> tuple[FloatArray, FloatArray]:
        """Return the positions of points (n, 2) along the path [steps] and to its left [m], (n,); NaN beyond `within_m`."""
        along, left = np.full(len(xy), np.nan), np.full(len(xy), np.nan)
        if len(self) == 0 or len(xy) == 0:
            return along, left
        origin = self.xy[0]
        distance, nearest = self.tree.query(xy - origin, distance_upper_bound=within_m)
        near = np.isfinite(distance)
        k = nearest[near]
        step = xy[near] - self.xy[k]
        forward = np.stack([self.left[k, 1], -self.left[k, 0]], axis=1)
        along[near] = k + np.clip(np.sum(step * forward, axis=1) / PATH_STEP_M, -0.5, 0.5)
        left[near] = np.sum(step * self.left[k], axis=1)
        return along, left

    def places(self, along: FloatArray, left_m: FloatArray) -> FloatArray:
        """Return the points (n, 2) at positions along the path (n,) [steps] and distances to its left (n,) [m]."""
        k = np.clip(np.rint(along).astype(np.int64), 0, len(self) - 1)
        return np.asarray(self.xy[k] + left_m[:, None] * self.left[k])


def _tree_of(places: FloatArray) -> Any:
    """Return the k-d tree of places (n, 2), relative to the first."""
    from scipy.spatial import (
        cKDTree,  # takes half a second to import, and who reads or writes lines has no path
    )

    return cKDTree(places - places[0])


def _first_time(places: FloatArray, way: FloatArray) -> BoolArray:
    """Return which positions (n,) are a first pass: no earlier one lies within `SAME_ROAD_M`, or runs back there."""
    tree = _tree_of(places)
    n_away = int(_AWAY_M / PATH_STEP_M)
    first = np.ones(len(places), dtype=np.bool_)
    for i, near in enumerate(tree.query_ball_point(places - places[0], SAME_ROAD_M)):
        before = np.array([k for k in near if k < i and first[k]], dtype=np.int64)
        first[i] = not np.any((before < i - n_away) | (way[before] @ way[i] < -0.5))
    return first


@dataclass(frozen=True, slots=True)
class PaintStretch:
    """What is left of a marking on a stretch of it; values that were hidden are None.

    Parameters
    ----------
    line, from_m, to_m
        Number of the marking, and the ends of the stretch along it. [m]
    values
        By quantity ("remaining_paint" [%], "contrast", "width" [m]): mean and its standard deviation.
    measured_share
        Share of the pieces at which the remaining paint was measured.
    """

    line: int
    from_m: float
    to_m: float
    values: Mapping[str, tuple[float | None, float | None]]
    measured_share: float
