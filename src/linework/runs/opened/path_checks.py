"""Does a trajectory look like that of a van that recorded these points: its height, its poses, whether it moves.

What is odd is said and used all the same: the path decides where the road is looked for, and nothing else.
"""

from __future__ import annotations

import numpy as np

from linework.arrays import BoolArray, FloatArray, IntArray, distance_along
from linework.files.store.read import PointStore
from linework.model.grid import Bounds
from linework.model.trajectory import Trajectory

#: Height of a van's origin or sensor above the road it drives on: 0 to 5 m (trucks end at 4 m, a mast adds 1 m), and
#: 3 m on either side for fixes of a single receiver. [m]
_LOWEST_M, _HIGHEST_M = -3.0, 8.0
#: Places along the way where heights are compared: each costs a block of points, and half of them decide.
_N_PLACES = 12
#: Points within this distance in plan are those of the lane that the van is on. [m]
_LANE_M = 4.0
#: Share of these points that must lie where the road can be; the others are walls, trees, and roads above or below.
_ROAD_SHARE = 0.1
#: Fewest points that show a road.
_FEWEST_POINTS = 20
#: Quantile of the heights of points in the lane that is taken for the road.
_ROAD_QUANTILE = 0.1
#: Least share of places with a wrong height that is said, and least number.
_WRONG_SHARE, _WRONG_PLACES = 0.2, 3
#: Largest height of the geoid above or below the ellipsoid anywhere on earth (EGM2008: -107 to 86 m). [m]
_MOST_GEOID_M = 110.0
_FOOT_M = 0.3048

#: No road vehicle that measures is faster. [m/s]
_FASTEST_MPS = 70.0
#: No tyre holds more than the weight on it. [m/s2]
_MOST_MPS2 = 10.0
#: Poses with less than this beside the way, or less than ten times what is usual in the file, are noise. [m]
_LEAST_OFF_M, _TIMES_USUAL = 1.0, 10.0
#: A pose alone is as far off as its neighbours make it; those have half of it between theirs. A step has equal shares.
_ALONE = 1.5
#: Fixes without corrections move by this from one to the next. [m]
_LEAP_M = 5.0
#: A van whose poses all lie within this, over more than this, has not moved. [m], [s]
_STILL_M, _STILL_S = 1.0, 1.0


def odd_path(trajectory: Trajectory, store: PointStore) -> tuple[str, ...]:
    """Return what is odd about a path that came with some points, a line each, with the suspected cause."""
    return (*_still(trajectory), *_far_off(trajectory), *_heights(trajectory, store))


# The poses alone: what no van drives


def _still(path: Trajectory) -> list[str]:
    """Return a warning about a van that never moves."""
    extent = float(np.hypot(*np.ptp(path.xyz[:, :2], axis=0)))
    seconds = float(path.time_s[-1] - path.time_s[0])
    if extent >= _STILL_M or seconds < _STILL_S:
        return []
    return [
        f"the van never moves: all {len(path):,} poses of {seconds:.0f} s lie within {extent:.2f} m. Positions of another"
        " recording, or a column that is not filled? Without a way no line is followed along it: name another file"
    ]


def _far_off(path: Trajectory) -> list[str]:
    """Return warnings about single poses beside the way, and about leaps of it."""
    warnings = []
    off, alone = _alone(path)
    if len(alone):
        worst = alone[int(np.argmax(off[alone]))]
        more = "" if len(alone) == 1 else f", the farthest of {len(alone):,} such poses"
        warnings.append(
            f"the pose at {path.time_s[worst]:.3f} s is {off[worst]:,.1f} m off the way between those before and after"
            f" it{more}: a fix gone wrong? Leave its row out"
        )
    kept = np.delete(np.arange(len(path)), alone)
    time, xyz = path.time_s[kept], path.xyz[kept]
    steps, seconds = np.hypot(*np.diff(xyz[:, :2], axis=0).T), np.diff(time)
    speed = float(np.median(steps / seconds)) if len(steps) else 0.0
    if speed > _FASTEST_MPS:
        return [*warnings, f"the van drives at {speed:,.0f} m/s: are times or lengths in another unit?"]
    leaps = np.flatnonzero(steps > _FASTEST_MPS * seconds + _LEAP_M)
    if len(leaps):
        i = leaps[int(np.argmax(steps[leaps]))]
        more = "" if len(leaps) == 1 else f", the longest of {len(leaps):,} such leaps"
        warnings.append(
            f"the van leaps {steps[i]:,.1f} m within {seconds[i]:.3f} s after {time[i]:.3f} s{more}: lost fixes, or two drives"
            " in one file? Cut the file there"
        )
    return warnings


