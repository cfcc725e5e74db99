"""Progress on stderr: bars with rate and time left on a terminal, plain lines elsewhere."""

from __future__ import annotations

import sys
from types import TracebackType
from typing import TYPE_CHECKING, Protocol, Self

from linework.runs.steps import Watcher

if TYPE_CHECKING:
    from rich.progress import Progress, TaskID

#: Width of a bar [characters]: amount, rate and both times fit beside it in 100 columns.
_BAR_WIDTH = 30


class Display(Watcher, Protocol):
    """A display of a run's steps, shown while it is entered as a context."""

    def __enter__(self) -> Self: ...
    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None: ...


def open_display(*, quiet: bool) -> Display:
    """Return the display of the steps: nothing, plain lines, or bars where stderr is a terminal."""
    if quiet or sys.stderr is None:
        return _Nothing()
    return _Bars() if sys.stderr.isatty() else _Lines()


class _Nothing:
    """Shows nothing."""

    def begin(self, step: str, unit: str) -> None:
        """Show nothing."""

    def advance(self, done: int, total: int) -> None:
        """Show nothing."""

    def end(self, step: str, seconds: float) -> None:
        """Show nothing."""

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Leave nothing behind."""


class _Lines(_Nothing):
    """One plain line per finished step."""

    def __init__(self) -> None:
        self._amount = ""
        self._unit = ""

    def begin(self, step: str, unit: str) -> None:  # noqa: ARG002  (printed at the end)
        self._amount, self._unit = "", unit

    def advance(self, done: int, total: int) -> None:  # noqa: ARG002  (a plain line shows the amount only)
        self._amount = f", {done:,} {self._unit}"

    def end(self, step: str, seconds: float) -> None:
        print(f"{step}: {seconds:.1f} s{self._amount}", file=sys.stderr)


class _Bars(_Nothing):
    """A bar per step: amount, rate, time elapsed and time left."""

    def __init__(self) -> None:
        from rich.console import Console
        from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

        self._bars: Progress = Progress(
            TextColumn("{task.description}"),
            BarColumn(bar_width=_BAR_WIDTH),
            TextColumn("{task.fields[amount]}"),
            TimeElapsedColumn(),
            TimeRemainingColumn(),
            console=Console(stderr=True),
        )
        self._task: TaskID | None = None
        self._unit = ""

    def __enter__(self) -> Self:
        self._bars.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._bars.stop()

    def begin(self, step: str, unit: str) -> None:
        self._unit = unit
        self._task = self._bars.add_task(step, total=None, amount="")

    def advance(self, done: int, total: int) -> None:
        if self._task is not None:
            speed = self._bars.tasks[-1].speed
            rate = f" ({speed:,.0f} {self._unit}/s)" if speed else ""
            amount = f"{done:,} of {total:,} {self._unit}{rate}"
            self._bars.update(self._task, completed=done, total=total, amount=amount)

    def end(self, step: str, seconds: float) -> None:  # noqa: ARG002  (the bar shows both)
        if self._task is not None:
            total = self._bars.tasks[-1].total or 1
            self._bars.update(self._task, completed=total, total=total)
            self._bars.stop_task(self._task)
