"""What belongs to a line and is judged, joined and taken away with it: its dashes, or the top of its kerb."""

from __future__ import annotations

import itertools

import numpy as np

from linework.arrays import FloatArray, IntArray
from linework.errors import UsageError
from linework.lines.edited_parts import joined
from linework.lines.edited_words import reviewed
from linework.methods.obb.trace import BESIDE_M, beside
from linework.model.changes import Change
from linework.model.lines import LineSet

#: What may lie beside a line of each kind, and belongs to it: judged when the line is judged.
COMPANIONS = {"lane_marking": "lane_marking_dash", "road_boundary": "kerb_top"}


def with_companions(chosen: LineSet, lines: LineSet) -> LineSet:
    """Return lines with the dashes that lie on them, and the tops of their kerbs."""
    is_in = np.isin(lines.id, chosen.id)
    for i in range(len(chosen)):
        kind = COMPANIONS.get(str(chosen.kind[i]), "")
        if kind:
            box = _near(lines, chosen.line(i), BESIDE_M[kind])
            is_in[box[beside(lines.take(box), chosen.line(i), kind)]] = True
    return lines.take(is_in)


def _near(lines: LineSet, xyz: FloatArray, within_m: float) -> IntArray:
    """Return which lines begin in the rectangle around a line: the others need no closer look."""
    low, high = xyz[:, :2].min(axis=0) - within_m, xyz[:, :2].max(axis=0) + within_m
    first = lines.xyz[lines.offsets[:-1], :2]
    return np.flatnonzero(np.all((first >= low) & (first <= high), axis=1))


def with_tops(change: Change, tops: LineSet, other_tops: LineSet) -> Change:
    """Return the change that joined two kerbs, with the tops joined that end where they did."""
    pairs = [
        (float(np.hypot(*(tops.line(i)[a, :2] - other_tops.line(k)[b, :2]))), i, k)
        for i, k, a, b in itertools.product(range(len(tops)), range(len(other_tops)), (0, -1), (0, -1))
        if tops.id[i] != other_tops.id[k]
    ]
    if not pairs:
        return change
    _, i, k = min(pairs)
    before = [tops.take([i]), other_tops.take([k])]
    try:
        top = joined(before[0], before[1], change.after)
    except UsageError:
        return change  # what does not fit stays as it is
    return Change(
        change.action,
        LineSet.concatenate([change.before, *before]),
        LineSet.concatenate([change.after, reviewed(top, str(change.after.review[0]))]),
    )
