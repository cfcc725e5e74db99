"""Grain of simulated surfaces: noise in octaves, low-pass filtered by the extent of a pixel on the surface."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from linework.arrays import FloatArray


@njit(cache=True, nogil=True)
def grain(
    x: FloatArray,
    y: FloatArray,
    wide_x: FloatArray,
    wide_y: FloatArray,
    finest: FloatArray,
    growth: FloatArray,
    n_octaves: int,
    seed: int,
) -> FloatArray:
    """Return (n,) noise of about -1 to 1: octaves of wavelength `finest` times 1, 2, 4 and so on.

    Parameters
    ----------
    x, y
        (n,) places on the surface. [m]
    wide_x, wide_y
        (n,) extent of a pixel there. [m]
    finest
        (n,) wavelength of the first octave. [m]
    growth
        (n,) amplitude of an octave over that of the next finer one.
    n_octaves
        Number of octaves.
    seed
        0 or more.

    Notes
    -----
    A pixel averages out what is finer than itself: an octave fades in between 0.6 and 1.5 pixels of wavelength. Where
    the pixel is longer than wide, the cells of the noise are stretched in the same ratio (between two powers of 2,
    mixed by variance) and their amplitude falls as that of a mean over as many cells.
    """
    out = np.empty(len(x))
    for i in range(len(x)):
        narrow = max(min(wide_x[i], wide_y[i]), 1e-6)
        octave = math.log2(max(max(wide_x[i], wide_y[i]) / narrow, 1.0))
        level = math.floor(octave)
        over = octave - level
        total, strength, cell = 0.0, 1.0, finest[i]
        for k in range(n_octaves):
            shown = min(max((cell / narrow - 0.6) / 0.9, 0.0), 1.0)
            if shown > 0.0:
                value = 0.0
                for j in range(2):
                    share = math.sqrt(over if j == 1 else 1.0 - over)
                    if share < 1e-3:
                        continue
                    stretch = 2.0 ** (level + j)
                    along_x = stretch if wide_x[i] > wide_y[i] else 1.0
                    along_y = stretch if wide_x[i] <= wide_y[i] else 1.0
                    noise = _smooth(x[i] / (cell * along_x), y[i] / (cell * along_y), seed + 31 * k + 7 * j)
                    value += share * noise / math.sqrt(stretch)
                total += shown * strength * value
            strength *= growth[i]
            cell *= 2.0
        out[i] = total
    return out


@njit(cache=True, nogil=True)
def _smooth(x: float, y: float, seed: int) -> float:
    """Return value noise of -1 to 1: smoothstep interpolation between hashed lattice points."""
    i, j = math.floor(x), math.floor(y)
    u, v = x - i, y - j
    u, v = u * u * (3.0 - 2.0 * u), v * v * (3.0 - 2.0 * v)
    a, b = int(i), int(j)
    low = _hashed(a, b, seed) * (1.0 - v) + _hashed(a, b + 1, seed) * v
    high = _hashed(a + 1, b, seed) * (1.0 - v) + _hashed(a + 1, b + 1, seed) * v
    return 2.0 * (low * (1.0 - u) + high * u) - 1.0


@njit(cache=True, nogil=True)
def _hashed(i: int, j: int, seed: int) -> float:
    """Return a hash of a lattice point in [0, 1), with the finalising steps of splitmix64."""
    h = np.uint64(i) * np.uint64(0x9E3779B97F4A7C15)
    h ^= np.uint64(j) * np.uint64(0xC2B2AE3D27D4EB4F)
    h ^= np.uint64(seed) * np.uint64(0x165667B19E3779F9)
    h = (h ^ (h >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    h = (h ^ (h >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    h ^= h >> np.uint64(31)
    return np.float64(h >> np.uint64(11)) / 9007199254740992.0
