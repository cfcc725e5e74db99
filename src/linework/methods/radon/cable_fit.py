"""One wire: its line in plan and its catenary, fitted robustly to all points on it; and how alone it is."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import numpy as np

from linework.lines.catenary import CatenaryFit, fit_catenary
from linework.methods.radon.cable_band import Band
from linework.methods.radon.cable_follow import LEAST_TUBE_M, RING_M, Plan
from linework.model.arrays import BoolArray, FloatArray, IntArray

#: Tukey's constant: residuals beyond this many deviations weigh nothing, 95 % efficient on Gaussian noise.
TUKEY = 4.685
#: 1.4826 makes the median absolute deviation a standard deviation for Gaussian noise.
MAD = 1.4826
#: What lies beyond a gap of this length [m], or this many usual gaps, must be a stretch of this length [m]
#: half as often hit as the wire itself.
TAIL_GAP_M, TAIL_GAPS, TAIL_LONG_M = 3.0, 3.0, 2.0
#: Points are looked at out to here in plan and in height. [m]
ROUND_M = 0.6


@dataclass(frozen=True, slots=True)
class Wire:
    """A wire over (part of) one span.

    Parameters
    ----------
    plan
        Its line in plan.
    fit
        Its catenary over that line's stations.
    low_m, high_m
        Stations where it begins and ends.
    members
        (n,) int64: its points, numbers in the band, by rising station.
    sigma_o_m
        Standard deviation of a point's offset. [m]
    """

    plan: Plan
    fit: CatenaryFit
    low_m: float
    high_m: float
    members: IntArray
    sigma_o_m: float

    @property
    def length_m(self) -> float:
        """Length in plan. [m]."""
        return self.high_m - self.low_m

    @property
    def gate_m(self) -> float:
        """How far from the axis a point of the wire may lie: four deviations across. [m]."""
        return max(4.0 * max(self.sigma_o_m, self.fit.sigma_m), LEAST_TUBE_M)

    def residuals(self, xyz: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return (n,) stations, offsets and heights above the wire [m] of (n, 3) points."""
        s, o = self.plan.stations(xyz[:, :2])
        return s, o, xyz[:, 2] - self.fit.curve.height_at(s)

    def at(self, station_m: FloatArray) -> FloatArray:
        """Return (n, 3) places [m] on the wire."""
        return np.column_stack([self.plan.places(station_m), self.fit.curve.height_at(station_m)])


def fit_wire(band: Band, members: IntArray, gate_m: float) -> Wire | None:
    """Fit a wire to points, collect the points on it anew from the whole band, and fit again.

    Parameters
    ----------
    members
        (n,) int64: points to start from, numbers in the band.
    gate_m
        Widest gate across the wire.

    Returns
    -------
    Wire or None
        None where fewer than four points remain.

    Notes
    -----
    The last fit depends on the points on the wire alone, not on how they were found.
    """
    wire = None
    for _ in range(3):
        if len(members) < 4:
            return None
        wire = _fitted(band.xyz[members], members)
        collected = _on_wire(band, wire, min(wire.gate_m, gate_m))
        if np.array_equal(collected, wire.members):
            break
        members = collected
    return wire


def _fitted(xyz: FloatArray, members: IntArray) -> Wire:
    plan, sigma_o, weights = _plan_line(xyz[:, :2])
    s, _ = plan.stations(xyz[:, :2])
    fit = fit_catenary(s, xyz[:, 2], weights)
    for _ in range(4):
        residual = xyz[:, 2] - fit.curve.height_at(s)
        sigma = max(MAD * float(np.median(np.abs(residual))), 1e-3)
        w = weights * _tukey(residual, sigma)
        fit = fit_catenary(s, xyz[:, 2], w if np.count_nonzero(w) >= 4 else weights)
    if fit.curve.curvature_per_m <= 0.0:  # a wire pulls, it never pushes
        fit = fit_catenary(s, xyz[:, 2], w if np.count_nonzero(w) >= 4 else weights, straight=True)
    order = np.lexsort((xyz[:, 2], xyz[:, 1], s))
    return Wire(plan, fit, float(s.min()), float(s.max()), members[order], sigma_o)


