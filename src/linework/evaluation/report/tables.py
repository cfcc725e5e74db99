"""Scores and lines as tables of text, for the terminal and the report alike."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from linework.arrays import FloatArray
from linework.evaluation.attributes import GROUPED_BY
from linework.evaluation.values import ErrorStats, KindScores, Scores, SigmaTercile
from linework.model.lines import LineSet


@dataclass(frozen=True, slots=True)
class ReportTable:
    """A table of texts, ready to be shown.

    Parameters
    ----------
    title
        Heading, with the unit where all values share one.
    columns
        Column heads; the first column holds names.
    rows
        Texts, one per column.
    note
        How to read the table.
    """

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    note: str = ""


def score_tables(scores: Scores) -> Iterator[ReportTable]:
    """Yield the tables of an evaluation: completeness, errors, by tolerance, then the others that have rows."""
    rows = [*scores.kinds, scores.overall] if len(scores.kinds) != 1 else list(scores.kinds)
    yield _completeness(rows, scores.tolerance_m)
    yield _errors(rows, scores.tolerance_m)
    yield _by_tolerance(rows)
    for table in (
        groups_table(rows), labels_table(rows), dashes_table(rows), _attributes(rows), bridged_table(rows),
        _whole_lines(rows), _calibration(rows),
    ):  # fmt: skip
        if table.rows:
            yield table


def _completeness(rows: Sequence[KindScores], tolerance_m: float) -> ReportTable:
    columns = (
        "kind", "lines", "reference\nm", "observed\nm", "complete", "of all", "correct", "quality", "redundant", "gaps/km",
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
        "lines: extracted / reference; complete: found share of the observed reference; of all: found share of all "
        "of it; redundant: duplicated share of the matched length; pieces: extracted lines per line found"
    )
    return ReportTable(f"Completeness and correctness within {tolerance_m:g} m", columns, tuple(texts), note)


def _errors(rows: Sequence[KindScores], tolerance_m: float) -> ReportTable:
    columns = (
        "kind", "stations", "missed", "lateral\nbias", "\nRMSE", "\nmedian", "\n95 %", "height\nbias", "\nRMSE",
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
        "lateral: positive to the left of the reference's drawing direction; missed: observed stations without a "
        "line within the tolerance, which is also the largest lateral error possible"
    )
    title = f"Errors in cm at stations every 0.5 m, within {tolerance_m:g} m"
    return ReportTable(title, columns, tuple(texts), note)


def _by_tolerance(rows: Sequence[KindScores]) -> ReportTable:
    columns = (
        "kind", "within m", "complete", "of all", "correct", "quality", "redundant", "missed", "lateral\nRMSE cm",
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
    return ReportTable("Scores by tolerance", columns, tuple(texts))


def _whole_lines(rows: Sequence[KindScores]) -> ReportTable:
    limits_m = sorted({limit_m for row in rows for limit_m in row.chamfer_ap})
    texts = [(row.kind, *(percent(row.chamfer_ap[b]) for b in limits_m)) for row in rows if row.n_reference]
    columns = ("kind", *(f"{b:g} m" for b in limits_m))
    note = "over lines by falling confidence; a line is right if its Chamfer distance to a reference line is below this"
    return ReportTable("Whole lines: average precision", columns, tuple(texts), note)


def _attributes(rows: Sequence[KindScores]) -> ReportTable:
    texts = [
        (row.kind, name.removesuffix("_m"), str(errors.n), *error_texts(errors))
        for row in rows
        for name, errors in row.attributes.items()
        if errors.n
    ]
    columns = ("kind", "value", "lines", "bias", "RMSE", "median", "95 %")
    return ReportTable("Errors of height, lower edge, width and clearance in cm", columns, tuple(texts))


def _calibration(rows: Sequence[KindScores]) -> ReportTable:
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
        "1 is honest, above 1 is overconfident; confidence: over pieces of about 10 m"
    )
    return ReportTable("Sigma and confidence", columns, tuple(texts), note)


def groups_table(rows: Sequence[KindScores]) -> ReportTable:
    """Return the scores of boundaries by form and of markings by pattern."""
    columns = (
        "kind", "group", "reference\nm", "observed\nm", "complete", "correct", "redundant", "pieces", "lateral\nbias", "\nRMSE",
        "\nmedian", "\n95 %", "measured\nRMSE", "height\nRMSE", "step\nRMSE",
    )  # fmt: skip
    texts = [
        (
            row.kind, f"{GROUPED_BY[row.kind]} {group.value or '-'}", f"{group.reference_m:.1f}",
            f"{group.observed_m:.1f}", percent(group.at.completeness), percent(group.at.correctness),
            percent(group.at.redundancy), number(group.at.pieces_per_line, 2), *error_texts(group.at.lateral),
            centimetres(group.bridged.lateral_measured.rmse_m), centimetres(group.at.height.rmse_m), centimetres(group.height.rmse_m),
        )
        for row in rows
        for group in row.groups
    ]  # fmt: skip
    note = (
        "errors in cm; an extracted line counts towards the group of the reference beside it, or else its own; "
        "measured: lateral, without bridged stretches; step: height_m of the line"
    )
    return ReportTable("By form and pattern", columns, tuple(texts), note)


def labels_table(rows: Sequence[KindScores]) -> ReportTable:
    """Return over which length the attributes of the lines are right."""
    texts = []
    for row in rows:
        for name, label in row.labels.items():
            if label.compared_m > 0:
                mistaken = [
                    f"{text} {percent(size_m / label.compared_m)}"
                    for text, size_m in label.mistaken_m.items()
                ]
                texts.append(
                    (
                        row.kind,
                        name,
                        f"{label.compared_m:.1f}",
                        percent(label.share_right),
                        ", ".join(mistaken[:3]),
                    )
                )
    columns = ("kind", "attribute", "compared m", "right", "most frequent errors (reference > extracted)")
    return ReportTable(
        "Attributes of the lines",
        columns,
        tuple(texts),
        "over the reference that was found and has the attribute",
    )


def dashes_table(rows: Sequence[KindScores]) -> ReportTable:
    """Return how many dashes were found, and the errors of their ends."""
    columns = (
        "kind", "observed", "found", "", "extracted", "right", "ends", "within", "end cm\nbias", "\nRMSE",
        "\nmedian", "\n95 %",
    )  # fmt: skip
    texts = [
        (
            row.kind, str(d.n_reference), str(d.n_found), percent(d.share_found), str(d.n_extracted),
            percent(d.share_right), str(d.ends.n), percent(d.share_ends_within), *error_texts(d.ends),
        )
        for row in rows
        if (d := row.dashes) is not None and (d.n_reference or d.n_extracted)
    ]  # fmt: skip
    limits = {100 * row.dashes.end_limit_m for row in rows if row.dashes is not None}
    note = f"within {' '.join(f'{cm:.0f}' for cm in sorted(limits))} cm; errors of ends: positive where the dash is too long"
    return ReportTable("Dashes", columns, tuple(texts), note)


def bridged_table(rows: Sequence[KindScores]) -> ReportTable:
    """Return how much was bridged, with its errors beside those of measured stretches."""
    columns = (
        "kind", "hidden m", "of it found", "bridged m", "right", "lateral cm\nRMSE", "\n95 %",
        "measured\nRMSE cm", "sigma xy", "sigma z",
    )  # fmt: skip
    texts = [
        (
            row.kind, f"{b.hidden_m:.1f}", percent(b.hidden_found_m / b.hidden_m if b.hidden_m else None),
            f"{b.bridged_m:.1f}", percent(b.share_right), centimetres(b.lateral.rmse_m),
            centimetres(b.lateral.p95_m), centimetres(b.lateral_measured.rmse_m), ratio_texts(b.sigma_xy),
            ratio_texts(b.sigma_z),
        )
        for row in rows
        if (b := row.bridged).bridged_m or b.hidden_m
    ]  # fmt: skip
    note = (
        "hidden: reference that was not observed; right: share of the bridged length within the tolerance; lateral: "
        "errors of bridged stretches at any distance searched; sigma: rms(error / sigma) of bridged stretches"
    )
    return ReportTable("Bridged", columns, tuple(texts), note)


def kinds_table(lines: LineSet) -> ReportTable:
    """Return number, length, confidence, sigmas and sizes of the lines by kind, form and pattern."""
    rows = []
    for kind in dict.fromkeys(str(kind) for kind in lines.kind):
        own = lines.take(lines.kind == kind)
        rows.append((kind, *_figures(own)))
        group = getattr(own, GROUPED_BY[kind]) if kind in GROUPED_BY else own.kind
        values = sorted(set(group.tolist()))
        if len(values) > 1:
            rows += [(f"- {value or 'unknown'}", *_figures(own.take(group == value))) for value in values]
    columns = (
        "kind", "lines", "length m", "bridged m", "confidence", "sigma\nacross cm", "sigma\nheight cm",
        "width cm", "height m",
    )  # fmt: skip
    note = (
        "confidence: mean over the length; sigma: root mean square over measured vertices; width, height: median "
        "over the length (5th to 95th percentile)"
    )
    return ReportTable("Lines", columns, tuple(rows), note)


def lines_table(lines: LineSet) -> ReportTable:
    """Return all lines with their values."""
    columns = (
        "id", "kind", "role", "pattern, form", "length m", "bridged m", "width cm", "height m", "clearance m",
        "confidence", "sigma\nacross cm", "sigma\nheight cm",
    )  # fmt: skip
    length_m, bridged_m = lines.length_m, lines.bridged_m
    rows = []
    for i in range(len(lines)):
        of_line = slice(lines.offsets[i], lines.offsets[i + 1])
        look = [str(lines.pattern[i]), str(lines.form[i]), "double" if lines.double[i] else ""]
        rows.append(
            (
                str(lines.id[i]) or str(i), str(lines.kind[i]), str(lines.role[i]), " ".join(filter(None, look)),
                f"{length_m[i]:.1f}", f"{bridged_m[i]:.1f}", centimetres(_finite(lines.width_m[i])),
                number(_finite(lines.height_m[i]), 2), number(_finite(lines.clearance_m[i]), 2),
                number(_finite(lines.confidence[i]), 2), centimetres(_rms(lines.sigma_xy_m[of_line])),
                centimetres(_rms(lines.sigma_z_m[of_line])),
            )
        )  # fmt: skip
    return ReportTable("All lines", columns, tuple(rows))


def _figures(lines: LineSet) -> tuple[str, ...]:
    length_m, measured = lines.length_m, ~lines.bridged
    known = np.isfinite(lines.confidence) & (length_m > 0)
    sure = float(np.average(lines.confidence[known], weights=length_m[known])) if known.any() else None
    return (
        str(len(lines)), f"{length_m.sum():.1f}", f"{lines.bridged_m.sum():.1f}", number(sure, 2),
        centimetres(_rms(lines.sigma_xy_m[measured])), centimetres(_rms(lines.sigma_z_m[measured])),
        _spread(100 * lines.width_m, length_m, 1), _spread(lines.height_m, length_m, 2),
    )  # fmt: skip


def _spread(values: FloatArray, weights: FloatArray, decimals: int) -> str:
    """Return the weighted median, with the 5th and 95th percentiles, as text.

    >>> _spread(np.array([10.0, 12.0, 30.0, np.nan]), np.array([1.0, 8.0, 1.0, 5.0]), 0)
    '12 (10 to 30)'
    """
    known = np.isfinite(values) & (weights > 0)
    if not known.any():
        return "-"
    order = np.argsort(values[known])
    share = np.cumsum(weights[known][order])
    low, middle, high = values[known][order][np.searchsorted(share / share[-1], [0.05, 0.5, 0.95])].tolist()
    text = number(middle, decimals)
    return text if low == high else f"{text} ({number(low, decimals)} to {number(high, decimals)})"


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _rms(values: FloatArray) -> float | None:
    values = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(values**2))) if len(values) else None


def error_texts(errors: ErrorStats) -> list[str]:
    """Return bias, RMSE, median and 95th percentile in centimetres."""
    values = (errors.bias_m, errors.rmse_m, errors.median_m, errors.p95_m)
    return [centimetres(value) for value in values]


def ratio_texts(thirds: tuple[SigmaTercile, ...]) -> str:
    """Return rms(error / sigma) of the thirds as text.

    >>> ratio_texts(())
    '-'
    """
    return " / ".join(f"{third.rms_ratio:.2f}" for third in thirds) or "-"


def percent(share: float | None) -> str:
    """Return a share as text in percent.

    >>> percent(0.98765), percent(-0.0001), percent(None)
    ('98.8 %', '0.0 %', '-')
    """
    return "-" if share is None else f"{number(100 * share, 1)} %"


def centimetres(length_m: float | None) -> str:
    """Return a length as text in centimetres.

    >>> centimetres(0.0123)
    '1.2'
    """
    return "-" if length_m is None else number(100 * length_m, 1)


def number(value: float | None, decimals: int) -> str:
    """Return a number as text, without a minus before zero.

    >>> number(1.0, 2), number(-0.01, 1)
    ('1.00', '0.0')
    """
    return "-" if value is None else f"{round(value, decimals) + 0.0:.{decimals}f}"
