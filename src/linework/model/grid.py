"""Grids on the ground and the images on them. Row 0 is north, column 0 is west (before rotation)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from linework.arrays import AnyArray, BoolArray, FloatArray
from linework.errors import needed


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


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Image:
    """Values (rows, cols) on a grid; NaN (or False) where nothing was measured.

    NumPy takes it as its values: ``np.nanmax(image)``. Two images are equal if grids and values are.

    Examples
    --------
    >>> image = Image(np.array([[1.0, np.nan], [3.0, 4.0]]), Grid(500.0, 210.0, 5.0, 5.0, 2, 2))
    >>> image
    Image of 2 x 2 cells of 5 x 5 m, float64 1 to 4, 75.0 % measured, from east 500.0, north 210.0
    >>> float(np.nanmean(image)), image.extent
    (2.6666666666666665, (500.0, 510.0, 200.0, 210.0))
    """

    values: AnyArray
    grid: Grid

    def __post_init__(self) -> None:
        if self.values.shape != self.grid.shape:
            raise ValueError(f"image of shape {self.values.shape} on a grid of {self.grid.shape}")

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> AnyArray:
        """Return the values: themselves where neither a copy nor another dtype is asked for."""
        if copy is False and dtype is not None and np.dtype(dtype) != self.values.dtype:
            raise ValueError(f"values are {self.values.dtype}: as {np.dtype(dtype)} they must be copied")
        values = np.asarray(self.values, dtype=dtype)
        return values.copy() if copy and np.may_share_memory(values, self.values) else values

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Image):
            return NotImplemented
        has_nan = self.values.dtype.kind == other.values.dtype.kind == "f"
        return self.grid == other.grid and np.array_equal(self.values, other.values, equal_nan=has_nan)

    __hash__ = None  # type: ignore[assignment]

    def __repr__(self) -> str:
        grid = self.grid
        is_flag = self.values.dtype.kind == "b"
        known = self.values if is_flag else np.isfinite(self.values)
        found = self.values[known]
        shown = "" if is_flag or found.size == 0 else f" {found.min():g} to {found.max():g}"
        turned = f", turned by {grid.rotation_deg:g} degrees" if grid.rotation_deg else ""
        return (
            f"Image of {grid.n_rows:,} x {grid.n_cols:,} cells of {grid.cell_width_m:g} x {grid.cell_height_m:g} m, "
            f"{self.values.dtype}{shown}, {100 * known.mean():.1f} % {'true' if is_flag else 'measured'}, "
            f"from east {grid.east_m:.1f}, north {grid.north_m:.1f}{turned}"
        )

    @property
    def extent(self) -> tuple[float, float, float, float]:
        """West, east, south, north [m, world]: the `extent` of matplotlib's `imshow`.

        Raises
        ------
        ValueError
            The grid is turned.
        """
        grid = self.grid
        if grid.rotation_deg:
            raise ValueError(f"image turned by {grid.rotation_deg:g} degrees: no extent; plot() draws it")
        east, south = grid.to_world(np.array(grid.n_rows), np.array(grid.n_cols)).tolist()
        return grid.east_m, east, south, grid.north_m

    def to_xarray(self) -> Any:
        """Return the values as an `xarray.DataArray`.

        Returns
        -------
        xarray.DataArray
            Dimensions y (north to south) and x (west to east), with the centres of the cells as coordinates [m,
            world]. Of a turned grid the dimensions are row and col, with x and y (rows, cols) as coordinates.

        Raises
        ------
        MissingPackageError
            xarray is not installed.
        """
        xarray = needed("xarray", "tables", where="to_xarray()")
        n_rows, n_cols = self.grid.shape
        rows, cols = np.mgrid[:n_rows, :n_cols] + 0.5
        xy = self.grid.to_world(rows, cols)
        if self.grid.rotation_deg:
            dims: tuple[str, str] = ("row", "col")
            coords: dict[str, Any] = {"x": (dims, xy[..., 0]), "y": (dims, xy[..., 1])}
        else:
            dims = ("y", "x")
            coords = {"y": xy[:, 0, 1], "x": xy[0, :, 0]}
        array = xarray.DataArray(self.values.copy(), coords=coords, dims=dims)
        array["x"].attrs.update(units="m", long_name="east")
        array["y"].attrs.update(units="m", long_name="north")
        return array

    def plot(self, ax: Any = None, **options: Any) -> Any:
        """Draw the image in plan, to scale; return the axes.

        Parameters
        ----------
        ax
            matplotlib axes; None: those of a new figure.
        **options
            Passed to `imshow`: cmap, vmin, vmax ...

        Raises
        ------
        MissingPackageError
            matplotlib is not installed.
        """
        from linework.model.lineset.plotted import plot_image

        return plot_image(self, ax, **options)
