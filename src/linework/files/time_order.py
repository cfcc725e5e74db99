"""Rows of a log in the order of time: sorted, each time once, clocks that were set back told, what was odd said."""

from __future__ import annotations

import numpy as np

from linework.arrays import FloatArray, IntArray
from linework.imaging.pairing import certain_times

#: Rows that changed places leave two rows in doubt; a clock that was set back leaves more.
_ROWS_OF_A_SWAP = 2
#: A log that was appended to itself leaves all rows in doubt; a clock that was set back a smaller share.
_MOST_IN_DOUBT = 0.5


def in_time_order(
    time_s: FloatArray, line_numbers: FloatArray, *, unit: str = "line"
) -> tuple[IntArray, tuple[str, ...]]:
    """Return which rows to take, in strictly increasing time, and what was odd.

    Rows are put in time order (stable); of rows with equal time the first is kept, the others are counted. Where
    the clock was set back, the same times were written twice: rows of these times are left out, since nobody knows
    which of the two they belong to.

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
    backward = np.flatnonzero(np.diff(time_s) < 0)
    if len(backward) == 0:
        rows, warnings = np.arange(len(time_s)), list[str]()
    else:
        first = f"at {unit} {int(line_numbers[backward[0] + 1])}"
        rows, warnings = _set_back(time_s, backward, first)
        rows = rows[np.argsort(time_s[rows], kind="stable")]
    kept = rows[np.concatenate([[True], np.diff(time_s[rows]) > 0])]
    if len(kept) < len(rows):
        warnings.append(f"{len(rows) - len(kept)} rows with the time of another left out")
    return kept.astype(np.int64), tuple(warnings)


def _set_back(time_s: FloatArray, backward: IntArray, first: str) -> tuple[IntArray, list[str]]:
    """Return the rows whose time is certain, all where times are only in another order; and what was odd.

    Parameters
    ----------
    backward
        Rows after which time runs backwards.
    first
        Where that first is.
    """
    is_new = np.diff(time_s, prepend=-np.inf) != 0.0
    in_doubt = is_new & ~certain_times(time_s)
    n = int(np.count_nonzero(in_doubt))
    if n <= _ROWS_OF_A_SWAP * len(backward) or n > _MOST_IN_DOUBT * len(time_s):
        return np.arange(len(time_s)), [f"time runs backwards {len(backward)} times, first {first}: sorted"]
    said = (
        f"the clock was set back {len(backward)} times, first after {time_s[backward[0]]:.3f} s by"
        f" {time_s[backward[0]] - time_s[backward[0] + 1]:.3f} s {first}: {n} rows whose time occurs twice left out"
    )
    return np.flatnonzero(~in_doubt), [said]
