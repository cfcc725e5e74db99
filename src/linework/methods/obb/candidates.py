"""Candidates: lines that were measured and not taken, each with the reason, for the layer `candidate`.

Separate from `joining`, which decides: this keeps what the decision left out. Nothing here changes a line that is taken.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from linework.arrays import AnyArray
from linework.methods.tracking import boundary_lines, marking_lines
from linework.methods.tracking.boundary_lines import SmoothBoundary
from linework.methods.tracking.marking_lines import SmoothMarking
from linework.model.lines import CANDIDATE, LineSet

#: A line that is as likely false as true. [1]
EVEN = 0.5

# Why lines are not taken, beside the reasons of `linework.methods.tracking.arrangement`

KERB_STONE = "kerb stone: the stripe lies on a kerb"
GUTTER_STONES = "stones of a gutter: the ground falls to the stripe from both sides"
KERB_BED = "gutter or bed of a kerb beside it"
BEHIND = "behind a boundary of the carriageway"
PIECE = "runs along a line: a piece of it"
FAINT = "too faint for paint that stands alone"
OPEN_LAND = "ground as uneven as open land where the carriageway would be"
WIDE_LAND = "wide ground in front of it on which nothing is painted, as on open land"
UNSURE = "taken, but less likely true than false"


@dataclass(frozen=True, slots=True)
class Candidate:
    """A line that was not taken.

    Parameters
    ----------
    line
        As it was measured.
    kind
        The kind that it would be.
    reason
        Why it was not taken, in words.
    """

    line: SmoothMarking | SmoothBoundary
    kind: str
    reason: str


def left_out(
    lines: Sequence[SmoothMarking | SmoothBoundary], kind: str, reasons: AnyArray | str
) -> list[Candidate]:
    """Return the lines (m,) that have a reason, as candidates.

    Parameters
    ----------
    reasons
        (m,) str, "" for lines that are taken; or one for all.
    """
    each = np.broadcast_to(np.asarray(reasons, dtype=np.str_), (len(lines),)).tolist()
    return [Candidate(line, kind, reason) for line, reason in zip(lines, each, strict=True) if reason]


def candidate_lines(candidates: Sequence[Candidate], taken: LineSet) -> LineSet:
    """Return candidates, and those of the lines that are taken which are less likely true than false [m, local].

    Notes
    -----
    The confidence is that of a line's own measurements, the evenness of the ground among them, before the lines beside it
    were considered.
    """
    sets = []
    for kind in dict.fromkeys(c.kind for c in candidates):
        own = [c for c in candidates if c.kind == kind]
        markings = [c.line for c in own if isinstance(c.line, SmoothMarking)]
        boundaries = [c.line for c in own if isinstance(c.line, SmoothBoundary)]
        found = LineSet.concatenate(
            [marking_lines.marking_line_set(markings, kind), boundary_lines.boundary_line_set(boundaries)]
        )
        sets.append(_as_candidates(found, [c.reason for c in own]))
    unsure = taken.take(taken.confidence < EVEN)
    sets.append(_as_candidates(unsure, [UNSURE] * len(unsure)))
    return LineSet.concatenate(sets)


def _as_candidates(lines: LineSet, reasons: Sequence[str]) -> LineSet:
    return lines.with_columns(
        kind=np.full(len(lines), CANDIDATE),
        candidate_kind=lines.kind,
        reason=np.array(reasons, dtype=np.str_),
    )
