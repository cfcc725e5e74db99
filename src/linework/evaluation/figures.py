"""Pictures of sections across rails and along cables."""

from __future__ import annotations

from collections.abc import Sequence

from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from linework.evaluation.picture import WIDTH_IN
from linework.evaluation.plan import COLOURS
from linework.evaluation.sections import Section


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
