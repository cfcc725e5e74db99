"""Wires whose points scatter farther than the gate, fitted together: airborne surveys, conductors in bundles.

Separate from `fit`, which fits one wire to the points within its gate. Where the gate cuts the scatter off, such a fit
drifts from one conductor of a bundle to the next. Here all wires within reach of each other are fitted at once, to all
points about them: a mixture of normal distributions, one about each wire, and of points that belong to none
(expectation and maximisation: Dempster, Laird and Rubin 1977). The number of wires is that of the smallest information
criterion (Schwarz 1978, doi:10.1214/aos/1176344136).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from linework.arrays import BoolArray, FloatArray, IntArray
from linework.kernels.cables.mixture import UNKNOWNS_OF_WIRE, MixtureLimits, settle_mixture
from linework.methods.cables.band import CableBand, Widths
from linework.methods.cables.fit import NO_POINTS, FittedWire, fit_members, main_run
from linework.methods.cables.follow import LEAST_OCCUPIED, LEAST_ROW_POINTS_PER_M, LEAST_SEEN_M, is_in_rows

#: Scatter of a wire's points from which the gate cuts them off, in gates: 5 % of a normal distribution lie beyond two
#: deviations.
CUT_OFF_GATES = 0.5
#: Most wires of a bundle: lines of 400 kV and more have four conductors a phase.
MOST_WIRES = 4
#: Least distance of two wires in deviations of their points: nearer ones have one mode (2), with a reserve.
LEAST_APART_SIGMAS = 3.0
#: Least distance of two wires that are lines of their own [m]: the conductors of a bundle are 0.2 m apart and more,
#: nearer ones are twisted into one cable.
LEAST_APART_M = 0.1
#: Largest scatter of the points of a wire, in gates: airborne scanners have 5 to 10 cm. What scatters farther is more
#: than one wire, or none.
MOST_SCATTER_GATES = 1.5
#: Half width of a wire's gate in deviations of its points, and in distances to the next wire.
BUNDLE_GATE_SIGMAS, GATE_APART = 4.0, 0.5
#: Share of the known length that is looked ahead, and at least so much [m].
_AHEAD_SHARE, _AHEAD_M = 0.25, 10.0
#: Points that tell the wires of a bundle apart: a hundred of each would, and these fit into the cache. The wires
#: themselves are fitted to all of their points.
ENOUGH_TO_TELL = 1500
#: Unknowns of a strip: those of a wire, its slope and its width; and the share of its points beyond either edge, that strays
#: make it no wider.
_STRIP_UNKNOWNS, _BEYOND_STRIP = 9, 0.01
#: Steps of looking ahead, and the least that one must bring [m].
_MOST_STEPS, _LEAST_STEP_M = 60, 0.5


class PointsNearby(NamedTuple):
    """Points about a line in space, by station.

    Parameters
    ----------
    points
        (n,) int64 indices in the band.
    s, o, dz
        (n,) stations along the line, offsets to its left and heights above it. [m]
    """

    points: IntArray
    s: FloatArray
    o: FloatArray
    dz: FloatArray


@dataclass(frozen=True, slots=True)
class Mixture:
    """Wires side by side, and the points about them.

    Parameters
    ----------
    across, up
        (wires, 3) each: offset and height [m] of each wire, parabolas of the scaled station. Wind bends them in plan.
    share
        (wires,) share of the points that are on each.
    sigma_o_m, sigma_z_m
        Standard deviations of a point across and in height. [m]
    middle_m, half_m
        Station that is 0, and length that is 1. [m]
    likelihood
        Logarithm, less half the information criterion's price of the unknowns.
    """

    across: FloatArray
    up: FloatArray
    share: FloatArray
    sigma_o_m: float
    sigma_z_m: float
    middle_m: float
    half_m: float
    likelihood: float

    def residuals(self, about: PointsNearby) -> tuple[FloatArray, FloatArray]:
        """Return offsets and heights (wires, n) of points from each wire [m]."""
        u = (about.s - self.middle_m) / self.half_m
        powers = np.stack([np.ones_like(u), u, u * u])
        return about.o - self.across @ powers, about.dz - self.up @ powers

    def squares(self, about: PointsNearby) -> FloatArray:
        """Return the squared distances (wires, n) of points from each wire, in standard deviations."""
        off, up = self.residuals(about)
        return np.asarray((off / self.sigma_o_m) ** 2 + (up / self.sigma_z_m) ** 2)

    def distances_m(self) -> FloatArray:
        """Return the mean distances between the wires, (wires, wires) [m]; infinite from a wire to itself."""
        u = np.linspace(-1.0, 1.0, 9)
        powers = np.stack([np.ones_like(u), u, u * u])
        place = np.stack([self.across @ powers, self.up @ powers])
        distance = np.hypot(*(place[:, :, None] - place[:, None, :])).mean(axis=-1)
        np.fill_diagonal(distance, np.inf)
        return np.asarray(distance)

    def apart_m(self) -> FloatArray:
        """Return the mean distance of each wire to the next one, (wires,) [m]; infinite for a single one."""
        return np.asarray(self.distances_m().min(axis=1))

    def cables(self) -> IntArray:
        """Return the number of the cable that each wire is twisted into, (wires,) int64."""
        n = len(self.share)
        near = (self.distances_m() < LEAST_APART_M) | np.eye(n, dtype=bool)
        for _ in range(n):  # neighbours of neighbours
            near = near @ near
        return np.asarray(np.unique(np.argmax(near, axis=1), return_inverse=True)[1], dtype=np.int64)


def tell_apart(band: CableBand, wires: list[FittedWire]) -> list[FittedWire]:
    """Return the wires; those whose points scatter farther than the gate are fitted together with their neighbours.

    All others are left as they are.
    """
    is_taken = np.zeros(len(band.xyz), dtype=bool)
    apart = _bundles(band, [w for w in wires if _is_cut_off(w)], is_taken)
    return [w for w in wires if is_taken[w.members].mean() < 0.5] + apart


def bundled_wires(band: CableBand, wires: list[FittedWire], crowded: list[FittedWire]) -> list[FittedWire]:
    """Return the wires of bundles about lines that have others beside them (`crowded`), and those beside `wires`.

    None has points of `wires`.
    """
    is_taken = np.zeros(len(band.xyz), dtype=bool)
    for wire in wires:
        is_taken[_scattered_about(band, wire)] = True
    first = _bundles(band, [w for w in crowded if is_taken[w.members].mean() < 0.5], is_taken)
    for wire in first:
        is_taken[_scattered_about(band, wire)] = True
    beside = _bundles(band, [w for w in wires + first if _has_rows_beside(band, w, is_taken)], is_taken)
    found = np.unique(np.concatenate([NO_POINTS, *(w.members for w in wires)]))
    return [replace(w, others=np.union1d(w.others, found)) for w in first + beside]


def _scattered_about(band: CableBand, wire: FittedWire) -> IntArray:
    """Return the points within four deviations of a wire, (k,) int64 in the band: its gate may be narrower."""
    about = _about(band, wire, np.zeros(len(band.xyz), dtype=bool), wire.low_m, wire.high_m)
    reach_m = max(BUNDLE_GATE_SIGMAS * max(wire.sigma_o_m, wire.fit.sigma_m), wire.gate_m)
    return np.concatenate([wire.members, about.points[np.hypot(about.o, about.dz) <= reach_m]])


def _has_rows_beside(band: CableBand, wire: FittedWire, is_taken: BoolArray) -> bool:
    """Return whether free points beside a wire are in rows; where wires are dense, few of their points are isolated."""
    beside = _about(band, wire, is_taken, wire.low_m, wire.high_m)
    is_dense = len(beside.s) >= LEAST_ROW_POINTS_PER_M * wire.length_m
    return is_dense and is_in_rows(beside.s, beside.o, beside.dz, wire.widths)


def _bundles(band: CableBand, seeds: list[FittedWire], is_taken: BoolArray) -> list[FittedWire]:
    """Return the wires about all pieces (`seeds`), the longest first; their points are then taken."""
    left = sorted(seeds, key=lambda w: (-w.length_m, w.plan.x, w.plan.y, w.fit.curve.height_m))
    apart = list[FittedWire]()
    is_tried = np.zeros(len(band.xyz), dtype=bool)
    while left:
        seed = left.pop(0)
        found = _bundle_about(band, seed, is_taken)
        is_tried[seed.members] = True
        for wire in found:
            is_taken[wire.members] = is_tried[wire.members] = True
        apart += found
        left = [w for w in left if is_tried[w.members].mean() < 0.5]
    return apart


def _is_cut_off(wire: FittedWire) -> bool:
    """Return whether a wire's gate cuts the scatter of its points off."""
    return max(wire.sigma_o_m, wire.fit.sigma_m) > CUT_OFF_GATES * wire.widths.gate_m