def _plan_line(xy: FloatArray) -> tuple[Plan, float, FloatArray]:
    """Return the orthogonal robust line through (n, 2) points, the deviation across, and the weights."""
    weights = np.ones(len(xy))
    for _ in range(5):
        centre = weights @ xy / weights.sum()
        d = xy - centre
        _, axes = np.linalg.eigh((d * weights[:, None]).T @ d)
        u = axes[:, 1] if (axes[0, 1], axes[1, 1]) > (0.0, 0.0) else -axes[:, 1]
        plan = Plan(float(centre[0]), float(centre[1]), float(u[0]), float(u[1]))
        _, o = plan.stations(xy)
        sigma = max(MAD * float(np.median(np.abs(o))), 1e-3)
        weights = _tukey(o, sigma)
        if np.count_nonzero(weights) < 4:
            weights = np.ones(len(xy))
    return plan, sigma, weights


def _tukey(residual: FloatArray, sigma: float) -> FloatArray:
    x = np.clip(np.abs(residual) / (TUKEY * sigma), 0.0, 1.0)
    weights: FloatArray = (1.0 - x * x) ** 2
    return weights


def _line_of(plan: Plan, low_m: float, high_m: float) -> FloatArray:
    return np.array([plan.x, plan.y, plan.ux, plan.uy, low_m, high_m])


def _on_wire(band: Band, wire: Wire, gate_m: float) -> IntArray:
    """Return the band's points within the gate of a wire and half a metre beyond its ends, by station."""
    near = band.near(_line_of(wire.plan, wire.low_m - 0.5, wire.high_m + 0.5), gate_m)
    s, o, dz = wire.residuals(band.xyz[near])
    on = np.hypot(o, dz) <= gate_m
    order = np.lexsort((band.xyz[near[on], 2], o[on], s[on]))
    members: IntArray = near[on][order]
    first, last = main_run(s[on][order])
    return members[first:last]


def main_run(s: FloatArray) -> tuple[int, int]:
    """Return the range of rising stations without the odd points beyond a wire's ends.

    What follows a gap stays only if it is a piece of wire itself. Where beams and wire drift in and out of
    step a wire has gaps all along; the mean gap, each weighted by its length, tells.
    """
    if len(s) < 4:
        return 0, len(s)
    gaps = np.diff(s)
    usual = float((gaps**2).sum() / max(float(gaps.sum()), 1e-6))
    cuts = np.flatnonzero(gaps > max(TAIL_GAP_M, TAIL_GAPS * usual)) + 1
    edges = np.concatenate([[0], cuts, [len(s)]])
    runs = list(itertools.pairwise(edges))
    seen = [len(np.unique(np.floor(2.0 * s[a:b]))) / 2.0 for a, b in runs]
    long = [float(s[b - 1] - s[a]) for a, b in runs]
    first = last = int(np.argmax(seen))
    density = min(seen[first] / max(long[first], 1.0), 1.0)
    is_wire = [
        length >= TAIL_LONG_M and m >= 0.5 * density * length for m, length in zip(seen, long, strict=True)
    ]
    while first > 0 and is_wire[first - 1]:
        first -= 1
    while last < len(runs) - 1 and is_wire[last + 1]:
        last += 1
    return int(edges[first]), int(edges[last + 1])


@dataclass(frozen=True, slots=True)
class Surroundings:
    """What lies on and around a wire, metre by metre.

    Parameters
    ----------
    n_points
        Points on it.
    occupied
        Share of its metres with a point on it.
    ringed
        Share of these with points in the ring about it, more than every third of those on it.
    crowded
        Share of these with other points within 0.6 m that are no wire's.
    wavy_m
        Root mean square of the mean residuals of its metres: what the catenary does not explain.
    """

    n_points: int
    occupied: float
    ringed: float
    crowded: float
    wavy_m: float


