"""Save the lines of a template with the line that they lie beside: those that they overlap are joined with them.

Separate from `keep_trace`, because a template is found beside saved lines too.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from linework.arrays import distance_along
from linework.editing.edits.attributes import with_review
from linework.editing.edits.continued import SAME_LINE_M
from linework.editing.edits.new_lines import foot_along
from linework.lines.along import line_stretch
from linework.lines.companions import closes_on_itself
from linework.model.changes import Change
from linework.model.lines import LineSet
from linework.workbench.edits.keep_trace import (
    grown_line,
    lines_touching,
    same_wires,
    share_on_line,
    stations_of,
)

#: Shortest line of a template that is kept: two stations. [m]
_SHORTEST_M = 1.0
#: A top that was found with the line itself is the template's, if most of it lies on that.
_MOST = 0.5
#: Lines of one kind above one another are as far apart as this, or farther: a W-beam is 0.31 m high, wires hang farther
#: apart than 0.2 m; and heights of one line, measured twice, differ by less. [m]
_SAME_HEIGHT_M = 0.2


def parts_beside(beside: LineSet, along: LineSet) -> list[LineSet]:
    """Return what of the lines of a template lies beside a line, without what is too short.

    Parameters
    ----------
    along
        A single line: what lies beyond its ends is cut off.
    """
    parts = [_cut(beside.take([k]), along) for k in range(len(beside))]
    return [part for part in parts if part is not None]


def without_twins(trace: LineSet, parts: Sequence[LineSet]) -> LineSet:
    """Return a followed line and the lines beside it, without those that a template has, too: the top of a kerb.

    Parameters
    ----------
    trace
        The followed line first, which stays.
    """
    is_twin = [k > 0 and any(_is_twin(trace.take([k]), part) for part in parts) for k in range(len(trace))]
    return trace.take(~np.array(is_twin, dtype=np.bool_))


def with_template(change: Change, parts: Sequence[LineSet], lines: LineSet, along: LineSet) -> Change:
    """Return a change that adds the lines of a template as well.

    Parameters
    ----------
    parts
        The lines of the template, as far as they are kept (`parts_beside`).
    lines
        All lines, before the change.
    along
        The single line that they are beside, which is not joined with any of them.
    """
    left = lines.take(~np.isin(lines.id, change.before.id) & ~np.isin(lines.id, along.id))
    before, new = [change.before], []
    for part in parts:
        same = left.take((left.kind == part.kind[0]) & (left.role == part.role[0]))
        same = same.take(np.array(_one_with(part, same), dtype=np.int64))
        whole, absorbed = grown_line(part.with_columns(id=np.array([""])), same, [])
        before.append(same.take(np.array(absorbed, dtype=np.int64)))
        left = left.take(~np.isin(left.id, before[-1].id))
        new.append(whole)
    if not new:
        return change
    made = with_review(LineSet.concatenate(new), "drawn")
    return replace(
        change, before=LineSet.concatenate(before), after=LineSet.concatenate([change.after, made])
    )


def _one_with(part: LineSet, lines: LineSet) -> list[int]:
    """Return the indices of lines that may be one with a line of a template: where they touch, they are as high."""
    near = lines_touching(part, lines, []).tolist()
    if str(part.kind[0]) == "cable":
        # Wires that meet at a pole, or cross, touch in plan too
        on = same_wires(part, lines)
        near = [k for k in near if k in on or same_wires(lines.take([k]), part)]
    return [k for k in near if _is_as_high(lines.take([k]), part)]


def _is_twin(one: LineSet, part: LineSet) -> bool:
    is_alike = str(one.kind[0]) == str(part.kind[0]) and share_on_line(one, part) > _MOST
    return is_alike and _is_as_high(one, part)


def _is_as_high(one: LineSet, other: LineSet) -> bool:
    """Return whether two lines are as high where one lies on the other in plan, or else where they are nearest."""
    places, there = stations_of(one.xyz), stations_of(other.xyz)
    away, nearest = cKDTree(there[:, :2]).query(places[:, :2])
    on = away <= max(SAME_LINE_M, float(away.min()))
    return float(np.median(np.abs(places[on, 2] - there[nearest[on], 2]))) <= _SAME_HEIGHT_M


def _cut(part: LineSet, along: LineSet) -> LineSet | None:
    """Return what of a line lies beside another; None if that is too short. All of it lies beside one that is closed."""
    if closes_on_itself(along.xyz):
        return part
    # As `line_stretch` measures it
    own = distance_along(part.xyz[:, :2], in_space=True)
    first, last = sorted(foot_along(part.xyz, own, along.xyz[k]) for k in (0, -1))
    if last - first < _SHORTEST_M:
        return None
    if first <= 0.0 and last >= own[-1]:
        return part
    return line_stretch(part, first, last)
