"""Follow a survey until a signal comes, or until nothing arrives any more."""

from __future__ import annotations

import contextlib
import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from linework.errors import OutputExistsError, UsageError, argument
from linework.files.output.inputs import check_not_read
from linework.files.output.publish import check_output
from linework.live.drive import LiveDrive
from linework.live.kept import KeptDrive, is_followed, live_folder
from linework.model.survey import Survey
from linework.processes.forced_end import wait_until_saved
from linework.processes.system import end_on_second

#: Pause where nothing is due: half the time between two readings of the file system that a person would notice. [s]
_PAUSE_S = 0.02
#: Time between two lines of progress. [s]
_PROGRESS_S = 10.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Following:
    """What to follow, and callbacks for what happens.

    Parameters
    ----------
    output
        GeoPackage of the lines.
    longest_lag_s
        A pair that is older than the newest by more is skipped. [s]
    until_quiet_s
        Time without anything new after which it ends [s]; None: only a signal ends it.
    serve
        Returns the server of the page, or a context that does nothing.
    report, progress
        Called with troubles, and with a line on how it goes every ten seconds.
    """

    survey: Survey
    output: Path
    work: Path
    overwrite: bool = False
    longest_lag_s: float = 5.0
    until_quiet_s: float | None = None
    serve: Callable[[LiveDrive], AbstractContextManager[Any]] = lambda _: contextlib.nullcontext()
    report: Callable[[str], None]
    progress: Callable[[str], None]


def follow_drive(following: Following) -> tuple[dict[str, Any], int | None]:
    """Follow a drive, and return its summary and the number of the signal that ended it, None without one.

    Raises
    ------
    UsageError
        The output is not a GeoPackage.
    OutputExistsError
        The output exists and is not of this drive, or another process writes it.
    LineworkError
        As for `LiveDrive`.
    """
    output = following.output
    if output.suffix.lower() != ".gpkg":
        raise UsageError(f"cannot write '{output.suffix}' files while driving", where=output,
                         advice="use .gpkg; linework convert makes other formats of it")  # fmt: skip
    check_not_read(output)
    is_continued = is_followed(following.work, output) and not following.overwrite
    if output.exists() and not (is_continued or following.overwrite):
        raise OutputExistsError("output exists already, and is not of a drive that was followed", where=output,
                                advice=f"choose another name or give {argument('overwrite', True)}")  # fmt: skip
    check_output(output, overwrite=True)
    with contextlib.ExitStack() as held:
        folder = held.enter_context(live_folder(following.work, output, afresh=not is_continued))
        kept = KeptDrive(folder, following.survey.root)
        drive = LiveDrive(
            following.survey, output, kept, longest_lag_s=following.longest_lag_s, report=following.report
        )
        stopped = held.enter_context(_stop_event())
        held.enter_context(following.serve(drive))
        _run(drive, stopped[0], following)
        drive.finish(time.monotonic())
        return drive.summary(), stopped[1][0] if stopped[1] else None


def _run(drive: LiveDrive, stopped: threading.Event, following: Following) -> None:
    """Do what is due until it is over."""
    shown_s = time.monotonic()
    while not stopped.is_set():
        now_s = time.monotonic()
        if not drive.step(now_s):
            stopped.wait(_PAUSE_S)
        if now_s - shown_s >= _PROGRESS_S:
            shown_s = now_s
            following.progress(drive.status(now_s).line())
        quiet_s = following.until_quiet_s
        if quiet_s is not None and drive.is_idle_for(now_s, quiet_s):
            return


@contextlib.contextmanager
def _stop_event() -> Iterator[tuple[threading.Event, list[int]]]:
    """Give an event that SIGINT or SIGTERM sets, and the list of those that came; the earlier handlers are restored."""
    stopped, numbers = threading.Event(), list[int]()

    def stop(number: int, _frame: object) -> None:
        wait_until_saved()
        numbers.append(number)
        stopped.set()

    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    for number in before:
        signal.signal(number, stop)
        end_on_second(number)
    try:
        yield stopped, numbers
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
            end_on_second(number)
