"""Peaks of the Radon transforms of many small windows, one after the other."""

from __future__ import annotations

import numpy as np
from numba import njit

from linework.arrays import FloatArray, IntArray
from linework.kernels.radon import radon
from linework.kernels.radon_peaks import peaks


@njit(cache=True, nogil=True)
def peaks_of_windows(
    cells: FloatArray,
    starts: IntArray,
    windows: tuple[IntArray, FloatArray],
    frame: tuple[tuple[float, float, float], float],
    angles: FloatArray,
    rho: FloatArray,
    limits: tuple[float, float, int],
    fewest: float,
) -> FloatArray:
    """Return (n, 4) window, theta, rho and strength of the peaks of each window's Radon transform.

    Parameters
    ----------
    cells
        (n, 2): centres of occupied cells by quarter; quarter i has those from starts[i] to starts[i + 1].
    windows
        (m, 4) the quarters of each window, -1 where one is empty, and (m, 2) its centre.
    frame
        Cells, and the strips' step; see `linework.kernels.radon.radon`.
    rho
        Centres of the strips, an odd number.
    limits
        Threshold and half windows; see `linework.kernels.radon_peaks.peaks`.
    fewest
        Windows with fewer occupied cells are passed over.
    """
    quarters, centres = windows
    cell, step = frame
    threshold, half_window, half_bins = limits
    n_most = 0
    for i in range(len(starts) - 1):
        n_most = max(n_most, starts[i + 1] - starts[i])
    x, y, ones = np.empty(4 * n_most), np.empty(4 * n_most), np.ones(4 * n_most)
    out, n_out = np.empty((256, 4)), 0
    for w in range(len(quarters)):
        n = 0
        for q in quarters[w]:
            if q < 0:
                continue
            for k in range(starts[q], starts[q + 1]):
                x[n], y[n] = cells[k, 0] - centres[w, 0], cells[k, 1] - centres[w, 1]
                n += 1
        if n < fewest:
            continue
        values = radon(x[:n], y[:n], ones[:n], cell, angles, step, len(rho) // 2)
        found = peaks(values, angles, rho, threshold, half_window, half_bins)
        if n_out + len(found) > len(out):
            out = np.concatenate((out, np.empty((len(out) + len(found), 4))))
        for k in range(len(found)):
            out[n_out, 0] = w
            out[n_out, 1:] = found[k]
            n_out += 1
    return out[:n_out].copy()