def surroundings(band: Band, wire: Wire, of_wire: BoolArray) -> Surroundings:
    """Return what lies on and around a wire.

    Parameters
    ----------
    of_wire
        (n,) bool: points of the band that belong to any wire: they do not crowd.
    """
    near = band.near(_line_of(wire.plan, wire.low_m, wire.high_m), ROUND_M)
    s, o, dz = wire.residuals(band.xyz[near])
    r = np.hypot(o, dz)
    metre = np.floor(s - wire.low_m).astype(np.int64)
    n_metres = max(math.ceil(wire.length_m), 1)

    def count(chosen: BoolArray) -> FloatArray:
        return np.bincount(metre[chosen], minlength=n_metres + 1)[:n_metres].astype(np.float64)

    on = count(r <= wire.gate_m)
    ring = count((r > 1.25 * wire.gate_m) & (r <= max(RING_M, 2.0 * wire.gate_m)))
    others = count((r > 1.25 * wire.gate_m) & (r <= ROUND_M) & ~of_wire[near])
    has = on > 0
    n_has = max(int(has.sum()), 1)
    return Surroundings(
        n_points=int(on.sum()),
        occupied=float(has.mean()),
        ringed=float((has & (ring > on / 3.0)).sum() / n_has),
        crowded=float((has & (others > 0)).sum() / n_has),
        wavy_m=_wavy(metre, o, dz, r <= wire.gate_m, n_metres),
    )


def _wavy(metre: IntArray, o: FloatArray, dz: FloatArray, on: BoolArray, n_metres: int) -> float:
    count = np.bincount(metre[on], minlength=n_metres + 1)
    has = count >= 3
    if not has.any():
        return 0.0
    means = [np.bincount(metre[on], weights=r[on], minlength=n_metres + 1)[has] / count[has] for r in (o, dz)]
    return float(np.sqrt((means[0] ** 2 + means[1] ** 2).mean()))


def split_at_kink(band: Band, wire: Wire, least_m: float) -> tuple[IntArray, IntArray] | None:
    """Return the two groups of points on either side of a support inside a wire, or None where there is none.

    Notes
    -----
    Two parabolas with any break fit better than one; they must halve the sum of squares, and the wire must
    turn down at the break, as it does over a support. The break is searched at steps of half a metre.
    """
    xyz = band.xyz[wire.members]
    s, _ = wire.plan.stations(xyz[:, :2])
    z = xyz[:, 2] - wire.fit.curve.height_at(s)
    u = (s - wire.low_m) / max(wire.length_m, 1e-6) * 2.0 - 1.0
    moments = np.cumsum(
        np.stack([u**k for k in range(5)] + [z * u**k for k in range(3)] + [z * z], axis=1), axis=0
    )
    whole = moments[-1]
    best = (math.inf, 0)
    breaks = np.searchsorted(s, np.arange(wire.low_m + least_m, wire.high_m - least_m, 0.5))
    for i in np.unique(breaks):
        if 6 <= i <= len(s) - 6:
            squares = _residual_squares(moments[i - 1]) + _residual_squares(whole - moments[i - 1])
            best = min(best, (squares, int(i)))
    if not math.isfinite(best[0]) or best[0] > 0.5 * _residual_squares(whole):
        return None
    i = best[1]
    left, right = (
        np.polynomial.Polynomial.fit(s[part], xyz[part, 2], 2) for part in (slice(i), slice(i, None))
    )
    if right.deriv()(s[i]) >= left.deriv()(s[i]):
        return None
    return wire.members[:i], wire.members[i:]


def _residual_squares(moments: FloatArray) -> float:
    """Return the sum of squares about the parabola with these sums of u^0..u^4, z u^0..z u^2, z^2."""
    normal = np.array([moments[0:3], moments[1:4], moments[2:5]])
    right = moments[5:8]
    solution = np.linalg.lstsq(normal, right, rcond=1e-12)[0]
    return max(float(moments[8] - solution @ right), 0.0)
