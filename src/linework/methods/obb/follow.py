"""One line followed from a place on it: a generator of steps that the caller may stop at any of them."""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Protocol

import numpy as np

from linework.kernels import track as kernels
from linework.methods.obb.track import BoxTable, TrackConfig
from linework.methods.sight import Sight
from linework.model.arrays import FloatArray, IntArray
from linework.model.boxes import BoxForm, BoxSet

#: Without a box for longer than this a stretch is bridged. [m]
BRIDGED_M = 1.5
#: Whether there is anything to see ahead is asked this far on. [m]
_AHEAD_M = 3.0


class Stop(StrEnum):
    """Why a line goes no further."""

    END_OF_DATA = "the data ends there"
    FADED = "nothing goes on within the search length, on ground that was seen"
    RING = "it is back where it began"
    PICKED = "it was picked there"


@dataclass(frozen=True, slots=True)
class Step:
    """One step along a line.

    Parameters
    ----------
    xyz
        (3,) float64 [m, from the survey's local origin]: centre of the box that was joined.
    sigma_xy_m, sigma_z_m
        Of this centre by itself; the line's, smoothed, are smaller. [m]
    bridged
        Whether nothing was measured between this step and the one before.
    box
        Number of the box in the source's set.
    length_m
        From the start along the line. [m]
    """

    xyz: FloatArray
    sigma_xy_m: float
    sigma_z_m: float
    bridged: bool
    box: int
    length_m: float


class BoxSource(Protocol):
    """Boxes of one feature, found where they are needed."""

    @property
    def boxes(self) -> BoxSet:
        """All boxes found so far; more are added behind them."""
        ...

    def load(self, xy: FloatArray, reach_m: float) -> bool:
        """Find all boxes within `reach_m` of a place [m, from the local origin]; return whether any were added."""
        ...


class _Path:
    """The boxes of a line so far, as kernels take them; looked up anew when the source has found more."""

    def __init__(self, source: BoxSource, start: int, way: float) -> None:
        self.boxes: list[int] = [start]
        self.ways: list[float] = [way]
        self._source = source
        self._fit = np.zeros(11)
        self._rebuild()

    def _rebuild(self) -> None:
        self._table = BoxTable.of(self._source.boxes)
        self._row = np.empty(len(self._table.order), dtype=np.int64)
        self._row[self._table.order] = np.arange(len(self._row))
        n = len(self._row)
        self._owner = np.full(n, kernels.FREE, dtype=np.int64)
        self._path, self._way = np.zeros(n + 1, dtype=np.int64), np.ones(n + 1)
        self._path[: len(self.boxes)] = self._row[self.boxes]
        self._way[: len(self.ways)] = self.ways
        self._owner[self._row[self.boxes]] = 0
        self._inward = np.zeros(n)

    def advance(self, config: TrackConfig, width_m: float) -> tuple[int, int]:
        """Join the next box; return its number, or -1 and the kernel's stop reason."""
        tip = self._source.boxes.centre[self.boxes[-1], :2]
        if self._source.load(tip, config.longest_gap_m + 2.0):
            self._rebuild()
        t, n = self._table, len(self.boxes)
        sided = bool(self._source.boxes.form[self.boxes[0]] >= BoxForm.KERB)
        limits = (config.longest_gap_m, config.widest_m, config.least_support, sided)
        state = (self._path, self._way, self._owner, self._inward)
        j, reason = kernels.next_box(t.rows, t.codes, t.lattice, state, n, limits, t.support, self._fit)
        if j < 0:
            return -1, reason
        i = self._path[n - 1]
        along = self._way[n - 1] * float(t.rows[i, 2:4] @ t.rows[j, 2:4])
        self._path[n], self._way[n] = j, 1.0 if along >= 0.0 else -1.0
        self._owner[j] = 0
        kernels.absorb(t.rows, t.codes, t.lattice, self._owner, (i, j), width_m)
        self.boxes.append(int(t.order[j]))
        self.ways.append(float(self._way[n]))
        return self.boxes[-1], reason


def follow(
    source: BoxSource, start: int, way: float, config: TrackConfig, *, width_m: float, seen: Sight
) -> Generator[Step, None, Stop]:
    """Follow the line through a box, one way; yield a step per box, and return why it ends.

    Parameters
    ----------
    start
        Number of the box in ``source.boxes``.
    way
        +1: along the box's u-axis; -1: against it.
    width_m
        Boxes within this of the line are the same feature. [m]
    seen
        Says where road or ground was measured [m, from the local origin].

    Notes
    -----
    The steps are those of `linework.methods.obb.track.track_lines`: box A moved by the search length, collision
    with what was found there.
    """
    path, length = _Path(source, start, way), 0.0
    while True:
        j, reason = path.advance(config, width_m)
        boxes = source.boxes
        if j < 0:
            if reason == kernels.MEETS_LINE:
                return Stop.RING
            return _why(boxes, path.boxes, path.ways[-1], seen)
        step = float(np.hypot(*(boxes.centre[j, :2] - boxes.centre[path.boxes[-2], :2])))
        length += step
        covered = boxes.half_u_m[j] + boxes.half_u_m[path.boxes[-2]]
        yield Step(
            boxes.centre[j], float(boxes.sigma_v_m[j]), float(boxes.sigma_z_m[j]),
            bool(step - covered > BRIDGED_M), j, length,
        )  # fmt: skip


def follow_ways(
    source: BoxSource,
    start: int,
    ways: Sequence[float],
    config: TrackConfig,
    *,
    width_m: float,
    seen: Sight,
) -> Generator[Step, None, tuple[IntArray, tuple[Stop, Stop]]]:
    """Follow the line through a box along it (+1), against it (-1) or both.

    Returns
    -------
    The boxes in the order of the start's u-axis, and the stop reasons at their start and their end.
    """
    path = [start]
    stops = {1.0: Stop.PICKED, -1.0: Stop.PICKED}
    for way in ways:
        ahead: list[int] = []
        steps = follow(source, start, way, config, width_m=width_m, seen=seen)
        while True:
            try:
                step = next(steps)
            except StopIteration as end:
                stops[way] = end.value
                break
            ahead.append(step.box)
            yield step
        path = path + ahead if way > 0 else ahead[::-1] + path
        if stops[way] is Stop.RING:
            stops[-way] = Stop.RING
            break
    return np.array(path, dtype=np.int64), (stops[-1.0], stops[1.0])


def _why(boxes: BoxSet, path: list[int], way: float, seen: Sight) -> Stop:
    """Return why nothing more was found: there is no ground ahead, or nothing on it."""
    tip, u = boxes.centre[path[-1], :2], way * boxes.u[path[-1]]
    left = np.array([-u[1], u[0]])
    ahead = np.linspace(0.5, _AHEAD_M, 6)[:, None] * u
    places = np.concatenate([tip + ahead, tip + ahead + 0.5 * left, tip + ahead - 0.5 * left])
    return Stop.FADED if np.mean(seen(places)) > 0.5 else Stop.END_OF_DATA