def _bundle_about(band: CableBand, seed: FittedWire, is_taken: BoolArray) -> list[FittedWire]:
    """Return the wires within reach of a piece; none where it is unclear."""
    middle = seed
    about = _about(band, middle, is_taken, middle.low_m, middle.high_m)
    mixture = _best_mixture(about, seed.widths)
    for _ in range(_MOST_STEPS):
        longer = middle if mixture is None else _farther(band, middle, is_taken, mixture)
        if longer.length_m <= middle.length_m + _LEAST_STEP_M:
            break
        middle = longer
        about = _about(band, middle, is_taken, middle.low_m, middle.high_m)
        mixture = _best_mixture(about, seed.widths)
    return [] if mixture is None else _wires_of(band, mixture, about, seed.widths)


def _about(band: CableBand, middle: FittedWire, is_taken: BoolArray, low: float, high: float) -> PointsNearby:
    """Return the free points within reach of a line in space between two stations [m]."""
    plan, reach_m = middle.plan, middle.widths.crowd_m
    bow_m = float(np.abs(plan.aside(np.array([low, high]))).max())
    near = band.near(np.array([plan.x, plan.y, plan.ux, plan.uy, low, high]), reach_m + bow_m)
    near = near[~is_taken[near]]
    s, o, dz = middle.residuals(band.xyz[near])
    inside = (np.abs(o) <= reach_m) & (np.abs(dz) <= reach_m) & (s >= low) & (s <= high)
    order = np.lexsort((dz[inside], o[inside], s[inside]))
    return PointsNearby(near[inside][order], s[inside][order], o[inside][order], dz[inside][order])


