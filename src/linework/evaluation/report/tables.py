"""Scores as tables of text, for the terminal and for the report alike."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from linework.arrays import FloatArray
from linework.evaluation.dashes import GROUPED_BY
from linework.evaluation.values import ErrorStats, KindScores, Scores, SigmaTercile
from linework.model.lines import LineSet


def score_tables(scores: Scores) -> Iterator[ReportTable]:
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


def _found(rows: Sequence[KindScores], tolerance_m: float) -> ReportTable:
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
    return ReportTable(f"Found, within {tolerance_m:g} m", columns, tuple(texts), note)


def _exact(rows: Sequence[KindScores], tolerance_m: float) -> ReportTable:
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
    return ReportTable(title, columns, tuple(texts), note)


def _over_tolerance(rows: Sequence[KindScores]) -> ReportTable:
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
    return ReportTable("Over the tolerance", columns, tuple(texts))


def _whole_lines(rows: Sequence[KindScores]) -> ReportTable:
    limits_m = sorted({limit_m for row in rows for limit_m in row.chamfer_ap})
    texts = [(row.kind, *(percent(row.chamfer_ap[b]) for b in limits_m)) for row in rows if row.n_reference]
    columns = ("kind", *(f"{b:g} m" for b in limits_m))
    note = (
        "of lines taken by confidence; right: nearer than this to a line of the truth, on average both ways"
    )
    return ReportTable("Whole lines: average precision", columns, tuple(texts), note)


def _attributes(rows: Sequence[KindScores]) -> ReportTable:
    texts = [
        (row.kind, name.removesuffix("_m"), str(errors.n), *error_texts(errors))
        for row in rows
        for name, errors in row.attributes.items()
        if errors.n
    ]
    columns = ("kind", "of", "lines", "bias", "RMSE", "median", "95 %")
    return ReportTable("Values of the lines, errors in cm", columns, tuple(texts))


def _honest(rows: Sequence[KindScores]) -> ReportTable:
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
    return ReportTable("Sigma, and confidence per piece of 10 m", columns, tuple(texts), note)


# Values as texts in tables


@dataclass(frozen=True, slots=True)
class ReportTable:
    """A table ready to be shown.

    Parameters
    ----------
    title
        What it is about, with the unit where all values share one.
    columns
        Their heads; the first column holds names.
    rows
        As many texts each as there are columns.
    note
        How to read it.
    """

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    note: str = ""


def error_texts(errors: ErrorStats) -> list[str]:
    """Return bias, RMSE, median and 95th percentile in centimetres."""
    values = (errors.bias_m, errors.rmse_m, errors.median_m, errors.p95_m)
    return [centimetres(value) for value in values]


def ratio_texts(thirds: tuple[SigmaTercile, ...]) -> str:
    """Return rms(error / sigma) of each third.

    >>> ratio_texts(())
    '-'
    """
    return " / ".join(f"{third.rms_ratio:.2f}" for third in thirds) or "-"


def percent(share: float | None) -> str:
    """Return a share as text.

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
    """Return a number as text; no minus before a zero.

    >>> number(1.0, 2), number(-0.01, 1)
    ('1.00', '0.0')
    """
    return "-" if value is None else f"{round(value, decimals) + 0.0:.{decimals}f}"


# Tables of what only some kinds have: groups, words, dashes, bridged stretches


def groups_table(rows: Sequence[KindScores]) -> ReportTable:
    """Return the measures of boundaries by form and of markings by pattern."""
    columns = (
        "kind", "of", "truth m", "seen m", "complete", "correct", "double", "pieces", "lateral\nbias", "\nRMSE",
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
        "errors in cm; what was extracted counts to the group of the truth beside it, or else to its own; "
        "measured: lateral, bridged stretches left out; step: height_m of the line"
    )
    return ReportTable("Apart", columns, tuple(texts), note)


def labels_table(rows: Sequence[KindScores]) -> ReportTable:
    """Return for what length the words of the lines are right."""
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
    columns = ("kind", "of", "compared m", "right", "mistaken most (truth > said)")
    return ReportTable(
        "Words of the lines", columns, tuple(texts), "over the truth that was found and has such a word"
    )


def dashes_table(rows: Sequence[KindScores]) -> ReportTable:
    """Return how many dashes were found and how exact their ends are."""
    columns = (
        "kind", "truth seen", "found", "", "extracted", "right", "ends", "within", "end cm\nbias", "\nRMSE",
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
    note = f"within {' '.join(f'{cm:.0f}' for cm in sorted(limits))} cm; end errors: positive where it is too long"
    return ReportTable("Dashes", columns, tuple(texts), note)


def bridged_table(rows: Sequence[KindScores]) -> ReportTable:
    """Return how much was carried over gaps and how well, beside what was measured."""
    columns = (
        "kind", "hidden m", "found of it", "bridged m", "right", "lateral cm\nRMSE", "\n95 %",
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
        "hidden: truth that could not be seen; right: part of the bridged length within the tolerance; lateral: "
        "of bridged stretches, however far off within the search; sigma as below, on bridged stretches"
    )
    return ReportTable("Bridged", columns, tuple(texts), note)


# What was found, as tables: kind by kind, and line by line


def kinds_table(lines: LineSet) -> ReportTable:
    """Return the figures of each kind, of boundaries by form and markings by pattern: how many, how long, how sure."""
    rows = []
    for kind in dict.fromkeys(str(kind) for kind in lines.kind):
        own = lines.of_kind(kind)
        rows.append((kind, *_figures(own)))
        words = getattr(own, GROUPED_BY[kind]) if kind in GROUPED_BY else own.kind
        values = sorted(set(words.tolist()))
        if len(values) > 1:
            rows += [(f"- {value or 'unknown'}", *_figures(own.take(words == value))) for value in values]
    columns = (
        "kind", "lines", "length m", "bridged m", "confidence", "sigma\nacross cm", "sigma\nheight cm",
        "width cm", "height m",
    )  # fmt: skip
    note = (
        "confidence: mean over the length; sigma: root mean square over the measured vertices; width, height: "
        "median over the length, with what nine tenths of it lie between"
    )
    return ReportTable("Lines", columns, tuple(rows), note)


def lines_table(lines: LineSet) -> ReportTable:
    """Return every line with its own values."""
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
    return ReportTable("Every line", columns, tuple(rows))


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
    """Return the weighted median, and the range without a twentieth at either end.

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
