"""A followed line carried into the next pair: found there again, measured anew, and followed on."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np

from linework.arrays import FloatArray
from linework.methods.picked_edge.follow import EdgeVertex, FollowedStretch, follow_edge
from linework.methods.picked_edge.view import PairView

#: A line is found again where it is well inside both images, a little beyond where it enters them. [pixels, m]
_MARGIN_PX, _BEYOND_M = 12.0, 3.0
#: Places that are tried, so far apart. [m]
_TRIES, _APART_M = 6, 1.5
#: How far the line may be from where the poses say: across, height [m]; heading [rad], curvature [1/m], grade.
#: Positions err by some centimetres from pair to pair, a pitch of 0.2 degrees lifts what is 10 m ahead by 3 cm.
_START = (0.05, 0.02, 0.005, 0.05, 0.02)
#: So many places in both images make it the line.
LEAST_CARRIED_PLACES = 4
#: Vertices nearer than this to a stretch's end are replaced by it. [m]
_NEAR_M = 0.1


def carry_into_pair(
    course: tuple[EdgeVertex, ...], view: PairView
) -> tuple[FollowedStretch, FollowedStretch] | None:
    """Find a known line in another pair and follow it there both ways.

    Parameters
    ----------
    course
        The line as known so far, in order.

    Returns
    -------
    Against its order and along it; or None where the pair does not show it.
    """
    for vertex in _starts(course, view):
        covariance = np.diag([v * v for v in _START])
        start = replace(vertex.state, covariance=covariance)
        ahead = follow_edge(view, start, vertex.template, 1)
        if not ahead.vertices:
            continue
        # Back from the first place of this pair: poses are no longer in between
        first = ahead.vertices[0]
        back = follow_edge(view, replace(first.state, covariance=covariance), first.template, -1)
        both = sum(v.in_both for v in (*ahead.vertices, *back.vertices))
        if both >= LEAST_CARRIED_PLACES:
            return back, ahead
    return None


def _starts(course: tuple[EdgeVertex, ...], view: PairView) -> list[EdgeVertex]:
    """Return places to begin at, the best first: near ones see best, those at the image's border see half."""
    xyz = followed_places(course)
    depth = view.depth_m(xyz)
    inside = view.is_inside(0, xyz, _MARGIN_PX) & view.is_inside(1, xyz, _MARGIN_PX) & (depth > 1.0)
    if not inside.any():
        return []
    wanted = depth[inside].min() + _BEYOND_M
    chosen: list[int] = []
    for i in np.argsort(np.where(inside, np.abs(depth - wanted), np.inf), kind="stable").tolist():
        if not inside[i] or len(chosen) == _TRIES:
            break
        if all(np.hypot(*(xyz[i] - xyz[k])[:2]) >= _APART_M for k in chosen):
            chosen.append(i)
    return [course[i] for i in chosen]


def followed_places(course: tuple[EdgeVertex, ...]) -> FloatArray:
    """Return (n, 3) places of a line as the filter had them. [m, local world]"""  # noqa: D400
    return np.array([v.state.place for v in course]).reshape(-1, 3)


def extend_by_pair(
    course: tuple[EdgeVertex, ...], stretch: tuple[EdgeVertex, ...], *, is_nearer: bool, ends: bool
) -> tuple[EdgeVertex, ...]:
    """Return a line with what another pair showed of it, in order along it.

    Parameters
    ----------
    is_nearer
        The other pair saw it from nearer: its places stand for those known so far; else only what it adds is taken.
    ends
        Seen from nearer, the line ends with the stretch: what was taken for it farther on was something else.
    """
    if len(stretch) < 2:
        return course
    outer, inner = (course, stretch) if is_nearer else (stretch, course)
    before = tuple(v for v in outer if _is_before(v, inner[0]))
    behind = tuple(v for v in outer if _is_before(inner[-1], v, of=inner[-1]))
    return (*before, *inner) if is_nearer and ends else (*before, *inner, *behind)


def _is_before(v: EdgeVertex, w: EdgeVertex, of: EdgeVertex | None = None) -> bool:
    """Return whether v is before w, along the direction of one of them."""
    state = (w if of is None else of).state
    way = np.array([np.cos(state.heading_rad), np.sin(state.heading_rad)])
    return bool((w.state.place - v.state.place)[:2] @ way > _NEAR_M)


def length_m(course: tuple[EdgeVertex, ...]) -> float:
    """Return the length of a line in plan. [m]"""  # noqa: D400
    return sum(float(np.hypot(*(b.state.place - a.state.place)[:2])) for a, b in pairwise(course))
