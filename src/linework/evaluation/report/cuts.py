"""Cuts across lines and their figures: the shape of the ground at a kerb, the intensity at a marking.

Separate from sections.py, as a cut follows the slope of its line and is read at single stations.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from linework.arrays import AnyArray, FloatArray, distance_along
from linework.errors import extra_needed
from linework.evaluation.report.plan import COLOURS
from linework.evaluation.report.scores_figure import FOUND_COLOUR, WIDTH_IN
from linework.model.grid import Bounds
from linework.model.lines import LineSet
from linework.model.points import Points

with extra_needed("reports"):
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

#: Reach of a cut to either side, and its thickness [m]: a few scan lines.
_KERB_REACH_M, _KERB_THICK_M = 0.5, 0.5
_PAINT_REACH_M, _PAINT_THICK_M = 1.2, 1.5
#: Points farther than this above or below the paint are not road but cars or leaves [m].
_OFF_ROAD_M = 0.2
#: Half the chord that gives the direction of a line at a station [m].
_HALF_CHORD_M = 0.5
#: Points nearer the line than this do not decide which side is higher [m]: they are on the face of the kerb.
_FACE_M = 0.1
#: Lines that cross a cut farther above or below than this belong to another road [m].
_OTHER_LEVEL_M = 1.0
#: Width of the steps over which the mean intensity is drawn [m]: a quarter of the narrowest marking.
_INTENSITY_STEP_M = 0.03


@dataclass(frozen=True, slots=True)
class Cut:
    """A vertical cut across a line: distances to the side and heights above the line.

    Parameters
    ----------
    title
        The line and the chainage.
    points
        (n, 2) [m]: distance across, height; the longitudinal slope of the line is removed.
    intensity
        (n,) as recorded, or None.
    found, truth
        (k, 2) [m]: distance across and height of the lines where they cross the cut.
    found_top, truth_top
        The same for the top edges of kerbs.
    found_width_m
        (k,) [m]: width of each line found; NaN where it has none.
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
    """A station on a line with its axes.

    Parameters
    ----------
    xyz
        (3,) [m, world].
    along, right
        (2,) unit vectors in plan.
    slope
        Rise per metre along the line.
    """

    xyz: FloatArray
    along: FloatArray
    right: FloatArray
    slope: float


def kerb_cuts(
    lines: LineSet, points_in: Callable[[Bounds], Points], reference: LineSet | None, n: int = 3
) -> tuple[Cut, ...]:
    """Return `n` cuts across the longest road boundary, evenly spaced over its measured vertices.

    Boundaries with a kerb take precedence over longer ones without; () where there is no boundary.
    """
    bounds = lines["road_boundary"]
    if len(bounds) == 0:
        return ()
    longest = int(np.lexsort((bounds.length_m, bounds.form == "kerb"))[-1])
    cuts = []
    for chainage_m in measured_chainages(bounds, longest, n):
        station = station_at(bounds[longest].xyz, chainage_m)
        step = bounds.height_m[longest]
        size = f": step {100 * step:.0f} cm" if np.isfinite(step) else ""
        name = str(bounds.form[longest] or "road boundary")
        title = f"{name}, {chainage_m:.0f} m from its start{size}"
        cuts.append(
            _higher_to_the_right(_cut(title, station, ("road_boundary",), lines, points_in, reference))
        )
    return tuple(cuts)


def marking_cuts(
    lines: LineSet, points_in: Callable[[Bounds], Points], reference: LineSet | None, n: int = 3
) -> tuple[Cut, ...]:
    """Return one cut each across the `n` longest solid markings and dashes; () where there are none."""
    painted = lines.take(
        ((lines.kind == "lane_marking") & (lines.pattern != "dashed")) | (lines.kind == "lane_marking_dash")
    )
    cuts = []
    for i in np.argsort(-painted.length_m, kind="stable")[:n].tolist():
        for chainage_m in measured_chainages(painted, i, 1):
            station = station_at(painted[i].xyz, chainage_m)
            width = painted.width_m[i]
            size = f": {100 * width:.0f} cm wide" if np.isfinite(width) else ""
            name = "dash" if painted.kind[i] == "lane_marking_dash" else str(painted.pattern[i] or "marking")
            cuts.append(
                _cut(
                    f"{name}{size}",
                    station,
                    ("lane_marking", "lane_marking_dash"),
                    lines,
                    points_in,
                    reference,
                )
            )
    return tuple(cuts)


