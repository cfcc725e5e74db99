"""Merging of the lines of two methods: each feature once, as the line with the smaller sigma."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from linework.arrays import BoolArray, FloatArray, IntArray
from linework.lines.along import PLACE_STEP_M, LinePlaces, line_stretch, places_along, runs_of
from linework.model.lines import LINE_COLUMNS, VERTEX_COLUMNS, LineSet

#: Two lines of one kind are the same feature within this many standard deviations of their difference,
LIKELY = 3.0
#: but always within the width of a stripe (their sigmas may leave out a common error), and never beyond half of the
#: distance of the outer edges of a double line. [m]
SAME_FEATURE_M, DOUBLE_APART_M = 0.15, 0.5
#: Greatest angle between lines of one feature. [deg]
TURN_DEG = 20.0
#: Sigma of a line without one, drawn by hand: the precision of a click on a picture with pixels of 5 cm. [m]
HAND_M = 0.1
#: Least length of a stretch that only one method measured; shorter ones are ends that differ. [m]
LEAST_MERGED_M = 3.0
#: Share of a dash that the other method measured from which it is the same dash; dashes are kept whole or not at all.
SAME_SHARE = 0.3
#: Kinds of short lines that are not cut.
UNCUT_KINDS = ("lane_marking_dash", "road_marking_other")


def merge_line_sets(one: LineSet, other: LineSet) -> LineSet:
    """Merge the lines of two methods, without the stretches that the other method has with a smaller sigma.

    Parameters
    ----------
    one, other
        In the same CRS; lines of one set are different features. `one` is kept where sigmas are equal.

    Returns
    -------
    LineSet
        Lines of `one`, then of `other`. A line that continues where only the other method measured it is one line
        (``method = "obb+stereo"``). Lines that both methods measured have ``disagreement_mean_m`` and
        ``disagreement_rms_m``: the offset of the other line, positive to their left. No vertex is moved: nothing is
        averaged.

    Notes
    -----
    Each feature is decided as a whole: of two lines that run along each other, the one with the smaller root mean
    square of its sigmas over their common stretch is kept there.
    """
    kinds = sorted(set(one.kind.tolist()) | set(other.kind.tolist()))
    parts = [
        part
        for kind in kinds
        for part in _merged_kind(one.take(one.kind == kind), other.take(other.kind == kind), kind)
    ]
    return LineSet.concatenate(parts) if parts else LineSet.empty(one.crs)


@dataclass(frozen=True, slots=True)
class _Piece:
    """A line, or what is kept of one (`is_rest`) whose other part another method measured better."""

    line: LineSet
    is_rest: bool


def _merged_kind(one: LineSet, other: LineSet, kind: str) -> list[LineSet]:
    """Return what is kept of both sets, whose lines are of one kind."""
    if not len(one) or not len(other):
        return [one, other]
    a, b = places_along(one), places_along(other)
    b_of_a, a_of_b = _nearest(a, b), _nearest(b, a)
    contest = _contest(a, b, b_of_a)
    sides = []
    for lines, own, others, k, is_first in ((one, a, b, b_of_a, True), (other, b, a, a_of_b, False)):
        met = k >= 0
        stays = contest.stays(own.line[met], others.line[k[met]], is_first=is_first)
        lost = np.zeros(len(k), dtype=bool)
        lost[met] = ~stays
        offsets = _offsets(own, others, k, stays, len(lines), in_space=kind == "cable")
        sides.append(_kept(lines, own, lost, offsets))
    return _joined(sides[0], sides[1])


def _nearest(a: LinePlaces, b: LinePlaces) -> IntArray:
    """Return the position of `b` nearest to each of `a` on the same feature, (k,) int64; -1 without any."""
    origin = a.xyz[0, :2]
    tree = cKDTree(b.xyz[:, :2] - origin)
    reach_m = float(np.hypot(DOUBLE_APART_M, PLACE_STEP_M))
    distance, index = tree.query(a.xyz[:, :2] - origin, k=min(8, len(b.xyz)), distance_upper_bound=reach_m)
    distance, index = distance.reshape(len(a.xyz), -1), index.reshape(len(a.xyz), -1)
    there = np.minimum(index, len(b.xyz) - 1)
    step = a.xyz[:, None, :2] - b.xyz[there, :2]
    across = np.abs(b.way[there, 0] * step[..., 1] - b.way[there, 1] * step[..., 0])
    along = np.abs(np.sum(b.way[there] * step, axis=2))
    same_way = np.abs(np.sum(b.way[there] * a.way[:, None], axis=2)) >= np.cos(np.radians(TURN_DEG))
    sigma = np.nan_to_num(np.hypot(a.sigma_m[:, None], b.sigma_m[there]))
    within = np.clip(LIKELY * sigma, SAME_FEATURE_M, DOUBLE_APART_M)
    fits = np.isfinite(distance) & same_way & (across <= within) & (along <= PLACE_STEP_M)
    best = np.argmin(np.where(fits, across, np.inf), axis=1)
    rows = np.arange(len(a.xyz))
    return np.where(fits[rows, best], there[rows, best], -1).astype(np.int64)


def _contest(a: LinePlaces, b: LinePlaces, b_of_a: IntArray) -> _Contest:
    """Decide for each pair of lines that run along each other which one is kept."""
    met = b_of_a >= 0
    pairs, owner = np.unique(
        np.stack([a.line[met], b.line[b_of_a[met]]], axis=1), axis=0, return_inverse=True
    )
    owner = owner.reshape(-1)
    # A line without a sigma gives way
    one = np.bincount(owner, np.nan_to_num(a.sigma_m[met] ** 2, nan=np.inf), len(pairs))
    other = np.bincount(owner, np.nan_to_num(b.sigma_m[b_of_a[met]] ** 2, nan=np.inf), len(pairs))
    gives_way = {(int(i), int(j)) for (i, j), loses in zip(pairs, one > other, strict=True) if loses}
    return _Contest(frozenset(gives_way))


@dataclass(frozen=True, slots=True)
class _Contest:
    """Pairs (line of `one`, line of `other`) in which the first gives way; in all others the second does."""

    first_gives_way: frozenset[tuple[int, int]]

    def stays(self, lines: IntArray, others: IntArray, *, is_first: bool) -> BoolArray:
        """Return whether each of `lines` (k,) is kept beside the corresponding one of `others` (k,), (k,) bool."""
        pairs = zip(*((lines, others) if is_first else (others, lines)), strict=True)
        first_stays = np.array([(int(i), int(j)) not in self.first_gives_way for i, j in pairs], dtype=bool)
        return first_stays if is_first else ~first_stays


def _offsets(
    a: LinePlaces, b: LinePlaces, k: IntArray, stays: BoolArray, n_lines: int, *, in_space: bool
) -> FloatArray:
    """Return mean and root mean square of the offset of the other line where each line is kept, (n_lines, 2) [m]."""
    at = np.flatnonzero(k >= 0)[stays]
    line, step, way = a.line[at], b.xyz[k[at]] - a.xyz[at], a.way[at]
    left = way[:, 0] * step[:, 1] - way[:, 1] * step[:, 0]
    size2 = left**2 + (step[:, 2] ** 2 if in_space else 0.0)
    n = np.bincount(line, minlength=n_lines).astype(np.float64)
    with np.errstate(invalid="ignore"):
        mean = np.bincount(line, left, n_lines) / n
        rms = np.sqrt(np.bincount(line, size2, n_lines) / n)
    return np.stack([mean, rms], axis=1)


def _kept(lines: LineSet, places: LinePlaces, lost: BoolArray, offsets: FloatArray) -> list[_Piece]:
    """Return what is kept of the lines: whole, or the stretches that are not lost (k,) bool."""
    compared = lines.with_columns(disagreement_mean_m=offsets[:, 0], disagreement_rms_m=offsets[:, 1])
    pieces = []
    for i in range(len(lines)):
        own = places.line == i
        gone, at = lost[own], places.chainage_m[own]
        one = compared.take([i])
        if not gone.any():
            pieces.append(_Piece(one, is_rest=False))
        elif str(one.kind[0]) in UNCUT_KINDS:
            pieces += [_Piece(one, is_rest=False)] if gone.mean() < SAME_SHARE else []
        else:
            runs = [(at[k], at[m]) for k, m in runs_of(~gone) if at[m] - at[k] >= LEAST_MERGED_M]
            pieces += [_Piece(line_stretch(one, start_m, end_m), is_rest=True) for start_m, end_m in runs]
    return pieces


def _joined(pieces: list[_Piece], others: list[_Piece]) -> list[LineSet]:
    """Return the lines of both sides, each rest joined to the line of the other side that it was cut from.

    No vertex is moved and no gap bridged: a line changes from one method to the other where the better one ends, and
    its `method` names both.
    """
    lines = [piece.line for piece in (*pieces, *others) if not piece.is_rest]
    for piece in (*pieces, *others):
        if not piece.is_rest:
            continue
        grown = piece.line
        # There may be a line at both of its ends
        for _ in range(2):
            k = _continued_by(grown, lines)
            if k is not None:
                grown = _as_one(lines.pop(k), grown)
        lines.append(grown)
    return lines


def _continued_by(rest: LineSet, lines: list[LineSet]) -> int | None:
    """Return the index of a line that ends where the rest begins or ends, in its direction; None without any."""
    for k, line in enumerate(lines):
        apart = np.linalg.norm(line.xyz[[0, -1], None, :2] - rest.xyz[None, [0, -1], :2], axis=2)
        if apart.min() > DOUBLE_APART_M + PLACE_STEP_M or set(line.method[0].split("+")) >= set(
            rest.method[0].split("+")
        ):
            continue
        a, b = (int(v) for v in np.unravel_index(int(np.argmin(apart)), apart.shape))
        outward, inward = _end_way(line.xyz, a), -_end_way(rest.xyz, b)
        if float(outward @ inward) > np.cos(np.radians(TURN_DEG)):
            return k
    return None


def _end_way(xyz: FloatArray, end: int) -> FloatArray:
    """Return the unit direction (2,) outwards at the start (0) or end (1) of a line (n, 3), in plan."""
    run = xyz[:, :2] if end else xyz[::-1, :2]
    inner = run[np.linalg.norm(run - run[-1], axis=1) >= min(1.0, float(np.linalg.norm(run[0] - run[-1])))][
        -1
    ]
    step = run[-1] - inner
    return np.asarray(step / max(float(np.linalg.norm(step)), 1e-9))


def _as_one(line: LineSet, rest: LineSet) -> LineSet:
    """Join a line and the rest that continues it at one of its ends; overlapping vertices are dropped."""
    apart = np.linalg.norm(line.xyz[[0, -1], None, :2] - rest.xyz[None, [0, -1], :2], axis=2)
    a, b = (int(v) for v in np.unravel_index(int(np.argmin(apart)), apart.shape))
    tail = rest if b == 0 else _turned(rest)
    head = line if a == 1 else _turned(line)
    ahead = (tail.xyz[:, :2] - head.xyz[-1, :2]) @ _end_way(head.xyz, 1)
    first = int(np.argmax(ahead > 0.05)) if (ahead > 0.05).any() else len(ahead)
    columns = {
        name: np.concatenate([getattr(head, name), getattr(tail, name)[first:]]) for name in VERTEX_COLUMNS
    }
    columns |= {name: getattr(line, name) for name in LINE_COLUMNS}
    methods = sorted({*line.method[0].split("+"), *rest.method[0].split("+")})
    columns["method"] = np.array(["+".join(methods)])
    columns["time_start_s"] = np.fmin(line.time_start_s, rest.time_start_s)
    columns["time_end_s"] = np.fmax(line.time_end_s, rest.time_end_s)
    both = LineSet.from_lines([np.concatenate([head.xyz, tail.xyz[first:]])], crs=line.crs, **columns)
    return both if a == 1 else _turned(both)


def _turned(line: LineSet) -> LineSet:
    """Return a single line in the opposite direction."""
    columns = {name: getattr(line, name)[::-1] for name in VERTEX_COLUMNS}
    return line.with_columns(xyz=line.xyz[::-1], **columns)


def distances_beside(
    lines: LineSet, others: LineSet, reach_m: float | None = None
) -> tuple[FloatArray, IntArray]:
    """Return the distance of the nearest of `others` from each position along `lines`, and its index.

    Parameters
    ----------
    lines, others
        Of one kind and in the same CRS; at least one line.
    reach_m
        Largest distance [m]; None: three standard deviations of their difference, between `SAME_FEATURE_M` and
        `DOUBLE_APART_M`, plus half of the width of the feature.

    Returns
    -------
    distance_m, index
        (k,) [m] and (k,) int64 for the positions of `places_along`: infinite and -1 where none is in reach. Across the
        line in plan; in space for cables, which hang above each other.
    """
    a = places_along(lines)
    distance, best = np.full(len(a.line), np.inf), np.full(len(a.line), -1, dtype=np.int64)
    if not len(others):
        return distance, best
    b = places_along(others)
    origin = a.xyz[0, :2]
    half = 0.5 * np.fmax(np.nan_to_num(lines.width_m)[a.line], np.nan_to_num(others.width_m).max())
    most = DOUBLE_APART_M + float(half.max()) if reach_m is None else reach_m
    tree = cKDTree(b.xyz[:, :2] - origin)
    near, index = tree.query(
        a.xyz[:, :2] - origin,
        k=min(16, len(b.line)),
        distance_upper_bound=float(np.hypot(most, PLACE_STEP_M)),
    )
    near, index = near.reshape(len(a.line), -1), index.reshape(len(a.line), -1)
    there = np.minimum(index, len(b.line) - 1)
    step = a.xyz[:, None] - b.xyz[there]
    way = b.way[there]
    across = np.abs(way[..., 0] * step[..., 1] - way[..., 1] * step[..., 0])
    if str(lines.kind[0]) == "cable":
        across = np.hypot(across, step[..., 2])
    along = np.abs(np.sum(way * step[..., :2], axis=2))
    same_way = np.abs(np.sum(way * a.way[:, None], axis=2)) >= np.cos(np.radians(TURN_DEG))
    width = 0.5 * np.fmax(
        np.nan_to_num(lines.width_m)[a.line][:, None], np.nan_to_num(others.width_m)[b.line[there]]
    )
    sigma = np.hypot(*(np.nan_to_num(s, nan=HAND_M) for s in (a.sigma_m[:, None], b.sigma_m[there])))
    within = np.clip(LIKELY * sigma, SAME_FEATURE_M, DOUBLE_APART_M) + width if reach_m is None else reach_m
    fits = np.isfinite(near) & same_way & (across <= within) & (along <= PLACE_STEP_M)
    across = np.where(fits, across, np.inf)
    rows, k = np.arange(len(a.line)), np.argmin(across, axis=1)
    distance = across[rows, k]
    return distance, np.where(np.isfinite(distance), b.line[there[rows, k]], -1).astype(np.int64)
