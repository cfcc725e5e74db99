"""Dashes of dashed markings along a route: lengths, gaps, and dashes that are missing.

Separate from `samples`: dashes are counted along their marking, not at stations.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from scipy.spatial import cKDTree

from linework.arrays import FloatArray
from linework.evaluation.chainage.samples import Sample
from linework.lines.crosscuts import Axis
from linework.lines.dashes import dashes_by_marking
from linework.model.lines import LineSet

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


def _is_bridged(lines: LineSet, i: int, a: FloatArray, b: FloatArray) -> bool:
    """Return whether a marking was carried across a gap anywhere between two places."""
    first, last = int(lines.offsets[i]), int(lines.offsets[i + 1])
    xy, bridged = lines.xyz[first:last, :2], lines.bridged[first:last]
    near = [int(np.argmin(np.linalg.norm(xy - place, axis=1))) for place in (a, b)]
    return bool(bridged[min(near) : max(near) + 1].any())
