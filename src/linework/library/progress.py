"""Progress of a run: bars with rate and time left on a terminal, plain lines elsewhere, or a function of the caller."""

from __future__ import annotations

import sys
from collections.abc import Callable
from types import TracebackType
from typing import TYPE_CHECKING, Protocol, Self

from linework.errors import UsageError, argument, printable
from linework.runs.steps import Watcher

if TYPE_CHECKING:
    from rich.progress import Progress as RichProgress
    from rich.progress import TaskID

#: Called with the name of a stage, the amount that is done, and the total amount (0 while it is not known).
ProgressCall = Callable[[str, int, int], None]
#: Whether progress is shown on stderr, or the function that is called with it.
Progress = bool | ProgressCall | None

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


def display_of(progress: Progress) -> Display:
    """Return the display that the argument `progress` of a public function asks for.

    Parameters
    ----------
    progress
        None or False: nothing is shown. True: bars on stderr, in a notebook below the cell. A function is called with
        stage, amount done and total amount.

    Raises
    ------
    UsageError
        It is something else.
    """
    if progress is None or progress is False:
        return _Nothing()
    if progress is True:
        return open_display(quiet=False)
    if not callable(progress):
        raise UsageError(
            f"{progress!r}",
            where=argument("progress"),
            advice="give True, or a function of (stage, done, total)",
        )
    return _Calls(progress)


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
        print(printable(f"{step}: {seconds:.1f} s{self._amount}"), file=sys.stderr)


class _Bars(_Nothing):
    """A bar per step: amount, rate, time elapsed and time left."""

    def __init__(self) -> None:
        from rich.console import Console
        from rich.progress import BarColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn
        from rich.progress import Progress as RichBars

        self._bars: RichProgress = RichBars(
            TextColumn("{task.description}", markup=False),
            BarColumn(bar_width=_BAR_WIDTH),
            TextColumn("{task.fields[amount]}", markup=False),
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
        self._task = self._bars.add_task(printable(step), total=None, amount="")

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


class _Calls(_Nothing):
    """Calls a function of the caller."""

    def __init__(self, call: ProgressCall) -> None:
        self._call, self._stage, self._total = call, "", 0

    def begin(self, step: str, unit: str) -> None:  # noqa: ARG002  (the stage is named, its unit is not)
        self._stage, self._total = step, 0
        self._call(step, 0, 0)

    def advance(self, done: int, total: int) -> None:
        self._total = total
        self._call(self._stage, done, total)

    def end(self, step: str, seconds: float) -> None:  # noqa: ARG002  (the caller has a clock)
        self._call(step, max(self._total, 1), max(self._total, 1))
