"""The page of what has changed between two surveys: a map, the sizes of moves, and a table by line and station.

Separate from `epochs`, which finds the changes: that needs neither matplotlib nor jinja2.
"""

from __future__ import annotations

import base64
import math
from collections import Counter
from collections.abc import Mapping, Sequence

import numpy as np

from linework.errors import extra_needed
from linework.evaluation.changes.epoch_change import EpochChange
from linework.evaluation.changes.registration import Registration
from linework.evaluation.report.scores_figure import WIDTH_IN, plot_png
from linework.evaluation.report.tables import ReportTable
from linework.model.lines import LineSet
from linework.model.lineset.shown import BACKGROUND

with extra_needed("reports"):
    from jinja2 import Environment, PackageLoader, StrictUndefined
    from matplotlib.figure import Figure

#: Colour of each status, distinct for the colour-blind (Okabe and Ito), in the order of the tables.
_COLOURS = {
    "new": "#009e73", "gone": "#d55e00", "moved": "#0072b2", "changed": "#cc79a7", "unsure": "#e69f00", "not visible": "#8b949e",
}  # fmt: skip
#: Tables with more rows than fit a screen are collapsed.
_LONG_TABLE = 25
#: Moves that are drawn, a row each: two screens. The table has them all.
_MOST_DRAWN = 60


def changes_page(
    changes: Sequence[EpochChange],
    registration: Registration,
    old: LineSet,
    new: LineSet,
    facts: Mapping[str, str],
    *,
    title: str,
) -> str:
    """Return the page as self-contained HTML; the same changes give the same text.

    Parameters
    ----------
    changes, registration
        From `compare_epochs`.
    old, new
        The lines of both surveys.
    facts
        Names and values for the head of the page.
    """
    figures = [("Map", "Grey: lines of both surveys.", _map_figure(changes, old, new))]
    moved = [change for change in changes if change.status == "moved"]
    if moved:
        caption = "New minus old after registration; bars: 1.96 standard deviations. Positive: left of the old line, up."
        if len(moved) > _MOST_DRAWN:
            caption += (
                f" The {_MOST_DRAWN} of {len(moved):,} moves that are largest in their standard deviations."
            )
        figures.append(("Moved lines", caption, _moves_figure(_largest(moved))))
    if len(registration.cells):
        caption = "What all lines do is navigation, not a change. By cells of 25 m, from west to east."
        figures.append(("Registration of the new survey", caption, _registration_figure(registration)))
    tables = [_summary_table(changes), _changes_table(changes)]
    environment = Environment(
        loader=PackageLoader("linework", "evaluation"), autoescape=True, undefined=StrictUndefined
    )
    page: str = environment.get_template("report.html.j2").render(
        title=title,
        facts=list(facts.items()),
        figures=[
            {"title": name, "caption": caption, "base64": base64.b64encode(plot_png(figure)).decode("ascii")}
            for name, caption, figure in figures
        ],
        tables=[
            {
                "title": table.title, "columns": table.columns, "rows": table.rows, "note": table.note,
                "is_long": len(table.rows) > _LONG_TABLE,
            }
            for table in tables
        ],
    )  # fmt: skip
    return page


def _summary_table(changes: Sequence[EpochChange]) -> ReportTable:
    counts = Counter((change.status, str(change.line.kind[0])) for change in changes)
    order = list(_COLOURS)
    rows = []
    for (status, kind), n in sorted(counts.items(), key=lambda item: (order.index(item[0][0]), item[0][1])):
        length_m = sum(c.length_m for c in changes if (c.status, str(c.line.kind[0])) == (status, kind))
        rows.append((status, kind, f"{n:,}", f"{length_m:,.1f}"))
    return ReportTable("In short", ("status", "kind", "stretches", "length\nm"), tuple(rows), "")


def _changes_table(changes: Sequence[EpochChange]) -> ReportTable:
    listed = sorted(changes, key=lambda c: (str(c.line.kind[0]), str(c.line.id[0]), c.from_m, c.status))
    rows = tuple(
        (
            str(c.line.id[0]), str(c.line.kind[0]), c.status, f"{c.from_m:.0f}", f"{c.to_m:.0f}",
            _with_sigma(c.across_m, c.sigma_across_m), _with_sigma(c.up_m, c.sigma_up_m), c.what,
            "" if math.isnan(c.probability) else f"{c.probability:.2f}", f"{c.line.xyz[0, 0]:.1f}", f"{c.line.xyz[0, 1]:.1f}",
        )
        for c in listed
    )  # fmt: skip
    columns = (
        "line",
        "kind",
        "status",
        "from\nm",
        "to\nm",
        "across\ncm",
        "up\ncm",
        "what",
        "probability",
        "east",
        "north",
    )
    note = "Stations are distances from the start of the line: of the new survey's for what is new, else of the old one's."
    return ReportTable("By line and station", columns, rows, note)


