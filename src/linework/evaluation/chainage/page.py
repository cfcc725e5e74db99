"""The page of a report by chainage: plots along the route, a map, and the worst places with their cross-sections.

Separate from `rows`, which it shows: rows need neither matplotlib nor jinja2.
"""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from linework.errors import extra_needed
from linework.evaluation.chainage.rows import ChainageReport, ChainageRow
from linework.evaluation.chainage.standards import limit_for
from linework.evaluation.report.scores_figure import WIDTH_IN, plot_png
from linework.lines.crosscuts import Axis
from linework.model.lines import LineSet
from linework.model.lineset.shown import BACKGROUND, colour_text

with extra_needed("reports"):
    from jinja2 import Environment, PackageLoader, StrictUndefined
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.patheffects import withStroke

#: What is drawn along the chainage: topic, quantity, statistic, title with its unit.
_PLOTS = (
    ("guardrail", "top_height", "min", "guardrail: lowest top height above the edge [m]"),
    ("kerb", "upstand", "mean", "kerb: mean upstand [m]"),
    ("clearance", "clearance", "min", "clearance: lowest wire above each lane [m]"),
    ("road", "lane_width", "mean", "lane width [m]"),
    ("road", "crossfall", "mean", "crossfall to the right [%]"),
    ("marking", "remaining_paint", "mean", "markings: paint that is left [%]"),
    ("marking", "missing_dashes", "sum", "missing dashes [number]"),
)
#: Intervals in which nothing of a quantity is known, and those in which it is hidden on some of the lines.
_HIDDEN, _PARTLY_HIDDEN = "#c4c4c4", "#ececec"
_SIDES = {"left": ("#0072b2", "o"), "right": ("#d55e00", "s"), "axis": ("#444444", "^")}
#: Rim of the lines on the map: yellow does not stand out from light ground without one.
_RIM = "#555555"
#: Places listed as the worst.
_WORST = 10


def chainage_page(report: ChainageReport, lines: LineSet, facts: Mapping[str, str], *, title: str) -> str:
    """Return the page as self-contained HTML; the same report gives the same text."""
    worst = worst_rows(report)
    figures = [("Map", _png(_map_figure(report, lines, worst)))]
    for axis in report.axes:
        shown = [plot for plot in _PLOTS if _shown(report.rows, *plot[:3], axis.name)]
        known = [p for p in shown if any(r.value is not None for r in _shown(report.rows, *p[:3], axis.name))]
        # A plot of nothing says less than its title
        hidden = ", ".join(plot[3].rsplit(" [", 1)[0] for plot in shown if plot not in known)
        if known:
            title_of_plots = f"Along {axis.name}" + (f" (hidden everywhere: {hidden})" if hidden else "")
            figures.append((title_of_plots, _png(_plots_figure(report, axis, known))))
    if worst:
        figures.append(("Cross-sections of the worst places", _png(_sections_figure(report, worst))))
    environment = Environment(
        loader=PackageLoader("linework", "evaluation"), autoescape=True, undefined=StrictUndefined
    )
    page: str = environment.get_template("chainage.html.j2").render(
        title=title, facts=list(facts.items()), figures=figures, worst=[_texts(row) for row in worst],
        rows=[_texts(row) for row in report.rows],
    )  # fmt: skip
    return page


def worst_rows(report: ChainageReport) -> list[ChainageRow]:
    """Return the rows farthest beyond their limit, relative to it; one per place and quantity."""
    found: dict[tuple[Any, ...], tuple[float, ChainageRow]] = {}
    for row in report.rows:
        limit = limit_for(report.standard, row.topic, row.quantity)
        if row.verdict not in ("below", "above") or limit is None or row.value is None:
            continue
        bound = limit.least if row.verdict == "below" else limit.most
        beyond = abs(row.value - (bound or 0.0)) / max(abs(bound or 0.0), 1e-9)
        key = (row.route, row.from_m, row.side, row.topic, row.quantity)
        if key not in found or beyond > found[key][0]:
            found[key] = (beyond, row)
    return [row for _, row in sorted(found.values(), key=lambda pair: -pair[0])[:_WORST]]


def _png(figure: Figure) -> str:
    return base64.b64encode(plot_png(figure)).decode()


def _texts(row: ChainageRow) -> dict[str, str]:
    value = "unknown" if row.value is None else f"{row.value:.3f}"
    sigma = "" if row.sigma is None else f"{row.sigma:.3f}"
    return {
        "route": row.route, "from": f"{row.from_m:.0f}", "to": f"{row.to_m:.0f}", "side": row.side, "topic": row.topic,
        "what": f"{row.quantity.replace('_', ' ')} ({row.statistic})", "value": value, "sigma": sigma, "unit": row.unit,
        "n": str(row.n), "measured": f"{100 * row.measured_share:.0f} %", "limit": row.limit_source, "verdict": row.verdict,
        "line": row.line,
    }  # fmt: skip


def _shown(
    rows: Sequence[ChainageRow], topic: str, quantity: str, statistic: str, route: str
) -> list[ChainageRow]:
    return [
        r for r in rows if (r.topic, r.quantity, r.statistic, r.route) == (topic, quantity, statistic, route)
    ]


