"""Lines without vertices that are too close together for HD maps.

Separate from `lanelet2`, which writes them: the rule is that of its validator.
"""

from __future__ import annotations

import numpy as np

from linework.arrays import BoolArray, FloatArray, offsets_of
from linework.model.lines import LINE_COLUMNS, VERTEX_COLUMNS, LineSet

#: Nearer vertices are reported by the validator of Lanelet2. [m]
NEAREST_M = 0.05


def set_apart(lines: LineSet) -> LineSet:
    """Return the lines without vertices nearer than `NEAREST_M` to the one before; the ends of a line stay.

    >>> lines = LineSet.from_lines([[[0, 0, 0], [0.01, 0, 0], [1, 0, 0], [1.02, 0, 0]]])
    >>> set_apart(lines).xyz[:, 0].tolist()
    [0.0, 1.02]
    """
    kept = np.zeros(len(lines.xyz), dtype=bool)
    for first, last in zip(lines.offsets[:-1], lines.offsets[1:], strict=True):
        kept[first:last] = _kept(lines.xyz[first:last])
    counts = np.add.reduceat(kept, lines.offsets[:-1]) if len(lines) else np.zeros(0, dtype=np.int64)
    offsets = offsets_of(counts)
    columns = {name: getattr(lines, name)[kept] for name in VERTEX_COLUMNS}
    columns |= {name: getattr(lines, name) for name in LINE_COLUMNS}
    return LineSet(xyz=lines.xyz[kept], offsets=offsets, crs=lines.crs, **columns)


def _kept(xyz: FloatArray) -> BoolArray:
    """Return (n,) bool: the first vertex, each at least `NEAREST_M` from the one kept before it, and the last."""
    kept = np.zeros(len(xyz), dtype=bool)
    before = xyz[0]
    kept[0] = kept[-1] = True
    for i in range(1, len(xyz) - 1):
        is_far = np.linalg.norm(xyz[i] - before) >= NEAREST_M
        if is_far and np.linalg.norm(xyz[-1] - xyz[i]) >= NEAREST_M:
            kept[i], before = True, xyz[i]
    return kept
