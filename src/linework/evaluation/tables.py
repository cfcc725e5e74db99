"""Scores as tables of text, for the terminal and for the report alike."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from linework.evaluation.detail_tables import bridged_table, dashes_table, groups_table, labels_table
from linework.evaluation.scores import KindScores, Scores
from linework.evaluation.table_texts import TextTable, centimetres, error_texts, number, percent, ratio_texts


def score_tables(scores: Scores) -> Iterator[TextTable]:
    """Yield the tables of an evaluation: found, exact, over the tolerance, then those that have a row."""
    rows = [*scores.kinds, scores.overall] if len(scores.kinds) != 1 else list(scores.kinds)
    yield _found(rows, scores.tolerance_m)
    yield _exact(rows, scores.tolerance_m)
    yield _over_tolerance(rows)
    for table in (
        groups_table(rows), labels_table(rows), dashes_table(rows), _attributes(rows), bridged_table(rows),
        _whole_lines(rows), _honest(rows),
    ):  # fmt: skip
        if table.rows:
            yield table


def _found(rows: Sequence[KindScores], tolerance_m: float) -> TextTable:
    columns = (
        "kind", "lines", "truth m", "seen m", "complete", "of all", "correct", "quality", "double", "gaps/km",
        "pieces", "bridged m",
    )  # fmt: skip
    texts = [
        (
            row.kind, f"{row.n_extracted} / {row.n_reference}", f"{row.reference_m:.1f}", f"{row.observed_m:.1f}",
            percent(row.at.completeness), percent(row.at.completeness_all), percent(row.at.correctness),
            percent(row.at.quality), percent(row.at.redundancy), number(row.at.gaps_per_km, 1),
            number(row.at.pieces_per_line, 2), f"{row.bridged_m:.1f}",
        )
        for row in rows
    ]  # fmt: skip
    note = (
        "lines: extracted / truth; complete: share of the truth that was seen; of all: share of all truth; "
        "double: redundancy; pieces: extracted lines per line found"
    )
    return TextTable(f"Found, within {tolerance_m:g} m", columns, tuple(texts), note)


def _exact(rows: Sequence[KindScores], tolerance_m: float) -> TextTable:
    columns = (
        "kind", "met", "missed", "lateral\nbias", "\nRMSE", "\nmedian", "\n95 %", "height\nbias", "\nRMSE",
        "\nmedian", "\n95 %", "3-D\nRMSE", "Hausdorff\n95 % m", "\nmax m",
    )  # fmt: skip
    texts = [
        (
            row.kind, str(row.at.lateral.n), str(row.at.n_missed_observed), *error_texts(row.at.lateral),
            *error_texts(row.at.height), centimetres(row.at.space.rmse_m), number(row.hausdorff_p95_m, 2),
            number(row.hausdorff_m, 2),
        )
        for row in rows
    ]  # fmt: skip
    note = (
        "lateral: positive to the left of the truth's drawing direction; missed: of the stations that were "
        "seen; within the tolerance no lateral error can be larger than it"
    )
    title = f"Errors in cm at stations every 0.5 m, within {tolerance_m:g} m"
    return TextTable(title, columns, tuple(texts), note)


def _over_tolerance(rows: Sequence[KindScores]) -> TextTable:
    columns = (
        "kind", "within m", "complete", "of all", "correct", "quality", "double", "missed", "lateral\nRMSE cm",
        "height\nRMSE cm",
    )  # fmt: skip
    texts = [
        (
            row.kind if i == 0 else "", f"{at.tolerance_m:g}", percent(at.completeness),
            percent(at.completeness_all), percent(at.correctness), percent(at.quality), percent(at.redundancy),
            str(at.n_missed_observed), centimetres(at.lateral.rmse_m), centimetres(at.height.rmse_m),
        )
        for row in rows
        for i, at in enumerate(row.curve)
    ]  # fmt: skip
    return TextTable("Over the tolerance", columns, tuple(texts))


def _whole_lines(rows: Sequence[KindScores]) -> TextTable:
    limits_m = sorted({limit_m for row in rows for limit_m in row.chamfer_ap})
    texts = [(row.kind, *(percent(row.chamfer_ap[b]) for b in limits_m)) for row in rows if row.n_reference]
    columns = ("kind", *(f"{b:g} m" for b in limits_m))
    note = (
        "of lines taken by confidence; right: nearer than this to a line of the truth, on average both ways"
    )
    return TextTable("Whole lines: average precision", columns, tuple(texts), note)


def _attributes(rows: Sequence[KindScores]) -> TextTable:
    texts = [
        (row.kind, name.removesuffix("_m"), str(errors.n), *error_texts(errors))
        for row in rows
        for name, errors in row.attributes.items()
        if errors.n
    ]
    columns = ("kind", "of", "lines", "bias", "RMSE", "median", "95 %")
    return TextTable("Values of the lines, errors in cm", columns, tuple(texts))


def _honest(rows: Sequence[KindScores]) -> TextTable:
    columns = ("kind", "sigma xy", "sigma z", "calibration\nerror", "AUC", "pieces", "right")
    texts = []
    for row in rows:
        c = row.confidence
        if row.sigma_xy or row.sigma_z or c.n_pieces:
            ratios = (ratio_texts(row.sigma_xy), ratio_texts(row.sigma_z))
            texts.append(
                (
                    row.kind,
                    *ratios,
                    percent(c.calibration_error),
                    number(c.auc, 3),
                    str(c.n_pieces),
                    str(c.n_correct),
                )
            )
    note = (
        "sigma: rms(error / sigma) where lines were measured, per third of the stations, smallest sigmas first; "
        "1 is honest"
    )
    return TextTable("Sigma, and confidence per piece of 10 m", columns, tuple(texts), note)
