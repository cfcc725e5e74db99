"""What speaks against a line of paint: strips that fade where it should have paint, and the step of a kerb's stone.

Separate from `marking_lines`, which makes lines of boxes: this weighs what else they could be.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence

import numpy as np
import shapely
from scipy.spatial import cKDTree
from scipy.special import expit

from linework.arrays import BoolArray, FloatArray, IntArray
from linework.methods.protocol import Sight
from linework.methods.tracking.fitted import LEAST_PIECE_SCORE
from linework.methods.tracking.neighbours import LineAxis, find_neighbours
from linework.methods.tracking.smooth import SmoothLine
from linework.model.boxes import BoxSet

#: Strips this near a line are in its place: boxes are right to about 2 cm, tracks smooth them. [m]
IN_PLACE_M = 0.06
#: A strip this near a box of the line along it is of the same search area, which explains both: paint on a strip. [m]
SAME_AREA_M = 0.25
#: A strip more than this many times as wide as the lines has room for one beside its middle.
WIDER = 1.5
#: Strips run along a line within 15 degrees: cosine.
ALONG = 0.966
#: Narrowest line: paint is 0.10 m wide and more (Vienna convention of 1968, protocol on road markings), the head of a
#: grooved rail 0.056 m. [m]
NARROWEST_MARKING_M = 0.075
#: By how much new asphalt may be off a straight line (4 mm under a straightedge of 4 m, EN 13036-7); height of a dropped
#: kerb, to either side of its stone (DIN 18040-3) [m]; and how rare such stones without a kerb are among bright stripes.
UNEVEN_M, DROPPED_KERB_M, STONE_SHARE = 0.004, 0.03, 0.1
#: Standard deviation over the median of the distances from the median, of a normal distribution; boxes of a stretch (8 m),
#: and fewest stretches that show how uneven the ground is.
MEDIAN_SPREAD, RISES_OF_STRETCH, LEAST_STRETCHES = 1.4826, 16, 3
#: Lines nearer to each other than a van is wide are drawn together, or one is none. [m]
DRAWN_TOGETHER_M = 1.8
#: The strip of concrete or stone along a grooved rail reaches this far from it: lines beside a track keep clear of the cars,
#: 0.5 m and more. [m]
BED_M = 0.45
#: Standard deviations of logarithms of ratios: of contrasts, between lines of one paint, as wear differs from line to line; of
#: widths, between two generations of one line.
SAME_PAINT, SAME_WIDTH = 0.35, 0.2
#: Broad lines are twice as wide as narrow ones (Vienna convention of 1968), 2.5 times at most: logarithm.
BROADER = math.log(2.5)
#: Ranges of these logarithms for strips of stone: from a tenth as bright to as bright, from as wide to five times as wide.
FAINTER_STRIP, WIDER_STRIP = 2.3, 1.6
#: Logarithm of the odds that what is bright beside a line is another line: 20 to 1, where neither tells. These odds and the
#: standard deviations were set by hand, 2026-11-30, on villages 17401 and 18001 and repainted roads 18001 to 18003.
BESIDE_LOG_ODDS = 3.0
#: Why a line is more likely something else than paint.
NARROW = "narrower than paint: a rail or a joint"
OTHER_STRIP = "no paint: it fades at its sides, or lies between two materials"
STRIP_BESIDE = "strip of stone: fainter and wider than the line beside it"
ON_STEP = "stone of a dropped kerb: the ground on one side is higher along all of it"


def is_other_strip(boxes: BoxSet) -> BoolArray:
    """Return which stripes are strips that paint may lie on, (n,) bool: more likely no paint, and wider than paint is here.

    What fades at its sides about a narrow line may be the line, worn or far away. How wide lines are is what most of the
    likely ones are.
    """
    is_paint = boxes.score >= LEAST_PIECE_SCORE
    if not is_paint.any():
        return is_paint
    wide: BoolArray = boxes.half_v_m > WIDER * np.median(boxes.half_v_m[is_paint])
    return wide & ~is_paint


class BrightStrips:
    """Bright strips that are no paint, see `is_other_strip`, found by place.

    Parameters
    ----------
    boxes
        [m, local].
    """

    def __init__(self, boxes: BoxSet) -> None:
        self.boxes = boxes
        self._tree = cKDTree(boxes.centre[:, :2]) if len(boxes) else None

    def scores_where(self, line: SmoothLine, own_xy: FloatArray, expected: FloatArray) -> FloatArray:
        """Return the scores of the strips that lie in the place of a line where it should have paint and has none, (j,).

        Parameters
        ----------
        own_xy
            (k, 2) centres of the line's own boxes. [m, local]
        expected
            (e, 2) stretches along the line that should have paint, ascending. [m]
        """
        near: list[int] = []
        if self._tree is not None:
            reach = math.hypot(IN_PLACE_M, 0.5 * float(np.diff(line.t_m).max(initial=0.0)))
            near = sorted(set().union(*self._tree.query_ball_point(line.xyz[:, :2], reach)))
        if not near:
            return np.zeros(0)
        xy, u = self.boxes.centre[near, :2], self.boxes.u[near]
        _, at = cKDTree(line.xyz[:, :2]).query(xy)
        step, normal = xy - line.xyz[at, :2], line.normal[at]
        t = line.t_m[at] + step[:, 0] * normal[:, 1] - step[:, 1] * normal[:, 0]
        chosen = np.abs(np.sum(step * normal, axis=1)) <= IN_PLACE_M
        chosen &= np.abs(u[:, 0] * normal[:, 1] - u[:, 1] * normal[:, 0]) >= ALONG
        chosen &= cKDTree(own_xy).query(xy)[0] > SAME_AREA_M
        k = np.searchsorted(expected[:, 0], t, side="right") - 1
        chosen &= (k >= 0) & (t <= expected[np.maximum(k, 0), 1])
        score: FloatArray = self.boxes.score[near][chosen]
        return score


def bare_road(visible: Sight, bright: BoxSet) -> Sight:
    """Return the function of places [m, local] that is true where road was measured and nothing bright found.

    What is too wide, or too unsure, to be in a line leaves no bare road under it either; what lies beside a place does.
    """
    u, v = bright.u, np.column_stack([-bright.u[:, 1], bright.u[:, 0]])
    reach_u, reach_v = bright.half_u_m[:, None] * u, (bright.half_v_m + IN_PLACE_M)[:, None] * v
    corners = [a * reach_u + b * reach_v for a, b in ((1, 1), (-1, 1), (-1, -1), (1, -1))]
    tree = shapely.STRtree(shapely.polygons(bright.centre[:, None, :2] + np.stack(corners, axis=1)))

    def is_bare(xy: FloatArray) -> BoolArray:
        bare = np.array(visible(xy), dtype=np.bool_)
        bare[tree.query(shapely.points(xy), predicate="intersects")[0]] = False
        return bare

    return is_bare


def median_contrast(boxes: BoxSet, box: IntArray) -> float:
    """Return by how much boxes (k,) of a line are brighter than the road, over the road; NaN if most do not say."""
    contrast = boxes.contrast[box]
    known = contrast[np.isfinite(contrast)]
    return float(np.median(known)) - 1.0 if 2 * len(known) > len(contrast) else math.nan


def chances_beside_paint(
    axes: Sequence[LineAxis],
    contrast: FloatArray,
    width_m: FloatArray,
    confidence: FloatArray,
    is_rail: BoolArray,
) -> FloatArray:
    """Return the chance that each line is paint by how bright and how wide it is beside others, (m,).

    Lines drawn beside each other have one paint, whatever their widths, or are two generations of one line. Strips of stone
    along the edge of a pavement are fainter than the edge line before them, and wider.

    Parameters
    ----------
    contrast
        (m,) by how much each is brighter than the road, over the road; NaN where that is unknown. [-]
    width_m, confidence
        (m,) of each [m, 1]; what is less sure to be paint says less about what is beside it.
    is_rail
        (m,) bool: narrower than paint. Its bed of stone reaches `BED_M`; what paint is farther away it cannot tell.
    """
    chance = np.ones(len(axes))
    n = find_neighbours(axes, DRAWN_TOGETHER_M)
    speaks = (contrast[n.line] > 0.0) & (contrast[n.line] < contrast[n.other])
    speaks &= width_m[n.line] > width_m[n.other]
    speaks &= ~is_rail[n.other] | (np.abs(n.across_m) <= BED_M)
    for i in np.unique(n.line[speaks]).tolist():
        own = speaks & (n.line == i)
        # What stands beside it here and there says nothing of it
        if 2 * len(np.unique(n.station[own])) <= len(axes[i].xy):
            continue
        other = n.other[own]
        fainter, wider, sure = (
            float(np.median(values))
            for values in (
                np.log(contrast[i] / contrast[other]),
                np.log(width_m[i] / width_m[other]),
                confidence[other],
            )
        )
        too_broad = -0.5 * (max(wider - BROADER, 0.0) / SAME_WIDTH) ** 2
        as_paint = max(
            _log_density(fainter, SAME_PAINT) + too_broad + math.log(FAINTER_STRIP),
            _log_density(wider, SAME_WIDTH) + math.log(WIDER_STRIP),
        )
        chance[i] = 1.0 - sure * float(expit(-(BESIDE_LOG_ODDS + as_paint)))
    return chance


def _log_density(value: float, spread: float) -> float:
    """Return the logarithm of the density of a normal distribution about 0."""
    return -0.5 * (value / spread) ** 2 - math.log(math.sqrt(2.0 * math.pi) * spread)


def why_not_paint(width_m: float, score: float, one_plane: float) -> str:
    """Return why a line is more likely something else than paint, "" where it is wide enough and its boxes are paint.

    Parameters
    ----------
    score
        Mean chance that its boxes are paint.
    one_plane
        `chance_of_one_plane`.
    """
    if width_m < NARROWEST_MARKING_M:
        return NARROW
    if score < LEAST_PIECE_SCORE:
        return OTHER_STRIP
    return "" if score * one_plane >= LEAST_PIECE_SCORE else ON_STEP


def chance_of_one_plane(boxes: BoxSet, box: IntArray) -> float:
    """Return the chance that the road is one plane under a line, 0 to 1, as under paint: not the stone of a kerb.

    The kerb of a driveway or a crossing is too low for a step in any one box; over a line its side is always the same.

    Parameters
    ----------
    boxes
        With `height_m`: by how much the ground on the left lies higher [m]; NaN where that is unknown.
    box
        (k,) int64: the boxes of a line, in order.
    """
    if len(box) < RISES_OF_STRETCH:
        return 1.0
    along = np.gradient(boxes.centre[box, :2], axis=0)
    rise = boxes.height_m[box] * np.sign(np.sum(along * boxes.u[box], axis=1))
    rise = rise[np.isfinite(rise)]
    if len(rise) < RISES_OF_STRETCH:
        return 1.0
    median = float(np.median(rise))
    # The stone of a kerb has its step everywhere: ground that is as uneven from one stretch to the next has none. A line
    # too short for stretches has boxes that err together
    stretches = np.array_split(rise, len(rise) // RISES_OF_STRETCH)
    spread = MEDIAN_SPREAD * float(np.median(np.abs(rise - median)))
    if len(stretches) >= LEAST_STRETCHES:
        # Few stretches may agree by chance: they differ by what the noise of their boxes makes of a median. Neighbouring
        # boxes share half of their points, so that half of them count
        noise = math.sqrt(0.5 * math.pi) * spread / math.sqrt(0.5 * len(rise) / len(stretches))
        spread = max(float(np.std([np.median(part) for part in stretches], ddof=1)), noise)
    sigma = math.hypot(UNEVEN_M, spread)
    paint = math.exp(-0.5 * (median / sigma) ** 2) / (math.sqrt(2.0 * math.pi) * sigma)
    # A stone has any height up to that of a dropped kerb, and is seen with the same error as paint
    near, far = ((abs(median) + d) / (math.sqrt(2.0) * sigma) for d in (-DROPPED_KERB_M, DROPPED_KERB_M))
    stone = STONE_SHARE * 0.25 / DROPPED_KERB_M * (math.erfc(near) - math.erfc(far))
    # Where neither explains a step (higher, and the same everywhere) there is no one plane
    return paint / (paint + stone + sys.float_info.min)
