"""The edge next to a picked pixel: its direction, its place on the road, and what it looks like."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from linework.kernels.line_matching import profile_across
from linework.methods.stereo.edge_profile import Edge, edges_in, stripe_or_edge
from linework.methods.stereo.edge_state import LineState
from linework.methods.stereo.edge_template import REACH_M, Template, template_of
from linework.methods.stereo.edge_view import View
from linework.methods.stereo.match_edge import match_edge, scale_at
from linework.model.arrays import FloatArray

#: A pick may be so far beside the edge. [pixels]
PICK_PX = 4.0
#: Half of the widest paint that a line is made of (broad lines, 0.30 m, and a tenth more): a pick on it. [m]
_HALF_STRIPE_M = 0.17
#: Directions that are tried at first, then around the best one. [degrees]
_DIRECTIONS, _FINER = 4.0, 0.5
#: An edge is looked at over this length, or over four rows where they are longer. [m, rows]
_LENGTH_M, _ROWS, _MOST_ROWS = 1.2, 4.0, 24
#: How well the start is known: heading [rad], curvature [1/m], height [m] (a kerb's top is on no road plane), grade.
_START = (0.035, 0.03, 0.12, 0.03)


@dataclass(frozen=True, slots=True)
class Picked:
    """A line at a picked place: where it starts to be followed, and its pattern."""

    state: LineState
    template: Template


@dataclass(frozen=True, slots=True)
class Refused:
    """Why there is no edge at a picked place."""

    reason: str


def pick_edge(view: View, side: int, place: FloatArray, kind: str) -> Picked | Refused:
    """Return the edge nearest to a place on the road, within a few pixels of one image.

    Parameters
    ----------
    side
        0: the place was picked in the left image; 1: in the right one.
    place
        (3,) float64 [m, local world]: where the picked pixel's ray meets the road.
    kind
        "lane_marking": stripes only; "road_boundary": edges only; "": whichever is nearest.
    """
    heading, contrast = _direction(view, side, place)
    seen = _profile(view, side, place, heading)
    if seen is None:
        return Refused("the road there is not wholly inside the image")
    s, grey, pixel_m = seen
    edges = edges_in(s, grey)
    reach = PICK_PX * pixel_m
    chosen = stripe_or_edge(edges, reach, _HALF_STRIPE_M, kind)
    if chosen is None:
        return Refused(_why(edges, contrast, reach, kind))
    # Begin on the line itself
    state = _start(view, place, heading, chosen.at_m, pixel_m)
    template = template_of(s, grey, chosen.at_m, chosen.width_m, chosen.rise)
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


def _why(edges: list[Edge], contrast: float, reach_m: float, kind: str) -> str:
    """Return why none of the edges is what was picked."""
    if kind and any(abs(e.at_m) <= reach_m for e in edges):
        other = "no stripe of paint" if kind == "lane_marking" else "an edge of paint"
        return f"the edge there is {other}"
    return f"no edge within {PICK_PX:.0f} pixels, grey values differ by {contrast:.0f} at most"


def _direction(view: View, side: int, place: FloatArray) -> tuple[float, float]:
    """Return the direction in plan [rad] whose profile has the steepest edge near a place, and its contrast."""
    away = place - view.centre
    ahead = np.arctan2(away[1], away[0])
    best, best_score = ahead, 0.0
    for step, span in ((_DIRECTIONS, 88.0), (_FINER, 4.0)):
        middle = best
        for turn in np.radians(np.arange(-span, span + 0.5 * step, step)):
            score = _score(view, side, place, middle + turn)
            if score > best_score:
                best, best_score = middle + turn, score
    return float(best), best_score


def _score(view: View, side: int, place: FloatArray, heading: float) -> float:
    """Return the largest difference between two samples left and two right of one within reach of a place."""
    seen = _profile(view, side, place, heading)
    if seen is None:
        return 0.0
    s, grey, pixel_m = seen
    near = np.abs(s) <= max(PICK_PX * pixel_m, _HALF_STRIPE_M) + 2.5 * pixel_m
    g = grey[near]
    if len(g) < 6:
        return 0.0
    pairs = g[:-1] + g[1:]
    return float(np.abs(pairs[3:] - pairs[:-3]).max() / 2.0)


def _profile(
    view: View, side: int, place: FloatArray, heading: float
) -> tuple[FloatArray, FloatArray, float] | None:
    """Return places across a direction, the grey values there, and what a pixel covers; None where not inside."""
    frame = _start(view, place, heading, 0.0, 0.0).frame(view.up)
    scale = scale_at(view, side, frame)
    if scale is None or scale.pixel_m > 0.2:
        return None
    length = max(_LENGTH_M, _ROWS * scale.along_m)
    half = int(np.ceil(REACH_M / scale.pixel_m))
    count = int(np.clip(round(length / scale.along_m), 1, _MOST_ROWS))
    grey = profile_across(
        view.images[side], view.to_pixel[side], frame.frame, 0.0, (length, count), scale.pixel_m, half
    )
    s: FloatArray = np.asarray(scale.pixel_m * np.arange(-half, half + 1), dtype=np.float64)
    inside = np.isfinite(grey)
    near = np.abs(s) <= max(8.0 * scale.pixel_m, 0.1)
    if not inside[near].all():
        return None
    first, last = np.flatnonzero(inside)[[0, -1]]
    return s[first : last + 1], grey[first : last + 1], scale.pixel_m


def _start(view: View, place: FloatArray, heading: float, across_m: float, sigma_m: float) -> LineState:
    """Return the state of a line through a place on the road."""
    grade = -float(np.cos(heading) * view.up[0] + np.sin(heading) * view.up[1]) / float(view.up[2])
    covariance = np.diag([max(sigma_m, 0.005) ** 2, *(v * v for v in _START)])
    state = LineState(place, float(heading), 0.0, grade, covariance)
    across = state.frame(view.up).frame[2]
    return LineState(place + across_m * across, float(heading), 0.0, grade, covariance)
