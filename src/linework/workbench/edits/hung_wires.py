"""Save the wires of a power line that were found from one of them, as one edit.

Separate from `keep_trace`, because it names saved wires instead of joining them with what was found.
"""

from __future__ import annotations

import numpy as np

from linework.editing.edits.attributes import with_review
from linework.errors import UsageError
from linework.lines.companions import HungWires
from linework.model.changes import Change
from linework.model.lines import LineSet
from linework.workbench.edits.keep_trace import same_wires

#: Names of what hangs together, which saved wires are given.
_NAMES = ("network", "circuit", "span")


def wires_change(action: str, lines: LineSet, found: HungWires, *, own_only: bool) -> Change:
    """Return the change that adds wires where there are none yet, and names those that there are.

    Parameters
    ----------
    lines
        All lines. Wires that a person rejected are not added again.
    own_only
        Whether only the wires of the same conductor are wanted.

    Raises
    ------
    UsageError
        All of them are there, with their names.
    """
    wanted = found.lines.take(found.is_own) if own_only else found.lines
    cables = lines.take(lines.kind == "cable")
    before, after = [LineSet.empty(lines.crs)], [LineSet.empty(lines.crs)]
    named: set[str] = set()
    for k in range(len(wanted)):
        one = wanted.take([k])
        there = cables.take(np.array(same_wires(one, cables), dtype=np.int64))
        if not len(there):
            after.append(with_review(one.with_columns(id=np.array([""])), "drawn"))
        names = {name: np.repeat(getattr(one, name), len(there)) for name in _NAMES}
        is_new = np.any([getattr(there, name) != column for name, column in names.items()], axis=0)
        is_new &= (there.review != "rejected") & ~np.isin(there.id, list(named))
        before.append(there.take(is_new))
        after.append(there.with_columns(**names).take(is_new))
        named |= set(before[-1].id.tolist())
    if not sum(map(len, after)):
        raise UsageError(
            "all wires that the points show with this one are there already", where="wires",
            advice="nothing to do; a wire that was rejected is not added again",
        )  # fmt: skip
    return Change(action, LineSet.concatenate(before), LineSet.concatenate(after))
