"""Wires of spans: pieces of one catenary are joined, and every wire ends at its support.

Separate from `find`, which judges each wire by itself: this compares wires with one another.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from linework.arrays import BoolArray, FloatArray
from linework.lines.catenary import meeting_stations
from linework.methods.cables.band import CableBand
from linework.methods.cables.fit import FittedWire, fit_wire, main_run, near_end, split_at_kink

#: Longest hidden stretch between joined pieces, which is at most as long as the pieces together. [m]
MOST_HIDDEN_M = 40.0
#: Least share of a wire's points that are on no other: wires from 0.3 m apart share only those where spans meet.
LEAST_OWN = 0.5
#: Extension of a wire to a pole: at the far end points are metres apart, and insulators and the crossarm hide as much
#: again. [m]
POLE_CARRY_M = 4.0
#: Extension to where the wire of the next span has the same height, or those beside it end: across a crown, and over the
#: sparse points of the far end. [m]
CARRY_M = 10.0
#: Extension without a support: a metre from a point counts as measured. [m]
OPEN_M = 0.8
#: Distance that a wire may have been followed past its support, into the next span where that is taut. [m]
SUPPORT_PAST_M = 2.0
#: Length of both spans that their meeting follows from, whole spans along roads and a part of longer ones: the far end of
#: the next span may be outside the tile. [m]
SUPPORT_REACH_M = 60.0
#: Wires of a bundle leave their support within this angle [rad], within these distances in plan and in height [m].
BUNDLE_RAD, BUNDLE_PLAN_M, BUNDLE_UP_M = math.radians(12.0), 2.5, 5.0
#: Largest difference of direction in plan, a degree, and of slope, sags that differ by a fifth, of wires of a bundle.
BESIDE_TURN, BESIDE_TILT = 0.02, 0.03
#: A pole (or a wall that the wire ends at) is a column of points up to near the wire: least height, largest distance in
#: plan, and largest width along the wire; a crown is wider. [m]
POLE_M, POLE_SIDE_M, POLE_WIDE_M = 1.5, 0.6, 0.75


class WireEnd(NamedTuple):
    """An end of a wire: index of the wire, low (0) or high (1), position and outward direction in plan, wire there."""

    wire: int
    side: int
    xy: FloatArray
    out: FloatArray
    near: FittedWire


def join_pieces(band: CableBand, wires: list[FittedWire]) -> list[FittedWire]:
    """Return the wires, with pieces of one catenary of one span joined, longest first.

    A joint fit must explain both pieces as well as their own fits do, without a kink.
    """
    longest = sorted(wires, key=lambda w: (-w.length_m, w.plan.x, w.plan.y, w.fit.curve.height_m))
    ends = np.array([w.plan.places(np.array([w.low_m, w.high_m])) for w in longest]).reshape(-1, 2, 2)
    is_left = np.ones(len(longest), dtype=bool)
    done: list[FittedWire] = []
    for i in range(len(longest)):
        if not is_left[i]:
            continue
        wire, is_left[i] = longest[i], False
        for k in _in_line(wire, ends, is_left):
            joint = _joined(band, wire, longest[k]) if _one_line(wire, longest[k]) else None
            if joint is not None:
                wire = joint
                is_left[k] = False
        done.append(wire)
    return done


def _in_line(wire: FittedWire, ends: FloatArray, is_left: BoolArray) -> list[int]:
    """Return the wires that are left whose ends (n, 2, 2) lie about the line of one: a handful of a thousand pieces.

    The test of `_one_line` for all at once; without it half of the time of the search is spent there.
    """
    left = np.flatnonzero(is_left)
    across = np.abs(wire.plan.stations(ends[left].reshape(-1, 2))[1]).reshape(-1, 2)
    return [int(k) for k in left[across.max(axis=1, initial=0.0) <= 4.0 * wire.widths.side_m + 1e-6]]


def _one_line(wire: FittedWire, other: FittedWire) -> bool:
    """Return whether two pieces may be one wire, by their ends and the gap between them."""
    ends = other.at(np.array([other.low_m, other.high_m]))
    s, o, dz = wire.residuals(ends)
    near = int(np.argmin(np.abs(s - (wire.low_m + wire.high_m) / 2.0)))
    hidden = max(float(s.min()) - wire.high_m, wire.low_m - float(s.max()))
    return bool(
        np.abs(o).max() <= 4.0 * wire.widths.side_m
        and abs(o[near]) <= wire.widths.side_m
        and abs(dz[near]) <= max(wire.widths.side_m, 0.03 * hidden)
        and hidden <= min(MOST_HIDDEN_M, wire.length_m + other.length_m)
    )


def _joined(band: CableBand, wire: FittedWire, other: FittedWire) -> FittedWire | None:
    """Return the joint fit of two pieces, or None where it does not explain both."""
    members = np.union1d(wire.members, other.members)
    joint = fit_wire(band, members, wire.widths, np.union1d(wire.others, other.others))
    if joint is None:
        return None
    if any(np.isin(w.members, joint.members).mean() < 0.9 for w in (wire, other)):
        return None
    worst = max(wire.fit.sigma_m, other.fit.sigma_m)
    if joint.fit.sigma_m > 1.3 * worst + 0.002 or split_at_kink(band, joint, 3.0) is not None:
        return None
    return joint


def without_mixtures(band: CableBand, wires: list[FittedWire]) -> list[FittedWire]:
    """Return the wires without those that consist of pieces of others: curves laid across a bundle.

    The wire with the smallest share of points of its own is removed first, until all have enough.
    """
    kept = list(wires)
    times = np.zeros(len(band.xyz), dtype=np.int64)
    for w in kept:
        times[w.members] += 1
    while kept:
        own = [float((times[w.members] == 1).mean()) for w in kept]
        worst = int(np.argmin(own))
        if own[worst] >= LEAST_OWN:
            break
        times[kept.pop(worst).members] -= 1
    return kept


def without_tails(band: CableBand, wires: list[FittedWire]) -> list[FittedWire]:
    """Return the wires without the points that they share with others at their ends.

    Followed past its support a wire crosses those of the next span, which lie on it for a metre or so. Points on one
    wire alone show where it ends; the supports are found from there.
    """
    times = np.zeros(len(band.xyz), dtype=np.int64)
    for w in wires:
        times[w.members] += 1
    kept = []
    for w in wires:
        s = w.plan.stations(band.xyz[w.members, :2])[0]
        own = np.flatnonzero(times[w.members] == 1)
        if len(own) < 4:
            continue
        first, last = main_run(s[own])
        a, b = own[first], own[last - 1] + 1
        kept.append(replace(w, members=w.members[a:b], low_m=float(s[a]), high_m=float(s[b - 1])))
    return kept


def end_at_supports(band: CableBand, wires: list[FittedWire], min_length_m: float) -> list[FittedWire]:
    """Return the wires with their ends moved to where neighbouring spans meet, or to the pole.

    Parameters
    ----------
    min_length_m
        Shorter wires are kept only if they share a support with a longer one or hang beside one: pieces at the edge of
        the survey, or of a partly hidden span. [m]

    Notes
    -----
    Wires of neighbouring spans are paired by where their lines or catenaries meet; an end without a partner ends at a
    pole, or at the support of the wires beside it; without any support it is extended a little.
    """
    wires = _with_partners(band, wires, min_length_m)
    ends = _ends(band, wires)
    of_wire = np.zeros(len(band.xyz), dtype=bool)
    for w in wires:
        of_wire[w.members] = True
    support = {(e.wire, e.side): place for pair, place in _met(ends) for e in pair}
    for end in ends:
        if (end.wire, end.side) not in support:
            pole = _pole_at(band, of_wire, wires[end.wire], end)
            if pole is not None:
                support[end.wire, end.side] = pole
    limits = [[w.low_m, w.high_m] for w in wires]
    for end in ends:
        place = support.get((end.wire, end.side))
        if place is None:
            place = _support_of_bundle(wires, ends, support, end)
        if place is None:
            place = end.xy + OPEN_M * end.out
        limits[end.wire][end.side] = float(wires[end.wire].plan.stations(place[None])[0][0])
    return [
        replace(w, low_m=low, high_m=high)
        for w, (low, high) in zip(wires, limits, strict=True)
        if high - low > 1.0
    ]


def _with_partners(band: CableBand, wires: list[FittedWire], min_length_m: float) -> list[FittedWire]:
    """Return the wires that are long enough, or meet such a wire at a support, or hang beside one."""
    long = [w.length_m >= min_length_m for w in wires]
    if all(long):
        return wires
    met = [pair for pair, _ in _met(_ends(band, wires))]
    partner = {a.wire for a, b in met if long[b.wire]} | {b.wire for a, b in met if long[a.wire]}
    known = [w for w, is_long in zip(wires, long, strict=True) if is_long]
    return [
        w
        for i, w in enumerate(wires)
        if long[i] or i in partner or any(_hangs_beside(w, other) for other in known)
    ]


def _hangs_beside(wire: FittedWire, other: FittedWire) -> bool:
    """Return whether a short piece runs along a wire of the same bundle, in plan and in height."""
    middle = (wire.low_m + wire.high_m) / 2.0
    s, o, dz = other.residuals(wire.at(np.array([middle])))
    turn = abs(wire.plan.ux * other.plan.uy - wire.plan.uy * other.plan.ux)
    same_way = math.copysign(1.0, wire.plan.ux * other.plan.ux + wire.plan.uy * other.plan.uy)
    tilt = abs(same_way * wire.fit.curve.slope_at(np.array([middle]))[0] - other.fit.curve.slope_at(s)[0])
    return bool(
        turn <= BESIDE_TURN
        and tilt <= BESIDE_TILT
        and other.low_m <= s[0] <= other.high_m
        and abs(o[0]) <= BUNDLE_PLAN_M
        and abs(dz[0]) <= BUNDLE_UP_M
    )


def _met(ends: list[WireEnd]) -> list[tuple[tuple[WireEnd, WireEnd], FloatArray]]:
    """Return the pairs of ends on one support, and its position (2,); the nearest pairs first."""
    taken: set[int] = set()
    pairs = []
    for _, a, b, place in _meetings(ends):
        if a not in taken and b not in taken:
            taken |= {a, b}
            pairs.append(((ends[a], ends[b]), place))
    return pairs


def _ends(band: CableBand, wires: list[FittedWire]) -> list[WireEnd]:
    """Return both ends of all wires."""
    ends = []
    for i, wire in enumerate(wires):
        for side, sign in ((0, -1.0), (1, 1.0)):
            near = near_end(band, wire, side, SUPPORT_REACH_M)
            last = np.array([wire.high_m if side else wire.low_m])
            at = near.plan.stations(wire.plan.places(last))[0]
            ahead = sign if near.plan.ux * wire.plan.ux + near.plan.uy * wire.plan.uy > 0.0 else -sign
            out = ahead * np.array([near.plan.ux, near.plan.uy])
            ends.append(WireEnd(i, side, near.plan.places(at)[0], out, near))
    return ends


def _meetings(ends: list[WireEnd]) -> list[tuple[float, int, int, FloatArray]]:
    """Return (cost, end, end, position) of all pairs of ends that may be on one support, by cost."""
    xy = np.array([e.xy for e in ends]).reshape(-1, 2)
    out = np.array([e.out for e in ends]).reshape(-1, 2)
    of_wire = np.array([e.wire for e in ends], dtype=np.int64)
    order = np.lexsort(xy.T)  # by position: the order of two wires must not depend on their lengths
    found = []
    for n, a in enumerate(order):
        end = ends[a]
        later = order[n + 1 :]
        off, facing = xy[later] - end.xy, out[later] @ end.out < -0.5
        near = np.hypot(off[:, 0], off[:, 1]) <= CARRY_M + POLE_CARRY_M
        for b in later[near & facing & (of_wire[later] != end.wire)]:
            meeting = _meeting(end.near, ends[b].near, end, ends[b])
            if meeting is not None:
                found.append((meeting[0], int(a), int(b), meeting[1]))
    return sorted(found, key=lambda m: m[0])


def _meeting(
    wire: FittedWire, other: FittedWire, end: WireEnd, end2: WireEnd
) -> tuple[float, FloatArray] | None:
    cross = float(end.out[0] * end2.out[1] - end.out[1] * end2.out[0])
    d = end2.xy - end.xy
    if abs(cross) > math.sin(math.radians(2.0)):
        along = float(d[0] * end2.out[1] - d[1] * end2.out[0]) / cross
        places = [end.xy + along * end.out]
    else:
        if abs(float(end.out[0] * d[1] - end.out[1] * d[0])) > 2.0 * wire.widths.side_m:
            return None
        places = [end.xy + a * end.out for a in _height_meetings(wire, other, end, float(d @ end.out))]
    best: tuple[float, FloatArray] | None = None
    for place in places:
        on1, on2 = float((place - end.xy) @ end.out), float((place - end2.xy) @ end2.out)
        if max(on1, on2) > CARRY_M or on1 + on2 > CARRY_M + POLE_CARRY_M or min(on1, on2) < -SUPPORT_PAST_M:
            continue
        gap = abs(_height(wire, place) - _height(other, place))
        cost = abs(on1) + abs(on2) + 10.0 * gap
        if gap <= wire.widths.side_m and (best is None or cost < best[0]):
            best = (cost, place)
    return best


def _height_meetings(wire: FittedWire, other: FittedWire, end: WireEnd, apart_m: float) -> list[float]:
    """Return the distances beyond `end` at which two collinear wires have the same height, and the middle of the gap."""
    station = float(wire.plan.stations(end.xy[None])[0][0])
    sign = 1.0 if float(end.out @ np.array([wire.plan.ux, wire.plan.uy])) > 0.0 else -1.0
    same = wire.plan.ux * other.plan.ux + wire.plan.uy * other.plan.uy
    shift = float(wire.plan.stations(other.plan.places(np.array([other.fit.curve.station_m])))[0][0])
    curve = replace(
        other.fit.curve, station_m=shift, slope=other.fit.curve.slope * (1.0 if same > 0 else -1.0)
    )
    low, high = sorted((station - sign * SUPPORT_PAST_M, station + sign * max(apart_m + SUPPORT_PAST_M, 0.0)))
    meetings = [sign * (float(s) - station) for s in meeting_stations(wire.fit.curve, curve, low, high)]
    return [*meetings, apart_m / 2.0]


def _height(wire: FittedWire, place: FloatArray) -> float:
    """Return the height of a wire at a position (2,) in plan. [m]."""
    x, y = place.tolist()
    return wire.fit.curve.height_of((x - wire.plan.x) * wire.plan.ux + (y - wire.plan.y) * wire.plan.uy)


def _support_of_bundle(
    wires: list[FittedWire], ends: list[WireEnd], support: dict[tuple[int, int], FloatArray], end: WireEnd
) -> FloatArray | None:
    """Return the position (2,) on the wire beside the supports at which its neighbours end, or None."""
    own_height = _height(wires[end.wire], end.xy)
    stations = []
    for other in ends:
        place = support.get((other.wire, other.side))
        if place is None or float(other.out @ end.out) < math.cos(BUNDLE_RAD):
            continue
        off = place - end.xy
        on, aside = float(off @ end.out), abs(float(end.out[0] * off[1] - end.out[1] * off[0]))
        up = abs(_height(wires[other.wire], place) - own_height)
        if aside <= BUNDLE_PLAN_M and up <= BUNDLE_UP_M and -SUPPORT_PAST_M <= on <= CARRY_M:
            stations.append(on)
    return end.xy + float(np.median(stations)) * end.out if stations else None


def _pole_at(band: CableBand, of_wire: BoolArray, wire: FittedWire, end: WireEnd) -> FloatArray | None:
    """Return the position (2,) on the wire at a pole just beyond its end, or None."""
    line = np.array([*end.xy, *end.out, -POLE_WIDE_M, POLE_CARRY_M])
    near = band.near(line, POLE_SIDE_M)
    near = near[~of_wire[near]]  # a stack of wires is not a pole
    along = (band.xyz[near, :2] - end.xy) @ end.out
    drop = _height(wire, end.xy) - band.xyz[near, 2]
    below = (drop > -0.5) & (drop < POLE_M + 1.0)
    bins = np.floor((along[below] + POLE_WIDE_M) / 0.25).astype(np.int64)
    levels = np.unique(np.stack([bins, np.floor(drop[below] / 0.25).astype(np.int64)]), axis=1)[0]
    column = np.flatnonzero(np.bincount(levels, minlength=1) >= 0.6 * POLE_M / 0.25)
    if len(column) == 0:
        return None
    run = column[column - np.arange(len(column)) == column[0]]
    if 0.25 * len(run) > POLE_WIDE_M:
        return None
    at_pole = (bins >= run[0]) & (bins <= run[-1])
    return end.xy + float(np.median(along[below][at_pole])) * end.out
