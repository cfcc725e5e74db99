"""Where the drive starts and how it heads: the way of dead reckoning laid onto the first fixes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from linework.arrays import FloatArray

#: First way that is laid onto the fixes: so many sigmas of theirs, and no less than a street corner. [m]
_LEAST_SIGMAS, _LEAST_M = 20.0, 15.0


@dataclass(frozen=True, slots=True)
class Fit:
    """A way laid onto fixes: position and heading at its origin, how much longer it is, what is left.

    Parameters
    ----------
    residual_m
        (n,) distances of the fixes.
    """

    east_m: float
    north_m: float
    heading_rad: float
    scale: float
    residual_m: FloatArray


def laid_onto(way_xy: FloatArray, fixes_xy: FloatArray, *, robust: bool = True) -> Fit:
    """Turn, shift and scale (n, 2) places of a way onto (n, 2) fixes, least squares.

    With complex numbers: ``fix = origin + scale e^(-i heading) way``; fixes far from all others count less.
    """
    way, fix = way_xy @ np.array([1.0, 1.0j]), fixes_xy @ np.array([1.0, 1.0j])
    weight = np.ones(len(way))
    for _ in range(8 if robust else 1):
        weight /= weight.sum()
        way_mean, fix_mean = weight @ way, weight @ fix
        centred = way - way_mean
        turn = np.sum(weight * centred.conj() * (fix - fix_mean)) / np.sum(weight * np.abs(centred) ** 2)
        residual = np.abs(fix - fix_mean - turn * centred)
        level = np.median(residual) + 1e-3
        weight = 1.0 / (1.0 + (residual / (2.0 * level)) ** 2)
    origin = fix_mean - turn * way_mean
    return Fit(float(origin.real), float(origin.imag), float(-np.angle(turn)), float(np.abs(turn)), residual)


def first_heading(way_xy: FloatArray, fixes_xy: FloatArray, sigma_m: FloatArray) -> Fit | None:
    """Return the first way's fit, from as many fixes as its length needs; None where the van never moves."""
    far = np.maximum.accumulate(np.hypot(*(way_xy - way_xy[0]).T))
    needed = np.maximum(_LEAST_SIGMAS * np.median(sigma_m), _LEAST_M)
    enough = np.flatnonzero(far >= needed)
    n = min(max(int(enough[0]) + 1, 4), len(way_xy)) if len(enough) else len(way_xy)
    if n < 3 or far[n - 1] < 3.0 * np.median(sigma_m) or far[n - 1] < 1.0:
        return None
    return laid_onto(way_xy[:n], fixes_xy[:n])
