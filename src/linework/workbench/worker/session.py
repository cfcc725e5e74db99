"""What a process of the workbench works on: the opened survey, and what has been made of it so far."""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar, cast

from linework.files.survey.open import open_survey
from linework.model.survey import Survey
from linework.processes.executors import Serial
from linework.runs.opened.points import surface_of
from linework.runs.opened.recordings import Recordings, opened_recordings
from linework.runs.opened.surface import SurveySurface
from linework.runs.opened.work_folder import work_folder
from linework.runs.settings import RunSettings
from linework.runs.steps import RunSteps

KeptT = TypeVar("KeptT")


@dataclass(frozen=True, slots=True)
class SurveyOrder:
    """Which survey is served, and how it is read.

    Parameters
    ----------
    inputs
        What was named on the command line.
    crs
        Where the files do not say; "" if not given.
    work
        Work folder; None: beside the survey.
    n_threads
        For decoding.
    """

    inputs: tuple[Path, ...]
    crs: str = ""
    work: Path | None = None
    settings: RunSettings = field(default_factory=RunSettings)
    n_threads: int = 1


class SurveySession:
    """The survey that a process has open, and what its works keep for one another.

    Parameters
    ----------
    tell
        Sends something to whoever asked for the work that is being done.
    """

    def __init__(self, order: SurveyOrder, tell: Callable[[Any], None]) -> None:
        self.order, self.tell = order, tell
        self._held = contextlib.ExitStack()
        self._kept: dict[str, Any] = {}

    @property
    def settings(self) -> RunSettings:
        """Settings of all methods."""
        return self.order.settings

    @property
    def survey(self) -> Survey:
        """The survey as its files describe it."""
        return self.keep("survey", lambda: open_survey(list(self.order.inputs), crs=self.order.crs or None))

    @property
    def work(self) -> Path:
        """The survey's work folder."""
        return self.keep("work", lambda: work_folder(self.survey.root, self.order.work))

    @property
    def recordings(self) -> Recordings:
        """Points and stereo pairs; opened at the first call, which decodes the points if nobody has yet.

        Raises
        ------
        InputError
            There is nothing that can be used.
        """
        return self.opened(RunSteps())

    def opened(self, steps: RunSteps) -> Recordings:
        """Return `recordings`; if they have to be opened first, say how far that is."""
        return self.keep(
            "recordings",
            lambda: self._held.enter_context(
                opened_recordings(self.survey, self.work, n_threads=self.order.n_threads, steps=steps)
            ),
        )

    @property
    def surface(self) -> SurveySurface | None:
        """Road and ground; None without points."""
        return self.surface_with(RunSteps())

    def surface_with(self, steps: RunSteps) -> SurveySurface | None:
        """Return `surface`; if it has to be made first, say how far that is."""
        points = self.opened(steps).points
        if points is None:
            return None
        return self.keep("surface", lambda: surface_of(points, self.settings.road, Serial(), steps))

    def keep(self, name: str, make: Callable[[], KeptT]) -> KeptT:
        """Return what is kept under a name; made when it is first asked for."""
        if name not in self._kept:
            self._kept[name] = make()
        return cast(KeptT, self._kept[name])
