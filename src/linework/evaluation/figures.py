"""The pictures of a report: lines over the points in plan, sections through rails and cables."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from linework.evaluation.picture import WIDTH_IN, main_direction, panel_height, turned
from linework.evaluation.sections import Section
from linework.imaging.map_marks import draw_north_arrow, draw_scale_bar
from linework.model.arrays import FloatArray
from linework.model.lines import KINDS, LineSet
from linework.model.points import Points

#: Colours that differ for most eyes and on both white and grey, one per kind.
COLOURS = dict(
    zip(
        KINDS,
        ("#e8b100", "#f0d060", "#ff7f0e", "#8c564b", "#c49c94", "#d62728", "#7f3fbf", "#2a9d8f", "#1667c4"),
        strict=True,
    )
)
OTHER_COLOUR = "#444444"
#: Cells along the longer side of the plan: a screen shows no more.
PLAN_CELLS = 1400
#: Points drawn at most; a plan does not gain from more.
PLAN_POINTS = 4_000_000


def plan_figure(lines: LineSet, points: Points | None) -> Figure:
    """Draw the lines over the density of the points, turned so that the road lies along the picture."""
    turn = main_direction([lines.xyz[:, :2]])
    origin = np.floor(lines.xyz[:, :2].mean(axis=0)) if len(lines.xyz) else np.zeros(2)
    places = turned(lines.xyz[:, :2] - origin, turn)
    cloud = np.zeros((0, 2))
    if points is not None and len(points):
        # An even share of a large cloud has the same pattern
        chosen = points.xyz[:: max(1, len(points) // PLAN_POINTS), :2]
        if not len(lines.xyz):
            origin = np.floor(chosen.mean(axis=0))
            turn = main_direction([chosen[:: max(1, len(chosen) // 10_000)] - origin])
        cloud = turned(chosen - origin, turn)
    box = _box_of(places if len(places) else cloud)
    height = panel_height(box)
    figure = Figure(figsize=(WIDTH_IN, height + 0.5), layout="constrained", dpi=110)
    ax = figure.subplots()
    if len(cloud):
        _draw_density(ax, cloud, box)
    drawn = [turned(lines.line(i)[:, :2] - origin, turn) for i in range(len(lines))]
    colours = [COLOURS.get(str(kind), OTHER_COLOUR) for kind in lines.kind]
    ax.add_collection(LineCollection(drawn, colors=colours, linewidths=1.8))
    ax.set(xlim=box[0], ylim=box[1], aspect="equal", xticks=[], yticks=[])
    draw_scale_bar(ax)
    draw_north_arrow(ax, math.degrees(turn))
    kinds = [kind for kind in (*KINDS, *sorted(set(lines.kind.tolist()) - set(KINDS))) if kind in lines.kind]
    handles = [
        Line2D([], [], color=COLOURS.get(kind, OTHER_COLOUR), lw=3, label=kind.replace("_", " "))
        for kind in kinds
    ]
    if handles:
        figure.legend(
            handles=handles, loc="outside lower center", ncols=len(handles), frameon=False, fontsize=9
        )
    return figure


def rail_figure(sections: Sequence[Section]) -> Figure:
    """Draw slices across a rail side by side: points, the found line (cross) and the truth (ring)."""
    figure = Figure(figsize=(WIDTH_IN, 3.9), layout="constrained", dpi=110)
    panels = figure.subplots(1, len(sections), squeeze=False, sharey=True)[0]
    for ax, section in zip(panels, sections, strict=True):
        ax.plot(*section.points.T, ".", ms=2.5, color="#555555", rasterized=True)
        for place in section.truth:
            ax.plot(*place.T, "o", ms=13, mfc="none", mec="#2a9d3f", mew=2)
        for place in section.found:
            ax.plot(*place.T, "x", ms=10, color=COLOURS["guardrail"], mew=2.2)
        ax.set(aspect="equal", xlabel="across, to the right [m]", xlim=(-1.3, 1.3))
        ax.set_ylim(section.bottom_m, section.top_m)
        ax.set_title(section.title, fontsize=9)
        ax.grid(alpha=0.3)
    panels[0].set_ylabel(f"height above {sections[0].datum} [m]")
    _legend(figure, "x", COLOURS["guardrail"], has_truth=any(s.truth for s in sections), truth_marker="o")
    return figure


def cable_figure(section: Section) -> Figure:
    """Draw the slice along a span: points, found cables and the truth under them."""
    figure = Figure(figsize=(WIDTH_IN, 4.6), layout="constrained", dpi=110)
    ax = figure.subplots()
    ax.plot(*section.points.T, ".", ms=1.2, color="#777777", rasterized=True)
    for line in section.truth:
        ax.plot(*line.T, color="#2a9d3f", lw=4, alpha=0.6)
    for line in section.found:
        ax.plot(*line.T, color=COLOURS["cable"], lw=1.4)
    ax.set_ylim(section.bottom_m, section.top_m)
    ax.set(xlabel="along the span [m]", ylabel=f"height above {section.datum} [m]", title=section.title)
    ax.grid(alpha=0.3)
    _legend(figure, "_", COLOURS["cable"], has_truth=bool(section.truth), truth_marker="_")
    return figure


def _legend(figure: Figure, marker: str, colour: str, *, has_truth: bool, truth_marker: str) -> None:
    handles = [
        Line2D([], [], ls="", marker=".", color="#555555", label="laser points"),
        Line2D([], [], ls="", marker=marker, ms=10, mew=2.2, color=colour, label="extracted"),
    ]
    if has_truth:
        handles.append(
            Line2D(
                [], [], ls="", marker=truth_marker, ms=11, mfc="none", mec="#2a9d3f", mew=2.5, label="truth"
            )
        )
    figure.legend(handles=handles, loc="outside lower center", ncols=3, frameon=False, fontsize=9)


def _box_of(places: FloatArray) -> tuple[tuple[float, float], tuple[float, float]]:
    if len(places) == 0:
        return (-10.0, 10.0), (-5.0, 5.0)
    (x0, y0), (x1, y1) = places.min(axis=0), places.max(axis=0)
    margin = max(0.04 * (x1 - x0), 6.0)
    return (float(x0 - margin), float(x1 + margin)), (float(y0 - margin), float(y1 + margin))


def _draw_density(ax: Axes, cloud: FloatArray, box: tuple[tuple[float, float], tuple[float, float]]) -> None:
    (x0, x1), (y0, y1) = box
    cell_m = max(x1 - x0, y1 - y0) / PLAN_CELLS
    n_cols, n_rows = max(1, round((x1 - x0) / cell_m)), max(1, round((y1 - y0) / cell_m))
    counts, _, _ = np.histogram2d(cloud[:, 1], cloud[:, 0], bins=(n_rows, n_cols), range=((y0, y1), (x0, x1)))
    # Logarithmic, as densities fall with the square of the distance
    ax.imshow(
        np.log1p(counts), origin="lower", extent=(x0, x1, y0, y1), cmap="Greys", interpolation="antialiased",
        vmax=float(np.log1p(np.percentile(counts[counts > 0], 99))) * 1.6 if (counts > 0).any() else 1.0,
    )  # fmt: skip
