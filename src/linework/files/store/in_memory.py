"""Read the points and the trajectory of a survey into memory, and check that they fit together."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from linework.arrays import FloatArray
from linework.errors import InputError, MachineError
from linework.files.las.tally import TimeKind
from linework.files.logs.clock import WEEK_S, known_offsets
from linework.files.store.build import FEW_POINTS, FEW_SHARE, build_store
from linework.files.store.facts import FileFacts as FileFacts
from linework.files.store.facts import StoreFacts
from linework.files.store.read import PointStore
from linework.model.points import Points
from linework.model.survey import Survey
from linework.model.trajectory import Trajectory
from linework.processes.forced_end import removed_if_forced

_FOOT_M = 0.3048
#: Largest distance between van and points [m]: scanners reach some 300 m; more means another place or CRS.
_MAX_APART_M = 1000.0
#: A gap in the trajectory: no poses for longer than this [s] and than this many median intervals.
_LEAST_HOLE_S, _HOLE_STEPS = 2.0, 10.0
#: Epoch as a survey.toml names it, by the kind of the points' times.
EPOCH_OF_KIND: dict[TimeKind, str] = {
    "week": "gps_week",
    "adjusted": "gps_adjusted",
    "gps": "gps",
    "none": "",
}


@dataclass(frozen=True, slots=True)
class SurveyPoints:
    """All points of a survey, in the tile store's order, and the facts about its files."""

    points: Points
    facts: StoreFacts

    @property
    def rejected(self) -> Mapping[str, int]:
        """Number of points left out, by reason."""
        return self.facts.rejected

    @property
    def warnings(self) -> tuple[str, ...]:
        """Warnings, one line each, starting with the file name."""
        return self.facts.warnings

    @property
    def files(self) -> tuple[FileFacts, ...]:
        """Facts about the files."""
        return self.facts.files

    @property
    def gps_time_kind(self) -> TimeKind:
        """Kind of GPS time of the points."""
        return self.facts.gps_time_kind

    @property
    def failures(self) -> tuple[tuple[Path, str], ...]:
        """(file, error message) of files that could not be used."""
        return self.facts.failures


def read_survey_points(survey: Survey, *, progress: Callable[[int, int], None] | None = None) -> SurveyPoints:
    """Read the points of all files; damaged files among good ones are left out and listed.

    Parameters
    ----------
    progress
        Called with the number of points read so far, over all files, and the number that they promise.

    Raises
    ------
    InputError, CrsError, MachineError
        As for `build_store`.

    Notes
    -----
    The points go through a tile store in a temporary folder: their order is the store's, whatever the order
    in the files, and their coordinates are on its lattice of 0.1 mm.
    """
    with tempfile.TemporaryDirectory(prefix="linework-") as name, removed_if_forced(Path(name)):
        folder = Path(name)
        facts = build_store(survey, folder, n_threads=os.cpu_count() or 1, progress=progress)
        points = PointStore.open(folder).points(with_time=facts.has_time, with_intensity=facts.has_intensity)
    if len(points) != facts.n_points:
        raise MachineError(
            f"only {len(points):,} of {facts.n_points:,} points could be read back from the disk", where=name,
            advice="check the disk",
        )  # fmt: skip
    return SurveyPoints(points, facts)


