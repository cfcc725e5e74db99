"""Following a line step by step through one stereo pair, to where it is no longer visible."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import StrEnum

import numpy as np

from linework.methods.picked_edge.fitted import AGREE, ALONE_STEPS, BARE_EDGE_M, LONGER, MOST_GATE_M
from linework.methods.picked_edge.match import (
    EdgeMatch,
    ExpectedPlace,
    ImageScale,
    adapt_template,
    match_edge,
    scale_at,
)
from linework.methods.picked_edge.state import LineState, advanced, corrected, measurement_variance
from linework.methods.picked_edge.template import LEAST_TEMPLATE_SIDE_M, Template
from linework.methods.picked_edge.view import PairView, is_hidden

#: Length of a step near the cameras; farther away it is at least one row or column of the image. [m]
FOLLOW_STEP_M = 0.25
#: Largest extent of a row or column along the line, and of a pixel across it: coarser ones do not resolve paint. [m]
MOST_ALONG_M, MOST_ACROSS_M = 1.5, 0.15
#: Largest extent of a row where a lost line may be found again: more are too few rows for four steps. [m]
AGAIN_ALONG_M = 1.0
#: Largest standard deviation across at which a line is still followed. [m]
MOST_STEP_SIGMA_M = 0.5
#: Longest stretch without a match: the longest gap between dashes (12 m), or a parked car. [m]
UNSEEN_M = 13.0
#: Stretch without a match from which a line counts as bridged. [m]
EDGE_BRIDGED_M = 1.0
#: Distance from an image's border within which it need not show the line. [pixels]
_BORDER_PX = 6.0
#: Width of the gate of a match, in standard deviations of the expected position.
_GATE_SIGMAS = 3.0
#: Distances ahead of a line's end at which an object in front of it is looked for. [m]
_HIDDEN_AHEAD_M = (0.75, 1.5, 3.0)


class EdgeStop(StrEnum):
    """Why a picked edge ends."""

    LEFT_IMAGE = "the line leaves the image"
    RANGE = "too far away to measure"
    HIDDEN = "hidden by something in front of it"
    FADED = "no longer visible"
    BRANCHES = "the line branches"
    END_OF_IMAGES = "the images end there"
    CALLER = "stopped on request"


@dataclass(frozen=True, slots=True)
class EdgeVertex:
    """A place where a line was measured in a pair.

    Parameters
    ----------
    expected
        The expected place.
    seen
        For each image that shows the line: its distance to the left of the expected place [m], the variance [m^2],
        and its apparent shift to the left per metre of height [m/m].
    state
        State of the filter after these measurements.
    template
        The template after the update with the better match.
    """

    expected: ExpectedPlace
    seen: tuple[tuple[float, float, float], ...]
    state: LineState
    template: Template

    @property
    def in_both(self) -> bool:
        """Whether both images show it."""
        return len(self.seen) == 2


@dataclass(frozen=True, slots=True)
class FollowedStretch:
    """The vertices of a line in one pair and one direction, in the order they were measured, and why it ends."""

    vertices: tuple[EdgeVertex, ...]
    stop: EdgeStop


@dataclass(slots=True)
class _Walk:
    """State of following: the vertices, the length since the last match, and vertices on trial after a gap.

    `carried` is the state predicted without the vertices on trial.
    """

    state: LineState
    first: Template
    vertices: list[EdgeVertex] = field(default_factory=list)
    unseen_m: float = 0.0
    trials: list[EdgeVertex | None] = field(default_factory=list)
    n_ambiguous: int = 0
    carried: LineState = field(init=False)

    def __post_init__(self) -> None:
        self.carried = self.state

    @property
    def template(self) -> Template:
        """The template at the last vertex."""
        return self.vertices[-1].template if self.vertices else self.first


def follow_edge(view: PairView, start: LineState, template: Template, way: int) -> FollowedStretch:
    """Return a line followed in one pair from a known place.

    Parameters
    ----------
    way
        1 follows in the direction of the state, -1 against it.

    Notes
    -----
    Least-squares matching of the profile across the line with the shift as the only unknown, step by step in both
    images (He and Novak 1992, section 3.5: row by row). The profile always lies across the line, so that a line along
    the rows is followed column by column. Where it is not visible the filter predicts it; after a gap three of four
    steps must agree before it continues.
    """
    walk = _Walk(start, template)
    while True:
        place = walk.state.frame(view.up)
        scales = [scale_at(view, side, place) for side in (0, 1)]
        stop = _ended(view, walk, place, scales)
        if stop is not None:
            return FollowedStretch(tuple(walk.vertices), stop)
        step = max(FOLLOW_STEP_M, min(s.along_m for s in scales if s is not None))
        vertex, is_alone = _measured(view, walk, place, scales, step)
        _take(walk, vertex, is_alone, step)
        if walk.n_ambiguous >= AGREE[0]:
            return FollowedStretch(tuple(walk.vertices), EdgeStop.BRANCHES)
        walk.state, walk.carried = (advanced(s, way * step) for s in (walk.state, walk.carried))


def _ended(
    view: PairView, walk: _Walk, place: ExpectedPlace, scales: list[ImageScale | None]
) -> EdgeStop | None:
    """Return why the line ends here, None if it continues."""
    at = place.frame[:1]
    if not view.is_inside(0, at)[0] and not view.is_inside(1, at)[0]:
        if walk.unseen_m > 0.5 * UNSEEN_M:
            return _why_unseen(view, walk)
        return EdgeStop.LEFT_IMAGE
    known = [s for s in scales if s is not None]
    if not known:
        return EdgeStop.RANGE
    best = min(known, key=lambda s: s.along_m)
    if best.along_m > MOST_ALONG_M or best.pixel_m > MOST_ACROSS_M:
        return EdgeStop.RANGE if walk.unseen_m <= 0.5 * UNSEEN_M else _why_unseen(view, walk)
    if walk.unseen_m > EDGE_BRIDGED_M and best.along_m > AGAIN_ALONG_M:
        return _why_unseen(view, walk)
    if walk.unseen_m > UNSEEN_M or walk.state.covariance[0, 0] > MOST_STEP_SIGMA_M**2:
        return _why_unseen(view, walk)
    return None


def _why_unseen(view: PairView, walk: _Walk) -> EdgeStop:
    """Return whether the line is hidden by an object where it was lost, or has faded."""
    last = walk.vertices[-1].state if walk.vertices else walk.state
    turn = np.sign((walk.state.place - last.place) @ last.frame(view.up).frame[1]) or 1.0
    ahead = [advanced(last, float(turn) * d).place for d in _HIDDEN_AHEAD_M]
    return EdgeStop.HIDDEN if is_hidden(view, np.array(ahead)) else EdgeStop.FADED


def _measured(
    view: PairView, walk: _Walk, place: ExpectedPlace, scales: list[ImageScale | None], step: float
) -> tuple[EdgeVertex | None, bool]:
    """Return the vertex that both images agree on, or None, and whether it is the only match in the gates."""
    # Windows longer than a step overlap; the variance is scaled so that all steps together keep their information
    first = 1.0 if walk.template.is_stripe else max(BARE_EDGE_M / step, 1.0)
    seen: list[tuple[float, float, float]] = []
    matches: list[EdgeMatch] = []
    is_alone, n_inside = True, 0
    for side, scale in enumerate(scales):
        if scale is None or not view.is_inside(side, place.frame[:1], _BORDER_PX)[0]:
            continue
        n_inside += 1
        # The match in the left image narrows the gate in the right one
        so_far = corrected(walk.state, place.frame[2], seen)
        offset = so_far.place - place.frame[0]
        expected = float(offset[:2] @ place.frame[2, :2]) + scale.lift * float(offset[2])
        reach = _GATE_SIGMAS * np.sqrt(measurement_variance(so_far, scale.lift)) + scale.pixel_m
        gate = (expected, float(min(reach, max(_most_gate(walk.template), 2.0 * scale.pixel_m))))
        match, longer = match_edge(view, side, place, walk.template, gate, first * step), first
        if match is None:
            # Weak edges show over a longer window
            longer = LONGER * first
            match = match_edge(view, side, place, walk.template, gate, longer * step)
        if match is not None:
            seen.append((match.across_m, longer * match.sigma_m**2, scale.lift))
            matches.append(match)
            is_alone &= match.is_alone
    # Grain of the road and leaves match by chance in one image, hardly in both
    n_alone = sum(not v.in_both for v in walk.vertices[-ALONE_STEPS:])
    if len(seen) < n_inside or not seen or (n_inside == 1 and n_alone == ALONE_STEPS):
        return None, True
    state = corrected(walk.state, place.frame[2], seen)
    template = adapt_template(walk.template, max(matches, key=lambda m: m.correlation))
    return EdgeVertex(place, tuple(seen), state, template), is_alone


def _most_gate(template: Template) -> float:
    """Return the largest half width of the gate: less than the distance to the next line. [m]"""  # noqa: D400
    return (
        min(MOST_GATE_M, max(0.5 * template.free_m, LEAST_TEMPLATE_SIDE_M))
        if not template.is_stripe
        else MOST_GATE_M
    )


def _take(walk: _Walk, vertex: EdgeVertex | None, is_alone: bool, step: float) -> None:
    """Add a vertex: at once while the line is visible, after enough steps that agree where it was lost."""
    if walk.unseen_m <= max(EDGE_BRIDGED_M, 1.5 * step) and not walk.trials:
        if vertex is None:
            walk.unseen_m += step
        else:
            walk.vertices.append(vertex)
            walk.state, walk.unseen_m = vertex.state, 0.0
        return
    walk.unseen_m += step
    if vertex is None and not walk.trials:
        return
    if not walk.trials:
        walk.carried = walk.state
    walk.trials.append(vertex)
    walk.n_ambiguous += not is_alone
    if vertex is not None:
        walk.state = vertex.state
    if len(walk.trials) == AGREE[1]:
        found = [v for v in walk.trials if v is not None]
        if len(found) >= AGREE[0]:
            walk.vertices += found
            walk.unseen_m = 0.0
        else:
            walk.state = walk.carried
        walk.trials, walk.n_ambiguous = [], 0
