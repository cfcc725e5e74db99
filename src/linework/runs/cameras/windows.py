"""Windows of stereo pairs in which corners are followed: chosen over the survey, then read pair by pair.

Separate from `calibrate`, which knows calibrations and reports; this knows pairs and poses.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from linework.arrays import AnyArray, FloatArray, IntArray
from linework.errors import InputError
from linework.files.images.read import read_pair
from linework.imaging.calibration.bundle import CornerWindow
from linework.imaging.calibration.corners import CornerTracks, follow_corners
from linework.model.images import Poses
from linework.model.trajectory import Trajectory
from linework.navigation.poses import poses_at
from linework.runs.opened.pairs import OpenedStereo
from linework.runs.steps import Advance

#: Pairs of a window: the path of a van is then known to a tenth of a degree where its positions are to 2 cm, and corners
#: at 30 m are seen from the first to the last.
_N_PAIRS = 6
#: Most windows, and how many of them are where the van turns most; the others are spread evenly. [windows]
_MOST_WINDOWS, _TURNING = 16, 8
#: Pairs of a window are so far apart, at least and at most: nearer ones tell little, and farther ones show other corners.
#: [m]
_APART_M = (0.5, 6.0)
#: Longest time between two pairs of a window. [s]
_LONGEST_S = 2.0
#: Images may be late or early by so much: their poses are within the trajectory all the same. [s]
_MARGIN_S = 0.1
#: Path that is kept around a window: clocks are off by less. [s]
_AROUND_S = 1.0


@dataclass(frozen=True, slots=True)
class FollowedWindows:
    """Windows with their corners, and what could not be read, one line each."""

    windows: tuple[CornerWindow, ...]
    warnings: tuple[str, ...] = ()


def corner_windows_of(stereo: OpenedStereo) -> list[IntArray]:
    """Return the windows of a survey as indices of its pairs, in time order.

    Raises
    ------
    InputError
        The van does not move, or its pairs are too far apart.
    """
    poses, time_s = stereo.poses, stereo.poses.time_s
    first, last = stereo.trajectory.time_s[[0, -1]]
    usable = np.flatnonzero((time_s >= first + _MARGIN_S) & (time_s <= last - _MARGIN_S))
    found: list[list[int]] = []
    now: list[int] = []
    for i in usable.tolist():
        if now:
            moved = float(np.linalg.norm(poses.xyz[i] - poses.xyz[now[-1]]))
            waited = time_s[i] - time_s[now[-1]]
            if moved < _APART_M[0] and waited <= _LONGEST_S:
                continue
            if moved > _APART_M[1] or waited > _LONGEST_S or moved < _APART_M[0]:
                now = []
        now.append(i)
        if len(now) == _N_PAIRS:
            found.append(now)
            now = []
    if not found:
        raise InputError(
            f"no {_N_PAIRS} pairs in a row that are {_APART_M[0]:g} to {_APART_M[1]:g} m apart: cameras are calibrated"
            " by what they see while the van moves", where=stereo.survey.name,
            advice="use a survey with more images of a moving van",
        )  # fmt: skip
    windows = [np.array(window, dtype=np.int64) for window in found]
    return [windows[i] for i in _picked(_turns(poses, windows))]


def _turns(poses: Poses, windows: Sequence[IntArray]) -> FloatArray:
    """Return by how much the van turns in each window, (n,) [rad]."""
    ahead = [poses.R_world_vehicle[window[[0, -1]], :2, 0] for window in windows]
    return np.array([abs(np.arctan2(a[0] * b[1] - a[1] * b[0], a @ b)) for a, b in ahead])


def _picked(turn_rad: FloatArray) -> list[int]:
    """Return the windows that are used, in order: spread evenly, and of the others those that turn most."""
    n = len(turn_rad)
    if n <= _MOST_WINDOWS:
        return list(range(n))
    even = np.unique(np.linspace(0, n - 1, _MOST_WINDOWS - _TURNING).round().astype(int))
    others = np.setdiff1d(np.arange(n), even)
    turning = others[np.argsort(-turn_rad[others], kind="stable")][: _MOST_WINDOWS - len(even)]
    return sorted([*even.tolist(), *turning.tolist()])


def followed(stereo: OpenedStereo, advance: Advance) -> FollowedWindows:
    """Return the windows of a survey with the corners followed in them; two pairs are held at a time.

    Raises
    ------
    InputError
        As for `corner_windows_of`, or no image can be read.
    """
    windows, warnings = [], []
    chosen = corner_windows_of(stereo)
    for done, window in enumerate(chosen):
        advance(done, len(chosen))
        try:
            tracks = _tracks_of(stereo, window)
        except InputError as error:
            warnings.append(str(error))
            continue
        windows.append(CornerWindow(tracks, _Moving.of(stereo.trajectory, stereo.poses.time_s[window])))
    advance(len(chosen), len(chosen))
    if not windows:
        raise InputError(f"no window of pairs can be read: {warnings[0].rstrip('.')}", where=stereo.survey.name,
                         advice="see the images with linework info")  # fmt: skip
    return FollowedWindows(tuple(windows), tuple(warnings))


def _tracks_of(stereo: OpenedStereo, window: IntArray) -> CornerTracks:
    def images() -> Iterator[tuple[AnyArray, AnyArray]]:
        for i in window.tolist():
            yield read_pair(stereo.pairs[i], stereo.series.rig)

    return follow_corners(images(), stereo.rectifier, stereo.series.rig, stereo.poses.take(window))


@dataclass(frozen=True, slots=True)
class _Moving:
    """Poses of the pairs of a window, if they were taken later than their times say; the path around the window."""

    path: Trajectory
    time_s: FloatArray

    @staticmethod
    def of(path: Trajectory, time_s: FloatArray) -> _Moving:
        first, last = np.searchsorted(path.time_s, [time_s[0] - _AROUND_S, time_s[-1] + _AROUND_S])
        # A pose beyond each end, where poses are farther apart than that
        return _Moving(path.take(slice(max(int(first) - 1, 0), int(last) + 1)), time_s)

    def __call__(self, later_s: float) -> Poses:
        known_s = self.path.time_s
        return poses_at(self.path, np.clip(self.time_s + later_s, known_s[0], known_s[-1]))
