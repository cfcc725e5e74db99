"""Robust fit of one wire, its line in plan and its catenary, to all points on it; and its surroundings."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, replace

import numpy as np

from linework.arrays import BoolArray, FloatArray, IntArray
from linework.kernels.cables import catenary as hanging
from linework.kernels.cables import fit as kernels
from linework.lines.catenary import Catenary, CatenaryFit, fit_catenary
from linework.methods.cables.band import RING, RING_INNER, CableBand, Widths
from linework.methods.cables.follow import PlanLine

#: Gap beyond which a tail must be a wire itself: a length [m], or a number of usual gaps; such a tail is at least this
#: long [m] and half as densely hit as the wire.
TAIL_GAP_M, TAIL_GAPS, TAIL_LONG_M = 3.0, 3.0, 2.0
#: Distance beyond the ends of a piece within which points are collected [m]; and most rounds in which a wire is extended
#: to all that follows without a gap: two or three suffice, more where much is missing.
NEXT_M, MOST_ROUNDS = 0.5, 30
#: Metres at the ends of a wire that insulators, crossarm and pole may occupy.
FITTING_METRES = 2
#: Longest usual gap of a wire; over longer ones something hides it. [m]
MOST_USUAL_M = 6.0
#: Sigmas of a bow that is certain: three, and points in groups of three that err alike; and fewest points of one: of
#: fewer, noise alone is bent by five sigmas once in hundreds.
BOW_SIGMAS, LEAST_BOW_POINTS = 5.0, 12
#: Deviation of a wire's points in height below which none is a kink: scanners resolve ranges to 2 mm, and of points without
#: noise the rest of a fit would be halved again and again. [m]
LEAST_KINK_M = 0.002
#: Points of the wires that one by itself was fitted together with.
NO_POINTS: IntArray = np.zeros(0, dtype=np.int64)
#: Factor from the cofactors of the coefficient of u^2 to those of the curvature.
_TWICE = np.outer((1.0, 1.0, 2.0), (1.0, 1.0, 2.0))


@dataclass(frozen=True, slots=True)
class FittedWire:
    """A wire over (part of) one span.

    Parameters
    ----------
    plan
        Its line in plan.
    fit
        Its catenary over that line's stations.
    low_m, high_m
        Stations of its ends. [m]
    members
        (n,) int64 indices of its points in the band, by rising station.
    sigma_o_m
        Standard deviation of a point's offset. [m]
    widths
        Widths that it was searched with.
    others
        (k,) int64, sorted: points in the band of the wires that it was fitted together with; they are not beside it.
    """

    plan: PlanLine
    fit: CatenaryFit
    low_m: float
    high_m: float
    members: IntArray
    sigma_o_m: float
    widths: Widths
    others: IntArray

    @property
    def length_m(self) -> float:
        """Length in plan. [m]."""
        return self.high_m - self.low_m

    @property
    def gate_m(self) -> float:
        """Largest distance of a point of the wire from its axis: four deviations across. [m]."""
        width = 4.0 * max(self.sigma_o_m, self.fit.sigma_m)
        return min(max(width, self.widths.tube_m), self.widths.gate_m)

    def residuals(self, xyz: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return stations, offsets and heights above the wire of points (n, 3), (n,) each [m]."""
        plan = self.plan
        line = plan.x, plan.y, plan.ux, plan.uy
        s, o, dz = hanging.residuals(xyz, line, self.fit.curve.numbers)
        return s, o - plan.aside(s) if plan.bow_per_m else o, dz

    def at(self, station_m: FloatArray) -> FloatArray:
        """Return the positions on the wire at stations (n,), (n, 3) [m]."""
        return np.column_stack([self.plan.places(station_m), self.fit.curve.height_at(station_m)])


def fit_wire(
    band: CableBand, members: IntArray, widths: Widths, others: IntArray = NO_POINTS
) -> FittedWire | None:
    """Fit a wire to points, collect the points on it from the whole band, and fit again.

    Parameters
    ----------
    members
        (n,) int64 indices in the band of the points to start from.
    widths
        Widths across a wire.
    others
        (k,) int64, sorted: points of wires that it is fitted together with.

    Returns
    -------
    Wire or None
        None with fewer than four points.

    Notes
    -----
    The last fit depends on the points on the wire alone, not on how they were found. They are collected with a
    parabola, which departs from a catenary of 40 m that sags 1 m by 0.2 mm.
    """
    for _ in range(3):
        if len(members) < 4:
            return None
        wire = fit_members(band, members, widths, others)
        collected = _on_wire(band, wire, wire.low_m - NEXT_M, wire.high_m + NEXT_M)
        if np.array_equal(collected, wire.members):
            break
        members = collected
    return fit_members(band, members, widths, others) if len(members) >= 4 else None


