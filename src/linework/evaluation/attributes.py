"""Scores of the attributes of lines: role, pattern and form, values such as the height, and groups by attribute."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from linework.arrays import AnyArray
from linework.evaluation.calibration import bridged_scores
from linework.evaluation.match import TIE_M, PieceMatch
from linework.evaluation.stations import Stations
from linework.evaluation.tolerance import KindMatch, at_tolerance, error_stats, ratio
from linework.evaluation.values import ErrorStats, GroupScores, LabelScores
from linework.model.lines import LineSet

#: Attributes that are compared where the reference has them.
COMPARED_LABELS = ("role", "pattern", "form", "double", "n_beams")


def label_scores(matches: Sequence[PieceMatch], name: str, tolerance_m: float) -> LabelScores:
    """Return over which length of the found reference the extracted line has the same attribute.

    Parameters
    ----------
    name
        One of `COMPARED_LABELS`. "double" is compared where the reference has a pattern.
    tolerance_m
        A piece of the reference is found if an extracted line is within this distance; the nearest one counts. [m]
    """
    length_m: Counter[tuple[str, str]] = Counter()
    for m in matches:
        found = np.flatnonzero(m.r_nearest.distance_m <= tolerance_m + TIE_M)
        right = _texts(m.reference.lines, name)[m.r_pieces.line[found]]
        given = _texts(m.extracted.lines, name)[m.r_nearest.line[found]]
        known = right != ""
        pairs, k = np.unique(np.stack([right[known], given[known]], axis=1), axis=0, return_inverse=True)
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


def _texts(lines: LineSet, name: str) -> AnyArray:
    """Return (m,) str: the attribute of each line, "" where it has none."""
    if name == "n_beams":
        return np.array(["" if np.isnan(n) else f"{n:g}" for n in lines.n_beams], dtype=np.str_)
    if name != "double":
        return np.asarray(getattr(lines, name))
    return np.where(lines.pattern == "", "", np.where(lines.double, "double", "single"))


#: Values of lines that are compared where both lines have them.
ATTRIBUTES = ("height_m", "lower_m", "width_m", "clearance_m")


def attribute_errors(matches: Sequence[PieceMatch], name: str, tolerance_m: float) -> ErrorStats:
    """Return the errors of a value of lines over the matched length where both lines have it.

    Their `n` counts extracted lines.
    """
    errors, n = [np.zeros(0)], 0
    for m in matches:
        i = np.flatnonzero(m.e_nearest.distance_m <= tolerance_m + TIE_M)
        e_line, r_line = m.e_pieces.line[i], m.e_nearest.line[i]
        error = getattr(m.extracted.lines, name)[e_line] - getattr(m.reference.lines, name)[r_line]
        errors.append(error)
        n += len(np.unique(e_line[np.isfinite(error)]))
    return error_stats(np.concatenate(errors), n=n)


#: The attribute by which the lines of a kind are also scored in groups.
GROUPED_BY = {"road_boundary": "form", "lane_marking": "pattern"}


def group_scores(parts: Sequence[KindMatch], kind: str, tolerance_m: float) -> tuple[GroupScores, ...]:
    """Return the measures of each group of a kind, sorted by name; () for kinds without groups."""
    if kind not in GROUPED_BY:
        return ()
    of_pieces = [_values_of_pieces(part, GROUPED_BY[kind]) for part in parts]
    values = sorted({str(value) for pair in of_pieces for column in pair for value in np.unique(column)})
    return tuple(
        _group_scores(
            [_taken(part, own, value) for part, own in zip(parts, of_pieces, strict=True)], value, tolerance_m
        )
        for value in values
    )


def _values_of_pieces(part: KindMatch, name: str) -> tuple[AnyArray, AnyArray]:
    """Return (k_e,) and (k_r,) str: the group of each piece of E and of R.

    A piece of E takes the group of the reference beside it, or its own where there is none.
    """
    m = part.match
    own, right = getattr(m.extracted.lines, name), getattr(m.reference.lines, name)
    groups = own[m.e_pieces.line].astype(object)
    beside = m.e_nearest.line >= 0
    groups[beside] = right[m.e_nearest.line[beside]]
    return groups.astype(np.str_), right[m.r_pieces.line]


def _taken(part: KindMatch, groups: tuple[AnyArray, AnyArray], value: str) -> KindMatch:
    """Return the match with the pieces and stations of one group only."""
    m = part.match
    of_e, of_r = (column == value for column in groups)
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


def _group_scores(parts: Sequence[KindMatch], value: str, tolerance_m: float) -> GroupScores:
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
