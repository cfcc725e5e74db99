"""Pictures of cuts across kerbs and markings."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from linework.evaluation.picture import FOUND, WIDTH_IN
from linework.evaluation.plan import COLOURS
from linework.evaluation.road_sections import KERB_REACH_M, PAINT_REACH_M, Cut

#: The mean brightness is drawn over steps of this width. [m]
STEP_M = 0.03


def kerb_figure(cuts: Sequence[Cut]) -> Figure:
    """Draw cuts across a boundary: points, foot (cross) and top (triangle), the truth as rings."""
    figure = Figure(figsize=(WIDTH_IN, 2.9), layout="constrained", dpi=110)
    panels = figure.subplots(1, len(cuts), squeeze=False, sharey=True)[0]
    for ax, cut in zip(panels, cuts, strict=True):
        ax.plot(*cut.points.T, ".", ms=2.5, color="#555555", rasterized=True)
        for places in (cut.truth, cut.truth_top):
            ax.plot(*places.T, "o", ms=13, mfc="none", mec=FOUND, mew=1.6)
        ax.plot(*cut.found.T, "x", ms=9, color=COLOURS["road_boundary"], mew=1.8)
        ax.plot(*cut.found_top.T, "^", ms=8, mfc="none", mec=COLOURS["road_boundary"], mew=1.8)
        ax.set(aspect="equal", xlim=(-KERB_REACH_M, KERB_REACH_M), ylim=(-0.2, 0.3))
        _label(ax, cut)
    panels[0].set_ylabel("height above the line [m]")
    handles = [
        _handle(".", "#555555", "laser points"),
        _handle("x", COLOURS["road_boundary"], "foot or edge, extracted"),
        _handle("^", COLOURS["road_boundary"], "kerb top, extracted"),
    ]
    if any(len(cut.truth) for cut in cuts):
        handles.append(_handle("o", FOUND, "truth"))
    figure.legend(handles=handles, loc="outside lower center", ncols=4, frameon=False, fontsize=9)
    return figure


def marking_figure(cuts: Sequence[Cut]) -> Figure:
    """Draw the brightness across markings: points, their mean, the extracted lines as wide as their paint."""
    figure = Figure(figsize=(WIDTH_IN, 3.4), layout="constrained", dpi=110)
    panels = figure.subplots(1, len(cuts), squeeze=False)[0]
    colour = COLOURS["lane_marking"]
    for ax, cut in zip(panels, cuts, strict=True):
        assert cut.intensity is not None
        ax.plot(cut.points[:, 0], cut.intensity, ".", ms=2.0, color="#8a8a8a", rasterized=True)
        ax.plot(*_mean_steps(cut.points[:, 0], cut.intensity), "-", lw=1.3, color="black")
        for place, width_m in zip(cut.found[:, 0].tolist(), cut.found_width_m.tolist(), strict=True):
            ax.axvline(place, color=colour, lw=1.6)
            if np.isfinite(width_m):
                ax.axvspan(place - width_m / 2, place + width_m / 2, color=colour, alpha=0.3, lw=0)
        for place in cut.truth[:, 0].tolist():
            ax.axvline(place, color=FOUND, lw=1.6, ls=(0, (4, 3)))
        ax.set(xlim=(-PAINT_REACH_M, PAINT_REACH_M), ylim=(0, None))
        _label(ax, cut)
    panels[0].set_ylabel("intensity as recorded")
    handles = [
        _handle(".", "#8a8a8a", "laser points"),
        Line2D([], [], color="black", lw=1.3, label=f"mean over {100 * STEP_M:.0f} cm"),
        Line2D([], [], color=colour, lw=3, label="extracted, as wide as its paint"),
    ]
    if any(len(cut.truth) for cut in cuts):
        handles.append(Line2D([], [], color=FOUND, lw=1.6, ls=(0, (4, 3)), label="truth"))
    figure.legend(handles=handles, loc="outside lower center", ncols=4, frameon=False, fontsize=9)
    return figure


def _mean_steps(across_m: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return middles of steps and the mean value in each that holds points."""
    step = np.floor(across_m / STEP_M).astype(np.int64)
    steps, which = np.unique(step, return_inverse=True)
    mean = np.bincount(which, weights=values) / np.maximum(np.bincount(which), 1)
    return (steps + 0.5) * STEP_M, mean


def _label(ax: Axes, cut: Cut) -> None:
    ax.set_title(cut.title, fontsize=9)
    ax.set_xlabel("across [m]")
    ax.grid(alpha=0.3)


def _handle(marker: str, colour: str, label: str) -> Line2D:
    face = "none" if marker in "o^" else colour
    return Line2D([], [], ls="", marker=marker, ms=9, mew=2, color=colour, mfc=face, label=label)
