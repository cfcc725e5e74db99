"""Lines of paint beside others: strips of stone, and what scrapers left of older lines.

Separate from `joining`, which takes the steps: this weighs lines against the paint that they lie beside.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree
from scipy.special import expit

from linework.arrays import FloatArray, IntArray
from linework.methods.obb.candidates import Candidate, left_out
from linework.methods.tracking.against_paint import (
    BESIDE_LOG_ODDS,
    DRAWN_TOGETHER_M,
    FAINTER_STRIP,
    STRIP_BESIDE,
    chances_beside_paint,
    median_contrast,
)
from linework.methods.tracking.fitted import LEAST_PIECE_SCORE
from linework.methods.tracking.marking_lines import SmoothMarking
from linework.methods.tracking.neighbours import LineAxis, find_neighbours
from linework.model.boxes import BoxSet

#: Paint is whole somewhere on every tenth of a line that can still be seen. [-]
WHOLE_QUANTILE = 0.9
#: Standard deviation of the logarithm of the ratio of contrasts of two lines where they are whole. Twice what those of the true
#: lines side by side of repainted roads 18001 to 18003, 18039 and 18040 differ by (0.13), 2026-12-01: the simulator's older
#: paint is worn, but as bright as the newer.
WHOLE_PAINT = 0.25
#: Fewest boxes whose brightest tenth is known.
LEAST_OF_TENTH = 4
#: Asphalt reflects 5 % of the light and more, paint all of it at most: beyond this ratio, less one, the road reads next to
#: nothing, and the ratio is that of its noise.
MOST_EXCESS = 19.0
#: A line lies beside another one if it does at more than this share of its stations.
_MOST = 0.5
#: Why a line is more likely something else than paint.
REMAINS = "remains of an older line: even the brightest of it is fainter than the paint beside it"


def without_strips(
    markings: Sequence[SmoothMarking],
    axes: Sequence[LineAxis],
    stripes: BoxSet,
    rails: Sequence[SmoothMarking],
    rail_axes: Sequence[LineAxis],
) -> tuple[list[SmoothMarking], list[Candidate]]:
    """Return markings that are no strips of stone beside paint or rails, as sure as that leaves them, and the strips.

    Parameters
    ----------
    markings, axes
        (m,), and their axes.
    stripes
        The boxes that they were tracked through.
    rails, rail_axes
        Lines that are narrower than paint, and their axes.
    """
    known, is_rail = [*markings, *rails], np.arange(len(markings) + len(rails)) >= len(markings)
    contrast = np.array([median_contrast(stripes, m.boxes) for m in known])
    width_m, confidence = (np.array([getattr(m, name) for m in known]) for name in ("width_m", "confidence"))
    chance = chances_beside_paint([*axes, *rail_axes], contrast, width_m, confidence, is_rail)[
        : len(markings)
    ]
    return _as_sure(markings, chance), _unlikely(markings, chance, "lane_marking", STRIP_BESIDE)


def without_remains(
    markings: Sequence[SmoothMarking],
    other: Sequence[SmoothMarking],
    axes: Sequence[LineAxis],
    stripes: BoxSet,
) -> tuple[list[SmoothMarking], list[SmoothMarking], list[Candidate]]:
    """Return markings and other paint that are no remains of older lines, as sure as that leaves them, and the remains.

    Parameters
    ----------
    markings, other, axes
        (m,) and (k,), and the axes of all. Only beside markings something is weighed.
    stripes
        The boxes that they were tracked through.
    """
    every = [*markings, *other]
    confidence = np.array([one.confidence for one in every])
    confidence[len(markings) :] = 0.0
    chance = chances_as_whole_paint(axes, [one.boxes for one in every], stripes, confidence)
    own, others = chance[: len(markings)], chance[len(markings) :]
    remains = [
        *_unlikely(markings, own, "lane_marking", REMAINS),
        *_unlikely(other, others, "road_marking_other", REMAINS),
    ]
    return _as_sure(markings, own), _as_sure(other, others), remains


def _as_sure(lines: Sequence[SmoothMarking], chance: FloatArray) -> list[SmoothMarking]:
    """Return the lines that are more likely paint than not, as sure as that leaves them."""
    each = zip(lines, chance.tolist(), strict=True)
    return [replace(line, confidence=line.confidence * c) for line, c in each if c >= LEAST_PIECE_SCORE]


def _unlikely(lines: Sequence[SmoothMarking], chance: FloatArray, kind: str, why: str) -> list[Candidate]:
    return left_out(lines, kind, np.where(chance < LEAST_PIECE_SCORE, why, ""))


def chances_as_whole_paint(
    axes: Sequence[LineAxis], line_boxes: Sequence[IntArray], stripes: BoxSet, confidence: FloatArray
) -> FloatArray:
    """Return the chance that each line is paint by the brightest of it, beside other lines, (m,).

    Wear takes paint away from places: what is left of an older line is about as bright as the newer one beside it. What a
    scraper or a cover of tar leaves is faint, or dark, everywhere. Lines are compared where both are, as the asphalt is not
    equally bright everywhere.

    Parameters
    ----------
    axes
        (m,) of lines.
    line_boxes
        The boxes of each, of `stripes`.
    confidence
        (m,) that each is paint: what is less sure says less about what is beside it.
    """
    chance = np.ones(len(axes))
    n = find_neighbours(axes, DRAWN_TOGETHER_M)
    for i in np.unique(n.line).tolist():
        for j in np.unique(n.other[n.line == i]).tolist():
            beside = len(np.unique(n.station[(n.line == i) & (n.other == j)]))
            fainter = (
                _fainter(stripes, line_boxes[i], line_boxes[j]) if beside > _MOST * len(axes[i].xy) else 0.0
            )
            if fainter < 0.0:
                paint = -0.5 * (fainter / WHOLE_PAINT) ** 2 - math.log(math.sqrt(2.0 * math.pi) * WHOLE_PAINT)
                odds = BESIDE_LOG_ODDS + paint + math.log(FAINTER_STRIP)
                chance[i] = min(chance[i], 1.0 - confidence[j] * float(expit(-odds)))
    return chance


def _fainter(stripes: BoxSet, own: IntArray, other: IntArray) -> float:
    """Return the logarithm of the ratio of the brightest tenths of two lines, where both are; 0 where it is unknown.

    Both differences from the road are taken as shares of the same road: where the zero of the intensity lies does not count,
    but where the road reads next to nothing.
    """
    excess = stripes.contrast - 1.0
    is_known = (excess > 0.0) & (excess < MOST_EXCESS)
    known_own, known_other = (box[is_known[box]] for box in (own, other))
    for box, known in ((own, known_own), (other, known_other)):
        if len(known) < LEAST_OF_TENTH or 2 * len(known) <= len(box):
            return 0.0
    _, nearest = cKDTree(stripes.centre[known_other, :2]).query(stripes.centre[known_own, :2])
    beside = known_other[np.unique(nearest)]
    least, most = (float(np.quantile(excess[box], WHOLE_QUANTILE)) for box in (known_own, beside))
    return math.log(least / most)
