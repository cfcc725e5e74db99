"""Dashes of dashed markings: which belong to which, and their rhythm."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterator
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import shapely
from scipy.spatial import cKDTree

from linework.arrays import FloatArray
from linework.model.lines import LineSet

#: A dash belongs to the marking whose line is this near to its middle. [m]
_NEAR_M = 0.3
#: Fewest dashes whose median says what the rhythm of a marking is: more than half of the gaps between four are single.
_FEWEST = 4


class MarkingRhythm(NamedTuple):
    """Median length [m] of the dashes of a marking, and of the gaps between them."""

    dash_m: float
    gap_m: float


def dash_rhythms(lines: LineSet) -> dict[int, MarkingRhythm]:
    """Return the rhythm of dashed markings with four dashes and more, by the number of the marking.

    >>> rows = [[[0, 0, 0], [40, 0, 0]], *([[x, 0, 0], [x + 3, 0, 0]] for x in (0, 9, 18, 27))]
    >>> kinds = ["lane_marking", *["lane_marking_dash"] * 4]
    >>> dash_rhythms(LineSet.from_lines(rows, kind=kinds, pattern=["dashed"] * 5))
    {0: MarkingRhythm(dash_m=3.0, gap_m=6.0)}
    """
    found = {}
    for _, i, ends in dashes_by_marking(lines):
        if len(ends) < _FEWEST:
            continue
        along = shapely.line_locate_point(
            shapely.linestrings(lines[i].xyz[:, :2]), shapely.points(ends.mean(axis=1))
        )
        order = np.argsort(along, kind="stable")
        middles, lengths = ends.mean(axis=1)[order], np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)[order]
        gaps = np.linalg.norm(np.diff(middles, axis=0), axis=1) - 0.5 * (lengths[1:] + lengths[:-1])
        found[i] = MarkingRhythm(float(np.median(lengths)), float(np.median(gaps)))
    return found


def dashes_by_marking(lines: LineSet) -> Iterator[tuple[str, int, FloatArray]]:
    """Yield the id and the number of each dashed marking, and the ends (k, 2, 2) of its dashes."""
    marks = np.flatnonzero((lines.kind == "lane_marking") & (lines.pattern == "dashed"))
    dashes = np.flatnonzero(lines.kind == "lane_marking_dash")
    if not len(marks) or not len(dashes):
        return
    places, owner = [], []
    for i in marks.tolist():
        xy = lines[i].xyz[:, :2]
        for a, b in pairwise(xy):
            n = max(math.ceil(float(np.linalg.norm(b - a)) / (_NEAR_M / 2)), 1)
            places.append(a + np.linspace(0.0, 1.0, n + 1)[:, None] * (b - a))
            owner.append(np.full(n + 1, i))
    tree, owners = cKDTree(np.concatenate(places)), np.concatenate(owner)
    found: dict[int, list[FloatArray]] = defaultdict(list)
    for i in dashes.tolist():
        xy = lines[i].xyz[:, :2]
        away, nearest = tree.query((xy[0] + xy[-1]) / 2)
        if away <= _NEAR_M:
            found[int(owners[nearest])].append(np.stack([xy[0], xy[-1]]))
    for i in sorted(found):
        yield str(lines.id[i]) or f"line {i + 1}", i, np.stack(found[i])
