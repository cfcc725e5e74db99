"""Where a painted line ends: gaps that are longer than wear explains, and those at mouths of streets and drives.

Separate from `marking_lines`, which cuts lines there: this judges the gaps.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from linework.arrays import BoolArray, FloatArray, IntArray
from linework.methods.protocol import Sight, visible_share
from linework.methods.tracking.mouths import Mouths
from linework.methods.tracking.pattern import (
    PATCH_M,
    PaintRhythm,
    PatternStretch,
    dashes_of,
    merged_intervals,
)
from linework.model.boxes import BoxSet

#: Paint of two boxes nearer than this is continuous: search areas are half a metre apart. [m]
CLOSE_M = 0.30
#: A line ends at a gap that its wear produces with less than this chance.
GAP_CHANCE = 0.01
#: Longest gap from wear, and longest gap that is never an end. [m]
LONGEST_WORN_M, SHORT_GAP_M = 20.0, 3.0
#: Fewest boxes of a ring: an island of 4 m across has 12 m around it.
LEAST_OF_RING = 24
#: Bounds of the share of a solid line that wear has removed, and of the share of missing dashes: with none or all gone
#: no longest gap follows. [-]
_WORN_SHARE, _MISSING_SHARE = (0.01, 0.99), (0.05, 0.8)


def ends_in_gaps(
    boxes: BoxSet, box: IntArray, stretches: Sequence[PatternStretch], visible: Sight, mouths: Mouths
) -> list[int]:
    """Return the boxes of a track before which its line has ended, as numbers in the track, ascending.

    A gap is an end if road was measured in it, and paint that is as worn as this, with the gap or without it, has one so long
    with less than the chance `GAP_CHANCE`. Where a boundary beside the line is open as well, both must be chance; and such a
    gap says the less about wear, the less likely that is: the mouths of a ring do not explain each other.

    Parameters
    ----------
    box
        (k,) int64: the boxes of the track, in order.
    stretches
        Its patterns along the centres of its boxes.
    """
    t, reach = boxes.along(box), boxes.half_u_m[box]
    gap = (t[1:] - reach[1:]) - (t[:-1] + reach[:-1])
    within = [
        (s, (t >= s.start_m) & (t <= s.end_m), (t[1:] > s.start_m) & (t[:-1] < s.end_m)) for s in stretches
    ]
    shortest = np.zeros(len(gap))
    for stretch, _, touches in within:
        least_m = SHORT_GAP_M if stretch.rhythm is None else stretch.rhythm.period_m
        shortest[touches] = np.maximum(shortest[touches], least_m)
    long = np.flatnonzero(gap > shortest)
    chance = np.ones(len(gap))
    chance[long] = mouths.chances(boxes, box, long)
    longest = np.zeros(len(gap))
    for stretch, inside, touches in within:
        is_own = inside[1:] & inside[:-1]
        if not inside.any():
            own = np.full(len(gap), SHORT_GAP_M)
        elif stretch.rhythm is None:
            own = _longest_worn(float(np.ptp(t[inside])), gap, chance, is_own)
        else:
            own = _longest_missing(t[inside], reach[inside], chance[is_own], stretch.rhythm, chance)
        longest[touches] = np.maximum(longest[touches], own[touches])
    return [
        k + 1
        for k in np.flatnonzero(gap > longest).tolist()
        if visible_share(visible, boxes.centre[box[k]], boxes.centre[box[k + 1]]) > 0.5
    ]


def from_longest_gap(boxes: BoxSet, box: IntArray) -> IntArray:
    """Return the boxes of a track (k,), those of a ring from behind its longest gap on: tracking began it anywhere."""
    step = boxes.centre[box[0], :2] - boxes.centre[box[-1], :2]
    closing = float(np.hypot(*step))
    along = boxes.centre[box[-1], :2] - boxes.centre[box[-2], :2] if len(box) > 1 else step
    if (
        len(box) < LEAST_OF_RING
        or closing > 2.0 * float(boxes.half_u_m[box[[0, -1]]].sum())
        or step @ along <= 0.0
    ):
        return box
    t, reach = boxes.along(box), boxes.half_u_m[box]
    gap = (t[1:] - reach[1:]) - (t[:-1] + reach[:-1])
    k = int(np.argmax(gap))
    return np.roll(box, -(k + 1)) if gap[k] > CLOSE_M else box


def _longest_worn(length_m: float, gap: FloatArray, chance: FloatArray, is_own: BoolArray) -> FloatArray:
    """Return the longest gaps [m] that wear explains in a solid stretch with this much paint left, (n,).

    Gaps that are longer are ends (the mouth of an arm, a crossing), and say nothing about wear. A gap counts as wear only if
    two tests allow its length: the share of the whole stretch that is bare, and the share that is bare outside the gap.
    Otherwise one long gap would be the only evidence of the wear that explains it. Outside, half a patch each of bare and of
    painted line is added: no line is known to be whole.

    Parameters
    ----------
    length_m
        Of the stretch.
    gap, chance
        (n,) all gaps of its track [m], and the chances of what is beside them.
    is_own
        (n,) bool: the gap lies in the stretch.
    """
    limit = np.full(len(gap), LONGEST_WORN_M)
    while True:
        is_worn = is_own & (gap <= limit)
        is_bare = is_worn & (gap > CLOSE_M)
        bare = np.where(is_bare, chance * gap, 0.0)
        # Neither what is an end, nor what may be one
        other = float(gap[is_own & ~is_worn].sum()) + float(((1.0 - chance) * gap)[is_bare].sum())
        all_m = max(length_m - other, 1.0)
        painted_m = max(all_m - float(bare.sum()), 0.0)
        gone = float(np.clip(bare.sum() / all_m, *_WORN_SHARE))
        elsewhere_m = bare.sum() - bare + 0.5 * PATCH_M
        gone_elsewhere = np.clip(elsewhere_m / (elsewhere_m + painted_m + 0.5 * PATCH_M), *_WORN_SHARE)
        # Any patch of paint may be followed by such a gap: the chance is shared among them
        chance_per_patch = GAP_CHANCE / chance / max(painted_m / PATCH_M, 1.0)
        worn_m = PATCH_M * np.minimum(
            np.log(np.minimum(GAP_CHANCE / chance, 1.0)) / math.log(gone),
            np.log(np.minimum(chance_per_patch, 1.0)) / np.log(gone_elsewhere),
        )
        now: FloatArray = np.clip(worn_m, SHORT_GAP_M, LONGEST_WORN_M)
        if not (gap[is_worn] > now[is_worn]).any():
            return now
        limit = np.minimum(limit, now)


def _longest_missing(
    t: FloatArray, reach: FloatArray, chance: FloatArray, rhythm: PaintRhythm, of: FloatArray
) -> FloatArray:
    """Return the longest gaps [m] that worn-off dashes explain in a line with this many dashes left."""
    dashes = dashes_of(merged_intervals(t - reach, t + reach, CLOSE_M), rhythm)
    gap = dashes[1:, 0] - dashes[:-1, 1]
    gone = np.rint((gap + rhythm.dash_m) / rhythm.period_m) - 1.0
    weight = np.ones(len(gap))
    # Between which dashes the gaps with an open boundary are
    beside = np.flatnonzero(chance < 1.0)
    at = np.searchsorted(dashes[:, 0], 0.5 * (t[beside] + t[beside + 1]), side="right") - 1
    is_between = (at >= 0) & (at < len(gap))
    weight[at[is_between]] = chance[beside[is_between]]
    counted = gap <= LONGEST_WORN_M + 2.0 * rhythm.period_m
    missing = float((weight * gone)[counted].sum())
    share = float(np.clip(missing / (missing + len(dashes)), *_MISSING_SHARE))
    return (
        rhythm.period_m * (1.0 + np.log(np.minimum(GAP_CHANCE / of, 1.0)) / math.log(share)) - rhythm.dash_m
    )
