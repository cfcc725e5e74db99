"""State of a line and the Kalman filter along it in object space, with the curvature of the van's path as a start."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from linework.arrays import FloatArray, distance_along
from linework.methods.picked_edge.match import ExpectedPlace

#: Spectral density of the random walk of the curvature: roads bend to radii of 18 m, within one or two lengths of a car
#: where a kerb turns into a side street, more slowly on the open road. [1/m^3]
BENDING = 5e-6
#: Spectral density of the random walk of the grade: crests and sags of some hundred metres' radius, and ramps. [1/m]
GRADING = 3e-5
#: Largest curvature: a road of 18 m radius, at its inner kerb. [1/m]
MOST_CURVATURE = 1.0 / 12.0
#: Rows of the state and its covariance: across to the left [m], heading [rad], curvature [1/m], height [m], grade.
STATE_ACROSS, STATE_HEADING, CURVATURE, STATE_HEIGHT, GRADE = range(5)
N_STATE = 5
#: Largest angle to the path of a line that runs along the road. [rad]
_ALONG_RAD = np.radians(15.0)
#: Length on either side over which the curvature of the path is taken. [m]
_OVER_M = 6.0
#: Least distance between places of the path. [m]
_PATH_STEP_M = 0.1
#: Standard deviation of the curvature of a line along the path, given that of the path. [1/m]
_SIGMA = 0.005
#: Largest distance from the path: lines farther away belong to another road. [m]
_FAR_M = 12.0
#: Largest distance ahead of the last pose at which the direction of the path is still that of the road. [m]
_AHEAD_M = 25.0
#: Least ratio of the radius of a line to that of the path inside of a bend.
_LEAST_RADIUS_RATIO = 0.2


@dataclass(frozen=True, slots=True)
class LineState:
    """A place on a line, its direction, curvature and grade there, and their covariance.

    Parameters
    ----------
    place
        (3,) place. [m, local world]
    heading_rad
        Direction in plan, anticlockwise from east. [rad]
    curvature
        Curvature to the left. [1/m]
    grade
        Rise along the line. [m/m]
    covariance
        (5, 5): rows and columns `STATE_ACROSS` to `GRADE`.
    """

    place: FloatArray
    heading_rad: float
    curvature: float
    grade: float
    covariance: FloatArray

    def frame(self, up: FloatArray) -> ExpectedPlace:
        """Return the place with its directions along and across, on a road of unit normal `up` (3,)."""
        c, s = np.cos(self.heading_rad), np.sin(self.heading_rad)
        along = np.array([c, s, self.grade])
        along /= np.sqrt(along @ along)
        across = _cross(up, along)
        return ExpectedPlace(np.stack([self.place, along, across / np.sqrt(across @ across)]), self.curvature)


def _cross(a: FloatArray, b: FloatArray) -> FloatArray:
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def advanced(state: LineState, d: float) -> LineState:
    """Return the state predicted `d` along the line, backwards where negative. [m]"""  # noqa: D400
    middle = state.heading_rad + 0.5 * state.curvature * d
    place = state.place + d * np.array([np.cos(middle), np.sin(middle), state.grade])
    f = np.eye(N_STATE)
    f[STATE_ACROSS, STATE_HEADING], f[STATE_HEADING, CURVATURE] = d, d
    f[STATE_ACROSS, CURVATURE] = 0.5 * d * d
    f[STATE_HEIGHT, GRADE] = d
    n, a = np.zeros((N_STATE, N_STATE)), abs(d)
    sign = np.sign(d)
    # The random walk of the curvature integrated into heading and place; odd powers have the sign of the direction
    n[STATE_ACROSS, STATE_ACROSS] = a**5 / 20.0
    n[STATE_ACROSS, STATE_HEADING], n[STATE_ACROSS, CURVATURE] = sign * a**4 / 8.0, a**3 / 6.0
    n[STATE_HEADING, STATE_HEADING], n[STATE_HEADING, CURVATURE] = a**3 / 3.0, sign * a**2 / 2.0
    n[CURVATURE, CURVATURE] = a
    plan = slice(STATE_ACROSS, CURVATURE + 1)
    n[plan, plan] = BENDING * (np.triu(n[plan, plan]) + np.triu(n[plan, plan], 1).T)
    n[STATE_HEIGHT, STATE_HEIGHT], n[GRADE, GRADE] = GRADING * a**3 / 3.0, GRADING * a
    n[STATE_HEIGHT, GRADE] = GRADING * sign * a**2 / 2.0
    n[GRADE, STATE_HEIGHT] = n[STATE_HEIGHT, GRADE]
    return replace(
        state, place=place, heading_rad=state.heading_rad + d * state.curvature,
        covariance=f @ state.covariance @ f.T + n,
    )  # fmt: skip


def measurement_variance(state: LineState, lift: float) -> float:
    """Return the variance of the line's expected position in one image, given its `lift` there. [m^2]"""  # noqa: D400
    p = state.covariance
    both = p[STATE_ACROSS, STATE_HEIGHT]
    return float(
        p[STATE_ACROSS, STATE_ACROSS] + 2.0 * lift * both + lift * lift * p[STATE_HEIGHT, STATE_HEIGHT]
    )


