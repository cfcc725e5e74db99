"""Pictures of raster images for people: overview and close-ups with scale bar, north arrow and legend."""

from __future__ import annotations

import io
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import BoundaryNorm, Colormap, ListedColormap, LogNorm, Normalize
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Rectangle
from matplotlib.ticker import FuncFormatter, NullFormatter

from linework.arrays import FloatArray
from linework.imaging.map_marks import draw_coordinates, draw_north_arrow, draw_scale_bar
from linework.imaging.overview import Window, close_ups, reduced
from linework.model.grid import Grid, Image

#: Cells drawn along the longer side of a panel at most; a screen shows no more.
PANEL_CELLS = 1600
#: An image with more cells than this along a side gets close-ups: there a cell is two pixels.
OVERVIEW_CELLS = 600
#: Size of a close-up. [m]
CLOSE_UP_M = (60.0, 45.0)
#: A map with sides of such a ratio has no room for a scale bar and a north arrow.
NARROW = 0.12
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
    windows: Sequence[Window] | None = None,
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
        windows = close_ups(image, *CLOSE_UP_M)
    g = image.grid
    if max(g.shape) <= OVERVIEW_CELLS:
        windows = ()
    # One that shows a quarter of the whole shows nothing new
    cells = 0.25 * g.n_rows * g.n_cols
    windows = [w for w in windows if (w.row1 - w.row0) * (w.col1 - w.col0) < cells]
    figure, whole, panels = _layout(g, len(windows))
    colours, norm = _colours(image, style)
    drawn = _draw_panel(whole, image, Window(0, g.n_rows, 0, g.n_cols), (style, colours, norm), lines)
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
    return png(figure)


def png(figure: Figure) -> bytes:
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
    from matplotlib import colormaps

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
    window: Window,
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
    if NARROW < (top - bottom) / (right - left) < 1.0 / NARROW:
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


def _frame(ax: Axes, grid: Grid, window: Window, name: str) -> None:
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
