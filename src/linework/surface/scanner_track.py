"""Where the scanner was, from the points alone: on the road it stands over the densest place of every moment."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from linework.arrays import FloatArray
from linework.model.points import Points
from linework.model.trajectory import Trajectory

#: Points of so long belong to one place of the scanner: 0.5 m and more of them at walking pace and 5 turns a second,
#: 6 m at 100 km/h. [s]
MOMENT_S = 0.2
#: The place is sought among the points this near to the last estimate: a lane and a half. [m]
NEAR_M = (8.0, 4.0, 2.5, 2.5, 2.5)
#: Moments over which the places are smoothed: a van does not swerve within a second.
N_SMOOTH = 5
#: Farther from the van's origin no scanner looks down. [m]
FARTHEST_M = 5.0
#: A moment with fewer points on the road tells no place.
LEAST_POINTS = 30


def scanner_track(points: Points) -> Trajectory | None:
    """Return the scanner's track on the road's surface, or None where the points do not tell it.

    Parameters
    ----------
    points
        On the road, with times, in any order.

    Notes
    -----
    A scanner that turns evenly lays its points on the road the denser the nearer they are, as range and
    incidence both spread them: the densest place is under it. The median of the points of a moment, taken
    again and again among those near the last one, moves there from wherever the road's middle is.
    """
    if points.time_s is None or len(points) == 0:
        return None
    order = np.argsort(points.time_s, kind="stable")
    moment = np.floor(points.time_s[order] / MOMENT_S)
    xyz = points.xyz[order]
    starts = np.concatenate([[0], np.flatnonzero(np.diff(moment)) + 1, [len(moment)]])
    times, places = [], []
    for first, last in pairwise(starts.tolist()):
        if last - first >= LEAST_POINTS:
            times.append((moment[first] + 0.5) * MOMENT_S)
            places.append(_densest(xyz[first:last]))
    if len(times) < 2:
        return None
    time_s, place = np.array(times), np.array(places)
    smooth = [_running_median(time_s, column) for column in place.T]
    # Half a moment at either end, so that all points have their time on it
    ends = np.array([time_s[0] - MOMENT_S, *time_s, time_s[-1] + MOMENT_S])
    return Trajectory(ends, np.stack([np.concatenate([s[:1], s, s[-1:]]) for s in smooth], axis=-1))


def mounted(path: Trajectory, track: Trajectory | None) -> Trajectory:
    """Return the van's path moved to where the scanner's track usually is beside and behind it.

    Scanners look down some metres behind the vehicle's origin, and how far is seldom told. The median over
    the path is exact to a few centimetres where single moments of the track are not; beyond 5 m it is not
    believed.
    """
    if track is None:
        return path
    step = np.gradient(path.xyz[:, :2], axis=0)
    length = np.hypot(*step.T)
    ahead = step / np.maximum(length, 1e-9)[:, None]
    known = (path.time_s >= track.time_s[0]) & (path.time_s <= track.time_s[-1]) & (length > 1e-3)
    if not known.any():
        return path
    way = np.stack([np.interp(path.time_s, track.time_s, column) for column in track.xyz.T], axis=-1)
    off = (way - path.xyz)[known]
    along = float(np.median(np.sum(off[:, :2] * ahead[known], axis=1)))
    left = float(np.median(off[:, 1] * ahead[known, 0] - off[:, 0] * ahead[known, 1]))
    if np.hypot(along, left) > FARTHEST_M:
        return path
    xyz = path.xyz + np.column_stack([
        along * ahead[:, 0] - left * ahead[:, 1],
        along * ahead[:, 1] + left * ahead[:, 0],
        np.full(len(path), float(np.median(off[:, 2]))),
    ])  # fmt: skip
    return Trajectory(path.time_s, xyz)


def _densest(xyz: FloatArray) -> FloatArray:
    """Return the middle (3,) of the densest part of points (n, 3)."""
    place = np.median(xyz, axis=0)
    for near_m in NEAR_M:
        near = xyz[np.hypot(xyz[:, 0] - place[0], xyz[:, 1] - place[1]) <= near_m]
        if len(near) < LEAST_POINTS // 3:
            break
        place = np.median(near, axis=0)
    return np.asarray(place)


def _running_median(time_s: FloatArray, value: FloatArray) -> FloatArray:
    """Return values with each replaced by the mean of those about it in time, outliers left out."""
    out = np.empty(len(value))
    half = N_SMOOTH * MOMENT_S / 2.0
    for i, t in enumerate(time_s):
        near = value[np.abs(time_s - t) <= half + 1e-9]
        out[i] = np.mean(np.sort(near)[len(near) // 4 : len(near) - len(near) // 4])
    return out
