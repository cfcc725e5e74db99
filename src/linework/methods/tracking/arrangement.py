"""How the lines of a road lie to one another: boundaries behind others, double lines, roles of markings."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from linework.arrays import AnyArray, BoolArray, FloatArray
from linework.methods.tracking.neighbours import AXIS_STATION_M, LineAxis, Neighbours, find_neighbours
from linework.model.boxes import BoxSet

#: A carriageway, or half of one with paint in its middle, is no wider than this. [m]
FACING_M = 20.0
#: A kerb goes on where the next one begins no farther off (stations stand a metre from the ends). [m]
GOES_ON_M = 4.0
#: Footways and the yards behind them are looked at this far. [m]
BEHIND_KERB_M = 15.0
#: Paint this close behind an edge: it lies within the carriageway. [m]
SEAM_M = 3.0
#: Gutters and kerb beds are no wider than this. [m]
WIDEST_GUTTER_M = 1.5
#: The stripes of a double line are no farther apart, middle to middle (two of 0.15 m and 0.2 m of gap between). [m]
DOUBLE_M = 0.50
#: Bars of a zebra crossing lie this far apart, middle to middle. [m]
ZEBRA_M = (0.5, 1.3)
#: Lanes are no wider than this. [m]
LANE_M = 6.0


def beside_kerb(boxes: BoxSet, kerbs: Sequence[LineAxis], from_m: float, to_m: float) -> BoolArray:
    """Return which boxes lie beside a kerb, between two offsets from its foot, positive on the carriageway."""
    out = np.zeros(len(boxes), dtype=np.bool_)
    if not kerbs or len(boxes) == 0:
        return out
    xy = np.concatenate([c.xy for c in kerbs])
    normal = np.concatenate([c.normal for c in kerbs])
    reach = float(np.hypot(max(abs(from_m), abs(to_m)), 0.75 * AXIS_STATION_M))
    distance, nearest = cKDTree(xy).query(boxes.centre[:, :2], distance_upper_bound=reach)
    near = np.isfinite(distance)
    step = boxes.centre[near, :2] - xy[nearest[near]]
    across = np.sum(step * normal[nearest[near]], axis=1)
    out[near] = (across > from_m) & (across < to_m)
    return out


def bounds_carriageway(
    courses: Sequence[LineAxis], is_kerb: BoolArray, is_sure: BoolArray, lanes: Sequence[LineAxis]
) -> BoolArray:
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
    is_sure
        (m,) bool: paint behind these says nothing, there is none on grass.
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
    in_front = first & (is_lane | (n.facing < 0.0))
    behind = own & (n.across_m < 0.0) & ~kerb[n.line]
    sure = np.concatenate([is_sure, np.zeros(len(lanes), dtype=np.bool_)])
    seam = behind & is_lane & (n.across_m > -SEAM_M) & ~sure[n.line]
    gutter = behind & kerb[n.other] & (n.across_m > -WIDEST_GUTTER_M) & (n.facing > 0.0)
    every = [*courses, *lanes]
    good = _share_of_stations(n, in_front, every)[:m] > 0.5
    # A kerb says itself on which side its carriageway is; so does all where there is neither paint nor a van's way
    hidden = _share_of_stations(n, first & ~in_front, every)[:m] > 0.5
    good |= ~hidden & (is_kerb | (len(lanes) == 0))
    bad = _share_of_stations(n, seam | gutter, every)[:m] > 0.5
    return _with_continued(courses, is_kerb, good & ~bad)


def _with_continued(courses: Sequence[LineAxis], is_kerb: BoolArray, kept: BoolArray) -> BoolArray:
    """Return the boundaries that are kept, and the kerbs that go on from their ends: round corners of side streets."""
    kept = kept.copy()
    ends = np.array([(c.xy[0], c.xy[-1]) for c in courses]).reshape(-1, 2, 2)
    open_ = [i for i in np.flatnonzero(kept).tolist() if is_kerb[i]]
    while open_:
        i = open_.pop()
        before = np.linalg.norm(ends[:, 1] - ends[i, 0], axis=1) <= GOES_ON_M
        behind = np.linalg.norm(ends[:, 0] - ends[i, 1], axis=1) <= GOES_ON_M
        new = np.flatnonzero((before | behind) & is_kerb & ~kept).tolist()
        kept[new] = True
        open_ += new
    return kept


def _nearest_per_station(n: Neighbours, chosen: BoolArray) -> BoolArray:
    """Return which of the chosen neighbours are the nearest at their station."""
    index = np.flatnonzero(chosen)
    order = index[np.lexsort((np.abs(n.across_m[index]), n.station[index]))]
    first = np.concatenate([[True], np.diff(n.station[order]) != 0]) if len(order) else np.zeros(0, bool)
    out = np.zeros(len(chosen), dtype=np.bool_)
    out[order[first]] = True
    return out


def behind_boundaries(lanes: Sequence[LineAxis], bounds: Sequence[LineAxis], is_kerb: BoolArray) -> BoolArray:
    """Return which markings lie behind a boundary: bright strips on footways, in yards and on verges are none.

    Behind a kerb there is no carriageway for a while; behind an edge without one there may be the next carriageway
    whose own edge was not seen, but not at once.
    """
    m = len(lanes)
    n = find_neighbours([*lanes, *bounds], BEHIND_KERB_M)
    reach = np.concatenate([np.zeros(m), np.where(is_kerb, BEHIND_KERB_M, SEAM_M)])
    near = (n.line < m) & (n.other >= m) & (np.abs(n.across_m) <= reach[n.other])
    first = _nearest_per_station(n, near)
    # The boundary's carriageway is on its left; on that side is the marking, or it is behind
    behind = first & (n.across_m * n.facing > 0.0)
    return np.asarray(_share_of_stations(n, behind, [*lanes, *bounds])[:m] > 0.5)


def along_lines(bars: Sequence[LineAxis], lines: Sequence[LineAxis], reach_m: float) -> BoolArray:
    """Return which paint runs along a line, within reach: a piece of a marking, the face of a kerb or an edge."""
    m = len(bars)
    n = find_neighbours([*bars, *lines], reach_m)
    beside = (n.line < m) & (n.other >= m)
    return np.asarray(_share_of_stations(n, beside, [*bars, *lines])[:m] > 0.5)


def is_double(courses: Sequence[LineAxis]) -> BoolArray:
    """Return which markings run beside another one as one of a double line for most of their length."""
    n = find_neighbours(courses, DOUBLE_M)
    return np.asarray(_share_of_stations(n, np.ones(len(n.line), dtype=np.bool_), courses) > 0.5)


def paint_forms(bars: Sequence[LineAxis], road: Sequence[LineAxis]) -> list[str]:
    """Return what paint that is no line is: a bar of a zebra crossing, a stop line, an arrow's shaft.

    Bars of a crossing lie side by side, 0.5 to 1.3 m from each other; a stop line lies across the road; what is
    alone and along it is an arrow.

    Parameters
    ----------
    bars
        The paint.
    road
        Lines along the road: lane markings, boundaries, the van's way.
    """
    n = find_neighbours(bars, ZEBRA_M[1])
    beside = np.bincount(n.line[np.abs(n.across_m) >= ZEBRA_M[0]], minlength=len(bars))
    along = _cosine_with(bars, road)
    return [
        "zebra" if beside[i] > 0 else "stop" if along[i] < 0.5 else "arrow" if along[i] > 0.866 else ""
        for i in range(len(bars))
    ]


def _cosine_with(bars: Sequence[LineAxis], road: Sequence[LineAxis]) -> FloatArray:
    """Return the cosine between each bar and the nearest line of the road; NaN where there is none near."""
    if not road:
        return np.full(len(bars), np.nan)
    xy, normal = np.concatenate([c.xy for c in road]), np.concatenate([c.normal for c in road])
    tree = cKDTree(xy)
    out = np.full(len(bars), np.nan)
    for i, bar in enumerate(bars):
        distance, nearest = tree.query(bar.xy.mean(axis=0), distance_upper_bound=2.0 * LANE_M)
        if np.isfinite(distance):
            out[i] = abs(float(normal[nearest] @ bar.normal[0]))
    return out


def roles(
    lanes: Sequence[LineAxis], bounds: Sequence[LineAxis], way: Sequence[LineAxis], double: BoolArray
) -> list[str]:
    """Return the role of each marking, "" where it cannot be told.

    The outermost line of paint, next to the end of the carriageway, is an edge line. A double line is the
    centre line, and so is one that vans pass in opposite directions on either side, or a single line half-way
    between two boundaries. Lines inside that vans pass the same way on both sides, and one of several inside,
    part lanes.

    Parameters
    ----------
    lanes, bounds, way
        Markings, boundaries, and the ways of vans.
    """
    n = find_neighbours([*lanes, *bounds, *way], 2.0 * LANE_M)
    m, k = len(lanes), len(lanes) + len(bounds)
    sides = []
    for i in range(m):
        own = n.line == i
        across, other, facing, station = n.across_m[own], n.other[own], n.facing[own], n.station[own]
        found = []
        for sign in (1.0, -1.0):
            here = across * sign > DOUBLE_M
            n_stations = len(lanes[i].xy)
            paint, bound, van = (
                here & chosen for chosen in (other < m, (other >= m) & (other < k), other >= k)
            )
            near = van & (np.abs(across) < LANE_M)
            found.append(
                _Side(
                    _typical(np.abs(across[paint]), station[paint], n_stations),
                    _typical(np.abs(across[bound]), station[bound], n_stations),
                    float(np.sign(facing[near].sum())),
                )
            )
        sides.append(found)
    inside = [not s[0].is_outer and not s[1].is_outer for s in sides]
    return [_role(*sides[i], is_double=bool(double[i]), is_one_of_many=sum(inside) > 1) for i in range(m)]


class _Side(NamedTuple):
    """What is on one side of a line: distance to the next paint and boundary [m], and which way vans go there."""

    paint_m: float
    bound_m: float
    way: float

    @property
    def is_outer(self) -> bool:
        """Whether no paint lies between the line and the end of the carriageway."""
        return not np.isfinite(self.paint_m) or self.paint_m > self.bound_m


def _role(left: _Side, right: _Side, *, is_double: bool, is_one_of_many: bool) -> str:
    """Return the role of a line with this on either side."""
    if is_double or left.way * right.way < 0.0:
        return "centre"
    if left.is_outer and right.is_outer:
        if not (np.isfinite(left.bound_m) and np.isfinite(right.bound_m)):
            return ""
        return "centre" if 0.6 < left.bound_m / right.bound_m < 1.67 else "edge"
    if left.is_outer or right.is_outer:
        outer, inner = (left, right) if left.is_outer else (right, left)
        is_edge = not np.isfinite(outer.bound_m) or outer.bound_m < 0.8 * inner.paint_m
        return "edge" if is_edge else "centre"
    return "lane" if is_one_of_many or left.way * right.way > 0.0 else ""


def _typical(across: FloatArray, station: AnyArray, n_stations: int) -> float:
    """Return the median distance of the nearest line per station, inf where most stations have none."""
    if len(across) == 0:
        return np.inf
    order = np.lexsort((across, station))
    first = np.concatenate([[True], np.diff(station[order]) != 0])
    nearest = across[order][first]
    return float(np.median(nearest)) if len(nearest) > 0.4 * n_stations else np.inf


def _share_of_stations(n: Neighbours, chosen: BoolArray, courses: Sequence[LineAxis]) -> FloatArray:
    """Return for each line the share of its stations with a chosen neighbour."""
    stations = np.unique(n.station[chosen])
    owner = np.repeat(np.arange(len(courses)), [len(c.xy) for c in courses])
    counted = np.bincount(owner[stations], minlength=len(courses))
    return counted / np.maximum([len(c.xy) for c in courses], 1)
