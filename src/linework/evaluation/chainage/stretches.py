"""The stretch of route to which a row of a report refers.

Separate from `rows`, because only tables with geometries need it.
"""

from __future__ import annotations

import numpy as np

from linework.arrays import FloatArray
from linework.evaluation.chainage.rows import ChainageReport, ChainageRow

#: How far a point row is drawn where an interval has a single station. [m]
_SHORTEST_M = 0.5


def stretch_of_row(report: ChainageReport, row: ChainageRow) -> FloatArray:
    """Return the vertices of the route from one chainage of a row to the other, (k, 3) [m, world], k >= 2.

    Parameters
    ----------
    report
        The report with the axes.
    row
        One of its rows.
    """
    axis = next(a for a in report.axes if a.name == row.route)
    first = float(np.clip(row.from_m, axis.station_m[0], axis.station_m[-1]))
    last = float(np.clip(row.to_m, axis.station_m[0], axis.station_m[-1]))
    if last - first < _SHORTEST_M:
        first = max(last - _SHORTEST_M, float(axis.station_m[0]))
        last = min(first + _SHORTEST_M, float(axis.station_m[-1]))
    inside = axis.station_m[(axis.station_m > first) & (axis.station_m < last)]
    at = np.concatenate([[first], inside, [last]])
    return np.stack([np.interp(at, axis.station_m, coordinate) for coordinate in axis.xyz.T], axis=1)
