"""Results of the steps of methods, drawn with matplotlib: Radon images, peaks, segments."""

from __future__ import annotations

from typing import Any

import numpy as np

from linework.arrays import FloatArray
from linework.errors import needed

#: Extra that installs matplotlib.
_EXTRA = "reports"


def new_axes(ax: Any) -> Any:
    """Return axes to draw in: those given, or those of a new figure."""
    return needed("matplotlib.pyplot", _EXTRA, where="plot()").subplots()[1] if ax is None else ax


def draw_radon_image(
    values: FloatArray, angles_rad: FloatArray, rho_m: FloatArray, ax: Any = None, **options: Any
) -> Any:
    """Draw Radon values (n_angles, n_rho) over theta [deg] and rho [m]; return the axes."""
    ax = new_axes(ax)
    look = {"shading": "nearest", "cmap": "viridis"} | options
    ax.pcolormesh(np.degrees(angles_rad), rho_m, values.T, **look)
    return _in_radon_space(ax)


def draw_peaks(theta_rad: FloatArray, rho_m: FloatArray, ax: Any = None, **options: Any) -> Any:
    """Draw peaks (n,) in Radon space, over theta [deg] and rho [m]; return the axes."""
    ax = new_axes(ax)
    look = {"facecolors": "none", "edgecolors": "#d62728", "s": 60.0} | options
    ax.scatter(np.degrees(theta_rad), rho_m, **look)
    return _in_radon_space(ax)


def draw_segments(start_xy: FloatArray, end_xy: FloatArray, ax: Any = None, **options: Any) -> Any:
    """Draw straight segments between (n, 2) ends [m, world] in plan; return the axes."""
    ax = new_axes(ax)
    collections = needed("matplotlib.collections", _EXTRA, where="plot()")
    look = {"colors": "#d62728", "linewidths": 1.0} | options
    ax.add_collection(collections.LineCollection(np.stack([start_xy, end_xy], axis=1), **look))
    return _in_plan(ax)


def _in_radon_space(ax: Any) -> Any:
    ax.set_xlabel("theta [deg]")
    ax.set_ylabel("rho [m]")
    return ax


def _in_plan(ax: Any) -> Any:
    ax.autoscale_view()
    ax.set_aspect("equal")
    ax.set_xlabel("east [m]")
    ax.set_ylabel("north [m]")
    ax.ticklabel_format(useOffset=False, style="plain")
    return ax
