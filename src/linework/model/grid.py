"""Grids on the ground and the images on them. Row 0 is north, column 0 is west (before rotation)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from linework.arrays import AnyArray, BoolArray, FloatArray


class Bounds(NamedTuple):
    """Rectangle in plan, half open: west <= x < east, south <= y < north [m, world]."""

    west: float
    south: float
    east: float
    north: float

    @property
    def width_m(self) -> float:
        """East-west size."""
        return self.east - self.west

    @property
    def height_m(self) -> float:
        """North-south size."""
        return self.north - self.south

    def grown(self, margin_m: float) -> Bounds:
        """Return the rectangle with `margin_m` added on every side."""
        return Bounds(
            self.west - margin_m, self.south - margin_m, self.east + margin_m, self.north + margin_m
        )


def holds(bounds: Bounds, places: FloatArray) -> BoolArray:
    """Return which of (n, 2 or 3) places lie within bounds, half open.

    >>> holds(Bounds(0, 0, 1, 1), np.array([[0.0, 0.5], [1.0, 0.5]])).tolist()
    [True, False]
    """
    east, north = places[:, 0], places[:, 1]
    return (east >= bounds.west) & (east < bounds.east) & (north >= bounds.south) & (north < bounds.north)


@dataclass(frozen=True, slots=True)
class Grid:
    """A regular grid of `n_rows` x `n_cols` cells, cell width and height independent, possibly turned.

    Parameters
    ----------
    east_m, north_m
        Outer corner of cell (0, 0): the north-west corner of the grid before rotation. [m, world]
    cell_width_m, cell_height_m
        Size of a cell along the columns' (u) and the rows' (v) direction. [m]
    rotation_deg
        Anticlockwise turn of the grid about (east_m, north_m); 0: columns run east, rows run south.
    """

    east_m: float
    north_m: float
    cell_width_m: float
    cell_height_m: float
    n_rows: int
    n_cols: int
    rotation_deg: float = 0.0

    def __post_init__(self) -> None:
        if not (self.cell_width_m > 0 and self.cell_height_m > 0):
            raise ValueError(f"cell {self.cell_width_m} x {self.cell_height_m} m, expected positive sizes")
        if self.n_rows < 1 or self.n_cols < 1:
            raise ValueError(f"grid of {self.n_rows} x {self.n_cols} cells, expected at least one")

    @classmethod
    def covering(cls, bounds: Bounds, cell_m: float) -> Grid:
        """Return the smallest north-up grid over `bounds` on the global lattice of multiples of `cell_m`.

        The lattice makes images of neighbouring tiles fit cell on cell. Rows are counted from the north,
        so a position on a cell's northern edge belongs to it, one on its southern edge does not.

        >>> Grid.covering(Bounds(10.1, 20.1, 10.9, 20.3), 0.2)
        Grid(east_m=10.0, north_m=20.400000000000002, cell_width_m=0.2, cell_height_m=0.2, n_rows=2, n_cols=5, rotation_deg=0.0)
        """
        west, south = math.floor(bounds.west / cell_m), math.ceil(bounds.south / cell_m) - 1
        east, north = math.floor(bounds.east / cell_m) + 1, math.ceil(bounds.north / cell_m)
        return cls(west * cell_m, north * cell_m, cell_m, cell_m, north - south, east - west)

    @property
    def shape(self) -> tuple[int, int]:
        """(n_rows, n_cols)."""
        return self.n_rows, self.n_cols

    @property
    def affine(self) -> tuple[float, float, float, float, float, float]:
        """GeoTIFF order a, b, c, d, e, f: east = a col + b row + c, north = d col + e row + f."""
        cos, sin = math.cos(math.radians(self.rotation_deg)), math.sin(math.radians(self.rotation_deg))
        w, h = self.cell_width_m, self.cell_height_m
        return (w * cos, h * sin, self.east_m, w * sin, -h * cos, self.north_m)

    def to_world(self, rows: AnyArray, cols: AnyArray) -> FloatArray:
        """Return (n, 2) world positions of fractional rows and columns (cell centres are at + 0.5)."""
        a, b, c, d, e, f = self.affine
        rows, cols = np.asarray(rows, dtype=np.float64), np.asarray(cols, dtype=np.float64)
        return np.stack([a * cols + b * rows + c, d * cols + e * rows + f], axis=-1)

    def to_cell(self, xy: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return fractional (rows, cols) of (n, 2) world positions; floor them for the cell's index."""
        cos, sin = math.cos(math.radians(self.rotation_deg)), math.sin(math.radians(self.rotation_deg))
        de, dn = xy[..., 0] - self.east_m, xy[..., 1] - self.north_m
        cols = (de * cos + dn * sin) / self.cell_width_m
        rows = (de * sin - dn * cos) / self.cell_height_m
        return rows, cols


@dataclass(frozen=True, slots=True)
class Image:
    """Values (rows, cols) on a grid; NaN (or False) where nothing was measured."""

    values: AnyArray
    grid: Grid

    def __post_init__(self) -> None:
        if self.values.shape != self.grid.shape:
            raise ValueError(f"image of shape {self.values.shape} on a grid of {self.grid.shape}")
