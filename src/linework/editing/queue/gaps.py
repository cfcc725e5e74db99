"""Gaps in lines, found by chainage along the van's trajectory and offset from it."""

from __future__ import annotations

from dataclasses import dataclass
from heapq import heapify, heappop, heappush

import numpy as np

from linework.arrays import FloatArray
from linework.editing.queue.suspects import VIEW_M, Suspect, WasMeasured, view_box
from linework.lines.along import PATH_STEP_M, DrivenPath
from linework.model.lines import LineSet

#: Largest offset from the trajectory; lines beyond belong to another road. [m]
WITHIN_M = 25.0
#: Largest change of offset across a gap: a constant [m] plus a share of the gap [1]; lanes change their width over
#: tens of metres.
GAP_DRIFT_M, GAP_DRIFT_SHARE = 0.20, 0.02
#: Shortest gap that is reported. [m]
LEAST_SUSPECT_GAP_M = 3.0
#: Probability that a line continues: between two aligned pieces, where a road must have an edge, and where a line
#: just ends.
IN_LINE, ALONG_ROAD, JUST_ENDS = 0.9, 0.8, 0.5
#: Kinds that are checked; of the second, only gaps between aligned pieces: rails do end.
_TRACKED = ("lane_marking", "guardrail", "barrier", "fence")
_ENDS_ANYWHERE = ("guardrail", "barrier", "fence")
#: Most that is missing between two such pieces: of thirteen gaps of 7 to 511 m on simulated streets and motorways (seeds 985
#: and 3410 to 3412), 0 to 10 m were. [m]
MOST_MISSING_OF_RAILS_M = 10.0


@dataclass(frozen=True, slots=True)
class _Pieces:
    """Lines of one kind along the trajectory: number, first and last step, and the offsets there [m]."""

    lines: LineSet
    number: tuple[int, ...]
    along: FloatArray
    left_m: FloatArray

    def __len__(self) -> int:
        return len(self.number)

    def end(self, k: int, side: int) -> tuple[str, FloatArray, str]:
        """Return id, place and review of a piece's end (0: its start along the trajectory)."""
        line = self.lines[self.number[k]].xyz
        tips = line[[0, -1], :2]
        return str(self.lines.id[self.number[k]]), tips[side], str(self.lines.review[self.number[k]])


def gap_suspects(lines: LineSet, way: DrivenPath, seen: WasMeasured) -> list[Suspect]:
    """Return gaps in markings and rails, and stretches of the trajectory without a boundary on one side.

    Parameters
    ----------
    lines
        Without rejected ones.
    way
        The van's way; without one nothing is found.
    seen
        Was ground measured there? What is hidden is not missing.
    """
    if len(way) == 0:
        return []
    there = lines.take(np.isin(lines.kind, (*_TRACKED, "road_boundary")))
    found = [gap for kind in _TRACKED for gap in _gaps_of_kind(there, kind, way, seen)]
    return found + [gap for side in (1.0, -1.0) for gap in _bare(there, side, way, seen)]


def _gaps_of_kind(lines: LineSet, kind: str, way: DrivenPath, seen: WasMeasured) -> list[Suspect]:
    pieces = _pieces(lines, kind, way)
    next_of = _next_of(pieces)
    found = []
    for k in range(len(pieces)):
        first, last = _extent(way, pieces.along[k])
        a = (pieces.along[k, 1], pieces.left_m[k, 1])
        if k in next_of:
            m = next_of[k]
            b = (pieces.along[m, 0], pieces.left_m[m, 0])
            found += _gap(pieces, (k, m), (a, b), IN_LINE, way, seen)
        elif kind not in _ENDS_ANYWHERE and not _is_covered(pieces, k, 1):
            found += _gap(pieces, (k, None), (a, (float(last), a[1])), JUST_ENDS, way, seen)
        if k not in next_of.values() and kind not in _ENDS_ANYWHERE and not _is_covered(pieces, k, 0):
            b = (pieces.along[k, 0], pieces.left_m[k, 0])
            found += _gap(pieces, (None, k), ((float(first), b[1]), b), JUST_ENDS, way, seen)
    return found


