"""Sections through the points, across a guardrail and along a cable span, and their figures.

Separate from cuts.py, as a section shows heights above the road or along a whole span.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from linework.arrays import FloatArray, distance_along
from linework.errors import extra_needed
from linework.evaluation.report.plan import COLOURS
from linework.evaluation.report.scores_figure import WIDTH_IN
from linework.model.lines import LineSet
from linework.model.points import Points

with extra_needed("reports"):
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

#: Half the thickness of a slice across a guardrail [m]: a few scan lines fall into it.
_RAIL_HALF_THICK_M = 0.3
#: Half the chord that gives the direction of a rail [m].
_HALF_CHORD_M = 0.5
#: Heights shown above the road: from just below it to well above a rail; and the same above the rail [m].
_ABOVE_ROAD_M, _ABOVE_RAIL_M = (-0.3, 1.5), (-1.1, 0.7)
#: How far a slice along a span reaches beyond its ends [m].
_BEYOND_SPAN_M = 2.0


@dataclass(frozen=True, slots=True)
class Section:
    """A vertical slice with its points and lines, projected onto it.

    Parameters
    ----------
    title
        The line and the chainage, or the span.
    points
        (n, 2) [m]: distance along the section, height above the datum.
    found, truth
        Lines in the slice, each (k, 2) [m]; in a slice across lines, single points (1, 2).
    datum
        The zero of the heights, as text.
    bottom_m, top_m
        Range of heights shown. [m above the datum]
    """

    title: str
    points: FloatArray
    found: Sequence[FloatArray]
    truth: Sequence[FloatArray]
    datum: str
    bottom_m: float
    top_m: float


def rail_sections(
    points: Points, lines: LineSet, reference: LineSet | None, *, n: int = 3, half_width_m: float = 1.6
) -> tuple[Section, ...]:
    """Return evenly spaced slices across the longest guardrail; () where there is none.

    Parameters
    ----------
    n
        Number of slices.
    half_width_m
        Reach of a slice to either side of the rail. [m]

    Notes
    -----
    Slices are 0.6 m thick, so that a few scan lines fall into each. Right is to the right of the drawing
    direction of the line.
    """
    rails = lines["guardrail"]
    if len(rails) == 0 or len(points) == 0:
        return ()
    longest = int(np.argmax(rails.length_m))
    rail = rails[longest].xyz
    chainage_m = distance_along(rail[:, :2], in_space=True)
    height_m = float(rails.height_m[longest])
    sections = []
    for place_m in chainage_m[-1] * (np.arange(n) + 0.5) / n:
        centre = _at(rail, chainage_m, place_m)
        ahead, behind = (
            _at(rail, chainage_m, place_m + step)[:2] for step in (_HALF_CHORD_M, -_HALF_CHORD_M)
        )
        along = (ahead - behind) / np.linalg.norm(ahead - behind)
        right = np.array([along[1], -along[0]])
        road = centre[2] - height_m if np.isfinite(height_m) else centre[2]
        flat = _flattened(points.xyz, centre[:2], along, right, _RAIL_HALF_THICK_M, half_width_m)
        flat[:, 1] -= road
        title = f"{rails.id[longest] or 'guardrail'}, {place_m:.0f} m from its start"
        own = np.array([[0.0, centre[2] - road]])
        truth = [] if reference is None else _crossings(reference, centre[:2], along, right, half_width_m)
        on_road = bool(np.isfinite(height_m))
        datum, limits_m = ("the road", _ABOVE_ROAD_M) if on_road else ("the rail", _ABOVE_RAIL_M)
        sections.append(Section(title, flat, [own], [t - [0.0, road] for t in truth], datum, *limits_m))
    return tuple(sections)


def cable_section(
    points: Points, lines: LineSet, reference: LineSet | None, *, half_width_m: float = 3.0
) -> Section | None:
    """Return the vertical slice along the longest cable, with all cables in it; None where there is none.

    Parameters
    ----------
    half_width_m
        Half the thickness of the slice. [m]
    """
    cables = lines["cable"]
    if len(cables) == 0 or len(points) == 0:
        return None
    longest = cables[int(np.argmax(cables.length_m))].xyz
    start, end = longest[0, :2], longest[-1, :2]
    span_m = float(np.linalg.norm(end - start))
    if span_m == 0:
        return None
    along = (end - start) / span_m
    right = np.array([along[1], -along[0]])
    middle = (start + end) / 2
    # Along the cable, the slice is thin across it: the two axes swap roles
    flat = _flattened(points.xyz, middle, right, along, half_width_m, span_m / 2 + _BEYOND_SPAN_M)
    found = _within(cables, middle, along, right, half_width_m, span_m)
    truth = (
        [] if reference is None else _within(reference["cable"], middle, along, right, half_width_m, span_m)
    )
    bottom = float(flat[:, 1].min()) if len(flat) else float(longest[:, 2].min())
    top = max([flat[:, 1].max(initial=bottom)] + [line[:, 1].max() for line in [*found, *truth]])
    down = np.array([0.0, bottom])
    title = f"{len(found)} {'cable' if len(found) == 1 else 'cables'} along a span of {span_m:.0f} m"
    return Section(
        title, flat - down, [line - down for line in found], [line - down for line in truth],
        "the lowest point", -0.5, float(top - bottom) + 1.0,
    )  # fmt: skip


def _flattened(
    xyz: FloatArray, centre: FloatArray, thin: FloatArray, wide: FloatArray, half_thin_m: float, half_wide_m: float
) -> FloatArray:  # fmt: skip
    """Return (n, 2) distance along `wide` and height [m] of the points (m, 3) in the box about `centre` (2,)."""
    reach = half_thin_m + half_wide_m
    near = np.flatnonzero((np.abs(xyz[:, 0] - centre[0]) <= reach) & (np.abs(xyz[:, 1] - centre[1]) <= reach))
    local = xyz[near, :2] - centre
    a, b = local @ thin, local @ wide
    inside = (np.abs(a) <= half_thin_m) & (np.abs(b) <= half_wide_m)
    return np.stack([b[inside], xyz[near[inside], 2]], axis=1)


def _crossings(
    lines: LineSet, centre: FloatArray, along: FloatArray, right: FloatArray, half_width_m: float
) -> list[FloatArray]:
    """Return the points, each (1, 2) [m], where guardrails cross the plane perpendicular to `along`."""
    rails = lines["guardrail"]
    places = []
    for i in range(len(rails)):
        rail = rails[i].xyz
        local = rail[:, :2] - centre
        a, b = local @ along, local @ right
        for k in np.flatnonzero((a[:-1] <= 0) != (a[1:] <= 0)):
            part = a[k] / (a[k] - a[k + 1])
            across = b[k] + part * (b[k + 1] - b[k])
            if abs(across) <= half_width_m:
                places.append(np.array([[across, rail[k, 2] + part * (rail[k + 1, 2] - rail[k, 2])]]))
    return places


def _within(
    lines: LineSet, middle: FloatArray, along: FloatArray, right: FloatArray, half_width_m: float, span_m: float
) -> list[FloatArray]:  # fmt: skip
    """Return the lines with most vertices in the slice, each (k, 2) [m], projected onto it."""
    flat = []
    for i in range(len(lines)):
        line = lines[i].xyz
        local = line[:, :2] - middle
        a, b = local @ along, local @ right
        inside = (np.abs(b) <= half_width_m) & (np.abs(a) <= span_m / 2 + _BEYOND_SPAN_M)
        if inside.mean() > 0.5:
            flat.append(np.stack([a, line[:, 2]], axis=1))
    return flat


def _at(line: FloatArray, chainage_m: FloatArray, place_m: float) -> FloatArray:
    return np.array([np.interp(place_m, chainage_m, line[:, k]) for k in range(3)])


def rail_figure(sections: Sequence[Section]) -> Figure:
    """Return a figure of slices across a rail: points, the line found (cross) and the reference (ring)."""
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
    """Return a figure of the slice along a span: points, cables found, and the reference under them."""
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
                [],
                [],
                ls="",
                marker=truth_marker,
                ms=11,
                mfc="none",
                mec="#2a9d3f",
                mew=2.5,
                label="reference",
            )
        )
    figure.legend(handles=handles, loc="outside lower center", ncols=3, frameon=False, fontsize=9)
