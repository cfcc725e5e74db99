"""A survey with its points in the tile store, its trajectory, and its surface."""

from __future__ import annotations

import contextlib
import hashlib
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path

from linework.files.las.decoder import DecoderLimits
from linework.files.logs.clock_offset import named_clock_offset
from linework.files.output.locks import hold_lock
from linework.files.output.record import hash_file
from linework.files.store.facts import StoreFacts
from linework.files.store.in_memory import EPOCH_OF_KIND, SurveyPoints, check_trajectory_covers
from linework.files.store.layout import STORE_BLOCK_M
from linework.files.store.read import PointStore
from linework.files.trajectories.of_survey import on_clock_of, read_survey_trajectory_content
from linework.model.grid import Bounds
from linework.model.ground import Ground
from linework.model.points import Points
from linework.model.survey import Survey
from linework.model.trajectory import Trajectory
from linework.navigation.lever import at_vehicle_origin
from linework.processes.executors import Executor
from linework.processes.identity import identity_of
from linework.runs.opened.path_checks import odd_path
from linework.runs.opened.store import held_store
from linework.runs.opened.surface import SurveySurface, make_surface
from linework.runs.own import GroundFinder
from linework.runs.resume import fingerprint_of, source_hash
from linework.runs.steps import RunSteps
from linework.surface.road import RoadConfig


@dataclass(frozen=True, slots=True)
class OpenedSurvey:
    """A survey with its points in the tile store, and its trajectory.

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
        Hashes of the content of the point files, and of the trajectory ("" without one).
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
    steps: RunSteps | None = None,
) -> Iterator[OpenedSurvey]:
    """Open a survey with its points in the tile store of `work`, and check that points and trajectory match.

    Raises
    ------
    InputError
        No file can be used, or the trajectory does not match the points. Damaged files among good ones
        are not an error: ``facts.failures`` lists them.
    """
    # Before the points: it is read at once, and may be wrong
    content = read_survey_trajectory_content(survey)
    trajectory: Trajectory | None = None
    with held_store(survey, work, n_threads=n_threads, limits=limits, steps=steps) as held:
        warnings, hashes, path_hash = held.facts.warnings, dict(held.hashes), ""
        if content is not None and survey.trajectory_file is not None:
            where = survey.trajectory_file
            if held.facts.has_time:
                span = held.facts.times.low_s, held.facts.times.high_s
                content = on_clock_of(content, span, EPOCH_OF_KIND[held.facts.gps_time_kind], survey)
            warnings += tuple(f"{where.name}: {text}" for text in content.warnings)
            trajectory = at_vehicle_origin(
                content.trajectory, survey.trajectory_lever_m, survey.trajectory_boresight_deg
            )
            warnings += check_trajectory_covers(trajectory, held.facts, where=where)
            warnings += tuple(f"{where.name}: {text}" for text in odd_path(trajectory, held.points))
            if held.facts.has_time:
                epoch = EPOCH_OF_KIND[held.facts.gps_time_kind]
                text = named_clock_offset(trajectory, held.points, epoch)
                warnings += (f"{where.name}: {text}",) if text else ()
            if where.is_file():
                hashes[where] = hash_file(where)
            path_hash = hash_path(trajectory)
        yield OpenedSurvey(survey, held.points, held.facts, trajectory, warnings, held.key, path_hash, hashes)


def hash_path(trajectory: Trajectory) -> str:
    """Return the SHA-256 of a trajectory: of its times, positions, attitudes and their sigmas."""
    parts = (
        trajectory.time_s, trajectory.xyz, trajectory.attitude_deg, trajectory.sigma_xyz_m,
        trajectory.sigma_attitude_deg,
    )  # fmt: skip
    return hashlib.sha256(b"".join(part.tobytes() for part in parts if part is not None)).hexdigest()


def surface_of(
    opened: OpenedSurvey,
    road: RoadConfig,
    executor: Executor,
    steps: RunSteps,
    ground: Ground | GroundFinder | None = None,
) -> SurveySurface:
    """Return road and ground of a survey, found once for a store, a trajectory and settings.

    ground: own ground, or a function that returns it, instead.
    """
    with steps.step("find the road", unit="tiles") as advance:
        made_of = {
            "points": opened.key,
            "path": opened.path_hash,
            "road": asdict(road),
            "code": source_hash("kernels", "model", "files", "navigation", "surface", "runs"),
        }
        if ground is not None:
            made_of["own"] = identity_of(ground)
        key = fingerprint_of(made_of)
        folder = opened.points.folder / f"surface-{key[:16]}"
        # Two runs of one survey share its surface: the second waits until the first has made it
        with hold_lock(folder.with_suffix(".lock"), keep=True):
            return make_surface(
                opened.points, opened.trajectory, road, folder, executor, advance, key=key, ground=ground
            )


# A survey with all its points in memory, for what needs all of them at once


@dataclass(frozen=True, slots=True)
class SurveyInMemory:
    """A survey with its points and its trajectory in memory.

    Parameters
    ----------
    points
        Points used and left out, file by file.
    trajectory
        Path of the vehicle's origin, or None.
    warnings
        One line each.
    hashes
        SHA-256 of every input file that can be read.
    """

    survey: Survey
    points: SurveyPoints
    trajectory: Trajectory | None
    warnings: tuple[str, ...]
    hashes: Mapping[Path, str]


def read_into_memory(opened: OpenedSurvey) -> SurveyInMemory:
    """Return a survey with all its points read from the tile store."""
    points = SurveyPoints(opened.points.points(), opened.facts)
    return SurveyInMemory(opened.survey, points, opened.trajectory, opened.warnings, opened.hashes)


# A sample of very many points: for pictures and statistics of surveys that do not fit into memory

#: Greatest number of points for a picture: one of some thousand pixels a side shows no more, and each point takes
#: 100 bytes of memory. [points]
MOST_PICTURE_POINTS = 4_000_000


def points_for_pictures(store: PointStore, most: int = MOST_PICTURE_POINTS) -> Points:
    """Return all points, or every k-th point of each block if there are more than `most`; always the same."""
    step = -(-store.n_points // most)
    if step <= 1:
        return store.points(with_columns=False)
    parts = []
    for east, north in (store.block_counts[0] * STORE_BLOCK_M).tolist():
        parts.append(
            store.points(
                Bounds(east, north, east + STORE_BLOCK_M, north + STORE_BLOCK_M), with_columns=False
            ).take(slice(None, None, step))
        )
    return Points.concatenate(parts)
