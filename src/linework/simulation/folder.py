"""Write a simulated survey as a survey folder: survey.toml, points, trajectory, images, truth."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from linework.errors import MachineError
from linework.files.las_header import read_las_header
from linework.files.las_write import write_las
from linework.files.publish import publish_folder
from linework.files.trajectories import write_trajectory
from linework.files.vectors import write_lines
from linework.model.lines import KINDS
from linework.simulation.cameras import StereoDrive
from linework.simulation.folder_images import cameras_toml, write_images
from linework.simulation.folder_logs import survey_logs, write_logs
from linework.simulation.seen import observed_in_images
from linework.simulation.simulate import SIMULATED_CRS, SimulatedSurvey


def write_survey_folder(
    survey: SimulatedSurvey,
    folder: Path,
    *,
    overwrite: bool = False,
    cameras: StereoDrive | None = None,
    advance: Callable[[int, int], None] | None = None,
) -> None:
    """Write the survey; the folder appears whole or not at all.

    Parameters
    ----------
    survey
        From `simulate_survey`.
    folder
        New, empty, or with `overwrite` one whose files of the same names are replaced.
    cameras
        What takes stereo images along the way, from `stereo_survey`; None: no images.
    advance
        Told how many pairs of images are drawn, and how many there are.

    Raises
    ------
    OutputExistsError
        The folder is not empty and `overwrite` is not set.
    MachineError
        The disk is full, the place is read-only, or what was written does not read back.
    """
    parts = _per_pass(survey)

    def write(part: Path) -> None:
        (part / "points").mkdir()
        bits = survey.scenario.sensor.intensity_bits
        for i, index in enumerate(parts):
            target = part / "points" / f"pass_{i + 1}.laz"
            write_las(survey.points.take(index), target, crs=survey.crs, intensity_bits=bits)
        write_trajectory(survey.trajectory, part / "trajectory.csv")
        # A layer for every kind, also where the survey has none of it
        write_lines(survey.truth, part / "truth.gpkg", kinds=KINDS)
        settings = _survey_toml(survey) + write_logs(survey_logs(survey), part)
        if cameras is not None:
            write_images(cameras, part, advance)
            seen = observed_in_images(survey.truth, cameras)
            write_lines(survey.truth.with_columns(observed=seen), part / "truth_images.gpkg", kinds=KINDS)
            settings += cameras_toml(cameras.rig)
        (part / "survey.toml").write_text(settings, encoding="utf-8")

    def verify(part: Path) -> None:
        held = sum(read_las_header(p).n_points for p in sorted((part / "points").glob("*.laz")))
        if held != len(survey.points):
            raise MachineError(f"{held} of {len(survey.points)} points were written", where=folder)

    publish_folder(folder, write, verify, overwrite=overwrite)


def _per_pass(survey: SimulatedSurvey) -> list[slice]:
    """Return the points of each pass; passes follow one another in time."""
    assert survey.points.time_s is not None
    starts = [p.start_time_s for p in survey.scenario.passes]
    ends = np.append(np.searchsorted(survey.points.time_s, starts[1:]), len(survey.points))
    return [slice(int(a), int(b)) for a, b in zip(np.append(0, ends[:-1]), ends, strict=True)]


def _survey_toml(survey: SimulatedSurvey) -> str:
    scenario = survey.scenario
    # By name: a pass that an older survey of more passes left in the folder is not taken for ours
    files = ", ".join(f'"points/pass_{i + 1}.laz"' for i in range(len(scenario.passes)))
    return f"""\
# Simulated by linework: road "{scenario.kind}", seed {scenario.seed}, {scenario.length_m:g} m; no real place.
name = "simulated {scenario.kind} {scenario.seed}"
crs = "{SIMULATED_CRS}"

[time]
epoch = "gps_adjusted"

[points]
files = [{files}]

[trajectory]
file = "trajectory.csv"
"""
