"""A wire through three places, as it hangs."""

from __future__ import annotations

import numpy as np

from linework.arrays import FloatArray
from linework.errors import UsageError
from linework.lines.catenary import fit_catenary
from linework.model.lines import LineSet

#: Vertices so far apart: chords of the slackest wire (a = 50 m) are within 1 cm of it. [m]
STATION_M = 2.0
#: Longer spans are of other lines than a street's. [m]
LONGEST_M = 300.0
#: The place between is in the plane of the wire within this, wind and clicks included. [m]
ASIDE_M = 1.0


def wire(xyz: FloatArray, crs: str) -> LineSet:
    """Return the cable that hangs through three places.

    Parameters
    ----------
    xyz
        (3, 3): both ends, and a place between; in any order. [m, world]

    Returns
    -------
    LineSet
        From the first end to the other, in the vertical plane of both: a catenary, or straight where the place between
        lies above the chord.

    Raises
    ------
    UsageError
        The places are not those of one span.
    """
    order = np.argsort((xyz[:, :2] - xyz[0, :2]) @ _widest(xyz), kind="stable")
    start, middle, end = xyz[order]
    way = end[:2] - start[:2]
    span_m = float(np.hypot(*way))
    if not 1.0 <= span_m <= LONGEST_M:
        raise UsageError(
            f"a span of {span_m:.0f} m",
            where="wire",
            advice=f"1 to {LONGEST_M:.0f} m; click from pole to pole",
        )
    way = way / span_m
    step = middle[:2] - start[:2]
    aside_m, at_m = float(abs(way[0] * step[1] - way[1] * step[0])), float(step @ way)
    if aside_m > ASIDE_M or not 0.05 * span_m < at_m < 0.95 * span_m:
        raise UsageError(
            "the three places are not on one span", where="wire",
            advice="click both ends and a place well between them",
        )  # fmt: skip
    known, heights = np.array([0.0, at_m, span_m]), np.array([start[2], middle[2], end[2]])
    hangs = middle[2] < start[2] + at_m / span_m * (end[2] - start[2])
    curve = fit_catenary(known, heights, straight=not hangs).curve
    at = np.linspace(0.0, span_m, int(np.ceil(span_m / STATION_M)) + 1)
    places = np.column_stack([start[:2] + at[:, None] * way, curve.height_at(at)])
    return LineSet.from_lines([places], crs=crs, kind=["cable"], method=["drawn"])


def _widest(xyz: FloatArray) -> FloatArray:
    """Return the direction (2,) of the two places that are farthest apart."""
    pairs = [(0, 1), (0, 2), (1, 2)]
    i, k = max(pairs, key=lambda pair: float(np.hypot(*(xyz[pair[1], :2] - xyz[pair[0], :2]))))
    return np.asarray(xyz[k, :2] - xyz[i, :2])
