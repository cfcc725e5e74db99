"""Save the lines of a template with the line that they lie beside: those that they overlap are joined with them.

Separate from `keep_trace`, because a template is found beside saved lines too.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from linework.arrays import distance_along
from linework.editing.edits.attributes import with_review
from linework.editing.edits.new_lines import foot_along
from linework.errors import UsageError
from linework.lines.along import line_stretch
from linework.model.changes import Change
from linework.model.lines import LineSet
from linework.workbench.edits.keep_trace import grown_line, share_on_line

#: Shortest line of a template that is kept: two stations. [m]
_SHORTEST_M = 1.0
#: A top that was found with the line itself is the template's, if most of it lies on that.
_MOST = 0.5


def with_template(change: Change, beside: LineSet, lines: LineSet, along: LineSet) -> Change:
    """Return a change that adds the lines of a template as well.

    Parameters
    ----------
    change
        Its `after` may hold lines that are the template's, too (the top of a kerb): the template's replace them.
    beside
        The lines of the template.
    lines
        All lines, before the change.
    along
        The single line that they are beside: what lies beyond its ends is cut off.

    Raises
    ------
    UsageError
        The points showed no edge of the template.
    """
    left = lines.take(~np.isin(lines.id, change.before.id))
    before, after, new = [change.before], change.after, []
    for part in (_cut(beside.take([k]), along) for k in range(len(beside))):
        if part is None:
            continue
        twin = np.array(
            [
                str(after.kind[k]) == str(part.kind[0])
                and k > 0
                and share_on_line(after.take([k]), part) > _MOST
                for k in range(len(after))
            ],
            dtype=np.bool_,
        )
        name = next((str(one) for one in after.id[twin] if one), "")
        after = after.take(~twin)
        same = left.take((left.kind == part.kind[0]) & (left.role == part.role[0]))
        whole, absorbed = grown_line(part.with_columns(id=np.array([name])), same, [])
        before.append(same.take(np.array(absorbed, dtype=np.int64)))
        left = left.take(~np.isin(left.id, before[-1].id))
        new.append(whole)
    if not new:
        raise UsageError(
            "the points show no edge of the template beside the line", where="template",
            advice="look at a section across it, or choose another template",
        )  # fmt: skip
    made = with_review(LineSet.concatenate(new), "drawn")
    return replace(change, before=LineSet.concatenate(before), after=LineSet.concatenate([after, made]))


def _cut(part: LineSet, along: LineSet) -> LineSet | None:
    """Return what of a line lies beside another; None if that is too short."""
    own = distance_along(part.xyz[:, :2])
    first, last = sorted(foot_along(part.xyz, own, along.xyz[k]) for k in (0, -1))
    if last - first < _SHORTEST_M:
        return None
    if first <= 0.0 and last >= own[-1]:
        return part
    return line_stretch(part, first, last)
