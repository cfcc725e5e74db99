"""Carrying a line into another stereo pair: find it again, measure it again, and extend the known line.

Separate from `method`, which decides in which pairs the line is looked for: this works on one pair.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np

from linework.arrays import FloatArray
from linework.methods.picked_edge.fitted import LEAST_CARRIED_PLACES
from linework.methods.picked_edge.follow import EdgeVertex, FollowedStretch, follow_edge
from linework.methods.picked_edge.view import PairView

#: Distance of a first place from the border of both images [pixels], and beyond where the line enters them [m].
_MARGIN_PX, _BEYOND_M = 12.0, 3.0
#: Smallest depth of a first place: nearer ones are at the van itself. [m]
_LEAST_DEPTH_M = 1.0
#: Most first places that are tried, and their distance from one another. [m]
_TRIES, _APART_M = 6, 1.5
#: Standard deviations of the line from where the poses put it: across [m], heading [rad], curvature [1/m], height [m],
#: grade. Positions err by some centimetres from pair to pair, and a pitch of 0.2 degrees lifts what is 10 m ahead by
#: 3 cm.
_START = (0.05, 0.02, 0.005, 0.05, 0.02)
#: Distance to the end of a stretch within which vertices are replaced by it. [m]
_NEAR_M = 0.1


def carry_into_pair(
    course: tuple[EdgeVertex, ...], view: PairView
) -> tuple[FollowedStretch, FollowedStretch] | None:
    """Return a known line followed in another pair, against its order and along it; None where it is not found.

    Parameters
    ----------
    course
        Vertices of the line known so far, in order.
    """
    for vertex in _starts(course, view):
        covariance = np.diag([v * v for v in _START])
        start = replace(vertex.state, covariance=covariance)
        ahead = follow_edge(view, start, vertex.template, 1)
        if not ahead.vertices:
            continue
        # Back from the first place measured in this pair, which is free of the error between the poses
        first = ahead.vertices[0]
        back = follow_edge(view, replace(first.state, covariance=covariance), first.template, -1)
        both = sum(v.in_both for v in (*ahead.vertices, *back.vertices))
        if both >= LEAST_CARRIED_PLACES:
            return back, ahead
    return None


def _starts(course: tuple[EdgeVertex, ...], view: PairView) -> list[EdgeVertex]:
    """Return vertices to start from, the best first: near ones are sharpest, those at the border are cut off."""
    xyz = followed_places(course)
    depth = view.depth_m(xyz)
    inside = (
        view.is_inside(0, xyz, _MARGIN_PX) & view.is_inside(1, xyz, _MARGIN_PX) & (depth > _LEAST_DEPTH_M)
    )
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
    """Return (n, 3) filtered positions of vertices. [m, local world]"""  # noqa: D400
    return np.array([v.state.place for v in course]).reshape(-1, 3)


def extend_by_pair(
    course: tuple[EdgeVertex, ...], stretch: tuple[EdgeVertex, ...], *, is_nearer: bool, ends: bool
) -> tuple[EdgeVertex, ...]:
    """Return a line extended by what another pair shows of it, in order along it.

    Parameters
    ----------
    is_nearer
        The other pair is nearer: its vertices replace those known so far; else only new ones are added.
    ends
        With `is_nearer`: the line ends with the stretch, and what was followed beyond it was something else.
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
