"""Lines of a CRS in feet as lines in metres, and back.

What we extract is in metres. Files of others may be in feet; all that measures lines, or writes a format that is always in
metres, takes them through here. Separate from `linework.crs`, which knows no lines.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from linework.arrays import FloatArray
from linework.crs import metric_twin, unit_factors
from linework.model.lines import LineSet


def in_metres(lines: LineSet) -> LineSet:
    """Return lines with coordinates in metres, in the same projection and datum; lines in metres as they are.

    >>> feet = LineSet.from_lines([np.array([[100.0, 0.0, 10.0], [200.0, 0.0, 10.0]])], crs="EPSG:2263+6360")
    >>> in_metres(feet).length_m.round(4).tolist()
    [30.4801]
    """
    twin = metric_twin(lines.crs)
    if twin == lines.crs:
        return lines
    return replace(lines, crs=twin, xyz=lines.xyz * unit_scale(lines.crs))


def in_units_of(lines: LineSet, crs: str) -> LineSet:
    """Return lines in metres in a CRS of which theirs is the twin in metres."""
    return lines if crs == lines.crs else replace(lines, crs=crs, xyz=lines.xyz / unit_scale(crs))


def unit_scale(crs: str) -> FloatArray:
    """Return (3,) metres per unit of east, north and up."""
    plan, up = unit_factors(crs)
    return np.array([plan, plan, up])
