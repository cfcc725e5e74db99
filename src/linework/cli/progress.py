"""Progress on stderr: a bar with rate and time left on a terminal, a few plain lines elsewhere."""

from __future__ import annotations

import contextlib
import gc
import importlib
import os
import sys
import threading
from collections.abc import Iterable
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Protocol, Self

from linework.runs.steps import Watcher

if TYPE_CHECKING:
    from rich.progress import Progress, TaskID


class Display(Watcher, Protocol):
    """A watcher of a run's steps that is switched on and off."""

    def __enter__(self) -> Self: ...
    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None: ...


def open_display(*, quiet: bool) -> Display:
    """Return what shows the steps: nothing, plain lines, or bars where stderr is a terminal."""
    if quiet or sys.stderr is None:
        return _Nothing()
    return _Bars() if sys.stderr.isatty() else _Lines()


class _Nothing:
    """Shows nothing."""

    def begin(self, step: str, unit: str) -> None:
        """Say nothing."""

    def advance(self, done: int, total: int) -> None:
        """Say nothing."""

    def end(self, step: str, seconds: float) -> None:
        """Say nothing."""

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

    def begin(self, step: str, unit: str) -> None:  # noqa: ARG002  (said at the end)
        self._amount, self._unit = "", unit

    def advance(self, done: int, total: int) -> None:  # noqa: ARG002  (no share on a plain line)
        self._amount = f", {done:,} {self._unit}"

    def end(self, step: str, seconds: float) -> None:
        print(f"{step}: {seconds:.1f} s{self._amount}", file=sys.stderr)


class _Bars(_Nothing):
    """A bar per step: how far, how fast, how long still."""

    def __init__(self) -> None:
        from rich.console import Console
        from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

        self._bars: Progress = Progress(
            TextColumn("{task.description}"),
            BarColumn(bar_width=30),
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

    def end(self, step: str, seconds: float) -> None:  # noqa: ARG002  (the bar knows both)
        if self._task is not None:
            total = self._bars.tasks[-1].total or 1
            self._bars.update(self._task, completed=total, total=total)
            self._bars.stop_task(self._task)


# Say why the first run takes longer: the kernels are compiled once, and kept

#: A kernel that the search for a kind always comes to; where it is compiled, so are the others.
_KERNEL_OF = {
    "lane_marking": "paint/stripes_all", "lane_marking_dash": "paint/stripes_all", "road_marking_other": "paint/stripes_all",
    "road_boundary": "boundaries/boundary_boxes", "kerb_top": "boundaries/boundary_boxes",
    "guardrail": "radon/follow", "barrier": "radon/follow", "cable": "cables/fit",
    "trajectory": "navigation",
}  # fmt: skip


def announce_compilation(kinds: Iterable[str], *, quiet: bool) -> None:
    """Print one line on stderr where kernels for these kinds have to be compiled first.

    Where numba keeps them elsewhere (``NUMBA_CACHE_DIR``, a package that cannot be written) nothing is said.
    """
    import linework.kernels

    folder = Path(next(iter(linework.kernels.__path__)))
    names = {_KERNEL_OF[kind] for kind in kinds if kind in _KERNEL_OF}
    elsewhere = "NUMBA_CACHE_DIR" in os.environ or not os.access(folder, os.W_OK)
    if not quiet and not elsewhere and not all(is_compiled(folder / f"{name}.py") for name in names):
        print("first run: compiling, once, about half a minute", file=sys.stderr, flush=True)


def is_compiled(module: Path) -> bool:
    """Return whether numba's cache holds kernels of a module that are no older than it.

    The stamp of the source is in numba's index; by its time, one of an older version is told well enough.
    """
    indices = (module.parent / "__pycache__").glob(f"{module.stem}.*.nbi")
    changed = module.stat().st_mtime
    return any(index.stat().st_mtime >= changed for index in indices)


# Import what comes later while the points are decoded


def preload_modules(*modules: str) -> threading.Thread:
    """Begin to import modules in a thread of their own; join it before they are used.

    Decoding lets go of the interpreter's lock and leaves it to the imports: of the 0.9 s that numba, scipy
    and pyogrio take, 0.6 s pass beside it (4 million points, 2 cores). The garbage collector, which finds
    nothing in freshly imported modules but takes another 0.1 s, rests meanwhile.
    """

    def work() -> None:
        had_collector = gc.isenabled()
        gc.disable()
        try:
            # What cannot be imported fails again, and is told, where it is used
            with contextlib.suppress(Exception):
                for module in modules:
                    importlib.import_module(module)
        finally:
            gc.freeze()
            if had_collector:
                gc.enable()

    thread = threading.Thread(target=work, name="import ahead", daemon=True)
    thread.start()
    return thread
