"""Signed errors at stations along the reference: lateral and in height, with the sigmas of the line."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from linework.arrays import BoolArray, FloatArray, IntArray
from linework.evaluation.chains import Chains, ChainSegments, cut_into_segments, same_direction, unit
from linework.evaluation.match import (
    MAX_ANGLE_DEG,
    SEARCH_SEGMENT_M,
    TIE_M,
    first_per_query,
    pairs_within,
)

#: Distance between stations on the reference (docs/evaluation.md). [m]
_REFERENCE_STATION_M = 0.5


@dataclass(frozen=True, slots=True)
class Stations:
    """The measurements at stations of the reference; NaN (inf for `offset_m`) where no line was met.

    Parameters
    ----------
    lateral_m
        (k,) [m]: horizontal error, positive to the left of the reference's drawing direction.
    height_m
        (k,) [m]: extracted minus reference height.
    offset_m
        (k,) [m]: the distance that is compared with a tolerance: |lateral_m|, or for cables and pipes of rails the
        distance in the vertical plane across the reference.
    sigma_xy_m, sigma_z_m
        (k,) [m]: the sigmas of the extracted line there.
    is_observed
        (k,) bool: the reference was observed there.
    is_bridged
        (k,) bool: the extracted line was not measured where it was met.
    line
        (k,) int64: the reference line, by its index in its own set.
    """

    lateral_m: FloatArray
    height_m: FloatArray
    offset_m: FloatArray
    sigma_xy_m: FloatArray
    sigma_z_m: FloatArray
    is_observed: BoolArray
    is_bridged: BoolArray
    line: IntArray

    def __len__(self) -> int:
        return len(self.lateral_m)

    def take(self, chosen: BoolArray) -> Stations:
        """Return the chosen stations, (k,) bool."""
        return Stations(*(getattr(self, f.name)[chosen] for f in fields(self)))

    @classmethod
    def concatenate(cls, parts: Sequence[Stations]) -> Stations:
        """Return the stations of all `parts`, of which there is at least one."""
        return cls(*(np.concatenate([getattr(p, f.name) for p in parts]) for f in fields(cls)))


@dataclass(frozen=True, slots=True)
class _Perpendiculars:
    """Points q on the reference with unit vectors along it in plan, to its left, and along it as matched."""

    q: FloatArray
    along: FloatArray
    left: FloatArray
    direction: FloatArray


@dataclass(frozen=True, slots=True)
class _Crossings:
    """Intersections of perpendiculars and segments: both indices, distances to the left and up, and chainage."""

    query: IntArray
    segment: IntArray
    left_m: FloatArray
    up_m: FloatArray
    chainage_m: FloatArray


def measure_stations(extracted: Chains, reference: Chains, reach_m: float) -> Stations:
    """Return ``e = (p - q) . n`` where the perpendicular at q on the reference meets an extracted line at p.

    Parameters
    ----------
    extracted, reference
        Lines of one kind, relative to one origin.
    reach_m
        Length of the perpendicular to either side; beyond it the station is missed. [m]

    Notes
    -----
    n points to the left of the reference's drawing direction: reversing the reference changes the sign and
    nothing else; reversing an extracted line changes nothing. Of several lines met, the nearest is taken (for
    cables the nearest in the vertical plane), and of those at equal distance the first. A line that is met at
    more than 20 degrees does not count.
    """
    line, chainage_m, _ = reference.divided(_REFERENCE_STATION_M)
    n = len(line)
    lateral_m, height_m, offset_m = np.full(n, np.nan), np.full(n, np.nan), np.full(n, np.inf)
    met_line, met_m = np.full(n, -1, dtype=np.int64), np.zeros(n)
    direction = reference.direction_at(line, chainage_m)
    along = unit(direction[:, :2])
    left = np.stack([-along[:, 1], along[:, 0]], axis=1)
    stations = _Perpendiculars(reference.at(line, chainage_m), along, left, direction)
    segments = cut_into_segments(extracted, SEARCH_SEGMENT_M)
    for query, k in pairs_within(stations.q, segments, reach_m, extracted.n_dims):
        found = _crossings(stations, segments, query, k)
        met_direction = extracted.direction_at(segments.line[found.segment], found.chainage_m)
        same = same_direction(met_direction, stations.direction[found.query], MAX_ANGLE_DEG)
        in_space = (
            extracted.is_stacked[segments.line[found.segment]] & reference.is_stacked[line[found.query]]
        )
        in_space = (in_space & np.isfinite(found.up_m)) | (extracted.n_dims == 3)
        size = np.where(in_space, np.hypot(found.left_m, found.up_m), np.abs(found.left_m))
        near = np.flatnonzero(same & (size <= reach_m + TIE_M))
        best = near[first_per_query(found.query[near], size[near], found.segment[near])]
        to = found.query[best]
        lateral_m[to], height_m[to], offset_m[to] = found.left_m[best], found.up_m[best], size[best]
        met_line[to], met_m[to] = segments.line[found.segment[best]], found.chainage_m[best]
    return Stations(
        lateral_m=lateral_m,
        height_m=height_m,
        offset_m=offset_m,
        sigma_xy_m=_sigma_at(extracted, extracted.lines.sigma_xy_m, met_line, met_m),
        sigma_z_m=_sigma_at(extracted, extracted.lines.sigma_z_m, met_line, met_m),
        is_observed=reference.observed_at(line, chainage_m),
        is_bridged=_bridged_at(extracted, met_line, met_m),
        line=line,
    )


def _crossings(
    stations: _Perpendiculars, segments: ChainSegments, query: IntArray, k: IntArray
) -> _Crossings:
    """Return the intersections of the perpendiculars `query` (k,) and the segments `k` (k,); others are dropped."""
    start, end = segments.start[k] - stations.q[query], segments.end[k] - stations.q[query]
    before = np.einsum("ij,ij->i", start[:, :2], stations.along[query])
    after = np.einsum("ij,ij->i", end[:, :2], stations.along[query])
    # A micrometre of slack, so that rounding does not decide for a line that ends at the station
    meets = (np.minimum(before, after) <= TIE_M) & (np.maximum(before, after) >= -TIE_M) & (before != after)
    query, k, start, end = query[meets], k[meets], start[meets], end[meets]
    part = np.clip(before[meets] / (before - after)[meets], 0.0, 1.0)
    p_less_q = start + part[:, None] * (end - start)
    return _Crossings(
        query=query,
        segment=k,
        left_m=np.einsum("ij,ij->i", p_less_q[:, :2], stations.left[query]),
        up_m=p_less_q[:, 2],
        chainage_m=segments.start_m[k] + part * (segments.end_m[k] - segments.start_m[k]),
    )


def _sigma_at(extracted: Chains, column: FloatArray, line: IntArray, chainage_m: FloatArray) -> FloatArray:
    sigma = np.full(len(line), np.nan)
    met = line >= 0
    if met.any():
        sigma[met] = extracted.column_at(column, line[met], chainage_m[met])
    return sigma


def _bridged_at(extracted: Chains, line: IntArray, chainage_m: FloatArray) -> BoolArray:
    is_bridged = np.zeros(len(line), dtype=np.bool_)
    met = line >= 0
    if met.any():
        is_bridged[met] = extracted.bridged_at(line[met], chainage_m[met])
    return is_bridged
