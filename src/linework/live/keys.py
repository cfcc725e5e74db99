"""The operator's keys: which there are, and what a press of one means.

Separate from `drive`, because presses come from the thread of the page while the drive looks at pairs.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from linework.errors import AbsentError, InputError
from linework.files.live.events import BEGIN, END, POINT, EventsFile, Press
from linework.files.logs.keys import EVENTS_NAME, events_file
from linework.model.survey import Survey

#: Presses that the page shows, the newest first: as many as fit beside the keys.
_SHOWN = 6


@dataclass(frozen=True, slots=True)
class OperatorKey:
    """A key of the page: its name, and whether it marks a point or begins and ends a stretch."""

    name: str
    is_span: bool = False


def keys_of(settings: Mapping[str, Any]) -> tuple[OperatorKey, ...]:
    """Return the keys of [[live.keys]] in a survey.toml, in their order."""
    tables = settings.get("live", {}).get("keys", [])
    return tuple(OperatorKey(str(table["name"]), table.get("kind") == "span") for table in tables)


def events_path(survey: Survey) -> Path:
    """Return the file of the operator's keys: that of [events], else events.csv in the survey's folder."""
    return events_file(survey) or survey.root / EVENTS_NAME


class Operator:
    """The presses of a drive; may be used from any thread.

    Parameters
    ----------
    survey_s
        Returns the survey's time at a time of this machine [s], None while it is not known.
    monotonic
        The clock of this machine. [s]
    """

    def __init__(
        self,
        keys: tuple[OperatorKey, ...],
        file: EventsFile,
        survey_s: Callable[[float], float | None],
        monotonic: Callable[[], float] = time.monotonic,
    ) -> None:
        self.keys = keys
        self._file, self._survey_s, self._monotonic = file, survey_s, monotonic
        self._lock = threading.Lock()

    def press(self, name: str, press: str, ago_s: float, note: str = "") -> Press:
        """Note a press of a key; the disk holds it when this returns. One that is sent again counts once.

        Parameters
        ----------
        press
            Identity of the press.
        ago_s
            How long ago it was pressed. [s]

        Raises
        ------
        AbsentError
            There is no such key.
        InputError
            The survey's time is not known: no log has arrived.
        MachineError
            The disk is full: it is not noted.
        """
        now_s = self._monotonic()
        key = next((one for one in self.keys if one.name == name), None)
        if key is None:
            raise AbsentError(f"there is no key {name!r:.60}", where="keys", advice="load the page again")
        with self._lock:
            if (known := self._file.find(press)) is not None:
                return known
            survey_s = self._survey_s(now_s - ago_s)
            if survey_s is None:
                raise InputError("the time is not known: no log and no image has arrived yet", where="keys",
                                 advice="press again when the logs run")  # fmt: skip
            is_open = name in self._file.open_spans()
            span = POINT if not key.is_span else END if is_open else BEGIN
            made = Press(round(survey_s, 3), name, span, press, note)
            self._file.add(made)
        return made

    def undo(self, press: str) -> Press:
        """Remove a press; the disk holds the rest when this returns.

        Raises
        ------
        AbsentError
            There is none of this identity.
        MachineError
            The disk is full: the press stays.
        """
        with self._lock:
            found = self._file.remove(press)
        if found is None:
            raise AbsentError("there is no such press", where="keys", advice="it may be undone already")
        return found

    def presses(self) -> list[Press]:
        """Return all presses, in their order."""
        with self._lock:
            return list(self._file.presses)

    def newest(self) -> tuple[list[Press], dict[str, Press]]:
        """Return the newest presses, the newest first, and the stretches that are open."""
        with self._lock:
            return self._file.presses[: -_SHOWN - 1 : -1], self._file.open_spans()
