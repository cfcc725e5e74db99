"""Extraction of a survey of several drives: their lines tie them together, then all points are moved and looked at."""

from __future__ import annotations

import hashlib
import shutil
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from linework.arrays import FloatArray
from linework.errors import InputError, PartialError
from linework.files.output.journal import JournalEntry, open_journal
from linework.files.output.parts import read_part, write_part
from linework.files.store.read import PointStore
from linework.methods.choose import choose_methods
from linework.methods.kinds import PUBLISHED_KINDS_OF
from linework.methods.obb.method import Obb
from linework.methods.protocol import Method
from linework.model.ground import Ground
from linework.model.lines import LineSet
from linework.model.points import Points
from linework.model.trajectory import Trajectory
from linework.processes.executors import Executor, Serial
from linework.runs.drives.account import DriveAccount, DrivesAccount
from linework.runs.drives.adjustment import DriveTies, PathCorrection, adjusted_path
from linework.runs.drives.separate import DriveSpan, may_tie, separate_drives, share_road, with_points
from linework.runs.drives.stores import changed_points, make_missing_stores
from linework.runs.drives.ties import (
    FIRST_REACH_M,
    LAST_REACH_M,
    TIE_KINDS_IN_TURN,
    MetLines,
    meet_lines,
    tie_drives,
    untied_places,
)
from linework.runs.drives.turns import level_turns, with_turns_sigma
from linework.runs.extraction import Extraction
from linework.runs.find import find_lines
from linework.runs.opened.points import hash_path
from linework.runs.opened.recordings import Recordings
from linework.runs.own import GroundFinder
from linework.runs.resume import RunFolder
from linework.runs.settings import RunSettings
from linework.runs.steps import RunSteps

#: Rounds of finding ties and adjusting: each brings lines nearer, so that fewer are mistaken for others.
_N_ROUNDS = 4


@dataclass(frozen=True, slots=True)
class AdjustedDrives:
    """Drives of a survey with the correction that makes them agree.

    Parameters
    ----------
    drives
        In the order of their times.
    correction
        Of the path and of all points.
    ties
        What they measured of the same lines, before they were moved.
    untied_xy
        (n, 2) places on the road that they share where no line ties them. [m, world]
    """

    drives: tuple[DriveSpan, ...]
    correction: PathCorrection
    ties: DriveTies
    untied_xy: FloatArray

    @property
    def is_held(self) -> bool:
        """Whether lines tie them along all of the road that they share."""
        return not len(self.untied_xy)

    def accounted(self) -> DrivesAccount:
        """Return how each was corrected: the covariance of the path, seconds of work for 15 km, so once for a run."""
        return _account(self.drives, self.correction, self.ties)


