"""Lines and images drawn with matplotlib.

Separate from `linework.model.lineset.shown`, which needs no other package.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from linework.arrays import FloatArray
from linework.errors import needed
from linework.model.lineset.shown import (
    BACKGROUND,
    LOOKS,
    OTHER_LOOK,
    bridged_runs,
    colour_text,
    counted,
    kind_text,
    measured_runs,
)

if TYPE_CHECKING:
    from linework.model.grid import Image
    from linework.model.lines import LineSet

#: Extra that installs matplotlib.
_EXTRA = "reports"
#: Points of line width per millimetre of a kind's width on a map.
_POINTS_PER_MM = 72 / 25.4


def plot_lines(lines: LineSet, ax: Any, **options: Any) -> Any:
    """Draw lines in plan: the work of `LineSet.plot`."""
    collections = needed("matplotlib.collections", _EXTRA, where="plot()")
    if ax is None:
        ax = _new_axes()
        ax.set_facecolor(BACKGROUND)
    for kind in lines.kinds:
        own = lines.take(lines.kind == kind)
        plan: FloatArray = own.xyz[:, :2]
        name = f"{kind_text(kind)} ({counted(len(own))})"
        for runs, style in ((measured_runs(own), "solid"), (bridged_runs(own), "dashed")):
            if not runs:
                continue
            look = {
                "colors": colour_text(kind),
                "linewidths": LOOKS.get(kind, OTHER_LOOK)[1] * _POINTS_PER_MM,
                "linestyles": style,
                "label": name,
            }
            name = "_nolegend_"
            pieces = [plan[first : last + 1] for first, last in runs]
            ax.add_collection(collections.LineCollection(pieces, **(look | options)), autolim=False)
    finite = lines.xyz[np.isfinite(lines.xyz[:, :2]).all(axis=1), :2]
    if len(finite):
        ax.update_datalim(finite)
        ax.autoscale_view()
    _in_metres(ax)
    if ax.get_legend_handles_labels()[0]:
        ax.legend()
    return ax


def plot_image(image: Image, ax: Any, **options: Any) -> Any:
    """Draw an image in plan: the work of `Image.plot`."""
    transforms = needed("matplotlib.transforms", _EXTRA, where="plot()")
    if ax is None:
        ax = _new_axes()
    # In cells, so that a turned grid is drawn like one that is not
    n_rows, n_cols = image.grid.shape
    a, b, c, d, e, f = image.grid.affine
    placed = transforms.Affine2D(np.array([[a, b, c], [d, e, f], [0.0, 0.0, 1.0]]))
    look = {"origin": "upper", "extent": (0, n_cols, n_rows, 0), "interpolation": "nearest"}
    drawn = ax.imshow(image.values, **(look | options))
    drawn.set_transform(placed + ax.transData)
    corners = image.grid.to_world(np.array([0, 0, n_rows, n_rows]), np.array([0, n_cols, 0, n_cols]))
    ax.set_xlim(corners[:, 0].min(), corners[:, 0].max())
    ax.set_ylim(corners[:, 1].min(), corners[:, 1].max())
    _in_metres(ax)
    return ax


def _new_axes() -> Any:
    """Return the axes of a new figure."""
    return needed("matplotlib.pyplot", _EXTRA, where="plot()").subplots()[1]


def _in_metres(ax: Any) -> None:
    """Label axes as east and north [m], to scale and with whole coordinates."""
    ax.set_aspect("equal")
    ax.set_xlabel("east [m]")
    ax.set_ylabel("north [m]")
    ax.ticklabel_format(useOffset=False, style="plain")
