"""Slopes of the surface, and which cells are smooth."""

from __future__ import annotations

from functools import cache

import numpy as np

from linework.arrays import AnyArray, BoolArray, Float32Array
from linework.kernels import surface as kernels
from linework.surface.config import RoadConfig

#: Slopes are medians over so many cells on every side: 25 cells outvote a kerb.
REACH = 2
#: They need heights from so many cells on every side.
HALO = REACH + 1


def smooth_slopes(
    height: Float32Array, spread: Float32Array, limit_m: float, config: RoadConfig
) -> tuple[BoolArray, Float32Array, Float32Array]:
    """Return which cells are smooth and not steep, and the slopes east and north of those. [m/m]

    Parameters
    ----------
    height
        (n_rows + 2 `HALO`, n_cols + 2 `HALO`): the cells and those around them.
    spread
        (n_rows, n_cols).
    limit_m
        Cells of more spread are rough.
    """  # noqa: D400
    smooth = np.asarray(spread <= np.float32(limit_m))  # NaN: no
    network = middle_network((2 * REACH + 1) ** 2)
    east, north = kernels.median_slopes(height, smooth, config.cell_m, REACH, network)
    smooth &= east * east + north * north <= np.float32(config.max_grade**2)
    return smooth, east, north


@cache
def middle_network(n: int) -> AnyArray:
    """Return the (k, 2) int32 comparisons that bring the two values below and at the middle to their places.

    Comparison (a, b) puts the smaller of two values at a. Odd-even merge sort (Batcher 1968,
    doi:10.1145/1468075.1468121) without the comparisons that the middle does not need.

    >>> import itertools
    >>> all(_applied([*v])[2] == sorted(v)[2] for v in itertools.permutations(range(5)))
    True
    """
    pairs = []
    p = 1
    while p < n:
        k = p
        while k >= 1:
            for j in range(k % p, n - k, 2 * k):
                lower = range(j, min(j + k, n - k))
                pairs += [(i, i + k) for i in lower if i // (2 * p) == (i + k) // (2 * p)]
            k //= 2
        p *= 2
    needed, kept = {n // 2 - 1, n // 2}, []
    for a, b in reversed(pairs):
        if a in needed or b in needed:
            needed |= {a, b}
            kept.append((a, b))
    return np.array(kept[::-1], dtype=np.int32).reshape(-1, 2)


def _applied(values: list[int]) -> list[int]:
    for a, b in middle_network(len(values)).tolist():
        values[a], values[b] = sorted((values[a], values[b]))
    return values