def find_lines_of_drives(
    recordings: Recordings,
    methods: Sequence[Method],
    run: RunFolder,
    *,
    settings: RunSettings | None = None,
    ground: Ground | GroundFinder | None = None,
    executor: Executor | None = None,
    steps: RunSteps | None = None,
    adjust: bool = True,
) -> Extraction:
    """Return the lines of a survey, as `find_lines` does, after its drives were made to agree.

    Parameters
    ----------
    adjust
        False: all drives stay as they were recorded.

    Returns
    -------
    Extraction
        That of `find_lines` where there is nothing to adjust: methods as published, which take points as they are, one
        drive, no two drives over one road, no times or trajectory, no common lines. Otherwise the sigmas of lines have what
        the drives there still have in common, and `drives` says what was corrected. Turns of a spinning lidar whose heights
        disagree are levelled before (`linework.runs.drives.turns`), with or without a trajectory, and `turns` says how.

    Notes
    -----
    The lines of each drive are found on its own points, where another one passes. They tie the drives: across at lines,
    in height, and along the road at dashes. Boundaries are looked for only where markings leave some of the shared road
    without a tie, and around there; guardrails and barriers only where both do: across it theirs weigh a fifth of those at
    most. The points are moved by the correction when they are written into a tile store of this run, from which everything
    else follows as for one drive. All that is made lies in the folder of the run, so that a killed run goes on.
    """
    chosen, steps, executor = settings or RunSettings(), steps or RunSteps(), executor or Serial()
    # The correction, and with it every line, must not depend on the tiles
    for_ties = replace(chosen, tiling=RunSettings().tiling)

    def found_in(
        them: Recordings,
        by: Sequence[Method],
        where: RunFolder,
        own: Ground | GroundFinder | None,
        using: RunSettings = chosen,
    ) -> Extraction:
        return find_lines(them, by, where, settings=using, ground=own, executor=executor, steps=steps)

    if not adjust or any(method.name in PUBLISHED_KINDS_OF for method in methods):
        return found_in(recordings, methods, run, ground)
    recordings, turns = level_turns(recordings, run, steps)

    def found_in_all(them: Recordings) -> Extraction:
        found = found_in(them, methods, run, ground)
        return replace(found, lines=with_turns_sigma(found.lines, turns), turns=turns) if turns else found

    opened = recordings.points
    path = None if opened is None else opened.trajectory
    if opened is None or path is None or not opened.points.has_time:
        return found_in_all(recordings)
    whole = separate_drives(path)
    drives = with_points(whole, opened.facts.times)
    if not share_road(drives):
        return found_in_all(recordings)
    by = partial(found_in, using=for_ties)
    lines, adjusted, untied = [LineSet.empty(recordings.survey.crs) for _ in drives], None, None
    met = meet_lines(drives, lines)
    for kinds in TIE_KINDS_IN_TURN:
        named = choose_methods(
            "auto", kinds, radon=chosen.radon, obb=chosen.obb, stereo=chosen.stereo, paint=None
        )
        tying = [
            replace(method, beside_boundaries=False) if isinstance(method, Obb) else method
            for method in named
            if method.recording == "points"
        ]
        if untied is None:
            _separate_points(recordings, drives, kinds[0], run, steps)
        more = [
            _lines_of_drive(recordings, drives, i, untied, tying, run, kinds[0], by, steps)
            for i in range(len(drives))
        ]
        lines = [LineSet.concatenate(both) for both in zip(lines, more, strict=True)]
        with steps.step("adjust drives"):
            # Lines meet lines of their own kind only: those of the kinds before meet where they met
            met = {pair: [*met[pair], *new] for pair, new in meet_lines(drives, more, untied).items()}
            # Further lines that do not agree leave what those before have tied
            adjusted = adjusted_drives(drives, path, lines, whole, met) or adjusted
        if adjusted is not None:
            untied = adjusted.untied_xy
            if adjusted.is_held:
                break
    for i in range(len(drives)):
        shutil.rmtree(_drive_folder(run, i), ignore_errors=True)
    if adjusted is None:
        return found_in_all(recordings)
    moved = _moved(recordings, adjusted, run, steps)
    found = found_in_all(moved)
    return replace(found, lines=with_common_sigma(found.lines, adjusted), drives=adjusted.accounted())


def adjusted_drives(
    drives: tuple[DriveSpan, ...],
    path: Trajectory,
    lines: Sequence[LineSet],
    whole: Sequence[DriveSpan] = (),
    met: MetLines | None = None,
) -> AdjustedDrives | None:
    """Return the correction that makes drives agree at their lines; None where they have no line in common.

    Parameters
    ----------
    drives
        Where they measured points.
    path
        Of all drives.
    lines
        Of each drive, found on its points alone.
    whole
        All drives of the path with all their poses, which are corrected too; none: `drives` are.
    met
        Where the lines meet (`meet_lines`); None: it is found.
    """
    correction, ties = None, DriveTies.empty()
    met = meet_lines(drives, lines) if met is None else met
    for reach_m in np.geomspace(FIRST_REACH_M, LAST_REACH_M, _N_ROUNDS).tolist():
        ties = tie_drives(drives, lines, met, correction, reach_m=reach_m)
        if not len(ties):
            return None
        correction = adjusted_path(whole or drives, path, ties)
    assert correction is not None
    return AdjustedDrives(drives, correction, ties, untied_places(drives, ties))


