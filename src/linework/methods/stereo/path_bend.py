"""How the road bends, as the van's own path shows it: lines along the road bend with it."""

from __future__ import annotations

import numpy as np

from linework.arrays import FloatArray
from linework.methods.stereo.edge_state import CURVATURE, LineState

#: A line within this of the path's direction runs along the road. [rad]
_ALONG_RAD = np.radians(15.0)
#: The path's curvature is taken over this to either side. [m]
_OVER_M = 6.0
#: A driver's path bends as the lines do, to this. [1/m]
_SIGMA = 0.005
#: Farther from the path a line belongs to another road. [m]
_FAR_M = 12.0
#: So far ahead of where the images end the road still goes about the path's way. [m]
_AHEAD_M = 25.0


def path_heading(place: FloatArray, path: FloatArray) -> float | None:
    """Return the direction of the path beside a place, None where there is none near it. [rad]

    Parameters
    ----------
    place
        (3,) [m].
    path
        (n, 3) places of the van in time order. [m]
    """  # noqa: D400
    away = np.hypot(*(path[:, :2] - place[:2]).T)
    i = int(np.argmin(away))
    near = path[np.abs(np.hypot(*(path[:, :2] - path[i, :2]).T)) <= _OVER_M]
    way = near[-1, :2] - near[0, :2]
    if away[i] > _AHEAD_M or np.hypot(*way) < 0.1 * _OVER_M:
        return None
    return float(np.arctan2(way[1], way[0]))


def bent_like_path(state: LineState, path: FloatArray) -> LineState:
    """Return a line's start with the curvature of the path beside it, where it runs along the path.

    Parameters
    ----------
    path
        (n, 3) places of the van in time order. [m, as the state's]
    """
    step = np.hypot(*np.diff(path[:, :2], axis=0).T)
    path = path[np.concatenate([[True], step > 0.1])]
    if len(path) < 3:
        return state
    t = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(path[:, :2], axis=0).T))])
    i = int(np.argmin(np.hypot(*(path[:, :2] - state.place[:2]).T)))
    low, high = t[i] - _OVER_M, t[i] + _OVER_M
    if low < t[0] or high > t[-1] or np.hypot(*(path[i] - state.place)[:2]) > _FAR_M:
        return state
    at = np.linspace(low, high, 5)
    xy = np.column_stack([np.interp(at, t, c) for c in path[:, :2].T])
    heading = np.unwrap(np.arctan2(*np.diff(xy, axis=0).T[::-1]))
    apart = float(np.angle(np.exp(1j * (state.heading_rad - 0.5 * (heading[1] + heading[2])))))
    way = 1.0 if abs(apart) < 0.5 * np.pi else -1.0
    if min(abs(apart), np.pi - abs(apart)) > _ALONG_RAD:
        return state
    bend = float(heading[3] - heading[0]) / float(at[3] - at[0])
    # Lines beside the path are its parallels: shorter and sharper inside of the bend
    middle = 0.5 * (heading[1] + heading[2])
    left_m = float((state.place - path[i])[:2] @ np.array([-np.sin(middle), np.cos(middle)]))
    curvature = way * bend / max(1.0 - bend * left_m, 0.2)
    covariance = state.covariance.copy()
    covariance[CURVATURE, CURVATURE] = _SIGMA**2
    return LineState(state.place, state.heading_rad, curvature, state.grade, covariance)
