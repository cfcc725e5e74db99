"""Points that may be wires: above the traffic, and isolated in their column; and widths across a wire."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from linework.arrays import BoolArray, Float32Array, FloatArray, IntArray
from linework.kernels.cables import search as kernels

#: Side of a column: five sub-cells of 0.1 m. Wider ones smear a sloping wire over more layers. [m]
COLUMN_M = 0.5
#: Thickness of a layer: three times the range noise of a mobile scanner, a third of the least distance between wires
#: one above another. [m]
CABLE_LAYER_M = 0.1
#: Reach above and below a point within which its column must be clear. [m]
COLUMN_REACH_M = 1.0
#: Depth below the band to which a wire of the band may hang: in mid-span, and where the ground rises. [m]
BELOW_M = 1.0
#: Most occupied layers, of the nine from 0.2 m to 1 m above (or below) a point, of an isolated point. Wires 0.3 m apart, each smeared over two layers by its slope, occupy six at most; a wall
#: or a crown fills them.
MOST_LAYERS = 6
#: Most occupied sub-cells, of the 25 of its column within one layer, of an isolated point. A wire crosses at most 9 of them, two side by side 14 with their noise; a roof or deck fills them.
MOST_SUB_CELLS = 15


@dataclass(frozen=True, slots=True)
class CableBand:
    """Points of a tile from a little below the band of cables upwards, in columns.

    Parameters
    ----------
    index
        (n,) int64 indices of the points in the tile.
    xyz
        (n, 3) from `origin`. [m]
    height_m
        (n,) above the ground. [m]
    lonely
        (n,) bool: isolated, and in the band or up to `BELOW_M` below it: may be a wire.
    origin
        (3,) shared by all tiles of a survey, so that lattices agree and no digits are lost. [m, world]
    keys, start, order, grid
        The columns: sorted row-major numbers of the occupied ones (c,) int64, (c + 1,) int64 where each begins in
        `order`, (n,) int64 points by column, and (4,) side [m], columns per row, first column, first row.
    """

    index: IntArray
    xyz: FloatArray
    height_m: FloatArray
    lonely: BoolArray
    origin: FloatArray
    keys: IntArray
    start: IntArray
    order: IntArray
    grid: FloatArray

    def near(self, line: FloatArray, reach_m: float) -> IntArray:
        """Return the points within `reach_m` in plan of a segment (6,): x, y, ux, uy, from, to [m]; (k,) int64."""
        found: IntArray = kernels.near_segment(
            self.keys, self.start, self.order, self.grid, self.xyz[:, :2], line, reach_m
        )
        return found


def cable_band(xyz: FloatArray, height_m: Float32Array, low_m: float, origin: FloatArray) -> CableBand | None:
    """Return the points above `low_m` and, for context, those up to 2 m below it; None without any.

    Parameters
    ----------
    xyz
        (n, 3) points. [m, world]
    height_m
        (n,) float32 above the ground; NaN where unknown: left out. [m]
    origin
        (3,) origin of columns, layers and cells. [m, world]

    Notes
    -----
    One sort of the points of the band and one pass over them: about 30 ns per point.
    """
    index = np.flatnonzero(height_m >= low_m - BELOW_M - COLUMN_REACH_M)
    if len(index) == 0:
        return None
    local = xyz[index] - origin
    height = height_m[index].astype(np.float64)
    sub = np.floor(local[:, :2] / (COLUMN_M / kernels.SIDE)).astype(np.int64)
    column = sub // kernels.SIDE
    west, south = column.min(axis=0).tolist()
    n_cols = int(column[:, 0].max()) - west + 1
    key = (column[:, 1] - south) * n_cols + column[:, 0] - west
    order = np.argsort(key, kind="stable")
    ordered = key[order]
    first = np.flatnonzero(np.diff(ordered, prepend=-1))
    start = np.append(first, len(ordered))
    sub_cell = ((sub[:, 1] % kernels.SIDE) * kernels.SIDE + sub[:, 0] % kernels.SIDE).astype(np.int32)
    layer = np.floor(local[:, 2] / CABLE_LAYER_M).astype(np.int32)
    stacked, spread = kernels.crowding(order, start, layer, sub_cell, round(COLUMN_REACH_M / CABLE_LAYER_M))
    lonely = (height >= low_m - BELOW_M) & (stacked <= MOST_LAYERS) & (spread <= MOST_SUB_CELLS)
    return CableBand(
        index,
        local,
        height,
        lonely,
        origin,
        ordered[first],
        start,
        order,
        np.array([COLUMN_M, n_cols, west, south], dtype=np.float64),
    )


# Widths across a wire, all proportional to the gate, which follows the noise of the survey

#: Outer over inner radius of the ring about a wire that must be empty. Leaves fill it with 3 times as many
#: points as the tube, a wall with as many; the next wire, from 0.3 m, is beyond it, and still is where sags
#: differ and bring two wires as near as 0.15 m.
RING = 2.2
#: Inner radius of that ring over the gate's: points between the two are neither on the wire nor beside it.
RING_INNER = 1.25


@dataclass(frozen=True, slots=True)
class Widths:
    """Widths across a wire.

    Parameters
    ----------
    gate_m
        Widest gate across a wire: points beyond are not on it. 0.1 m is four deviations of the noise of mobile
        scanners (20 mm, and 10 mm of the wire itself) and a third of the least distance of wires. [m]
    """

    gate_m: float

    @property
    def tube_m(self) -> float:
        """Narrowest gate: a wire is up to 4 cm thick, a beam 2 cm wide, and hits lie anywhere on it."""
        return 0.5 * self.gate_m

    @property
    def gates(self) -> FloatArray:
        """Narrowest and widest gate [m] and outer radius of the ring over the gate's, (3,), for the kernels."""
        return np.array([self.tube_m, self.gate_m, RING])

    @property
    def sigma_m(self) -> float:
        """Least deviation that outliers are judged by [m]: 4.7 of it are the tube."""
        return 0.1 * self.gate_m

    @property
    def round_m(self) -> float:
        """Deviation of a wire's points up to which their cross-section need not look round [m]."""
        return 0.3 * self.gate_m

    @property
    def side_m(self) -> float:
        """Pieces of one wire face each other, and wires meet at a support, within this [m]."""
        return 1.5 * self.gate_m

    @property
    def slice_m(self) -> float:
        """Half width of the slice through a seed line [m]: a cell, the angle's step, and a wire beside."""
        return 5.0 * self.gate_m

    @property
    def vote_m(self) -> float:
        """Height of a bin of votes in the slice [m]."""
        return 0.8 * self.gate_m

    @property
    def crowd_m(self) -> float:
        """Distance within which the edge of a roof has its wall, and a wire at most other wires [m]."""
        return 6.0 * self.gate_m