def _account(drives: tuple[DriveSpan, ...], correction: PathCorrection, ties: DriveTies) -> DrivesAccount:
    """Return how drives were corrected, and how far apart their lines were before and after."""
    left = ties.apart_m + np.sum(
        ties.normal * (correction.at(ties.other_s) - correction.at(ties.time_s)), axis=1
    )
    level = np.abs(ties.normal[:, 2]) < 0.5
    accounts = []
    for drive in drives:
        moved = correction.xyz_m[drive.holds(correction.knot_s)]
        time, normal = (
            np.concatenate(
                [v[drive.holds(at)] for at, v in zip((ties.time_s, ties.other_s), both, strict=True)]
            )
            for both in ((ties.time_s, ties.other_s), (ties.normal, ties.normal))
        )
        along = np.sqrt(np.einsum("ij,ijk,ik->i", normal, correction.covariance_at(time), normal))
        is_level = np.abs(normal[:, 2]) < 0.5
        accounts.append(
            DriveAccount(
                float(drive.time_s[0]), float(drive.time_s[-1]),
                len(time), (_rms(np.hypot(moved[:, 0], moved[:, 1])), _rms(moved[:, 2])),
                (_rms(along[is_level]), _rms(along[~is_level])),
            )
        )  # fmt: skip
    apart = [(_median_size(d[level]), _median_size(d[~level])) for d in (ties.apart_m, left)]
    return DrivesAccount(tuple(accounts), *apart)


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values**2))) if len(values) else 0.0


def _median_size(values: FloatArray) -> float:
    return float(np.median(np.abs(values))) if len(values) else 0.0


def with_common_sigma(lines: LineSet, adjusted: AdjustedDrives) -> LineSet:
    """Return lines with sigmas that hold the error which the drives over a place have in common."""
    if not len(lines):
        return lines
    ahead = np.concatenate([np.gradient(line.xyz[:, :2], axis=0) for line in lines])
    ahead /= np.maximum(np.linalg.norm(ahead, axis=1, keepdims=True), 1e-9)
    left = np.column_stack([-ahead[:, 1], ahead[:, 0]])
    total, n = np.zeros((len(lines.xyz), 2)), np.zeros(len(lines.xyz))
    for drive in adjusted.drives:
        time = drive.passing_s(lines.xyz[:, :2])
        here = np.flatnonzero(np.isfinite(time))
        covariance = adjusted.correction.covariance_at(time[here])
        across = np.einsum("ij,ijk,ik->i", left[here], covariance[:, :2, :2], left[here])
        total[here] += np.column_stack([across, covariance[:, 2, 2]])
        n[here] += 1.0
    common = np.sqrt(total / np.maximum(n, 1.0)[:, None])
    return lines.with_columns(
        sigma_xy_m=np.hypot(lines.sigma_xy_m, common[:, 0]), sigma_z_m=np.hypot(lines.sigma_z_m, common[:, 1])
    )


def _drive_folder(run: RunFolder, number: int) -> Path:
    """Return the folder of what is made of one drive."""
    return run.path / f"drive-{number}"


