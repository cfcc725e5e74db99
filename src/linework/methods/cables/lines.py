"""Lines from wires: vertices, sigmas, bridged stretches, clearance and confidence.

Separate from `find`, which decides what is a wire: this measures the vertices and attributes of those that are.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.ndimage import median_filter

from linework.arrays import BoolArray, FloatArray
from linework.methods.cables.band import CableBand
from linework.methods.cables.fit import FittedWire, WireSurroundings
from linework.model.ground import Ground
from linework.model.lines import LineSet

#: Largest distance of a chord from the catenary, k d^2 / 8: 6 mm at 1 m and 0.05 per m, 0.6 mm on a usual wire. [m]
CHORD_M = 0.005
#: Distance along to the nearest point from which a wire is bridged: at least this [m],
WIRE_BRIDGED_M = 1.0
#: and at least this many times its usual distance between points.
USUAL_GAPS = 3.0
#: Error that no fit shows: points lie on the side of the wire that faces the scanner, a radius of 4 to 12 mm off its
#: axis, partly sideways and partly down; and the pose of a pass is off by a few millimetres. [m]
HIDDEN_SIGMA_M = 0.005
#: Length of the blocks whose means show the correlation of neighbouring points. [m]
_BLOCK_M = 2.0
#: Fewest blocks that show it, and the largest factor that it inflates a sigma by.
_LEAST_BLOCKS, _MOST_INFLATION = 5, 5.0
#: Points of the median of the ground below a wire: drops single cells with a vehicle or a bush.
_GROUND_MEDIAN = 7
#: Least share of a wire's vertices over known ground for its clearance to be known: the lowest place is in mid-span.
_KNOWN_SHARE = 0.5
#: Scales of the confidence: length [m] at which a factor is 1 - 1/e, and number of crossings: the five unknowns of a
#: catenary and a line.
_SURE_LENGTH_M, _SURE_POINTS = 6.0, 5.0
#: Confidence of a wire without occupied metres, its increase with their share, and weight of crowded metres.
_EMPTY, _PER_OCCUPIED, _CROWDED_WEIGHT = 0.4, 0.7, 0.5


def lines_of_wires(
    band: CableBand,
    wires: list[FittedWire],
    sure: list[float],
    time_s: FloatArray | None,
    spacing_m: float,
) -> LineSet:
    """Return one line per wire, in the order of their western ends.

    Parameters
    ----------
    sure
        Confidence of each wire.
    time_s
        (n,) times of the points of the tile [s], or None.
    spacing_m
        Distance of the vertices, less where the wire bends so much that a chord is 5 mm off. [m]
    """
    lines = [_vertices(w, spacing_m) for w in wires]
    order = sorted(range(len(wires)), key=lambda i: tuple(lines[i][0].round(3)))
    wires, lines, sure = [wires[i] for i in order], [lines[i] for i in order], [sure[i] for i in order]
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
        confidence=sure,
        time_start_s=[t[0] for t in spans],
        time_end_s=[t[1] for t in spans],
    )


def _vertices(wire: FittedWire, spacing_m: float) -> FloatArray:
    """Return the vertices (n, 3) [m], from west to east (south to north where the wire runs north)."""
    bend = abs(wire.fit.curve.curvature_per_m)
    step = min(spacing_m, math.sqrt(8.0 * CHORD_M / bend)) if bend > 0 else spacing_m
    n = max(math.ceil(wire.length_m / step - 1e-9), 1)
    return wire.at(np.linspace(wire.low_m, wire.high_m, n + 1))


def _sigmas(band: CableBand, wire: FittedWire, line: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the sigmas of vertices (n, 3) across in plan and in height, (n,) each [m].

    Residuals of neighbouring points are correlated (one pass, one pose, one side of the wire): the variance of their
    means over two metres, against that of independent residuals, scales the covariance.
    """
    xyz = band.xyz[wire.members]
    s, o, dz = wire.residuals(xyz)
    at = wire.plan.stations(line[:, :2])[0]
    # A line in plan, or a parabola where wind has bent it
    n_unknowns = 3 if wire.plan.bow_per_m else 2
    scale = max(float(np.abs(s).max()), 1.0)
    powers = np.vander(s / scale, n_unknowns, increasing=True)
    cofactor = np.linalg.inv(powers.T @ powers + 1e-9 * np.eye(n_unknowns))
    here = np.vander(at / scale, n_unknowns, increasing=True)
    lever = np.einsum("ni,ij,nj->n", here, cofactor, here)
    sigma_o = float(np.sqrt((o**2).sum() / max(len(s) - n_unknowns, 1)))
    sigma_xy = np.sqrt(lever) * sigma_o * _inflation(s, o)
    sigma_z = wire.fit.height_sigma_at(at) * _inflation(s, dz)
    return np.hypot(sigma_xy, HIDDEN_SIGMA_M), np.hypot(sigma_z, HIDDEN_SIGMA_M)


