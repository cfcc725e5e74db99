"""Does a trajectory look like that of a van that recorded these points: its height, its poses, whether it moves.

What is odd is said and used all the same: the path decides where the road is looked for, and nothing else.
"""

from __future__ import annotations

import numpy as np

from linework.arrays import FloatArray
from linework.files.store.read import PointStore
from linework.model.grid import Bounds
from linework.model.trajectory import Trajectory

#: Height of a vehicle's origin above the road: from the contact of its wheels, less two metres of error of a poor fix,
#: to the roof of a lorry with a mast. [m]
_LOWEST_M, _HIGHEST_M = -2.0, 6.0
#: The ellipsoid and the geoid are at most so far apart (EGM2008: -107 to 86 m). [m]
_MOST_UNDULATION_M = 110.0
_FOOT_M = 0.3048
#: Lower roads do not tell feet from metres: 20 m are 65 feet. [m]
_LEAST_TOLD_FEET_M = 20.0
#: Places along the path where the height is looked at, half the width of the square of points there [m], and the least
#: number of points that show the ground.
_PLACES, _REACH_M, _FEW = 40, 4.0, 20
#: A pose leaves the straight line between its neighbours by the acceleration of an emergency stop, 1 g, and by the noise
#: of a poor fix. [m/s^2], [m]
_MOST_ACCELERATION, _FIX_NOISE_M = 9.81, 1.0
#: A path that stays within this for longer than this is that of a van at rest, or of no van. [m], [s]
_REST_M, _REST_S = 2.0, 10.0


def odd_path(trajectory: Trajectory, store: PointStore) -> tuple[str, ...]:
    """Return what is odd about a path that came with some points, a line each, with the suspected cause."""
    found = (_odd_height(trajectory, store), _odd_poses(trajectory), _rest(trajectory))
    return tuple(text for text in found if text)


def _odd_height(trajectory: Trajectory, store: PointStore) -> str:
    """Compare the heights of the path with those of the lowest points around it."""
    at = np.unique(np.linspace(0, len(trajectory) - 1, _PLACES).astype(np.int64))
    above, ground = [], []
    for east, north, height in trajectory.xyz[at].tolist():
        near = Bounds(east - _REACH_M, north - _REACH_M, east + _REACH_M, north + _REACH_M)
        heights = store.points(near, with_time=False, with_intensity=False, with_columns=False).xyz[:, 2]
        if len(heights) >= _FEW:
            ground.append(float(np.percentile(heights, 10.0)))
            above.append(height - ground[-1])
    if not above:
        return ""
    middle, level = float(np.median(above)), float(np.median(ground))
    if _LOWEST_M <= middle <= _HIGHEST_M:
        return ""
    text = (
        f"the path runs {abs(middle):.1f} m {'above' if middle > 0 else 'below'} the lowest points around it"
        f" ({len(above)} places)"
    )
    feet = (level + middle) * _FOOT_M - level
    if abs(level) >= _LEAST_TOLD_FEET_M and _LOWEST_M <= feet <= _HIGHEST_M:
        return f"{text}: are its heights in feet?"
    if abs(middle) <= _MOST_UNDULATION_M:
        return f"{text}: are its heights above the ellipsoid, and those of the points above sea level, or the reverse? See [heights] in the survey.toml"
    return f"{text}: is it the path of this survey?"


def _odd_poses(trajectory: Trajectory) -> str:
    """Look for single poses that lie off the line between their neighbours."""
    if len(trajectory) < 3:
        return ""
    time, xyz = trajectory.time_s, trajectory.xyz
    before, after = np.diff(time)[:-1], np.diff(time)[1:]
    share = (before / (before + after))[:, np.newaxis]
    off = _lengths(xyz[1:-1] - (1.0 - share) * xyz[:-2] - share * xyz[2:])
    limit = _FIX_NOISE_M + 0.5 * _MOST_ACCELERATION * before * after
    beside = np.maximum(np.append(off[1:], 0.0), np.insert(off[:-1], 0, 0.0))
    # The neighbours of such a pose are off by half of it
    odd = np.flatnonzero((off > limit) & (off >= beside))
    if not len(odd):
        return ""
    worst = int(odd[np.argmax(off[odd])])
    n = f"{len(odd)} of {len(trajectory):,} poses lie" if len(odd) > 1 else "a pose lies"
    return (
        f"{n} off the line between the two beside, that at {time[worst + 1]:.2f} s by {off[worst]:.1f} m, more than a van"
        " can brake or turn: leave such poses out"
    )


def _rest(trajectory: Trajectory) -> str:
    """Look for a path that stays in one place."""
    extent = float(np.hypot(*np.ptp(trajectory.xyz[:, :2], axis=0)))
    span = float(trajectory.time_s[-1] - trajectory.time_s[0])
    if extent > _REST_M or span <= _REST_S:
        return ""
    return f"the path stays within {extent:.1f} m for {span:.0f} s: is it that of a van at rest, or of another sensor?"


def _lengths(vectors: FloatArray) -> FloatArray:
    lengths: FloatArray = np.sqrt(np.einsum("ij,ij->i", vectors, vectors))
    return lengths