def settle_wire(band: CableBand, wire: FittedWire) -> FittedWire:
    """Return the wire with all points on it and on what follows its ends, however it was found."""
    before = wire
    for _ in range(MOST_ROUNDS):
        members = _on_wire(band, wire, wire.low_m - TAIL_GAP_M, wire.high_m + TAIL_GAP_M)
        if len(members) < 4 or np.array_equal(members, wire.members):
            break
        after = fit_members(band, members, wire.widths, wire.others)
        if np.array_equal(after.members, before.members):  # alternating: the one with more points
            return max(wire, before, key=lambda w: len(w.members))
        before, wire = wire, after
    return fit_members(band, wire.members, wire.widths, wire.others)


def near_end(band: CableBand, wire: FittedWire, side: int, reach_m: float) -> FittedWire:
    """Return the wire fitted only to its points within `reach_m` [m] of its low (0) or high (1) end."""
    if wire.length_m <= reach_m:
        return wire
    s, _ = wire.plan.stations(band.xyz[wire.members, :2])
    limits = (wire.high_m - reach_m, wire.high_m) if side else (wire.low_m, wire.low_m + reach_m)
    edges = wire.plan.places(np.array(limits))
    members = wire.members[(s >= limits[0]) & (s <= limits[1])]
    if len(members) < 8:
        return wire
    near = fit_members(band, members, wire.widths, wire.others)
    for _ in range(MOST_ROUNDS):
        low, high = near.plan.stations(edges)[0].tolist()
        members = _on_wire(band, near, min(low, high), max(low, high))
        if len(members) < 8 or np.array_equal(members, near.members):
            break
        near = fit_members(band, members, wire.widths, wire.others)
    return fit_exact_catenary(band, near)


def fit_exact_catenary(band: CableBand, wire: FittedWire) -> FittedWire:
    """Return the wire with the catenary itself fitted to its points."""
    xyz = band.xyz[wire.members]
    s, o, dz = wire.residuals(xyz)
    least = wire.widths.sigma_m
    weights = kernels.tukey(o, max(wire.sigma_o_m, least)) * kernels.tukey(dz, max(wire.fit.sigma_m, least))
    if np.count_nonzero(weights) < 4:
        return wire
    straight = wire.fit.curve.curvature_per_m <= 0.0  # a wire can only pull
    return replace(wire, fit=fit_catenary(s, xyz[:, 2], weights, straight=straight))


def fit_members(
    band: CableBand, members: IntArray, widths: Widths, others: IntArray = NO_POINTS
) -> FittedWire:
    """Return the wire fitted to these points and no others, independent of their order; arguments as for `fit_wire`."""
    members = members[np.lexsort(band.xyz[members].T)]
    xyz = band.xyz[members]
    x, y, z = (np.ascontiguousarray(column) for column in xyz.T)
    x0, y0, ux, uy, sigma_o, weights = kernels.robust_line(x, y, widths.sigma_m)
    plan = PlanLine(x0, y0, ux, uy)
    s, o = plan.stations(xyz[:, :2])
    bent, sigma = _bowed(plan, s, o, z, sigma_o, widths)
    if bent is not plan:
        bent_s, bent_o = bent.stations(xyz[:, :2])
        bent_weights = kernels.tukey(bent_o, max(sigma, widths.sigma_m))
        # A bow that fewer points lie on than define one is none
        if np.count_nonzero(bent_weights) >= LEAST_BOW_POINTS:
            plan, sigma_o, s, weights = bent, sigma, bent_s, bent_weights
    centre, curve, cofactor, sigma_z, _ = kernels.robust_parabola(s, z, weights, widths.sigma_m)
    hang = Catenary(centre, curve[0], curve[1], max(2.0 * curve[2] / math.hypot(1.0, curve[1]), 0.0))
    cofactor = cofactor * _TWICE
    order = np.lexsort((xyz[:, 2], xyz[:, 1], s))
    fit = CatenaryFit(hang, cofactor, sigma_z)
    return FittedWire(plan, fit, float(s.min()), float(s.max()), members[order], sigma_o, widths, others)