def _farther(band: CableBand, middle: FittedWire, is_taken: BoolArray, mixture: Mixture) -> FittedWire:
    """Return the middle of the wires (`middle`) fitted to all points on them, up to the first long stretch of none."""
    step = max(_AHEAD_SHARE * middle.length_m, _AHEAD_M)
    about = _about(band, middle, is_taken, middle.low_m - step, middle.high_m + step)
    on = np.flatnonzero(mixture.squares(about).min(axis=0) <= LEAST_APART_SIGMAS**2)
    first, last = main_run(about.s[on])
    members = about.points[on[first:last]]
    return fit_members(band, members, middle.widths) if len(members) >= 2 * UNKNOWNS_OF_WIRE else middle


def _best_mixture(about: PointsNearby, widths: Widths) -> Mixture | None:
    """Return the mixture with the number of wires that the points show; None: too few points, or none settles."""
    if len(about.s) < 2 * UNKNOWNS_OF_WIRE:
        return None
    step = 1 + len(about.s) // ENOUGH_TO_TELL
    some = PointsNearby(about.points[::step], about.s[::step], about.o[::step], about.dz[::step])
    start = Mixture(
        np.zeros((1, 3)), np.zeros((1, 3)), np.array([0.9]), 2.0 * widths.gate_m, 2.0 * widths.gate_m,
        float(some.s[0] + some.s[-1]) / 2.0, max(float(some.s[-1] - some.s[0]) / 2.0, 1.0), -np.inf,
    )  # fmt: skip
    one = _settled(some, start, widths)
    if one is None:
        return None
    best: Mixture = one
    for n in range(2, MOST_WIRES + 1):
        for is_stacked in (False, True):
            best = _likelier(best, _settled(some, _spread(one, n, is_stacked), widths))
    # Wires of unequal lengths: the one that was begun with, no wider than the gate, and one more at a time of what is left
    narrow = replace(start, sigma_o_m=widths.gate_m, sigma_z_m=widths.gate_m)
    next_one = _settled(some, narrow, widths, most_m=widths.gate_m)
    while next_one is not None:
        best = _likelier(best, next_one)
        next_one = _with_one_more(some, next_one, widths) if len(next_one.share) < MOST_WIRES else None
    if max(best.sigma_o_m, best.sigma_z_m) > MOST_SCATTER_GATES * widths.gate_m:
        return None
    is_several = int(best.cables().max()) > 0
    return None if is_several and _likelihood_of_strip(some, best, widths) > best.likelihood else best


