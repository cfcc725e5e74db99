"""Pictures of raster images for people: overview and close-ups with scale bar, north arrow and legend."""

from __future__ import annotations

import io
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from linework.arrays import FloatArray
from linework.errors import extra_needed
from linework.imaging.overview import ImageWindow, close_ups, reduced
from linework.model.grid import Grid, Image

with extra_needed("reports"):
    from matplotlib import colormaps
    from matplotlib.axes import Axes
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.colors import BoundaryNorm, Colormap, ListedColormap, LogNorm, Normalize, PowerNorm
    from matplotlib.figure import Figure
    from matplotlib.image import AxesImage
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch, Rectangle
    from matplotlib.ticker import FuncFormatter, MaxNLocator, NullFormatter
    from matplotlib.transforms import Transform, offset_copy
    from mpl_toolkits.axes_grid1.anchored_artists import AnchoredSizeBar

#: Cells drawn along the longer side of a panel at most; a screen shows no more.
PANEL_CELLS = 1600
#: An image with more cells than this along a side gets close-ups: there a cell is two pixels.
OVERVIEW_CELLS = 600
#: Size of a close-up. [m]
MAP_CLOSE_UP_M = (60.0, 45.0)
#: A map with sides of such a ratio has no room for a scale bar and a north arrow.
NARROW_MAP = 0.12
DPI = 120
LINE_COLOUR = "#d01c1c"


@dataclass(frozen=True, slots=True, kw_only=True)
class Style:
    """How values become colours.

    Parameters
    ----------
    unit
        What the colour bar says.
    colours
        Name of a matplotlib colour map.
    logarithmic
        Colours follow the logarithm, from 1.
    limits
        First and last value of the bar; None: 1st and 99th percentile.
    classes
        (value, colour, name) of an image of classes: a legend instead of a bar.
    keep
        What an overview keeps of the cells it joins.
    empty
        Colour where no point is.
    """

    unit: str = ""
    colours: str = "viridis"
    logarithmic: bool = False
    limits: tuple[float, float] | None = None
    classes: tuple[tuple[int, str, str], ...] = ()
    keep: Literal["largest", "smallest"] = "largest"
    empty: str = "#f2f2ee"


@dataclass(frozen=True, slots=True)
class OverlaidLines:
    """Straight lines over a map.

    Parameters
    ----------
    ends
        (m, 2, 2) float64 [m, world]: from and to.
    names
        A short name for each.
    legend
        What they are.
    """

    ends: FloatArray
    names: Sequence[str]
    legend: str


def draw_map(
    image: Image,
    style: Style,
    *,
    title: str,
    crs_name: str,
    windows: Sequence[ImageWindow] | None = None,
    lines: OverlaidLines | None = None,
) -> bytes:
    """Return a PNG of the image: whole, and where it is large also `windows` of it close up.

    Parameters
    ----------
    image
        Numbers with NaN for empty cells, or classes with 0 for empty.
    crs_name
        Short name of the CRS for the caption.
    windows
        Close-ups to draw; None: chosen on the image's own occupied cells.

    Notes
    -----
    The size of the picture is bounded whatever the image's; a turned grid is drawn along its own axes.
    """
    if windows is None:
        windows = close_ups(image, *MAP_CLOSE_UP_M)
    g = image.grid
    if max(g.shape) <= OVERVIEW_CELLS:
        windows = ()
    # One that shows a quarter of the whole shows nothing new
    cells = 0.25 * g.n_rows * g.n_cols
    windows = [w for w in windows if (w.row1 - w.row0) * (w.col1 - w.col0) < cells]
    figure, whole, panels = _layout(g, len(windows))
    colours, norm = _colours(image, style)
    drawn = _draw_panel(whole, image, ImageWindow(0, g.n_rows, 0, g.n_cols), (style, colours, norm), lines)
    for name, panel, window in zip("ABCDEF", panels, windows, strict=False):
        _draw_panel(panel, image, window, (style, colours, norm), lines)
        panel.set_title(name, fontsize=9, weight="bold", loc="left")
        _frame(whole, g, window, name)
    _explain(figure, [whole, *panels], drawn, style, lines)
    turn = ""
    if g.rotation_deg:
        east, north = g.to_world(np.array(g.n_rows), np.array(0))
        turn = f"; turned {g.rotation_deg:.2f}° anticlockwise, 0, 0 is east {east:,.1f}, north {north:,.1f}"
    size = f"{g.n_rows:,} x {g.n_cols:,} cells of {g.cell_width_m:.3g} x {g.cell_height_m:.3g} m"
    figure.suptitle(title, fontsize=13, weight="bold")
    whole.set_title(f"{size}{turn}; {crs_name}", fontsize=8, pad=16 if windows else 6)
    return figure_png(figure)


