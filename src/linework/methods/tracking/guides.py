"""Worn lines joined along guides: the long lines that run beside them.

The remains of a worn dash are a box or two, too few for a direction of their own. Beside a guide (other paint, a
boundary, the vehicle's path) a piece has a chainage along the guide and an offset from it, and pieces of one line have
one offset. So pieces are joined over gaps that tracking alone would not cross.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from linework.arrays import BoolArray, FloatArray, IntArray, offsets_of
from linework.methods.tracking.fitted import LEAST_PIECE_SCORE
from linework.methods.tracking.line_ends import SHORT_GAP_M
from linework.methods.tracking.neighbours import AXIS_STATION_M, LineAxis
from linework.methods.tracking.track import Tracks
from linework.model.boxes import BoxSet

#: Shortest line that is a guide, and how far to its sides it guides. [m]
LEAST_GUIDE_M, GUIDE_REACH_M = 25.0, 15.0
#: Pieces run along their guide within 10 degrees, the accuracy of the direction of one box: cosine.
LEAST_COSINE = 0.985
#: A line does not guide its own pieces, which end where it does: lines side by side have 0.1 m and more between them, and
#: their own width. [m]
OWN_LINE_M = 0.1
#: Fewest boxes of the largest piece of a line: single boxes alone are noise.
LEAST_BOXES = 3
#: Largest difference of the offsets of one line's pieces [m], and its growth per metre of gap: lines run parallel to a
#: few centimetres, carriageways widen by 1 in 50 at most, markings by less.
OFFSET_M, OFFSET_PER_M = 0.06, 0.004
#: A piece is beside a guide if it lies no farther beyond its end than this, in stations.
BEYOND_END = 1.5


@dataclass(frozen=True, slots=True)
class _Ends:
    """Chainage and offset of a piece's two ends on a guide, ascending, and whether the piece runs against it."""

    guide: int
    start: tuple[float, float]
    end: tuple[float, float]
    is_turned: bool

    def at(self, *, is_last: bool) -> tuple[float, float]:
        """Return chainage and offset of the piece's last end, or its first one."""
        return self.end if is_last != self.is_turned else self.start


@dataclass(frozen=True, slots=True)
class Jumps:
    """Tracks cut where they jump from one line to another beside it, and what joined them.

    Parameters
    ----------
    tracks
        The pieces, in the order of the tracks.
    links
        (cost [m], end, end) of each cut; the ends of piece i are 2 i and 2 i + 1.
    """

    tracks: Tracks
    links: Sequence[tuple[float, int, int]] = ()


def cut_at_jumps(boxes: BoxSet, tracks: Tracks, guides: Sequence[LineAxis]) -> Jumps:
    """Return the tracks, cut in gaps that they cross at an angle to the line beside them.

    Where two dashed lines lie side by side, old and new, a dash leads as well to the one as to the other: its direction is
    not known well enough. The distance from a solid line beside them is.

    Parameters
    ----------
    guides
        Axes of lines that were measured all along, the longest last.
    """
    long = [g for g in guides if len(g.xy) * AXIS_STATION_M >= LEAST_GUIDE_M]
    if not long or len(tracks) == 0:
        return Jumps(tracks)
    is_start = np.zeros(len(tracks.box), dtype=np.bool_)
    is_start[tracks.offsets[:-1]] = True
    is_gap = ~is_start
    step = np.linalg.norm(np.diff(boxes.centre[tracks.box, :2], axis=0), axis=1)
    reach = boxes.half_u_m[tracks.box]
    is_gap[1:] &= step - reach[1:] - reach[:-1] > SHORT_GAP_M
    parts = _split(tracks, is_start | is_gap)
    ends = _ends_on_guides(boxes, parts, long)
    jump_m = np.zeros(len(tracks.box))
    for k in np.flatnonzero(is_gap[parts.offsets[:-1]]).tolist():
        jump_m[parts.offsets[k]] = _jump_cost(ends[k - 1], ends[k])
    cut = _split(tracks, is_start | (jump_m > 0.0))
    cost = jump_m[cut.offsets[:-1]]
    return Jumps(cut, [(float(cost[k]), 2 * k - 1, 2 * k) for k in np.flatnonzero(cost).tolist()])


