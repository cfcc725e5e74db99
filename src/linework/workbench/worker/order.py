"""The survey that a worker is to open.

Separate from `session`, because the server names a survey without importing what opens it: the settings alone import all
methods, which takes two seconds.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from linework.runs.settings import RunSettings


@dataclass(frozen=True, slots=True)
class SurveyOrder:
    """The survey to serve, and how it is read.

    Parameters
    ----------
    inputs
        Files and folders named on the command line.
    crs
        CRS of files that do not state theirs; None if not given.
    allow_outside
        Whether its survey.toml may name files outside its folder.
    allow_remote
        Whether its survey.toml may name points at addresses.
    trajectory
        Trajectory that replaces the survey's own; None: its own.
    work
        Work folder; None: beside the survey.
    settings
        Of all methods; None: the usual ones.
    n_threads
        Threads for decoding.
    """

    inputs: tuple[Path, ...]
    crs: str | None = None
    allow_outside: bool = False
    allow_remote: bool = False
    trajectory: Path | None = None
    work: Path | None = None
    settings: RunSettings | None = None
    n_threads: int = 1
