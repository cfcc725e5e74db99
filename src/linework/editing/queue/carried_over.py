"""Carrying review decisions over to a new extraction: reviewed lines stay and are not asked about again."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np

from linework.arrays import BoolArray, FloatArray
from linework.lines.along import line_stretch, places_along, runs_of
from linework.lines.merged import DOUBLE_APART_M, LEAST_MERGED_M, SAME_SHARE, UNCUT_KINDS, distances_beside
from linework.lines.names import with_ids
from linework.model.changes import Change
from linework.model.lines import LINE_COLUMNS, REJECTED_REVIEW, VERTEX_COLUMNS, LineSet

#: A new line that runs along rejected lines for at least this share of its length is the same object again.
MOST = 0.5
#: Kinds whose lines are parts of a line of another kind.
PARTS_OF = {"lane_marking_dash": "lane_marking", "kerb_top": "road_boundary"}


@dataclass(frozen=True, slots=True)
class CarriedReviews:
    """What a new extraction does to the existing lines and to the newly found ones.

    Parameters
    ----------
    stays
        Which of the lines that were there stay as they are.
    new
        What was found and comes in: whole lines, and pieces of those that are there already in part.
    n_again
        How many found lines were left out, or cut, because people have judged what they run along.
    """

    stays: BoolArray
    new: LineSet
    n_again: int


def with_reviews(found: LineSet, there: LineSet, judged: LineSet | None = None) -> LineSet:
    """Return the reviewed lines of `there` and the lines of `found` that are new; see `carry_over_reviews`."""
    kept = carry_over_reviews(found, there, judged)
    return LineSet.concatenate([there.take(kept.stays), kept.new])


def carry_over_reviews(found: LineSet, there: LineSet, judged: LineSet | None = None) -> CarriedReviews:
    """Decide what a new extraction changes.

    Parameters
    ----------
    found
        Lines found anew.
    there
        Lines that are there, those that people judged (a review, a condition or a note) and others.
    judged
        Lines as they were before people changed, moved or deleted them: what is found again at their place, in the
        kind they had then, was judged, too.

    Notes
    -----
    Lines that people judged stay exactly as they are. A found line is left out where it runs along one of them or one
    of `judged` (see `distances_beside`), unless a line that nobody judged is nearer: what goes on beyond stays, in
    pieces of at least `LEAST_MERGED_M`; of what runs along rejected lines for `MOST` of its length nothing does. Dashes and
    arrows are left out or stay whole. Parts of other lines (`PARTS_OF`) go where these are left out. Parts that are
    there, of lines that stay and where no such part was found, stay. All other lines that are there go.
    """
    judged = LineSet.empty(there.crs) if judged is None else judged
    is_said = (there.review != "") | (there.condition != "") | (there.note != "")
    said, free = there.take(is_said), there.take(~is_said)
    stands: list[LineSet] = []
    n_again = 0
    # Lines before their parts
    for kind in sorted(set(found.kind.tolist()), key=lambda k: (k in PARTS_OF, k)):
        own = found.take(found.kind == kind)
        sets = [lines.take(lines.kind == kind) for lines in (said, judged, free)]
        left_out, again, by_free = _left_out(own, *sets)
        if kind in PARTS_OF:
            whole = PARTS_OF[kind]
            left_out |= _without_whole(own, said, judged, stands, whole)
        pieces, n = _pieces(own, left_out, again, by_free)
        stands.append(pieces)
        n_again += n
    new = LineSet.concatenate([LineSet.empty(there.crs), *stands])
    stays = is_said.copy()
    stays[np.flatnonzero(~is_said)] = _parts_that_stay(free, said, new)
    return CarriedReviews(stays, _in_order(new, found, set(there.id[stays].tolist())), n_again)


def _left_out(
    own: LineSet, said: LineSet, judged: LineSet, free: LineSet
) -> tuple[BoolArray, BoolArray, BoolArray]:
    """Return for each place along found lines of a kind whether it lies along a reviewed, a rejected, an unreviewed line."""
    to_said, index = distances_beside(own, said)
    to_free, _ = distances_beside(own, free)
    to_judged, _ = distances_beside(own, judged)
    by_said = np.isfinite(to_said) & (to_said <= to_free)
    left_out = by_said | (np.isfinite(to_judged) & ~np.isfinite(to_free))
    is_out = np.append(said.review == REJECTED_REVIEW, False)
    return left_out, by_said & is_out[index], np.isfinite(to_free)


def _without_whole(
    own: LineSet, said: LineSet, judged: LineSet, stands: list[LineSet], whole: str
) -> BoolArray:
    """Return which places along parts belong to a line that no longer exists."""
    is_in = (said.kind == whole) & (said.review != REJECTED_REVIEW)
    is_out = (said.kind == whole) & (said.review == REJECTED_REVIEW)
    standing = LineSet.concatenate([said.take(is_in), *(lines.take(lines.kind == whole) for lines in stands)])
    gone = LineSet.concatenate([said.take(is_out), judged.take(judged.kind == whole)])
    to_gone, _ = distances_beside(own, gone, DOUBLE_APART_M)
    to_standing, _ = distances_beside(own, standing, DOUBLE_APART_M)
    return np.asarray(to_gone < to_standing, dtype=np.bool_)


def _pieces(own: LineSet, left_out: BoolArray, again: BoolArray, by_free: BoolArray) -> tuple[LineSet, int]:
    """Return the pieces of found lines of a kind to keep, and the number of lines that were cut or dropped."""
    places = places_along(own)
    kept, n = [LineSet.empty(own.crs)], 0
    first = np.searchsorted(places.line, np.arange(len(own) + 1))
    for i in range(len(own)):
        mine = slice(int(first[i]), int(first[i + 1]))
        out, one = left_out[mine], own.take([i])
        if not out.any():
            kept.append(one)
            continue
        at = places.chainage_m[mine]
        if str(one.kind[0]) in UNCUT_KINDS or at[-1] < LEAST_MERGED_M:
            is_same = out.mean() >= SAME_SHARE
            kept += [] if is_same else [one]
            n += bool(is_same)
            continue
        n += 1
        is_again = again[mine].mean() >= MOST
        for k, m in runs_of(~out):
            if at[m] - at[k] >= LEAST_MERGED_M and (not is_again or by_free[mine][k : m + 1].mean() >= MOST):
                kept.append(line_stretch(one, float(at[k]), float(at[m])).with_columns(id=[""]))
    return LineSet.concatenate(kept), n


def _parts_that_stay(free: LineSet, said: LineSet, new: LineSet) -> BoolArray:
    """Return which unreviewed parts belong to lines that stay and were not found again."""
    stays = np.zeros(len(free), dtype=np.bool_)
    for kind, whole in PARTS_OF.items():
        chosen = np.flatnonzero(free.kind == kind)
        if not len(chosen):
            continue
        parts = free.take(chosen)
        own, _ = distances_beside(
            parts, said.take((said.kind == whole) & (said.review != REJECTED_REVIEW)), DOUBLE_APART_M
        )
        found, _ = distances_beside(parts, new.take(new.kind == whole), DOUBLE_APART_M)
        again, _ = distances_beside(parts, new.take(new.kind == kind))
        belongs = _share(parts, np.isfinite(own) & (own <= found)) >= MOST
        stays[chosen] = belongs & (_share(parts, np.isfinite(again)) < SAME_SHARE)
    return stays


def _share(lines: LineSet, flags: BoolArray) -> FloatArray:
    """Return the share of each line's places that are flagged."""
    line = places_along(lines).line
    n = np.bincount(line, minlength=len(lines))
    return np.asarray(np.bincount(line, flags, len(lines)) / n, dtype=np.float64)