def _split(tracks: Tracks, is_start: BoolArray) -> Tracks:
    """Return the tracks cut before boxes (n,), the first ones of tracks among them."""
    return Tracks(tracks.box, tracks.sense, np.append(np.flatnonzero(is_start), len(tracks.box)))


def _jump_cost(before: _Ends | None, behind: _Ends | None) -> float:
    """Return what it costs to join two pieces that are not of one line [m], 0 where they may be of one."""
    if before is None or behind is None or before.guide != behind.guide:
        return 0.0
    (from_m, from_off), (to_m, to_off) = before.at(is_last=True), behind.at(is_last=False)
    gap, off = abs(to_m - from_m), abs(to_off - from_off)
    return gap + off / OFFSET_PER_M if off > OFFSET_M + OFFSET_PER_M * gap else 0.0


def join_along(
    boxes: BoxSet,
    tracks: Tracks,
    guides: Sequence[LineAxis],
    longest_gap_m: float,
    links: Sequence[tuple[float, int, int]] = (),
) -> Tracks:
    """Return the tracks, joined where guides show that they are pieces of one line.

    Parameters
    ----------
    tracks
        Pieces, down to single boxes.
    guides
        Axes of lines, those that are most surely parallel to paint last; short ones are left out.
    longest_gap_m
        Longest gap between two pieces of a line. [m]
    links
        What joins them already, and what it costs, see `Jumps`: it holds where nothing fits better.
    """
    long = [g for g in guides if len(g.xy) * AXIS_STATION_M >= LEAST_GUIDE_M]
    if not long or len(tracks) == 0:
        return tracks
    ends = _ends_on_guides(boxes, tracks, long)
    partner = _partners([*links, *_pairs(ends, longest_gap_m)])
    return _chained(tracks, ends, partner)


def by_length(guides: Sequence[LineAxis]) -> list[LineAxis]:
    """Return guides, the longest last."""
    return sorted(guides, key=lambda guide: len(guide.xy))


def drop_unlikely_pieces(pieces: Tracks, score: FloatArray) -> Tracks:
    """Return the pieces without the small ones that more likely belong to no line, by their boxes' scores (n,)."""
    n = np.diff(pieces.offsets)
    total = np.add.reduceat(score[pieces.box], pieces.offsets[:-1]) if len(n) else np.zeros(0)
    return pieces.take((n >= LEAST_BOXES) | (total >= LEAST_PIECE_SCORE * n))


