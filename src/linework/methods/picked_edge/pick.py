"""The edge next to a picked pixel: its direction, its place on the road and its pattern; or why there is none.

Separate from `method`: it looks at one image pair around one pixel, before there is a line to follow.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from linework.arrays import AnyArray, FloatArray
from linework.errors import InputError
from linework.kernels.images.line_matching import grey_profile_across
from linework.methods.picked_edge.fitted import ACROSS_ROAD, ALONG_SIN, LEAST_RISE
from linework.methods.picked_edge.match import match_edge, scale_at
from linework.methods.picked_edge.profile import GreyProfile, pattern_at, rises
from linework.methods.picked_edge.state import LineState
from linework.methods.picked_edge.template import TEMPLATE_REACH_M, Template, template_of
from linework.methods.picked_edge.view import PairView
from linework.methods.stereo.road_plane import CAMERA_HEIGHT_M, RoadShape, fit_pair_road
from linework.model.camera import RectifiedRig
from linework.model.images import RectifiedPair

#: Largest distance of a pick from the edge. [pixels]
PICK_PX = 4.0
#: Added to it for the middle of an edge: edges are blurred over some pixels (lens, motion), and what is visible of the
#: foot of a kerb is its shadow. [pixels]
_SOFT_PX = 2.5
#: Half the width of broad lines (0.30 m) and a tenth more: a pick on paint may be this far from both edges. [m]
_HALF_STRIPE_M = 0.17
#: Steps of the directions that are tried, at first and around the best one, and the ranges to both sides. [degrees]
_DIRECTIONS, _FINER, _DIRECTIONS_SPAN, _FINER_SPAN = 4.0, 0.5, 88.0, 4.0
#: Largest distance of the edge of worn paint from a side of the whole stripe. [m]
_SIDE_M = 0.05
#: Length of the profile along an edge, or rows where these are longer; most rows of one half. [m, rows, rows]
_LENGTH_M, _ROWS, _MOST_ROWS = 1.2, 4.0, 24
#: Largest extent of a pixel across the line at which an edge can be picked. [m]
_MOST_PIXEL_M = 0.2
#: Half width of the profile that must be inside the image. [pixels, m]
_INSIDE_PX, _INSIDE_M = 8.0, 0.1
#: Standard deviations of the start: heading [rad], curvature [1/m], height [m] (the top of a kerb is above the road),
#: grade.
_START = (0.035, 0.03, 0.12, 0.03)
#: Smallest standard deviation of the start across. [m]
_START_ACROSS_M = 0.005
#: Largest gate across for a height that is not known, in standard deviations of the height and in metres.
_LIFT_SIGMAS, _MOST_LIFT_M = 3.0, 0.5
#: Distances along the edge at which the pattern is looked for: a dash may begin there, or paint be worn. [m]
_BESIDE_M = (0.0, 0.6, -0.6, 1.4, -1.4)


@dataclass(frozen=True, slots=True)
class PickedStart:
    """A line at a picked place: the state from which it is followed, and its template."""

    state: LineState
    template: Template


@dataclass(frozen=True, slots=True)
class EdgeRefusal:
    """Why there is no edge at a picked place."""

    reason: str


def pick_edge(
    view: PairView, side: int, place: FloatArray, kind: str, road_rad: float | None = None
) -> PickedStart | EdgeRefusal:
    """Return the edge nearest to a place on the road, within a few pixels of one image, or why there is none.

    Parameters
    ----------
    side
        0: picked in the left image; 1: in the right one.
    place
        (3,) intersection of the pixel's ray with the road. [m, local world]
    kind
        "lane_marking": stripes only; "road_boundary": edges only; "": whichever is nearest.
    road_rad
        Direction of the van's path beside the place, anticlockwise from east; None where it is not known. [rad]
    """
    heading, rise = _direction(view, side, place, road_rad)
    way = np.array([np.cos(heading), np.sin(heading), 0.0])
    refused = EdgeRefusal(f"no edge within {PICK_PX:.0f} pixels, the largest step is {rise:.0f} grey values")
    edge = None
    for along in _BESIDE_M:
        found = _picked_at(view, side, place + along * way, heading, kind)
        if isinstance(found, PickedStart):
            # An edge of worn paint continues as a side of the stripe where the paint is whole
            if found.template.is_stripe and (edge is None or _is_side(edge, found)):
                return found
            edge = edge or found
        elif found is not None:
            refused = found
    return edge or refused


def _is_side(edge: PickedStart, stripe: PickedStart) -> bool:
    """Return whether an edge is a side of a stripe found farther along it."""
    across = edge.state.frame(np.array([0.0, 0.0, 1.0])).frame[2]
    apart = abs(float((stripe.state.place - edge.state.place) @ across))
    return abs(apart - 0.5 * stripe.template.width_m) <= _SIDE_M


def _picked_at(
    view: PairView, side: int, place: FloatArray, heading: float, kind: str
) -> PickedStart | EdgeRefusal | None:
    """Return the line at a place, why it is refused, or None where there is no edge."""
    profile = _profile(view, side, place, heading)
    if profile is None:
        return None
    pixel_m = profile.pixel_m
    reach = (PICK_PX + _SOFT_PX) * pixel_m
    chosen = pattern_at(profile, reach, _HALF_STRIPE_M, kind)
    if chosen is None:
        if not kind or pattern_at(profile, reach, _HALF_STRIPE_M, "") is None:
            return None
        if kind == "lane_marking":
            return EdgeRefusal("the edge is not a stripe of paint")
        return EdgeRefusal("the edge belongs to a stripe of paint")
    # Start on the line itself
    state = _start(view, place, heading, chosen.at_m, pixel_m)
    template = template_of(profile.s, profile.grey, chosen)
    frame = state.frame(view.up)
    for image in (side, 1 - side):
        scale = scale_at(view, image, frame)
        if scale is None:
            return EdgeRefusal("the line points at the camera")
        lift_m = 0.0 if image == side else _LIFT_SIGMAS * _START[2] * abs(scale.lift)
        gate = 2.0 * scale.pixel_m + min(lift_m, _MOST_LIFT_M)
        if match_edge(view, image, frame, template, (0.0, gate), _LENGTH_M) is None:
            name = ("left", "right")[image]
            return EdgeRefusal(f"the {name} image does not show the edge on the road")
    return PickedStart(state, template)


def _direction(view: PairView, side: int, place: FloatArray, road_rad: float | None) -> tuple[float, float]:
    """Return the direction in plan [rad] whose profile has the largest step near a place, and the step.

    Where there is none within a few pixels, the edges of wide paint are tried.
    """
    away = place - view.centre
    best, best_score = float(np.arctan2(away[1], away[0])), 0.0
    for reach_m in (0.0, _HALF_STRIPE_M):
        for step, span in ((_DIRECTIONS, _DIRECTIONS_SPAN), (_FINER, _FINER_SPAN)):
            middle = best
            for turn in np.radians(np.arange(-span, span + 0.5 * step, step)):
                score = _score(view, side, place, middle + turn, reach_m)
                if road_rad is not None and abs(np.sin(middle + turn - road_rad)) > ALONG_SIN:
                    score *= ACROSS_ROAD
                if score > best_score:
                    best, best_score = middle + turn, score
        if best_score >= LEAST_RISE:
            break
    return best, best_score


def _score(view: PairView, side: int, place: FloatArray, heading: float, reach_m: float) -> float:
    """Return the largest step between three samples and the next three that both halves of the length show."""
    profile = _profile(view, side, place, heading)
    if profile is None:
        return 0.0
    near = np.abs(profile.s) <= max((PICK_PX + 3.0) * profile.pixel_m, reach_m)
    one, two = (rises(half[near], 3) for half in profile.halves)
    return float(np.where(one * two > 0.0, np.minimum(np.abs(one), np.abs(two)), 0.0).max(initial=0.0))


def _profile(view: PairView, side: int, place: FloatArray, heading: float) -> GreyProfile | None:
    """Return the profile across a direction; None where it is not inside the image or too coarse."""
    frame = _start(view, place, heading, 0.0, 0.0).frame(view.up)
    scale = scale_at(view, side, frame)
    if scale is None or scale.pixel_m > _MOST_PIXEL_M:
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
    # At the border of the image one half may be outside
    halves = np.where(np.isfinite(halves), halves, halves[::-1])
    inside = np.asarray(np.isfinite(halves).all(axis=0))
    s: FloatArray = np.asarray(scale.pixel_m * np.arange(-half, half + 1), dtype=np.float64)
    near = np.abs(s) <= max(_INSIDE_PX * scale.pixel_m, _INSIDE_M)
    if not inside[near].all():
        return None
    first, last = np.flatnonzero(inside)[[0, -1]]
    part = slice(int(first), int(last) + 1)
    return GreyProfile(s[part], halves[:, part].mean(axis=0), halves[:, part], scale.pixel_m)


def _start(view: PairView, place: FloatArray, heading: float, across_m: float, sigma_m: float) -> LineState:
    """Return the state of a line through a place on the road."""
    grade = -float(np.cos(heading) * view.up[0] + np.sin(heading) * view.up[1]) / float(view.up[2])
    covariance = np.diag([max(sigma_m, _START_ACROSS_M) ** 2, *(v * v for v in _START)])
    state = LineState(place, float(heading), 0.0, grade, covariance)
    across = state.frame(view.up).frame[2]
    return LineState(place + across_m * across, float(heading), 0.0, grade, covariance)


#: Distance between the rings around a refused pick, radius of the last one [pixels]; places on each.
_RING_PX, _LAST_PX, _PLACES = 6.0, 90.0, 16
#: Smallest range of grey values within two pixels of a place that is tried, and as a share of the largest range around
#: the pick; most places tried: each takes as long as a pick. [grey values, 1, places]
_LEAST_DIFFERENCE, _OF_THE_MOST, _MOST_TRIES = 10.0, 0.5, 40


def nearest_pick(
    image: AnyArray,
    pick: tuple[float, float],
    is_road: Callable[[float, float], bool],
    works: Callable[[float, float], bool],
) -> tuple[int, int] | None:
    """Return the nearest pixel (col, row) from which a line can be followed; None if there is none within 90 pixels.

    Parameters
    ----------
    image
        (height, width) uint8.
    pick
        Column and row of the refused pick. [pixels]
    is_road
        Whether a pixel (col, row) shows the road within range; called for all places.
    works
        Whether a line can be followed from a pixel; called where grey values differ from their surroundings.
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


