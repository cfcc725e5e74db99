"""Following a picked edge through stereo pairs: the second approach of He and Novak (1992, section 3.5).

G. He, K. Novak (1992): Automatic analysis of highway features from digital stereo-images, ISPRS XXIX B3, 119-124.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from linework.arrays import FloatArray
from linework.errors import InputError
from linework.methods.picked_edge.carry import carry_into_pair, extend_by_pair, followed_places
from linework.methods.picked_edge.fitted import LEAST_CARRIED_PLACES
from linework.methods.picked_edge.follow import UNSEEN_M, EdgeStop, EdgeVertex, FollowedStretch, follow_edge
from linework.methods.picked_edge.line import EdgeSightings, edge_through, line_of, with_pose_sigmas
from linework.methods.picked_edge.pick import (
    FARTHEST_PICK_M,
    EdgeRefusal,
    PairRoad,
    PickedStart,
    nearest_pick,
    pick_edge,
    road_in,
)
from linework.methods.picked_edge.state import STATE_ACROSS, STATE_HEIGHT, bent_like_path, path_heading
from linework.methods.picked_edge.view import PairView
from linework.model.images import Poses, RectifiedPair
from linework.model.lines import LineSet

#: Kinds of line that can be picked.
EDGE_KINDS = ("lane_marking", "road_boundary")
SIDES = ("left", "right")
#: Least distance between pairs that are used: nearer ones show the same. [m]
_MOVED_M = 0.3


@dataclass(frozen=True, slots=True)
class EdgeStep:
    """The line as one pair shows it.

    Parameters
    ----------
    number
        Number of the pair.
    xyz
        (n, 3) vertices in order along the line. [m, world]
    sigma_xy_m, sigma_z_m
        (n,) standard deviations across and of the height, from this pair alone. [m]
    in_both
        (n,) bool: whether both images show the vertex.
    left_px, right_px
        (n, 2) columns and rows in the rectified images. [pixels]
    stops
        Why the line ends in this pair, at its start and end.
    course
        (k, 3) the line from all pairs so far, not yet smoothed. [m, world]
    """

    number: int
    xyz: FloatArray
    sigma_xy_m: FloatArray
    sigma_z_m: FloatArray
    in_both: FloatArray
    left_px: FloatArray
    right_px: FloatArray
    stops: tuple[EdgeStop, EdgeStop]
    course: FloatArray


@dataclass(frozen=True, slots=True)
class PickedEdge:
    """A followed edge: one line, why it ends, its pixels in each pair, and messages of pairs that could not be read."""

    kind: str
    lines: LineSet
    stops: tuple[EdgeStop, EdgeStop]
    pixels: dict[int, tuple[FloatArray, FloatArray]]
    failures: tuple[str, ...] = ()


class NoEdgeAtPixelError(InputError):
    """Raised for a pixel from which no edge can be followed.

    Parameters
    ----------
    reason
        Why no edge can be followed.
    pick
        Number of the pair; column and row. [pixels, rectified]
    works
        Nearest pixel from which an edge can be followed; None if there is none nearby.
    """

    def __init__(self, reason: str, pick: tuple[int, float, float], works: tuple[int, int] | None) -> None:
        self.reason, self.pick, self.works = reason, pick, works
        advice = "pick a pixel on a line" if works is None else f"pick {works[0]},{works[1]}"
        super().__init__(f"{reason} at {pick[1]:.0f},{pick[2]:.0f}", where=f"pair {pick[0]}", advice=advice)


@dataclass(frozen=True, slots=True)
class PosedPairs:
    """Stereo pairs in time order and their poses.

    Parameters
    ----------
    source
        Returns the rectified pair of a number; a pair that raises `InputError` is left out.
    numbers
        Numbers of the pairs; pose i belongs to ``numbers[i]``.
    """

    source: Callable[[int], RectifiedPair]
    numbers: Sequence[int]
    poses: Poses

    @property
    def origin(self) -> FloatArray:
        """(3,) origin of the local world, near the first pose. [m, world]"""  # noqa: D400
        return np.asarray(np.round(self.poses.xyz[0]))


@dataclass(slots=True)
class _Following:
    """State of following: the line so far in order, why it ends at its start and end, and the step of each pair."""

    drive: PosedPairs
    course: tuple[EdgeVertex, ...] = ()
    stops: list[EdgeStop] = field(default_factory=lambda: [EdgeStop.FADED, EdgeStop.FADED])
    steps: list[EdgeStep] = field(default_factory=list)
    vertices: list[tuple[EdgeVertex, ...]] = field(default_factory=list)
    failures: list[str] = field(default_factory=list)


def follow_picked(
    drive: PosedPairs, pick: tuple[int, float, float], *, side: str = "left", kind: str = ""
) -> Generator[EdgeStep, bool | None, PickedEdge]:
    """Follow the edge next to a picked pixel; yield the step of each pair, and return the whole line.

    Parameters
    ----------
    pick
        Number of the pair; column and row. [pixels, rectified]
    side
        "left" or "right": the image that the pixel was picked in.
    kind
        One of `EDGE_KINDS`; "": stripes of paint are lane markings, other edges road boundaries.

    Raises
    ------
    NoEdgeAtPixelError
        When no edge can be followed from the pixel.
    InputError
        When the picked pair cannot be read or shows no road.

    Notes
    -----
    ``send(True)`` stops following and returns the line so far.
    """
    at = list(drive.numbers).index(pick[0])
    pair = drive.source(pick[0])
    # The road surface of the picked pair
    road = road_in(pair)
    view = PairView.of(pair, drive.poses, at, drive.origin, road.up_vehicle)
    # The edge at the pixel, and its pattern
    picked = _picked(view, road, drive, at, pick[1:], SIDES.index(side), kind)
    # Along it in both images of this pair, away from the van and towards it
    back, ahead = _both_ways(view, picked)
    follow = _Following(drive)
    if (yield _taken(follow, view, back, ahead, is_nearer=True)):
        return _whole(follow, kind, EdgeStop.CALLER)
    # Into the next pairs, then from the picked one into those before it
    for way in (1, -1):
        for view in _views(follow, at, way, road.up_vehicle):
            found = carry_into_pair(follow.course, view)
            if found is not None and (yield _taken(follow, view, *found, is_nearer=way > 0)):
                return _whole(follow, kind, EdgeStop.CALLER)
    return _whole(follow, kind, None)


def _picked(
    view: PairView,
    road: PairRoad,
    drive: PosedPairs,
    at: int,
    pixel: tuple[float, float],
    side: int,
    kind: str,
) -> PickedStart:
    """Return the edge at a pixel.

    Raises
    ------
    NoEdgeAtPixelError
        When there is none, with the nearest pixel from which an edge can be followed.
    """

    def tried(col: float, row: float) -> PickedStart | EdgeRefusal:
        place = road.under(side, col, row)
        if place is None:
            return EdgeRefusal(f"above the horizon of the road or more than {FARTHEST_PICK_M:.0f} m away")
        place, path = drive.poses.to_world(at, place[None])[0] - drive.origin, drive.poses.xyz - drive.origin
        found = pick_edge(view, side, place, kind, path_heading(place, path))
        if isinstance(found, PickedStart):
            found = replace(found, state=bent_like_path(found.state, path))
            back, ahead = _both_ways(view, found)
            if sum(v.in_both for v in (*back.vertices, *ahead.vertices)) < LEAST_CARRIED_PLACES:
                return EdgeRefusal(f"the edge cannot be followed on the road ({ahead.stop})")
        return found

    found = tried(*pixel)
    if isinstance(found, PickedStart):
        return found
    works = nearest_pick(
        view.images[side],
        pixel,
        lambda col, row: road.under(side, col, row) is not None,
        lambda col, row: isinstance(tried(col, row), PickedStart),
    )
    raise NoEdgeAtPixelError(found.reason, (view.number, *pixel), works)


def _both_ways(view: PairView, picked: PickedStart) -> tuple[FollowedStretch, FollowedStretch]:
    """Return a picked line followed in one pair, against its direction and along it."""
    ahead = follow_edge(view, picked.state, picked.template, 1)
    back = follow_edge(view, picked.state, picked.template, -1)
    # The first vertex is in both
    return replace(back, vertices=back.vertices[1:]), ahead


def _views(follow: _Following, at: int, way: int, up_vehicle: FloatArray) -> Iterator[PairView]:
    """Yield the later (1) or earlier (-1) pairs, as long as they can show the line."""
    drive = follow.drive
    last_seen = last_looked = drive.poses.xyz[at]
    n_seen = len(follow.steps)
    for i in range(at + way, len(drive.numbers) if way > 0 else -1, way):
        here = drive.poses.xyz[i]
        if np.linalg.norm(here - last_looked) < _MOVED_M:
            continue
        last_looked = here
        try:
            pair = drive.source(drive.numbers[i])
        except InputError as error:
            follow.failures.append(str(error))
            continue
        view = PairView.of(pair, drive.poses, i, drive.origin, up_vehicle)
        if way > 0 and (view.depth_m(followed_places(follow.course)) < 0.0).all():
            return
        yield view
        if len(follow.steps) > n_seen:
            last_seen, n_seen = here, len(follow.steps)
        elif np.linalg.norm(here - last_seen) > UNSEEN_M:
            return
    # The line may continue, but there are no more images
    end = 1 if way > 0 else 0
    if follow.stops[end] in (EdgeStop.RANGE, EdgeStop.LEFT_IMAGE):
        follow.stops[end] = EdgeStop.END_OF_IMAGES


def _taken(
    follow: _Following, view: PairView, back: FollowedStretch, ahead: FollowedStretch, *, is_nearer: bool
) -> EdgeStep:
    """Add the vertices of a pair to the line, and return its step."""
    vertices = (*reversed(back.vertices), *ahead.vertices)
    before = follow.course
    follow.course = vertices
    if before:
        ends = ahead.stop not in (EdgeStop.LEFT_IMAGE, EdgeStop.HIDDEN)
        follow.course = extend_by_pair(before, vertices, is_nearer=is_nearer, ends=ends)
    # The reason of an end is that of the pair that extended it or is nearer to it
    if follow.course[-1] is not (before[-1] if before else None):
        follow.stops[1] = ahead.stop
    if follow.course[0] is not (before[0] if before else None):
        follow.stops[0] = back.stop
    xyz = followed_places(vertices)
    sigma = np.sqrt([np.diag(v.state.covariance)[[STATE_ACROSS, STATE_HEIGHT]] for v in vertices])
    step = EdgeStep(
        view.number, xyz + follow.drive.origin, sigma[:, 0], sigma[:, 1],
        np.array([v.in_both for v in vertices]), view.pixels(0, xyz), view.pixels(1, xyz), (back.stop, ahead.stop),
        followed_places(follow.course) + follow.drive.origin,
    )  # fmt: skip
    follow.steps.append(step)
    follow.vertices.append(vertices)
    return step


def _whole(follow: _Following, kind: str, stop: EdgeStop | None) -> PickedEdge:
    """Return the smooth line through the vertices of all pairs."""
    drive, steps = follow.drive, follow.steps
    found = [(v, s.number) for vertices, s in zip(follow.vertices, steps, strict=True) for v in vertices]
    rows = [(v.expected.frame[0], v.expected.frame[2], *seen, n) for v, n in found for seen in v.seen]
    place, left, across, variance, lift, pair = (np.array(column) for column in zip(*rows, strict=True))
    edge = edge_through(
        followed_places(follow.course), EdgeSightings(place, left, across, variance, lift, pair)
    )
    width_m = _width(follow.course)
    kind = kind or ("road_boundary" if np.isnan(width_m) else "lane_marking")
    used = np.flatnonzero(np.isin(drive.numbers, pair))
    lines = with_pose_sigmas(line_of(edge, kind, width_m), drive.poses, used)
    return PickedEdge(
        kind, lines.with_columns(xyz=lines.xyz + drive.origin),
        (stop or follow.stops[0], stop or follow.stops[1]),
        {s.number: (s.left_px, s.right_px) for s in steps}, tuple(follow.failures),
    )  # fmt: skip


def _width(course: tuple[EdgeVertex, ...]) -> float:
    """Return the median width of the paint at the better half of the vertices; NaN for a bare edge. [m]"""  # noqa: D400
    best = sorted(course, key=lambda v: min(seen[1] for seen in v.seen))[: max(len(course) // 2, 1)]
    return float(np.median([v.template.width_m for v in best]))
