"""Wires to lines: vertices, sigmas, bridged stretches, clearance and confidence."""

from __future__ import annotations

import math

import numpy as np
from scipy.ndimage import median_filter

from linework.arrays import BoolArray, FloatArray
from linework.methods.cables.band import CableBand
from linework.methods.cables.fit import FittedWire, WireSurroundings
from linework.model.lines import LineSet

#: A chord leaves the catenary by k d^2 / 8: at 1 m and 0.05 per m that is 6 mm, and 0.6 mm on a usual wire.
CHORD_M = 0.005
#: A wire is bridged where the nearest point is farther along than this [m], ...
WIRE_BRIDGED_M = 1.0
#: ... or than this many times its usual distance between points, where it is hit more rarely.
USUAL_GAPS = 3.0
#: What no fit sees [m]: hits lie on the side of the wire that faces the scanner, a radius of 4 to 12 mm off
#: its axis, some of it sideways and some down; and a pass is off by its pose, a few millimetres.
HIDDEN_SIGMA_M = 0.005


def lines_of_wires(
    band: CableBand,
    wires: list[FittedWire],
    around: list[WireSurroundings],
    time_s: FloatArray | None,
    spacing_m: float,
) -> LineSet:
    """Return one line per wire, in the order of their western ends.

    Parameters
    ----------
    around
        What lies around each wire.
    time_s
        (n,) time of the tile's points, or None.
    spacing_m
        Distance of the vertices, less where the wire bends so much that a chord leaves it by 5 mm.
    """
    lines = [_vertices(w, spacing_m) for w in wires]
    order = sorted(range(len(wires)), key=lambda i: tuple(lines[i][0].round(3)))
    wires, lines, around = [wires[i] for i in order], [lines[i] for i in order], [around[i] for i in order]
    if not lines:
        return LineSet.empty()
    sigmas = [_sigmas(band, w, line) for w, line in zip(wires, lines, strict=True)]
    spans = [_time_span(band, w, time_s) for w in wires]
    n = len(lines)
    return LineSet.from_lines(
        [line + band.origin for line in lines],
        sigma_xy_m=np.concatenate([s[0] for s in sigmas]),
        sigma_z_m=np.concatenate([s[1] for s in sigmas]),
        bridged=np.concatenate([_bridged(band, w, line) for w, line in zip(wires, lines, strict=True)]),
        kind=["cable"] * n,
        method=["radon"] * n,
        clearance_m=[_clearance(band, w, line) for w, line in zip(wires, lines, strict=True)],
        confidence=[confidence(w, a) for w, a in zip(wires, around, strict=True)],
        time_start_s=[t[0] for t in spans],
        time_end_s=[t[1] for t in spans],
    )


def _vertices(wire: FittedWire, spacing_m: float) -> FloatArray:
    """Return (n, 3) vertices, from west to east (south to north where the wire runs north)."""
    bend = abs(wire.fit.curve.curvature_per_m)
    step = min(spacing_m, math.sqrt(8.0 * CHORD_M / bend)) if bend > 0 else spacing_m
    n = max(math.ceil(wire.length_m / step - 1e-9), 1)
    return wire.at(np.linspace(wire.low_m, wire.high_m, n + 1))


def _sigmas(band: CableBand, wire: FittedWire, line: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return (n,) sigma across in plan and in height. [m].

    Residuals of neighbouring points hang together (one pass, one pose, one side of the wire): the variance
    of their means over two metres, against what independent residuals would leave, scales the covariance.
    """
    xyz = band.xyz[wire.members]
    s, o, dz = wire.residuals(xyz)
    at = wire.plan.stations(line[:, :2])[0]
    n = len(s)
    middle = float(s.mean())
    lever = 1.0 / n + (at - middle) ** 2 / max(float(((s - middle) ** 2).sum()), 1e-9)
    sigma_o = float(np.sqrt((o**2).sum() / max(n - 2, 1)))
    sigma_xy = np.sqrt(lever) * sigma_o * _inflation(s, o)
    sigma_z = wire.fit.height_sigma_at(at) * _inflation(s, dz)
    return np.hypot(sigma_xy, HIDDEN_SIGMA_M), np.hypot(sigma_z, HIDDEN_SIGMA_M)


def _inflation(s: FloatArray, residual: FloatArray) -> float:
    """Return by how much means over two metres scatter more than independent residuals would, 1 to 5."""
    block = np.floor((s - s[0]) / 2.0).astype(np.int64)
    count = np.bincount(block)
    total = np.bincount(block, weights=residual)
    used = count > 0
    variance = float((residual**2).mean())
    if used.sum() < 5 or variance == 0.0:
        return 1.0
    freedom = max(float(used.sum()) - 3.0, 1.0)
    return float(np.clip(math.sqrt((total[used] ** 2 / count[used]).sum() / freedom / variance), 1.0, 5.0))


def _bridged(band: CableBand, wire: FittedWire, line: FloatArray) -> BoolArray:
    s = np.sort(wire.plan.stations(band.xyz[wire.members, :2])[0])
    at = wire.plan.stations(line[:, :2])[0]
    right = np.clip(np.searchsorted(s, at), 0, len(s) - 1)
    left = np.maximum(right - 1, 0)
    nearest = np.minimum(np.abs(s[right] - at), np.abs(s[left] - at))
    usual = float(np.median(np.diff(s))) if len(s) > 1 else 0.0
    bridged: BoolArray = nearest > max(WIRE_BRIDGED_M, USUAL_GAPS * usual)
    return bridged


def _clearance(band: CableBand, wire: FittedWire, line: FloatArray) -> float:
    """Return the smallest height of the wire above the ground under its points [m].

    A median of seven points along the wire takes single cells of the ground model out that hold a vehicle or
    a bush.
    """
    s = wire.plan.stations(band.xyz[wire.members, :2])[0]
    order = np.argsort(s, kind="stable")
    ground = (band.xyz[wire.members, 2] - band.height_m[wire.members])[order]
    at = wire.plan.stations(line[:, :2])[0]
    level = np.interp(at, s[order], median_filter(ground, size=7, mode="nearest"))
    return float((line[:, 2] - level).min())


def _time_span(band: CableBand, wire: FittedWire, time_s: FloatArray | None) -> tuple[float, float]:
    if time_s is None:
        return math.nan, math.nan
    t = time_s[band.index[wire.members]]
    return float(t.min()), float(t.max())


def confidence(wire: FittedWire, around: WireSurroundings) -> float:
    """Return 0 to 1: how sure it is that this is a wire.

    Each factor is near 1 for a wire that is long, often hit, thin and alone, and falls with what the tests
    in `cables` look at.
    """
    long_enough = 1.0 - math.exp(-wire.length_m / 6.0)
    seen = 1.0 - math.exp(-around.n_points / 8.0)
    whole = min(1.0, 0.4 + 0.7 * around.occupied)
    alone = (1.0 - around.ringed) * (1.0 - 0.5 * around.crowded)
    return float(long_enough * seen * whole * alone)