def _with_sigma(value_m: float, sigma_m: float) -> str:
    return "" if math.isnan(value_m) else f"{100.0 * value_m:+.1f} ± {100.0 * sigma_m:.1f}"


def _map_figure(changes: Sequence[EpochChange], old: LineSet, new: LineSet) -> Figure:
    figure = Figure(figsize=(WIDTH_IN, 5.5), layout="constrained", dpi=110)
    ax = figure.subplots()
    ax.set_facecolor(BACKGROUND)
    every = np.concatenate([old.xyz[:, :2], new.xyz[:, :2]])
    origin = every.min(axis=0) if len(every) else np.zeros(2)
    for lines in (old, new):
        for line in lines:
            ax.plot(*(line.xyz[:, :2] - origin).T, color="#a0a0a0", lw=0.5)
    for status, colour in _COLOURS.items():
        own = [change for change in changes if change.status == status]
        for number, change in enumerate(own):
            label = f"{status} ({len(own)})" if number == 0 else None
            ax.plot(*(change.line.xyz[:, :2] - origin).T, color=colour, lw=2.0, label=label)
    if changes:
        ax.legend(fontsize=8, loc="best")
    ax.set_aspect("equal", adjustable="datalim")
    ax.set_xlabel(f"east of {origin[0]:.0f} [m]")
    ax.set_ylabel(f"north of {origin[1]:.0f} [m]")
    return figure


def _largest(moved: Sequence[EpochChange]) -> list[EpochChange]:
    """Return the moves to draw: those largest in their standard deviations, of equal ones the first by line and station."""

    def size(change: EpochChange) -> float:
        both = ((change.across_m, change.sigma_across_m), (change.up_m, change.sigma_up_m))
        return max(
            (abs(value) / max(sigma, 1e-9) for value, sigma in both if math.isfinite(value)), default=0.0
        )

    return sorted(moved, key=lambda c: (-size(c), str(c.line.id[0]), c.from_m))[:_MOST_DRAWN]


def _moves_figure(moved: Sequence[EpochChange]) -> Figure:
    ids = sorted({str(change.line.id[0]) for change in moved})
    figure = Figure(figsize=(WIDTH_IN, 0.6 + 0.28 * max(len(moved), 4)), layout="constrained", dpi=110)
    panels = figure.subplots(1, 2, sharey=True)
    listed = sorted(moved, key=lambda c: (ids.index(str(c.line.id[0])), c.from_m))
    names = [f"{c.line.id[0]}, {c.from_m:.0f} to {c.to_m:.0f} m" for c in listed]
    place = np.arange(len(listed))[::-1]
    for ax, name in zip(panels, ("across", "up"), strict=True):
        size = 100.0 * np.array([getattr(c, f"{name}_m") for c in listed])
        bar = 196.0 * np.array([getattr(c, f"sigma_{name}_m") for c in listed])
        ax.errorbar(size, place, xerr=bar, fmt="o", ms=4, color=_COLOURS["moved"], lw=1.0)
        ax.axvline(0.0, color="#888888", lw=0.8)
        ax.set_xlabel(f"{name} [cm]")
        ax.grid(visible=True, axis="x", color="#eeeeee")
    panels[0].set_yticks(place, names, fontsize=7)
    return figure


def _registration_figure(registration: Registration) -> Figure:
    figure = Figure(figsize=(WIDTH_IN, 2.4), layout="constrained", dpi=110)
    ax = figure.subplots()
    order = np.lexsort((registration.cells[:, 1], registration.cells[:, 0]))
    for column, (name, colour) in enumerate((("east", "#0072b2"), ("north", "#d55e00"), ("up", "#444444"))):
        ax.plot(100.0 * registration.shift_m[order, column], ".-", ms=3, lw=0.7, color=colour, label=name)
    ax.set_ylabel("shift [cm]")
    ax.set_xlabel("cell")
    ax.grid(visible=True, color="#eeeeee")
    ax.legend(fontsize=8)
    return figure