def measured_chainages(lines: LineSet, i: int, n: int) -> list[float]:
    """Return `n` chainages [m] on line `i`, evenly spread over its measured vertices; [] where all is bridged.

    >>> line = LineSet.from_lines([[[x, 0, 0] for x in range(5)]], bridged=[False, False, False, True, True])
    >>> measured_chainages(line, 0, 1)
    [1.0]
    """
    own = slice(lines.offsets[i], lines.offsets[i + 1])
    measured_m = distance_along(lines.xyz[own, :2], in_space=True)[~lines.bridged[own]]
    if len(measured_m) == 0:
        return []
    shares = (np.arange(n) + 0.5) / n
    return sorted(set(np.quantile(measured_m, shares, method="nearest").tolist()))


def station_at(line: FloatArray, chainage_m: float) -> CutStation:
    """Return the station at a chainage of a line (k, 3) [m, world]; its direction is that of a chord of 1 m."""
    axis_m = distance_along(line[:, :2], in_space=True)
    here, ahead, behind = (
        np.array([np.interp(chainage_m + off_m, axis_m, line[:, k]) for k in range(3)])
        for off_m in (0.0, _HALF_CHORD_M, -_HALF_CHORD_M)
    )
    chord = ahead - behind
    size = max(float(np.linalg.norm(chord[:2])), 1e-9)
    along = chord[:2] / size
    return CutStation(here, along, np.array([along[1], -along[0]]), float(chord[2] / size))


def _cut(
    title: str,
    station: CutStation,
    kinds: Sequence[str],
    lines: LineSet,
    points_in: Callable[[Bounds], Points],
    reference: LineSet | None,
) -> Cut:
    is_paint = "lane_marking" in kinds
    reach_m, thick_m = (_PAINT_REACH_M, _PAINT_THICK_M) if is_paint else (_KERB_REACH_M, _KERB_THICK_M)
    east, north = station.xyz[:2].tolist()
    wide = reach_m + thick_m
    points = points_in(Bounds(east - wide, north - wide, east + wide, north + wide))
    local = points.xyz - station.xyz
    a, b = local[:, :2] @ station.along, local[:, :2] @ station.right
    up = local[:, 2] - station.slope * a
    inside = (np.abs(a) <= thick_m / 2) & (np.abs(b) <= reach_m)
    if is_paint:
        inside &= np.abs(up) <= _OFF_ROAD_M
    sets = [s if s is not None else LineSet.empty() for s in (lines, reference)]
    (found, width_m), (truth, _) = (_crossings(_of_kinds(s, kinds), station, reach_m) for s in sets)
    (found_top, _), (truth_top, _) = (_crossings(s["kerb_top"], station, reach_m) for s in sets)
    intensity = None if points.intensity is None else points.intensity[inside]
    return Cut(
        title, np.stack([b, up], axis=1)[inside], intensity, found, truth, found_top, truth_top, width_m
    )


def _higher_to_the_right(cut: Cut) -> Cut:
    """Return the cut, mirrored where necessary so that the footway or verge is to the right."""
    across, up = cut.points.T
    sides = [up[across > _FACE_M], up[across < -_FACE_M]]
    if any(len(side) == 0 for side in sides) or np.median(sides[0]) >= np.median(sides[1]):
        return cut
    names = ("points", "found", "truth", "found_top", "truth_top")
    return replace(cut, **{name: getattr(cut, name) * [-1.0, 1.0] for name in names})


def _of_kinds(lines: LineSet, kinds: Sequence[str]) -> LineSet:
    """Return the lines of these kinds; a dashed marking is represented by its dashes."""
    in_dashes = (lines.kind == "lane_marking") & (lines.pattern == "dashed")
    return lines.take(np.isin(lines.kind, kinds) & ~in_dashes)


def _crossings(lines: LineSet, station: CutStation, reach_m: float) -> tuple[FloatArray, FloatArray]:
    """Return where lines cross the plane of a cut: (k, 2) distance across and height [m], and (k,) widths [m]."""
    found, width_m = [np.zeros((0, 2))], []
    for i in range(len(lines)):
        local = lines[i].xyz - station.xyz
        a, b = local[:, :2] @ station.along, local[:, :2] @ station.right
        for k in np.flatnonzero((a[:-1] <= 0) != (a[1:] <= 0)):
            part = a[k] / (a[k] - a[k + 1])
            across, up = (v[k] + part * (v[k + 1] - v[k]) for v in (b, local[:, 2]))
            if abs(across) <= reach_m and abs(up) <= _OTHER_LEVEL_M:
                found.append(np.array([[across, up]]))
                width_m.append(float(lines.width_m[i]))
    return np.concatenate(found), np.array(width_m)


