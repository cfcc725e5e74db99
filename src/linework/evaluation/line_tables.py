"""What was found, as tables: kind by kind, and line by line."""

from __future__ import annotations

import numpy as np

from linework.arrays import FloatArray
from linework.evaluation.groups import GROUPED_BY
from linework.evaluation.table_texts import TextTable, centimetres, number
from linework.model.lines import LineSet


def kinds_table(lines: LineSet) -> TextTable:
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
    return TextTable("Lines", columns, tuple(rows), note)


def lines_table(lines: LineSet) -> TextTable:
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
    return TextTable("Every line", columns, tuple(rows))


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
