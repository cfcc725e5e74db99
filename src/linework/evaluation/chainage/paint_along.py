"""Remaining paint, contrast and width of markings along a route, from what the points show on them.

Separate from `samples`, which needs the lines only.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from statistics import NormalDist
from typing import NamedTuple

import numpy as np
import shapely
from scipy.spatial import cKDTree

from linework.arrays import BoolArray, FloatArray, IntArray
from linework.evaluation.chainage.paint_points import N_RATIOS, PaintPieces, bins_of_factor, ratio_of_bin
from linework.evaluation.chainage.samples import Sample
from linework.lines.along import PaintStretch
from linework.lines.crosscuts import Axis
from linework.model.lines import LineSet

#: Stations beyond this are those of another road. [m]
_FAR_M = 30.0
#: Fewest points in the core of a piece that show how much paint is left, and fewest painted ones of a marking.
_LEAST_ON, _LEAST_PAINTED = 10, 30
#: Fewest points on paint that give its brightness, for each point of road that may be among them: the middle two of four.
_LEAST_BRIGHT = 4
#: Least share of painted points that are not as bright as a scanner can record: a quarter is more than worn edges have.
_LEAST_OPEN = 0.25
#: Most of the points of plain road that may look like paint: with more, the two cannot be told apart. [share]
_MOST_MISTAKEN = 0.25
#: A width with a larger deviation is unknown. [share of the width]
_MOST_OF_WIDTH = 0.25
#: Points this far from the brightness of the road, in its own deviations, are no road. [deviations]
_ROAD_SIGMAS = 2.0
#: Most of the points of plain road that are as bright as the least paint where single points tell where it ends. [share]
_MOST_BRIGHT_ROAD = 0.002
#: Pieces this near have the same road beside them: patches of other asphalt are longer. [m]
_SAME_ROAD_M = 10.0
#: Rounds after which the share of paint among some points changes by less than a hundredth.
_N_ROUNDS = 10
#: Points this near to each other show the same place: a spot of the beam. Points farther apart lie at random on paint and
#: bare places, however large these are, and their share errs by as much as that of as many draws. [m]
_SPOT_M = 0.02


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


def least_paint_ratios(pieces: PaintPieces) -> dict[int, float]:
    """Return the least brightness of paint as a ratio to the road beside, by the number of the marking; of those that show it.

    Half-way between road and whole paint, or above where more points of plain road would be as bright. Bright points beside
    paint that have no dark ones to match, as speckle is a factor, are other paint.
    """
    found = {}
    ratio = ratio_of_bin()
    for number in np.unique(pieces.line).tolist():
        marking = pieces.take(np.flatnonzero(pieces.line == number))
        whole, beside = _usual_paint(marking).ratio, marking.beside.sum(axis=0)
        if whole is None:
            continue
        for least in ratio[(ratio >= 0.5 * (1.0 + whole)) & (ratio < whole)].tolist():
            dark = float(beside[ratio <= 1.0 / least].sum())
            if min(float(beside[ratio >= least].sum()), dark) <= _MOST_BRIGHT_ROAD * beside.sum():
                found[number] = least
                break
    return found


_Measured = dict[str, tuple[float | None, float]]


def _by_marking(pieces: PaintPieces) -> Iterator[tuple[IntArray, dict[int, _Measured]]]:
    """Yield the pieces of each marking, and what was measured of each.

    The brightness of whole paint is that of the pieces about each: the road beside it, to which it is a ratio, is brighter
    on one patch of asphalt than on another. What the pieces about show is no whole paint where that of the whole marking
    is far from it: little is left there, and remains are hardly brighter than road.
    """
    for number in np.unique(pieces.line).tolist():
        rows = np.flatnonzero(pieces.line == number)
        marking = pieces.take(rows)
        usual, every = _usual_paint(marking), (marking.on.sum(axis=0), marking.beside.sum(axis=0))
        near = cKDTree(marking.xy).query_ball_point(marking.xy, _SAME_ROAD_M)
        found = {}
        for i, about in enumerate(near):
            whole, here = None, every
            if usual.ratio is not None:
                whole, shown = _whole_about(marking, i, marking.take(np.array(about)), usual)
                here = shown or every
            sigma = math.sqrt(float(np.mean(marking.road_sigma[about] ** 2)))
            road = _Road(marking.beside[about].sum(axis=0), sigma)
            found[int(rows[i])] = _measured(marking, i, whole, _mistaken(*here, whole), road)
        yield rows, found


class _Road(NamedTuple):
    """The road about a piece: points beside paint by their ratio, and the relative deviation of its brightness.

    What the sides of one piece differ by is a single draw of what the road between them errs by, often small by chance: the
    deviation is that of all pieces about.
    """

    plain: IntArray
    sigma: float


class _Usual(NamedTuple):
    """Whole paint of a marking: its ratio to the road beside, None where it cannot be distinguished from it, and its brightness by number of looks."""

    ratio: float | None
    brightness: dict[int, float]


def _usual_paint(marking: PaintPieces) -> _Usual:
    """Return what whole paint is like along all of a marking."""
    plain = marking.beside.sum(axis=0)
    brightness = {}
    for n in np.unique(marking.n_looks).tolist():
        road = marking.road[(marking.n_looks == n) & (marking.road > 0.0)]
        if len(road):
            mean = float(np.exp(np.mean(np.log(road))))
            ratio = _whole_paint(
                _on_same_road(marking.take(np.flatnonzero(marking.n_looks == n)), mean, n), plain
            )
            if ratio is not None:
                brightness[n] = ratio * mean
    return _Usual(_whole_paint(marking.on.sum(axis=0), plain), brightness)


def _whole_about(
    marking: PaintPieces, i: int, about: PaintPieces, usual: _Usual
) -> tuple[float, tuple[IntArray, IntArray] | None]:
    """Return the ratio of whole paint to road at one piece, and the points on and beside paint that show it, if any.

    Either ratios are alike, as where dirt or water darkens paint and road, or paint is equally bright on whatever road it
    lies. What explains the points on the piece better is chosen. Where the pieces about show no whole paint it is that of
    the whole marking.
    """
    own, road, n_looks = marking.on[i], float(marking.road[i]), int(marking.n_looks[i])
    plain = about.beside.sum(axis=0)
    by_marking = [usual.ratio or 0.0]
    if road > 0.0 and n_looks in usual.brightness:
        by_marking.append(usual.brightness[n_looks] / road)
    found = []
    for on in (about.on.sum(axis=0), _on_same_road(about, road, n_looks)):
        ratio = _whole_paint(on, plain)
        if ratio is not None and any(_is_whole(ratio, one) for one in by_marking):
            found.append((ratio, (on, plain)))
    if found:
        return max(found, key=lambda one: _likelihood(own, plain, one[0]))
    return max(by_marking, key=lambda one: _likelihood(own, plain, one)), None


def _likelihood(on: IntArray, beside: IntArray, whole: float) -> float:
    """Return the logarithm of the likelihood of points that lie on paint, on bare road, or anywhere.

    Bare road varies as that beside, and so does paint, as speckle is a factor; the share of paint is that which explains
    the points best.
    """
    if not on.any():
        return 0.0
    plain = beside / max(int(beside.sum()), 1)
    step = min(max(int(bins_of_factor(np.array([whole]))[0]), 0), N_RATIOS)
    paint = np.concatenate([np.zeros(step), plain[: N_RATIOS - step]])
    chance = np.stack([paint, plain, np.full(N_RATIOS, 1.0 / N_RATIOS)])
    share = np.full(3, 1.0 / 3.0)
    for _ in range(_N_ROUNDS):
        each = share[:, None] * chance
        share = (each / each.sum(axis=0)) @ on / max(int(on.sum()), 1)
    return float(on[on > 0] @ np.log((share @ chance)[on > 0]))


def _on_same_road(about: PaintPieces, road: float, n_looks: int) -> IntArray:
    """Return the points on all pieces about one, by their ratio to the road beside that one.

    Along a marking its paint is equally bright, on whatever road it lies. Pieces that were seen in fewer or more looks
    cannot be compared by brightness, and count by their own ratios.
    """
    alike = (about.n_looks == n_looks) & (about.road > 0.0) & (road > 0.0)
    brighter = np.where(alike, about.road, 1.0) / np.where(alike, road, 1.0)
    source = np.arange(N_RATIOS) - bins_of_factor(brighter)[:, None]
    inside = (source >= 0) & (source < N_RATIOS)
    shifted = np.where(inside, np.take_along_axis(about.on, np.clip(source, 0, N_RATIOS - 1), axis=1), 0)
    return np.asarray(shifted.sum(axis=0))


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
        painted = np.where(_is_whole(ratio, whole), on, 0)
        if whole <= plain or painted.sum() < _LEAST_PAINTED:
            return None
        renewed = _quantile(painted, 0.5)
        if renewed == whole:
            break
        whole = renewed
    return whole


def _is_whole(ratio: FloatArray | float, whole: float) -> BoolArray:
    """Return which ratios are nearer to whole paint than to road, and as little above it: neither remains nor studs."""
    middle = 0.5 * (1.0 + whole)
    return np.asarray((ratio >= middle) & (ratio <= whole * whole / middle))


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


def _measured(
    pieces: PaintPieces, row: int, whole: float | None, mistaken: tuple[float, float], road: _Road
) -> _Measured:
    """Return share left [%], contrast and width [m] of one piece, each with its standard deviation."""
    hidden: _Measured = dict.fromkeys(("remaining_paint", "contrast", "width"), (None, math.nan))
    on, ratio = pieces.on[row], ratio_of_bin()
    n = int(on.sum())
    if whole is None or not n or sum(mistaken) > 2 * _MOST_MISTAKEN:
        return hidden
    found = dict(hidden)
    painted = np.where(ratio >= 0.5 * (1.0 + whole), on, 0)
    n_painted = int(painted.sum())
    share = n_painted / n
    scale = 1.0 - sum(mistaken)
    left = min(max((share - mistaken[0]) / scale, 0.0), 1.0)
    n_places = min(float(n), max(pieces.area_m2[row] / _SPOT_M**2, 1.0))
    if n >= _LEAST_ON:
        # By Laplace's rule, as a share of 0 or 1 among a few places is not exact
        likely = (share * n_places + 1.0) / (n_places + 2.0)
        sigma = math.sqrt(likely * (1.0 - likely) / n_places) / scale
        found["remaining_paint"] = 100 * left, 100 * sigma
    if n_painted >= max(1.0, mistaken[0] * (1.0 - left) * n) * _LEAST_BRIGHT:
        # Speckle differs from point to point, paint from patch to patch
        n_independent = min(float(n_painted), max(share * n_places, 1.0))
        found["contrast"] = _contrast(painted, left, int(pieces.n_clipped[row]), n_independent, road)
    # Of paint that is mostly gone the width is that of what is left
    if n_painted >= _LEAST_ON and np.isfinite(pieces.across_m[row]) and left >= 0.5:
        worn = float(pieces.across_m[row]) * math.sqrt(left * (1.0 - left) / n_places)
        sigma = math.hypot(float(pieces.across_sigma_m[row]), worn)
        if sigma <= _MOST_OF_WIDTH * pieces.width_m[row]:
            found["width"] = float(pieces.across_m[row]), sigma
    return found


def _quantile(counts: IntArray, share: float) -> float:
    """Return the ratio of the bin below which a share of the counts lie."""
    return float(ratio_of_bin()[np.searchsorted(np.cumsum(counts), share * counts.sum())])


def _contrast(
    painted: IntArray, left: float, n_clipped: int, n_independent: float, road: _Road
) -> tuple[float | None, float]:
    """Return the median ratio of painted points to the road and its standard deviation; None where most were clipped.

    Of points as bright as a scanner can record it is not known how bright they are. Where they are more than half, the
    median follows from the middle one of the others, as paint varies as the road beside does: speckle is a factor. Where
    they are nearly all, the others lie on worn edges.
    """
    open_share = 1.0 - n_clipped / float(painted.sum())
    if 1.0 - open_share > (1.0 - _LEAST_OPEN) * left:
        return None, math.nan
    at = 0.5 if open_share >= 0.5 else 0.5 * open_share
    contrast = _within_bin(painted, at)
    if at < 0.5 and road.plain.any():
        contrast *= _within_bin(road.plain, 0.5) / _within_bin(road.plain, at)
    normal = NormalDist()
    # That of a quantile, by the density of normally distributed values at it
    by_number = math.sqrt(at * (1.0 - at) / n_independent) / normal.pdf(normal.inv_cdf(at))
    return contrast, math.hypot(_spread(painted) * by_number, contrast * road.sigma)


def _within_bin(counts: IntArray, share: float) -> float:
    """Return the ratio below which a share of the counts lie, between the ends of its bin by how many lie below it."""
    wanted, below = share * float(counts.sum()), np.cumsum(counts)
    k = int(np.searchsorted(below, wanted))
    part = (wanted - float(below[k] - counts[k])) / float(counts[k])
    ratio = ratio_of_bin()
    return float(ratio[k] * (ratio[1] / ratio[0]) ** (part - 0.5))


def _spread(counts: IntArray) -> float:
    """Return the standard deviation of the ratios."""
    ratio: FloatArray = ratio_of_bin()
    mean = float(counts @ ratio) / max(int(counts.sum()), 1)
    return math.sqrt(float(counts @ (ratio - mean) ** 2) / max(int(counts.sum()), 1))
