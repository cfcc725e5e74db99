"""A survey that has logs and no trajectory: the trajectory is made from them, as `linework locate` does."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from linework.files.navigation_logs import read_navigation_logs
from linework.files.trajectories import write_trajectory
from linework.model.survey import Survey
from linework.navigation.locate import locate
from linework.tiling.opened import hash_path
from linework.tiling.steps import Steps
from linework.tiling.work_folder import STORES


def located_survey(survey: Survey, work: Path, steps: Steps) -> tuple[Survey, tuple[str, ...]]:
    """Return the survey with a trajectory, its own or one made from its logs, and what is to be told of that.

    Parameters
    ----------
    work
        The work folder: a trajectory that is made stays there, under the name of what it holds.

    Raises
    ------
    InputError, ConfigError, CrsError
        The logs cannot be used.
    """
    if survey.trajectory_file is not None or not survey.settings.get("navigation"):
        return survey, ()
    with steps.step("locate", unit="stretches") as advance:
        content = read_navigation_logs(survey)
        found = locate(content.logs, progress=advance)
        path = work / STORES / f"located-{hash_path(found.trajectory)[:16]}.csv"
        if not path.is_file():
            write_trajectory(found.trajectory, path, overwrite=True)
    settings = {name: table for name, table in survey.settings.items() if name != "trajectory"}
    located = replace(
        survey, trajectory_file=path, trajectory_lever_m=(0.0, 0.0, 0.0), trajectory_boresight_deg=(0.0, 0.0, 0.0),
        settings=settings,
    )  # fmt: skip
    told = f"{survey.name}: no trajectory: made from the logs, as linework locate does"
    return located, (told, *content.warnings, *found.warnings)
