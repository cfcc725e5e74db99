"""What speaks for a boundary, and for a carriageway behind it.

Separate from `joining`, which takes the steps: these are the figures that it decides by.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from linework.arrays import BoolArray
from linework.kernels.boundaries.change_boxes import GAIN_SCALE
from linework.methods.tracking.arrangement import (
    BEHIND_KERB_M,
    FACING_M,
    SEAM_M,
    nearest_per_station,
    share_of_stations,
)
from linework.methods.tracking.boundary_lines import SmoothBoundary
from linework.methods.tracking.line_odds import FREE_DASHES
from linework.methods.tracking.marking_lines import SmoothMarking
from linework.methods.tracking.neighbours import LineAxis, find_neighbours

#: Fewest dashes that show a carriageway: period, phase and length are fitted to three, and as many again lie
#: where these say.
DASHES_OF_ROAD = 2 * FREE_DASHES
#: There is a carriageway behind a kerb if its dashes are beside it at more than this share of its stations.
_MOST = 0.5


def may_be_bank(boundary: SmoothBoundary) -> bool:
    """Return whether a boundary is a kerb by its step alone: most of its boxes do not tell stone and paving from soil."""
    unknown = np.count_nonzero(np.isnan(boundary.rougher))
    return bool(boundary.form == "kerb" and 2 * unknown > len(boundary.rougher))


def evidence_of(boundary: SmoothBoundary) -> float:
    """Return the log-likelihood that a boundary is one, over all its boxes; inf for kerbs that are no banks."""
    if boundary.form == "kerb" and not may_be_bank(boundary):
        return math.inf
    if boundary.form == "barrier":
        return 0.0
    return float(-GAIN_SCALE * np.sum(np.log1p(-np.minimum(boundary.scores, 1.0 - 1e-6))))


def shade_of(boundary: SmoothBoundary) -> int:
    """Return +1 where a boundary is a change of brightness alone, brighter outside, -1 where it is darker, else 0."""
    contrast = boundary.contrasts
    alone = np.isfinite(contrast)
    return int(np.sign(np.median(np.log(contrast[alone])))) if 2 * np.count_nonzero(alone) > len(alone) else 0


def _dashes_of_road(markings: Sequence[SmoothMarking], lanes: Sequence[LineAxis]) -> list[LineAxis]:
    """Return the axes of the markings with enough dashes to show that there is a carriageway."""
    return [axis for axis, one in zip(lanes, markings, strict=True) if len(one.dashes) >= DASHES_OF_ROAD]


def has_dashes_behind(
    kerbs: Sequence[LineAxis], markings: Sequence[SmoothMarking], lanes: Sequence[LineAxis]
) -> BoolArray:
    """Return which kerbs have a dashed line behind them, (m,) bool: they are the kerbs of a median.

    Strips on footways and in yards are straight and even, too, but nothing there is repeated as dashes are.

    Parameters
    ----------
    kerbs
        (m,) axes, each with the carriageway to its left.
    markings, lanes
        (k,) markings, and their axes.
    """
    m = len(kerbs)
    dashed = _dashes_of_road(markings, lanes)
    n = find_neighbours([*kerbs, *dashed], BEHIND_KERB_M)
    behind = (n.line < m) & (n.other >= m) & (n.across_m < -SEAM_M)
    return np.asarray(share_of_stations(n, behind, [*kerbs, *dashed])[:m] > _MOST)


def is_joint_of_road(
    axes: Sequence[LineAxis],
    is_kerb: BoolArray,
    markings: Sequence[SmoothMarking],
    lanes: Sequence[LineAxis],
) -> BoolArray:
    """Return which boundaries without a kerb are joints between two asphalts of one carriageway, (m,) bool.

    A lane with new asphalt is as different from the other as grass is from a road, and its joint lies beside the line between
    them: dashes are close behind such a boundary, and the next one behind it has its carriageway in front as well.

    Parameters
    ----------
    axes
        (m,) boundaries, each with the carriageway to its left.
    markings, lanes
        (k,) markings, and their axes.
    """
    m = len(axes)
    dashed = _dashes_of_road(markings, lanes)
    every = [*axes, *dashed]
    n = find_neighbours(every, FACING_M)
    behind = (n.line < m) & (n.across_m < 0.0)
    is_dashes = n.other >= m
    next_behind = nearest_per_station(n, behind & ~is_dashes)
    dashes, facing = (
        share_of_stations(n, chosen, every)[:m] > _MOST
        for chosen in (behind & is_dashes & (n.across_m > -SEAM_M), next_behind & (n.facing > 0.0))
    )
    return np.asarray(~is_kerb & dashes & facing)
