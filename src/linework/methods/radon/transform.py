"""Radon transform of a raster image: exact strip integrals, at a cost proportional to the occupied cells."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from linework.arrays import AnyArray, FloatArray, checked
from linework.errors import InputError
from linework.kernels.radon import transform as kernels
from linework.methods.drawn import draw_radon_image
from linework.model.grid import Image

#: Largest number of bins of a Radon image: 0.8 GB of float64.
MAX_BINS = 100_000_000


@dataclass(frozen=True, slots=True)
class RadonImage:
    """R(theta, rho): the integral of an image over the strip about the line ``x cos + y sin = rho``.

    Parameters
    ----------
    values
        (n_angles, n_rho) integral over the strip of width `rho_step_m`, divided by that width; for a binary
        image the occupied length of the line. [value x m]
    angles_rad
        (n_angles,) theta, the direction of the line's normal, anticlockwise from east. [rad]
    rho_m
        (n_rho,) centres of the strips, symmetric about 0. [m]
    rho_step_m
        Width of a strip. [m]
    centre_xy
        (2,) point where rho = 0; x is east and y north of it. [m, world]
    """

    values: FloatArray
    angles_rad: FloatArray
    rho_m: FloatArray
    rho_step_m: float
    centre_xy: FloatArray

    def plot(self, ax: Any = None, **options: Any) -> Any:
        """Draw the image over theta [deg] and rho [m]; return the axes.

        options: for `matplotlib.axes.Axes.pcolormesh`.
        """
        return draw_radon_image(self.values, self.angles_rad, self.rho_m, ax, **options)


def radon_transform(image: Image, angles_rad: AnyArray, rho_step_m: float | None = None) -> RadonImage:
    """Return the Radon transform of an image at any set of angles.

    Parameters
    ----------
    image
        Any values on any grid, also turned and with cells that are not square; NaN counts as 0.
    angles_rad
        (n,) theta in [0, pi). [rad]
    rho_step_m
        Width of a strip [m]; the shorter side of a cell where not given.

    Raises
    ------
    InputError
        When the result would be larger than `MAX_BINS`.
    ValueError
        When an angle is outside [0, pi), or the step is not positive.

    Notes
    -----
    An image is a function that is constant over each cell, a rectangle. Seen along a direction a rectangle
    is a trapezoid, whose integral between the edges of a strip has a closed form: no interpolation, no
    sampling. The sum over rho is therefore the same at every angle. Cost: occupied cells x angles.

    References
    ----------
    Manandhar and Shibasaki (2002), "Line Detection by Radon Transformation", equations 1 and 2. They
    integrate along a line; we average over a strip as wide as a bin, so that nothing falls between bins.

    >>> from linework.model.grid import Grid
    >>> row = Image(np.ones((1, 5)), Grid(0.0, 0.2, 0.2, 0.2, 1, 5))
    >>> radon = radon_transform(row, [0.0, np.pi / 2])
    >>> radon.values.round(12).tolist()[1]  # looking along the row: 1 m in one strip
    [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]
    """
    grid = image.grid
    angles = checked("angles_rad", angles_rad, np.float64, (None,))
    if np.any(~((angles >= 0) & (angles < math.pi))):
        raise ValueError("angles_rad: expected 0 <= theta < pi")
    step = min(grid.cell_width_m, grid.cell_height_m) if rho_step_m is None else rho_step_m
    half_m = 0.5 * math.hypot(grid.n_cols * grid.cell_width_m, grid.n_rows * grid.cell_height_m)
    if len(angles) * (2 * half_m / step + 1) > MAX_BINS:
        raise InputError(
            f"a Radon image of {len(angles):,} x {2 * half_m / step:,.0f} bins, the limit is {MAX_BINS:,}",
            advice="take fewer angles, a wider step, or a part of the image",
        )
    rows, cols = np.nonzero(np.nan_to_num(image.values) if image.values.dtype.kind == "f" else image.values)
    turn = math.radians(grid.rotation_deg)
    along = (cols + 0.5 - 0.5 * grid.n_cols) * grid.cell_width_m
    up = (0.5 * grid.n_rows - rows - 0.5) * grid.cell_height_m
    values = radon_of_cells(
        along * math.cos(turn) - up * math.sin(turn),
        along * math.sin(turn) + up * math.cos(turn),
        image.values[rows, cols].astype(np.float64),
        cell_width_m=grid.cell_width_m,
        cell_height_m=grid.cell_height_m,
        angles_rad=angles,
        rho_step_m=step,
        rho_max_m=half_m,
        cell_turn_rad=turn,
    )
    centre = grid.to_world(np.array(0.5 * grid.n_rows), np.array(0.5 * grid.n_cols))
    return RadonImage(values, angles, rho_bins(half_m, step), step, centre)


def radon_of_cells(
    x_m: FloatArray,
    y_m: FloatArray,
    weights: FloatArray,
    *,
    cell_width_m: float,
    cell_height_m: float,
    angles_rad: FloatArray,
    rho_step_m: float,
    rho_max_m: float,
    cell_turn_rad: float = 0.0,
) -> FloatArray:
    """Return the Radon transform of a few cells, at little cost per call: for windows.

    Parameters
    ----------
    x_m, y_m
        (n,) centres of the cells from the window's centre, where rho = 0. [m]
    weights
        (n,) value of each cell; 1 for a binary image.
    angles_rad
        (n_angles,) theta. [rad]
    rho_max_m
        The strips cover at least -rho_max_m to rho_max_m; what projects beyond them is left out.
    cell_turn_rad
        Anticlockwise turn of the cells' axes from x and y. [rad]

    Returns
    -------
    (n_angles, n_rho) [value x m]; the strips are those of `rho_bins`.

    Raises
    ------
    ValueError
        When the step is not positive or `rho_max_m` is negative.

    >>> x, one = np.array([-0.1, 0.1]), np.ones(2)
    >>> radon_of_cells(x, 0 * x, one, cell_width_m=0.2, cell_height_m=0.2,
    ...                angles_rad=np.array([np.pi / 2]), rho_step_m=0.2, rho_max_m=0.2).round(12)
    array([[0. , 0.4, 0. ]])
    """
    values: FloatArray = kernels.radon(
        x_m,
        y_m,
        weights,
        (cell_width_m, cell_height_m, cell_turn_rad),
        angles_rad,
        rho_step_m,
        _n_half(rho_max_m, rho_step_m),
    )
    return values


def rho_bins(rho_max_m: float, rho_step_m: float) -> FloatArray:
    """Return the centres (n,) of the strips that cover -rho_max_m to rho_max_m, symmetric about 0 [m].

    Raises
    ------
    ValueError
        When the step is not positive or `rho_max_m` is negative.


    >>> rho_bins(0.35, 0.2)
    array([-0.4, -0.2,  0. ,  0.2,  0.4])
    """
    n_half = _n_half(rho_max_m, rho_step_m)
    return np.arange(-n_half, n_half + 1, dtype=np.float64) * rho_step_m


def evenly_spaced_angles(step_deg: float) -> FloatArray:
    """Return angles (n,) over [0, pi) [rad], in the whole number of steps nearest to `step_deg`.

    >>> np.rad2deg(evenly_spaced_angles(45.0)).round(9).tolist()
    [0.0, 45.0, 90.0, 135.0]
    """
    n = max(1, round(180.0 / step_deg))
    return np.arange(n, dtype=np.float64) * (math.pi / n)


def _n_half(rho_max_m: float, rho_step_m: float) -> int:
    if not (rho_step_m > 0 and rho_max_m >= 0):
        raise ValueError(f"rho_step_m {rho_step_m}, rho_max_m {rho_max_m}: expected > 0 and >= 0")
    # Slightly wider, so that rounding does not push out a corner that lies on the last edge
    return max(0, math.ceil(rho_max_m / rho_step_m - 0.5 + 1e-9))
