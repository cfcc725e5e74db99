"""Kernels for grey dilation and peaks of a Radon image, periodic in theta: R(theta + pi, rho) = R(theta, -rho)."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from linework.arrays import AnyArray

#: Relative difference within which values are equal: sums of the same cells in another order differ by 1e-15.
SAME = 1e-9
#: Columns of a peak: theta [rad], rho [m], strength.
PEAK_THETA, PEAK_RHO, PEAK_STRENGTH = 0, 1, 2


@njit(cache=True, nogil=True)
def wrapped_angle(i: int, n: int) -> tuple[int, int]:
    """Wrap the index of an angle into 0 .. n - 1, and return it with the number of half turns taken off."""
    turns = math.floor(i / n)
    return i - turns * n, turns


@njit(cache=True, nogil=True)
def reach(angles: AnyArray, i: int, window: float, sign: int) -> int:
    """Return how many angles lie within `window` of angle `i` on one side (sign +1 or -1), at most n - 1."""
    n = angles.size
    count = 0
    while count < n - 1:
        k, turns = wrapped_angle(i + sign * (count + 1), n)
        if abs(angles[k] + turns * math.pi - angles[i]) > window * (1.0 + 1e-9):
            break
        count += 1
    return count


@njit(cache=True, nogil=True)
def dilate_radon(values: AnyArray, angles: AnyArray, half_window: float, half_bins: int) -> AnyArray:
    """Return the grey dilation of a Radon image by a line element along rho, then by one along theta.

    Parameters
    ----------
    values
        (n_angles, n_bins) Radon image.
    angles
        (n_angles,) rising, within half a turn. [rad]
    half_window, half_bins
        Reach of the elements to either side: along theta [rad], along rho [bins].

    Returns
    -------
    (n_angles, n_bins) dilated image.
    """
    n, m = values.shape
    along_rho = np.empty_like(values)
    for i in range(n):
        for j in range(m):
            top = values[i, j]
            for k in range(max(0, j - half_bins), min(m, j + half_bins + 1)):
                top = max(top, values[i, k])
            along_rho[i, j] = top
    dilated = along_rho.copy()
    for i in range(n):
        for d in range(-reach(angles, i, half_window, -1), reach(angles, i, half_window, 1) + 1):
            k, turns = wrapped_angle(i + d, n)
            if turns % 2 == 0:
                for j in range(m):
                    dilated[i, j] = max(dilated[i, j], along_rho[k, j])
            else:
                for j in range(m):
                    dilated[i, j] = max(dilated[i, j], along_rho[k, m - 1 - j])
    return dilated


@njit(cache=True, nogil=True)
def is_top(values: AnyArray, angles: AnyArray, i: int, j: int, half_window: float, half_bins: int) -> bool:
    """Return whether bin (i, j) equals its dilation: no bin of its window is higher.

    Nearly every bin has a higher neighbour, which ends the search: cheaper than dilating the whole image.
    """
    n, m = values.shape
    value = values[i, j]
    for r in range(max(0, j - half_bins), min(m, j + half_bins + 1)):
        if value < values[i, r] - SAME * abs(values[i, r]):
            return False
    for sign in (1, -1):
        for d in range(1, reach(angles, i, half_window, sign) + 1):
            k, turns = wrapped_angle(i + sign * d, n)
            c = j if turns % 2 == 0 else m - 1 - j
            for r in range(max(0, c - half_bins), min(m, c + half_bins + 1)):
                if value < values[k, r] - SAME * abs(values[k, r]):
                    return False
    return True


@njit(cache=True, nogil=True)
def peaks(
    values: AnyArray, angles: AnyArray, rho: AnyArray, threshold: float, half_window: float, half_bins: int
) -> AnyArray:
    """Return the peaks: bins that equal their dilation and exceed a threshold, (n, 3).

    Columns `PEAK_THETA` in [0, pi) [rad], `PEAK_RHO` [m], `PEAK_STRENGTH`. Peaks that lie in one another's
    window form a plateau and count once, at the bin nearest to its middle; positions are refined below the bin.

    Parameters
    ----------
    values, angles, half_window, half_bins
        See `dilate_radon`.
    rho
        (n_bins,) centres of the bins. [m]
    threshold
        Least strength, exclusive.
    """
    n, m = values.shape
    step = rho[1] - rho[0] if m > 1 else 1.0
    top = np.zeros((n, m), np.bool_)
    n_top = 0
    for i in range(n):
        for j in range(m):
            if values[i, j] > threshold and is_top(values, angles, i, j, half_window, half_bins):
                top[i, j] = True
                n_top += 1
    found = np.empty((n_top, 3), np.float64)
    n_found = 0
    plateau = np.empty(
        (n_top, 2), np.int64
    )  # index of the angle, unwrapped; index of rho on the first bin's side
    for i in range(n):
        for j in range(m):
            if not top[i, j]:
                continue
            size = flood(top, angles, i, j, half_window, half_bins, plateau)
            best = middle(plateau[:size])
            k, turns = wrapped_angle(plateau[best, 0], n)
            c = plateau[best, 1] if turns % 2 == 0 else m - 1 - plateau[best, 1]
            d_theta, d_rho = refine(values, angles, step, k, c)
            theta, offset = angles[k] + d_theta, rho[c] + d_rho
            if theta < 0.0:
                theta, offset = theta + math.pi, -offset
            if theta >= math.pi:
                theta, offset = theta - math.pi, -offset
            found[n_found, PEAK_THETA], found[n_found, PEAK_RHO] = theta, offset
            found[n_found, PEAK_STRENGTH] = values[k, c]
            n_found += 1
    return found[:n_found].copy()


@njit(cache=True, nogil=True)
def flood(
    top: AnyArray, angles: AnyArray, i: int, j: int, half_window: float, half_bins: int, plateau: AnyArray
) -> int:
    """Collect the plateau that contains bin (i, j), erase it from `top`, and return its size.

    `plateau` (n, 2) int64 is written: index of the angle, unwrapped, and of rho.
    """
    n, m = top.shape
    top[i, j] = False
    plateau[0, 0], plateau[0, 1] = i, j
    size, done = 1, 0
    while done < size:
        at, rho = plateau[done, 0], plateau[done, 1]
        done += 1
        home, _ = wrapped_angle(at, n)
        for d in range(-reach(angles, home, half_window, -1), reach(angles, home, half_window, 1) + 1):
            k, turns = wrapped_angle(at + d, n)
            for r in range(max(0, rho - half_bins), min(m, rho + half_bins + 1)):
                c = r if turns % 2 == 0 else m - 1 - r
                if top[k, c]:
                    top[k, c] = False
                    plateau[size, 0], plateau[size, 1] = at + d, r
                    size += 1
    return size


@njit(cache=True, nogil=True)
def middle(plateau: AnyArray) -> int:
    """Return the row of a plateau (n, 2) that is nearest to its mean, the first of equals."""
    mean_i, mean_j = plateau[:, 0].mean(), plateau[:, 1].mean()
    best, least = 0, np.inf
    for k in range(plateau.shape[0]):
        d = (plateau[k, 0] - mean_i) ** 2 + (plateau[k, 1] - mean_j) ** 2
        if d < least - 1e-9:
            best, least = k, d
    return best


@njit(cache=True, nogil=True)
def refine(values: AnyArray, angles: AnyArray, step: float, i: int, j: int) -> tuple[float, float]:
    """Return the offset [rad, m] from a peak to the top of the paraboloid through it and its 8 neighbours.

    A line whose middle is off the centre makes an oblique ridge, so theta and rho are solved together. Where
    the nine values are not a hill each is solved alone, within half a bin; (0, 0) where a neighbour is missing.
    """
    n, m = values.shape
    below_i, below_turns = wrapped_angle(i - 1, n)
    above_i, above_turns = wrapped_angle(i + 1, n)
    g = angles[i] - angles[below_i] - below_turns * math.pi
    h = angles[above_i] + above_turns * math.pi - angles[i]
    if j == 0 or j == m - 1 or n < 3 or max(g, h) > 2.0 * min(g, h):
        return 0.0, 0.0
    f = np.empty((3, 3))
    for c in range(3):
        r = j - 1 + c
        f[0, c] = values[below_i, r if below_turns % 2 == 0 else m - 1 - r]
        f[1, c] = values[i, r]
        f[2, c] = values[above_i, r if above_turns % 2 == 0 else m - 1 - r]
    slope_t = (g * g * (f[2, 1] - f[1, 1]) + h * h * (f[1, 1] - f[0, 1])) / (g * h * (g + h))
    bend_t = 2.0 * (g * (f[2, 1] - f[1, 1]) - h * (f[1, 1] - f[0, 1])) / (g * h * (g + h))
    slope_r = (f[1, 2] - f[1, 0]) / (2.0 * step)
    bend_r = (f[1, 2] - 2.0 * f[1, 1] + f[1, 0]) / (step * step)
    twist = (f[2, 2] - f[2, 0] - f[0, 2] + f[0, 0]) / (2.0 * step * (g + h))
    det = bend_t * bend_r - twist * twist
    if bend_t < 0.0 and bend_r < 0.0 and det > 0.0:
        theta = (twist * slope_r - bend_r * slope_t) / det
        rho = (twist * slope_t - bend_t * slope_r) / det
        if -g <= theta <= h and abs(rho) <= step:
            return theta, rho
    theta = -slope_t / bend_t if bend_t < 0.0 else 0.0
    rho = -slope_r / bend_r if bend_r < 0.0 else 0.0
    return min(max(theta, -0.5 * g), 0.5 * h), min(max(rho, -0.5 * step), 0.5 * step)