def _lines_of_drive(
    recordings: Recordings, drives: Sequence[DriveSpan], number: int, untied_xy: FloatArray | None,
    methods: Sequence[Method], run: RunFolder, what: str, found_in: Any, steps: RunSteps,
) -> LineSet:  # fmt: skip
    """Return the lines of one drive where others pass, around places without a tie; none where nothing can be looked at.

    untied_xy: (n, 2) [m, world], None: anywhere. what: is looked for.
    """
    folder, around = _drive_folder(run, number), ""
    whole = folder / "store"
    if untied_xy is not None:
        around = f"-around-{hashlib.sha256(untied_xy.tobytes()).hexdigest()[:16]}"
        folder = folder / around.removeprefix("-")
    name = f"drive-{number}-{what}{around}"
    done = _kept_lines(run, name)
    if done is not None:
        return done
    opened = recordings.points
    assert opened is not None
    if untied_xy is not None and whole.is_dir():
        # What lies around some places is among all of the drive's points that matter
        kept = PointStore.open(whole)
        opened = replace(opened, points=kept) if kept.n_points else opened
    change = partial(_own_points, drives, number, untied_xy)
    spans = [(other.start_s, other.end_s) for other in drives]
    of = f"drive {number} of {spans}{around}"
    own = changed_points(opened, folder / "store", change, of, steps, "separate drives", near_xy=untied_xy)
    lines = LineSet.empty(recordings.survey.crs)
    if own is not None:
        results = folder / f"tiles-{what}"
        results.mkdir(parents=True, exist_ok=True)
        journal = open_journal(folder / f"journal-{what}.sqlite")
        try:
            where = RunFolder(folder, results, journal, run.is_resumed)
            lines = found_in(replace(recordings, points=own, stereo=None), methods, where, None).lines
        except (InputError, PartialError):
            # What cannot be looked at is reported when all points are
            pass
        finally:
            journal.close()
    run.journal.enter(JournalEntry(name, write_part(lines, run.path / f"{name}.arrays"), {}))
    return lines


def _kept_lines(run: RunFolder, name: str) -> LineSet | None:
    """Return the lines of a drive that the run has found before, None if it has not."""
    entry = run.journal.done().get(name)
    return read_part(LineSet, run.path / f"{name}.arrays", entry.sha256) if entry is not None else None


def _own_points(
    drives: Sequence[DriveSpan], number: int, untied_xy: FloatArray | None, points: Points
) -> Points:
    """Return the points of one drive that may matter for lines that it has in common with others."""
    assert points.time_s is not None
    own = points.take(drives[number].holds(points.time_s))
    return own.take(may_tie(drives[number], drives, own.xyz[:, :2], untied_xy))


def _separate_points(
    recordings: Recordings, drives: Sequence[DriveSpan], what: str, run: RunFolder, steps: RunSteps
) -> None:
    """Write the points of each drive whose lines are still to be found: the survey is read once, not for each drive."""
    assert recordings.points is not None
    changes = {
        _drive_folder(run, i) / "store": partial(_own_points, drives, i, None)
        for i in range(len(drives))
        if _kept_lines(run, f"drive-{i}-{what}") is None
    }
    make_missing_stores(recordings.points.points, changes, steps, "separate drives")


def _moved(recordings: Recordings, adjusted: AdjustedDrives, run: RunFolder, steps: RunSteps) -> Recordings:
    """Return the recordings with their points, path and poses corrected."""
    correction, opened = adjusted.correction, recordings.points
    assert opened is not None and opened.trajectory is not None

    def change(points: Points) -> Points:
        assert points.time_s is not None
        return Points(points.xyz + correction.at(points.time_s), intensity=points.intensity, time_s=points.time_s,
                      crs=points.crs, columns=points.columns)  # fmt: skip

    what = hashlib.sha256(correction.knot_s.tobytes() + correction.xyz_m.tobytes()).hexdigest()
    path = correction.moved(opened.trajectory)
    points = changed_points(opened, run.path / "adjusted", change, what, steps, "move points")
    assert points is not None
    points = replace(points, trajectory=path, path_hash=hash_path(path), facts=replace(
        opened.facts, bounds=points.facts.bounds))  # fmt: skip
    stereo = recordings.stereo
    if stereo is not None:
        poses = stereo.poses
        stereo = replace(stereo, trajectory=correction.moved(stereo.trajectory),
                         poses=replace(poses, xyz=poses.xyz + correction.at(poses.time_s)))  # fmt: skip
    return replace(recordings, points=points, stereo=stereo)
