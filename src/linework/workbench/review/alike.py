"""After an edit: the lines in which the same fault may be; taught by the example that a person gave.

Separate from `routes`, which every server imports: this imports what compares lines.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from linework.arrays import BoolArray, FloatArray, IntArray
from linework.editing.queue.alike import (
    RIGHT_REVIEWS,
    VERY_LIKE_CHANCE,
    Alike,
    line_measures,
    lines_alike,
)
from linework.editing.queue.suspects import line_middle, view_box
from linework.files.line_file.file import LineFile
from linework.model.changes import Change
from linework.model.lines import REJECTED_REVIEW, LineSet
from linework.workbench.edits.apply import COMPANIONS
from linework.workbench.review.point_measures import PointsOfLines
from linework.workbench.review.routes import AlikeItem
from linework.workbench.review.suspects import driven_path
from linework.workbench.worker.session import SurveySession

#: Lines that are listed, at most: more than a person looks at one by one.
MOST_ALIKE = 200
#: Lines of the kind among which is looked, those nearest to the example: each takes a hundredth of a second.
MOST_LOOKED_AT = 2000
#: Examples that are looked at, at most: twenty show what they have in common, and each is compared with all others.
MOST_EXAMPLES = 20
#: Lines whose points are measured in one request to the worker, which pictures wait for: half a second.
MEASURED_AT_ONCE = 30
#: Edits back that are looked for the example.
_MOST_BACK = 50
#: Attributes that a person sets because a line has them wrong.
TAUGHT_COLUMNS = ("role", "pattern", "form", "condition", "double")


@dataclass(frozen=True, slots=True)
class Taught:
    """An example that an edit gave.

    Parameters
    ----------
    examples
        The lines as they were before, of one kind; the first `n_looked_at` of them are compared with others.
    mend
        The edit that mends other lines the same way, without its ids.
    column
        The attribute that was wrong; "" where it was the line itself or its kind.
    """

    examples: LineSet
    mend: dict[str, Any]
    column: str = ""

    @property
    def kind(self) -> str:
        """Kind of the examples."""
        return str(self.examples.kind[0])

    @property
    def n_looked_at(self) -> int:
        """Number of the examples that are compared with others: `MOST_EXAMPLES` at most, as more teach little."""
        return min(len(self.examples), MOST_EXAMPLES)


def taught_by_edit(line_file: LineFile, number: int) -> Taught | None:
    """Return the example that an edit of the file gave; None where it gave none, or was undone."""
    back = line_file.revision - number + 1
    if not 1 <= back <= _MOST_BACK or number in line_file.undone:
        return None
    edit = next((edit for edit in line_file.history(back) if edit.number == number), None)
    return None if edit is None else taught_by(edit.change)


def taught_by(change: Change) -> Taught | None:
    """Return the example that a change gives: a line rejected or deleted, or given another kind or attribute.

    What was moved, cut, joined or drawn gives none: how it would be mended elsewhere depends on the place.
    """
    before, after, action = change.before, change.after, change.action.partition(" ")[0]
    if len(before) == 0 or action not in ("reject", "delete", "kind", "set"):
        return None
    # Dashes and tops that went with their line are no example
    with_it = [COMPANIONS[kind] for kind in set(before.kind.tolist()) if kind in COMPANIONS]
    own = before.take(~np.isin(before.kind, with_it))
    if len(set(own.kind.tolist())) != 1:
        return None
    own = own.take(_looked_at_first(own))
    if action in ("reject", "delete"):
        return Taught(own, {"action": action})
    became = after.take(np.isin(after.id, own.id) & (after.review != REJECTED_REVIEW))
    if action == "kind":
        kinds = set(became.kind.tolist())
        return Taught(own, {"action": action, "kind": kinds.pop()}) if len(kinds) == 1 else None
    for column in TAUGHT_COLUMNS:
        was, now = set(getattr(own, column).tolist()), set(getattr(became, column).tolist())
        if was != now and len(was) == len(now) == 1:
            return Taught(own, {"action": action, "column": column, "value": now.pop()}, column)
    return None


def _looked_at_first(examples: LineSet) -> IntArray:
    """Return the numbers of examples, those that are looked at first: evenly spread over their ids, in whatever order."""
    order: IntArray = np.argsort(examples.id, kind="stable")
    if len(order) <= MOST_EXAMPLES:
        return np.arange(len(order))
    looked_at = order[np.arange(MOST_EXAMPLES) * len(order) // MOST_EXAMPLES]
    return np.concatenate([looked_at, np.setdiff1d(order, looked_at)])


def population_of(taught: Taught, lines: LineSet) -> tuple[LineSet, IntArray]:
    """Return all lines that are not rejected, with the examples as they were, and which of them (k,) are compared.

    These are the `Taught.n_looked_at` examples, and the `MOST_LOOKED_AT` others of their kind nearest to the first.
    """
    others = lines.take((lines.review != REJECTED_REVIEW) & ~np.isin(lines.id, taught.examples.id))
    whole = LineSet.concatenate([taught.examples.with_columns(crs=lines.crs), others])
    is_own = whole.kind == taught.kind
    if taught.column:
        is_own &= getattr(whole, taught.column) == getattr(taught.examples, taught.column)[0]
    own = np.flatnonzero(is_own)
    own = own[own >= len(taught.examples)]
    if len(own) > MOST_LOOKED_AT:
        here = np.array(line_middle(taught.examples[0].xyz))
        away = np.hypot(*(whole.xyz[whole.offsets[own], :2] - here).T)
        own = np.sort(own[np.argsort(away, kind="stable")[:MOST_LOOKED_AT]])
    return whole, np.r_[np.arange(taught.n_looked_at), own]


def points_in_worker(session: SurveySession, lines: LineSet) -> dict[str, FloatArray]:
    """Return what the points say of lines, by name, (n,) each."""
    points: PointsOfLines = session.keep("points of lines", PointsOfLines)
    return points.of(session, lines)


def lines_in_worker(session: SurveySession, lines: LineSet, chosen: IntArray) -> dict[str, FloatArray]:
    """Return what the lines say of the chosen (k,) of them, by name, (k,) each."""
    return line_measures(lines, chosen, driven_path(session))


def alike_of(taught: Taught, own: LineSet, measures: dict[str, FloatArray]) -> list[Alike]:
    """Return which lines are like the examples, which are the first of them."""
    is_example: BoolArray = np.arange(len(own)) < taught.n_looked_at
    right = ~is_example & np.isin(own.review, RIGHT_REVIEWS)
    return lines_alike(is_example, right, ~is_example & (own.review == ""), measures)


def alike_item(line: LineSet, one: Alike) -> AlikeItem:
    """Return the item of a line (a set of one)."""
    xyz = line[0].xyz
    return AlikeItem(
        id=str(line.id[0]),
        at=[round(v, 3) for v in line_middle(xyz)],
        box=[round(v, 2) for v in view_box(xyz)],
        length_m=round(float(line.length_m[0]), 2),
        reason="like it in " + ", ".join(one.because) if one.because else "like it in all a little",
        is_very=one.chance <= VERY_LIKE_CHANCE,
    )
