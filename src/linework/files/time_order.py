"""Rows of a log in the order of time: sorted, each time once, what was odd said."""

from __future__ import annotations

import numpy as np

from linework.model.arrays import FloatArray, IntArray


def in_time_order(
    time_s: FloatArray, line_numbers: FloatArray, *, unit: str = "line"
) -> tuple[IntArray, tuple[str, ...]]:
    """Return which rows to take, in strictly increasing time, and what was odd.

    Rows are put in time order (stable); of rows with equal time the first is kept, the others are counted.

    Parameters
    ----------
    time_s
        (n,) float64 [s], in the order of the file.
    line_numbers
        (n,) where each row stands in the file.
    unit
        What `line_numbers` count.

    Examples
    --------
    >>> in_time_order(np.array([1.0, 3.0, 2.0, 3.0]), np.arange(2.0, 6.0))[0].tolist()
    [0, 2, 1]
    """
    if len(time_s) == 0:
        return np.zeros(0, np.int64), ()
    warnings = []
    order = np.argsort(time_s, kind="stable")
    backward = np.flatnonzero(np.diff(time_s) < 0)
    if len(backward):
        first = int(line_numbers[backward[0] + 1])
        warnings.append(f"time runs backwards {len(backward)} times, first at {unit} {first}: sorted")
    kept = order[np.concatenate([[True], np.diff(time_s[order]) > 0])]
    if len(kept) < len(time_s):
        warnings.append(f"{len(time_s) - len(kept)} rows with the time of another left out")
    return kept.astype(np.int64), tuple(warnings)
