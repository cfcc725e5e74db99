"""How far the nearest line of the same way runs from each place along others."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from linework.arrays import FloatArray, IntArray
from linework.lines.merged import APART_M, LIKELY, SAME_M, TURN_DEG
from linework.lines.places import STEP_M, places_along
from linework.model.lines import LineSet

#: Where nobody knows how exact a line is, a person drew it: so well does one click on a picture of 5 cm. [m]
HAND_M = 0.1


def distances_beside(
    lines: LineSet, others: LineSet, reach_m: float | None = None
) -> tuple[FloatArray, IntArray]:
    """Return how far the nearest of `others` runs from each place along `lines`, and which it is.

    Parameters
    ----------
    lines, others
        Of one kind, at least one line; in the same CRS.
    reach_m
        How far one may run from the other. None: three standard deviations of their difference, at least `SAME_M` and at
        most `APART_M`, and half of the width of the thing.

    Returns
    -------
    distance_m, index
        (k,) for the places of `places_along`: infinite and -1 where none is in reach. Across the line, in plan; in space
        for cables, which hang above each other.
    """
    a = places_along(lines)
    distance, best = np.full(len(a.line), np.inf), np.full(len(a.line), -1, dtype=np.int64)
    if not len(others):
        return distance, best
    b = places_along(others)
    origin = a.xyz[0, :2]
    half = 0.5 * np.fmax(np.nan_to_num(lines.width_m)[a.line], np.nan_to_num(others.width_m).max())
    most = APART_M + float(half.max()) if reach_m is None else reach_m
    tree = cKDTree(b.xyz[:, :2] - origin)
    near, index = tree.query(
        a.xyz[:, :2] - origin, k=min(16, len(b.line)), distance_upper_bound=float(np.hypot(most, STEP_M))
    )
    near, index = near.reshape(len(a.line), -1), index.reshape(len(a.line), -1)
    there = np.minimum(index, len(b.line) - 1)
    step = a.xyz[:, None] - b.xyz[there]
    way = b.way[there]
    across = np.abs(way[..., 0] * step[..., 1] - way[..., 1] * step[..., 0])
    if str(lines.kind[0]) == "cable":
        across = np.hypot(across, step[..., 2])
    along = np.abs(np.sum(way * step[..., :2], axis=2))
    same_way = np.abs(np.sum(way * a.way[:, None], axis=2)) >= np.cos(np.radians(TURN_DEG))
    width = 0.5 * np.fmax(
        np.nan_to_num(lines.width_m)[a.line][:, None], np.nan_to_num(others.width_m)[b.line[there]]
    )
    sigma = np.hypot(*(np.nan_to_num(s, nan=HAND_M) for s in (a.sigma_m[:, None], b.sigma_m[there])))
    within = np.clip(LIKELY * sigma, SAME_M, APART_M) + width if reach_m is None else reach_m
    fits = np.isfinite(near) & same_way & (across <= within) & (along <= STEP_M)
    across = np.where(fits, across, np.inf)
    rows, k = np.arange(len(a.line)), np.argmin(across, axis=1)
    distance = across[rows, k]
    return distance, np.where(np.isfinite(distance), b.line[there[rows, k]], -1).astype(np.int64)
