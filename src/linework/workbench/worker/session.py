"""The survey that a worker process has open, and what its requests have made of it so far."""

from __future__ import annotations

import contextlib
from collections.abc import Callable
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
from linework.workbench.worker.order import SurveyOrder

KeptT = TypeVar("KeptT")


class SurveySession:
    """The open survey of a worker process, with what its requests keep for later ones.

    Parameters
    ----------
    report
        Sends a value to the caller of the running request.
    """

    def __init__(self, order: SurveyOrder, report: Callable[[Any], None]) -> None:
        self.order, self.report = order, report
        self._held = contextlib.ExitStack()
        self._kept: dict[str, Any] = {}

    @property
    def settings(self) -> RunSettings:
        """Settings of all methods."""
        return self.keep("settings", lambda: self.order.settings or RunSettings())

    @property
    def survey(self) -> Survey:
        """The survey as its files describe it."""
        return self.keep("survey", lambda: _opened(self.order))

    @property
    def work(self) -> Path:
        """The survey's work folder."""
        return self.keep("work", lambda: work_folder(self.survey.root, self.order.work))

    @property
    def recordings(self) -> Recordings:
        """Points and stereo pairs; opened at the first call, which decodes the points if that has not been done.

        Raises
        ------
        InputError
            The survey holds nothing that can be used.
        """
        return self.opened(RunSteps())

    def opened(self, steps: RunSteps) -> Recordings:
        """Return `recordings`; if they have to be opened first, `steps` shows the progress."""
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
        """Return `surface`; if it has to be made first, `steps` shows the progress."""
        points = self.opened(steps).points
        if points is None:
            return None
        return self.keep("surface", lambda: surface_of(points, self.settings.road, Serial(), steps))

    def keep(self, name: str, make: Callable[[], KeptT]) -> KeptT:
        """Return the value kept under a name, made at the first call."""
        if name not in self._kept:
            self._kept[name] = make()
        return cast(KeptT, self._kept[name])


def _opened(order: SurveyOrder) -> Survey:
    survey = open_survey(
        list(order.inputs), crs=order.crs, allow_outside=order.allow_outside, allow_remote=order.allow_remote
    )
    return survey if order.trajectory is None else survey.with_trajectory(order.trajectory)
