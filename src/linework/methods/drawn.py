"""Results of the steps of methods, drawn with matplotlib: Radon images, peaks, segments, boxes."""

from __future__ import annotations

from typing import Any

import numpy as np

from linework.arrays import FloatArray
from linework.errors import needed
from linework.model.boxes import BoxForm, BoxSet

#: Extra that installs matplotlib.
_EXTRA = "reports"
#: Colours of boxes by form, as in the pictures of the guides.
BOX_COLOURS = {
    BoxForm.STRIPE: "#1f6fd1",
    BoxForm.OTHER_PAINT: "#2e9e4f",
    BoxForm.KERB: "#d62728",
    BoxForm.EDGE: "#ff8c1a",
    BoxForm.BARRIER: "#8c4bbf",
}


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


def draw_boxes(boxes: BoxSet, ax: Any = None, **options: Any) -> Any:
    """Draw boxes in plan, coloured by form; return the axes.

    Stripes and kerbs may have no width: they are drawn as lines.
    """
    ax = new_axes(ax)
    collections = needed("matplotlib.collections", _EXTRA, where="plot()")
    along = boxes.u * boxes.half_u_m[:, None]
    left = np.stack([-boxes.u[:, 1], boxes.u[:, 0]], axis=-1) * np.nan_to_num(boxes.half_v_m)[:, None]
    xy = boxes.centre[:, :2]
    corners = np.stack([xy - along - left, xy + along - left, xy + along + left, xy - along + left], axis=1)
    for form, colour in BOX_COLOURS.items():
        own = corners[boxes.form == form]
        if len(own):
            look = {"facecolors": "none", "edgecolors": colour, "linewidths": 0.8, "label": form.name.lower()}
            ax.add_collection(collections.PolyCollection(own, **(look | options)))
    if ax.get_legend_handles_labels()[0]:
        ax.legend()
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
