"""Chains: strands followed from many starts, each independently, and linked to whole lines.

A line followed from one start to its end depends on where it was started, and so on how much of it a tile holds.
Here nothing is followed farther than `FAR_REACH_M` from its start, and starts are close together: what is found at a
place depends only on the points about it, whatever the tile.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.spatial import cKDTree

from linework.arrays import AnyArray, BoolArray, FloatArray, IntArray, distance_along, offsets_of
from linework.kernels.radon import follow
from linework.kernels.radon.corridor import NODE_HEADING, NODE_TOP, NODE_X, NODE_Y, START_SCORE
from linework.kernels.radon.follow import NODE_MEASURED, NODE_POINTS, SETTLED
from linework.kernels.tracking.passing import passing
from linework.methods.rails.circles import Bins, CircleConfig

#: Distance that a strand is followed from its start: at least three times that to the next start. [m]
FOLLOW_REACH_M = 24.0
#: The same where it meets no other start: four times the longest bush. [m]
FAR_REACH_M = 48.0
#: Starts within this distance of a clearer one, on its line, are skipped: every place is followed from several. [m]
NEAR_START_M = 8.0
#: Number of columns of a chain: x, y [m, from the bins' origin], top z [m], number of points, measured (1) or not (0).
CHAIN_COLUMNS = 5
#: Columns of a chain: the height of a node, and whether it is measured.
_TOP, _MEASURED = 2, 4
#: Columns of a node that a chain has.
_OF_NODE = (NODE_X, NODE_Y, NODE_TOP, NODE_POINTS, NODE_MEASURED)
#: Fewest nodes of a chain, whatever the setting.
_LEAST_NODES = 4
#: Across, nodes within this many radii of a circle lie on the same line: half of a circle, and its noise.
ACROSS_RADII = 1.25
#: Score of a node followed from one side only, against one followed from both.
_ONE_SIDE = 0.5
#: Chains lie on each other only where they run within 20 degrees: sine of that.
_PARALLEL_SINE = 0.34


@dataclass(frozen=True, slots=True)
class Strands:
    """Strands followed from n starts, the clearest start first: strand i has the nodes offsets[i] to offsets[i + 1].

    Parameters
    ----------
    nodes
        (m, 7) as `linework.kernels.radon.follow.follow_sheets` returns them.
    offsets
        (n + 1,) int64.
    arc_m
        (m,) distance along each strand, 0 at its middle. [m]
    middle
        (n,) int64: node at the start of the strand.
    begin
        (n, 5) the starts.
    """

    nodes: FloatArray
    offsets: IntArray
    arc_m: FloatArray
    middle: IntArray
    begin: FloatArray

    def __len__(self) -> int:
        return len(self.middle)

    def along(self, end: int, to_m: float, at: FloatArray) -> FloatArray:
        """Return the rows (k, 5) of a chain at shares `at` (k,) of the distance `to_m` [m] from a middle to an end."""
        begin, stop = self.offsets[end // 2], self.offsets[end // 2 + 1]
        sign = 1.0 if end % 2 == 0 else -1.0
        s, nodes = self.arc_m[begin:stop], self.nodes[begin:stop]
        return np.column_stack([np.interp(sign * to_m * at, s, nodes[:, k]) for k in _OF_NODE])

    def tail(self, end: int) -> FloatArray:
        """Return the rows (k, 5) of a chain from a strand's middle, excluded, to an end."""
        i = end // 2
        nodes = self.nodes[self.middle[i] + 1 : self.offsets[i + 1]]
        if end % 2 == 1:
            nodes = self.nodes[self.offsets[i] : self.middle[i]][::-1]
        return nodes[:, _OF_NODE]

    def reaching(self, partner: dict[int, StrandLink], n_nodes: int) -> IntArray:
        """Return the strands (k,) with an unlinked end that was cut off `n_nodes` from the middle."""
        ahead, behind = self.offsets[1:] - 1 - self.middle, self.middle - self.offsets[:-1]
        free = np.array([end not in partner for end in range(2 * len(self))], dtype=bool).reshape(-1, 2)
        # A few nodes fewer: nodes at the end that were not measured are removed
        return np.flatnonzero((free & (np.column_stack([ahead, behind]) >= n_nodes - SETTLED)).any(axis=1))

    def replaced(self, longer: Strands) -> Strands:
        """Return the strands with some of them replaced by longer ones from the same starts."""
        at = {tuple(begin): i for i, begin in enumerate(longer.begin.tolist())}
        parts = [
            longer.part(at[key]) if (key := tuple(begin)) in at else self.part(i)
            for i, begin in enumerate(self.begin.tolist())
        ]
        if not parts:
            return self
        offsets = offsets_of([len(nodes) for nodes, *_ in parts])
        return Strands(
            np.concatenate([nodes for nodes, *_ in parts]),
            offsets,
            np.concatenate([arc for _, arc, _ in parts]),
            offsets[:-1] + np.array([middle for *_, middle in parts], dtype=np.int64),
            self.begin,
        )

    def part(self, i: int) -> tuple[FloatArray, FloatArray, int]:
        """Return nodes (k, 7), arc lengths (k,) [m] and the number of the middle of strand i."""
        run = slice(self.offsets[i], self.offsets[i + 1])
        return self.nodes[run], self.arc_m[run], int(self.middle[i] - self.offsets[i])

    def ends_on(self, end: int, i: int, config: CircleConfig) -> bool:
        """Return whether an end of a strand lies on another strand i."""
        last = self.nodes[self.offsets[end // 2 + 1] - 1 if end % 2 == 0 else self.offsets[end // 2]]
        nodes = self.nodes[self.offsets[i] : self.offsets[i + 1]]
        step, angle = last[:NODE_HEADING] - nodes[:, :NODE_HEADING], nodes[:, NODE_HEADING]
        along = step[:, 0] * np.cos(angle) + step[:, 1] * np.sin(angle)
        across = step[:, 1] * np.cos(angle) - step[:, 0] * np.sin(angle)
        return bool(
            np.any((np.abs(along) <= config.spacing_m) & (np.abs(across) <= ACROSS_RADII * config.radius_m))
        )


def chains_from_starts(
    starts: FloatArray,
    bins: Bins,
    band_m: tuple[float, float],
    least_m: float,
    config: CircleConfig,
    followed: Sequence[FloatArray] = (),
) -> list[FloatArray]:
    """Return the chains that circles follow from all starts, (n, 5) each, without overlap.

    Parameters
    ----------
    starts
        (k, 5) as `find_starts` returns them.
    band_m
        Range of heights above the road of the points that are followed. [m]
    least_m
        Shorter chains are dropped. [m]
    followed
        Chains of another band, (n, 5) each: what lies on one of them at its height is the same edge, and left out.

    Returns
    -------
    list of arrays
        Columns: see `CHAIN_COLUMNS`.
    """
    least = max(round(least_m / config.spacing_m), _LEAST_NODES)
    order = np.lexsort((starts[:, NODE_Y], starts[:, NODE_X], -starts[:, START_SCORE]))
    reach, far, near = (round(m / config.spacing_m) for m in (FOLLOW_REACH_M, FAR_REACH_M, NEAR_START_M))
    strands = follow_strands(starts[order], bins, band_m, follow.FollowLimits(least, reach, near), config)
    # Strands that meet no other are followed again, farther
    lonely = strands.begin[strands.reaching(link_strands(strands, bins, config), reach)]
    strands = strands.replaced(
        follow_strands(lonely, bins, band_m, follow.FollowLimits(least, far, -1), config)
    )
    partner = link_strands(strands, bins, config)
    chains = [_assembled(strands, chain, partner, config) for chain in _ordered(len(strands), partner)]
    return _apart_from(followed, _each_place_once(chains, least, config), least, config)


def follow_strands(
    starts: FloatArray,
    bins: Bins,
    band_m: tuple[float, float],
    limits: follow.FollowLimits,
    config: CircleConfig,
) -> Strands:
    """Follow the starts in both directions, in their order.

    Parameters
    ----------
    starts
        (k, 5) as `find_starts` returns them.
    band_m
        Range of heights above the road. [m]
    limits
        Numbers of nodes; see `linework.kernels.radon.follow.FollowLimits`.
    """
    setting = follow.FollowSettings(
        spacing=float(config.spacing_m),
        radius=float(config.radius_m),
        max_gap=float(config.max_gap_m),
        half_along=float(config.spacing_m),
        low=float(band_m[0]),
        high=float(band_m[1]),
        sheet=float(config.sheet_m),
    )
    nodes, offsets, middle, number = follow.follow_sheets(
        bins.points,
        bins.layers,
        (bins.n_x, bins.n_y, bins.cell_m),
        starts,
        setting,
        (config.spacing_m, ACROSS_RADII * config.radius_m),
        limits,
        bins.work,
    )
    arc = distance_along(nodes)[: len(nodes)]
    arc -= np.repeat(arc[middle], np.diff(offsets))
    return Strands(nodes, offsets, arc, middle, starts[number])


@dataclass(frozen=True, slots=True)
class StrandLink:
    """Continuation of an end of a strand: the other end, and the distance of the other strand's middle [m].

    `seen`: the strand itself passes that middle; otherwise only the other one passes this one's.
    """

    end: int
    away_m: float
    seen: bool = True


def link_strands(strands: Strands, bins: Bins, config: CircleConfig) -> dict[int, StrandLink]:
    """Return the links between ends of strands, in both directions.

    End 2 i is ahead of strand i, 2 i + 1 behind it. Two strands are linked when each passes the other's middle, and
    neither meets a nearer one for which that holds. Two of the remaining ends are linked where one strand passes the
    other's middle, and the other one ends on the first on its way back: a gap that is crossed in one direction only.
    """
    pairs, how = passing(
        strands.nodes,
        strands.offsets,
        strands.middle,
        (bins.n_x, bins.n_y, bins.cell_m),
        (config.spacing_m, ACROSS_RADII * config.radius_m),
    )
    away, same = how[:, 0], how[:, 1] > 0
    far = np.abs(away) >= 0.5 * config.spacing_m
    own = (2 * pairs[:, 0] + (away < 0))[far]
    other = (2 * pairs[:, 1] + ((away > 0) == same))[far]
    away, n = np.abs(away[far]), 2 * len(strands)
    mutual = np.isin(own * n + other, other * n + own)
    found = _nearest_of_each_other(n, own[mutual], other[mutual], away[mutual])
    links = {end: StrandLink(to, m) for end, (to, m) in found.items()}

    left = ~mutual & ~np.isin(own, list(links)) & ~np.isin(other, list(links))
    left[left] = [strands.ends_on(b, a // 2, config) for a, b in zip(own[left], other[left], strict=True)]
    one, two, m = own[left], other[left], away[left]
    both_ways = np.r_[one, two], np.r_[two, one], np.r_[m, m]
    seeing = set(zip(one.tolist(), two.tolist(), strict=True))
    for end, (to, m_away) in _nearest_of_each_other(n, *both_ways).items():
        links[end] = StrandLink(to, m_away, seen=(end, to) in seeing)
    return links


def _nearest_of_each_other(
    n: int, own: IntArray, other: IntArray, away: FloatArray
) -> dict[int, tuple[int, float]]:
    """Return the nearest other end of each end, and its distance, where they are the nearest of each other.

    `own`, `other` and `away` are (k,): pairs of ends, and their distances [m].
    """
    order = np.lexsort((other, away))[::-1]
    nearest = np.full(n, -1, dtype=np.int64)
    nearest[own[order]] = order  # the last of several remains: the nearest
    to = np.where(nearest >= 0, other[nearest] if len(other) else -1, -1)
    ends = np.flatnonzero(nearest >= 0)
    ends = ends[to[to[ends]] == ends]
    return {end: (int(to[end]), float(away[nearest[end]])) for end in ends.tolist()}


def _ordered(n: int, partner: dict[int, StrandLink]) -> list[list[int]]:
    """Return the strands in order along each chain, as the ends at which they are left; a ring starts anywhere."""
    chains, done = [], set()
    starts = [e for e in range(2 * n) if e not in partner] + list(range(2 * n))
    for start in starts:
        chain: list[int] = []
        end: int | None = start
        while end is not None and end // 2 not in done:
            done.add(end // 2)
            chain.append(end ^ 1)
            end = partner[end ^ 1].end if end ^ 1 in partner else None
        if chain:
            chains.append(chain)
    return chains


@dataclass(frozen=True, slots=True)
class _Chain:
    """Rows (n, 5) of a chain, and their rank where two chains lie on each other.

    Parameters
    ----------
    far
        (n,) bool: followed far from its start, and from one side only.
    score
        (n,) of the start; half of it where followed from one side only.
    number
        (n,) int64: the strand, which belongs to no other chain.
    """

    rows: FloatArray
    far: BoolArray
    score: FloatArray
    number: IntArray


def _assembled(
    strands: Strands, chain: list[int], partner: dict[int, StrandLink], config: CircleConfig
) -> _Chain:
    """Return the nodes of a chain of strands: evenly spaced, and blended between two middles."""
    near, score = round(NEAR_START_M / config.spacing_m), strands.begin[:, 4]
    is_ring = chain[-1] in partner
    chain = [*chain, chain[0]] if is_ring else chain

    def from_one_side(rows: FloatArray, i: int, steps: IntArray) -> _Chain:
        n = len(rows)
        return _Chain(rows, steps >= near, np.full(n, _ONE_SIDE * score[i]), np.full(n, i))

    def tail(end: int) -> _Chain:
        rows = strands.tail(end)[: 0 if is_ring else None]
        return from_one_side(rows, end // 2, np.arange(len(rows)))

    first = tail(chain[0] ^ 1)
    parts = [_Chain(first.rows[::-1], first.far[::-1], first.score, first.number)]
    for end, following in pairwise(chain):
        link, i, j = partner[end], end // 2, following // 2
        back = partner[link.end]
        rows = _between(strands, end, link, back, config)
        at, n = np.arange(len(rows)), len(rows)
        if link.seen and back.seen:
            least = np.full(n, min(score[i], score[j]))
            parts.append(_Chain(rows, np.zeros(n, dtype=bool), least, np.full(n, max(i, j))))
        else:
            parts.append(from_one_side(rows, i if link.seen else j, at if link.seen else at[::-1]))
    last = chain[-1]
    parts += [
        from_one_side(strands.along(last, 0.0, np.zeros(1)), last // 2, np.zeros(1, np.int64)),
        tail(last),
    ]
    return _Chain(
        np.concatenate([p.rows for p in parts]),
        np.concatenate([p.far for p in parts]),
        np.concatenate([p.score for p in parts]),
        np.concatenate([p.number for p in parts]),
    )


def _between(
    strands: Strands, end: int, link: StrandLink, back: StrandLink, config: CircleConfig
) -> FloatArray:
    """Return the rows from the middle of a strand to that of the next, excluded.

    The nodes of both strands, blended; the same rows in either direction.
    """
    steps = max(round(0.5 * (link.away_m + back.away_m) / config.spacing_m), 1)
    at = np.arange(steps) / steps
    own, other = strands.along(end, link.away_m, at), strands.along(link.end, back.away_m, 1.0 - at)
    if not (link.seen and back.seen):
        rows = own if link.seen else other
        rows[0] = strands.along(end, 0.0, np.zeros(1))[0]
        return rows
    rows = (1.0 - at[:, None]) * own + at[:, None] * other
    rows[:, _MEASURED] = np.minimum(own[:, _MEASURED], other[:, _MEASURED]) >= 0.5
    return np.asarray(rows)


def _each_place_once(chains: list[_Chain], least: int, config: CircleConfig) -> list[FloatArray]:
    """Return the runs of at least `least` nodes on which no chain of higher rank lies.

    A clearer start ranks higher; following from both sides counts twice; what was followed far from one side only
    ranks lowest.
    """
    if not chains:
        return []
    lengths = [len(chain.rows) for chain in chains]
    rows, owner = np.concatenate([c.rows for c in chains]), np.repeat(np.arange(len(chains)), lengths)
    score, number = np.concatenate([c.score for c in chains]), np.concatenate([c.number for c in chains])
    rank = np.empty(len(rows), dtype=np.int64)
    rank[np.lexsort((number, -score, np.concatenate([c.far for c in chains])))] = np.arange(len(rows))
    ahead = np.concatenate([_ahead(chain.rows) for chain in chains])
    near = cKDTree(rows[:, :2]).query_pairs(_reach_of_node(config), output_type="ndarray")
    near = near[owner[near[:, 0]] != owner[near[:, 1]]]
    less = np.where((rank[near[:, 0]] > rank[near[:, 1]])[:, None], near, near[:, ::-1])
    node, over = less.T
    lies_on = _lies_on(rows[node], ahead[node], rows[over], ahead[over], config)
    free = np.ones(len(rows), dtype=bool)
    free[node[lies_on]] = False
    parts = np.split(free, np.cumsum(lengths)[:-1])
    return [
        chain.rows[run] for chain, own in zip(chains, parts, strict=True) for run in long_runs(own, least)
    ]


def _apart_from(
    followed: Sequence[FloatArray], chains: list[FloatArray], least: int, config: CircleConfig
) -> list[FloatArray]:
    """Return the runs of at least `least` nodes of chains that do not lie on those followed before, at their height."""
    if not followed or not chains:
        return chains
    over, rows = np.concatenate(followed), np.concatenate(chains)
    trees, reach_m = (cKDTree(rows[:, :2]), cKDTree(over[:, :2])), _reach_of_node(config)
    near = trees[0].sparse_distance_matrix(trees[1], reach_m, output_type="ndarray")
    i, j = near["i"], near["j"]
    ahead, ahead_over = (np.concatenate([_ahead(c) for c in of_all]) for of_all in (chains, followed))
    same = _lies_on(rows[i], ahead[i], over[j], ahead_over[j], config)
    same &= np.abs(rows[i, _TOP] - over[j, _TOP]) <= config.radius_m
    free = np.ones(len(rows), dtype=bool)
    free[i[same]] = False
    parts = np.split(free, np.cumsum([len(c) for c in chains])[:-1])
    return [chain[run] for chain, own in zip(chains, parts, strict=True) for run in long_runs(own, least)]


def _reach_of_node(config: CircleConfig) -> float:
    """Return how far in plan a node may lie from one that it lies on [m]."""
    return float(np.hypot(config.spacing_m, ACROSS_RADII * config.radius_m))


def _lies_on(
    node: FloatArray, ahead: FloatArray, over: FloatArray, ahead_over: FloatArray, config: CircleConfig
) -> BoolArray:
    """Return which nodes (n, 5) lie in plan on other ones of parallel chains, (n,) bool."""
    step = node[:, :2] - over[:, :2]
    lies_on = np.abs(np.sum(step * ahead_over, axis=1)) <= config.spacing_m
    lies_on &= np.abs(_cross(step, ahead_over)) <= ACROSS_RADII * config.radius_m
    return np.asarray(lies_on & (np.abs(_cross(ahead, ahead_over)) < _PARALLEL_SINE))


def _ahead(rows: FloatArray) -> FloatArray:
    """Return the unit vectors (n, 2) along a chain (n, 5)."""
    step = np.gradient(rows[:, :2], axis=0)
    return np.asarray(step / np.maximum(np.hypot(step[:, :1], step[:, 1:]), 1e-9))


def _cross(a: AnyArray, b: AnyArray) -> FloatArray:
    """Return the cross products (n,) of vectors (n, 2) in plan."""
    return np.asarray(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])


def long_runs(chosen: BoolArray, least: int) -> list[slice]:
    """Return the runs of True of at least `least` in a row.

    >>> long_runs(np.array([True, True, False, True]), 2)
    [slice(0, 2, None)]
    """
    edges = np.flatnonzero(np.diff(np.r_[False, chosen, False].astype(np.int8)))
    return [
        slice(a, b) for a, b in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True) if b - a >= least
    ]