def _likelihood_of_strip(about: PointsNearby, mixture: Mixture, widths: Widths) -> float:
    """Return what a filled strip explains where a mixture has several wires, less the price of its unknowns.

    The edge of a roof, a board, a parapet: as even between two wires as on them, at any slope. Its middle is that of the
    wires, its direction across that in which their points spread farthest. Comparable with `Mixture.likelihood`.
    """
    on = mixture.squares(about).min(axis=0) <= BUNDLE_GATE_SIGMAS**2
    weight = mixture.share / mixture.share.sum()
    u = (about.s - mixture.middle_m) / mixture.half_m
    powers = np.stack([np.ones_like(u), u, u * u])
    off = np.stack([about.o - weight @ mixture.across @ powers, about.dz - weight @ mixture.up @ powers])
    if np.count_nonzero(on) < _STRIP_UNKNOWNS:
        return -math.inf
    _, axes = np.linalg.eigh(np.cov(off[:, on]))
    through, along = axes.T @ off
    through = through - through[on].mean()
    low, high = np.quantile(along[on], [_BEYOND_STRIP, 1.0 - _BEYOND_STRIP])
    sigma = max(float(through[on].std()), widths.sigma_m)
    width = max(float(high - low), sigma)
    # The edges of a strip are as blurred as its face
    beyond = np.maximum(np.maximum(low - along, along - high), 0.0)
    density = np.exp(-0.5 * (through**2 + beyond**2) / sigma**2) / (sigma * math.sqrt(2.0 * math.pi))
    density /= width + sigma * math.sqrt(2.0 * math.pi)
    share = min(float(on.mean()), 0.999)
    sums = share * density + (1.0 - share) / (2.0 * widths.crowd_m) ** 2
    return float(np.log(sums).sum()) - 0.5 * _STRIP_UNKNOWNS * math.log(len(about.s))


def _likelier(best: Mixture, other: Mixture | None) -> Mixture:
    """Return the likelier of two mixtures; one whose wires are too near each other is none."""
    if other is None:
        return best
    scatter = max(other.sigma_o_m, other.sigma_z_m)
    if other.apart_m().min() < LEAST_APART_SIGMAS * scatter or other.likelihood <= best.likelihood:
        return best
    return other


def _with_one_more(about: PointsNearby, mixture: Mixture, widths: Widths) -> Mixture | None:
    """Return the mixture with one more wire, in the middle of the points that it leaves; None: they are too few."""
    left = np.flatnonzero(mixture.squares(about).min(axis=0) > LEAST_APART_SIGMAS**2)
    if len(left) < 2 * UNKNOWNS_OF_WIRE:
        return None
    rest = PointsNearby(about.points[left], about.s[left], about.o[left], about.dz[left])
    middle = np.zeros((2, 1, 3))
    middle[:, 0, 0] = np.median(rest.o), np.median(rest.dz)
    start = replace(
        mixture, across=middle[0], up=middle[1], share=np.array([0.9]), sigma_o_m=widths.gate_m, sigma_z_m=widths.gate_m,
    )  # fmt: skip
    more = _settled(rest, start, widths, most_m=widths.gate_m)
    if more is None:
        return None
    share = len(left) / len(about.s)
    return _settled(
        about,
        replace(
            mixture,
            across=np.concatenate([mixture.across, more.across]),
            up=np.concatenate([mixture.up, more.up]),
            share=np.concatenate([(1.0 - share) * mixture.share, share * more.share]),
        ),
        widths,
        most_m=widths.gate_m,
    )


