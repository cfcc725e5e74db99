"""Where a line goes on beyond a gap that is too long for the tracker: somebody says that it is one line."""

from __future__ import annotations

import numpy as np

from linework.arrays import FloatArray
from linework.lines.continued import PICKED_TWICE, continued
from linework.methods.obb.trace import PICK_M, leads, may_go_on
from linework.model.lines import LineSet

#: Ahead of an end it is looked every so many metres, as far to either side.
_STRIP_M = 4.0
#: What lies beyond a gap is known for a line by so much of it. [m]
_BEYOND_M = 12.0
#: The way on over a gap may bend: it is looked for to either side by this share of how far ahead it is.
_FAN = 0.1
#: Where a line that was interrupted goes on, both have so much in common: that joins them. [m]
_OVERLAP_M = 3.0


def places_ahead(one: LineSet, end: int) -> tuple[FloatArray, FloatArray]:
    """Return places (n, 2) beyond a line's start (0) or end (1) [m], and how far about each it may go on."""
    tip, way = (part[end] for part in leads(one.xyz))
    along = np.arange(0.0, PICKED_TWICE.longest_m + _BEYOND_M, _STRIP_M)
    return tip + along[:, None] * way, _STRIP_M + _FAN * along


def way_on(one: LineSet, end: int, lines: LineSet) -> tuple[FloatArray, FloatArray] | None:
    """Return a place (2,) on the nearest line that goes on beyond an end, and one further along it; None: none does.

    Parameters
    ----------
    lines
        Of the same kind, about what is ahead.
    """
    tip, way = (part[end] for part in leads(one.xyz))
    best: tuple[float, FloatArray] | None = None
    for i in range(len(lines)):
        other = lines.line(i)[:, :2]
        ahead_m = (other - tip) @ way
        if ahead_m.max() < PICK_M or not may_go_on(one.xyz, lines.line(i), PICKED_TWICE.longest_m):
            continue
        if joined(one, lines.take([i])) is one:
            continue
        beyond = other[ahead_m > -_OVERLAP_M]
        beyond = beyond if (beyond[-1] - beyond[0]) @ way >= 0.0 else beyond[::-1]
        gap_m = float(np.hypot(*(beyond[0] - tip)))
        if len(beyond) > 1 and (best is None or gap_m < best[0]):
            best = gap_m, beyond
    if best is None:
        return None
    # The first vertex may be one of an end that is not known well
    return best[1][min(1, len(best[1]) - 2)], best[1][-1]


def joined(one: LineSet, new: LineSet) -> LineSet:
    """Return a line with one that goes on where it ends, the gap bridged; the same where that one does not."""
    found = continued(one, new.with_columns(crs=one.crs))
    return found if len(found) == 1 else one
