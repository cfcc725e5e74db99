"""What runs close beside a line: the two rails of a median."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from linework.arrays import BoolArray, FloatArray


def close_beside(xyz: list[FloatArray], found: list[FloatArray], pair_m: float) -> list[BoolArray]:
    """Return which nodes of each line have a node of a found one abreast, within `pair_m`, and level with them.

    >>> x = np.arange(0.0, 5.0, 0.5)
    >>> one = np.column_stack([x, 0 * x, 0 * x])
    >>> close_beside([one], [one + [0.0, 0.4, 0.0]], 3.0)[0].all(), close_beside([one], [one], 3.0)[0].any()
    (np.True_, np.False_)
    """
    if not found or not xyz:
        return [np.zeros(len(v), dtype=bool) for v in xyz]
    places, nodes = np.concatenate(xyz), np.concatenate(found)
    step = np.concatenate([np.gradient(v[:, :2], axis=0) for v in xyz])
    ahead = step / np.maximum(np.hypot(step[:, :1], step[:, 1:]), 1e-9)
    near = cKDTree(places[:, :2]).sparse_distance_matrix(cKDTree(nodes[:, :2]), pair_m, output_type="ndarray")
    i, d = near["i"], nodes[near["j"]] - places[near["i"]]
    along = np.sum(d[:, :2] * ahead[i], axis=1)
    across = np.abs(d[:, 1] * ahead[i, 0] - d[:, 0] * ahead[i, 1])
    # Abreast: to half the spacing of the nodes. Level: to 10 cm, and a crossfall of 6 % in between
    is_level = np.abs(d[:, 2]) < 0.10 + 0.06 * across
    # The line's own nodes lie before and behind it
    is_pair = (np.abs(along) < 0.3) & (across > 0.12) & is_level
    chosen = np.bincount(i[is_pair], minlength=len(places)) > 0
    return np.split(chosen, np.cumsum([len(v) for v in xyz])[:-1])
