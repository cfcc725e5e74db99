"""Which lines at a station may be another one than the end of a lane or of the carriageway, by what lies before and behind.

Separate from `samples`, which measures between lines at one station at a time.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from linework.arrays import FloatArray
from linework.evaluation.chainage.crossings import FACE_M, Crossing
from linework.lines.crosscuts import STATION_M
from linework.lines.lane_evidence import TWO_STRIPES_M

#: Edge lines that end go on where they are seen again this near: worn for longer, they are gone. [m]
_SAME_PAINT_M = 100.0
#: Places that differ by more than this are two, 95 times of 100. [standard deviations]
_SURELY = 2.0
#: Least deviation of a distance, and that of lines that state none: the repeatability of good mobile mapping. [m]
_LEAST_SIGMA_M = 0.01


def doubtful_bounds(crossings: list[list[Crossing]]) -> list[set[str]]:
    """Return the names of the lines at each station up to which no lane and no carriageway has a width.

    These are boundaries behind another one, boundaries carried to another edge, and stones with what lies behind them.
    """
    doubts = (_behind_near(crossings), _led_astray(crossings), _about_stones(crossings))
    return [behind | astray | stones for behind, astray, stones in zip(*doubts, strict=True)]


def _blocks_near(n: int) -> Iterator[tuple[slice, list[slice]]]:
    """Yield stations in blocks of `_SAME_PAINT_M`, and the blocks within that of any of these."""
    reach = round(_SAME_PAINT_M / STATION_M)
    blocks = [slice(a, min(a + reach, n)) for a in range(0, n, reach)]
    for i, block in enumerate(blocks):
        yield block, blocks[max(i - 1, 0) : i + 2]


def paint_near(crossings: list[list[Crossing]]) -> list[FloatArray]:
    """Return the offsets [m] of all paint within `_SAME_PAINT_M` of each station, ascending."""
    found: list[FloatArray] = []
    for block, near in _blocks_near(len(crossings)):
        offsets = {
            round(c.offset_m, 1)
            for one in near
            for here in crossings[one]
            for c in here
            if c.kind == "lane_marking"
        }
        found += [np.array(sorted(offsets))] * len(crossings[block])
    return found


def paired_near(crossings: list[list[Crossing]]) -> list[set[tuple[str, int]]]:
    """Return the lines of paint that have another one beside them within `_SAME_PAINT_M` of each station, with its side.

    The side is 1 on the left and -1 on the right. Both are one double line, or two generations of paint.
    """
    found: list[set[tuple[str, int]]] = []
    for block, near in _blocks_near(len(crossings)):
        paired: set[tuple[str, int]] = set()
        for here in (here for one in near for here in crossings[one]):
            paint = [c for c in here if c.kind == "lane_marking"]
            for right, left in pairwise(paint):
                if TWO_STRIPES_M[0] <= left.offset_m - right.offset_m <= TWO_STRIPES_M[1]:
                    paired |= {(right.name, 1), (left.name, -1)}
        found += [paired] * len(crossings[block])
    return found


def _behind_near(crossings: list[list[Crossing]]) -> list[set[str]]:
    """Return the boundaries that lie behind another one of their side within `_SAME_PAINT_M` of each station.

    Where the nearer one is not seen, such a boundary is not known to be the end of the carriageway.
    """
    found: list[set[str]] = []
    for block, near in _blocks_near(len(crossings)):
        behind: set[str] = set()
        for here in (here for one in near for here in crossings[one]):
            edges = [c for c in here if c.kind == "road_boundary"]
            for side in (1.0, -1.0):
                away = [(side * c.offset_m, c.name) for c in edges if side * c.offset_m > FACE_M]
                nearest = min(away, default=(0.0, ""))[0]
                behind |= {name for offset, name in away if offset > nearest + FACE_M}
        found += [behind] * len(crossings[block])
    return found


def _about_stones(crossings: list[list[Crossing]]) -> list[set[str]]:
    """Return the stripes at each station that are stones rather than paint, and the boundaries without a kerb behind them.

    Nobody paints beyond the pavement. A stripe just behind its edge, or behind the front of a gutter, is the row of pale
    stones of a flush kerb: there the carriageway ends, and what lies farther out is the end of a footway, or a house. Within
    `_SAME_PAINT_M` the stripe is one line; so is a boundary that never lies inside it.
    """
    found: list[set[str]] = []
    for block, near in _blocks_near(len(crossings)):
        about = [here for one in near for here in crossings[one]]
        stones = _stones(about)
        sides = [_sides_of_stones(here, stones) for here in about] if stones else []
        behind = {name for _, names in sides for name in names}
        behind -= {name for names, _ in sides for name in names}
        found += [stones | behind | _sides_of_stones(here, stones)[1] for here in crossings[block]]
    return found


def _stones(about: list[list[Crossing]]) -> set[str]:
    """Return the names of the stripes that lie beyond an edge of the pavement, as a mean of the stations where both were measured.

    The errors of a line are much the same from station to station: no mean makes them smaller.
    """
    beyond: dict[tuple[str, str], list[tuple[float, float]]] = {}
    for stripe, edge in (pair for here in about for pair in _stripes_at_edges(here)):
        side = math.copysign(1.0, edge.offset_m)
        sigma_m = max(float(np.nan_to_num(np.hypot(stripe.sigma_xy_m, edge.sigma_xy_m))), _LEAST_SIGMA_M)
        beyond.setdefault((stripe.name, edge.name), []).append(
            (side * (stripe.offset_m - edge.offset_m), sigma_m)
        )
    means = {names: np.mean(pairs, axis=0).tolist() for names, pairs in beyond.items()}
    return {stripe for (stripe, _), (away, sigma) in means.items() if away > _SURELY * sigma}


def _stripes_at_edges(here: list[Crossing]) -> Iterator[tuple[Crossing, Crossing]]:
    """Yield the outermost line of paint on either side with the first edge of the pavement there, where these are within the face of a kerb and both were measured.

    Beyond a median is paint, too: of two lines, the inner one is not at the end of the road. Lines and kerbs of islands in
    the middle of a road are at neither.
    """
    for side in (1.0, -1.0):
        out = sorted((side * c.offset_m, c) for c in here if side * c.offset_m > FACE_M)
        paint = [c for _, c in out if c.kind == "lane_marking"]
        paint = [c for c in paint[-1:] if c.role not in ("centre", "lane")]
        edges = [c for _, c in out if c.kind == "road_boundary" or c.role == "gutter"]
        yield from (
            (stripe, edge)
            for stripe, edge in zip(paint, edges[:1], strict=False)
            if not (stripe.bridged or edge.bridged) and abs(stripe.offset_m - edge.offset_m) <= FACE_M
        )


def _sides_of_stones(here: list[Crossing], stones: set[str]) -> tuple[set[str], set[str]]:
    """Return the names of the boundaries between the axis and stones, and of those behind the stones that are not kerbs."""
    inside, behind = set(), set()
    for stone in (c for c in here if c.name in stones):
        for c in here:
            if c.kind == "road_boundary" and c.offset_m * stone.offset_m > 0.0:
                if abs(c.offset_m) <= abs(stone.offset_m):
                    inside.add(c.name)
                elif c.form != "kerb":
                    behind.add(c.name)
    return inside, behind


def _led_astray(crossings: list[list[Crossing]]) -> list[set[str]]:
    """Return the boundaries at each station that may be another edge, to which a line was carried across a gap.

    Where it goes over by more than the face of a kerb, and was measured for less than it was carried, before or behind the
    gap, nothing but the guess says that this is the same edge.
    """
    runs: dict[str, list[list[tuple[int, Crossing]]]] = {}
    for k, here in enumerate(crossings):
        for c in here:
            if c.kind == "road_boundary":
                own = runs.setdefault(c.name, [[]])
                if own[-1] and own[-1][-1][1].bridged != c.bridged:
                    own.append([])
                own[-1].append((k, c))
    found: list[set[str]] = [set() for _ in crossings]
    for name, own in runs.items():
        for before, gap, behind in zip(own, own[1:], own[2:], strict=False):
            if not gap[0][1].bridged or abs(behind[0][1].offset_m - before[-1][1].offset_m) <= FACE_M:
                continue
            for k in (k for run in (before, behind) if len(run) < len(gap) for k, _ in run):
                found[k].add(name)
    return found
