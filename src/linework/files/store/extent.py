"""Extent of a survey: limits beyond which points are strays, and detection of coordinates in degrees.

Separate from `build`, which plans the store: this decides where the survey is before anything is written.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence

import numpy as np

from linework.arrays import AnyArray, FloatArray
from linework.errors import CrsError
from linework.files.store.layout import HEIGHT_BUCKET_M, STORE_BLOCK_M, Limits, RunTable

#: Share of the points that may lie outside the box around the survey, at either side.
_TAIL = 0.001
#: Distance beyond that box within which points are kept, in sizes of the box, and at least in metres: a stray point
#: in the sky is 1e3 to 1e8 m away, a side street or a mast is not.
_REACH_SIZES, _REACH_M = 3.0, 1000.0
#: Degrees mistaken for metres: 50 km of road span 0.5, and objects along it are hundreds of times as high (10 m over
#: 0.01 for a kilometre). In metres that would be a thread: a mast cut out alone is 30 times as high as wide.
_DEGREES_SIZE, _DEGREES_SLENDER = 0.5, 50.0
#: Least height range [m] and number of points for that comparison.
_DEGREES_HEIGHT_M, _DEGREES_LEAST = 0.5, 100


def stray_limits(runs: RunTable, height_counts: Sequence[Mapping[int, int]]) -> Limits | None:
    """Return the limits beyond which points are far from nearly all others; None where no point is.

    Parameters
    ----------
    runs
        All runs of the store.
    height_counts
        Points by bucket of height, of each file.

    Notes
    -----
    Whole blocks and buckets are counted: the result depends neither on the order of the points nor on the batches
    they were read in.
    """
    rows = runs.rows
    heights = sum((Counter(counts) for counts in height_counts), Counter[int]())
    buckets, in_bucket = np.array(list(heights), np.int64), np.array(list(heights.values()), np.int64)
    ranges = [
        _middle(rows["east"].astype(np.int64), rows["count"]),
        _middle(rows["north"].astype(np.int64), rows["count"]),
        _middle(buckets, in_bucket),
    ]
    # One size for both plan axes: a long road east-west may bend north by as much
    plan_m = max(high - low for low, high in ranges[:2]) * STORE_BLOCK_M
    height_m = (ranges[2][1] - ranges[2][0]) * HEIGHT_BUCKET_M
    plan = math.ceil(max(_REACH_SIZES * plan_m, _REACH_M) / STORE_BLOCK_M)
    height = math.ceil(max(_REACH_SIZES * height_m, _REACH_M) / HEIGHT_BUCKET_M)
    limits = Limits(
        west=ranges[0][0] - plan,
        south=ranges[1][0] - plan,
        low=ranges[2][0] - height,
        east=ranges[0][1] + plan,
        north=ranges[1][1] + plan,
        high=ranges[2][1] + height,
    )
    holds_all = (
        limits.west <= rows["east"].min()
        and rows["east"].max() < limits.east
        and limits.south <= rows["north"].min()
        and rows["north"].max() < limits.north
        and limits.low <= buckets.min()
        and buckets.max() < limits.high
    )
    return None if holds_all else limits


def _middle(places: AnyArray, counts: AnyArray) -> tuple[int, int]:
    """Return the half-open range that holds all points but a tail at either side."""
    order = np.argsort(places, kind="stable")
    places, cumulated = places[order], np.cumsum(counts[order])
    n = int(cumulated[-1])
    low = places[np.searchsorted(cumulated, _TAIL * n, side="right")]
    high = places[np.searchsorted(cumulated, n - math.floor(_TAIL * n))]
    return int(low), int(high) + 1


def refuse_degrees(samples: Sequence[FloatArray | None], n_points: int, *, where: object) -> None:
    """Refuse longitudes and latitudes with heights in metres, whatever CRS is stated.

    Parameters
    ----------
    samples
        (k, 3) points of each file; None for a file whose points cannot be degrees.
    n_points
        Points of all files.

    Raises
    ------
    CrsError
        They are degrees.
    """
    sound = [sample for sample in samples if sample is not None]
    if len(sound) < len(samples) or n_points < _DEGREES_LEAST or not any(len(sample) for sample in sound):
        return
    low, high = np.quantile(np.concatenate(sound), [_TAIL, 1.0 - _TAIL], axis=0)
    plan, height = float((high - low)[:2].max()), float((high - low)[2])
    in_range = np.all(np.abs([low[0], high[0]]) <= 180.0) and np.all(np.abs([low[1], high[1]]) <= 90.0)
    slender = height > max(_DEGREES_SLENDER * plan, _DEGREES_HEIGHT_M)
    if in_range and plan < _DEGREES_SIZE and slender:
        raise CrsError(
            f"coordinates are geographic (degrees), lengths need metres: {low[0]:.5f} to {high[0]:.5f} and {low[1]:.5f}"
            f" to {high[1]:.5f}, with heights over {height:.1f} m",
            where=where,
            advice="transform to a projected CRS",
        )
