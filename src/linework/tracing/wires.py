"""The wires of a power line from one of its spans: the same conductor from pole to pole, and those beside it.

Separate from `rails`, which finds the line at a place: this goes on from span to span.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from linework.arrays import FloatArray
from linework.lines.companions import HungWires
from linework.methods.cables.networks import CONTINUES_M, conductors, with_networks
from linework.model.lines import LineSet
from linework.tracing.rails import CORE_M, RailPieces, distance_m

#: A wire that a person has edited is this near to where the points show it. [m]
EDITED_WIRE_M = 0.5
#: Vertices of a wire that are compared with others.
_COMPARED = 9
#: Half of the longest span: the tile of its middle finds it. [m]
HALF_SPAN_M = 300.0
#: Wires of a conductor that are followed at most.
MOST_FOLLOWED_SPANS = 200


def wires_along(pieces: RailPieces, wire: FloatArray) -> HungWires | None:
    """Return the wires that hang with a wire (n, 3) [m, world] from pole to pole; None: the points show none there."""
    lines, n_own = _cables(pieces.each_once_about(wire[:, :2])), 0
    while True:
        own = _same(lines, wire)
        if own is None:
            return None
        numbers = conductors(lines)
        is_own = numbers == numbers[own]
        # Either it has grown, or everything ahead was searched in vain
        if not n_own < np.count_nonzero(is_own) < MOST_FOLLOWED_SPANS:
            break
        n_own = int(np.count_nonzero(is_own))
        for places in _ahead(lines.take(is_own)):
            lines = _cables(pieces.each_once_about(places))
            again, numbers = _same(lines, wire), conductors(lines)
            if again is None or np.count_nonzero(numbers == numbers[again]) > n_own:
                break
    named = with_networks(lines)
    beside = named.circuit == named.circuit[own]
    return HungWires(named.take(beside), is_own[beside])


def _cables(lines: LineSet) -> LineSet:
    return lines.take(lines.kind == "cable")


def _same(lines: LineSet, wire: FloatArray) -> int | None:
    """Return the index of the line that a wire (n, 3) lies on; None: there is none."""
    some = wire[np.unique(np.linspace(0, len(wire) - 1, _COMPARED).astype(np.int64))]
    low, high = some.min(axis=0) - EDITED_WIRE_M, some.max(axis=0) + EDITED_WIRE_M
    best, best_m = None, EDITED_WIRE_M
    for i in range(len(lines)):
        xyz = lines[i].xyz
        if np.any(xyz.max(axis=0) < low) or np.any(xyz.min(axis=0) > high):
            continue
        away_m = float(np.median([distance_m(xyz, place) for place in some]))
        if away_m <= best_m:
            best, best_m = i, away_m
    return best


def _ahead(conductor: LineSet) -> Iterator[FloatArray]:
    """Yield places (k, 2) ever farther beyond the free ends of a conductor. [m]"""  # noqa: D400
    ends = np.concatenate([conductor.xyz[conductor.offsets[:-1]], conductor.xyz[conductor.offsets[1:] - 1]])
    others = np.roll(ends, len(conductor), axis=0)
    apart = np.linalg.norm(ends[:, None] - ends, axis=2) + np.diag(np.full(len(ends), np.inf))
    is_free = apart.min(axis=1) > CONTINUES_M
    out = (ends - others)[is_free, :2]
    out /= np.maximum(np.hypot(*out.T), 1e-9)[:, None]
    for away_m in np.arange(0.25 * CORE_M, HALF_SPAN_M + CORE_M, 0.5 * CORE_M).tolist():
        yield ends[is_free, :2] + away_m * out
