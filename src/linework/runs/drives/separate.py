"""Which drives a trajectory consists of: a drive passes a road once."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from linework.arrays import AnyArray, BoolArray, FloatArray, IntArray, distance_along
from linework.files.las.tally import TimeCounts
from linework.lines.along import runs_of
from linework.model.trajectory import Trajectory

#: A trajectory without poses for longer has paused: logs have 1 to 200 poses a second. [s]
_PAUSE_S = 10.0
#: Interval of the poses that are looked at; a van at rest that wobbles by a centimetre goes nowhere then. [s]
_STEP_S = 0.5
#: Distance of positions along the path. [m]
_PLACE_M = 1.0
#: A path that comes this near to itself, along itself, for at least such a length is on a road where it has been. [m]
SHARED_ROAD_M, LEAST_SHARED_M = 12.0, 30.0
#: Length driven before a path can return. [m]
_LEFT_M = 60.0
#: Cosine of the greatest angle between two passes over one road, in either direction.
_PARALLEL = 0.9
#: A drive passes what is this near to its path: profile scanners reach 20 to 50 m, with lines of 10 to 20 m. [m]
PASSED_M = 25.0
#: Points around a place that its lines may depend on: what rails need, which need most. [m]
_AROUND_M = 64.0
#: Side of the cells that points are told apart by. [m]
_CELL_M = 4.0
#: Points this near to a place may matter for lines that are passed there. [m]
MATTERS_M = PASSED_M + _AROUND_M + _CELL_M


@dataclass(frozen=True, slots=True)
class DriveSpan:
    """One drive: a part of a trajectory, from one time to another.

    Parameters
    ----------
    start_s, end_s
        Half open: the drives of a trajectory together hold all times. [s]
    time_s
        (n,) times of some of its poses. [s]
    xy
        (n, 2) their positions. [m, world]
    resumes
        (k,) numbers of the poses before which others were left out (`with_points`): between them is no road of it.
    """

    start_s: float
    end_s: float
    time_s: FloatArray
    xy: FloatArray
    resumes: IntArray = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    tree: Any = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "tree", cKDTree(self.xy - self.xy[0]))

    def holds(self, time_s: FloatArray) -> BoolArray:
        """Return which times (n,) are of this drive."""
        return np.asarray((time_s >= self.start_s) & (time_s < self.end_s))

    def passing_s(self, xy: FloatArray, within_m: float = PASSED_M) -> FloatArray:
        """Return when it passes places (n, 2) [m, world], (n,) [s]; NaN for those farther than `within_m`."""
        away, k = self.tree.query(xy - self.xy[0])
        return np.where(away <= within_m, self.time_s[k], np.nan)

    def stretches(self) -> Iterator[tuple[FloatArray, FloatArray]]:
        """Yield times (n,) [s] and places (n, 2) [m, world] every metre, of each stretch that it measured by itself."""
        for first, last in pairwise([0, *self.resumes.tolist(), len(self.xy)]):
            yield _spaced(self.time_s[first:last], self.xy[first:last])

    def is_near(self, xy: FloatArray) -> BoolArray:
        """Return which places (n, 2) may matter for lines that it passes: those within what lines depend on."""
        return _within(self.tree, xy - self.xy[0], MATTERS_M)


def separate_drives(path: Trajectory) -> tuple[DriveSpan, ...]:
    """Return the drives of a trajectory: it is cut where it pauses, and where it returns to a road.

    Examples
    --------
    >>> there = np.arange(0.0, 200.0, 5.0)
    >>> xyz = np.column_stack([np.concatenate([there, there]), np.repeat([0.0, 3.0], 40), np.zeros(80)])
    >>> time = np.concatenate([np.arange(40.0), 100.0 + np.arange(40.0)])
    >>> [(drive.start_s, drive.end_s) for drive in separate_drives(Trajectory(time, xyz))]
    [(-inf, 69.5), (69.5, inf)]
    """
    picked = _picked(path.time_s)
    time, xy = path.time_s[picked], path.xyz[picked, :2]
    if len(time) < 2:
        return ()
    breaks = np.flatnonzero(np.diff(time) > _PAUSE_S)
    cuts = [float(0.5 * (time[i] + time[i + 1])) for i in breaks.tolist()]
    for first, last in pairwise([0, *(breaks + 1).tolist(), len(time)]):
        cuts += _returns(time[first:last], xy[first:last])
    edges = [-np.inf, *sorted(cuts), np.inf]
    spans = []
    for start, end in pairwise(edges):
        own = (time >= start) & (time < end)
        if own.any():
            spans.append(DriveSpan(start, end, time[own], xy[own]))
    return tuple(spans)


def with_points(drives: Sequence[DriveSpan], times: TimeCounts) -> tuple[DriveSpan, ...]:
    """Return drives with those of their poses only at which points were measured; drives without any are left out.

    A trajectory is often that of a whole day, and the points those of a part of it: where a drive has measured nothing,
    it ties nothing.

    Examples
    --------
    >>> there = np.arange(0.0, 200.0, 5.0)
    >>> path = Trajectory(np.arange(40.0), np.column_stack([there, np.zeros((40, 2))]))
    >>> times = TimeCounts()
    >>> times.add(np.arange(10.0, 20.0))
    >>> with_points(separate_drives(path), times)[0].xy[[0, -1], 0].tolist()
    [50.0, 95.0]
    """
    measured = [times.measured_at(drive.time_s) for drive in drives]
    return tuple(
        replace(
            drive,
            time_s=drive.time_s[own],
            xy=drive.xy[own],
            resumes=np.flatnonzero(np.diff(np.flatnonzero(own)) > 1) + 1,
        )
        for drive, own in zip(drives, measured, strict=True)
        if own.any()
    )


def share_road(drives: tuple[DriveSpan, ...]) -> bool:
    """Return whether two of the drives are on one road for `LEAST_SHARED_M`, one direction or the other."""
    if len(drives) < 2:
        return False
    places, owners = [], []
    for i, drive in enumerate(drives):
        for _, place in drive.stretches():
            places.append(place)
            owners.append(np.full(len(place), i))
    place, owner = np.concatenate(places), np.concatenate(owners)
    ahead = np.concatenate([_ahead(p) for p in places])
    beside = _beside(place, ahead, lambda i, near: owner[near] != owner[i])
    return any(
        last - first >= LEAST_SHARED_M / _PLACE_M
        for i in range(len(drives))
        for first, last in runs_of(beside[owner == i])
    )


def may_tie(
    drive: DriveSpan, drives: Sequence[DriveSpan], xy: FloatArray, untied_xy: FloatArray | None = None
) -> BoolArray:
    """Return which places (n, 2) of some block may matter for lines that a drive has in common with others, (n,).

    Along a road that no other drive passes there is nothing to tie: a survey with one road driven twice is looked at
    twice along that road only.

    Parameters
    ----------
    untied_xy
        (k, 2) places [m, world]: only what may matter for lines around them counts; None: everything does.
    """
    if not len(xy):
        return np.zeros(0, dtype=np.bool_)
    cell = np.floor(xy / _CELL_M).astype(np.int64)
    first = cell.min(axis=0)
    n = cell.max(axis=0) - first + 1
    grid = np.stack(np.meshgrid(np.arange(n[0]), np.arange(n[1]), indexing="ij"), axis=-1).reshape(-1, 2)
    place = (grid + first + 0.5) * _CELL_M
    chosen = drive.is_near(place)
    if untied_xy is not None:
        chosen &= _within(cKDTree(untied_xy - drive.xy[0]), place - drive.xy[0], MATTERS_M)
    others = [other.is_near(place[chosen]) for other in drives if other is not drive]
    chosen[chosen] = np.any(others, axis=0) if others else False
    return np.asarray(chosen[(cell[:, 0] - first[0]) * n[1] + cell[:, 1] - first[1]])


def _within(tree: Any, xy: FloatArray, within_m: float) -> BoolArray:
    """Return which places (n, 2) have one of a tree that near, (n,)."""
    return np.asarray(np.isfinite(tree.query(xy, distance_upper_bound=within_m)[0]))


def _picked(time_s: FloatArray) -> IntArray:
    """Return poses about `_STEP_S` apart, by their times alone."""
    _, first = np.unique(np.floor(time_s / _STEP_S), return_index=True)
    return np.asarray(np.union1d(first, [0, len(time_s) - 1] if len(time_s) else []), dtype=np.int64)


def _spaced(time_s: FloatArray, xy: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return times and positions every `_PLACE_M` along a path."""
    along = distance_along(xy)
    at = np.arange(0.0, along[-1] + 1e-9, _PLACE_M)
    # A van at rest stays at one distance: the first pose there counts
    moving = np.concatenate([[True], np.diff(along) > 0.0])
    along, time_s, xy = along[moving], time_s[moving], xy[moving]
    place = np.stack([np.interp(at, along, column) for column in xy.T], axis=1)
    return np.interp(at, along, time_s), place


