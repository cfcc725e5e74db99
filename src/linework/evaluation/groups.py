"""Lines of one kind scored apart by a word of theirs: boundaries with and without a kerb, dashed markings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from linework.arrays import AnyArray
from linework.evaluation.attributes import attribute_errors
from linework.evaluation.bridges import bridged_scores
from linework.evaluation.stations import Stations
from linework.evaluation.tolerance import KindMatch, at_tolerance
from linework.evaluation.values import GroupScores

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
