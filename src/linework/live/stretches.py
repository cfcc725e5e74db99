"""Lines of a drive, stretch by stretch: each is joined once its pairs are complete, so that memory stays the same.

Separate from `drive`, because it knows nothing of files and clocks: pairs with their poses come in, lines go out.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from linework.arrays import FloatArray, distance_along
from linework.lines.along import line_stretch, runs_of
from linework.methods.protocol import Method, SurveyContext
from linework.model.camera import RectifiedRig
from linework.model.images import Poses
from linework.model.lines import LineSet
from linework.model.sightings import Sightings

#: Length of a stretch: two seconds of joining at most, and half a minute of driving in a town. [m]
LIVE_STRETCH_M = 250.0
#: Distance ahead within which pairs show paint: beyond it a pixel is more than half a metre of road. [m]
AHEAD_M = 40.0
#: Distance driven between two pairs whose sightings are joined: a van that stands takes the same picture again. [m]
LEAST_DRIVEN_M = 0.5
#: Shortest piece of a line that is kept where a stretch is cut. [m]
_LEAST_PIECE_M = 0.5
#: Spacing of the path that places along it are looked up in. [m]
_PATH_STEP_M = 1.0


@dataclass(frozen=True, slots=True)
class PlacedPair:
    """A pair with its place.

    Parameters
    ----------
    number, time_s
        As in `ImagePair`.
    pose
        One row.
    chainage_m
        Distance driven. [m]
    sightings
        In the vehicle frame; None where it was not looked at.
    """

    number: int
    time_s: float
    pose: Poses
    chainage_m: float
    sightings: Sightings | None


class Stretches:
    """The pairs of the stretch that is being driven, and of as much before it as they see of it.

    Parameters
    ----------
    from_m
        Chainage of the start of the first stretch. [m]

    Notes
    -----
    Lines are cut at the ends of stretches, across the path; `linework extract` joins them over the whole survey.
    """

    def __init__(self, method: Method, rig: RectifiedRig, *, from_m: float = 0.0) -> None:
        self._method, self._rig = method, rig
        self._pairs: deque[PlacedPair] = deque()
        #: Chainage of the start of the open stretch. [m]
        self.from_m = from_m

    def __len__(self) -> int:
        return len(self._pairs)

    def add(self, pair: PlacedPair) -> None:
        """Add a pair that shows lines, in any order; one at the place of the last one is left out."""
        if pair.sightings is None or pair.chainage_m < self.from_m - AHEAD_M:
            return
        if self._pairs and abs(pair.chainage_m - self._pairs[-1].chainage_m) < LEAST_DRIVEN_M:
            return
        is_late = bool(self._pairs) and pair.time_s < self._pairs[-1].time_s
        self._pairs.append(pair)
        if is_late:
            self._pairs = deque(sorted(self._pairs, key=lambda one: one.time_s))

    @property
    def is_complete(self) -> bool:
        """Whether all pairs are there that show the open stretch."""
        return bool(self._pairs) and self._pairs[-1].chainage_m >= self.from_m + LIVE_STRETCH_M

    def completed(self) -> LineSet:
        """Return the lines of the open stretch, which is closed: the next one begins at its end."""
        until = self.from_m + LIVE_STRETCH_M
        lines = self.lines(until)
        # After a stretch that was driven without pairs, the next one begins where they are
        self.from_m = max(until, self._pairs[-1].chainage_m - LIVE_STRETCH_M)
        while self._pairs and self._pairs[0].chainage_m < self.from_m - AHEAD_M:
            self._pairs.popleft()
        return lines

    def lines(self, until_m: float = np.inf) -> LineSet:
        """Return the lines of the open stretch so far, up to a chainage [m]."""
        pairs = list(self._pairs)
        if len(pairs) < 2:
            return LineSet.empty()
        sightings = Sightings.concatenate(
            found.with_pair(i) for i, pair in enumerate(pairs) if (found := pair.sightings) is not None
        )
        poses = Poses.concatenate([pair.pose for pair in pairs])
        lines = self._method.join(sightings, SurveyContext(poses=poses, rig=self._rig))
        path = np.column_stack([poses.xyz[:, :2], [pair.chainage_m for pair in pairs]])
        return _between(lines, path, self.from_m, until_m)


def _between(lines: LineSet, path: FloatArray, from_m: float, until_m: float) -> LineSet:
    """Return the parts of lines between two chainages of a path.

    Parameters
    ----------
    path
        (n, 3) east, north and chainage along the drive. [m]
    """
    if len(lines) == 0:
        return lines
    along = _chainages(lines.xyz[:, :2], path)
    parts = []
    for i in range(len(lines)):
        line, own = lines.take([i]), slice(*lines.offsets[i : i + 2].tolist())
        at, inside = along[own], (along[own] >= from_m) & (along[own] < until_m)
        if inside.all():
            parts.append(line)
            continue
        way = distance_along(line.xyz[:, :2], in_space=True)
        for first, last in runs_of(inside):
            start = way[first] if first == 0 else _crossing(at, way, first - 1, from_m, until_m)
            end = way[last] if last == len(at) - 1 else _crossing(at, way, last, from_m, until_m)
            if end - start >= _LEAST_PIECE_M:
                parts.append(line_stretch(line, start, end))
    return LineSet.concatenate(parts) if parts else lines.take(np.zeros(0, dtype=np.int64))


def _crossing(at: FloatArray, way: FloatArray, i: int, from_m: float, until_m: float) -> float:
    """Return the distance along a line at which it crosses an end of the stretch between its vertices i and i + 1."""
    low, high = sorted((float(at[i]), float(at[i + 1])))
    edge = from_m if low < from_m <= high else until_m
    share = (edge - at[i]) / (at[i + 1] - at[i]) if at[i + 1] != at[i] else 0.5
    return float(way[i] + np.clip(share, 0.0, 1.0) * (way[i + 1] - way[i]))


def _chainages(xy: FloatArray, path: FloatArray) -> FloatArray:
    """Return the chainage (n,) of positions (n, 2) beside a path (m, 3), also some way beyond its ends. [m]."""
    ends = path[[0, -1]]
    before, after = _direction(path[:2]), _direction(path[-2:])
    longer = np.concatenate([ends[:1] - 2.0 * AHEAD_M * before, path, ends[1:] + 2.0 * AHEAD_M * after])
    way = distance_along(longer[:, :2])
    at = np.arange(0.0, way[-1], _PATH_STEP_M)
    fine = np.stack([np.interp(at, way, column) for column in longer.T], axis=1)
    origin = fine[0, :2]
    _, nearest = cKDTree(fine[:, :2] - origin).query(xy - origin)
    ahead = np.gradient(fine[:, :2], axis=0)
    ahead /= np.maximum(np.hypot(*ahead.T), 1e-9)[:, None]
    beyond = np.sum((xy - fine[nearest, :2]) * ahead[nearest], axis=1)
    return np.asarray(fine[nearest, 2] + np.clip(beyond, -_PATH_STEP_M, _PATH_STEP_M))


def _direction(two: FloatArray) -> FloatArray:
    """Return the step in plan and chainage (3,) for a metre along two places (2, 3)."""
    step = two[1] - two[0]
    return np.asarray(step / max(float(np.hypot(*step[:2])), 1e-6))
