"""Figures of an evaluation: found, missed and wrong in plan, and scores by tolerance."""

from __future__ import annotations

import io
import math
from collections.abc import Sequence

import numpy as np

from linework.arrays import BoolArray, FloatArray
from linework.errors import extra_needed
from linework.evaluation.chains import Chains, LinePieces
from linework.evaluation.match import TIE_M, PieceMatch
from linework.evaluation.tolerance import KindMatch
from linework.evaluation.values import KindScores, Scores
from linework.imaging.picture import draw_north_arrow, draw_scale_bar

with extra_needed("reports"):
    from matplotlib.axes import Axes
    from matplotlib.collections import LineCollection
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

FOUND_COLOUR, _MISSED_COLOUR, _WRONG_COLOUR, _HIDDEN_COLOUR = "#2a9d3f", "#d1242f", "#f58b1f", "#b8b8b8"
#: Width of all figures of a report [inch]: 1210 pixels at 110 dpi, the width of the page.
WIDTH_IN = 11.0


def hits_figure(parts: Sequence[KindMatch], tolerance_m: float) -> Figure:
    """Return a plan of the reference found (green) and missed (red), and of wrong lines (orange).

    One panel per kind, rotated so that the lines run from left to right; grey is hidden reference that was not
    found.
    """
    shown = [part.match for part in parts if len(part.match.e_pieces) + len(part.match.r_pieces)]
    titles = [part.kind for part in parts if len(part.match.e_pieces) + len(part.match.r_pieces)]
    turn = main_direction([m.r_pieces.xyz[:, :2] for m in shown] + [m.e_pieces.xyz[:, :2] for m in shown])
    # One extent for all panels, so that they can be compared
    box = _box(shown, turn) if shown else ((0.0, 1.0), (0.0, 1.0))
    height = min(panel_height(box), 18.0 / max(len(shown), 1))
    figure = Figure(figsize=(WIDTH_IN, height * len(shown) + 0.6), layout="constrained", dpi=110)
    if not shown:
        figure.text(0.5, 0.5, "no lines", ha="center")
        return figure
    panels = figure.subplots(len(shown), 1, squeeze=False)[:, 0]
    for ax, match, title in zip(panels, shown, titles, strict=True):
        _draw_match(ax, match, tolerance_m, turn)
        ax.set(aspect="equal", xticks=[], yticks=[], adjustable="datalim")
        ax.margins(0)
        ax.update_datalim(np.transpose(box))
        ax.autoscale_view()
        ax.set_title(title.replace("_", " "), loc="left", fontsize=10)
        draw_scale_bar(ax)
    draw_north_arrow(panels[0], math.degrees(turn))
    legend = [
        Line2D([], [], color=colour, lw=3, label=label)
        for colour, label in (
            (FOUND_COLOUR, f"found within {tolerance_m:g} m"), (_MISSED_COLOUR, "missed"),
            (_WRONG_COLOUR, "extracted, not in the reference"), (_HIDDEN_COLOUR, "hidden, not found"),
        )
    ]  # fmt: skip
    figure.legend(handles=legend, loc="outside lower center", ncols=4, frameon=False, fontsize=9)
    return figure


def tolerance_figure(scores: Scores) -> Figure:
    """Return a figure of completeness and correctness by tolerance, a pair of curves per kind."""
    figure = Figure(figsize=(WIDTH_IN, 3.6), layout="constrained", dpi=110)
    left, right = figure.subplots(1, 2, sharey=True)
    for kind in scores.kinds:
        _draw_curve(left, kind, "completeness")
        _draw_curve(right, kind, "correctness")
    for ax, name in ((left, "completeness (observed reference)"), (right, "correctness")):
        ax.set(xlabel="tolerance [m]", ylim=(-0.03, 1.03), title=name)
        ax.grid(alpha=0.3)
    left.legend(frameon=False)
    return figure


