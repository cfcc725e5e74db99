"""The words that lines carry: did the extracted line say the same as the reference."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import numpy as np

from linework.arrays import AnyArray
from linework.evaluation.match import TIE_M, Match
from linework.evaluation.tolerance import ratio
from linework.evaluation.values import LabelScores
from linework.model.lines import LineSet

#: Words that are compared where the reference has one.
LABELS = ("role", "pattern", "form", "double")


def label_scores(matches: Sequence[Match], name: str, tolerance_m: float) -> LabelScores:
    """Return for what length of the found reference the extracted line has the same word.

    Parameters
    ----------
    name
        One of `LABELS`. "double" is compared where the reference has a pattern.
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
