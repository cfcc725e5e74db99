"""Steps of a run: named, timed, and shown to a watcher."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterator
from typing import Protocol

#: Called with the amount of a step that has been done, and the total amount, in the unit of the step.
Advance = Callable[[int, int], None]


class Watcher(Protocol):
    """Shows a run to a person."""

    def begin(self, step: str, unit: str) -> None:
        """Show that a step begins; its amounts are counted in `unit` ("": it has none)."""
        ...

    def advance(self, done: int, total: int) -> None:
        """Show the progress of the step."""
        ...

    def end(self, step: str, seconds: float) -> None:
        """Show that the step is done."""
        ...


class RunSteps:
    """Steps of one run and the wall time that each took.

    Parameters
    ----------
    watcher
        Is shown every step; None: there is no watcher.

    Examples
    --------
    >>> steps = RunSteps()
    >>> with steps.step("read points", unit="points") as advance:
    ...     advance(5, 10)
    >>> list(steps.timings_s)
    ['read points']
    """

    def __init__(self, watcher: Watcher | None = None) -> None:
        self._watcher = watcher
        self.timings_s: dict[str, float] = {}
        self._running: dict[str, float] = {}

    @contextlib.contextmanager
    def step(self, name: str, unit: str = "") -> Iterator[Advance]:
        """Time the block inside; the times of steps of one name are added."""
        watcher = self._watcher
        if watcher:
            watcher.begin(name, unit)
        start = self._running[name] = time.perf_counter()
        try:
            yield watcher.advance if watcher else _not_shown
        finally:
            self._running.pop(name, None)
        seconds = time.perf_counter() - start
        self.timings_s[name] = self.timings_s.get(name, 0.0) + seconds
        if watcher:
            watcher.end(name, seconds)

    def timings_so_far_s(self) -> dict[str, float]:
        """Return the wall time of each step, with those that have not ended yet [s]."""
        now, found = time.perf_counter(), dict(self.timings_s)
        for name, start in self._running.items():
            found[name] = found.get(name, 0.0) + now - start
        return found


def _not_shown(done: int, total: int) -> None:
    """Advance without a watcher."""