#: Largest distance of a pick: a pixel there covers metres of the road. [m]
FARTHEST_PICK_M = 60.0
#: Rounds of the search for the left pixel of a right one: its disparity is that of the left pixel.
_RIGHT_ROUNDS = 8


@dataclass(frozen=True, slots=True)
class PairRoad:
    """The road of one pair: its surface from the images, or the ground plane of the vehicle frame where there is none.

    Parameters
    ----------
    shape
        The surface; None for the ground plane.
    up_vehicle
        (3,) unit normal of the road in the vehicle frame.
    """

    rig: RectifiedRig
    shape: RoadShape | None
    up_vehicle: FloatArray

    def under(self, side: int, col: float, row: float) -> FloatArray | None:
        """Return (3,) the intersection of the ray of a pixel with the road. [m, vehicle]

        None above the horizon and beyond `FARTHEST_PICK_M`. Side 0 is the left image, 1 the right one.
        """  # noqa: D400
        rig = self.rig
        left = float(col)
        for _ in range(1 + _RIGHT_ROUNDS * side):
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
        When the images show no road surface and the calibration does not give the height of the cameras.
    """
    rig, shape = pair.rig, fit_pair_road(pair)
    if shape is not None:
        return PairRoad(rig, shape, rig.R_vehicle_camera @ shape.plane.up(rig))
    if not CAMERA_HEIGHT_M[0] <= rig.position_m[2] <= CAMERA_HEIGHT_M[1]:
        raise InputError(
            "the pair shows no road surface", where=f"pair {pair.number}", advice="pick in another pair"
        )
    return PairRoad(rig, None, np.array([0.0, 0.0, 1.0]))