def _in_order(new: LineSet, found: LineSet, taken: Collection[str]) -> LineSet:
    """Return lines and pieces in the order of the extraction, each with an id of its own."""
    rank = {kind: k for k, kind in enumerate(dict.fromkeys(found.kind.tolist()))}
    order = np.argsort([rank[kind] for kind in new.kind.tolist()], kind="stable")
    lines = new.take(order) if len(new) else new
    ids = [name if name not in taken else "" for name in lines.id.tolist()]
    return with_ids(lines.with_columns(id=np.array(ids, dtype=np.str_)), {*taken, *found.id.tolist()})


def extraction_change(
    there: LineSet, found: LineSet, kinds: Collection[str], judged: LineSet | None = None
) -> Change:
    """Return the change that an extraction makes to a line file: found lines replace unreviewed ones.

    Parameters
    ----------
    there
        All lines of the drawing.
    kinds
        What was looked for; lines of other kinds stay.
    judged
        See `carry_over_reviews`.
    """
    kept = carry_over_reviews(found, there, judged)
    goes = ~kept.stays & np.isin(there.kind, sorted(kinds))
    free = there.take(~kept.stays & ~goes)
    new = kept.new
    ids = [name if name not in free.id else "" for name in new.id.tolist()]
    new = with_ids(new.with_columns(id=np.array(ids, dtype=np.str_)), set(there.id.tolist()))
    before = there.take(goes)
    same = set(_keys(before)) & set(_keys(new))
    return Change(
        "extract",
        before.take(np.array([key not in same for key in _keys(before)], dtype=np.bool_)),
        new.take(np.array([key not in same for key in _keys(new)], dtype=np.bool_)),
    )


def _keys(lines: LineSet) -> list[tuple[str, ...]]:
    """Return a key per line that is equal only for bitwise equal lines."""
    parts = [getattr(lines, name) for name in ("xyz", *VERTEX_COLUMNS)]
    texts = [getattr(lines, name).tolist() for name in LINE_COLUMNS]
    ends = zip(lines.offsets[:-1].tolist(), lines.offsets[1:].tolist(), strict=True)
    return [
        (*(repr(column[i]) for column in texts), *(part[a:b].tobytes().hex() for part in parts))
        for i, (a, b) in enumerate(ends)
    ]
