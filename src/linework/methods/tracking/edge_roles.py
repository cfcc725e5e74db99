"""Roles of the edges beside a boundary of the carriageway: the order outwards from the carriageway decides.

Height and brightness tell them apart nowhere: the back of a footway may be brighter than its kerb, and the foot of a verge
higher than the pavement's edge. What lies on the side of the carriageway is a gutter, the first edge behind a kerb the
back of the footway, what stands up a wall, and the rest verge.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from linework.arrays import AnyArray, BoolArray, FloatArray
from linework.methods.tracking.arrangement import (
    BESIDE_KERB_M,
    SECTION_M,
    WIDEST_GUTTER_M,
    nearest_per_station,
    share_of_stations,
)
from linework.methods.tracking.neighbours import LineAxis, find_neighbours

#: Roles of edges beside a boundary.
EDGE_ROLES = ("gutter", "footway_back", "verge", "wall_foot")
#: Two tracks this near each other are of one edge: where a wall stands on a footway's back, both are measured. [m]
SAME_EDGE_M = 0.3
#: Gutters lie at the level of the road; their lip is no higher than a dropped kerb. [m]
HIGHEST_LIP_M = 0.03
#: An edge lies beside a boundary, or behind another edge, if it does at more than this share of its stations.
_BESIDE = 0.3


def edge_roles(
    edges: Sequence[LineAxis],
    is_wall: BoolArray,
    height_m: FloatArray,
    evidence: FloatArray,
    bounds: Sequence[LineAxis],
    is_kerb: BoolArray,
) -> AnyArray:
    """Return the role of each edge, (m,) str; "" where it lies beside no boundary, or belongs to a boundary or an edge.

    Parameters
    ----------
    edges
        Edges that are no boundaries, facing either way.
    is_wall
        (m,) bool: edges at the foot of something that stands up.
    height_m
        (m,) height of the step at each [m]; NaN: unknown.
    evidence
        (m,) log-likelihood of each: of two tracks of one edge, that with more has the role. A wall outweighs the others.
    bounds
        Boundaries, each with the carriageway to its left.
    is_kerb
        (k,) bool.
    """
    m = len(edges)
    every = [*edges, *bounds]
    n = find_neighbours(every, SECTION_M)
    own = n.line < m
    # Distance of the edge behind the boundary, negative on the side of the carriageway
    behind_m = n.across_m * np.sign(n.facing)
    nearest = nearest_per_station(n, own & (n.other >= m))
    is_beside = share_of_stations(n, nearest, every)[:m] > _BESIDE
    out = np.full(m, "", dtype=object)
    rank = np.lexsort((np.arange(m), -evidence, ~is_wall))
    order = np.empty(m, dtype=np.int64)
    order[rank] = np.arange(m)
    whole = np.append(order, np.full(len(bounds), -1))
    same = own & (n.other < m) & (np.abs(n.across_m) < SAME_EDGE_M) & (whole[n.other] < whole[n.line])
    is_copy = share_of_stations(n, same, every)[:m] > 0.5
    start = np.searchsorted(n.line, np.arange(m + 1))
    for i in np.flatnonzero(is_beside & ~is_copy).tolist():
        of_line = np.arange(start[i], start[i + 1])
        here = of_line[nearest[of_line]]
        typical_m = float(np.median(behind_m[here]))
        beside_kerb = bool(np.mean(is_kerb[n.other[here] - m]) > 0.5)
        if is_wall[i] and typical_m > 0.0:
            out[i] = "wall_foot"
        elif -WIDEST_GUTTER_M <= typical_m < -SAME_EDGE_M / 2.0:
            out[i] = "" if abs(height_m[i]) > HIGHEST_LIP_M else "gutter"
        elif typical_m > (BESIDE_KERB_M if beside_kerb else SAME_EDGE_M):
            side = float(np.sign(np.median(n.across_m[here])))
            outwards_m = side * n.across_m[of_line]
            between = (n.other[of_line] < m) & (outwards_m > SAME_EDGE_M)
            between &= outwards_m < typical_m - SAME_EDGE_M
            stations = np.unique(n.station[of_line[between]])
            is_second = len(stations) / max(len(edges[i].xy), 1) > _BESIDE
            out[i] = "footway_back" if beside_kerb and not is_second else "verge"
    return out.astype(np.str_)