def figure_png(figure: Figure) -> bytes:
    """Return a figure as the bytes of a PNG file, the same for the same picture."""
    buffer = io.BytesIO()
    figure.set_canvas(FigureCanvasAgg(figure))
    figure.savefig(buffer, format="png", metadata={"Software": None})
    return buffer.getvalue()


def _layout(grid: Grid, n_close: int) -> tuple[Figure, Axes, list[Axes]]:
    """Return a figure with the whole map, and the close-ups below a wide one or beside a tall one."""
    width_m, height_m = grid.n_cols * grid.cell_width_m, grid.n_rows * grid.cell_height_m
    ratio = height_m / width_m
    if n_close == 0:
        width = min(13.0, max(6.0, 9.5 / ratio))
        figure = Figure((width, min(11.0, max(3.2, (width - 1.8) * ratio + 1.4))), DPI, layout="constrained")
        return figure, figure.add_subplot(), []
    if ratio <= 1.0:
        tall = min(9.5, max(1.6, 12.0 * ratio))
        figure = Figure((14.0, tall + 4.9), DPI, layout="constrained")
        spec = figure.add_gridspec(2, n_close, height_ratios=[tall, 3.6])
        return (
            figure,
            figure.add_subplot(spec[0, :]),
            [figure.add_subplot(spec[1, k]) for k in range(n_close)],
        )
    wide = min(9.0, max(2.2, 10.5 / ratio))
    figure = Figure((wide + 6.6, 12.5), DPI, layout="constrained")
    spec = figure.add_gridspec(n_close, 2, width_ratios=[wide, 4.8])
    return figure, figure.add_subplot(spec[:, 0]), [figure.add_subplot(spec[k, 1]) for k in range(n_close)]


def _colours(image: Image, style: Style) -> tuple[Colormap, Any]:
    if style.classes:
        edges = [value - 0.5 for value, _, _ in style.classes] + [style.classes[-1][0] + 0.5]
        colours: Colormap = ListedColormap([colour for _, colour, _ in style.classes])
        return colours.with_extremes(bad=style.empty), BoundaryNorm(edges, len(style.classes))

    low, high = style.limits or _spread(image.values)
    norm = LogNorm(1.0, max(high, 10.0)) if style.logarithmic else Normalize(low, max(high, low + 1e-6))
    return colormaps[style.colours].with_extremes(bad=style.empty), norm


