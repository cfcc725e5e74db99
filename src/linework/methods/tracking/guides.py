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

from linework.arrays import FloatArray, IntArray, offsets_of
from linework.methods.tracking.fitted import LEAST_PIECE_SCORE
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


def join_along(boxes: BoxSet, tracks: Tracks, guides: Sequence[LineAxis], longest_gap_m: float) -> Tracks:
    """Return the tracks, joined where guides show that they are pieces of one line.

    Parameters
    ----------
    tracks
        Pieces, down to single boxes.
    guides
        Axes of lines, those that are most surely parallel to paint last; short ones are left out.
    longest_gap_m
        Longest gap between two pieces of a line. [m]
    """
    long = [g for g in guides if len(g.xy) * AXIS_STATION_M >= LEAST_GUIDE_M]
    if not long or len(tracks) == 0:
        return tracks
    ends = _ends_on_guides(boxes, tracks, long)
    partner = _partners(ends, longest_gap_m)
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


def _partners(ends: Sequence[_Ends | None], longest_gap_m: float) -> dict[int, int]:
    """Return for each piece the one that continues it, the nearest in chainage and offset first."""
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
            pairs += [(float(cost[j]), members[k], members[int(after[j])]) for j in np.flatnonzero(fits)]
    follows: dict[int, int] = {}
    taken: set[int] = set()
    for _, a, b in sorted(pairs):
        if a not in follows and b not in taken:
            follows[a] = b
            taken.add(b)
    return follows


def _chained(tracks: Tracks, ends: Sequence[_Ends | None], follows: dict[int, int]) -> Tracks:
    """Return the pieces joined as they follow each other."""
    begun = set(follows.values())
    box: list[IntArray] = []
    sense: list[FloatArray] = []
    lengths = []
    for i in range(len(tracks)):
        if i in begun:
            continue
        chain = [i]
        while chain[-1] in follows:
            chain.append(follows[chain[-1]])
        pieces = [tracks.line(k) for k in chain]
        if max(len(own) for own, _ in pieces) < LEAST_BOXES:
            continue
        for k, (own, senses) in zip(chain, pieces, strict=True):
            e = ends[k]
            turned = e is not None and e.is_turned
            box.append(own[::-1] if turned else own)
            sense.append(-senses[::-1] if turned else senses)
        lengths.append(sum(len(own) for own, _ in pieces))
    no_box, no_sense = np.zeros(0, np.int64), np.zeros(0)
    return Tracks(np.concatenate([no_box, *box]), np.concatenate([no_sense, *sense]), offsets_of(lengths))
