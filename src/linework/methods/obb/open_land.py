"""Edges of what is too wide to be a road, as nothing is painted on it: meadows between hedges, yards, playing fields.

Separate from `joining`, which decides: this weighs the width of the ground in front of an edge.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from linework.arrays import BoolArray, FloatArray
from linework.methods.tracking.arrangement import BESIDE_KERB_M, FACING_M, HALF_VEHICLE_M
from linework.methods.tracking.boundary_lines import SmoothBoundary
from linework.methods.tracking.neighbours import LineAxis, find_neighbours

#: Widest carriageway on which nothing is painted as a rule: two lanes. Wider ones have lane lines; outside of towns,
#: those of 5.5 m and more have a centre line (RMS-1; MUTCD 3B.01). [m]
UNPAINTED_M = 7.5
#: Width of each further lane [m], and the chance that it is not marked off where no kerb bounds it either. An estimate: yards
#: and parking places are such ground, roads hardly ever.
FURTHER_M, UNPAINTED_CHANCE = 3.5, 0.1
#: What evenness says for a road at most, as a ratio of chances. An estimate: of open land one piece in thirty is as even as a
#: road, such as mown meadows and sports grounds.
MOST_EVEN_ODDS = 30.0


def weighed_by_width(
    boundaries: Sequence[SmoothBoundary],
    axes: Sequence[LineAxis],
    paint: Sequence[LineAxis],
    path: Sequence[LineAxis],
) -> list[SmoothBoundary]:
    """Return boundaries with the chance that they bound a road, by the width without paint in front of edges as well.

    Kerbs and barriers are built, and stay as they are.

    Parameters
    ----------
    boundaries, axes
        (m,), and their axes.
    paint, path
        Axes of lane markings, and along the path of the vehicle.
    """
    width_m = unpainted_width_m(axes, paint, path)
    return [
        replace(b, on_road=chance_by_width(b.on_road, float(w))) if b.form == "edge" else b
        for b, w in zip(boundaries, width_m, strict=True)
    ]


def chance_by_width(on_road: float, width_m: float) -> float:
    """Return the chance that the ground in front of an edge is road, given that without its width.

    >>> [round(chance_by_width(1.0, width_m), 2) for width_m in (7.0, 11.0, 18.0)]
    [1.0, 0.75, 0.03]
    """
    if width_m <= UNPAINTED_M:
        return on_road
    odds = on_road / max(1.0 - on_road, on_road / MOST_EVEN_ODDS)
    odds *= UNPAINTED_CHANCE ** ((width_m - UNPAINTED_M) / FURTHER_M)
    return float(odds / (1.0 + odds))


def unpainted_width_m(
    axes: Sequence[LineAxis], paint: Sequence[LineAxis], path: Sequence[LineAxis]
) -> FloatArray:
    """Return the width of the ground to the left of lines that has no paint, (m,): the median over their stations.

    It ends at paint, or at a line that faces this one; where there is neither, it reaches as far as the vehicle drove, at
    least. [m]
    """
    m, n_paint = len(axes), len(paint)
    near = find_neighbours([*axes, *paint, *path], FACING_M)
    own = (near.line < m) & (near.across_m > -BESIDE_KERB_M)
    is_paint = own & (near.other >= m) & (near.other < m + n_paint)
    is_path = own & (near.other >= m + n_paint)
    is_facing = own & (near.other < m) & (near.facing < 0.0) & (near.across_m > 0.0)
    stations = np.array([len(axis.xy) for axis in axes], dtype=np.int64)
    total = int(stations.sum())

    def nearest_m(which: BoolArray) -> FloatArray:
        found = np.full(total, np.inf)
        np.minimum.at(found, near.station[which], np.maximum(near.across_m[which], 0.0))
        return found

    across = nearest_m(is_facing)
    driven = nearest_m(is_path) + HALF_VEHICLE_M
    across = np.where(np.isfinite(across), across, np.where(np.isfinite(driven), driven, 0.0))
    width = np.minimum(across, nearest_m(is_paint))
    ends = np.cumsum(stations)
    return np.array([np.median(width[end - n : end]) for end, n in zip(ends, stations, strict=True)])