def _spread(values: Any) -> tuple[float, float]:
    """Return the 1st and 99th percentile of what was measured, on a sample of a large image."""
    flat = values.ravel()
    flat = flat[:: max(1, flat.size // 1_000_000)]
    known = flat[np.isfinite(flat) & (flat != 0)] if flat.dtype.kind in "ui" else flat[np.isfinite(flat)]
    return (float(np.percentile(known, 1)), float(np.percentile(known, 99))) if known.size else (0.0, 1.0)


def _draw_panel(
    ax: Axes,
    image: Image,
    window: ImageWindow,
    look: tuple[Style, Colormap, Any],
    lines: OverlaidLines | None,
) -> AxesImage:
    style, colours, norm = look
    grid = image.grid
    part = image.values[window.row0 : window.row1, window.col0 : window.col1]
    values = (
        part if part.dtype.kind == "f" else np.where(part == 0, np.float32(np.nan), part.astype(np.float32))
    )
    small, factor = reduced(values, PANEL_CELLS, style.keep)
    (left, top), (right, bottom) = (
        _place(grid, window.row0, window.col0),
        _place(grid, window.row1, window.col1),
    )
    reach_right = _place(grid, 0, window.col0 + factor * small.shape[1])[0]
    reach_bottom = _place(grid, window.row0 + factor * small.shape[0], 0)[1]
    drawn = ax.imshow(
        np.ma.masked_invalid(small), cmap=colours, norm=norm, interpolation="nearest",
        extent=(left, reach_right, reach_bottom, top), origin="upper",
    )  # fmt: skip
    if lines is not None:
        _draw_lines(ax, grid, lines, (left, right, bottom, top))
    ax.set_xlim(left, right)
    ax.set_ylim(bottom, top)
    names = ("along the grid's columns", "across") if grid.rotation_deg else ("east", "north")
    draw_coordinates(ax, *names)
    # In the overview of a long straight road they would hide it; the close-ups have them
    if NARROW_MAP < (top - bottom) / (right - left) < 1.0 / NARROW_MAP:
        draw_scale_bar(ax)
        draw_north_arrow(ax, grid.rotation_deg)
    return drawn


def _place(grid: Grid, row: Any, col: Any) -> tuple[Any, Any]:
    """Return panel coordinates: the world's on a north-up grid, from the lower left corner on a turned one."""
    x, y = col * grid.cell_width_m, (grid.n_rows - row) * grid.cell_height_m
    if grid.rotation_deg:
        return x, y
    return grid.east_m + x, grid.north_m - grid.n_rows * grid.cell_height_m + y


def _draw_lines(ax: Axes, grid: Grid, lines: OverlaidLines, box: tuple[float, float, float, float]) -> None:
    left, right, bottom, top = box
    for k, (ends, name) in enumerate(zip(lines.ends, lines.names, strict=True)):
        x, y = _place(grid, *grid.to_cell(ends))
        ax.plot(x, y, color=LINE_COLOUR, linewidth=1.2, alpha=0.9, zorder=5)
        # Names stand near where the lines enter the panel, in steps so that neighbours do not meet
        steps = np.linspace(0.0, 1.0, 2001)
        px, py = x[0] + steps * (x[1] - x[0]), y[0] + steps * (y[1] - y[0])
        inside = np.flatnonzero((px > left) & (px < right) & (py > bottom) & (py < top))
        if len(inside):
            at = inside[int((0.04 + 0.04 * (k % 6)) * len(inside))]
            ax.text(
                px[at], py[at], name, fontsize=7, color="white", ha="center", va="center", zorder=6, clip_on=True,
                bbox={"boxstyle": "round,pad=0.15", "facecolor": LINE_COLOUR, "edgecolor": "none"},
            )  # fmt: skip


def _frame(ax: Axes, grid: Grid, window: ImageWindow, name: str) -> None:
    (left, top), (right, bottom) = (
        _place(grid, window.row0, window.col0),
        _place(grid, window.row1, window.col1),
    )
    ax.add_patch(
        Rectangle((left, bottom), right - left, top - bottom, fill=False, edgecolor="black", zorder=7)
    )
    ax.text(
        left, top, name, fontsize=9, weight="bold", ha="right", va="bottom", zorder=7,
        bbox={"boxstyle": "round,pad=0.15", "facecolor": "white", "edgecolor": "none", "alpha": 0.85},
    )  # fmt: skip


def _explain(
    figure: Figure, axes: list[Axes], drawn: AxesImage, style: Style, lines: OverlaidLines | None
) -> None:
    """Add the colour bar, or the legend, of the picture."""
    handles: list[Any] = [
        Patch(facecolor=colour, edgecolor="black", linewidth=0.4, label=name)
        for _, colour, name in style.classes
    ]
    if lines is not None:
        handles.append(Line2D([], [], color=LINE_COLOUR, label=lines.legend))
    handles.append(Patch(facecolor=style.empty, edgecolor="black", linewidth=0.4, label="no points"))
    figure.legend(handles=handles, loc="outside lower center", ncols=len(handles), fontsize=8, frameon=False)
    if not style.classes:
        bar = figure.colorbar(drawn, ax=axes, extend="both", shrink=0.9, aspect=45, fraction=0.04, pad=0.01)
        bar.set_label(style.unit, fontsize=9)
        bar.ax.tick_params(labelsize=8)
        if style.logarithmic:
            bar.ax.yaxis.set_major_formatter(FuncFormatter(lambda v, _: f"{v:,g}"))
            bar.ax.yaxis.set_minor_formatter(NullFormatter())


# Picture of a Radon image, with its peaks


def draw_radon(
    values: FloatArray,
    angles_rad: FloatArray,
    rho_m: FloatArray,
    *,
    title: str,
    peaks: tuple[FloatArray, FloatArray] | None = None,
    names: Sequence[str] = (),
) -> bytes:
    """Return a PNG of Radon values (n_angles, n_rho), theta to the right and rho up.

    Parameters
    ----------
    peaks
        theta [rad] and rho [m] of peaks to mark, or None.
    names
        A short name for each peak, the same as on the map of the lines.
    """
    small, factor = reduced(values.T, PANEL_CELLS)
    theta_deg = np.degrees(angles_rad)
    step_deg = 180.0 / len(theta_deg)
    rho_step = float(rho_m[1] - rho_m[0]) if len(rho_m) > 1 else 1.0
    left, low = float(theta_deg[0]) - 0.5 * step_deg, float(rho_m[0]) - 0.5 * rho_step
    figure = Figure((11.0, 8.0), DPI, layout="constrained")
    ax = figure.add_subplot()
    drawn = ax.imshow(
        small, cmap="inferno", norm=PowerNorm(0.5, 0.0, max(float(values.max(initial=0.0)), 1e-6)), aspect="auto", origin="lower", interpolation="nearest",
        extent=(left, left + factor * step_deg * small.shape[1], low, low + factor * rho_step * small.shape[0]),
    )  # fmt: skip
    ax.set_xlim(left, left + step_deg * len(theta_deg))
    ax.set_ylim(low, low + rho_step * len(rho_m))
    ax.set_xlabel("theta: direction of the line's normal, anticlockwise from east [°]")
    ax.set_ylabel("rho: distance of the line from the image's centre [m]")
    figure.colorbar(drawn, ax=ax, pad=0.01).set_label(
        "occupied length in the strip [m], colours by its square root"
    )
    figure.suptitle(title, fontsize=13, weight="bold")
    if peaks is not None:
        ax.plot(
            np.degrees(peaks[0]), peaks[1], "o", markersize=9, markerfacecolor="none",
            markeredgecolor="#35d0ff", markeredgewidth=1.3, label="peak = candidate line",
        )  # fmt: skip
        for k, (theta, rho, name) in enumerate(zip(*peaks, names, strict=True)):
            aside = ((8, 6), (8, -12), (-16, 6), (-16, -12))[k % 4]
            ax.annotate(
                name, (float(np.degrees(theta)), float(rho)), xytext=aside, textcoords="offset points",
                fontsize=8, color="white", bbox={"boxstyle": "round,pad=0.15", "facecolor": LINE_COLOUR},
            )  # fmt: skip
        ax.legend(loc="upper right", fontsize=8)
    return figure_png(figure)


# Scale bar, north arrow and coordinates of a map picture


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
