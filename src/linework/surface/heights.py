"""Heights of cells: lowest supported height, mean and spread of the layer above it, slopes, smooth cells."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from itertools import pairwise

import numpy as np

from linework.arrays import AnyArray, BoolArray, Float32Array, FloatArray, IntArray, offsets_of
from linework.kernels.cells import surface as kernels
from linework.surface.cells import CellWindow, drops_of_cells
from linework.surface.config import RoadConfig

#: Local height origins are whole multiples of this, so that float32 resolves 0.01 mm. [m]
HEIGHT_ORIGIN_M = 100.0
#: Points below the ground (reflected twice, or of a receiver that saturates) are few and scattered: a layer of them has
#: not a twentieth of the points of the densest one of its cell. Ground that is seen through leaves has, because leaves are
#: at all heights. With fewer points than this in the densest layer nothing is said. [ratio], [points]
_STRAY_SHARE, _LEAST_DENSEST = 0.05, 20
#: Bin of the histogram of spreads [m], far below what distinguishes asphalt from grass; and number of bins: a layer of
#: at most 1 m spreads at most half of that.
_SPREAD_STEP_M, _N_SPREADS = 0.001, 501


@dataclass(frozen=True, slots=True)
class CellHeights:
    """Heights of the cells of a window.

    Parameters
    ----------
    window
        The cells.
    height, spread
        (n_rows, n_cols) float32 mean [m, above the local height origin] and standard deviation [m] of the lowest layer;
        NaN in empty cells.
    count
        (n_rows, n_cols) int32 points.
    """

    window: CellWindow
    height: Float32Array
    spread: Float32Array
    count: AnyArray


def cell_heights(xyz: FloatArray, window: CellWindow, z0_m: float, config: RoadConfig) -> CellHeights:
    """Return the heights of the cells of a window.

    Parameters
    ----------
    xyz
        (n, 3) points, in any order; those outside the window are left out. [m, world]
    z0_m
        Local height origin. [m, world]
    """
    xyz = np.ascontiguousarray(xyz, dtype=np.float64)
    cells, z, low, count = kernels.lowest_supported(xyz, *window, config.cell_m, z0_m, config.support_m)
    height, spread, number = kernels.lowest_layer(cells, z, low, config.layer_m)
    low, n_changed = kernels.above_strays(
        cells, z, low, count, number, config.layer_m, _LEAST_DENSEST, _STRAY_SHARE
    )
    if n_changed:
        height, spread, _ = kernels.lowest_layer(cells, z, low, config.layer_m)
    return CellHeights(window, height, spread, count)


def height_origin(z_m: FloatArray) -> float:
    """Return the local height origin for heights (n,): near their median, so that float32 resolves 0.01 mm.

    >>> height_origin(np.array([310.0, 320.0, 9999.0]))
    300.0
    """
    return math.floor(float(np.median(z_m)) / HEIGHT_ORIGIN_M) * HEIGHT_ORIGIN_M


def count_spreads(spread: Float32Array) -> IntArray:
    """Return the histogram of spreads (rows, cols) [m] in steps of 1 mm, (501,) int64; histograms of tiles add up."""
    return np.asarray(kernels.count_in_steps(spread, _SPREAD_STEP_M, _N_SPREADS))


@dataclass(frozen=True, slots=True)
class SpreadsUnder:
    """Spreads of the cells under the path, by blocks of 64 m; those of tiles add up.

    Parameters
    ----------
    blocks
        (k, 2) int64 numbers of the blocks east and north.
    counts
        (k, 501) int64: histogram of each, as `count_spreads` counts.
    """

    blocks: IntArray
    counts: IntArray

    @classmethod
    def of(cls, path: FloatArray, heights: CellHeights, z0_m: float, cell_m: float) -> SpreadsUnder:
        """Return the spreads of the cells of a window under samples of a path (n, 3) [m, world]."""
        window = heights.window
        has = np.isfinite(heights.height)
        cells, _ = drops_of_cells(path, window, heights.height, has, z0_m, cell_m)
        rows, cols = window.blocks(cell_m)
        r, c = np.divmod(cells, window.n_cols)
        each = np.stack([cols[c], rows[r]], axis=-1)
        blocks, at, n = np.unique(each, axis=0, return_inverse=True, return_counts=True)
        spreads = heights.spread.ravel()[cells][np.argsort(at.ravel(), kind="stable")]
        of_blocks = [count_spreads(spreads[None, a:b]) for a, b in pairwise(offsets_of(n).tolist())]
        return cls(blocks.reshape(-1, 2), np.array(of_blocks, dtype=np.int64).reshape(-1, _N_SPREADS))

    @classmethod
    def added(cls, parts: Sequence[SpreadsUnder]) -> SpreadsUnder:
        """Return the spreads of all parts."""
        each = np.concatenate([np.zeros((0, 2), dtype=np.int64), *(part.blocks for part in parts)])
        blocks, at = np.unique(each, axis=0, return_inverse=True)
        counts = np.zeros((len(blocks), _N_SPREADS), dtype=np.int64)
        if parts:
            np.add.at(counts, at.ravel(), np.concatenate([part.counts for part in parts]))
        return cls(blocks.reshape(-1, 2), counts)


def rough_limit_m(counts: IntArray, config: RoadConfig) -> float:
    """Return the largest spread of a smooth cell [m]: the setting, or 1.5 times the median where all is rough.

    >>> rough_limit_m(np.array([5, 1]), RoadConfig()), rough_limit_m(np.eye(1, 101, 100)[0], RoadConfig())
    (0.06, 0.15075)
    """
    median = _median_spread_m(counts)
    return config.roughness_m if np.isnan(median) else max(config.roughness_m, _ROUGH_MEDIANS * median)


#: Limit of the spread of a smooth cell in medians of all, for a survey that is rough everywhere.
_ROUGH_MEDIANS = 1.5
#: Limit of the spread of a cell about its plane: ruts of 2 cm, or so many times the spread under the path, which is noise,
#: grade and texture; a cell on which a kerb of 7 cm stands spreads by 2 cm where a tenth of it lies on the other side.
#: [m], [ratio]
_RUTS_M, _ROADS_UNEVENNESS = 0.02, 3.0

#: Reach of the median of slopes: 25 cells outvote a kerb. [cells]
REACH = 2
#: Halo width of the slopes. [cells]
SLOPE_HALO = REACH + 1


@dataclass(frozen=True, slots=True)
class UnevenLimits:
    """Largest spread of a cell of a road about its plane, by blocks of 64 m.

    Parameters
    ----------
    blocks
        (k, 2) int64 numbers of blocks east and north under the path.
    limit_m
        (k,) of each. [m]
    elsewhere_m
        (1,) where no path is near. [m]
    """

    blocks: IntArray
    limit_m: FloatArray
    elsewhere_m: FloatArray

    @property
    def arrays(self) -> tuple[IntArray, FloatArray, FloatArray]:
        """The limits as arrays, in the order in which they are taken."""
        return self.blocks, self.limit_m, self.elsewhere_m

    @classmethod
    def of(cls, under: SpreadsUnder, config: RoadConfig) -> UnevenLimits:
        """Return the limits that follow from the spreads of the cells under the path.

        >>> nowhere = SpreadsUnder(np.zeros((0, 2), np.int64), np.zeros((0, 501), np.int64))
        >>> UnevenLimits.of(nowhere, RoadConfig()).elsewhere_m.tolist()
        [0.06]
        """
        limits = [_limit_beside(counts, config) for counts in under.counts]
        everywhere = np.array([_limit_beside(under.counts.sum(axis=0), config)])
        return cls(under.blocks, np.array(limits), everywhere)

    def over(self, window: CellWindow, cell_m: float) -> Float32Array:
        """Return the limit of each cell of a window, (n_rows, n_cols) float32 [m]: the largest of its block and those around.

        A track that begins there is as rough as it is under the van.
        """
        (r, of_row), (c, of_col) = (
            np.unique(numbers, return_inverse=True) for numbers in window.blocks(cell_m)
        )
        low, high = np.array([c[0], r[0]]) - 1, np.array([c[-1], r[-1]]) + 1
        at = np.flatnonzero(np.all((self.blocks >= low) & (self.blocks <= high), axis=1))
        limit = np.full((len(r), len(c)), np.nan)
        for (east, north), value in zip(self.blocks[at].tolist(), self.limit_m[at].tolist(), strict=True):
            around = np.ix_(np.abs(r - north) <= 1, np.abs(c - east) <= 1)
            limit[around] = np.fmax(limit[around], value)
        limit[np.isnan(limit)] = self.elsewhere_m[0]
        return limit[np.ix_(of_row, of_col)].astype(np.float32)


def _limit_beside(counts: IntArray, config: RoadConfig) -> float:
    """Return the largest spread of a cell of a road about its plane [m], by the histogram of those under the path.

    >>> _limit_beside(np.eye(1, 101, 10)[0], RoadConfig()), _limit_beside(np.zeros(0), RoadConfig())
    (0.0315, 0.06)
    """
    under = _median_spread_m(counts)
    return config.roughness_m if np.isnan(under) else max(_RUTS_M, _ROADS_UNEVENNESS * under)


def _median_spread_m(counts: IntArray) -> float:
    """Return the median of the spreads of a histogram [m], NaN without any."""
    total = np.cumsum(counts)
    if len(total) == 0 or total[-1] == 0:
        return math.nan
    return (int(np.searchsorted(total, 0.5 * total[-1])) + 0.5) * _SPREAD_STEP_M


def smooth_slopes(
    height: Float32Array, spread: Float32Array, limit_m: float, uneven_m: Float32Array, config: RoadConfig
) -> tuple[BoolArray, Float32Array, Float32Array]:
    """Return which cells are smooth and not steep, and their slopes east and north.

    Parameters
    ----------
    height
        (n_rows + 2 `SLOPE_HALO`, n_cols + 2 `SLOPE_HALO`) float32, with a halo. [m]
    spread
        (n_rows, n_cols) float32. [m]
    limit_m
        Largest spread of a smooth cell. [m]
    uneven_m
        (n_rows, n_cols) float32: largest spread about the plane of its slopes. [m]

    Returns
    -------
    smooth, east, north
        (n_rows, n_cols) bool and float32 slopes [m/m], NaN where rough.
    """
    smooth = np.asarray(spread <= np.float32(limit_m))  # NaN: no
    network = middle_network((2 * REACH + 1) ** 2)
    east, north = kernels.median_slopes(height, smooth, config.cell_m, REACH, network)
    steepness = east * east + north * north
    smooth &= steepness <= np.float32(config.max_grade**2)
    # Over a square the heights of a plane spread by slope x side / sqrt(12)
    smooth &= spread * spread - steepness * np.float32(config.cell_m**2 / 12.0) <= uneven_m * uneven_m
    return smooth, east, north


@cache
def middle_network(n: int) -> AnyArray:
    """Return the comparisons that bring the median of n values, and the one below it, to their places, (k, 2) int32.

    Comparison (a, b) puts the smaller of two values at a. Odd-even merge sort (Batcher 1968,
    doi:10.1145/1468075.1468121) without the comparisons that the median does not need.

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
    """Return values after the comparisons of `middle_network`."""
    for a, b in middle_network(len(values)).tolist():
        values[a], values[b] = sorted((values[a], values[b]))
    return values
