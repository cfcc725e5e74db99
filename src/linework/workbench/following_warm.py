"""Warming up: lines are followed for nobody, so that code and survey are at hand when somebody clicks."""

from __future__ import annotations

import contextlib
import itertools
from collections.abc import Generator, Iterator
from typing import Any

import numpy as np

from linework.arrays import FloatArray
from linework.errors import LineworkError
from linework.methods.obb.trace import TRACKED_AS
from linework.tiling.traces import Trace
from linework.workbench.following import INTERRUPT, tracer_of
from linework.workbench.table import Table

#: Beside the van's way there is a line within a lane or two. [m]
_BESIDE_M = (-5.0, -1.75, 1.75, 5.0)
#: A line of each kind is followed by so many steps: each part of the code has run then.
_STEPS = 4


def warm_at_desk(table: Table) -> Generator[None, Any, None]:
    """Follow a line of each kind beside the van's way for a few steps; what is said to it ends it."""
    path = None if table.recordings.trajectory is None else table.recordings.trajectory.xyz
    if table.recordings.points is None or path is None or len(path) < 2:
        return
    tracer = tracer_of(table)
    for kind in TRACKED_AS:
        for place in _places(path):
            steps = tracer.trace((float(place[0]), float(place[1])), kind=kind)
            followed = 0
            for _ in _drained(steps):
                followed += 1
                if (yield) == INTERRUPT:
                    return
            if followed:
                break


def _drained(steps: Trace) -> Iterator[None]:
    """Run some steps of a trace, and what comes when it is stopped then."""
    with contextlib.suppress(StopIteration, LineworkError):
        for number in itertools.count():
            steps.send(None if number == 0 else number >= _STEPS)
            yield


def _places(path: FloatArray) -> Iterator[FloatArray]:
    """Yield places beside the middle of a van's way."""
    i = len(path) // 2
    before = path[max(i - 20, 0), :2]
    way = path[i, :2] - before
    length = float(np.hypot(*way))
    if length == 0.0:
        return
    right = np.array([way[1], -way[0]]) / length
    for across_m in _BESIDE_M:
        yield path[i, :2] + across_m * right
