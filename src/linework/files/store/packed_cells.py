"""Planes of cells on disk, packed where most neighbours are equal: empty cells cost next to nothing.

A plane is two arrays of a file. Packed, they are its size and the ends of its stretches of equal cells, row after
row, (2 + k,) int32, and the value of each stretch, (k,); otherwise an empty array, and the plane as it is. So a tile
with one point, or the flat surface carried on around it, takes a few kB instead of megabytes. Lossless, NaN included.
"""

from __future__ import annotations

import numpy as np

from linework.arrays import AnyArray
from linework.files.array_file import ArrayFile

#: Bytes that say where a stretch ends.
END_BYTES = 4
#: A plane is packed where that takes at most this share of its bytes: for less, reading it is not worth the work.
_LARGEST_SHARE = 0.5
_AS_IT_IS = np.empty(0, np.int32)


def packed_plane(values: AnyArray) -> tuple[AnyArray, AnyArray]:
    """Return the two arrays of a plane (n_rows, n_cols); arrays of other dimensions stay as they are.

    >>> packed_plane(np.zeros((2, 3)))
    (array([2, 3, 6], dtype=int32), array([0.]))
    """
    if values.ndim != 2 or values.size == 0:
        return _AS_IT_IS, values
    flat = np.ascontiguousarray(values).reshape(-1)
    last = np.append(_differs_from_next(flat), True)
    n_bytes = int(np.count_nonzero(last)) * (END_BYTES + values.itemsize)
    if n_bytes > _LARGEST_SHARE * values.nbytes:
        return _AS_IT_IS, values
    at = np.flatnonzero(last)
    return np.concatenate([values.shape, at + 1]).astype(np.int32), flat[at]


def plane_rows(file: ArrayFile, which: int, rows: slice | None = None) -> AnyArray:
    """Return a plane of a file, or some of its rows.

    Raises
    ------
    ValueError
        The file does not hold what `packed_plane` returns.
    """
    head, values = 2 * which, 2 * which + 1
    (n_head,), (n_values, *_) = file.shape(head), file.shape(values)
    if n_head == 0:
        rows = slice(0, n_values) if rows is None else rows
        return file.rows(values, rows.start, rows.stop)
    stated = file.rows(head, 0, n_head)
    (n_rows, n_cols), ends = stated[:2].tolist(), stated[2:].astype(np.int64)
    rows = slice(0, n_rows) if rows is None else rows
    if not 0 < len(ends) == n_values or ends[-1] != n_rows * n_cols or np.any(np.diff(ends, prepend=0) <= 0):
        raise ValueError(f"stretches of {len(ends)} cells do not fill {n_rows} x {n_cols}")
    first, last = rows.start * n_cols, rows.stop * n_cols
    begin, stop = (int(np.searchsorted(ends, at)) for at in (first + 1, last))
    cut = np.clip(ends[begin : stop + 1], first, last)
    lengths = cut - np.concatenate([[first], cut[:-1]])
    return np.repeat(file.rows(values, begin, stop + 1), lengths).reshape(rows.stop - rows.start, n_cols)


def _differs_from_next(flat: AnyArray) -> AnyArray:
    """Return whether the bytes of each but the last value (n,) differ from those of the next, (n - 1,) bool."""
    words = {1: np.uint8, 2: np.uint16, 4: np.uint32, 8: np.uint64}
    if flat.itemsize in words:
        bits = flat.view(words[flat.itemsize])
        return np.asarray(bits[1:] != bits[:-1])
    parts = flat.view(np.uint8).reshape(len(flat), flat.itemsize)
    return np.asarray((parts[1:] != parts[:-1]).any(axis=1))
