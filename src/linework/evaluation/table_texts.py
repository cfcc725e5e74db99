"""Values as texts in tables."""

from __future__ import annotations

from dataclasses import dataclass

from linework.evaluation.values import ErrorStats, SigmaTercile


@dataclass(frozen=True, slots=True)
class TextTable:
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
