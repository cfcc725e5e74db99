"""Where a line is and how it goes on: a filter along it in object space, on a smooth road."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from linework.arrays import FloatArray
from linework.methods.picked_edge.match import ExpectedPlace

#: Roads bend to radii of 18 m, within a car's length or two where a kerb turns into a side street, slower on the
#: open road: density of the curvature's random walk. [1/m^3]
BENDING = 5e-6
#: Grades change over crests and sags of some hundred metres' radius, and at ramps: density of the grade's random
#: walk. [1/m]
GRADING = 3e-5
#: No road bends more than this (18 m, and the inner kerb of it). [1/m]
MOST_CURVATURE = 1.0 / 12.0
#: Rows of the state and its covariance: across to the left [m], heading [rad], curvature [1/m], height [m], grade.
STATE_ACROSS, STATE_HEADING, CURVATURE, STATE_HEIGHT, GRADE = range(5)


@dataclass(frozen=True, slots=True)
class LineState:
    """A place on a line, its direction there, and how well all of that is known.

    Parameters
    ----------
    place
        (3,) float64 [m, local world].
    heading_rad
        Direction in plan, from east towards north.
    curvature
        To the left. [1/m]
    grade
        Rise along the line. [m/m]
    covariance
        (5, 5) of across, heading, curvature, height, grade.
    """

    place: FloatArray
    heading_rad: float
    curvature: float
    grade: float
    covariance: FloatArray

    def frame(self, up: FloatArray) -> ExpectedPlace:
        """Return the place with its directions along and across, on a road with a normal."""
        c, s = np.cos(self.heading_rad), np.sin(self.heading_rad)
        along = np.array([c, s, self.grade])
        along /= np.sqrt(along @ along)
        across = _cross(up, along)
        return ExpectedPlace(np.stack([self.place, along, across / np.sqrt(across @ across)]), self.curvature)


def _cross(a: FloatArray, b: FloatArray) -> FloatArray:
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def advanced(state: LineState, d: float) -> LineState:
    """Return the state `d` metres on along the line, back where negative."""
    middle = state.heading_rad + 0.5 * state.curvature * d
    place = state.place + d * np.array([np.cos(middle), np.sin(middle), state.grade])
    f = np.eye(5)
    f[STATE_ACROSS, STATE_HEADING], f[STATE_ACROSS, CURVATURE], f[STATE_HEADING, CURVATURE] = (
        d,
        0.5 * d * d,
        d,
    )
    f[STATE_HEIGHT, GRADE] = d
    n, a = np.zeros((5, 5)), abs(d)
    way = np.sign(d)
    # A walk of the curvature, seen in heading and place; signs follow the way
    n[0, 0], n[0, 1], n[0, 2] = a**5 / 20.0, way * a**4 / 8.0, a**3 / 6.0
    n[1, 1], n[1, 2], n[2, 2] = a**3 / 3.0, way * a**2 / 2.0, a
    n[:3, :3] = BENDING * (np.triu(n[:3, :3]) + np.triu(n[:3, :3], 1).T)
    n[3, 3], n[3, 4], n[4, 4] = GRADING * a**3 / 3.0, GRADING * way * a**2 / 2.0, GRADING * a
    n[4, 3] = n[3, 4]
    return replace(
        state, place=place, heading_rad=state.heading_rad + d * state.curvature,
        covariance=f @ state.covariance @ f.T + n,
    )  # fmt: skip


def measurement_variance(state: LineState, lift: float) -> float:
    """Return the variance of where an image should show the line. [m^2]"""  # noqa: D400
    p = state.covariance
    return float(p[0, 0] + 2.0 * lift * p[0, 3] + lift * lift * p[3, 3])


def corrected(state: LineState, across: FloatArray, seen: list[tuple[float, float, float]]) -> LineState:
    """Return the state after one or two images showed the line.

    Parameters
    ----------
    across
        (3,) unit direction to the left.
    seen
        For each image: where it showed the line to the left of the state's place, the variance [m, m^2], and how
        far the line seems to move when it is lifted [m/m].
    """
    x, p = np.zeros(5), state.covariance
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


# How the road bends, as the van's own path shows it: lines along the road bend with it

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