def _bowed(
    plan: PlanLine, s: FloatArray, o: FloatArray, z: FloatArray, sigma_o: float, widths: Widths
) -> tuple[PlanLine, float]:
    """Return the line bent to points (n,), where wind has pushed the wire aside by more than they scatter; and that [m].

    A bow must be certain, too: neighbouring points err alike, so that its sigma is an underestimate. It is no larger than
    the sag: wind swings a wire out of the vertical by less than 45 degrees, and what does not hang is not a wire.
    """
    if len(s) < LEAST_BOW_POINTS:
        return plan, sigma_o
    one = np.ones(len(s))
    bend, cofactor, sigma = kernels.robust_parabola(s, o, one, widths.sigma_m)[1:4]
    sag = kernels.robust_parabola(s, z, one, widths.sigma_m)[1][2]
    middle = float(np.mean(s))
    reach = max(float(np.abs(s - middle).max()), 1e-3)
    spread = max(sigma, widths.sigma_m)
    is_certain = abs(bend[2]) > BOW_SIGMAS * spread * math.sqrt(max(float(cofactor[2, 2]), 0.0))
    if not is_certain or abs(bend[2]) > sag or abs(bend[2]) * reach**2 <= sigma_o:
        return plan, sigma_o
    # The parabola is about the mean station; the line is its tangent there
    line = plan.turned(float(bend[0] - bend[1] * middle), float(bend[1]))
    at = line.places(np.array([middle * math.hypot(1.0, float(bend[1]))]))[0]
    bow = 2.0 * float(bend[2]) / math.hypot(1.0, float(bend[1])) ** 3
    return PlanLine(float(at[0]), float(at[1]), line.ux, line.uy, bow), float(sigma)


def _line_of(plan: PlanLine, low_m: float, high_m: float) -> FloatArray:
    return np.array([plan.x, plan.y, plan.ux, plan.uy, low_m, high_m])


def _sagitta_m(plan: PlanLine, low_m: float, high_m: float) -> float:
    """Return the largest distance of a line between two stations from its tangent [m]."""
    return float(np.abs(plan.aside(np.array([low_m, high_m]))).max())


def among(wires: list[FittedWire], band: CableBand) -> list[FittedWire]:
    """Return the wires, each fitted together with no others than these: what else it was fitted with is beside it."""
    is_of_wire = np.zeros(len(band.xyz), dtype=bool)
    for wire in wires:
        is_of_wire[wire.members] = True
    return [replace(w, others=w.others[is_of_wire[w.others]]) if len(w.others) else w for w in wires]


def _not_of(wire: FittedWire, points: IntArray) -> IntArray:
    """Return the points (k,) without those of the wires that this one was fitted together with."""
    if len(wire.others) == 0:
        return points
    at = np.minimum(np.searchsorted(wire.others, points), len(wire.others) - 1)
    return np.asarray(points[wire.others[at] != points])


def _on_wire(band: CableBand, wire: FittedWire, low: float, high: float) -> IntArray:
    """Return the points of the band on an extended wire between two stations [m], (k,) int64 by station.

    Beyond the first and the last metre clear of other points it continues to the next other point: in a crown leaves
    lie on any line.
    """
    reach_m = RING * wire.gate_m + _sagitta_m(wire.plan, low, high)
    near = _not_of(wire, band.near(_line_of(wire.plan, low, high), reach_m))
    s, o, dz = wire.residuals(band.xyz[near])
    gate = wire.gate_m
    # Metres are counted from the origin of the band, independent of the points of the wire
    shift = wire.plan.x * wire.plan.ux + wire.plan.y * wire.plan.uy
    on = np.flatnonzero(
        kernels.on_wire(
            s,
            o,
            dz,
            kernels.OnWireEdges(low, high, shift),
            kernels.OnWireRadii(gate, RING_INNER * gate, RING * gate),
        )
    )
    if len(on) == 0:
        return near[:0]
    near, s = near[on], s[on]
    order = np.lexsort((band.xyz[near, 2], o[on], s))
    members: IntArray = near[order]
    first, last = main_run(s[order])
    return members[first:last]


def main_run(s: FloatArray) -> tuple[int, int]:
    """Return the range of rising stations (n,) [m] without stray points beyond the ends of a wire.

    What follows a gap is kept only if it is a piece of wire itself. A wire that scan lines drift along has gaps
    throughout; the mean gap, weighted by length, shows that.
    """
    if len(s) < 4:
        return 0, len(s)
    found, metres = kernels.station_runs(s, MOST_USUAL_M, TAIL_GAP_M, TAIL_GAPS)
    edges, seen = found.tolist(), metres.tolist()
    if len(seen) == 1:
        return 0, len(s)
    runs = list(itertools.pairwise(edges))
    long = [float(s[b - 1] - s[a]) for a, b in runs]
    first = last = seen.index(max(seen))
    density = min(seen[first] / max(long[first], 1.0), 1.0)
    is_wire = [
        length >= TAIL_LONG_M and m >= 0.5 * density * length for m, length in zip(seen, long, strict=True)
    ]
    while first > 0 and is_wire[first - 1]:
        first -= 1
    while last < len(runs) - 1 and is_wire[last + 1]:
        last += 1
    return edges[first], edges[last + 1]


