"""Cuts across the road's lines: the shape of the ground at a kerb, the brightness at a marking."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from linework.arrays import AnyArray, FloatArray
from linework.evaluation.report.plan import COLOURS
from linework.evaluation.report.scores_figure import FOUND_COLOUR, WIDTH_IN
from linework.model.grid import Bounds
from linework.model.lines import LineSet
from linework.model.points import Points

#: How far a cut reaches to either side [m], and how thick it is: a few scan lines [m].
KERB_REACH_M, KERB_THICK_M = 0.5, 0.5
PAINT_REACH_M, PAINT_THICK_M = 1.2, 1.5
#: What is higher than this over the paint, or lower, is not the road: cars, leaves. [m]
OFF_ROAD_M = 0.2


@dataclass(frozen=True, slots=True)
class Cut:
    """A vertical cut across a line: distances from it, heights above it.

    Parameters
    ----------
    title
        Which line, and where along it.
    points
        (n, 2) float64 [m]: across, height; the line's own slope along the road is taken out.
    intensity
        (n,) as recorded, or None.
    found, truth
        Where lines pass through the cut: (k, 2) float64 [m], across and height.
    found_top, truth_top
        The same for the top edges of kerbs.
    found_width_m
        (k,) float64 [m]: width of each found line; NaN where it has none.
    """

    title: str
    points: FloatArray
    intensity: AnyArray | None
    found: FloatArray
    truth: FloatArray
    found_top: FloatArray
    truth_top: FloatArray
    found_width_m: FloatArray


@dataclass(frozen=True, slots=True)
class CutStation:
    """A place on a line with its axes.

    Parameters
    ----------
    xyz
        (3,) float64 [m, world].
    along, right
        (2,) float64: unit vectors in plan.
    slope
        Rise per metre along.
    """

    xyz: FloatArray
    along: FloatArray
    right: FloatArray
    slope: float


def kerb_cuts(
    lines: LineSet, points_in: Callable[[Bounds], Points], reference: LineSet | None, n: int = 3
) -> tuple[Cut, ...]:
    """Return cuts across the longest boundary where it was measured, at even shares of its length.

    A boundary with a kerb goes before longer ones without; () where there is no boundary.
    """
    bounds = lines.of_kind("road_boundary")
    if len(bounds) == 0:
        return ()
    longest = int(np.lexsort((bounds.length_m, bounds.form == "kerb"))[-1])
    cuts = []
    for chainage_m in measured_places(bounds, longest, n):
        place = place_on(bounds.line(longest), chainage_m)
        step = bounds.height_m[longest]
        size = f": step {100 * step:.0f} cm" if np.isfinite(step) else ""
        name = str(bounds.form[longest] or "road boundary")
        title = f"{name}, {chainage_m:.0f} m from its start{size}"
        cuts.append(_higher_to_the_right(_cut(title, place, ("road_boundary",), lines, points_in, reference)))
    return tuple(cuts)


def marking_cuts(
    lines: LineSet, points_in: Callable[[Bounds], Points], reference: LineSet | None, n: int = 3
) -> tuple[Cut, ...]:
    """Return cuts across the longest solid markings and dashes where they were measured.

    () where there are no markings.
    """
    painted = lines.take(
        ((lines.kind == "lane_marking") & (lines.pattern != "dashed")) | (lines.kind == "lane_marking_dash")
    )
    cuts = []
    for i in np.argsort(-painted.length_m, kind="stable")[:n].tolist():
        for chainage_m in measured_places(painted, i, 1):
            place = place_on(painted.line(i), chainage_m)
            width = painted.width_m[i]
            size = f": {100 * width:.0f} cm wide" if np.isfinite(width) else ""
            name = "dash" if painted.kind[i] == "lane_marking_dash" else str(painted.pattern[i] or "marking")
            cuts.append(
                _cut(
                    f"{name}{size}", place, ("lane_marking", "lane_marking_dash"), lines, points_in, reference
                )
            )
    return tuple(cuts)


def measured_places(lines: LineSet, i: int, n: int) -> list[float]:
    """Return n chainages [m] on line i, at even shares of its measured vertices; [] where all is bridged.

    >>> line = LineSet.from_lines([[[x, 0, 0] for x in range(5)]], bridged=[False, False, False, True, True])
    >>> measured_places(line, 0, 1)
    [1.0]
    """
    own = slice(lines.offsets[i], lines.offsets[i + 1])
    step = np.linalg.norm(np.diff(lines.xyz[own, :2], axis=0), axis=1)
    measured_m = np.concatenate([[0.0], np.cumsum(step)])[~lines.bridged[own]]
    if len(measured_m) == 0:
        return []
    shares = (np.arange(n) + 0.5) / n
    return sorted(set(np.quantile(measured_m, shares, method="nearest").tolist()))


def place_on(line: FloatArray, chainage_m: float) -> CutStation:
    """Return the place at a chainage of a line (k, 3), its direction that of half a metre either way."""
    step = np.linalg.norm(np.diff(line[:, :2], axis=0), axis=1)
    axis_m = np.concatenate([[0.0], np.cumsum(step)])
    here, ahead, behind = (
        np.array([np.interp(chainage_m + off_m, axis_m, line[:, k]) for k in range(3)])
        for off_m in (0.0, 0.5, -0.5)
    )
    chord = ahead - behind
    size = max(float(np.linalg.norm(chord[:2])), 1e-9)
    along = chord[:2] / size
    return CutStation(here, along, np.array([along[1], -along[0]]), float(chord[2] / size))


def _cut(
    title: str,
    place: CutStation,
    kinds: Sequence[str],
    lines: LineSet,
    points_in: Callable[[Bounds], Points],
    reference: LineSet | None,
) -> Cut:
    is_paint = "lane_marking" in kinds
    reach_m, thick_m = (PAINT_REACH_M, PAINT_THICK_M) if is_paint else (KERB_REACH_M, KERB_THICK_M)
    east, north = place.xyz[:2].tolist()
    wide = reach_m + thick_m
    points = points_in(Bounds(east - wide, north - wide, east + wide, north + wide))
    local = points.xyz - place.xyz
    a, b = local[:, :2] @ place.along, local[:, :2] @ place.right
    up = local[:, 2] - place.slope * a
    inside = (np.abs(a) <= thick_m / 2) & (np.abs(b) <= reach_m)
    if is_paint:
        inside &= np.abs(up) <= OFF_ROAD_M
    sets = [s if s is not None else LineSet.empty() for s in (lines, reference)]
    (found, width_m), (truth, _) = (_crossings(_of_kinds(s, kinds), place, reach_m) for s in sets)
    (found_top, _), (truth_top, _) = (_crossings(s.of_kind("kerb_top"), place, reach_m) for s in sets)
    intensity = None if points.intensity is None else points.intensity[inside]
    return Cut(
        title, np.stack([b, up], axis=1)[inside], intensity, found, truth, found_top, truth_top, width_m
    )


def _higher_to_the_right(cut: Cut) -> Cut:
    """Return the cut seen so that the footway or verge is to the right."""
    across, up = cut.points.T
    sides = [up[across > 0.1], up[across < -0.1]]
    if any(len(side) == 0 for side in sides) or np.median(sides[0]) >= np.median(sides[1]):
        return cut
    names = ("points", "found", "truth", "found_top", "truth_top")
    return replace(cut, **{name: getattr(cut, name) * [-1.0, 1.0] for name in names})


def _of_kinds(lines: LineSet, kinds: Sequence[str]) -> LineSet:
    """Return the lines of some kinds; a dashed line is in its dashes."""
    in_dashes = (lines.kind == "lane_marking") & (lines.pattern == "dashed")
    return lines.take(np.isin(lines.kind, kinds) & ~in_dashes)


def _crossings(lines: LineSet, place: CutStation, reach_m: float) -> tuple[FloatArray, FloatArray]:
    """Return (k, 2) across and height where lines pass through the plane across a place, and (k,) widths [m]."""
    found, width_m = [np.zeros((0, 2))], []
    for i in range(len(lines)):
        local = lines.line(i) - place.xyz
        a, b = local[:, :2] @ place.along, local[:, :2] @ place.right
        for k in np.flatnonzero((a[:-1] <= 0) != (a[1:] <= 0)):
            part = a[k] / (a[k] - a[k + 1])
            across, up = (v[k] + part * (v[k + 1] - v[k]) for v in (b, local[:, 2]))
            if abs(across) <= reach_m and abs(up) <= 1.0:
                found.append(np.array([[across, up]]))
                width_m.append(float(lines.width_m[i]))
    return np.concatenate(found), np.array(width_m)


# Pictures of cuts across kerbs and markings

#: The mean brightness is drawn over steps of this width. [m]
BRIGHTNESS_STEP_M = 0.03


def kerb_figure(cuts: Sequence[Cut]) -> Figure:
    """Draw cuts across a boundary: points, foot (cross) and top (triangle), the truth as rings."""
    figure = Figure(figsize=(WIDTH_IN, 2.9), layout="constrained", dpi=110)
    panels = figure.subplots(1, len(cuts), squeeze=False, sharey=True)[0]
    for ax, cut in zip(panels, cuts, strict=True):
        ax.plot(*cut.points.T, ".", ms=2.5, color="#555555", rasterized=True)
        for places in (cut.truth, cut.truth_top):
            ax.plot(*places.T, "o", ms=13, mfc="none", mec=FOUND_COLOUR, mew=1.6)
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
        handles.append(_handle("o", FOUND_COLOUR, "truth"))
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
            ax.axvline(place, color=FOUND_COLOUR, lw=1.6, ls=(0, (4, 3)))
        ax.set(xlim=(-PAINT_REACH_M, PAINT_REACH_M), ylim=(0, None))
        _label(ax, cut)
    panels[0].set_ylabel("intensity as recorded")
    handles = [
        _handle(".", "#8a8a8a", "laser points"),
        Line2D([], [], color="black", lw=1.3, label=f"mean over {100 * BRIGHTNESS_STEP_M:.0f} cm"),
        Line2D([], [], color=colour, lw=3, label="extracted, as wide as its paint"),
    ]
    if any(len(cut.truth) for cut in cuts):
        handles.append(Line2D([], [], color=FOUND_COLOUR, lw=1.6, ls=(0, (4, 3)), label="truth"))
    figure.legend(handles=handles, loc="outside lower center", ncols=4, frameon=False, fontsize=9)
    return figure


def _mean_steps(across_m: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return middles of steps and the mean value in each that holds points."""
    step = np.floor(across_m / BRIGHTNESS_STEP_M).astype(np.int64)
    steps, which = np.unique(step, return_inverse=True)
    mean = np.bincount(which, weights=values) / np.maximum(np.bincount(which), 1)
    return (steps + 0.5) * BRIGHTNESS_STEP_M, mean


def _label(ax: Axes, cut: Cut) -> None:
    ax.set_title(cut.title, fontsize=9)
    ax.set_xlabel("across [m]")
    ax.grid(alpha=0.3)


def _handle(marker: str, colour: str, label: str) -> Line2D:
    face = "none" if marker in "o^" else colour
    return Line2D([], [], ls="", marker=marker, ms=9, mew=2, color=colour, mfc=face, label=label)