def check_trajectory_covers(
    trajectory: Trajectory, facts: StoreFacts, *, where: object = None
) -> tuple[str, ...]:
    """Compare the place and time of the trajectory with those of the points.

    Returns
    -------
    tuple of str
        Warnings about points outside the time span of the trajectory or in its gaps, with the known clock offset
        (such as UTC taken for GPS time) that would explain them.

    Raises
    ------
    InputError
        They are more than 1 km apart, or have no time in common. The message gives both extents.
    """
    driven, bounds = _extent(trajectory.xyz), facts.bounds
    scanned = np.array([bounds.west, bounds.south]), np.array([bounds.east, bounds.north])
    apart = np.maximum(np.maximum(driven[0] - scanned[1], scanned[0] - driven[1]), 0.0)
    if float(np.hypot(*apart)) > _MAX_APART_M:
        raise InputError(
            f"trajectory and points are {float(np.hypot(*apart)) / 1000.0:,.1f} km apart: east {_range(driven, 0)},"
            f" north {_range(driven, 1)} against east {_range(scanned, 0)}, north {_range(scanned, 1)}"
            f"{_named_unit(driven, scanned)}",
            where=where,
            advice="check that both are in the same CRS, with east before north",
        )
    if not facts.has_time:
        return ()
    start, end = float(trajectory.time_s[0]), float(trajectory.time_s[-1])
    share = _share_covered(facts, start, end)
    spans = (
        f"trajectory from {start:.1f} to {end:.1f} s, points from {facts.times.low_s:.1f} to"
        f" {facts.times.high_s:.1f} s"
    )
    if share == 0.0:
        raise InputError(f"{spans}: no common time{_named_offset(facts, start, end)}", where=where,
                         advice="check the epochs (GPS week seconds, adjusted, unix)")  # fmt: skip
    holes = _in_holes(trajectory, facts)
    outside = 1.0 - share
    if outside <= FEW_SHARE and outside * facts.n_points <= FEW_POINTS:
        return holes
    return (
        *holes,
        f"{100.0 * outside:.2g} % of the points are outside the trajectory's time"
        f" ({spans}){_named_offset(facts, start, end)}",
    )


def _share_covered(facts: StoreFacts, start_s: float, end_s: float) -> float:
    """Return the share of the points within the trajectory's time; GPS week seconds of the points restart at 0."""
    share = facts.times.share_within(start_s, end_s)
    if facts.gps_time_kind == "week" and end_s > WEEK_S:
        share += facts.times.share_within(0.0, end_s - WEEK_S)
    return share


def _in_holes(trajectory: Trajectory, facts: StoreFacts) -> tuple[str, ...]:
    """Return a warning about points measured while the trajectory has no poses."""
    steps = np.diff(trajectory.time_s)
    holes = np.flatnonzero(steps > max(_LEAST_HOLE_S, _HOLE_STEPS * float(np.median(steps))))
    spans = [(float(trajectory.time_s[i]), float(trajectory.time_s[i + 1])) for i in holes]
    share = sum(facts.times.share_in_gap(a, b) for a, b in spans)
    if share <= 0.0:
        return ()
    start, end = max(spans, key=lambda span: span[1] - span[0])
    where = "a gap" if len(spans) == 1 else f"{len(spans)} gaps"
    longest = "" if len(spans) == 1 else "the longest "
    return (
        f"{100.0 * share:.2g} % of the points are in {where} of the trajectory, {longest}from {start:.1f}"
        f" to {end:.1f} s: a straight path is assumed there",
    )


def _named_unit(driven: tuple[FloatArray, FloatArray], scanned: tuple[FloatArray, FloatArray]) -> str:
    """Return which of trajectory and points would meet the other if it were in feet, as text; "" if neither."""
    for what, feet, metres in (("the trajectory is", driven, scanned), ("the points are", scanned, driven)):
        low, high = feet[0] * _FOOT_M, feet[1] * _FOOT_M
        apart = np.maximum(np.maximum(low - metres[1], metres[0] - high), 0.0)
        if float(np.hypot(*apart)) <= _MAX_APART_M:
            return f"; they meet if {what} in feet"
    return ""


def _named_offset(facts: StoreFacts, start_s: float, end_s: float) -> str:
    """Return the known difference of clocks that brings the points into the trajectory's time, if any."""
    epoch = EPOCH_OF_KIND[facts.gps_time_kind]
    overhang = max(start_s - facts.times.low_s, facts.times.high_s - end_s)
    for offset, name in known_offsets(facts.times.low_s, epoch):
        # The trajectory starts before the points, so the overhang is smaller than the offset, but rarely by half
        if abs(offset) <= 2.0 * overhang and _share_covered(facts, start_s - offset, end_s - offset) > 0.999:
            return f"; {-offset:+.0f} s added to the times of the trajectory would make them fit: {name}?"
    return ""


def _extent(xyz: FloatArray) -> tuple[FloatArray, FloatArray]:
    # Column by column: ten times as fast as min(axis=0) of the whole array
    east, north = xyz[:, 0], xyz[:, 1]
    return np.array([east.min(), north.min()]), np.array([east.max(), north.max()])


def _range(extent: tuple[FloatArray, FloatArray], axis: int) -> str:
    return f"{extent[0][axis]:.0f} to {extent[1][axis]:.0f}"