def _plots_figure(report: ChainageReport, axis: Axis, plots: Sequence[tuple[str, str, str, str]]) -> Figure:
    figure = Figure(figsize=(WIDTH_IN, 1.9 * len(plots) + 0.5), layout="constrained", dpi=110)
    panels = figure.subplots(len(plots), 1, squeeze=False, sharex=True)[:, 0]
    for ax, (topic, quantity, statistic, title) in zip(panels, plots, strict=True):
        rows = _shown(report.rows, topic, quantity, statistic, axis.name)
        for side, (colour, marker) in _SIDES.items():
            own = [r for r in rows if r.side == side]
            known = [(r, r.value) for r in own if r.value is not None]
            if known:
                at = [(r.from_m + r.to_m) / 2 for r, _ in known]
                spread = [r.sigma or 0.0 for r, _ in known]
                ax.errorbar(
                    at, [v for _, v in known], spread, fmt=marker, ms=3.5, color=colour, lw=0.8, label=side
                )
        known_m = {(r.from_m, r.to_m) for r in rows if r.value is not None}
        for interval in {(r.from_m, r.to_m) for r in rows if r.value is None}:
            ax.axvspan(*interval, color=_PARTLY_HIDDEN if interval in known_m else _HIDDEN, lw=0)
        if quantity == "missing_dashes":
            ax.set_ylim(-0.5, max([r.value for r in rows if r.value is not None] + [1.0]) + 0.5)
            ax.yaxis.get_major_locator().set_params(integer=True)
        limit = limit_for(report.standard, topic, quantity)
        for bound in (limit.least, limit.most) if limit else ():
            if bound is not None:
                ax.axhline(bound, color="#b00020", lw=0.9, ls="--")
        ax.set_title(title, fontsize=9, loc="left")
        ax.grid(visible=True, color="#eeeeee")
        ax.set_xlim(axis.station_m[0], axis.station_m[-1])
        if ax.get_legend_handles_labels()[1]:
            ax.legend(fontsize=7, loc="upper right")
    panels[-1].set_xlabel(
        f"chainage along {axis.name} [m]; grey: hidden, unknown; light grey: hidden on some lines; dashed: limit"
    )
    return figure


def _map_figure(report: ChainageReport, lines: LineSet, worst: Sequence[ChainageRow]) -> Figure:
    figure = Figure(figsize=(WIDTH_IN, 5.5), layout="constrained", dpi=110)
    ax = figure.subplots()
    ax.set_facecolor(BACKGROUND)
    origin = lines.xyz[:, :2].min(axis=0) if len(lines.xyz) else np.zeros(2)
    rim = withStroke(linewidth=2.0, foreground=_RIM)
    for kind in lines.kinds:
        for line in lines[kind]:
            ax.plot(*(line.xyz[:, :2] - origin).T, color=colour_text(kind), lw=1.0, path_effects=[rim])
    for axis in report.axes:
        xy = axis.xyz[:, :2] - origin
        ax.plot(*xy.T, color="#333333", lw=0.6, ls=":")
        step = max(round(len(xy) / 8), 1)
        for i in range(0, len(xy), step):
            ax.annotate(f"{axis.station_m[i]:.0f}", xy[i], fontsize=7)
    for row in worst:
        place = _station(report, row)[1] - origin
        ax.plot(*place, "o", ms=9, mfc="none", mec="#b00020", mew=1.5)
    ax.set_aspect("equal", adjustable="datalim")
    ax.set_xlabel(f"east of {origin[0]:.0f} [m]")
    ax.set_ylabel(f"north of {origin[1]:.0f} [m]")
    return figure


def _station(report: ChainageReport, row: ChainageRow) -> tuple[int, Any]:
    """Return the station in the middle of a row's interval, and its place in plan."""
    axis = next(a for a in report.axes if a.name == row.route)
    i = int(np.argmin(np.abs(axis.station_m - (row.from_m + row.to_m) / 2)))
    return i, axis.xyz[i, :2]


def _sections_figure(report: ChainageReport, worst: Sequence[ChainageRow]) -> Figure:
    n_rows = -(-len(worst) // 2)
    figure = Figure(figsize=(WIDTH_IN, 2.1 * n_rows + 0.3), layout="constrained", dpi=110)
    panels = figure.subplots(n_rows, 2, squeeze=False).ravel()
    for ax, row in zip(panels, worst, strict=False):
        _draw_section(ax, report, row)
    for ax in panels[len(worst) :]:
        ax.set_axis_off()
    return figure


def _draw_section(ax: Axes, report: ChainageReport, row: ChainageRow) -> None:
    number = next(i for i, a in enumerate(report.axes) if a.name == row.route)
    here = report.crossings[number][_station(report, row)[0]]
    ground = [c for c in here if c.kind in ("lane_marking", "road_boundary")]
    ax.plot([c.offset_m for c in ground], [c.up_m for c in ground], color="#999999", lw=1)
    for c in here:
        ax.errorbar(
            c.offset_m, c.up_m, c.sigma_z_m, fmt="o", ms=4, color=colour_text(c.kind), mec="#333333", mew=0.4
        )
    ax.set_title(
        f"{row.route} {row.from_m:.0f} to {row.to_m:.0f} m, {row.side}: {row.quantity.replace('_', ' ')}"
        f" {row.value:.3f} {row.unit}", fontsize=8, loc="left",
    )  # fmt: skip
    ax.set_facecolor(BACKGROUND)
    ax.invert_xaxis()
    ax.tick_params(labelsize=7)
