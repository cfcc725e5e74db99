"""Figures of a located drive: the track with its outages, sigmas over time, residuals of the fixes."""

from __future__ import annotations

import base64
import html

import numpy as np

from linework.arrays import BoolArray, FloatArray, IntArray
from linework.errors import extra_needed
from linework.evaluation.report.scores_figure import plot_png
from linework.imaging.picture import draw_scale_bar
from linework.navigation.located import LocatedDrive

with extra_needed("reports"):
    from matplotlib.axes import Axes
    from matplotlib.collections import LineCollection
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

_WITH_FIXES, _OUTAGE, _OUTLIER = "#1f77b4", "#e06c00", "#d1242f"
#: Most poses drawn: more than the figure has pixels show nothing more.
_MOST_POINTS = 4000


def track_figure(located: LocatedDrive) -> Figure:
    """Return a figure of the track (outages in orange), and of sigmas and residuals of the fixes over time."""
    figure = Figure(figsize=(11.0, 9.0), layout="constrained", dpi=110)
    grid = figure.add_gridspec(3, 1, height_ratios=(2.4, 1.0, 1.0))
    plan, sigma, fixes = (figure.add_subplot(grid[i]) for i in range(3))
    fixes.sharex(sigma)
    _draw_plan(plan, located)
    _draw_sigmas(sigma, located)
    _draw_residuals(fixes, located)
    legend = [
        Line2D([], [], color=_WITH_FIXES, lw=2, label="with fixes"),
        Line2D([], [], color=_OUTAGE, lw=2, label="outage, dead reckoning"),
        Line2D([], [], color=_OUTLIER, lw=0, marker="x", label="outlier"),
    ]
    figure.legend(handles=legend, loc="outside lower center", ncols=3, frameon=False, fontsize=9)
    return figure


def track_page(located: LocatedDrive, rows: list[tuple[str, str]]) -> str:
    """Return a self-contained HTML page of the figure and a table of results."""
    picture = base64.b64encode(plot_png(track_figure(located))).decode("ascii")
    table = "".join(f"<tr><th>{html.escape(a)}</th><td>{html.escape(b)}</td></tr>" for a, b in rows)
    warnings = "".join(f"<li>{html.escape(w)}</li>" for w in located.warnings)
    return (
        '<!doctype html><html lang="en"><head><meta charset="utf-8"><title>linework locate</title>'
        "<style>body{font:15px sans-serif;max-width:75em;margin:2em auto}th{text-align:left;padding-right:2em}"
        "img{max-width:100%}</style></head><body><h1>Trajectory</h1>"
        f"<table>{table}</table>{f'<ul>{warnings}</ul>' if warnings else ''}"
        f'<img alt="track, sigmas, residuals" src="data:image/png;base64,{picture}"></body></html>\n'
    )


def _thinned(located: LocatedDrive) -> IntArray:
    """Return the indices of the poses to draw, (k,) int64, evenly spread."""
    n = len(located.trajectory)
    return np.unique(np.linspace(0, n - 1, min(n, _MOST_POINTS)).astype(np.int64))


def _in_outage(time_s: FloatArray, located: LocatedDrive) -> BoolArray:
    inside = np.zeros(len(time_s), dtype=bool)
    for start, end in located.outages_s:
        inside |= (time_s >= start) & (time_s <= end)
    return inside


def _draw_plan(ax: Axes, located: LocatedDrive) -> None:
    picked = _thinned(located)
    time, xy = located.trajectory.time_s[picked], located.trajectory.xyz[picked, :2]
    segments = np.stack([xy[:-1], xy[1:]], axis=1)
    middle = 0.5 * (time[1:] + time[:-1])
    colours = np.where(_in_outage(middle, located), _OUTAGE, _WITH_FIXES)
    joined = ~_over_hole(time, located)
    ax.add_collection(LineCollection(list(segments[joined]), colors=colours[joined].tolist(), lw=1.6))
    ax.set(aspect="equal", xticks=[], yticks=[], adjustable="datalim", title="track")
    ax.autoscale_view()
    draw_scale_bar(ax)


def _draw_sigmas(ax: Axes, located: LocatedDrive) -> None:
    picked = _thinned(located)
    for poses, style, label in ((located.trajectory, "-", "smoothed"), (located.forward, ":", "real time")):
        time, sigma = poses.time_s[picked], poses.sigma_xyz_m
        assert sigma is not None
        ax.plot(
            *_broken(time, np.hypot(*sigma[picked, :2].T), located), style, color="black", lw=1, label=label
        )
    _shade(ax, located)
    ax.set(ylabel="horizontal sigma [m]", yscale="log")
    ax.legend(loc="upper right", fontsize=8)


def _draw_residuals(ax: Axes, located: LocatedDrive) -> None:
    time, good = located.fix_time_s - _start(located), ~located.is_outlier
    for i, name, colour in ((0, "east", "#1f77b4"), (1, "north", "#2a9d3f"), (2, "up", "#8a8a8a")):
        share = located.residual_m[:, i] / located.residual_sigma_m[:, i]
        ax.plot(time[good], share[good], ".", ms=2, color=colour, label=name)
    at = time[~good]
    ax.plot(at, np.zeros(len(at)), "x", ms=4, color=_OUTLIER)
    _shade(ax, located)
    ax.set(xlabel=f"time [s] since {_start(located):.1f}", ylabel="residual of fixes [sigma]", ylim=(-5, 5))
    ax.legend(loc="upper right", fontsize=8, ncols=3, markerscale=4)


def _shade(ax: Axes, located: LocatedDrive) -> None:
    for start, end in located.outages_s:
        ax.axvspan(start - _start(located), end - _start(located), color=_OUTAGE, alpha=0.15, lw=0)


def _over_hole(time: FloatArray, located: LocatedDrive) -> BoolArray:
    """Return (k - 1,) bool: the step between two drawn poses spans a time without poses."""
    known = located.trajectory.time_s
    holes = np.flatnonzero(np.diff(known) > 1.5 * np.median(np.diff(known)))
    n_before = np.searchsorted(known[holes], time)
    return np.asarray(np.diff(n_before) > 0)


def _broken(time: FloatArray, values: FloatArray, located: LocatedDrive) -> tuple[FloatArray, FloatArray]:
    """Return times since the start [s] and values, with NaN where there are no poses."""
    values = values.copy()
    values[1:][_over_hole(time, located)] = np.nan
    return time - _start(located), values


def _start(located: LocatedDrive) -> float:
    return float(located.trajectory.time_s[0])
