"""Points that are in memory, opened as the recordings of a survey: arrays take the path of files from here on."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from linework.errors import UsageError
from linework.files.logs.clock_offset import named_clock_offset
from linework.files.store.in_memory import EPOCH_OF_KIND, check_trajectory_covers
from linework.model.points import Points
from linework.model.survey import Survey
from linework.model.trajectory import Trajectory
from linework.runs.opened.path_checks import odd_path
from linework.runs.opened.points import OpenedSurvey, hash_path
from linework.runs.opened.recordings import Recordings
from linework.runs.opened.store import HeldStore, held_store_of_points
from linework.runs.steps import RunSteps


@contextlib.contextmanager
def opened_points(
    points: Points,
    work: Path,
    *,
    trajectory: Trajectory | None = None,
    name: str = "points",
    steps: RunSteps | None = None,
) -> Iterator[Recordings]:
    """Open points as the recordings of a survey that has laser points only, and hold them open.

    Parameters
    ----------
    points
        In a metric CRS, in any order: what is found in them does not depend on it.
    work
        Folder for the tile store, such as a temporary one.
    trajectory
        Path of the vehicle's origin, in the CRS and on the clock of the points; None where there is none.
    name
        Name of the points, for messages and for the sources of lines.
    steps
        Times and shows the steps.

    Raises
    ------
    UsageError
        Points or a trajectory that cannot be used: none, or values that are not finite.
    CrsError
        The CRS of the points is not known, or its lengths are not in metres; or the coordinates are degrees.
    InputError
        Points and trajectory are more than 1 km apart, or have no time in common.
    MachineError
        The work folder is full.
    """
    if trajectory is not None:
        _refuse_unusable_path(trajectory)
    with held_store_of_points(points, work, name=name, steps=steps) as held:
        facts = held.facts
        survey = Survey(name=name, root=work, point_files=(), crs=facts.crs, carry=facts.columns)
        path_hash = "" if trajectory is None else hash_path(trajectory)
        warnings = (
            facts.warnings if trajectory is None else (*facts.warnings, *_checked_path(trajectory, held))
        )
        opened = OpenedSurvey(survey, held.points, facts, trajectory, warnings, held.key, path_hash, {})
        yield Recordings(survey=survey, points=opened, stereo=None, hashes={Path(name): held.key})


def _refuse_unusable_path(trajectory: Trajectory) -> None:
    if len(trajectory) < 2:
        raise UsageError(f"{len(trajectory)} poses, at least 2 are needed", where="trajectory")
    for name in ("time_s", "xyz", "attitude_deg"):
        values = trajectory.by_name().get(name)
        if values is not None and not np.isfinite(values).all():
            n_bad = np.count_nonzero(~np.isfinite(values).reshape(len(values), -1).all(axis=1))
            raise UsageError(
                f"{n_bad:,} of {len(trajectory):,} poses have NaN or infinity in {name}", where="trajectory",
                advice="leave them out",
            )  # fmt: skip


def _checked_path(trajectory: Trajectory, held: HeldStore) -> tuple[str, ...]:
    """Return warnings about a trajectory that does not fit its points well."""
    warnings = check_trajectory_covers(trajectory, held.facts, where="trajectory")
    warnings += tuple(f"trajectory: {text}" for text in odd_path(trajectory, held.points))
    if held.facts.has_time:
        text = named_clock_offset(trajectory, held.points, EPOCH_OF_KIND[held.facts.gps_time_kind])
        warnings += (f"trajectory: {text}",) if text else ()
    return warnings
