"""Array types, and the one check at the door: after it, kernels trust their input."""

from __future__ import annotations

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


def offsets_of(counts: npt.ArrayLike) -> IntArray:
    """Return the offsets (m + 1,) of ragged columns whose m rows have these counts."""
    return np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
