"""The pattern of points without times: direction of the scan lines and both spacings, from their spectrum.

Points along a line follow each other by one spacing, and lines by another. Lines that are evenly apart give the power
spectrum of the points a peak across them, wherever the points are along each line; so does not, with other spacings,
what the points lie on. Nearest neighbours show directions only where the two spacings differ much.

References
----------
Bartlett, M. S. (1964): The spectral analysis of two-dimensional point processes. Biometrika 51(3/4), 299-311.
doi:10.1093/biomet/51.3-4.299
"""

from __future__ import annotations

import numpy as np

from linework.arrays import Float32Array, FloatArray, IntArray

#: Cells of a block, each way, and cells per mean spacing: frequencies up to 1.25 per mean spacing, in a block of 26
#: spacings, 650 points.
_CELLS, _FINE = 64, 2.5
#: Cells of the parts of a block, each way, that count as covered if a point is there: of 3 spacings, 10 points.
_PART = 8
#: Blocks around a block whose spectra are averaged: a strip keeps its direction over 100 m and more.
_AROUND = 2
#: Peaks are looked for from this frequency on, in cycles per mean spacing: below it are shapes of roads and houses.
_LOWEST = 0.35
#: Fewest points of a block that counts: noise has the same power in blocks of all sizes, patterns have less in few points.
_LEAST = 60
#: Farthest that peaks of two halves of the blocks lie apart: noise moves a peak by less than its width, two cycles of a
#: tapered block. [cycles per block]
_AGREE = 2.0
#: One pattern in 1,000 looked at may come of points without any.
_FALSE = 1e-3


def mean_spacing_m(xyz: FloatArray) -> float:
    """Return the mean spacing of points in plan where there are some [m]: 1 / sqrt(density), 1 for fewer than two."""
    if len(xyz) < 2:
        return 1.0
    size = np.ptp(xyz[:, :2], axis=0)
    cell = max(4.0 * float(np.sqrt(max(size[0] * size[1], 1e-6) / len(xyz))), 1e-3)
    # Twice: much of the extent may be empty
    for _ in range(2):
        place = np.floor(xyz[:, :2] / cell).astype(np.int64)
        _, count = np.unique(place[:, 0] * 2**31 + place[:, 1], return_counts=True)
        # The density around the median point, not that of the median cell
        order = np.sort(count)
        typical = order[np.searchsorted(np.cumsum(order), 0.5 * len(xyz))]
        spacing = cell / float(np.sqrt(typical))
        cell = 4.0 * spacing
    return spacing