def _inflation(s: FloatArray, residual: FloatArray) -> float:
    """Return the ratio of the scatter of means over two metres to that of independent residuals (n,), 1 to 5."""
    block = np.floor((s - s[0]) / _BLOCK_M).astype(np.int64)
    count = np.bincount(block)
    total = np.bincount(block, weights=residual)
    used = count > 0
    variance = float((residual**2).mean())
    if used.sum() < _LEAST_BLOCKS or variance == 0.0:
        return 1.0
    freedom = max(float(used.sum()) - 3.0, 1.0)
    return float(
        np.clip(math.sqrt((total[used] ** 2 / count[used]).sum() / freedom / variance), 1.0, _MOST_INFLATION)
    )


def _bridged(band: CableBand, wire: FittedWire, line: FloatArray) -> BoolArray:
    """Return which vertices (n, 3) are far from the points of the wire, (n,) bool."""
    s = np.sort(wire.plan.stations(band.xyz[wire.members, :2])[0])
    at = wire.plan.stations(line[:, :2])[0]
    right = np.clip(np.searchsorted(s, at), 0, len(s) - 1)
    left = np.maximum(right - 1, 0)
    nearest = np.minimum(np.abs(s[right] - at), np.abs(s[left] - at))
    usual = float(np.median(np.diff(s))) if len(s) > 1 else 0.0
    bridged: BoolArray = nearest > max(WIRE_BRIDGED_M, USUAL_GAPS * usual)
    return bridged


def _clearance(band: CableBand, wire: FittedWire, line: FloatArray) -> float:
    """Return the least height of the wire above the ground below its points [m].

    A median of seven points along the wire drops single cells of the ground with a vehicle or a bush.
    """
    s = wire.plan.stations(band.xyz[wire.members, :2])[0]
    order = np.argsort(s, kind="stable")
    ground = (band.xyz[wire.members, 2] - band.height_m[wire.members])[order]
    at = wire.plan.stations(line[:, :2])[0]
    level = np.interp(at, s[order], median_filter(ground, size=_GROUND_MEDIAN, mode="nearest"))
    return float((line[:, 2] - level).min())


def with_known_clearance(lines: LineSet, surface: Ground) -> LineSet:
    """Return wires without the clearance of those of which less than half hangs over ground that is known.

    Where the ground is only extended from elsewhere, a height above it is no clearance.
    """
    if not len(lines):
        return lines
    rows, cols = (np.floor(at).astype(np.int64) for at in surface.grid.to_cell(lines.xyz[:, :2]))
    inside = (rows >= 0) & (rows < surface.grid.n_rows) & (cols >= 0) & (cols < surface.grid.n_cols)
    known = np.zeros(len(lines.xyz), dtype=np.float64)
    known[inside] = surface.is_known[rows[inside], cols[inside]]
    share = np.add.reduceat(known, lines.offsets[:-1]) / np.diff(lines.offsets)
    return lines.with_columns(clearance_m=np.where(share >= _KNOWN_SHARE, lines.clearance_m, np.nan))


def _time_span(band: CableBand, wire: FittedWire, time_s: FloatArray | None) -> tuple[float, float]:
    if time_s is None:
        return math.nan, math.nan
    t = time_s[band.index[wire.members]]
    return float(t.min()), float(t.max())


def confidence(wire: FittedWire, around: WireSurroundings, crossings: float | None = None) -> float:
    """Return the confidence, 0 to 1, that this is a wire.

    `crossings` is the effective number of scan lines that drew it, None where points do not tell: then each point counts
    as one. Each factor is near 1 for a wire that is long, densely hit, thin and isolated. Its constants were chosen by hand;
    the surveys they were tuned on are not recorded.
    """
    long_enough = 1.0 - math.exp(-wire.length_m / _SURE_LENGTH_M)
    n_seen = around.n_points if crossings is None else min(crossings, around.n_points)
    seen = 1.0 - math.exp(-n_seen / _SURE_POINTS)
    whole = min(1.0, _EMPTY + _PER_OCCUPIED * around.occupied)
    alone = (1.0 - around.ringed) * (1.0 - _CROWDED_WEIGHT * around.crowded)
    return float(long_enough * seen * whole * alone)