def _bare(lines: LineSet, side: float, way: DrivenPath, seen: WasMeasured) -> list[Suspect]:
    """Return stretches without a boundary on one side of the trajectory (1: left)."""
    pieces = _pieces(lines, "road_boundary", way, side)
    found = []
    for first, last in way.pieces:
        # From boundary to boundary; the ends of the trajectory count as the first and the last
        here = [k for k in range(len(pieces)) if first <= pieces.along[k].mean() <= last]
        before: int | None = None
        reach = float(first)
        for k in [*sorted(here, key=lambda k: float(pieces.along[k, 0])), None]:
            start = float(last) if k is None else float(pieces.along[k, 0])
            ends = [pieces.left_m[m, i] for m, i in ((before, 1), (k, 0)) if m is not None]
            if ends:
                a, b = (reach, float(ends[0])), (start, float(ends[-1]))
                found += _gap(pieces, (before, k), (a, b), ALONG_ROAD, way, seen)
            if k is not None and pieces.along[k, 1] >= reach:
                before, reach = k, float(pieces.along[k, 1])
    return found


def _gap(
    pieces: _Pieces,
    ends: tuple[int | None, int | None],
    span: tuple[tuple[float, float], tuple[float, float]],
    likely: float,
    way: DrivenPath,
    seen: WasMeasured,
) -> list[Suspect]:
    """Return the gap between two ends, or beyond one end, as a list of one; empty where no data could show the line."""
    (start, left_start), (stop, left_stop) = span
    length_m = (stop - start) * PATH_STEP_M
    if length_m < LEAST_SUSPECT_GAP_M:
        return []
    at = np.linspace(start, stop, max(int(stop - start), 2))
    places = way.places(at, np.linspace(left_start, left_stop, len(at)))
    to_see = float(np.mean(seen(places))) * length_m
    before, behind = (None if k is None else pieces.end(k, 1 - i) for i, k in enumerate(ends))
    if "accepted" in [end[2] for end in (before, behind) if end is not None]:
        return []
    kind = str(pieces.lines.kind[pieces.number[next(k for k in ends if k is not None)]])
    ids = tuple(end[0] for end in (before, behind) if end is not None)
    tip = before[1] if before is not None else behind[1] if behind is not None else places[0]
    side = "left" if left_start > 0 else "right"
    missing_m = min(to_see, MOST_MISSING_OF_RAILS_M) if kind in _ENDS_ANYWHERE else to_see
    reason = (
        f"no road boundary on the {side} for {length_m:.0f} m" if kind == "road_boundary"
        else f"ends; an aligned line starts {length_m:.0f} m further on" if len(ids) == 2
        else f"ends although {to_see:.0f} m of road beyond were measured"
    )  # fmt: skip
    return [
        Suspect(
            type="boundary" if kind == "road_boundary" else "gap",
            ids=ids,
            kind=kind,
            at=(float(tip[0]), float(tip[1])),
            box=view_box(places),
            length_m=likely * missing_m,
            confidence=1.0 - likely,
            reason=reason,
            n_looks=max(length_m / VIEW_M, 1.0) if not ids else 1.0,
        )
    ]


