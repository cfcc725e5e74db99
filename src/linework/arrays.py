"""Array types, the check of arrays that enter the package, ragged offsets, and distances along a line."""

from __future__ import annotations

import math
import mmap
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
Float32Array = npt.NDArray[np.float32]
IntArray = npt.NDArray[np.int64]
Int32Array = npt.NDArray[np.int32]
ByteArray = npt.NDArray[np.uint8]
BoolArray = npt.NDArray[np.bool_]
AnyArray = npt.NDArray[Any]


def checked(name: str, values: Any, dtype: Any, shape: Sequence[int | None]) -> AnyArray:
    """Return `values` as a contiguous, read-only array of the given dtype and shape.

    Parameters
    ----------
    shape
        Expected size per axis; None where any size will do.

    Raises
    ------
    ValueError
        When the shape differs; the message names the array.
    """
    array = np.ascontiguousarray(values, dtype=dtype)
    if array.ndim != len(shape) or any(
        s is not None and s != n for s, n in zip(shape, array.shape, strict=True)
    ):
        expected = "(" + ", ".join("n" if s is None else str(s) for s in shape) + ")"
        raise ValueError(f"{name}: shape {array.shape}, expected {expected}")
    view = array.view()
    view.flags.writeable = False
    return view


def zeros_on_demand(shape: tuple[int, ...]) -> FloatArray:
    """Return zeros whose memory the system gives page by page as they are written, for arrays of which most stays zero.

    Numpy asks for large pages, and the whole of a page is cleared and kept once one number in it is written.
    """
    n = math.prod(shape)
    # Windows has no private mappings of its own, and gives small pages anyway
    if n == 0 or not hasattr(mmap, "MAP_PRIVATE"):
        return np.zeros(shape)
    memory = mmap.mmap(-1, 8 * n, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS)
    return np.frombuffer(memory, np.float64, n).reshape(shape)


def ranks_of(values: IntArray) -> tuple[IntArray, IntArray]:
    """Return the distinct values (k,), ascending, of values (n,), and where each stands among them (n,), as `np.unique` does.

    Values of a small range are marked instead of sorted.

    >>> [part.tolist() for part in ranks_of(np.array([7, 3, 7]))]
    [[3, 7], [1, 0, 1]]
    """
    low, high = (int(values.min()), int(values.max())) if len(values) else (0, 0)
    if high - low > 4 * len(values):
        distinct, number = np.unique(values, return_inverse=True)
        return distinct, number
    seen = np.zeros(high - low + 1, dtype=np.bool_)
    seen[values - low] = True
    return np.flatnonzero(seen) + low, (np.cumsum(seen) - 1)[values - low]


def offsets_of(counts: npt.ArrayLike) -> IntArray:
    """Return the offsets (m + 1,) of ragged columns whose m rows have these counts."""
    return np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)


def distance_along(xyz: FloatArray, *, in_space: bool = False) -> FloatArray:
    """Return the distance of each vertex from the line's start, (n,) [m].

    Parameters
    ----------
    xyz
        (n, 2) or (n, 3) vertices of one line, n >= 1. [m]
    in_space
        Measure over all columns of `xyz` instead of in plan. It sums squares where the plan takes `np.hypot`;
        the two differ in the last bit.
    """
    step = np.diff(xyz, axis=0)
    length = np.linalg.norm(step, axis=1) if in_space else np.hypot(step[:, 0], step[:, 1])
    return np.concatenate([[0.0], np.cumsum(length)])
