"""Dashes of dashed markings along a route: lengths, gaps, and dashes that are missing.

Separate from `samples`: dashes are counted along their marking, not at stations.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterator
from itertools import pairwise

import numpy as np
from scipy.spatial import cKDTree

from linework.arrays import FloatArray
from linework.evaluation.chainage.samples import Sample
from linework.lines.crosscuts import Axis
from linework.model.lines import LineSet

#: A dash belongs to the marking whose line is this near to its middle. [m]
_NEAR_M = 0.3
#: Stations beyond this are those of another road. [m]
_FAR_M = 30.0


def dash_samples(lines: LineSet, axis: Axis) -> Iterator[Sample]:
    """Yield the length of each dash, the gap after it, and the number of dashes missing in it.

    A gap with room for more dashes, of the marking's own rhythm (medians), is missing paint where the marking was
    measured; where it was bridged, the gap is not counted.
    """
    tree = cKDTree(axis.xyz[:, :2])
    for name, line, ends in dashes_by_marking(lines):
        middles = ends.mean(axis=1)
        away, station = tree.query(middles)
        order = np.argsort(axis.station_m[station], kind="stable")
        lengths = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
        gaps = (
            np.linalg.norm(np.diff(middles[order], axis=0), axis=1)
            - (lengths[order][:-1] + lengths[order][1:]) / 2
        )
        period = float(np.median(lengths) + np.median(gaps)) if len(gaps) else math.inf
        for place, i in enumerate(order.tolist()):
            if away[i] > _FAR_M:
                continue
            s = float(axis.station_m[station[i]])
            offset = float((middles[i] - axis.xyz[station[i], :2]) @ axis.left[station[i]])
            # Of a dash at a hidden stretch a part may be hidden
            is_part = _is_bridged(lines, line, ends[i, 0], ends[i, 1])
            length = None if is_part else float(lengths[i])
            yield Sample(s, offset, "marking", "dash_length", name, length, math.nan)
            if place == len(gaps):
                continue
            hidden = _is_bridged(lines, line, middles[i], middles[order[place + 1]])
            missing = max(round((gaps[place] + np.median(lengths)) / period) - 1, 0) if period > 0 else 0
            yield Sample(
                s, offset, "marking", "missing_dashes", name, None if hidden else float(missing), math.nan
            )
            if hidden:
                yield Sample(s, offset, "marking", "gap_length", name, None, math.nan)
            elif not missing:
                yield Sample(s, offset, "marking", "gap_length", name, float(gaps[place]), math.nan)


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


def _is_bridged(lines: LineSet, i: int, a: FloatArray, b: FloatArray) -> bool:
    """Return whether a marking was carried across a gap anywhere between two places."""
    first, last = int(lines.offsets[i]), int(lines.offsets[i + 1])
    xy, bridged = lines.xyz[first:last, :2], lines.bridged[first:last]
    near = [int(np.argmin(np.linalg.norm(xy - place, axis=1))) for place in (a, b)]
    return bool(bridged[min(near) : max(near) + 1].any())
