"""Matching of extracted and reference lines, piece by piece."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from linework.arrays import AnyArray, BoolArray, FloatArray, IntArray
from linework.evaluation.chains import (
    Chains,
    ChainSegments,
    LinePieces,
    cut_into_pieces,
    cut_into_segments,
    same_direction,
)

#: Largest angle between matched lines, whatever their drawing directions [deg] (docs/evaluation.md).
MAX_ANGLE_DEG = 20.0
#: Slack of comparisons with a tolerance [m]: above the rounding of coordinates of millions of metres (1e-9 m).
TIE_M = 1e-6
#: Longest segment in a search [m]: segments are found by their middles, and short ones give few false candidates.
SEARCH_SEGMENT_M = 0.5
#: Queries per block times the reach [m]: bounds the memory of candidate pairs (about 10 per query at a reach of
#: 0.5 m, 100 bytes each).
_QUERY_BLOCK_M = 50_000.0


@dataclass(frozen=True, slots=True)
class Nearest:
    """For each query, the nearest point of the same direction on the other lines.

    Parameters
    ----------
    distance_m
        (k,) [m]; inf where there is none within reach.
    line
        (k,) int64: the line of that point; -1 where there is none.
    """

    distance_m: FloatArray
    line: IntArray

    def take(self, chosen: BoolArray) -> Nearest:
        """Return the entries of the chosen queries (k,) bool."""
        return Nearest(self.distance_m[chosen], self.line[chosen])


@dataclass(frozen=True, slots=True)
class PieceMatch:
    """Extracted and reference lines of one kind, matched piece by piece.

    Parameters
    ----------
    extracted, reference
        The lines by chainage.
    e_pieces, r_pieces
        Their pieces of at most 0.1 m.
    e_nearest
        For each piece of E, the nearest point on R within reach and of the same direction.
    r_nearest
        The same for each piece of R, on E.
    r_observed
        (k_r,) bool: the piece of R was observed (visible to the sensors).
    reach_m
        Largest distance searched. [m]
    """

    extracted: Chains
    reference: Chains
    e_pieces: LinePieces
    r_pieces: LinePieces
    e_nearest: Nearest
    r_nearest: Nearest
    r_observed: BoolArray
    reach_m: float


def match_chains(extracted: Chains, reference: Chains, reach_m: float) -> PieceMatch:
    """Return for every piece of either side its distance to the other side.

    Parameters
    ----------
    extracted, reference
        Lines of one kind, relative to one origin.
    reach_m
        Largest distance searched [m]; the result serves every tolerance up to it.

    Notes
    -----
    A piece is judged by its middle. Line ends are round, like the caps of a buffer: a line that covers half
    of another matches that half and up to one tolerance more.
    """
    e_pieces, r_pieces = cut_into_pieces(extracted), cut_into_pieces(reference)
    return PieceMatch(
        extracted=extracted,
        reference=reference,
        e_pieces=e_pieces,
        r_pieces=r_pieces,
        e_nearest=nearest_along(e_pieces, reference, reach_m, extracted.is_stacked),
        r_nearest=nearest_along(r_pieces, extracted, reach_m, reference.is_stacked),
        r_observed=reference.observed_at(r_pieces.line, r_pieces.chainage_m),
        reach_m=reach_m,
    )


def nearest_along(pieces: LinePieces, chains: Chains, reach_m: float, is_stacked: BoolArray) -> Nearest:
    """Return for each piece the nearest point on `chains` of the same direction.

    Distances are to the lines themselves, not to samples. Of two lines at equal distance the first is taken.
    `is_stacked` (m,) bool says which lines the pieces are of that are pipes of a rail: their distances to other pipes
    are in space.
    """
    distance_m = np.full(len(pieces), np.inf)
    line = np.full(len(pieces), -1, dtype=np.int64)
    segments = cut_into_segments(chains, SEARCH_SEGMENT_M)
    n = chains.n_dims
    for query, k in pairs_within(pieces.xyz, segments, reach_m, n):
        start = segments.start[k, :n]
        step = segments.end[k, :n] - start
        along = np.einsum("ij,ij->i", pieces.xyz[query, :n] - start, step)
        part = np.clip(along / np.einsum("ij,ij->i", step, step), 0.0, 1.0)
        gap_m = np.linalg.norm(start + part[:, None] * step - pieces.xyz[query, :n], axis=1)
        both = is_stacked[pieces.line[query]] & chains.is_stacked[segments.line[k]]
        up_m = segments.start[k, 2] + part * (segments.end - segments.start)[k, 2] - pieces.xyz[query, 2]
        gap_m = np.where(both & np.isfinite(up_m), np.hypot(gap_m, up_m), gap_m)
        # Directions cost most: only for candidates within reach
        near = np.flatnonzero(gap_m <= reach_m + TIE_M)
        there = k[near]
        chainage_m = segments.start_m[there] + part[near] * (segments.end_m - segments.start_m)[there]
        direction = chains.direction_at(segments.line[there], chainage_m)
        near = near[same_direction(pieces.direction[query[near]], direction, MAX_ANGLE_DEG)]
        best = near[first_per_query(query[near], gap_m[near], k[near])]
        distance_m[query[best]] = gap_m[best]
        line[query[best]] = segments.line[k[best]]
    return Nearest(distance_m, line)


def pairs_within(
    positions: FloatArray, segments: ChainSegments, reach_m: float, n_dims: int
) -> Iterator[tuple[IntArray, IntArray]]:
    """Yield index pairs (query, segment), each (k,) int64, that may lie within `reach_m`, by blocks of queries.

    Parameters
    ----------
    positions
        (q, 3) positions. [m, local]
    n_dims
        2: distances in plan; 3: in space.
    """
    if len(positions) == 0 or len(segments) == 0:
        return
    middle = (segments.start + segments.end)[:, :n_dims] / 2
    half_m = float(np.linalg.norm((segments.end - segments.start)[:, :n_dims], axis=1).max()) / 2
    tree = cKDTree(middle)
    block = max(int(_QUERY_BLOCK_M / reach_m), 1000)
    for first in range(0, len(positions), block):
        queries = cKDTree(positions[first : first + block, :n_dims])
        found = queries.sparse_distance_matrix(tree, reach_m + half_m + TIE_M, output_type="ndarray")
        yield found["i"].astype(np.int64) + first, found["j"].astype(np.int64)


def first_per_query(query: IntArray, cost: AnyArray, tie: AnyArray) -> IntArray:
    """Return the index of the entry with the lowest cost of each query; ties go to the smallest `tie`.

    >>> first_per_query(np.array([1, 0, 1]), np.array([0.3, 0.2, 0.1]), np.array([0, 0, 0])).tolist()
    [1, 2]
    """
    order = np.lexsort((tie, cost, query))
    is_first = np.ones(len(order), dtype=bool)
    is_first[1:] = query[order][1:] != query[order][:-1]
    return np.asarray(order[is_first], dtype=np.int64)


def distance_to(positions: FloatArray, chains: Chains, spacing_m: float) -> FloatArray:
    """Return (k,) distances [m] of positions (k, 3) to the nearest line of any direction, at any distance.

    Exact for straight lines; in a bend of radius r wrong by at most ``spacing_m**2 / (8 r)``. inf where there are
    no lines.
    """
    line, chainage_m, length_m = chains.divided(spacing_m)
    if len(line) == 0 or len(positions) == 0:
        return np.full(len(positions), np.inf)
    n = chains.n_dims
    start = chains.at(line, chainage_m - length_m / 2)[:, :n]
    step = chains.at(line, chainage_m + length_m / 2)[:, :n] - start
    query = positions[:, :n]
    _, k = cKDTree(start + step / 2).query(query)
    size = np.einsum("ij,ij->i", step[k], step[k])
    along = np.einsum("ij,ij->i", query - start[k], step[k])
    part = np.clip(np.divide(along, size, out=np.zeros_like(along), where=size > 0), 0.0, 1.0)
    return np.asarray(np.linalg.norm(start[k] + part[:, None] * step[k] - query, axis=1))
