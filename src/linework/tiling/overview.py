"""A few of very many points: for pictures and statistics of surveys that do not fit into memory."""

from __future__ import annotations

import numpy as np

from linework.files.store_layout import BLOCK_M
from linework.files.store_read import PointStore
from linework.model.grid import Bounds
from linework.model.points import Points

#: Pictures of some thousand pixels show no more, and 100 bytes of each are in memory at a time.
MOST_POINTS = 4_000_000


def points_for_pictures(store: PointStore, most: int = MOST_POINTS) -> Points:
    """Return all points, or of more than `most` every k-th of each block: the same ones every time."""
    step = -(-store.n_points // most)
    if step <= 1:
        return store.points()
    parts = []
    for east, north in (store.block_counts[0] * BLOCK_M).tolist():
        parts.append(
            store.points(Bounds(east, north, east + BLOCK_M, north + BLOCK_M)).take(slice(None, None, step))
        )
    return joined(parts)


def joined(parts: list[Points]) -> Points:
    """Return the points of all parts, which have the same columns."""
    if not parts:
        return Points(np.zeros((0, 3)))
    intensity = [part.intensity for part in parts if part.intensity is not None]
    time = [part.time_s for part in parts if part.time_s is not None]
    return Points(
        np.concatenate([part.xyz for part in parts]),
        np.concatenate(intensity) if intensity else None,
        np.concatenate(time) if time else None,
    )