@dataclass(frozen=True, slots=True)
class WireSurroundings:
    """Points on and around a wire, metre by metre.

    Parameters
    ----------
    n_points
        Number of points on it.
    occupied
        Share of its metres with a point on it.
    ringed
        Share of these with points in the ring about it, more than every third of those on it.
    crowded
        Share of these with points of other objects than wires within 0.6 m.
    taken
        Number of ringed or crowded metres, except at its ends, where it hangs on something.
    even
        Evenness of the points along it, 0 to 1: (sum of r)^2 / sum of r^2 over the number of metres, r the root of the
        number of points in a metre.
    wavy_m
        Deviation of its metres from the catenary beyond the scatter within them. [m]
    """

    n_points: int
    occupied: float
    ringed: float
    crowded: float
    taken: int
    even: float
    wavy_m: float


def surroundings(band: CableBand, wire: FittedWire, of_wire: BoolArray) -> WireSurroundings:
    """Return the points on and around a wire.

    Parameters
    ----------
    of_wire
        (n,) bool: points of the band that belong to any wire; they do not count as crowding.
    """
    reach_m = wire.widths.crowd_m + _sagitta_m(wire.plan, wire.low_m, wire.high_m)
    near = _not_of(wire, band.near(_line_of(wire.plan, wire.low_m, wire.high_m), reach_m))
    s, o, dz = wire.residuals(band.xyz[near])
    r = np.hypot(o, dz)
    metre = np.floor(s - wire.low_m).astype(np.int64)
    n_metres = max(math.ceil(wire.length_m), 1)

    def count(chosen: BoolArray) -> FloatArray:
        return np.bincount(metre[chosen], minlength=n_metres + 1)[:n_metres].astype(np.float64)

    on = count(r <= wire.gate_m)
    ring = count((r > RING_INNER * wire.gate_m) & (r <= RING * wire.gate_m))
    others = count((r > RING_INNER * wire.gate_m) & (r <= wire.widths.crowd_m) & ~of_wire[near])
    has, is_ringed, is_crowded = on > 0, ring > on / 3.0, others > 0
    n_has = max(int(has.sum()), 1)
    return WireSurroundings(
        n_points=int(on.sum()),
        occupied=float(has.mean()),
        ringed=float((has & is_ringed).sum() / n_has),
        crowded=float((has & is_crowded).sum() / n_has),
        taken=int((is_ringed | is_crowded)[FITTING_METRES : n_metres - FITTING_METRES].sum()),
        even=float(np.sqrt(on).sum() ** 2 / max(on.sum(), 1.0) / n_metres),
        wavy_m=_wavy(metre, o, dz, r <= wire.gate_m),
    )


def _wavy(metre: IntArray, o: FloatArray, dz: FloatArray, on: BoolArray) -> float:
    """Return the deviation of the means of metres beyond that explained by the scatter within them [m]."""
    count = np.bincount(metre[on])
    n, m = int(count.sum()), int(np.count_nonzero(count))
    if n - m < 3:
        return 0.0
    square = 0.0
    for residual in (o[on], dz[on]):
        between = float((np.bincount(metre[on], weights=residual)[count > 0] ** 2 / count[count > 0]).sum())
        within = (float((residual**2).sum()) - between) / (n - m)
        square += max(between - m * within, 0.0) / n
    return math.sqrt(square)


def split_at_kink(band: CableBand, wire: FittedWire, least_m: float) -> tuple[IntArray, IntArray] | None:
    """Return the points on either side of a support inside a wire, (k,) int64 each, or None without one.

    Notes
    -----
    Two parabolas always fit better than one; they must halve the sum of squares, and the wire must turn down at the
    break, as it does over a support.
    """
    xyz = band.xyz[wire.members]
    s, _ = wire.plan.stations(xyz[:, :2])
    # Kernels are compiled for contiguous arrays
    z = np.ascontiguousarray(xyz[:, 2])
    off = z - wire.fit.curve.height_at(s)
    if len(off) == 0 or math.sqrt(float(np.mean(off * off))) < LEAST_KINK_M:
        return None
    i, share = kernels.best_break(s, off, least_m, 0.5, 6)
    if share > 0.5:
        return None
    one = np.ones(len(s))
    left, right = (
        kernels.robust_parabola(s[part], z[part], one[part], wire.widths.sigma_m)
        for part in (slice(i), slice(i, None))
    )
    falls = [fit[1][1] + 2.0 * fit[1][2] * (s[i] - fit[0]) for fit in (left, right)]
    return (wire.members[:i], wire.members[i:]) if falls[1] < falls[0] else None
