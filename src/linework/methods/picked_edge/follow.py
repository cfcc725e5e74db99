"""A line followed through one stereo pair, step by step along it, to where it is no longer to be seen."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import StrEnum

import numpy as np

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

#: Steps near the cameras; farther away a step is at least one row or column of the image. [m]
FOLLOW_STEP_M = 0.25
#: One row or column that covers more than this along the line, or more than this across it, shows no line. [m]
MOST_ALONG_M, MOST_ACROSS_M = 1.5, 0.15
#: A line that was lost is believed again only where a row covers less than this: four rows are few. [m]
AGAIN_ALONG_M = 1.0
#: Beyond this standard deviation across the line is not followed. [m]
MOST_STEP_SIGMA_M = 0.5
#: Without being seen a line is followed this far: the longest gap between dashes (12 m) and a parked car.
UNSEEN_M = 13.0
#: Without being seen for longer than this, a stretch was bridged; and steps that must agree before it goes on.
EDGE_BRIDGED_M, AGREE = 1.0, (3, 4)
#: Where one step's length does not show the line, so many are looked at together.
LONGER = 3.0
#: A bare edge is ragged and its texture has no sharp rise: it is looked at over this length at once. [m]
BARE_EDGE_M = 2.0
#: Nearer to an image's border than this it need not show the line. [pixels]
_BORDER_PX = 6.0
#: So many steps one image alone may go on where the line has left the other one.
_ALONE = 8
#: A match is looked for at most this far from where it is expected: nearer than the next line. [m]
MOST_GATE_M = 0.5


class EdgeStop(StrEnum):
    """Why a picked edge goes no further."""

    LEFT_IMAGE = "it leaves the image"
    RANGE = "it is too far away to be measured"
    HIDDEN = "something stands before it"
    FADED = "it is not to be seen any further"
    BRANCHES = "it branches"
    END_OF_IMAGES = "the images end"
    CALLER = "the caller stopped it"


@dataclass(frozen=True, slots=True)
class EdgeVertex:
    """A place where a line was measured in a pair.

    Parameters
    ----------
    expected
        Where it was expected.
    seen
        For each image that showed it: how far to the left of there, the variance [m, m^2], and how far the line
        seems to move when it is lifted [m/m].
    state
        Of the filter with that.
    template
        As renewed there.
    """

    expected: ExpectedPlace
    seen: tuple[tuple[float, float, float], ...]
    state: LineState
    template: Template

    @property
    def in_both(self) -> bool:
        """Whether both images showed it."""
        return len(self.seen) == 2


@dataclass(frozen=True, slots=True)
class FollowedStretch:
    """What one pair showed of a line in one direction, in the order it was followed, and why it ends."""

    vertices: tuple[EdgeVertex, ...]
    stop: EdgeStop


@dataclass(slots=True)
class _Walk:
    """What following remembers: the vertices, since when the line is not seen, and what may be it again.

    `carried` is where the line would be had none of the places on trial been seen.
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
        """The pattern as it looked where the line was seen last."""
        return self.vertices[-1].template if self.vertices else self.first


def follow_edge(view: PairView, start: LineState, template: Template, way: int) -> FollowedStretch:
    """Follow a line in one pair from a known place.

    Parameters
    ----------
    way
        1: along the state's direction; -1: against it.

    Notes
    -----
    One-parameter least-squares matching of the profile across the line, a step after the other, in both images
    (He and Novak 1992, section 3.5: row by row). The profile lies across the line wherever it goes, so that a line
    that runs along the rows is followed column by column. Where neither image shows it the filter carries it on;
    after that three of four steps must agree before it is believed.
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
    """Return why the line ends here, None if it goes on."""
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
    """Return whether something stands before the line where it was lost, or it has faded."""
    last = walk.vertices[-1].state if walk.vertices else walk.state
    turn = np.sign((walk.state.place - last.place) @ last.frame(view.up).frame[1]) or 1.0
    ahead = [advanced(last, float(turn) * d).place for d in (0.75, 1.5, 3.0)]
    return EdgeStop.HIDDEN if is_hidden(view, np.array(ahead)) else EdgeStop.FADED


def _measured(
    view: PairView, walk: _Walk, place: ExpectedPlace, scales: list[ImageScale | None], step: float
) -> tuple[EdgeVertex | None, bool]:
    """Return what both images show here, and whether there is only one place that it can be."""
    # Steps overlap where more than one is looked at: the variance stays that of all of them together
    first = 1.0 if walk.template.is_stripe else max(BARE_EDGE_M / step, 1.0)
    seen: list[tuple[float, float, float]] = []
    matches: list[EdgeMatch] = []
    is_alone, n_inside = True, 0
    for side, scale in enumerate(scales):
        if scale is None or not view.is_inside(side, place.frame[:1], _BORDER_PX)[0]:
            continue
        n_inside += 1
        # What the left image showed narrows down where the right one can
        so_far = corrected(walk.state, place.frame[2], seen)
        offset = so_far.place - place.frame[0]
        expected = float(offset[:2] @ place.frame[2, :2]) + scale.lift * float(offset[2])
        reach = 3.0 * np.sqrt(measurement_variance(so_far, scale.lift)) + scale.pixel_m
        gate = (expected, float(min(reach, max(_most_gate(walk.template), 2.0 * scale.pixel_m))))
        match, longer = match_edge(view, side, place, walk.template, gate, first * step), first
        if match is None:
            # Weak edges show over a longer stretch; the next steps' stretches overlap it
            longer = LONGER * first
            match = match_edge(view, side, place, walk.template, gate, longer * step)
        if match is not None:
            seen.append((match.across_m, longer * match.sigma_m**2, scale.lift))
            matches.append(match)
            is_alone &= match.is_alone
    # Grain of the road and leaves look like anything in one image; the line is where both show it
    n_alone = sum(not v.in_both for v in walk.vertices[-_ALONE:])
    if len(seen) < n_inside or not seen or (n_inside == 1 and n_alone == _ALONE):
        return None, True
    state = corrected(walk.state, place.frame[2], seen)
    template = adapt_template(walk.template, max(matches, key=lambda m: m.correlation))
    return EdgeVertex(place, tuple(seen), state, template), is_alone


def _most_gate(template: Template) -> float:
    """Return how far from where it is expected a line is looked for: not as far as the next one. [m]"""  # noqa: D400
    return (
        min(MOST_GATE_M, max(0.5 * template.free_m, LEAST_TEMPLATE_SIDE_M))
        if not template.is_stripe
        else MOST_GATE_M
    )


def _take(walk: _Walk, vertex: EdgeVertex | None, is_alone: bool, step: float) -> None:
    """Believe a measured place at once where the line is being seen, after some that agree where it was lost."""
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
