"""A fixed order of points, taken from their own fields: what is found in arrays does not depend on their order.

Separate from `protocol`, which says what a method is: this decides in which order it sees the points of an array.
"""

from __future__ import annotations

import numpy as np

from linework.arrays import AnyArray, IntArray
from linework.kernels.store.pack import KEY_STEPS_PER_M, pack_points
from linework.model.points import Points, refuse_unusable

#: Buckets of heights on either side of 0, which `pack_points` counts in: coordinates lie within 1e8 m.
_MIDDLE_BUCKET = 2**21


def in_fixed_order(points: Points) -> Points:
    """Return points on the tile store's lattice of 0.1 mm and in its order: by place, then by their other columns.

    Raises
    ------
    UsageError
        A coordinate, time or intensity is not a finite number.

    Examples
    --------
    >>> points = Points([[2.00004, 0.0, 5.0], [1.0, 0.0, 5.0], [1.0, 0.0, 5.0]], intensity=[1, 3, 2])
    >>> ordered = in_fixed_order(points)
    >>> ordered.xyz[:, 0].tolist(), ordered.intensity.tolist()
    ([1.0, 1.0, 2.0], [2.0, 3.0, 1.0])
    """
    refuse_unusable(points)
    n = len(points)
    keys, owners = np.empty(n, np.uint64), np.empty(n, np.int32)
    _, codes, _, _, _ = pack_points(
        points.xyz, keys, owners, np.zeros(2 * _MIDDLE_BUCKET, np.int64), _MIDDLE_BUCKET
    )
    blocks = np.empty(len(codes), np.int32)
    blocks[np.argsort(codes)] = np.arange(len(codes), dtype=np.int32)
    order = _settled(np.lexsort((keys, blocks[owners])), keys, blocks[owners], points)
    found = points.take(order).by_name()
    found["xyz"] = np.rint(found["xyz"] * KEY_STEPS_PER_M) / KEY_STEPS_PER_M
    known = {name: found.pop(name, None) for name in ("xyz", "intensity", "time_s")}
    return Points(**known, crs=points.crs, columns=found)


def _settled(order: IntArray, keys: AnyArray, blocks: AnyArray, points: Points) -> IntArray:
    """Return the order with points of one place sorted by time, intensity and further columns, as the store does."""
    ordered, of_block = keys[order], blocks[order]
    is_same = (ordered[1:] == ordered[:-1]) & (of_block[1:] == of_block[:-1])
    if not is_same.any():
        return order
    tied = np.flatnonzero(np.append(is_same, False) | np.append(False, is_same))
    place = np.cumsum(np.append(True, ~is_same))[tied]
    others = [points.time_s, points.intensity, *(points.columns[name] for name in sorted(points.columns))]
    columns = [column[order[tied]] for column in others if column is not None]
    settled = order.copy()
    settled[tied] = order[tied][np.lexsort((*reversed(columns), place))]
    return settled
