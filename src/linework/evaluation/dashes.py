"""Dashes one by one: how many were found, and how far off their ends are."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from linework.arrays import AnyArray, BoolArray, FloatArray, IntArray
from linework.evaluation.honesty import bridged_scores
from linework.evaluation.match import TIE_M, PieceMatch, first_per_query
from linework.evaluation.stations import Stations
from linework.evaluation.tolerance import KindMatch, at_tolerance, error_stats, ratio
from linework.evaluation.values import DashScores, ErrorStats, GroupScores, LabelScores
from linework.model.lines import LineSet

DASH_KIND = "lane_marking_dash"
#: A dash is found if another covers this share of it, and seen if this share of it was observed.
LEAST_DASH_COVER = 0.5


def dash_scores(parts: Sequence[KindMatch], tolerance_m: float) -> DashScores:
    """Score the dashes of some surveys (the lines of kind `DASH_KIND`).

    Parameters
    ----------
    parts
        At least one; each with its own limit for the ends.
    tolerance_m
        How far to the side a dash may be. [m]
    """
    n_reference = n_found = n_right = n_within = 0
    errors_m = [np.zeros(0)]
    for part in parts:
        r_line, e_line = paired_dashes(part.match, tolerance_m)
        is_seen = _seen(part.match)
        end_m, end_seen = end_errors(part.match, r_line, e_line)
        n_reference += int(is_seen.sum())
        n_found += int(is_seen[r_line].sum())
        n_right += len(e_line)
        n_within += int((np.abs(end_m[end_seen]) <= part.dash_end_m + TIE_M).sum())
        errors_m.append(end_m[end_seen])
    ends, n_extracted = np.concatenate(errors_m), sum(len(part.match.extracted) for part in parts)
    return DashScores(
        n_reference=n_reference,
        n_found=n_found,
        n_extracted=n_extracted,
        n_right=n_right,
        share_found=ratio(n_found, n_reference),
        share_right=ratio(n_right, n_extracted),
        end_limit_m=float(np.mean([part.dash_end_m for part in parts])),
        share_ends_within=ratio(n_within, len(ends)),
        ends=error_stats(ends),
    )


def paired_dashes(match: PieceMatch, tolerance_m: float) -> tuple[IntArray, IntArray]:
    """Return (k,) reference and extracted dashes that are each other's largest overlap, half the former or more."""
    found = match.r_nearest.distance_m <= tolerance_m + TIE_M
    n_e = max(len(match.extracted), 1)
    key = match.r_pieces.line[found] * n_e + match.r_nearest.line[found]
    pair, k = np.unique(key, return_inverse=True)
    overlap_m = np.bincount(k, weights=match.r_pieces.length_m[found], minlength=len(pair))
    r_line, e_line = pair // n_e, pair % n_e
    mutual = np.intersect1d(
        first_per_query(r_line, -overlap_m, e_line), first_per_query(e_line, -overlap_m, r_line)
    )
    kept = mutual[overlap_m[mutual] >= LEAST_DASH_COVER * match.reference.length_m[r_line[mutual]] - TIE_M]
    return r_line[kept], e_line[kept]


def end_errors(match: PieceMatch, r_line: IntArray, e_line: IntArray) -> tuple[FloatArray, BoolArray]:
    """Return (k, 2) errors of both ends [m], positive outwards, and (k, 2) bool: was that end observed.

    Both are measured along the reference dash's chord: it is short against any bend.
    """
    e, r = match.extracted, match.reference
    zero = np.zeros(len(r_line))
    start, end = (r.at(r_line, chainage_m)[:, :2] for chainage_m in (zero, r.length_m[r_line]))
    size_m = np.linalg.norm(end - start, axis=1)
    along = (end - start) / np.maximum(size_m, TIE_M)[:, None]
    places_m = np.stack(
        [
            np.einsum("ij,ij->i", e.at(e_line, chainage_m)[:, :2] - start, along)
            for chainage_m in (zero, e.length_m[e_line])
        ]
    )
    errors_m = np.stack([-places_m.min(axis=0), places_m.max(axis=0) - size_m], axis=1)
    first, last = r.lines.offsets[r_line], r.lines.offsets[r_line + 1] - 1
    return errors_m, np.stack([r.lines.observed[first], r.lines.observed[last]], axis=1)


def _seen(match: PieceMatch) -> BoolArray:
    """Return (m_r,) bool: at least half of the dash was observed."""
    length_m = match.r_pieces.length_m * match.r_observed
    seen_m = np.bincount(match.r_pieces.line, weights=length_m, minlength=len(match.reference))
    return np.asarray(
        (match.reference.length_m > 0) & (seen_m >= LEAST_DASH_COVER * match.reference.length_m - TIE_M)
    )


# The words that lines carry: did the extracted line say the same as the reference

#: Words that are compared where the reference has one.
COMPARED_LABELS = ("role", "pattern", "form", "double")


