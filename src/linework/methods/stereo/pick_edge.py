"""The edge next to a picked pixel: its direction, its place on the road, and what it looks like."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from linework.arrays import FloatArray
from linework.kernels.line_matching import profile_across
from linework.methods.stereo.edge_profile import LEAST_RISE, Profile, pattern_at, rises
from linework.methods.stereo.edge_state import LineState
from linework.methods.stereo.edge_template import REACH_M, Template, template_of
from linework.methods.stereo.edge_view import View
from linework.methods.stereo.match_edge import match_edge, scale_at

#: A pick may be so far beside the edge. [pixels]
PICK_PX = 4.0
#: Edges are soft over some pixels (lens, motion), and what is seen of a kerb's foot is its shadow: so far from the
#: pick the middle of an edge may be found. [pixels]
_SOFT_PX = 2.5
#: Half of the widest paint that a line is made of (broad lines, 0.30 m, and a tenth more): a pick on it. [m]
_HALF_STRIPE_M = 0.17
#: Directions that are tried at first, then around the best one. [degrees]
_DIRECTIONS, _FINER = 4.0, 0.5
#: Sides of worn paint are ragged by this. [m]
_SIDE_M = 0.05
#: Most lines run along the road, within 15 degrees of it (sine); what runs otherwise must be so much higher to be
#: taken: grass and shadows have short edges in all directions.
_ALONG_SIN, _ACROSS_ROAD = 0.26, 0.5
#: An edge is looked at over this length, or over four rows where they are longer. [m, rows]
_LENGTH_M, _ROWS, _MOST_ROWS = 1.2, 4.0, 24
#: How well the start is known: heading [rad], curvature [1/m], height [m] (a kerb's top is on no road plane), grade.
_START = (0.035, 0.03, 0.12, 0.03)
#: Where a dash begins or paint is worn it is looked at a little farther on, or back. [m]
_BESIDE_M = (0.0, 0.6, -0.6, 1.4, -1.4)


@dataclass(frozen=True, slots=True)
class Picked:
    """A line at a picked place: where it starts to be followed, and its pattern."""

    state: LineState
    template: Template


@dataclass(frozen=True, slots=True)
class Refused:
    """Why there is no edge at a picked place."""

    reason: str


def pick_edge(
    view: View, side: int, place: FloatArray, kind: str, road_rad: float | None = None
) -> Picked | Refused:
    """Return the edge nearest to a place on the road, within a few pixels of one image.

    Parameters
    ----------
    side
        0: the place was picked in the left image; 1: in the right one.
    place
        (3,) float64 [m, local world]: where the picked pixel's ray meets the road.
    kind
        "lane_marking": stripes only; "road_boundary": edges only; "": whichever is nearest.
    road_rad
        Direction of the road there, from the van's path; None where it is not known.
    """
    heading, rise = _direction(view, side, place, road_rad)
    way = np.array([np.cos(heading), np.sin(heading), 0.0])
    refused = Refused(f"no edge within {PICK_PX:.0f} pixels, grey values differ by {rise:.0f} at most")
    edge = None
    for along in _BESIDE_M:
        found = _picked_at(view, side, place + along * way, heading, kind)
        if isinstance(found, Picked):
            # The edge of a worn stripe is a side of it where the paint is whole
            if found.template.is_stripe and (edge is None or _is_side(edge, found)):
                return found
            edge = edge or found
        elif found is not None:
            refused = found
    return edge or refused


def _is_side(edge: Picked, stripe: Picked) -> bool:
    """Return whether an edge is a side of a stripe found a little farther on."""
    across = edge.state.frame(np.array([0.0, 0.0, 1.0])).frame[2]
    apart = abs(float((stripe.state.place - edge.state.place) @ across))
    return abs(apart - 0.5 * stripe.template.width_m) <= _SIDE_M


def _picked_at(
    view: View, side: int, place: FloatArray, heading: float, kind: str
) -> Picked | Refused | None:
    """Return the line at a place, None where nothing is."""
    profile = _profile(view, side, place, heading)
    if profile is None:
        return None
    pixel_m = profile.pixel_m
    reach = (PICK_PX + _SOFT_PX) * pixel_m
    chosen = pattern_at(profile, reach, _HALF_STRIPE_M, kind)
    if chosen is None:
        if not kind or pattern_at(profile, reach, _HALF_STRIPE_M, "") is None:
            return None
        other = "no stripe of paint" if kind == "lane_marking" else "an edge of paint"
        return Refused(f"the edge there is {other}")
    # Begin on the line itself
    state = _start(view, place, heading, chosen.at_m, pixel_m)
    template = template_of(profile.s, profile.grey, chosen)
    frame = state.frame(view.up)
    for image in (side, 1 - side):
        scale = scale_at(view, image, frame)
        if scale is None:
            return Refused("the line is seen end on there")
        lift_m = 0.0 if image == side else 3.0 * _START[2] * abs(scale.lift)
        gate = 2.0 * scale.pixel_m + min(lift_m, 0.5)
        if match_edge(view, image, frame, template, (0.0, gate), _LENGTH_M) is None:
            name = ("left", "right")[image]
            return Refused(f"there is an edge, but on the road the {name} image does not show it")
    return Picked(state, template)


def _direction(view: View, side: int, place: FloatArray, road_rad: float | None) -> tuple[float, float]:
    """Return the direction in plan [rad] whose profile has the highest edge near a place, and its rise.

    On paint wider than the pick's reach the edges are farther away.
    """
    away = place - view.centre
    best, best_score = float(np.arctan2(away[1], away[0])), 0.0
    for reach_m in (0.0, _HALF_STRIPE_M):
        for step, span in ((_DIRECTIONS, 88.0), (_FINER, 4.0)):
            middle = best
            for turn in np.radians(np.arange(-span, span + 0.5 * step, step)):
                score = _score(view, side, place, middle + turn, reach_m)
                if road_rad is not None and abs(np.sin(middle + turn - road_rad)) > _ALONG_SIN:
                    score *= _ACROSS_ROAD
                if score > best_score:
                    best, best_score = middle + turn, score
        if best_score >= LEAST_RISE:
            break
    return best, best_score


def _score(view: View, side: int, place: FloatArray, heading: float, reach_m: float) -> float:
    """Return the largest rise between three samples and the three before that both halves of the length show."""
    profile = _profile(view, side, place, heading)
    if profile is None:
        return 0.0
    near = np.abs(profile.s) <= max((PICK_PX + 3.0) * profile.pixel_m, reach_m)
    one, two = (rises(half[near], 3) for half in profile.halves)
    return float(np.where(one * two > 0.0, np.minimum(np.abs(one), np.abs(two)), 0.0).max(initial=0.0))


def _profile(view: View, side: int, place: FloatArray, heading: float) -> Profile | None:
    """Return the profile across a direction; None where it is not inside the image."""
    frame = _start(view, place, heading, 0.0, 0.0).frame(view.up)
    scale = scale_at(view, side, frame)
    if scale is None or scale.pixel_m > 0.2:
        return None
    length = max(_LENGTH_M, _ROWS * scale.along_m)
    half = int(np.ceil(REACH_M / scale.pixel_m))
    count = int(np.clip(round(0.5 * length / scale.along_m), 1, _MOST_ROWS))
    parts = []
    for sign in (-0.25, 0.25):
        moved = frame.frame.copy()
        moved[0] += sign * length * moved[1]
        parts.append(
            profile_across(
                view.images[side], view.to_pixel[side], moved, 0.0, (0.5 * length, count), scale.pixel_m, half
            )
        )
    halves = np.array(parts)
    # At the image's border one half may be outside
    halves = np.where(np.isfinite(halves), halves, halves[::-1])
    inside = np.asarray(np.isfinite(halves).all(axis=0))
    s: FloatArray = np.asarray(scale.pixel_m * np.arange(-half, half + 1), dtype=np.float64)
    near = np.abs(s) <= max(8.0 * scale.pixel_m, 0.1)
    if not inside[near].all():
        return None
    first, last = np.flatnonzero(inside)[[0, -1]]
    part = slice(int(first), int(last) + 1)
    return Profile(s[part], halves[:, part].mean(axis=0), halves[:, part], scale.pixel_m)


def _start(view: View, place: FloatArray, heading: float, across_m: float, sigma_m: float) -> LineState:
    """Return the state of a line through a place on the road."""
    grade = -float(np.cos(heading) * view.up[0] + np.sin(heading) * view.up[1]) / float(view.up[2])
    covariance = np.diag([max(sigma_m, 0.005) ** 2, *(v * v for v in _START)])
    state = LineState(place, float(heading), 0.0, grade, covariance)
    across = state.frame(view.up).frame[2]
    return LineState(place + across_m * across, float(heading), 0.0, grade, covariance)
