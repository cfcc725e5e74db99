"""A survey whose points are in the tile store and whose trajectory has been read."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path

from linework.files.decoder import DecoderLimits
from linework.files.locks import locked
from linework.files.run_record import hash_file
from linework.files.store_facts import StoreFacts
from linework.files.store_read import PointStore
from linework.files.survey_points import check_trajectory_covers, read_survey_trajectory
from linework.model.survey import Survey
from linework.model.trajectory import Trajectory
from linework.navigation.lever import at_vehicle_origin
from linework.surface.road import RoadConfig
from linework.tiling.executors import Executor
from linework.tiling.source_hash import source_hash
from linework.tiling.steps import Steps
from linework.tiling.stores import held_store
from linework.tiling.surfaces import SurveySurface, make_surface
from linework.tiling.unfinished import fingerprint_of


@dataclass(frozen=True, slots=True)
class OpenedSurvey:
    """A survey whose points are at hand and whose trajectory has been read.

    Parameters
    ----------
    points
        The tile store.
    facts
        Points used and left out, file by file.
    trajectory
        Path of the vehicle's origin, or None.
    warnings
        One line each.
    key, path_hash
        Stand for the content of the files of points, and for the trajectory ("" without one).
    hashes
        SHA-256 of every input file that can be read.
    """

    survey: Survey
    points: PointStore
    facts: StoreFacts
    trajectory: Trajectory | None
    warnings: tuple[str, ...]
    key: str
    path_hash: str
    hashes: Mapping[Path, str]


@contextlib.contextmanager
def opened_survey(
    survey: Survey,
    work: Path,
    *,
    n_threads: int = 1,
    limits: DecoderLimits | None = None,
    steps: Steps | None = None,
) -> Iterator[OpenedSurvey]:
    """Give a survey with its points in the tile store of `work`, and see that points and trajectory belong together.

    Raises
    ------
    InputError
        No file can be used, or the trajectory does not go with the points. Damaged files among good ones
        are no error here: ``facts.failures`` lists them.
    """
    # Before the points: it is read in no time, and may be wrong
    trajectory = read_survey_trajectory(survey)
    with held_store(survey, work, n_threads=n_threads, limits=limits, steps=steps) as held:
        warnings, hashes, path_hash = held.facts.warnings, dict(held.hashes), ""
        if trajectory is not None and survey.trajectory_file is not None:
            trajectory = at_vehicle_origin(trajectory, survey.trajectory_lever_m)
            warnings += check_trajectory_covers(trajectory, held.facts, where=survey.trajectory_file)
            hashes[survey.trajectory_file] = hash_file(survey.trajectory_file)
            path_hash = f"{hashes[survey.trajectory_file]} {survey.trajectory_lever_m}"
        yield OpenedSurvey(survey, held.points, held.facts, trajectory, warnings, held.key, path_hash, hashes)


def surface_of(opened: OpenedSurvey, road: RoadConfig, executor: Executor, steps: Steps) -> SurveySurface:
    """Return the road and the ground of the survey, made once for a store, a trajectory and settings."""
    with steps.step("find the road", unit="tiles") as advance:
        made_of = {
            "points": opened.key,
            "path": opened.path_hash,
            "road": asdict(road),
            "code": source_hash(),
        }
        key = fingerprint_of(made_of)
        folder = opened.points.folder / f"surface-{key[:16]}"
        # Two runs of one survey share its surface: the second waits for the first to make it
        with locked(folder.with_suffix(".lock"), keep=True):
            return make_surface(opened.points, opened.trajectory, road, folder, executor, advance, key=key)