def _ahead(place: FloatArray) -> FloatArray:
    """Return unit directions (n, 2) over 3 m to both sides."""
    n = np.arange(len(place))
    step = place[np.minimum(n + 3, len(place) - 1)] - place[np.maximum(n - 3, 0)]
    return np.asarray(step / np.maximum(np.linalg.norm(step, axis=1, keepdims=True), 1e-9))


def _beside(place: FloatArray, ahead: FloatArray, is_other: Any) -> BoolArray:
    """Return which positions have another one in reach that runs along them; `is_other(i, near)` chooses among those."""
    beside = np.zeros(len(place), dtype=np.bool_)
    tree = cKDTree(place - place[0])
    for i in range(len(place)):
        near = np.asarray(tree.query_ball_point(place[i] - place[0], SHARED_ROAD_M), dtype=np.int64)
        near = near[is_other(i, near)]
        beside[i] = bool(np.any(np.abs(ahead[near] @ ahead[i]) >= _PARALLEL))
    return beside


def _returns(time_s: FloatArray, xy: FloatArray) -> list[float]:
    """Return the times at which a path without pauses comes back to a road of its present drive."""
    if len(time_s) < 2 or distance_along(xy)[-1] < _LEFT_M:
        return []
    time, place = _spaced(time_s, xy)
    ahead, tree = _ahead(place), cKDTree(place - place[0])
    n_left, n_shared = int(_LEFT_M / _PLACE_M), int(LEAST_SHARED_M / _PLACE_M)
    cuts, first, n_beside = list[float](), 0, 0
    for i in range(len(place)):
        near: AnyArray = np.asarray(tree.query_ball_point(place[i] - place[0], SHARED_ROAD_M), dtype=np.int64)
        near = near[(near >= first) & (near < i - n_left)]
        n_beside = n_beside + 1 if np.any(np.abs(ahead[near] @ ahead[i]) >= _PARALLEL) else 0
        if n_beside == n_shared:
            first = i - n_shared + 1
            cuts.append(float(time[first]))
            n_beside = 0
    return cuts