def plot_png(figure: Figure) -> bytes:
    """Return a figure as PNG; the same figure gives the same bytes."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", metadata={"Software": None})
    return buffer.getvalue()


def _draw_curve(ax: Axes, kind: KindScores, name: str) -> None:
    points = [(at.tolerance_m, getattr(at, name)) for at in kind.curve if getattr(at, name) is not None]
    if points:
        x, y = zip(*sorted(points), strict=True)
        ax.plot(x, y, marker="o", ms=4, label=kind.kind.replace("_", " "))


def _draw_match(ax: Axes, match: PieceMatch, tolerance_m: float, turn: float) -> None:
    is_right = match.e_nearest.distance_m <= tolerance_m + TIE_M
    is_found = match.r_nearest.distance_m <= tolerance_m + TIE_M
    e, r = match.extracted, match.reference
    for chains, pieces, chosen, colour, order in (
        (r, match.r_pieces, ~is_found & ~match.r_observed, _HIDDEN_COLOUR, 1),
        (r, match.r_pieces, is_found, FOUND_COLOUR, 2),
        (e, match.e_pieces, ~is_right, _WRONG_COLOUR, 3),
        (r, match.r_pieces, ~is_found & match.r_observed, _MISSED_COLOUR, 4),
    ):
        runs = [turned_in_plan(run, turn) for run in chosen_stretches(chains, pieces, chosen)]
        ax.add_collection(LineCollection(runs, colors=colour, linewidths=2.0, zorder=order))


def chosen_stretches(chains: Chains, pieces: LinePieces, chosen: BoolArray) -> list[FloatArray]:
    """Return the stretches of lines formed by the chosen pieces, each (k, 2) in plan [m, local].

    A stretch runs from the start of its first piece to the end of its last.
    """
    index = np.flatnonzero(chosen)
    if len(index) == 0:
        return []
    breaks = (np.diff(index) > 1) | (np.diff(pieces.line[index]) != 0)
    runs = []
    for run in np.split(index, np.flatnonzero(breaks) + 1):
        half = pieces.length_m[run[[0, -1]]] / 2
        ends = chains.at(pieces.line[run[[0, -1]]], pieces.chainage_m[run[[0, -1]]] + half * [-1, 1])
        runs.append(np.concatenate([ends[:1, :2], pieces.xyz[run, :2], ends[1:, :2]]))
    return runs


def main_direction(positions: Sequence[FloatArray]) -> float:
    """Return the angle of the longest extent of all positions (k, 2), -pi/2 to pi/2 from east [rad]."""
    together = np.concatenate([np.zeros((0, 2)), *positions])
    if len(together) < 2:
        return 0.0
    _, vectors = np.linalg.eigh(np.cov(together.T))
    east, north = vectors[:, -1]
    return float(math.atan2(north, east) if east >= 0 else math.atan2(-north, -east))


def turned_in_plan(positions: FloatArray, turn: float) -> FloatArray:
    """Return positions (k, 2) in axes rotated anticlockwise by `turn` [rad]."""
    cos, sin = math.cos(turn), math.sin(turn)
    return np.stack(
        [positions[:, 0] * cos + positions[:, 1] * sin, positions[:, 1] * cos - positions[:, 0] * sin], axis=1
    )


def _box(matches: Sequence[PieceMatch], turn: float) -> tuple[tuple[float, float], tuple[float, float]]:
    pieces = [m.e_pieces.xyz for m in matches] + [m.r_pieces.xyz for m in matches]
    positions = turned_in_plan(np.concatenate(pieces)[:, :2], turn)
    (x0, y0), (x1, y1) = positions.min(axis=0), positions.max(axis=0)
    margin = max(0.03 * (x1 - x0), 2.0)
    return (float(x0 - margin), float(x1 + margin)), (float(y0 - margin), float(y1 + margin))


def panel_height(box: tuple[tuple[float, float], tuple[float, float]]) -> float:
    """Return the height [inch] of a panel of full width that shows `box` ((x0, x1), (y0, y1)) [m]."""
    (x0, x1), (y0, y1) = box
    # Room for title, scale bar and arrow on a narrow road; no panel taller than a screen
    return float(np.clip(WIDTH_IN * (y1 - y0) / (x1 - x0), 1.4, 7.0)) + 0.35