def spacing_pattern(xyz: FloatArray, mean_m: float) -> tuple[Float32Array, Float32Array, Float32Array]:
    """Return direction (n, 2), spacing along and spacing across the lines [m] of the pattern around each point.

    The direction is a unit vector in plan, of either sign; NaN where the points show none: then both spacings are the
    mean spacing of the block.

    Parameters
    ----------
    xyz
        (n, 3) float64 [m].
    mean_m
        Mean spacing, from `mean_spacing_m` of the whole survey. [m]

    Notes
    -----
    What is within three blocks of 26 mean spacings decides.
    """
    n = len(xyz)
    direction = np.full((n, 2), np.nan, dtype=np.float32)
    along, across = np.full(n, mean_m, dtype=np.float32), np.full(n, mean_m, dtype=np.float32)
    # A whole number of centimetres, or of millimetres: files round coordinates to these, and other cells would hold now
    # one more of the rounded values, now one less, which is a pattern too
    grain = 0.01 if mean_m / _FINE > 0.03 else 0.001
    cell = max(round(mean_m / _FINE / grain), 1) * grain
    place = np.floor(xyz[:, :2] / cell + 0.01).astype(np.int64)
    blocks, of_block = np.unique(place // _CELLS, axis=0, return_inverse=True)
    of_block = of_block.reshape(-1)
    count = np.bincount(of_block, minlength=len(blocks))
    spectra = _spectra(place, of_block, len(blocks), count)
    area = _area_of(place, cell)
    index = {(int(i), int(j)): k for k, (i, j) in enumerate(blocks)}
    found = np.full((len(blocks), 4), np.nan)
    for k, (i, j) in enumerate(blocks):
        around = [
            (a, b)
            for a in range(i - _AROUND, i + _AROUND + 1)
            for b in range(j - _AROUND, j + _AROUND + 1)
            if (a, b) in index and count[index[a, b]] >= _LEAST
        ]
        # Black and white fields of a chessboard
        near = [[index[a, b] for a, b in around if (a + b) % 2 == colour] for colour in (0, 1)]
        if near[0] and near[1]:
            found[k, :3] = _lines_of([spectra[half].mean(axis=0) for half in near], len(around), cell)
            # One point for each spacing along times spacing across
            both = near[0] + near[1]
            found[k, 3] = area[both].sum() / count[both].sum() / found[k, 2]
    own = found[of_block]
    has = np.isfinite(own[:, 0])
    direction[has] = own[has, :2]
    across[has] = own[has, 2]
    along[has] = own[has, 3]
    return direction, along, across


def _spectra(place: IntArray, of_block: IntArray, n_blocks: int, count: IntArray) -> Float32Array:
    """Return the power spectrum of each block in units of that of random points, (b, cells, cells / 2 + 1) float32."""
    spectra = np.zeros((n_blocks, _CELLS, _CELLS // 2 + 1), dtype=np.float32)
    taper = np.hanning(_CELLS + 2)[1:-1]
    window = np.outer(taper, taper)
    inside = place % _CELLS
    flat = inside[:, 0] * _CELLS + inside[:, 1]
    order = np.argsort(of_block, kind="stable")
    start = np.searchsorted(of_block[order], np.arange(n_blocks + 1))
    for k in range(n_blocks):
        if count[k] < _LEAST:
            continue
        image = np.bincount(flat[order[start[k] : start[k + 1]]], minlength=_CELLS**2).reshape(_CELLS, _CELLS)
        # Less the mean, where there are points: the spectrum of the window stays out
        noise = float(np.sum(image * window**2))
        power = np.abs(np.fft.rfft2((image - image.mean()) * window)) ** 2
        spectra[k] = power / max(noise, 1e-9)
    return spectra


def _lines_of(halves: list[Float32Array], n_blocks: int, cell: float) -> tuple[float, float, float]:
    """Return the direction of the lines (x, y) and their distance [m]; NaN: no pattern.

    The two halves of the blocks must agree: what stands out by chance, or by one object, does so in one of them.
    """
    none = (np.nan, np.nan, np.nan)
    power = 0.5 * (halves[0] + halves[1])
    fx = np.fft.fftfreq(_CELLS)[:, None] * _FINE
    fy = np.fft.rfftfreq(_CELLS)[None, :] * _FINE
    radius = np.hypot(fx, fy)
    allowed = (radius >= _LOWEST) & (radius <= 0.48 * _FINE)
    # Half of the frequencies at fy = 0 repeat the others
    trials = int(np.count_nonzero(allowed))
    limit = _highest_of_noise(n_blocks, trials)
    level = float(np.median(power[allowed])) / _median_of_noise(n_blocks)
    best = np.where(allowed, power, 0.0)
    u, v = np.unravel_index(int(np.argmax(best)), best.shape)
    if best[u, v] < limit * max(level, 1.0):
        return none
    kx, ky = _peak(power, int(u), int(v))
    for half in halves:
        own = np.where(allowed, half, 0.0)
        a, b = np.unravel_index(int(np.argmax(own)), own.shape)
        x, y = _peak(own, int(a), int(b))
        if min(np.hypot(x - kx, y - ky), np.hypot(x + kx, y + ky)) > _AGREE:
            return none
    k = float(np.hypot(kx, ky))
    return -ky / k, kx / k, _CELLS * cell / k


def _peak(power: Float32Array, u: int, v: int) -> tuple[float, float]:
    """Return the place of a peak in the spectrum by parabolas through its logarithm, in cycles per block."""

    def at(i: int, j: int) -> float:
        # Frequencies of the other half are those of this one, mirrored
        i, j = i % _CELLS, j % _CELLS
        if j > _CELLS // 2:
            i, j = -i % _CELLS, _CELLS - j
        return float(np.log(power[i, j] + 1e-12))

    def shift(low: float, mid: float, high: float) -> float:
        bend = low - 2.0 * mid + high
        return float(np.clip(0.5 * (low - high) / bend, -0.5, 0.5)) if bend < 0.0 else 0.0

    du = shift(at(u - 1, v), at(u, v), at(u + 1, v))
    dv = shift(at(u, v - 1), at(u, v), at(u, v + 1))
    signed = u if u < _CELLS // 2 else u - _CELLS
    return signed + du, v + dv


def _area_of(place: IntArray, cell: float) -> FloatArray:
    """Return the area that the points of each block cover, (b,) float64 [m2]."""
    parts = np.unique(place // _PART, axis=0)
    blocks, index = np.unique(parts // (_CELLS // _PART), axis=0, return_inverse=True)
    return np.asarray(
        np.bincount(index.reshape(-1), minlength=len(blocks)) * (_PART * cell) ** 2, dtype=np.float64
    )


def _highest_of_noise(n: int, trials: int) -> float:
    """Return what the mean of n powers of noise does not reach in any of the trials (Wilson and Hilferty 1931)."""
    z = np.sqrt(2.0 * np.log(trials / _FALSE))
    return float(max((1.0 - 1.0 / (9.0 * n) + z / (3.0 * np.sqrt(n))) ** 3, np.log(trials / _FALSE) / n))


def _median_of_noise(n: int) -> float:
    """Return the median of the mean of n powers of noise, whose mean is 1."""
    return float((1.0 - 1.0 / (9.0 * n)) ** 3)
