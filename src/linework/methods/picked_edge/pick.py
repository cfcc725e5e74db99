"""The edge next to a picked pixel: its direction, its place on the road, and what it looks like."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from linework.arrays import AnyArray, FloatArray
from linework.errors import InputError
from linework.kernels.images.line_matching import grey_profile_across
from linework.methods.picked_edge.match import match_edge, scale_at
from linework.methods.picked_edge.profile import LEAST_RISE, GreyProfile, pattern_at, rises
from linework.methods.picked_edge.state import LineState
from linework.methods.picked_edge.template import TEMPLATE_REACH_M, Template, template_of
from linework.methods.picked_edge.view import PairView
from linework.methods.stereo.road_plane import CAMERA_HEIGHT_M, RoadShape, fit_pair_road
from linework.model.camera import RectifiedRig
from linework.model.images import RectifiedPair

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
class PickedStart:
    """A line at a picked place: where it starts to be followed, and its pattern."""

    state: LineState
    template: Template


@dataclass(frozen=True, slots=True)
class EdgeRefusal:
    """Why there is no edge at a picked place."""

    reason: str


def pick_edge(
    view: PairView, side: int, place: FloatArray, kind: str, road_rad: float | None = None
) -> PickedStart | EdgeRefusal:
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
    refused = EdgeRefusal(f"no edge within {PICK_PX:.0f} pixels, grey values differ by {rise:.0f} at most")
    edge = None
    for along in _BESIDE_M:
        found = _picked_at(view, side, place + along * way, heading, kind)
        if isinstance(found, PickedStart):
            # The edge of a worn stripe is a side of it where the paint is whole
            if found.template.is_stripe and (edge is None or _is_side(edge, found)):
                return found
            edge = edge or found
        elif found is not None:
            refused = found
    return edge or refused


def _is_side(edge: PickedStart, stripe: PickedStart) -> bool:
    """Return whether an edge is a side of a stripe found a little farther on."""
    across = edge.state.frame(np.array([0.0, 0.0, 1.0])).frame[2]
    apart = abs(float((stripe.state.place - edge.state.place) @ across))
    return abs(apart - 0.5 * stripe.template.width_m) <= _SIDE_M


def _picked_at(
    view: PairView, side: int, place: FloatArray, heading: float, kind: str
) -> PickedStart | EdgeRefusal | None:
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
        return EdgeRefusal(f"the edge there is {other}")
    # Begin on the line itself
    state = _start(view, place, heading, chosen.at_m, pixel_m)
    template = template_of(profile.s, profile.grey, chosen)
    frame = state.frame(view.up)
    for image in (side, 1 - side):
        scale = scale_at(view, image, frame)
        if scale is None:
            return EdgeRefusal("the line is seen end on there")
        lift_m = 0.0 if image == side else 3.0 * _START[2] * abs(scale.lift)
        gate = 2.0 * scale.pixel_m + min(lift_m, 0.5)
        if match_edge(view, image, frame, template, (0.0, gate), _LENGTH_M) is None:
            name = ("left", "right")[image]
            return EdgeRefusal(f"there is an edge, but on the road the {name} image does not show it")
    return PickedStart(state, template)


def _direction(view: PairView, side: int, place: FloatArray, road_rad: float | None) -> tuple[float, float]:
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


def _score(view: PairView, side: int, place: FloatArray, heading: float, reach_m: float) -> float:
    """Return the largest rise between three samples and the three before that both halves of the length show."""
    profile = _profile(view, side, place, heading)
    if profile is None:
        return 0.0
    near = np.abs(profile.s) <= max((PICK_PX + 3.0) * profile.pixel_m, reach_m)
    one, two = (rises(half[near], 3) for half in profile.halves)
    return float(np.where(one * two > 0.0, np.minimum(np.abs(one), np.abs(two)), 0.0).max(initial=0.0))


def _profile(view: PairView, side: int, place: FloatArray, heading: float) -> GreyProfile | None:
    """Return the profile across a direction; None where it is not inside the image."""
    frame = _start(view, place, heading, 0.0, 0.0).frame(view.up)
    scale = scale_at(view, side, frame)
    if scale is None or scale.pixel_m > 0.2:
        return None
    length = max(_LENGTH_M, _ROWS * scale.along_m)
    half = int(np.ceil(TEMPLATE_REACH_M / scale.pixel_m))
    count = int(np.clip(round(0.5 * length / scale.along_m), 1, _MOST_ROWS))
    parts = []
    for sign in (-0.25, 0.25):
        moved = frame.frame.copy()
        moved[0] += sign * length * moved[1]
        parts.append(
            grey_profile_across(
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
    return GreyProfile(s[part], halves[:, part].mean(axis=0), halves[:, part], scale.pixel_m)


def _start(view: PairView, place: FloatArray, heading: float, across_m: float, sigma_m: float) -> LineState:
    """Return the state of a line through a place on the road."""
    grade = -float(np.cos(heading) * view.up[0] + np.sin(heading) * view.up[1]) / float(view.up[2])
    covariance = np.diag([max(sigma_m, 0.005) ** 2, *(v * v for v in _START)])
    state = LineState(place, float(heading), 0.0, grade, covariance)
    across = state.frame(view.up).frame[2]
    return LineState(place + across_m * across, float(heading), 0.0, grade, covariance)


# The pixel nearest to a refused pick that works

#: Rings around the pick, so far apart, out to the last; places on each. [pixels]
_RING_PX, _LAST_PX, _PLACES = 6.0, 90.0, 16
#: A place is tried where grey values within two pixels differ by so much, and by half of what they do where they
#: differ most around the pick; so many places at most: each takes as long as a pick.
_LEAST_DIFFERENCE, _OF_THE_MOST, _MOST_TRIES = 10.0, 0.5, 40


def nearest_pick(
    image: AnyArray,
    pick: tuple[float, float],
    is_road: Callable[[float, float], bool],
    works: Callable[[float, float], bool],
) -> tuple[int, int] | None:
    """Return the nearest pixel (col, row) of an image that works, None if there is none within 90 pixels.

    Parameters
    ----------
    is_road
        Whether a pixel shows the road's surface, near enough: asked of all places.
    works
        Whether a line can be followed from it: asked of those that differ from their surroundings.
    """
    height, width = image.shape
    places = [
        (round(pick[0] + ring * np.cos(turn)), round(pick[1] + ring * np.sin(turn)))
        for ring in np.arange(_RING_PX, _LAST_PX + 1.0, _RING_PX)
        for turn in 2.0 * np.pi * np.arange(_PLACES) / _PLACES
    ]
    inside = [(c, r) for c, r in places if 2 <= c < width - 2 and 2 <= r < height - 2 and is_road(c, r)]
    if not inside:
        return None
    differ = np.array([float(np.ptp(image[r - 2 : r + 3, c - 2 : c + 3])) for c, r in inside])
    least = max(_LEAST_DIFFERENCE, _OF_THE_MOST * float(differ.max()))
    tried = [inside[i] for i in np.flatnonzero(differ >= least)[:_MOST_TRIES]]
    return next((place for place in tried if works(*place)), None)


# Where the ray of a picked pixel meets the road; how high the cameras are above it is not known beforehand

#: Nothing farther away can be picked: a pixel there covers metres of the road. [m]
FARTHEST_PICK_M = 60.0


@dataclass(frozen=True, slots=True)
class PairRoad:
    """The road of one pair: as its images show it, or the plane of the vehicle frame where they show none.

    Parameters
    ----------
    up_vehicle
        (3,) its normal.
    """

    rig: RectifiedRig
    shape: RoadShape | None
    up_vehicle: FloatArray

    def under(self, side: int, col: float, row: float) -> FloatArray | None:
        """Return (3,) the place [m, vehicle] where a pixel of the left (0) or right (1) image shows the road.

        None above the horizon, and too far away to be picked.
        """
        rig = self.rig
        left = float(col)
        # A pixel of the right image is a disparity to the left of the left one's: found in a few rounds
        for _ in range(1 + 8 * side):
            d = self._disparity(left, row)
            if d < rig.focal_px * rig.base_m / FARTHEST_PICK_M:
                return None
            left = col + d * side
        return np.asarray(rig.intersect(np.array([left]), np.array([row]), np.array([d]))[0])

    def _disparity(self, col: float, row: float) -> float:
        rig = self.rig
        if self.shape is not None:
            return float(self.shape.disparity(rig, np.array([col]), np.array([row]))[0])
        ray = rig.R_vehicle_camera @ np.array(
            [(col - rig.cx) / rig.focal_px, (row - rig.cy) / rig.focal_px, 1.0]
        )
        return float(-ray[2] / rig.position_m[2] * rig.focal_px * rig.base_m)


def road_in(pair: RectifiedPair) -> PairRoad:
    """Return the road of a pair.

    Raises
    ------
    InputError
        Its images show none, and the calibration does not say how high the cameras are.
    """
    rig, shape = pair.rig, fit_pair_road(pair)
    if shape is not None:
        return PairRoad(rig, shape, rig.R_vehicle_camera @ shape.plane.up(rig))
    if not CAMERA_HEIGHT_M[0] <= rig.position_m[2] <= CAMERA_HEIGHT_M[1]:
        raise InputError(
            "the pair does not show a road", where=f"pair {pair.number}", advice="pick in another"
        )
    return PairRoad(rig, None, np.array([0.0, 0.0, 1.0]))