def _alone(path: Trajectory) -> tuple[FloatArray, IntArray]:
    """Return the distance [m] of each pose from the way between its neighbours, and the poses that alone are off."""
    n = len(path)
    off = np.zeros(n)
    if n < 3:
        return off, np.zeros(0, np.int64)
    before, after = np.diff(path.time_s)[:-1], np.diff(path.time_s)[1:]
    share = (before / (before + after))[:, None]
    way = path.xyz[:-2] + share * (path.xyz[2:] - path.xyz[:-2])
    off[1:-1] = np.linalg.norm(path.xyz[1:-1] - way, axis=1)
    limit = np.full(n, np.inf)
    noise = max(_LEAST_OFF_M, _TIMES_USUAL * float(np.median(off[1:-1])))
    limit[1:-1] = 0.5 * _MOST_MPS2 * before * after + noise
    beside = np.maximum(np.concatenate([[0.0], off[:-1]]), np.concatenate([off[1:], [0.0]]))
    return off, np.flatnonzero((off > limit) & (off > _ALONE * beside))


# The poses above the points


def _heights(path: Trajectory, store: PointStore) -> list[str]:
    """Return a warning where the van is not on the road that the points show, with the likely cause."""
    at, road_m, on_road = _roads(path, store)
    wrong = ~on_road
    n_wrong = int(np.count_nonzero(wrong))
    if n_wrong < max(_WRONG_PLACES, _WRONG_SHARE * len(at)):
        return []
    van_m = path.xyz[at, 2]
    above = van_m - road_m
    if 2 * n_wrong <= len(at):
        times = path.time_s[at[wrong]]
        return [
            f"the van is {_above(above[wrong])} the points at {n_wrong} of {len(at)} places looked at, from {times[0]:.1f} to"
            f" {times[-1]:.1f} s: heights of fixes that are not good enough there? Leave these poses out"
        ]
    median = float(np.median(above))
    return [f"the van is {_above(above)} the points along the way: {_cause(van_m, road_m, median)}"]


def _roads(path: Trajectory, store: PointStore) -> tuple[IntArray, FloatArray, BoolArray]:
    """Return some poses with points around, the height of the road there [m], and whether the van can be on it."""
    way = distance_along(path.xyz)
    # Four times as many as are needed: the van may be where no points are
    wanted = np.linspace(0.0, way[-1], 4 * _N_PLACES + 2)[1:-1]
    tried = np.unique(np.minimum(np.searchsorted(way, wanted), len(path) - 1))
    boxes = [_lane(path, i) for i in tried.tolist()]
    full = np.flatnonzero([store.count_in(box) >= _FEWEST_POINTS for box in boxes])
    chosen = full[np.unique(np.linspace(0, len(full) - 1, min(_N_PLACES, len(full))).astype(int))]
    margin = 0.0
    if path.sigma_xyz_m is not None:
        margin = max(0.0, 3.0 * float(np.median(path.sigma_xyz_m[:, 2])) - abs(_LOWEST_M))
    at, road, on_road = list[int](), list[float](), list[bool]()
    for i in chosen.tolist():
        points = store.points(
            boxes[i], ordered=False, with_time=False, with_intensity=False, with_columns=False
        )
        if len(points) < _FEWEST_POINTS:
            continue
        above = path.xyz[tried[i], 2] - points.xyz[:, 2]
        can_be = (above >= _LOWEST_M - margin) & (above <= _HIGHEST_M + margin)
        at.append(int(tried[i]))
        road.append(float(np.quantile(points.xyz[:, 2], _ROAD_QUANTILE)))
        on_road.append(float(np.mean(can_be)) >= _ROAD_SHARE)
    return np.array(at, np.int64), np.array(road), np.array(on_road, np.bool_)


def _lane(path: Trajectory, i: int) -> Bounds:
    east, north = path.xyz[i, :2].tolist()
    return Bounds(east, north, east, north).grown(_LANE_M)


def _above(above: FloatArray) -> str:
    median = float(np.median(above))
    return f"{abs(median):,.1f} m {'above' if median >= 0.0 else 'below'}"


def _cause(van_m: FloatArray, road_m: FloatArray, above_m: float) -> str:
    """Return what the heights of a van and of the road below it suggest, and what to do."""
    causes = []
    for factor, whose in ((_FOOT_M, "the trajectory's"), (1.0 / _FOOT_M, "the points'")):
        left = van_m * factor - road_m if factor < 1.0 else van_m - road_m * _FOOT_M
        if _LOWEST_M <= float(np.median(left)) <= _HIGHEST_M:
            causes.append(f"are {whose} heights in feet? Convert them to metres")
    if abs(above_m) <= _MOST_GEOID_M:
        causes.append(
            "are heights above the ellipsoid mixed with heights above sea level? Convert those of one, or set [heights] geoid"
            " for files of latitudes and longitudes"
        )
    return ", or ".join(
        causes or ["do they have the same vertical datum and unit? Check the heights of both"]
    )