def label_scores(matches: Sequence[PieceMatch], name: str, tolerance_m: float) -> LabelScores:
    """Return for what length of the found reference the extracted line has the same word.

    Parameters
    ----------
    name
        One of `COMPARED_LABELS`. "double" is compared where the reference has a pattern.
    tolerance_m
        A piece of the reference is found if an extracted line is this near; the nearest one counts. [m]
    """
    length_m: Counter[tuple[str, str]] = Counter()
    for m in matches:
        found = np.flatnonzero(m.r_nearest.distance_m <= tolerance_m + TIE_M)
        right = _words(m.reference.lines, name)[m.r_pieces.line[found]]
        said = _words(m.extracted.lines, name)[m.r_nearest.line[found]]
        known = right != ""
        pairs, k = np.unique(np.stack([right[known], said[known]], axis=1), axis=0, return_inverse=True)
        sums_m = np.bincount(k.ravel(), weights=m.r_pieces.length_m[found][known], minlength=len(pairs))
        for pair, sum_m in zip(pairs.tolist(), sums_m.tolist(), strict=True):
            length_m[pair[0], pair[1]] += sum_m
    compared_m = float(sum(length_m.values()))
    right_m = sum(size_m for (a, b), size_m in length_m.items() if a == b)
    mistaken = sorted((-size_m, f"{a} > {b or '-'}") for (a, b), size_m in length_m.items() if a != b)
    return LabelScores(
        compared_m=compared_m,
        share_right=ratio(right_m, compared_m),
        mistaken_m={text: -size_m for size_m, text in mistaken},
    )


def _words(lines: LineSet, name: str) -> AnyArray:
    """Return (m,) str: the word of each line, "" where it has none."""
    if name != "double":
        return np.asarray(getattr(lines, name))
    return np.where(lines.pattern == "", "", np.where(lines.double, "double", "single"))


# Lines of one kind scored apart by a word of theirs: boundaries with and without a kerb, dashed markings

#: The word by which the lines of a kind are scored apart.
GROUPED_BY = {"road_boundary": "form", "lane_marking": "pattern"}


def group_scores(parts: Sequence[KindMatch], kind: str, tolerance_m: float) -> tuple[GroupScores, ...]:
    """Return the measures of each group of a kind by name of the group; () for kinds that have none."""
    if kind not in GROUPED_BY:
        return ()
    words = [_words_of_pieces(part, GROUPED_BY[kind]) for part in parts]
    values = sorted({str(value) for pair in words for column in pair for value in np.unique(column)})
    return tuple(
        _scores(
            [_taken(part, own, value) for part, own in zip(parts, words, strict=True)], value, tolerance_m
        )
        for value in values
    )


def _words_of_pieces(part: KindMatch, name: str) -> tuple[AnyArray, AnyArray]:
    """Return the word of each piece of E and of R: E takes that of the reference beside it, or else its own."""
    m = part.match
    own, right = getattr(m.extracted.lines, name), getattr(m.reference.lines, name)
    words = own[m.e_pieces.line].astype(object)
    beside = m.e_nearest.line >= 0
    words[beside] = right[m.e_nearest.line[beside]]
    return words.astype(np.str_), right[m.r_pieces.line]


def _taken(part: KindMatch, words: tuple[AnyArray, AnyArray], value: str) -> KindMatch:
    """Return the part with the pieces and stations of one group only."""
    m = part.match
    of_e, of_r = (column == value for column in words)
    match = replace(
        m,
        e_pieces=m.e_pieces.take(of_e),
        r_pieces=m.r_pieces.take(of_r),
        e_nearest=m.e_nearest.take(of_e),
        r_nearest=m.r_nearest.take(of_r),
        r_observed=m.r_observed[of_r],
    )
    is_own = getattr(m.reference.lines, GROUPED_BY[part.kind]) == value
    return replace(part, match=match, stations=part.stations.take(is_own[part.stations.line]))


def _scores(parts: Sequence[KindMatch], value: str, tolerance_m: float) -> GroupScores:
    matches = [part.match for part in parts]
    stations = Stations.concatenate([part.stations for part in parts])
    return GroupScores(
        value=value,
        n_reference=sum(len(np.unique(m.r_pieces.line)) for m in matches),
        reference_m=float(sum(m.r_pieces.length_m.sum() for m in matches)),
        observed_m=float(sum(m.r_pieces.length_m[m.r_observed].sum() for m in matches)),
        extracted_m=float(sum(m.e_pieces.length_m.sum() for m in matches)),
        at=at_tolerance(parts, stations, tolerance_m),
        height=attribute_errors(matches, "height_m", tolerance_m),
        bridged=bridged_scores(parts, stations, tolerance_m),
    )


# Errors of values that lines carry: height, width, clearance

#: Per-line values that are compared where both lines have them.
ATTRIBUTES = ("height_m", "width_m", "clearance_m")


def attribute_errors(matches: Sequence[PieceMatch], name: str, tolerance_m: float) -> ErrorStats:
    """Return the errors of a per-line attribute, over the matched length where both lines have it.

    `n` counts extracted lines.
    """
    errors, n = [np.zeros(0)], 0
    for m in matches:
        i = np.flatnonzero(m.e_nearest.distance_m <= tolerance_m + TIE_M)
        e_line, r_line = m.e_pieces.line[i], m.e_nearest.line[i]
        error = getattr(m.extracted.lines, name)[e_line] - getattr(m.reference.lines, name)[r_line]
        errors.append(error)
        n += len(np.unique(e_line[np.isfinite(error)]))
    return error_stats(np.concatenate(errors), n=n)
