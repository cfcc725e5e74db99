"""What guardrails are by form, and what else has the cross-section of a rail, a concrete barrier or a fence.

Separate from `rail_lines`, which decides by the vertical profile alone: this adds what the whole section shows.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from linework.arrays import BoolArray, FloatArray
from linework.methods.rails.chains import long_runs
from linework.methods.rails.circles import Bins, CircleConfig
from linework.methods.rails.forms import (
    FormedStretch,
    fitted_again,
    form_of_run,
    formed_stretches,
    forms_along,
    is_agreed,
    lid_of_run,
)
from linework.methods.rails.placed import PlacedRail, Stretch, in_plan, near_nodes, place_rails
from linework.methods.rails.profile import ProfileConfig
from linework.methods.rails.verdict import NodeScores
from linework.surface.road import Ground

#: Share of a line from which on another line that runs on it stands for it: on a lid, on the posts behind.
_AGAIN = 0.5
#: Mean score of a stretch from which on it is more likely what it shows than not.
_LIKELY = 0.5
#: A mesh lets the scanner see what lies behind it, unless the land falls away there; a wall does not. Where nothing is
#: seen behind, it is a little more likely a mesh than not: its section is that of a thin sheet. Set, not measured.
_BLIND = 0.6
#: Share of the points of the upper 3 cm behind the face from which on there is a lid: a beam under 3 cm of noise has a
#: quarter of them there, a wall 0.3 m thick three quarters.
_LID = 0.5
#: Score of a node that is rather on one line than not.
_STEADY = 0.5


@dataclass(frozen=True, slots=True)
class Surroundings:
    """What rails were fitted to and with."""

    bins: Bins
    surface: Ground
    circles: CircleConfig
    config: ProfileConfig


class _Shown(NamedTuple):
    """A stretch of a placed rail that shows a form, the scores of the rail, and which of its nodes (n,) are paired."""

    placed: PlacedRail
    verdict: NodeScores
    stretch: FormedStretch
    paired: BoolArray

    @property
    def xyz(self) -> FloatArray:
        """Nodes (k, 3). [m, world]."""
        return self.placed.xyz[self.stretch.run]

    @property
    def score(self) -> FloatArray:
        """Score (k,) of each node."""
        explained = min(self.stretch.agreeing, self.stretch.section.explained)
        score = np.asarray(self.verdict.steady[self.stretch.run] * explained)
        if self.stretch.section.form == "mesh":
            score = np.where(self.verdict.open_[self.stretch.run], score, _BLIND * score)
        if self.stretch.section.form in ("w_beam", "thrie_beam"):
            # A wall whose foot is hidden has the height of a deep beam, and a lid
            highest = self.stretch.section.bands[0]
            lid = highest.top_share - highest.below_share
            score = (1.0 - lid) * score if lid >= _LID else score
        return score


def with_forms(
    found: list[Stretch],
    barriers: list[Stretch],
    placed: list[PlacedRail],
    verdicts: list[NodeScores],
    around: Surroundings,
) -> list[Stretch]:
    """Return the guardrails with their forms, the barriers, and what else has a form where neither of them is.

    Parameters
    ----------
    found, barriers
        Guardrails and barriers that their vertical profile told.
    placed, verdicts
        All followed sheets, and the scores of their nodes.
    around
        What they were fitted to and with.
    """
    kept: list[Stretch] = []
    shown: list[_Shown] = []
    of_found = in_plan(found)
    least = round(around.config.min_length_m / around.circles.spacing_m) + 1
    for p, verdict in zip(placed, verdicts, strict=True):
        own = [s for s in found if s.placed is p]
        free = (verdict.steady >= _STEADY) & ~near_nodes(p.xyz, of_found)
        if not own and np.count_nonzero(free) < least:
            continue
        at, forms = forms_along(p, around.bins, around.surface, around.circles)
        others = formed_stretches(at, forms, free, p.height_m, around.circles, around.config)
        alone = np.zeros(len(p.xyz), dtype=bool)
        shown += [_Shown(p, verdict, s, alone) for s in others if _is_more_than_high(p, s, around.config)]
        for s in own:
            stretch = form_of_run(at, forms, s.run, p.height_m)
            other = _Shown(p, verdict, stretch, s.paired)
            is_other = is_agreed(stretch) and stretch.section.form != "w_beam"
            if is_other and np.mean(other.score) >= _LIKELY:
                shown.append(other)
            else:
                kept += _likely_rail(_of_form(s, stretch), lid_of_run(at, forms, s.run))
    concrete = _each_once([s for s in shown if s.stretch.section.kind == "barrier"], [], around)
    concrete = _barriers_once(concrete, barriers, least)
    # Nothing else stands on a barrier
    no_concrete = [s for s in shown if s.stretch.section.kind != "barrier"]
    return kept + _each_once(no_concrete, concrete, around) + concrete


def _likely_rail(found: Stretch, lid: float) -> list[Stretch]:
    """Return a guardrail with what the share of points on a lid behind its top edge leaves of its score; none at less than half.

    A low wall has the height and the clear top of a beam, but is as thick as it is: half and more of what is seen of its
    upper 3 cm lies behind its face. A beam whose section shows a form has no such lid.
    """
    if found.form or lid < _LID:
        return [found]
    score = found.score * (1.0 - lid)
    return [replace(found, score=score)] if np.mean(score) >= _LIKELY else []


def _is_more_than_high(placed: PlacedRail, stretch: FormedStretch, config: ProfileConfig) -> bool:
    """Return whether a stretch shows more than the height of a W-beam, where its profile speaks against one.

    Its profile refuses beams one above another, as boards are; folded ones are as deep as one alone.
    """
    if stretch.section.form != "w_beam":
        return True
    spread_m = placed.rail.profile.spread_m[stretch.run]
    known = spread_m[~np.isnan(spread_m)]
    return len(stretch.section.bands) > 1 and len(known) > 0 and bool(np.median(known) >= config.min_spread_m)


def _barriers_once(formed: list[Stretch], profiled: list[Stretch], least: int) -> list[Stretch]:
    """Return the barriers that were found by form and by profile, each once.

    Of one by profile, what lies on those by form is left out, which go on to the ends; parts of at least `least` nodes
    remain.
    """
    of_formed = in_plan(formed)
    out = []
    for s in profiled:
        near = near_nodes(s.xyz, of_formed)
        out += [_part(s, run) for run in long_runs(~near, least)] if near.any() else [s]
    return formed + out


def _part(s: Stretch, part: slice) -> Stretch:
    """Return some of the nodes of a stretch."""
    run = slice(s.run.start + part.start, s.run.start + part.stop)
    return replace(s, run=run, score=s.score[part])


def _each_once(shown: list[_Shown], taken: list[Stretch], around: Surroundings) -> list[Stretch]:
    """Return the lines of stretches, the longest first, without those that mostly run on a line before them."""
    lines: list[Stretch] = []
    likely = [s for s in shown if np.mean(s.score) >= _LIKELY]
    before = [in_plan(taken)]
    for s in sorted(likely, key=_longest_first):
        if np.mean(np.any([near_nodes(s.xyz, nodes) for nodes in before], axis=0)) < _AGAIN:
            own = list(_lines_of(s, around))
            before.append(in_plan(own))
            lines += own
    return lines


def _longest_first(s: _Shown) -> tuple[int, list[list[float]], str]:
    """Return what stretches are sorted by: equally long ones by place, whatever the order that they are found in."""
    return -len(s.xyz), sorted(s.xyz[[0, -1]].tolist()), s.stretch.section.form


def _lines_of(shown: _Shown, around: Surroundings) -> Iterator[Stretch]:
    """Yield the lines of a stretch, fitted again."""
    section, run, score = shown.stretch.section, shown.stretch.run, shown.score
    fits = fitted_again(shown.placed.rail, shown.stretch, around.bins, around.circles, around.config)
    whole = NodeScores(score, score, np.ones_like(score), steady=score, open_=shown.verdict.open_[run])
    is_one = len(section.lines) == 1
    number = float(len(section.bands)) if is_one else 1.0
    for fit, band in zip(place_rails(fits, around.bins, around.surface), section.lines, strict=True):
        lowest = section.bands[-1] if is_one else band
        yield Stretch(
            section.kind,
            fit,
            slice(0, len(score)),
            score,
            whole,
            shown.paired[run],
            section.form,
            band.high_m - lowest.low_m,
            np.nan if section.kind == "barrier" else number,
        )


def _of_form(found: Stretch, stretch: FormedStretch) -> Stretch:
    """Return a guardrail with the form of a W-beam where most of its windows show one."""
    if not is_agreed(stretch) or stretch.section.form != "w_beam":
        return found
    bands = stretch.section.bands
    return replace(found, form="w_beam", depth_m=-bands[-1].low_m, n_beams=float(len(bands)))
