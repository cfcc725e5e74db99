"""How the lines of a road lie to one another: boundaries behind others, double lines, roles of markings."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial import cKDTree

from linework.methods.obb.neighbours import STATION_M, Course, Neighbours, find_neighbours
from linework.model.arrays import AnyArray, BoolArray, FloatArray
from linework.model.boxes import BoxSet

#: A footway or verge with what stands at its back is no wider than this. [m]
BEHIND_M = 12.0
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


def behind_another(courses: Sequence[Course], is_kerb: BoolArray) -> BoolArray:
    """Return which boundaries stand behind another one, seen from the carriageway.

    Walls, hedges and garden edges at the back of a footway end no carriageway: looking from them towards it
    one meets the kerb from behind. Edges without a kerb do not hide one: gutters and patches of asphalt lie
    in front of kerbs; those that do are left out themselves.

    Parameters
    ----------
    courses
        Boundaries, each with the carriageway to its left.
    is_kerb
        (m,) bool.
    """
    n = find_neighbours(courses, BEHIND_M)
    # The other one is on my carriageway side, and turns its own back on me
    hidden = (n.across_m > 0.0) & (n.facing > 0.0) & (is_kerb[n.other] | ~is_kerb[n.line])
    gutter = (n.across_m < 0.0) & (n.across_m > -1.5) & (n.facing > 0.0) & ~is_kerb[n.line] & is_kerb[n.other]
    share = _share_of_stations(n, hidden | gutter, courses)
    return np.asarray(share > 0.5)


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