def kerb_figure(cuts: Sequence[Cut]) -> Figure:
    """Return a figure of cuts across a boundary: points, foot (cross), top (triangle), reference (rings)."""
    figure = Figure(figsize=(WIDTH_IN, 2.9), layout="constrained", dpi=110)
    panels = figure.subplots(1, len(cuts), squeeze=False, sharey=True)[0]
    for ax, cut in zip(panels, cuts, strict=True):
        ax.plot(*cut.points.T, ".", ms=2.5, color="#555555", rasterized=True)
        for crossings in (cut.truth, cut.truth_top):
            ax.plot(*crossings.T, "o", ms=13, mfc="none", mec=FOUND_COLOUR, mew=1.6)
        ax.plot(*cut.found.T, "x", ms=9, color=COLOURS["road_boundary"], mew=1.8)
        ax.plot(*cut.found_top.T, "^", ms=8, mfc="none", mec=COLOURS["road_boundary"], mew=1.8)
        ax.set(aspect="equal", xlim=(-_KERB_REACH_M, _KERB_REACH_M), ylim=(-0.2, 0.3))
        _label(ax, cut)
    panels[0].set_ylabel("height above the line [m]")
    handles = [
        _handle(".", "#555555", "laser points"),
        _handle("x", COLOURS["road_boundary"], "foot or edge, extracted"),
        _handle("^", COLOURS["road_boundary"], "kerb top, extracted"),
    ]
    if any(len(cut.truth) for cut in cuts):
        handles.append(_handle("o", FOUND_COLOUR, "reference"))
    figure.legend(handles=handles, loc="outside lower center", ncols=4, frameon=False, fontsize=9)
    return figure


def marking_figure(cuts: Sequence[Cut]) -> Figure:
    """Return a figure of the intensity across markings: points, their mean, and lines with their widths."""
    figure = Figure(figsize=(WIDTH_IN, 3.4), layout="constrained", dpi=110)
    panels = figure.subplots(1, len(cuts), squeeze=False)[0]
    colour = COLOURS["lane_marking"]
    for ax, cut in zip(panels, cuts, strict=True):
        assert cut.intensity is not None
        ax.plot(cut.points[:, 0], cut.intensity, ".", ms=2.0, color="#8a8a8a", rasterized=True)
        ax.plot(*_mean_steps(cut.points[:, 0], cut.intensity), "-", lw=1.3, color="black")
        for across_m, width_m in zip(cut.found[:, 0].tolist(), cut.found_width_m.tolist(), strict=True):
            ax.axvline(across_m, color=colour, lw=1.6)
            if np.isfinite(width_m):
                ax.axvspan(across_m - width_m / 2, across_m + width_m / 2, color=colour, alpha=0.3, lw=0)
        for across_m in cut.truth[:, 0].tolist():
            ax.axvline(across_m, color=FOUND_COLOUR, lw=1.6, ls=(0, (4, 3)))
        ax.set(xlim=(-_PAINT_REACH_M, _PAINT_REACH_M), ylim=(0, None))
        _label(ax, cut)
    panels[0].set_ylabel("recorded intensity")
    handles = [
        _handle(".", "#8a8a8a", "laser points"),
        Line2D([], [], color="black", lw=1.3, label=f"mean over {100 * _INTENSITY_STEP_M:.0f} cm"),
        Line2D([], [], color=colour, lw=3, label="extracted, with its width"),
    ]
    if any(len(cut.truth) for cut in cuts):
        handles.append(Line2D([], [], color=FOUND_COLOUR, lw=1.6, ls=(0, (4, 3)), label="reference"))
    figure.legend(handles=handles, loc="outside lower center", ncols=4, frameon=False, fontsize=9)
    return figure


def _mean_steps(across_m: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the middles of the steps that hold points [m], and the mean value in each."""
    step = np.floor(across_m / _INTENSITY_STEP_M).astype(np.int64)
    steps, which = np.unique(step, return_inverse=True)
    mean = np.bincount(which, weights=values) / np.maximum(np.bincount(which), 1)
    return (steps + 0.5) * _INTENSITY_STEP_M, mean


def _label(ax: Axes, cut: Cut) -> None:
    ax.set_title(cut.title, fontsize=9)
    ax.set_xlabel("across [m]")
    ax.grid(alpha=0.3)


def _handle(marker: str, colour: str, label: str) -> Line2D:
    face = "none" if marker in "o^" else colour
    return Line2D([], [], ls="", marker=marker, ms=9, mew=2, color=colour, mfc=face, label=label)
