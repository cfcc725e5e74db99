"""The arrangement of the lines of a road: boundaries behind others, double lines, roles of markings."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from linework.arrays import AnyArray, BoolArray, FloatArray, IntArray
from linework.methods.tracking.neighbours import AXIS_STATION_M, LineAxis, Neighbours, find_neighbours
from linework.model.boxes import BoxSet

#: Widest carriageway, or half of one with paint in its middle. [m]
FACING_M = 20.0
#: Stations of two lines are beside each other if they are no farther apart along the line, in stations.
_BESIDE_STATIONS = 0.75
#: Largest distance from the end of a kerb to the one that continues it (stations are a metre from the ends). [m]
KERB_CONTINUES_M = 4.0
#: Paint within this of a boundary may be its stone. [m]
BESIDE_KERB_M = 0.45
#: Width of the footways and yards behind a kerb, where paint is not a marking. [m]
BEHIND_KERB_M = 15.0
#: An edge with paint this close behind it is a seam within the carriageway. [m]
SEAM_M = 3.0
#: Lines of one side of a carriageway lie within this: a lane with its shoulder, a parking lane and a footway. [m]
SECTION_M = 8.0
#: Widest strip of another brightness within a carriageway: the band between wheel tracks, a trench. [m]
SHADE_STRIP_M = 3.0
#: Half the width of a vehicle that passes, at least: small vans are 1.8 m wide. [m]
HALF_VEHICLE_M = 0.9
#: Widest gutter or kerb bed. [m]
WIDEST_GUTTER_M = 1.5
#: Largest distance of the stripes of a double line, middle to middle (two of 0.15 m with a gap of 0.2 m). [m]
DOUBLE_M = 0.50
#: Distance of the bars of a zebra crossing, middle to middle. [m]
ZEBRA_M = (0.5, 1.3)
#: Widest lane. [m]
LANE_M = 6.0
#: A property holds for a line if it does at more than this share of its stations; a neighbour counts if it is there at
#: more than this share of them.
_MOST, _OFTEN = 0.5, 0.4
#: A change of the ground is refused for what is beside it at more than this share of its stations.
_SOME = 0.3
# Why a boundary or a change of the ground is none of the carriageway's
DRIVEN_OVER = "inside the carriageway: driven over, or paint lies close behind it"
STRIP = "strip of another brightness, as between wheel tracks"
DARKER = "darker outside, and nothing but brightness changes"
OUTWEIGHED = "a parallel edge has more evidence"
SEAM = "the road goes on behind it: a seam"
GUTTER = "gutter of a kerb behind it"
HIDDEN = "another boundary lies between it and the carriageway"
NOTHING_IN_FRONT = "no carriageway in front of it"

#: Cosines with the road below which a bar lies across it (60 degrees), and above which it runs along it (30 degrees).
_ACROSS_ROAD, _ALONG_ROAD = 0.5, 0.866
#: Ratios of the distances to both boundaries between which a line lies half-way between them.
_HALF_WAY = (0.6, 1.67)
#: An edge line is nearer to the end of the carriageway than this share of its distance to the next paint.
_EDGE_SHARE = 0.8


def beside_kerb(
    boxes: BoxSet, kerbs: Sequence[LineAxis], from_m: float, to_m: float | FloatArray
) -> BoolArray:
    """Return which boxes lie beside a kerb, (n,) bool: between two offsets [m] from its foot, positive on the road.

    to_m: one for all boxes, or (n,), one for each.
    """
    out = np.zeros(len(boxes), dtype=np.bool_)
    if not kerbs or len(boxes) == 0:
        return out
    xy = np.concatenate([c.xy for c in kerbs])
    normal = np.concatenate([c.normal for c in kerbs])
    to_m = np.broadcast_to(to_m, len(boxes))
    reach = np.hypot(np.maximum(abs(from_m), np.abs(to_m)), _BESIDE_STATIONS * AXIS_STATION_M)
    distance, nearest = cKDTree(xy).query(boxes.centre[:, :2], distance_upper_bound=float(reach.max()))
    near = distance < reach
    step = boxes.centre[near, :2] - xy[nearest[near]]
    across = np.sum(step * normal[nearest[near]], axis=1)
    out[near] = (across > from_m) & (across < to_m[near])
    return out


def outweighed(
    axes: Sequence[LineAxis],
    evidence: FloatArray,
    shades: IntArray,
    is_known: BoolArray,
    is_channel: BoolArray,
    is_bank: BoolArray,
    lanes: Sequence[LineAxis],
    path: Sequence[LineAxis],
) -> AnyArray:
    """Return why changes of the ground are not where the carriageway ends, (m,) str; "" for those that may be.

    Of parallel ones that face the same way, that with the most evidence in all is the end; a patch, a wheel track or a
    seam is shorter or fainter. None ends a carriageway on which a vehicle passes as close as half its width, nor where
    paint or the path lies close behind it.

    Parameters
    ----------
    axes
        Boundaries that are known, and changes, each with the carriageway to its left.
    evidence
        (m,) log-likelihood that the line is one, in all; inf: it cannot be outweighed.
    shades
        (m,) +1 where the line is a change of brightness alone, brighter outside, -1 where it is darker, 0 for others.
    is_known, is_channel, is_bank
        (m,) bool: boundaries that are known, which stay; channels, which yield to all but backs of footways; and steps that
        may be banks of a verge, which yield to what lies in front of them.
    lanes, path
        Axes of markings and of the vehicle's path.
    """
    m, every = len(axes), [*axes, *lanes, *path]
    n = find_neighbours(every, SECTION_M)
    is_lane, is_path = n.other >= m, n.other >= m + len(lanes)
    inside = is_path & (np.abs(n.across_m) < HALF_VEHICLE_M)
    seam = is_lane & (n.across_m < -BESIDE_KERB_M) & (n.across_m > -SEAM_M)
    why = np.full(m, "", dtype=object)
    why[share_of_stations(n, (n.line < m) & (inside | seam), every)[:m] > _SOME] = DRIVEN_OVER
    # Wheel tracks and strips of other asphalt are as bright on one side as on the other
    shade = np.concatenate([shades * 1.0, np.zeros(len(every) - m)])
    strip = (shade[n.line] * shade[n.other] * n.facing < 0.0) & (np.abs(n.across_m) < SHADE_STRIP_M)
    why[(why == "") & (share_of_stations(n, strip, every)[:m] > _SOME)] = STRIP
    # Grass, soil and stone are brighter than asphalt
    why[(why == "") & (shades < 0)] = DARKER
    why[is_known | is_bank] = ""
    # Those that weigh most first; brightness or a channel alone weighs less than any boundary that is known
    weighs = np.append(evidence > 0.0, np.zeros(len(every) - m, dtype=np.bool_))
    known = np.append(is_known, np.zeros(len(every) - m, dtype=np.bool_)) & weighs
    facing, edges = ~is_lane & (n.facing > 0.0), np.flatnonzero(is_known & np.isfinite(evidence))
    faces = facing & ~(n.ends_footway & np.isin(n.other, edges))
    is_stronger = np.zeros(len(every), dtype=np.bool_)
    for i in np.lexsort((np.arange(m), -evidence)).tolist():
        stronger = (is_stronger | known) if shades[i] or is_channel[i] else is_stronger
        rival = (n.line == i) & (faces if is_channel[i] else facing) & stronger[n.other]
        rival &= ~is_bank[i] | (n.across_m > 0.0)
        if not why[i] and not is_known[i] and share_of_stations(n, rival, every)[i] > _SOME:
            why[i] = OUTWEIGHED
        is_stronger[i] = not why[i] and weighs[i]
    return why.astype(np.str_)


def between_kerbs(axes: Sequence[LineAxis], is_kerb: BoolArray) -> BoolArray:
    """Return which boundaries without a kerb lie on the carriageway of two kerbs that face each other, (m,) bool.

    The next boundary behind such a line is a kerb with its carriageway towards the line, farther off than a gutter or a
    footway; and so is the next kerb in front. Behind the edge of a median the next boundary faces away.

    Parameters
    ----------
    axes
        Boundaries, each with the carriageway to its left.
    is_kerb
        (m,) bool.
    """
    n = find_neighbours(axes, FACING_M)
    own = ~is_kerb[n.line]
    behind = nearest_per_station(n, own & (n.across_m < 0.0))
    faces_back = behind & is_kerb[n.other] & (n.facing > 0.0) & (n.across_m < -SEAM_M)
    ahead = nearest_per_station(n, own & (n.across_m > 0.0) & is_kerb[n.other])
    faces_front = ahead & (n.facing < 0.0)
    shares = [share_of_stations(n, chosen, axes) for chosen in (faces_back, faces_front)]
    return np.asarray((shares[0] > _MOST) & (shares[1] > _MOST))


def bounds_carriageway(
    axes: Sequence[LineAxis],
    is_kerb: BoolArray,
    is_sure: BoolArray,
    markings: Sequence[LineAxis],
    path: Sequence[LineAxis],
) -> AnyArray:
    """Return why boundaries do not have a carriageway in front of them and none behind, (m,) str; "" for those that do.

    The first line across from a boundary, towards its carriageway, is paint, the vehicle's path, or a boundary that
    faces it. If it is a boundary facing away, that one is the end of the carriageway: walls, hedges and garden edges at
    the back of a footway stand behind it. An edge without a kerb that has paint or the vehicle's path close behind it
    is a seam of the asphalt, and one beside a kerb is its gutter; neither hides a kerb.

    Parameters
    ----------
    axes
        Boundaries, each with the carriageway to its left.
    is_kerb
        (m,) bool.
    is_sure
        (m,) bool: sure boundaries, to which paint behind them means nothing (it is grass or stone).
    markings, path
        Axes of markings and of the vehicle's path.
    """
    m, lanes, has_path = len(axes), [*markings, *path], len(path) > 0
    n = find_neighbours([*axes, *lanes], FACING_M)
    own = n.line < m
    is_lane = n.other >= m
    kerb = np.concatenate([is_kerb, np.zeros(len(lanes), dtype=np.bool_)])
    counts = is_lane | kerb[n.other] | ~kerb[n.line]
    ahead = own & counts & (n.across_m > 0.0)
    first = nearest_per_station(n, ahead)
    in_front = first & (is_lane | (n.facing < 0.0))
    behind = own & (n.across_m < 0.0) & ~kerb[n.line]
    sure = np.concatenate([is_sure, np.zeros(len(lanes), dtype=np.bool_)])
    # Paint along a line between kerbs is on the carriageway, too
    inside = np.concatenate([between_kerbs(axes, is_kerb), np.zeros(len(lanes), dtype=np.bool_)])
    along = inside[n.line] & (np.abs(n.across_m) < BESIDE_KERB_M)
    seam = (behind | along) & is_lane & (n.across_m > -SEAM_M) & ~sure[n.line]
    gutter = behind & kerb[n.other] & (n.across_m > -WIDEST_GUTTER_M) & (n.facing > 0.0)
    every = [*axes, *lanes]
    good = share_of_stations(n, in_front, every)[:m] > _MOST
    # A kerb shows on which side its carriageway is; without a path, and paint near it, so does every boundary
    hidden = share_of_stations(n, first & ~in_front, every)[:m] > _MOST
    is_alone = (not has_path) & (share_of_stations(n, own & is_lane, every)[:m] <= _MOST)
    good |= ~hidden & (is_kerb | is_alone)
    bad = share_of_stations(n, seam | gutter, every)[:m] > _MOST
    is_gutter = bad & (share_of_stations(n, gutter, every)[:m] >= share_of_stations(n, seam, every)[:m])
    why = np.where(is_gutter, GUTTER, np.where(bad, SEAM, np.where(hidden, HIDDEN, NOTHING_IN_FRONT)))
    # Behind a boundary that is kept there is the back of its footway, however well it goes on from another
    kept = np.concatenate([good & ~bad, np.zeros(len(lanes), dtype=np.bool_)])
    is_behind = share_of_stations(n, first & ~in_front & kept[n.other], every)[:m] > _MOST
    return np.where(_with_continued(axes, is_kerb & ~is_behind, good & ~bad), "", why)


def _with_continued(axes: Sequence[LineAxis], is_kerb: BoolArray, kept: BoolArray) -> BoolArray:
    """Return the kept boundaries and the kerbs that continue them, (m,) bool: round the corners of side streets."""
    kept = kept.copy()
    ends = np.array([(c.xy[0], c.xy[-1]) for c in axes]).reshape(-1, 2, 2)
    open_ = [i for i in np.flatnonzero(kept).tolist() if is_kerb[i]]
    while open_:
        i = open_.pop()
        before = np.linalg.norm(ends[:, 1] - ends[i, 0], axis=1) <= KERB_CONTINUES_M
        behind = np.linalg.norm(ends[:, 0] - ends[i, 1], axis=1) <= KERB_CONTINUES_M
        new = np.flatnonzero((before | behind) & is_kerb & ~kept).tolist()
        kept[new] = True
        open_ += new
    return kept


def nearest_per_station(n: Neighbours, chosen: BoolArray) -> BoolArray:
    """Return which of the chosen neighbours are the nearest at their station, (k,) bool."""
    index = np.flatnonzero(chosen)
    order = index[np.lexsort((np.abs(n.across_m[index]), n.station[index]))]
    first = np.concatenate([[True], np.diff(n.station[order]) != 0]) if len(order) else np.zeros(0, bool)
    out = np.zeros(len(chosen), dtype=np.bool_)
    out[order[first]] = True
    return out


def has_road_behind(
    axes: Sequence[LineAxis], lanes: Sequence[LineAxis], path: Sequence[LineAxis]
) -> BoolArray:
    """Return which boundaries are stepped down from their road, (m,) bool: its carriageway lies behind, not in front.

    Where the verge is lower than the pavement, the step faces the verge. What tells the side is where the vehicle went,
    and without it where paint is: the first line across, with no other boundary between.

    Parameters
    ----------
    axes
        Boundaries, each with its lower side to its left.
    lanes
        Axes of markings. Those within `BESIDE_KERB_M` of a boundary tell nothing: kerb stones are bright.
    path
        Axes of the vehicle's path.
    """
    m = len(axes)
    every = [*axes, *lanes, *path]
    n = find_neighbours(every, FACING_M)
    own = n.line < m
    is_path = n.other >= m + len(lanes)
    is_bound = n.other < m
    out = np.zeros(m, dtype=np.bool_)
    decided = np.zeros(m, dtype=np.bool_)
    for is_lane in (is_path, ~is_bound & (np.abs(n.across_m) > BESIDE_KERB_M)):
        counts = own & (is_lane | is_bound)
        ahead = nearest_per_station(n, counts & (n.across_m > 0.0)) & is_lane
        behind = nearest_per_station(n, counts & (n.across_m < 0.0)) & is_lane
        in_front, at_back = (share_of_stations(n, side, every)[:m] for side in (ahead, behind))
        out |= ~decided & (at_back > _MOST) & (in_front < at_back - _MOST)
        decided |= np.maximum(in_front, at_back) > _MOST
    return out


def behind_boundaries(
    lanes: Sequence[LineAxis], bounds: Sequence[LineAxis], width_m: FloatArray
) -> BoolArray:
    """Return which markings lie behind a boundary, (m,) bool: bright strips on footways, in yards and on verges.

    width_m: (k,) how far behind each boundary there is no carriageway [m].
    """
    m = len(lanes)
    n = find_neighbours([*lanes, *bounds], BEHIND_KERB_M)
    reach = np.concatenate([np.zeros(m), width_m])
    near = (n.line < m) & (n.other >= m) & (np.abs(n.across_m) <= reach[n.other])
    first = nearest_per_station(n, near)
    # The carriageway is on the left of the boundary: a marking on its right is behind
    behind = first & (n.across_m * n.facing > 0.0)
    return np.asarray(share_of_stations(n, behind, [*lanes, *bounds])[:m] > _MOST)


def along_lines(bars: Sequence[LineAxis], lines: Sequence[LineAxis], reach_m: float) -> BoolArray:
    """Return which paint runs along a line within reach [m], (m,) bool: pieces of markings, faces of kerbs, edges."""
    m = len(bars)
    n = find_neighbours([*bars, *lines], reach_m)
    beside = (n.line < m) & (n.other >= m)
    return np.asarray(share_of_stations(n, beside, [*bars, *lines])[:m] > _MOST)


def is_double(axes: Sequence[LineAxis]) -> BoolArray:
    """Return which markings are one of a double line for most of their length, (m,) bool."""
    n = find_neighbours(axes, DOUBLE_M)
    return np.asarray(share_of_stations(n, np.ones(len(n.line), dtype=np.bool_), axes) > _MOST)


def paint_forms(bars: Sequence[LineAxis], road: Sequence[LineAxis]) -> list[str]:
    """Return the form of paint that is not a line: "zebra", "stop", "arrow", or "" where it is unknown.

    The bars of a zebra crossing lie side by side, 0.5 to 1.3 m apart; a stop line lies across the road; a single bar
    along it is the shaft of an arrow.

    Parameters
    ----------
    bars
        The paint.
    road
        Lines along the road: lane markings, boundaries, the vehicle's path.
    """
    n = find_neighbours(bars, ZEBRA_M[1])
    beside = np.bincount(n.line[np.abs(n.across_m) >= ZEBRA_M[0]], minlength=len(bars))
    along = _cosine_with(bars, road)
    return [
        "zebra"
        if beside[i] > 0
        else "stop"
        if along[i] < _ACROSS_ROAD
        else "arrow"
        if along[i] > _ALONG_ROAD
        else ""
        for i in range(len(bars))
    ]


def _cosine_with(bars: Sequence[LineAxis], road: Sequence[LineAxis]) -> FloatArray:
    """Return the cosine between each bar and the nearest line of the road, (m,); NaN without one near."""
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
    lanes: Sequence[LineAxis], bounds: Sequence[LineAxis], path: Sequence[LineAxis], double: BoolArray
) -> list[str]:
    """Return the role of each marking: "edge", "centre", "lane", or "" where it is unknown.

    The outermost line of paint, next to the end of the carriageway, is an edge line. A double line is the centre line,
    and so is a line that vehicles pass in opposite directions on either side, or a single line half-way between two
    boundaries. Inner lines that vehicles pass in the same direction on both sides, and one of several inner lines,
    separate lanes.

    Parameters
    ----------
    lanes, bounds, path
        Axes of markings, of boundaries, and of the vehicle's path.
    double
        (m,) bool: markings that are one of a double line.
    """
    n = find_neighbours([*lanes, *bounds, *path], 2.0 * LANE_M)
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
    """One side of a line: distance to the next paint and boundary [m], and the sense in which vehicles pass there."""

    paint_m: float
    bound_m: float
    sense: float

    @property
    def is_outer(self) -> bool:
        """Whether there is no paint between the line and the end of the carriageway."""
        return not np.isfinite(self.paint_m) or self.paint_m > self.bound_m


def _role(left: _Side, right: _Side, *, is_double: bool, is_one_of_many: bool) -> str:
    """Return the role of a line from its two sides."""
    if is_double or left.sense * right.sense < 0.0:
        return "centre"
    if left.is_outer and right.is_outer:
        if not (np.isfinite(left.bound_m) and np.isfinite(right.bound_m)):
            return ""
        return "centre" if _HALF_WAY[0] < left.bound_m / right.bound_m < _HALF_WAY[1] else "edge"
    if left.is_outer or right.is_outer:
        outer, inner = (left, right) if left.is_outer else (right, left)
        is_edge = not np.isfinite(outer.bound_m) or outer.bound_m < _EDGE_SHARE * inner.paint_m
        return "edge" if is_edge else "centre"
    return "lane" if is_one_of_many or left.sense * right.sense > 0.0 else ""


def _typical(across: FloatArray, station: AnyArray, n_stations: int) -> float:
    """Return the median distance [m] of the nearest line per station, inf where most stations have none."""
    if len(across) == 0:
        return np.inf
    order = np.lexsort((across, station))
    first = np.concatenate([[True], np.diff(station[order]) != 0])
    nearest = across[order][first]
    return float(np.median(nearest)) if len(nearest) > _OFTEN * n_stations else np.inf


def share_of_stations(n: Neighbours, chosen: BoolArray, axes: Sequence[LineAxis]) -> FloatArray:
    """Return the share of each line's stations with a chosen neighbour, (m,)."""
    stations = np.unique(n.station[chosen])
    owner = np.repeat(np.arange(len(axes)), [len(c.xy) for c in axes])
    counted = np.bincount(owner[stations], minlength=len(axes))
    return counted / np.maximum([len(c.xy) for c in axes], 1)