def _ends_on_guides(boxes: BoxSet, tracks: Tracks, guides: Sequence[LineAxis]) -> list[_Ends | None]:
    """Return the place of each piece beside the last guide within reach that it runs along, None without one."""
    found: list[_Ends | None] = [None] * len(tracks)
    middle = np.array([box[len(box) // 2] for box in (tracks.line(i)[0] for i in range(len(tracks)))])
    xy, u = boxes.centre[middle, :2], boxes.u[middle]
    for number, guide in enumerate(guides):
        low, high = guide.xy.min(axis=0) - GUIDE_REACH_M, guide.xy.max(axis=0) + GUIDE_REACH_M
        near = np.flatnonzero(np.all((xy >= low) & (xy <= high), axis=1))
        tree = cKDTree(guide.xy)
        distance, station = tree.query(xy[near], distance_upper_bound=GUIDE_REACH_M)
        beside = np.isfinite(distance)
        near, normal = near[beside], guide.normal[station[beside]]
        cosine = np.abs(u[near, 0] * normal[:, 1] - u[near, 1] * normal[:, 0])
        for i in near[cosine >= LEAST_COSINE].tolist():
            found[i] = _ends(boxes, tracks.line(i)[0], guide, tree, number) or found[i]
    return found


def _ends(boxes: BoxSet, box: IntArray, guide: LineAxis, tree: cKDTree, number: int) -> _Ends | None:
    """Return the place of a piece beside a guide, None beyond its ends and where it is part of the guide itself."""
    places = boxes.centre[box[[0, -1]], :2]
    _, station = tree.query(places)
    step = places - guide.xy[station]
    along = np.column_stack([guide.normal[station, 1], -guide.normal[station, 0]])
    chainage = station * _spacing(guide) + np.sum(step * along, axis=1)
    offset = np.sum(step * guide.normal[station], axis=1)
    if np.abs(np.sum(step * along, axis=1)).max() > BEYOND_END * AXIS_STATION_M:
        return None
    if np.abs(offset).max() < OWN_LINE_M:
        return None
    a, b = sorted(zip(chainage.tolist(), offset.tolist(), strict=True))
    return _Ends(number, a, b, bool(chainage[1] < chainage[0]))


def _spacing(guide: LineAxis) -> float:
    """Return the distance of a guide's stations [m]."""
    return float(np.hypot(*np.diff(guide.xy, axis=0).T).mean()) if len(guide.xy) > 1 else AXIS_STATION_M


def _pairs(ends: Sequence[_Ends | None], longest_gap_m: float) -> list[tuple[float, int, int]]:
    """Return the ends of pieces that may continue each other, and what it costs to join them [m]."""
    by_guide: dict[int, list[int]] = {}
    for i, e in enumerate(ends):
        if e is not None:
            by_guide.setdefault(e.guide, []).append(i)
    pairs: list[tuple[float, int, int]] = []
    for members in by_guide.values():
        known = [e for i in members if (e := ends[i]) is not None]
        start = np.array([e.start for e in known])
        order = np.argsort(start[:, 0], kind="stable")
        chainage = start[order, 0]
        for k, e in enumerate(known):
            low, high = np.searchsorted(chainage, [e.end[0], e.end[0] + longest_gap_m])
            after = order[low:high]
            gap = start[after, 0] - e.end[0]
            off = np.abs(start[after, 1] - e.end[1])
            fits = (off <= OFFSET_M + OFFSET_PER_M * gap) & (after != k)
            cost = gap + off / OFFSET_PER_M
            last = 2 * members[k] + (not e.is_turned)
            for j in np.flatnonzero(fits).tolist():
                other = int(after[j])
                pairs.append((float(cost[j]), last, 2 * members[other] + known[other].is_turned))
    return pairs


def _partners(pairs: Sequence[tuple[float, int, int]]) -> dict[int, int]:
    """Return for each end of a piece the one that continues it, the nearest in chainage and offset first."""
    partner: dict[int, int] = {}
    for _, a, b in sorted(pairs):
        if a not in partner and b not in partner:
            partner[a], partner[b] = b, a
    return partner


def _chained(tracks: Tracks, ends: Sequence[_Ends | None], partner: dict[int, int]) -> Tracks:
    """Return the pieces joined as their ends are, each line along its guide."""
    done: BoolArray = np.zeros(len(tracks), dtype=np.bool_)
    box: list[IntArray] = []
    sense: list[FloatArray] = []
    lengths = []
    # Ends without a partner first: only rings are left for the second round
    for start in [e for e in range(2 * len(tracks)) if e not in partner] + list(range(2 * len(tracks))):
        chain: list[int] = []
        end: int | None = start
        while end is not None and not done[end // 2]:
            done[end // 2] = True
            chain.append(end)
            end = partner.get(end ^ 1)
        if not chain or max(len(tracks.line(e // 2)[0]) for e in chain) < LEAST_BOXES:
            continue
        for e in _along_guide(chain, ends):
            own, senses = tracks.line(e // 2)
            box.append(own[::-1] if e % 2 else own)
            sense.append(-senses[::-1] if e % 2 else senses)
        lengths.append(sum(len(tracks.line(e // 2)[0]) for e in chain))
    no_box, no_sense = np.zeros(0, np.int64), np.zeros(0)
    return Tracks(np.concatenate([no_box, *box]), np.concatenate([no_sense, *sense]), offsets_of(lengths))


def _along_guide(chain: Sequence[int], ends: Sequence[_Ends | None]) -> list[int]:
    """Return a chain, given by the end of each piece that it enters by, as its first piece with a guide runs along that."""
    for e in chain:
        known = ends[e // 2]
        if known is not None:
            return list(chain) if bool(e % 2) == known.is_turned else [e ^ 1 for e in reversed(chain)]
    return list(chain)