def _spread(one: Mixture, n: int, is_stacked: bool) -> Mixture:
    """Return `n` wires spread evenly about a single one (`one`), side by side or above one another."""
    place = np.linspace(-1.5, 1.5, n)
    across, up = np.repeat(one.across, n, axis=0), np.repeat(one.up, n, axis=0)
    if is_stacked:
        up[:, 0] += place * one.sigma_z_m
    else:
        across[:, 0] += place * one.sigma_o_m
    share = np.full(n, one.share[0] / n)
    return Mixture(
        across,
        up,
        share,
        one.sigma_o_m / n,
        one.sigma_z_m / (n if is_stacked else 1),
        one.middle_m,
        one.half_m,
        -np.inf,
    )


def _settled(
    about: PointsNearby, start: Mixture, widths: Widths, *, most_m: float = math.inf
) -> Mixture | None:
    """Return the mixture after expectation and maximisation in turn; None: a wire has lost its points.

    most_m: largest scatter of the points of a wire [m].
    """
    points = np.stack([(about.s - start.middle_m) / start.half_m, about.o, about.dz], axis=1)
    curves, share = np.stack([start.across, start.up]), start.share.copy()
    limits = MixtureLimits(widths.crowd_m, widths.sigma_m, most_m)
    total, sigma_o, sigma_z = settle_mixture(
        points, curves, share, (start.sigma_o_m, start.sigma_z_m), limits
    )
    if math.isnan(total):
        return None
    price = 0.5 * UNKNOWNS_OF_WIRE * len(share) * math.log(len(points))
    across, up = curves
    return Mixture(across, up, share, sigma_o, sigma_z, start.middle_m, start.half_m, total - price)


def _wires_of(band: CableBand, mixture: Mixture, about: PointsNearby, widths: Widths) -> list[FittedWire]:
    """Return the wires of a mixture with points in enough of their metres, each fitted to those that are likely its own."""
    squares, (off, up) = mixture.squares(about), mixture.residuals(about)
    owner, is_explained = np.argmin(squares, axis=0), squares.min(axis=0) <= BUNDLE_GATE_SIGMAS**2
    sigma = max(mixture.sigma_o_m, mixture.sigma_z_m)
    distance, cable = mixture.distances_m(), mixture.cables()
    wires = []
    for k in range(int(cable.max()) + 1):
        mine = cable == k
        next_m = float(distance[np.ix_(mine, ~mine)].min(initial=np.inf))
        gate = max(min(BUNDLE_GATE_SIGMAS * sigma, GATE_APART * next_m), widths.gate_m)
        away = np.hypot(off[owner, np.arange(len(owner))], up[owner, np.arange(len(owner))])
        own = np.flatnonzero(mine[owner] & is_explained & (away <= gate))
        first, last = main_run(about.s[own])
        members = own[first:last]
        if len(members) < UNKNOWNS_OF_WIRE:
            continue
        twisted_m = float(np.where(np.isfinite(distance), distance, 0.0)[np.ix_(mine, mine)].max())
        wire = fit_members(band, about.points[members], Widths(gate + twisted_m / 2.0))
        seen = len(np.unique(np.floor(about.s[members])))
        if wire.length_m >= LEAST_SEEN_M and seen >= LEAST_OCCUPIED * wire.length_m:
            wires.append(wire)
    # What was taken for a wire and is none counts as beside the others
    return [
        replace(
            wire, others=np.sort(np.concatenate([NO_POINTS, *(w.members for w in wires if w is not wire)]))
        )
        for wire in wires
    ]
