"""The steps of a run: named, timed, and shown to whoever watches."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterator
from typing import Protocol

#: Called with how much of a step has been done so far, and how much there is in all.
Advance = Callable[[int, int], None]


class Watcher(Protocol):
    """Shows a run to a person."""

    def begin(self, step: str, unit: str) -> None:
        """Say that a step begins; its amounts are counted in `unit` ("" where it has no amounts)."""
        ...

    def advance(self, done: int, total: int) -> None:
        """Say how far the step has come."""
        ...

    def end(self, step: str, seconds: float) -> None:
        """Say that the step is done."""
        ...


class RunSteps:
    """The steps of one run and the wall time each took.

    Parameters
    ----------
    watcher
        Told of every step; None: nobody watches.

    Examples
    --------
    >>> steps = Steps()
    >>> with steps.step("read points", unit="points") as advance:
    ...     advance(5, 10)
    >>> list(steps.timings_s)
    ['read points']
    """

    def __init__(self, watcher: Watcher | None = None) -> None:
        self._watcher = watcher
        self.timings_s: dict[str, float] = {}

    @contextlib.contextmanager
    def step(self, name: str, unit: str = "") -> Iterator[Advance]:
        """Time what is done inside; a name that comes again adds to its time."""
        watcher = self._watcher
        if watcher:
            watcher.begin(name, unit)
        start = time.perf_counter()
        yield watcher.advance if watcher else _unseen
        seconds = time.perf_counter() - start
        self.timings_s[name] = self.timings_s.get(name, 0.0) + seconds
        if watcher:
            watcher.end(name, seconds)


def _unseen(done: int, total: int) -> None:
    """Advance where nobody watches."""