def corrected(state: LineState, across: FloatArray, seen: list[tuple[float, float, float]]) -> LineState:
    """Return the state updated by the measurements of one or two images.

    Parameters
    ----------
    across
        (3,) unit direction to the left.
    seen
        For each image: distance of the line to the left of the state's place [m], its variance [m^2], and the apparent
        shift of the line to the left per metre of height [m/m].
    """
    x, p = np.zeros(N_STATE), state.covariance
    for where, variance, lift in seen:
        h = np.array([1.0, 0.0, 0.0, lift, 0.0])
        ph = p @ h
        gain = ph / (h @ ph + variance)
        x = x + gain * (where - h @ x)
        p = p - np.outer(gain, ph)
    curvature = float(np.clip(state.curvature + x[CURVATURE], -MOST_CURVATURE, MOST_CURVATURE))
    return LineState(
        state.place + x[STATE_ACROSS] * across + np.array([0.0, 0.0, x[STATE_HEIGHT]]),
        state.heading_rad + float(x[STATE_HEADING]), curvature, state.grade + float(x[GRADE]), 0.5 * (p + p.T),
    )  # fmt: skip


def path_heading(place: FloatArray, path: FloatArray) -> float | None:
    """Return the direction of the path beside a place, anticlockwise from east; None where no path is near. [rad]

    Parameters
    ----------
    place
        (3,) [m, local world].
    path
        (n, 3) positions of the van in time order. [m, local world]
    """  # noqa: D400
    away = np.hypot(*(path[:, :2] - place[:2]).T)
    i = int(np.argmin(away))
    near = path[np.abs(np.hypot(*(path[:, :2] - path[i, :2]).T)) <= _OVER_M]
    way = near[-1, :2] - near[0, :2]
    if away[i] > _AHEAD_M or np.hypot(*way) < 0.1 * _OVER_M:
        return None
    return float(np.arctan2(way[1], way[0]))


def bent_like_path(state: LineState, path: FloatArray) -> LineState:
    """Return the state with the curvature of the path beside it, where the line runs along the path.

    Parameters
    ----------
    path
        (n, 3) positions of the van in time order. [m, local world]
    """
    step = np.hypot(*np.diff(path[:, :2], axis=0).T)
    path = path[np.concatenate([[True], step > _PATH_STEP_M])]
    if len(path) < 3:
        return state
    t = distance_along(path)
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
    # Lines beside the path are parallel to it: of smaller radius inside of the bend
    middle = 0.5 * (heading[1] + heading[2])
    left_m = float((state.place - path[i])[:2] @ np.array([-np.sin(middle), np.cos(middle)]))
    curvature = way * bend / max(1.0 - bend * left_m, _LEAST_RADIUS_RATIO)
    covariance = state.covariance.copy()
    covariance[CURVATURE, CURVATURE] = _SIGMA**2
    return LineState(state.place, state.heading_rad, curvature, state.grade, covariance)
