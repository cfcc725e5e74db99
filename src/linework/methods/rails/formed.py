"""What guardrails are by form, and what else has the cross-section of a rail, a concrete barrier or a fence.

Separate from `rail_lines`, which decides by the vertical profile alone: this adds what the whole section shows.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from linework.arrays import FloatArray
from linework.methods.rails.circles import Bins, CircleConfig
from linework.methods.rails.forms import (
    FormedStretch,
    fitted_again,
    form_of_run,
    formed_stretches,
    forms_along,
    is_agreed,
)
from linework.methods.rails.placed import PlacedRail, Stretch, near_stretches, place_rails
from linework.methods.rails.profile import ProfileConfig
from linework.methods.rails.verdict import NodeScores
from linework.surface.road import Ground

#: Share of a line from which on another line that runs on it stands for it.
_MOSTLY = 0.8
#: The same for what a form is found on a second time: on a lid, on the posts behind.
_AGAIN = 0.5
#: Mean score of a stretch from which on it is more likely what it shows than not.
_LIKELY = 0.5
#: Score of a node that is rather on one line than not.
_STEADY = 0.5


@dataclass(frozen=True, slots=True)
class Surroundings:
    """What rails were fitted to and with."""

    bins: Bins
    surface: Ground
    circles: CircleConfig
    config: ProfileConfig


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
    shown: list[tuple[PlacedRail, NodeScores, FormedStretch]] = []
    least = round(around.config.min_length_m / around.circles.spacing_m) + 1
    for p, verdict in zip(placed, verdicts, strict=True):
        own = [s for s in found if s.placed is p]
        free = (verdict.steady >= _STEADY) & ~near_stretches(p.xyz, found)
        if not own and np.count_nonzero(free) < least:
            continue
        at, forms = forms_along(p.rail, p.above_ground_m, around.bins, around.circles)
        # What is no guardrail by its profile is none by its height alone
        others = formed_stretches(at, forms, free, around.circles, around.config)
        shown += [(p, verdict, s) for s in others if s.section.form != "w_beam"]
        for s in own:
            stretch = form_of_run(at, forms, s.run)
            other = is_agreed(stretch) and stretch.section.form != "w_beam"
            if other and np.mean(_score(verdict, stretch)) >= _LIKELY:
                shown.append((p, verdict, stretch))
            else:
                kept.append(_of_form(s, stretch))
    concrete = _each_once([s for s in shown if s[2].section.kind == "barrier"], [], around)
    # A barrier is found whole, or as before; nothing else stands on one
    before = [s for s in barriers if np.mean(near_stretches(s.xyz, concrete)) < _MOSTLY]
    concrete = [s for s in concrete if not near_stretches(s.xyz, before).any()] + before
    no_concrete = [s for s in shown if s[2].section.kind != "barrier"]
    return kept + _each_once(no_concrete, concrete, around) + concrete


def _each_once(
    shown: list[tuple[PlacedRail, NodeScores, FormedStretch]], taken: list[Stretch], around: Surroundings
) -> list[Stretch]:
    """Return the lines of stretches, the longest first, without those that mostly run on a line before them."""
    lines: list[Stretch] = []
    likely = [s for s in shown if np.mean(_score(s[1], s[2])) >= _LIKELY]
    for p, verdict, stretch in sorted(likely, key=lambda s: s[2].run.start - s[2].run.stop):
        if np.mean(near_stretches(p.xyz[stretch.run], taken + lines)) < _AGAIN:
            lines += _lines_of(p, verdict, stretch, around)
    return lines


def _score(verdict: NodeScores, stretch: FormedStretch) -> FloatArray:
    """Return the score of each node of a stretch."""
    return np.asarray(verdict.steady[stretch.run] * min(stretch.agreeing, stretch.section.explained))


def _lines_of(
    p: PlacedRail, verdict: NodeScores, stretch: FormedStretch, around: Surroundings
) -> Iterator[Stretch]:
    """Yield the lines of a stretch, fitted again."""
    section, run = stretch.section, stretch.run
    fits = fitted_again(p.rail, stretch, around.bins, around.circles, around.config)
    score = _score(verdict, stretch)
    whole = NodeScores(score, score, np.ones_like(score), steady=score, open_=verdict.open_[run])
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
            np.zeros(len(score), dtype=bool),
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
