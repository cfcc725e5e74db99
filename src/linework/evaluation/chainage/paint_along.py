"""Remaining paint, contrast and width of markings along a route, from what the points show on them.

Separate from `samples`, which needs the lines only.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import shapely
from scipy.spatial import cKDTree

from linework.arrays import FloatArray, IntArray
from linework.evaluation.chainage.paint_points import N_RATIOS, PaintPieces, ratio_of_bin
from linework.evaluation.chainage.samples import Sample
from linework.lines.along import PaintStretch
from linework.lines.crosscuts import Axis
from linework.model.lines import LineSet

#: Stations beyond this are those of another road. [m]
_FAR_M = 30.0
#: Fewest points in the core of a piece that show how much paint is left, and fewest painted ones of a marking.
_LEAST_ON, _LEAST_PAINTED = 10, 30
#: Most of the points of plain road that may look like paint: with more, the two cannot be told apart. [share]
_MOST_MISTAKEN = 0.25
#: A width with a larger deviation is unknown. [share of the width]
_MOST_OF_WIDTH = 0.25
#: Points this far from the brightness of the road, in its own deviations, are no road. [deviations]
_ROAD_SIGMAS = 2.0
#: Pieces this near have the same road beside them: patches of other asphalt are longer. [m]
_SAME_ROAD_M = 10.0
#: Places this near to each other have paint or none together: worn patches are decimetres wide. [m]
_PATCH_M = 0.10


def paint_samples(lines: LineSet, axis: Axis, pieces: PaintPieces) -> Iterator[Sample]:
    """Yield the share of paint left [%], the contrast to the road, and the width [m] of each piece of a marking.

    Whole paint has one brightness along 20 m of a marking, as a ratio to the road beside: the median of the points about it, down to the
    middle between it and the road (Ridler and Calvard 1978, doi:10.1109/TSMC.1978.4310039, with medians). What is left
    is the share of points above that middle, corrected by how many points of plain road are above it and of paint below.
    """
    if not len(pieces):
        return
    tree = cKDTree(axis.xyz[:, :2])
    away, station = tree.query(pieces.xy)
    for rows, found in _by_marking(pieces):
        number = int(pieces.line[rows[0]])
        name = str(lines.id[number]) or f"line {number + 1}"
        for row in rows[away[rows] <= _FAR_M].tolist():
            i = int(station[row])
            s, offset = float(axis.station_m[i]), float((pieces.xy[row] - axis.xyz[i, :2]) @ axis.left[i])
            for quantity, (value, sigma) in found[row].items():
                yield Sample(s, offset, "marking", quantity, name, value, sigma)


def paint_left(pieces: PaintPieces) -> tuple[FloatArray, FloatArray]:
    """Return the share of paint left in each piece and its standard deviation, (p,) each [%]; NaN where unknown."""
    left = np.full((2, len(pieces)), np.nan)
    for rows, found in _by_marking(pieces):
        for row in rows.tolist():
            share, sigma = found[row]["remaining_paint"]
            left[:, row] = math.nan if share is None else share, sigma
    return left[0], left[1]


def paint_stretches(lines: LineSet, pieces: PaintPieces, *, every_m: float = 10.0) -> list[PaintStretch]:
    """Return what is left of each marking, by stretches of itself: means as those of a report by chainage.

    Parameters
    ----------
    lines
        Those that the pieces are of.
    every_m
        Length of a stretch. [m]
    """
    found = []
    for rows, measured in _by_marking(pieces):
        number = int(pieces.line[rows[0]])
        shape = shapely.linestrings(lines[number].xyz[:, :2])
        along = shapely.line_locate_point(shape, shapely.points(pieces.xy[rows]))
        for stretch in np.unique(along // every_m).tolist():
            own = [measured[row] for row in rows[along // every_m == stretch].tolist()]
            values: dict[str, tuple[float | None, float | None]] = {}
            for quantity in own[0]:
                known = [one[quantity] for one in own if one[quantity][0] is not None]
                mean = math.fsum(float(value or 0.0) for value, _ in known) / len(known) if known else None
                # Each piece has errors of its own, but the brightness of the road beside, which contrast refers to
                total = math.sqrt(math.fsum(sigma**2 for _, sigma in known))
                each = len(known) if quantity != "contrast" else math.sqrt(len(known))
                values[quantity] = mean, total / each if known else None
            n_known = sum(one["remaining_paint"][0] is not None for one in own)
            end = min((stretch + 1.0) * every_m, float(lines.length_m[number]))
            found.append(PaintStretch(number, stretch * every_m, end, values, n_known / len(own)))
    return found


_Measured = dict[str, tuple[float | None, float]]


def _by_marking(pieces: PaintPieces) -> Iterator[tuple[IntArray, dict[int, _Measured]]]:
    """Yield the pieces of each marking, and what was measured of each.

    The brightness of whole paint is that of the pieces about each: the road beside it, to which it is a ratio, is brighter
    on one patch of asphalt than on another. Where little paint is left it is that of the whole marking.
    """
    for number in np.unique(pieces.line).tolist():
        rows = np.flatnonzero(pieces.line == number)
        on, beside = pieces.on[rows], pieces.beside[rows]
        usual = _whole_paint(on.sum(axis=0), beside.sum(axis=0))
        found = {}
        for row, about in zip(
            rows.tolist(),
            cKDTree(pieces.xy[rows]).query_ball_point(pieces.xy[rows], _SAME_ROAD_M),
            strict=True,
        ):
            here = on[about].sum(axis=0), beside[about].sum(axis=0)
            whole = None if usual is None else _whole_paint(*here)
            if whole is None:
                whole, here = usual, (on.sum(axis=0), beside.sum(axis=0))
            found[row] = _measured(pieces, row, whole, _mistaken(*here, whole))
        yield rows, found


def _whole_paint(on: IntArray, beside: IntArray) -> float | None:
    """Return the ratio of whole paint to road, None where it cannot be distinguished from road.

    Begun at the commonest brightness above that of the road: studs, which are brighter still, are few.
    """
    ratio = ratio_of_bin()
    if on.sum() < _LEAST_PAINTED or not beside.sum():
        return None
    plain = 1.0 + _ROAD_SIGMAS * (_quantile(beside, 0.75) - _quantile(beside, 0.25)) / 1.349
    # Less the bare places, which are as bright as the road beside
    bare = on[ratio <= 1.0].sum() / max(int(beside[ratio <= 1.0].sum()), 1)
    common = np.where(ratio > plain, np.convolve(on - bare * beside, np.ones(5), mode="same"), 0.0)
    # What is left of worn paint is hardly brighter than road
    whole = float(ratio[int(np.argmax(common * (1.0 - 1.0 / ratio)))])
    for _ in range(N_RATIOS):
        middle = 0.5 * (1.0 + whole)
        painted = np.where((ratio >= middle) & (ratio <= whole * whole / middle), on, 0)
        if whole <= plain or painted.sum() < _LEAST_PAINTED:
            return None
        renewed = _quantile(painted, 0.5)
        if renewed == whole:
            break
        whole = renewed
    return whole


def _mistaken(on: IntArray, beside: IntArray, whole: float | None) -> tuple[float, float]:
    """Return the shares of road taken for paint, and of paint taken for road."""
    if whole is None:
        return 1.0, 1.0
    ratio, middle = ratio_of_bin(), 0.5 * (1.0 + whole)
    # Other paint or a verge beside the road is bright and no noise: that is symmetric, as speckle is a factor
    above = min(float(beside[ratio >= middle].sum()), float(beside[ratio <= 1.0 / middle].sum()))
    above /= max(int(beside.sum()), 1)
    # Brightness is as often far above that of whole paint as far below it
    step = whole / middle
    far = float(on[(ratio > whole * step) & (ratio <= whole * step * step)].sum())
    upper = float(on[(ratio > whole) & (ratio <= whole * step * step)].sum())
    upper += 0.5 * float(on[np.argmin(np.abs(ratio - whole))])
    return above, min(0.5 * far / max(upper, 1.0), 0.5)


def _measured(pieces: PaintPieces, row: int, whole: float | None, mistaken: tuple[float, float]) -> _Measured:
    """Return share left [%], contrast and width [m] of one piece, each with its standard deviation."""
    hidden: _Measured = dict.fromkeys(("remaining_paint", "contrast", "width"), (None, math.nan))
    on, ratio = pieces.on[row], ratio_of_bin()
    n = int(on.sum())
    if whole is None or n < _LEAST_ON or sum(mistaken) > 2 * _MOST_MISTAKEN:
        return hidden
    painted = np.where(ratio >= 0.5 * (1.0 + whole), on, 0)
    share = float(painted.sum()) / n
    scale = 1.0 - sum(mistaken)
    left = min(max((share - mistaken[0]) / scale, 0.0), 1.0)
    n_patches = min(float(n), max(pieces.area_m2[row] / _PATCH_M**2, 1.0))
    # By Laplace's rule, as a share of 0 or 1 among a few places is not exact
    likely = (share * n_patches + 1.0) / (n_patches + 2.0)
    found = hidden | {
        "remaining_paint": (100 * left, 100 * math.sqrt(likely * (1.0 - likely) / n_patches) / scale)
    }
    if painted.sum() >= _LEAST_ON:
        # Speckle differs from point to point, paint from patch to patch
        n_independent = min(float(painted.sum()), max(share * n_patches, 1.0))
        contrast = _quantile(painted, 0.5)
        noise = 1.2533 * _spread(painted) / math.sqrt(n_independent)
        found["contrast"] = contrast, math.hypot(noise, contrast * float(pieces.road_sigma[row]))
        # Of paint that is mostly gone the width is that of what is left
        if np.isfinite(pieces.across_m[row]) and left >= 0.5:
            worn = float(pieces.across_m[row]) * math.sqrt(left * (1.0 - left) / n_patches)
            sigma = math.hypot(float(pieces.across_sigma_m[row]), worn)
            if sigma <= _MOST_OF_WIDTH * pieces.width_m[row]:
                found["width"] = float(pieces.across_m[row]), sigma
    return found


def _quantile(counts: IntArray, share: float) -> float:
    """Return the ratio of the bin below which a share of the counts lie."""
    return float(ratio_of_bin()[np.searchsorted(np.cumsum(counts), share * counts.sum())])


def _spread(counts: IntArray) -> float:
    """Return the standard deviation of the ratios."""
    ratio: FloatArray = ratio_of_bin()
    mean = float(counts @ ratio) / max(int(counts.sum()), 1)
    return math.sqrt(float(counts @ (ratio - mean) ** 2) / max(int(counts.sum()), 1))
