"""Scores as tables for people: what was found, how exactly, over the tolerance, and how honestly."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence

from rich import box
from rich.console import Console
from rich.table import Table

from linework.evaluation.scores import ErrorStats, KindScores, Scores

#: Without a terminal tables are as wide as they need to be, up to this many characters.
PLAIN_WIDTH = 160


def print_scores(scores: Scores) -> None:
    """Print all tables on stdout."""
    console = Console(file=sys.stdout, width=None if sys.stdout.isatty() else PLAIN_WIDTH, highlight=False)
    for table in score_tables(scores):
        console.print(table)


def score_tables(scores: Scores) -> Iterator[Table]:
    """Yield the tables, those without a row left out."""
    rows = [*scores.kinds, scores.overall] if len(scores.kinds) > 1 else list(scores.kinds)
    yield _found(rows, scores.tolerance_m)
    yield _exact(rows, scores.tolerance_m)
    yield _over_tolerance(rows)
    for table in (_whole_lines(rows), _attributes(rows), _honest(rows)):
        if table.row_count:
            yield table


def _found(rows: Sequence[KindScores], tolerance_m: float) -> Table:
    table = _table(
        f"Found, within {tolerance_m:g} m", "lines", "truth m", "seen m", "complete", "of all", "correct",
        "quality", "double", "gaps/km", "pieces", "bridged m",
    )  # fmt: skip
    for row in rows:
        at = row.at
        table.add_row(
            row.kind, f"{row.n_extracted} / {row.n_reference}", f"{row.reference_m:.1f}", f"{row.observed_m:.1f}",
            percent(at.completeness), percent(at.completeness_all), percent(at.correctness), percent(at.quality),
            percent(at.redundancy), number(at.gaps_per_km, 1), number(at.pieces_per_line, 2),
            f"{row.bridged_m:.1f}",
        )  # fmt: skip
    table.caption = (
        "lines: extracted / truth; complete: share of the truth that was seen; of all: share of all truth; "
        "double: redundancy; pieces: extracted lines per line found"
    )
    return table


def _exact(rows: Sequence[KindScores], tolerance_m: float) -> Table:
    table = _table(
        f"Errors in cm at stations every 0.5 m, within {tolerance_m:g} m", "met", "missed", "lateral\nbias",
        "\nRMSE", "\nmedian", "\n95 %", "height\nbias", "\nRMSE", "\nmedian", "\n95 %", "3-D\nRMSE",
        "Hausdorff\n95 % m", "\nmax m",
    )  # fmt: skip
    for row in rows:
        at = row.at
        table.add_row(
            row.kind, str(at.lateral.n), str(at.n_missed_observed), *_errors(at.lateral), *_errors(at.height),
            centimetres(at.space.rmse_m), number(row.hausdorff_p95_m, 2),
            number(row.hausdorff_m, 2),
        )  # fmt: skip
    table.caption = "lateral: positive to the left of the truth's drawing direction; missed: of the stations that were seen"
    return table


def _over_tolerance(rows: Sequence[KindScores]) -> Table:
    table = _table(
        "Over the tolerance",
        "within m",
        "complete",
        "of all",
        "correct",
        "quality",
        "double",
        "lateral RMSE cm",
    )
    for row in rows:
        for i, at in enumerate(row.curve):
            table.add_row(
                row.kind if i == 0 else "", f"{at.tolerance_m:g}", percent(at.completeness),
                percent(at.completeness_all), percent(at.correctness), percent(at.quality),
                percent(at.redundancy), centimetres(at.lateral.rmse_m), end_section=at is row.curve[-1],
            )  # fmt: skip
    return table


def _whole_lines(rows: Sequence[KindScores]) -> Table:
    limits_m = sorted({limit_m for row in rows for limit_m in row.chamfer_ap})
    table = _table("Whole lines: average precision by Chamfer distance", *(f"{b:g} m" for b in limits_m))
    for row in rows:
        if row.n_reference:
            table.add_row(row.kind, *(percent(row.chamfer_ap[b]) for b in limits_m))
    return table


def _attributes(rows: Sequence[KindScores]) -> Table:
    table = _table("Values of the lines in cm", "of", "lines", "bias", "RMSE", "median", "95 %")
    for row in rows:
        for name, errors in row.attributes.items():
            if errors.n:
                table.add_row(row.kind, name.removesuffix("_m"), str(errors.n), *_errors(errors))
    return table


def _honest(rows: Sequence[KindScores]) -> Table:
    table = _table(
        "Honest? rms(error / sigma) per third of sigma, and confidence per 10 m", "sigma xy", "sigma z",
        "calibration error", "AUC", "pieces", "right",
    )  # fmt: skip
    for row in rows:
        c = row.confidence
        if not (row.sigma_xy or row.sigma_z or c.n_pieces):
            continue
        ratios = (
            " / ".join(f"{t.rms_ratio:.2f}" for t in thirds) or "-" for thirds in (row.sigma_xy, row.sigma_z)
        )
        table.add_row(
            row.kind,
            *ratios,
            percent(c.calibration_error),
            number(c.auc, 3),
            str(c.n_pieces),
            str(c.n_correct),
        )
    return table


def _table(title: str, *columns: str) -> Table:
    table = Table(
        title=title, box=box.SIMPLE_HEAD, title_justify="left", caption_justify="left", pad_edge=False
    )
    table.add_column("kind", no_wrap=True)
    for name in columns:
        table.add_column(name, justify="right")
    return table


def _errors(errors: ErrorStats) -> list[str]:
    values = (errors.bias_m, errors.rmse_m, errors.median_m, errors.p95_m)
    return [centimetres(value) for value in values]


def percent(share: float | None) -> str:
    """Return a share as text.

    >>> percent(0.98765), percent(None)
    ('98.8 %', '-')
    """
    return "-" if share is None else f"{_no_minus_zero(100 * share, 1)} %"


def centimetres(length_m: float | None) -> str:
    """Return a length as text in centimetres.

    >>> centimetres(0.0123)
    '1.2'
    """
    return "-" if length_m is None else _no_minus_zero(100 * length_m, 1)


def number(value: float | None, decimals: int) -> str:
    """Return a number as text.

    >>> number(1.0, 2)
    '1.00'
    """
    return "-" if value is None else f"{value:.{decimals}f}"


def _no_minus_zero(value: float, decimals: int) -> str:
    return f"{round(value, decimals) + 0.0:.{decimals}f}"
