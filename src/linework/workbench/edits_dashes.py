"""The change that gives lines the dashes that they lack."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from linework.arrays import FloatArray
from linework.errors import UsageError
from linework.lines.edited_dashes import dashes_by_paint, with_missing_dashes
from linework.lines.edited_words import reviewed
from linework.model.changes import Change
from linework.model.lines import LineSet
from linework.workbench.edits_companions import with_companions


def dashed(chosen: LineSet, lines: LineSet, spans: Mapping[str, FloatArray]) -> Change:
    """Return the change that gives lines their dashes: by the paint along them, else by the rhythm of those there.

    Parameters
    ----------
    chosen
        Markings; those that lack none are passed over.
    lines
        All lines.
    spans
        By id, where along a line the paint shows dashes: (k, 2) [m].

    Raises
    ------
    UsageError
        None of them lacks any.
    """
    before, after = [LineSet.empty(lines.crs)], []
    refused: UsageError | None = None
    for k in range(len(chosen)):
        line = chosen.take([k])
        try:
            gone, new = _of_line(line, lines, spans.get(str(line.id[0]), np.zeros((0, 2))))
        except UsageError as refusal:
            refused = refused or refusal
            continue
        before.append(gone)
        after.append(reviewed(new, "drawn"))
        if not line.pattern[0]:
            before.append(line)
            after.append(line.with_columns(pattern=np.array(["dashed"])))
    if not after:
        raise refused or UsageError("no line is chosen", where="dashes", advice="choose a marking")
    return Change("dashes", LineSet.concatenate(before), LineSet.concatenate(after))


def _of_line(line: LineSet, lines: LineSet, spans: FloatArray) -> tuple[LineSet, LineSet]:
    """Return the dashes of a line that go, and that come."""
    if str(line.kind[0]) != "lane_marking":
        raise UsageError(f"a {line.kind[0]} has no dashes", where="dashes", advice="choose a lane marking")
    own = with_companions(line, lines).of_kind("lane_marking_dash")
    own = own.take(own.review != "rejected")
    if len(spans):
        return dashes_by_paint(line, own, spans)
    return LineSet.empty(lines.crs), with_missing_dashes(line, own)
