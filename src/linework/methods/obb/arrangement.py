"""How the lines of a road lie to one another: boundaries behind others, double lines, roles of markings."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial import cKDTree

from linework.methods.obb.neighbours import STATION_M, Course, Neighbours, find_neighbours
from linework.model.arrays import AnyArray, BoolArray, FloatArray
from linework.model.boxes import BoxSet

#: A carriageway, or half of one with paint in its middle, is no wider than this. [m]
FACING_M = 20.0
#: Paint this close behind an edge: it lies within the carriageway. [m]
SEAM_M = 3.0
#: Gutters and kerb beds are no wider than this. [m]
GUTTER_M = 1.5
#: The stripes of a double line are no farther apart, middle to middle (two of 0.15 m and 0.2 m of gap between). [m]
DOUBLE_M = 0.50
#: Lanes are no wider than this. [m]
LANE_M = 6.0


def beside_kerb(boxes: BoxSet, kerbs: Sequence[Course], from_m: float, to_m: float) -> BoolArray:
    """Return which boxes lie beside a kerb, between two offsets from its foot, positive on the carriageway."""
    out = np.zeros(len(boxes), dtype=np.bool_)
    if not kerbs or len(boxes) == 0:
        return out
    xy = np.concatenate([c.xy for c in kerbs])
    normal = np.concatenate([c.normal for c in kerbs])
    reach = float(np.hypot(max(abs(from_m), abs(to_m)), 0.75 * STATION_M))
    distance, nearest = cKDTree(xy).query(boxes.centre[:, :2], distance_upper_bound=reach)
    near = np.isfinite(distance)
    step = boxes.centre[near, :2] - xy[nearest[near]]
    across = np.sum(step * normal[nearest[near]], axis=1)
    out[near] = (across > from_m) & (across < to_m)
    return out


def bounds_carriageway(courses: Sequence[Course], is_kerb: BoolArray, lanes: Sequence[Course]) -> BoolArray:
    """Return which boundaries have a carriageway in front of them, and none behind.

    Looking across from a boundary towards its carriageway one meets paint, the van's way, or a boundary that
    looks back. One that is met from behind is the carriageway's end: walls, hedges and garden edges at the back
    of a footway stand behind it. An edge without a kerb that has paint or the van's way close behind it is a
    seam of the asphalt; and one beside a kerb is its gutter: neither hides a kerb.

    Parameters
    ----------
    courses
        Boundaries, each with the carriageway to its left.
    is_kerb
        (m,) bool.
    lanes
        Lines of paint and the ways of vans.
    """
    m = len(courses)
    n = find_neighbours([*courses, *lanes], FACING_M)
    own = n.line < m
    is_lane = n.other >= m
    kerb = np.concatenate([is_kerb, np.zeros(len(lanes), dtype=np.bool_)])
    counts = is_lane | kerb[n.other] | ~kerb[n.line]
    ahead = own & counts & (n.across_m > 0.0)
    first = _nearest_per_station(n, ahead)
    in_front = first & (is_lane[:] | (n.facing < 0.0))
    behind = own & (n.across_m < 0.0) & ~kerb[n.line]
    seam = behind & is_lane & (n.across_m > -SEAM_M)
    gutter = behind & kerb[n.other] & (n.across_m > -GUTTER_M) & (n.facing > 0.0)
    every = [*courses, *lanes]
    good = _share_of_stations(n, in_front, every)[:m] > 0.5
    bad = _share_of_stations(n, seam | gutter, every)[:m] > 0.5
    return np.asarray(good & ~bad)


def _nearest_per_station(n: Neighbours, chosen: BoolArray) -> BoolArray:
    """Return which of the chosen neighbours are the nearest at their station."""
    index = np.flatnonzero(chosen)
    order = index[np.lexsort((np.abs(n.across_m[index]), n.station[index]))]
    first = np.concatenate([[True], np.diff(n.station[order]) != 0]) if len(order) else np.zeros(0, bool)
    out = np.zeros(len(chosen), dtype=np.bool_)
    out[order[first]] = True
    return out


def is_double(courses: Sequence[Course]) -> BoolArray:
    """Return which markings run beside another one as one of a double line for most of their length."""
    n = find_neighbours(courses, DOUBLE_M)
    return np.asarray(_share_of_stations(n, np.ones(len(n.line), dtype=np.bool_), courses) > 0.5)


def roles(courses: Sequence[Course], n_markings: int, double: BoolArray) -> list[str]:
    """Return the role of each marking, "" where it cannot be told.

    The outermost line of paint, next to the end of the carriageway, is an edge line; a double line that is
    not is the centre line; of a road with one line of paint inside, half-way between its edges, so is that.

    Parameters
    ----------
    courses
        Markings, then boundaries.
    """
    n = find_neighbours(courses, 2.0 * LANE_M)
    is_marking = np.arange(len(courses)) < n_markings
    found = []
    for i in range(n_markings):
        own = n.line == i
        sides = []
        for sign in (1.0, -1.0):
            across = n.across_m[own] * sign
            here = across > DOUBLE_M
            paint = here & is_marking[n.other[own]]
            bound = here & ~is_marking[n.other[own]]
            stations = max(len(courses[i].xy), 1)
            sides.append((
                _typical(across[paint], n.station[own][paint], stations),
                _typical(across[bound], n.station[own][bound], stations),
            ))  # fmt: skip
        found.append(_role(*sides, is_double=bool(double[i])))
    return found


def _role(left: tuple[float, float], right: tuple[float, float], *, is_double: bool) -> str:
    """Return the role of a line with these distances to the next paint and the next boundary on either side."""
    outer = [paint > bound or not np.isfinite(paint) for paint, bound in (left, right)]
    if is_double:
        return "centre"
    if all(outer):
        (_, a), (_, b) = left, right
        if not (np.isfinite(a) and np.isfinite(b)):
            return ""
        return "centre" if 0.6 < a / b < 1.67 else "edge"
    if any(outer):
        (_, bound), (paint, _) = (left, right) if outer[0] else (right, left)
        return "edge" if not np.isfinite(bound) or bound < 0.8 * paint else "centre"
    return "lane"


def _typical(across: FloatArray, station: AnyArray, n_stations: int) -> float:
    """Return the median distance of the nearest line per station, inf where most stations have none."""
    if len(across) == 0:
        return np.inf
    order = np.lexsort((across, station))
    first = np.concatenate([[True], np.diff(station[order]) != 0])
    nearest = across[order][first]
    return float(np.median(nearest)) if len(nearest) > 0.4 * n_stations else np.inf


def _share_of_stations(n: Neighbours, chosen: BoolArray, courses: Sequence[Course]) -> FloatArray:
    """Return for each line the share of its stations with a chosen neighbour."""
    stations = np.unique(n.station[chosen])
    owner = np.repeat(np.arange(len(courses)), [len(c.xy) for c in courses])
    counted = np.bincount(owner[stations], minlength=len(courses))
    return counted / np.maximum([len(c.xy) for c in courses], 1)
