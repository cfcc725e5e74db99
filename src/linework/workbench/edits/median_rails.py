"""Save the other rail of a median, which was found from one of them, as one edit.

Separate from `keep_trace`, because the line that it was found from stays as it is.
"""

from __future__ import annotations

import numpy as np

from linework.editing.edits.attributes import with_review
from linework.errors import UsageError
from linework.model.changes import Change
from linework.model.lines import LineSet
from linework.workbench.edits.keep_trace import NEARLY_ALL, grown_line, share_on_line


def partner_change(action: str, lines: LineSet, line: LineSet, found: LineSet) -> Change:
    """Return the change that adds the other rail of a median where it is not there yet.

    Parameters
    ----------
    lines
        All lines. What a person rejected is not added again; what a saved line has in part is joined with it.
    line
        The single line that the other was found from.
    found
        The lines of the other rail.

    Raises
    ------
    UsageError
        There is none, or all of it is there.
    """
    if not len(found):
        raise UsageError(
            "the points show no other rail of a median beside the line", where="partner",
            advice="follow it from a click, or draw it with Parallel",
        )  # fmt: skip
    others = lines.take(lines.id != line.id[0])
    before, after = [LineSet.empty(lines.crs)], [LineSet.empty(lines.crs)]
    gone: list[int] = []
    for k in range(len(found)):
        one = found.take([k]).with_columns(id=np.array([""]))
        there = np.flatnonzero(others.kind == one.kind[0]).tolist()
        if any(share_on_line(one, others.take([j])) >= NEARLY_ALL for j in there):
            continue
        whole, absorbed = grown_line(one, others, gone)
        gone += absorbed
        before.append(others.take(np.array(absorbed, dtype=np.int64)))
        after.append(with_review(whole, "drawn"))
    if not sum(map(len, after)):
        raise UsageError(
            "the other rail is there already", where="partner",
            advice="nothing to do; one that was rejected is not added again",
        )  # fmt: skip
    return Change(action, LineSet.concatenate(before), LineSet.concatenate(after))