def _pieces(lines: LineSet, kind: str, way: DrivenPath, side: float = 0.0) -> _Pieces:
    """Return the lines of a kind that run along the trajectory, on one side of it."""
    number, along, left = [], [], []
    length_m = lines.length_m
    chosen = np.flatnonzero(lines.kind == kind)
    own = lines.take(chosen)
    every_at, every_off = way.offsets(own.xyz[:, :2], WITHIN_M)
    for k, i in enumerate(chosen.tolist()):
        part = slice(int(own.offsets[k]), int(own.offsets[k + 1]))
        xyz, at, off = own.xyz[part], every_at[part], every_off[part]
        near = np.flatnonzero(np.isfinite(at))
        if len(near) < 2 or (side and np.median(off[near]) * side < 0.0):
            continue
        span = at[near[-1]] - at[near[0]]
        if abs(span) * PATH_STEP_M < 0.5 * float(length_m[i]) * len(near) / len(xyz):
            continue
        ends = near[[0, -1]] if span > 0 else near[[-1, 0]]
        number.append(i if span > 0 else -i - 1)
        along.append(at[ends])
        left.append(off[ends])
    turned = lines
    if any(i < 0 for i in number):
        turned = _turned(lines, [-i - 1 for i in number if i < 0])
    order = [i if i >= 0 else -i - 1 for i in number]
    return _Pieces(turned, tuple(order), np.array(along).reshape(-1, 2), np.array(left).reshape(-1, 2))


def _turned(lines: LineSet, which: list[int]) -> LineSet:
    """Return lines with some of them reversed; only their vertices matter here."""
    index = np.arange(len(lines.xyz))
    for i in which:
        part = slice(int(lines.offsets[i]), int(lines.offsets[i + 1]))
        index[part] = index[part][::-1]
    return lines.with_columns(xyz=lines.xyz[index])


def _next_of(pieces: _Pieces) -> dict[int, int]:
    """Return pairs of pieces, one continuing the other: best fit first, each end used once."""
    start, left_m = pieces.along[:, 0], pieces.left_m[:, 0]
    is_free = np.ones(len(pieces), dtype=np.bool_)

    def best(k: int) -> list[tuple[float, int, int]]:
        """Return how well the best free piece continues one, the piece, and the other; empty where none does."""
        gap = start - pieces.along[k, 1]
        drift = np.abs(left_m - pieces.left_m[k, 1])
        fits = (gap > -1.0) & (drift <= GAP_DRIFT_M + GAP_DRIFT_SHARE * np.maximum(gap, 0.0) * PATH_STEP_M)
        fits &= is_free
        fits[k] = False
        # One metre across weighs as much as fifty along, so that the lines of a double line are not swapped
        cost = np.where(fits, gap + 50.0 * drift, np.inf)
        m = int(np.argmin(cost))
        return [(float(cost[m]), k, m)] if fits[m] else []

    # A list of all pairs took half a minute for 5,000 lines: every line ahead may continue one
    waiting = [pair for k in range(len(pieces)) for pair in best(k)]
    heapify(waiting)
    next_of: dict[int, int] = {}
    while waiting:
        _, k, m = heappop(waiting)
        if is_free[m]:
            next_of[k] = m
            is_free[m] = False
        else:
            for pair in best(k):
                heappush(waiting, pair)
    return next_of


def _is_covered(pieces: _Pieces, k: int, side: int) -> bool:
    """Return whether another piece runs past the end of one: then nothing is missing beyond."""
    at, left_m = pieces.along[k, side], pieces.left_m[k, side]
    runs = (pieces.along[:, 0] <= at) & (pieces.along[:, 1] >= at)
    length = np.maximum(pieces.along[:, 1] - pieces.along[:, 0], 1e-9)
    share = np.clip((at - pieces.along[:, 0]) / length, 0.0, 1.0)
    there_m = pieces.left_m[:, 0] + share * (pieces.left_m[:, 1] - pieces.left_m[:, 0])
    runs[k] = False
    return bool(np.any(runs & (np.abs(there_m - left_m) <= GAP_DRIFT_M)))


def _extent(way: DrivenPath, along: FloatArray) -> tuple[int, int]:
    """Return the first and last step of the trajectory that a piece runs along."""
    middle = float(along.mean())
    return next((p for p in way.pieces if p[0] - 1 <= middle <= p[1] + 1), (int(middle), int(middle)))
