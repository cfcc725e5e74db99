"""Scale bar, north arrow and coordinates of a map picture."""

from __future__ import annotations

import math
from typing import Any

from matplotlib.axes import Axes
from matplotlib.ticker import FuncFormatter, MaxNLocator
from matplotlib.transforms import Transform, offset_copy
from mpl_toolkits.axes_grid1.anchored_artists import AnchoredSizeBar


def nice_length_m(at_most_m: float) -> float:
    """Return the largest of 1, 2, 5 times a power of ten that is not longer than `at_most_m`.

    >>> [nice_length_m(x) for x in (0.7, 9.0, 31.0)]
    [0.5, 5.0, 20.0]
    """
    power = 10.0 ** math.floor(math.log10(at_most_m))
    return max(f * power for f in (1.0, 2.0, 5.0) if f * power <= at_most_m * (1 + 1e-9))


def draw_scale_bar(ax: Axes) -> None:
    """Draw a bar of a round length in the lower left corner of an axes in metres."""
    left, right = ax.get_xlim()
    length = nice_length_m(0.22 * (right - left))
    bar = AnchoredSizeBar(
        ax.transData, length, f"{length:g} m", "lower left",
        pad=0.4, sep=4, borderpad=0.6, size_vertical=0.004 * (right - left), fill_bar=True, color="black",
    )  # fmt: skip
    bar.patch.set(alpha=0.85, edgecolor="none")
    bar.set_zorder(9)
    ax.add_artist(bar)


def draw_north_arrow(ax: Axes, rotation_deg: float) -> None:
    """Draw an arrow to grid north in the upper right corner; `rotation_deg` is the grid's own turn."""
    turn = math.radians(rotation_deg)
    east, north = math.sin(turn), math.cos(turn)
    figure: Any = ax.figure

    def from_corner(points: float) -> Transform:
        """Return the transform that puts (1, 1) so far along the arrow from its middle."""
        x, y = -24 + points * east, -24 + points * north
        return offset_copy(ax.transAxes, fig=figure, x=x, y=y, units="points")

    ax.plot(
        [1], [1], marker="o", markersize=42, color="white", alpha=0.85, transform=from_corner(0), zorder=8,
        scalex=False, scaley=False,
    )  # fmt: skip
    ax.annotate(
        "", xy=(1, 1), xycoords=from_corner(10), xytext=(1, 1), textcoords=from_corner(-16),
        arrowprops={"arrowstyle": "-|>,head_width=0.3,head_length=0.6", "color": "black"}, zorder=9,
    )  # fmt: skip
    ax.text(
        1, 1, "N", transform=from_corner(14), ha="center", va="center", fontsize=9, weight="bold", zorder=9
    )


def draw_coordinates(ax: Axes, x_name: str, y_name: str) -> None:
    """Label the axes in metres: whole numbers, never an offset to be added in the head."""
    (left, right), (bottom, top) = ax.get_xlim(), ax.get_ylim()
    ratio = (top - bottom) / (right - left)
    # As many as there is room for on the shorter side
    for axis, n in ((ax.xaxis, 5 if ratio < 4.0 else 2), (ax.yaxis, 5 if ratio > 0.25 else 2)):
        axis.set_major_locator(MaxNLocator(n, min_n_ticks=2))
        axis.set_major_formatter(FuncFormatter(lambda v, _: f"{v:,.10g}"))
    # In the lower left corner the labels of the two axes would meet
    ax.yaxis.set_major_formatter(
        FuncFormatter(lambda v, _: f"{v:,.10g}" if v > bottom + 0.06 * (top - bottom) else "")
    )
    ax.tick_params(labelsize=8)
    for label in ax.get_yticklabels():
        label.set(rotation=90, va="center")
    ax.set_xlabel(f"{x_name} [m]", fontsize=8)
    ax.set_ylabel(f"{y_name} [m]", fontsize=8)
