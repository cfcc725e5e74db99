"""Outlines of bars, a plate, a pipe and a square tube, as a scanner sees them; the likeliest explains a bar.

Beams are evenly spaced across their direction, so that a piece of outline returns in proportion to how squarely it faces
the scanner, and the noise of the scanner blurs what it draws. A view is the share of points in each cell of a section
that follows from both: of a plate, a pipe or a tube seen from the left, the right or, in two passes, from both.

Separate from `sections`, which finds the bars: this explains one.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache, partial
from math import erf

import numpy as np

from linework.arrays import AnyArray, Float32Array, FloatArray, IntArray
from linework.kernels.radon import outlines as kernels
from linework.kernels.radon.bands import fold_of_rows
from linework.methods.rails import fitted

#: Side of the cells of a section: half of the thinnest rope that still returns beams; half of that is the width of the
#: columns of a view, the step between tried places across. [m]
SECTION_CELL_M = 0.01
_PLACE_STEP_M = 0.5 * SECTION_CELL_M
#: Depth of W-beams and thrie beams, from crest to valley (EN 1317 A and B, AASHTO M 180), which their faces cover evenly. [m]
FOLD_DEPTH_M = 0.081
#: Farthest place of the middle of an outline, the thickest pipe in use is 0.2 m, and the places of plates. [m]
_MOST_ACROSS_M = 0.20
_PLACES = np.arange(-_MOST_ACROSS_M, _MOST_ACROSS_M + 0.5 * _PLACE_STEP_M, _PLACE_STEP_M)
#: A point within this distance of an outline lies on it: 2.5 deviations of 2 cm of noise, or as many of more noise. [m, sigma]
ON_OUTLINE_M, _ON_OUTLINE_SIGMAS = 0.05, 2.5
#: Noise of a survey up to which more or less of it makes no difference: 5 cm are 2.5 times as much. [m]
USUAL_NOISE_M = 0.02
#: Noises that are tried, across and in height: each 1.5 times the one before, from that of a scanner at its best to that of
#: one whose path errs within a window. Ranges err along the beam, which meets a bar nearly level or, from close by, steeply;
#: paths err in all directions. [m]
_NOISES_M = tuple(
    (across, share * across) for across in (0.006, 0.009, 0.014, 0.021, 0.031, 0.047) for share in (0.4, 1.0)
)
#: Elevations from which a scanner 1 to 2 m over a bar sees it from 3 to 20 m. [rad]
_ELEVATIONS_RAD = (np.radians(5.0), np.radians(15.0), np.radians(30.0))
#: Share of the points that lie anywhere: posts and twigs behind, double returns.
_ELSEWHERE = 0.05
#: Where an even beam blurred by noise falls to a fifth of its density, as bands end, beyond its edge. [sigma]
_BLUR_SIGMAS = 0.84
#: Smallest half height of a bar after that. [m]
_LEAST_HALF_M = 0.02
#: Beams on an outline, of each side, that a view is drawn with; and half of its width: the section's and the places'. [m]
_BEAMS, _HALF_VIEW_M = 60, 0.50
#: Middles of the columns of a view. [m]
_N_BESIDE = round(_HALF_VIEW_M / _PLACE_STEP_M)
_COLUMNS = np.arange(-_N_BESIDE, _N_BESIDE + 1, dtype=np.float64) * _PLACE_STEP_M
#: Farthest that a middle is sought from where the points' own middle puts it. [columns]
_NEAR = 6
#: Views that are kept: of three outlines of 17 heights with 12 noises.
_KEPT_VIEWS = 1024
#: Sets of tried places that are kept: of 81 middles, each with the offsets of outlines, heights and noises that are tried.
_KEPT_PLACES = 4096


@dataclass(frozen=True, slots=True)
class OutlineFit:
    """How well an outline explains a beam.

    Parameters
    ----------
    outline
        "flat", "box" or "pipe".
    axis_m
        Its middle, to the left of the line. [m]
    explained
        Share of the points that lie on it.
    cost
        Negative log likelihood of the points, with the penalty of BIC for a thickness; 0 where nothing else was tried.
    """

    outline: str
    axis_m: float
    explained: float
    cost: float


def on_outline_m(noise_m: float) -> float:
    """Return the distance within which a point lies on an outline, from the noise of the survey there. [m].

    >>> on_outline_m(0.01), on_outline_m(0.03)
    (0.05, 0.075)
    """
    return max(ON_OUTLINE_M, _ON_OUTLINE_SIGMAS * noise_m)


def least_thin(noise_m: float) -> float:
    """Return the share of the points of a sheet without thickness that lies within 5 cm of it, less what mesh loses.

    >>> round(least_thin(0.01), 3), round(least_thin(0.03), 3)
    (0.95, 0.87)
    """
    usual, here = (erf(ON_OUTLINE_M / (np.sqrt(2.0) * max(sigma, USUAL_NOISE_M))) for sigma in (0.0, noise_m))
    return fitted.LEAST_THIN * here / usual


def fold_of(counts: FloatArray, u: FloatArray) -> float:
    """Return the standard deviation of where the rows of a band lie across, less what the noise of their points makes. [m].

    A one-way analysis of variance of the points (heights, widths) of columns at `u` [m], those within the section's
    middle `_MOST_ACROSS_M`: noise across spreads the points of a row, a fold moves the rows.

    >>> noise = np.random.default_rng(1).normal(size=(40, 500)) * 0.02
    >>> fold = 0.04 * np.cos(np.linspace(0.0, 12.0, 40))[:, None]
    >>> edges = np.arange(-0.3, 0.305, 0.01)
    >>> rows = [np.stack([np.histogram(r, edges)[0] for r in noise + at]) for at in (0.0 * fold, fold)]
    >>> [round(fold_of(r.astype(float), edges[:-1] + 0.005), 2) for r in rows]
    [0.0, 0.03]
    """
    fold: float = fold_of_rows(counts, u, 0.5 * _MOST_ACROSS_M)
    return fold


def is_folded(fold_m: float) -> bool:
    """Return whether rows lie as far apart across as those of a folded beam: half of it at least, a flat sheet's not at all.

    >>> is_folded(0.025), is_folded(0.005)
    (True, False)
    """
    return fold_m > 0.5 * FOLD_DEPTH_M / float(np.sqrt(12.0))


def plate_of(columns: FloatArray, u: FloatArray) -> OutlineFit:
    """Return the plate that is nearest to the points (widths,) of the columns at `u`. [m].

    Whatever the noise, within 5 cm they lie on it: what is thicker, a wall or a hedge, is no more a plate for that.
    """
    cost = kernels.flat_costs(columns, u, _PLACES, ON_OUTLINE_M)
    at = float(_PLACES[int(np.argmin(cost))])
    on = float(columns[np.abs(u - at) <= ON_OUTLINE_M].sum()) / float(columns.sum())
    return OutlineFit("flat", at, on, 0.0)


def bars_of(counts: FloatArray, height: FloatArray, u: FloatArray, on_m: float) -> tuple[OutlineFit, ...]:
    """Return how well a plate, a pipe and a square tube explain a bar, the plate first.

    The noise is that with which an outline explains most. The simplest outline, a plate, is kept where others fit no
    better than by chance: half the logarithm of the number of points for the thickness that they have in addition, and as
    much for the side that they are seen from.

    Parameters
    ----------
    counts
        (heights, widths) points of the bar.
    height, u
        Middles of its cells over the middle of the bar, and across. [m]
    on_m
        Distance within which a point lies on an outline. [m]
    """
    rows, columns = np.nonzero(counts)
    number = counts[rows, columns]
    fullest = np.argsort(-number, kind="stable")
    rows, columns, number = rows[fullest], columns[fullest], number[fullest]
    cells = np.column_stack([rows, np.rint(u[columns] / _PLACE_STEP_M).astype(np.int64)])
    at = np.column_stack([u[columns], height[rows]])
    fits: list[OutlineFit] = []
    likely = _NOISES_M[len(_NOISES_M) // 2]
    for outline in ("flat", "pipe", "box"):
        at_middle = partial(_likeliest, outline, len(counts), fits[0].axis_m if fits else None, cells, number)
        # The noise of the outline before is about right: most of the others are left out when it has been tried
        most = float(np.nextafter(at_middle(likely, np.inf, 0)[0], np.inf))
        best, place = most, 0
        for tried in _NOISES_M:
            before = best
            best, place = at_middle(tried, best, place)
            likely = tried if best < before else likely
        axis = place * _PLACE_STEP_M
        away = _distance_m(outline, at - np.array([axis, 0.0]), 0.5 * len(counts) * SECTION_CELL_M)
        on = number[away <= on_m].sum() / number.sum()
        thick = float(np.log(number.sum())) if outline != "flat" else 0.0
        fits.append(OutlineFit(outline, axis, float(on), best + thick))
    return tuple(fits)


def _likeliest(
    outline: str, n_rows: int, middle_m: float | None, cells: IntArray, number: FloatArray,
    noise_m: tuple[float, float], most: float, at: int,
) -> tuple[float, int]:  # fmt: skip
    """Return how unlikely points are with a noise, and the place; `most` and `at` where they are no likelier.

    See `linework.kernels.radon.outlines.likeliest_view` and `_places`.
    """
    offset = 0.0 if outline == "flat" else _face_m(outline, half_height_m(n_rows, noise_m[1]))
    views, largest = views_of(outline, n_rows, noise_m), _largest_of(outline, n_rows, noise_m)
    likeliest: tuple[float, int] = kernels.likeliest_view(
        cells, number, views, largest, _places(offset, middle_m), most, at
    )
    return likeliest


def half_height_m(n_rows: int, noise_m: float) -> float:
    """Return half the height of a bar whose points fill `n_rows` rows of cells with `noise_m` of noise in height. [m]."""
    return max(0.5 * n_rows * SECTION_CELL_M - _BLUR_SIGMAS * noise_m, _LEAST_HALF_M)


@lru_cache(maxsize=_KEPT_VIEWS)
def views_of(outline: str, n_rows: int, noise_m: tuple[float, float]) -> Float32Array:
    """Return the views (v, rows, columns) float32 of an outline: logarithms of the share of points in each cell.

    One view of a plate, which looks the same from both sides; of others three for each elevation: from the right, from
    the left, from both.

    Parameters
    ----------
    outline
        "flat", "pipe" or "box".
    n_rows
        Rows of cells that its points fill.
    noise_m
        Standard deviations of the points across and in height. [m]
    """
    half = half_height_m(n_rows, noise_m[1])
    beams = (np.arange(_BEAMS) + 0.5) / _BEAMS * 2.0 - 1.0
    heights: FloatArray = (np.arange(n_rows, dtype=np.float64) + 0.5 - 0.5 * n_rows) * SECTION_CELL_M
    across, upward = partial(_blurred, _COLUMNS, noise_m[0]), partial(_blurred, heights, noise_m[1])
    if outline == "pipe":
        points = [_pipe(half, beams, angle).T for angle in _ELEVATIONS_RAD]
        # Not a product of matrices, whose last bits depend on the threads of the library that does it
        right = [np.einsum("zb,ub->zu", upward(height), across(u)) for u, height in points]
    else:
        # What is even upwards or across, a face or a top, has the same density in all rows or columns that it fills
        middle = half if outline == "box" else 0.0
        face = np.outer(upward(half * beams).sum(axis=1), across(middle))
        if outline == "flat":
            return _log_shares(face[None])
        top = np.outer(upward(half), across(half * beams).sum(axis=1))
        right = [np.cos(angle) * face + np.sin(angle) * top for angle in _ELEVATIONS_RAD]
    one = _log_shares(np.stack(right))
    both = _log_shares(np.stack([0.5 * (seen + seen[:, ::-1]) for seen in right]))
    views: Float32Array = np.stack([one, one[:, :, ::-1], both], axis=1).reshape(-1, *one.shape[1:])
    return views


@lru_cache(maxsize=_KEPT_VIEWS)
def _largest_of(outline: str, n_rows: int, noise_m: tuple[float, float]) -> Float32Array:
    """Return the largest value (v, rows) float32 of each row of the views with these arguments."""
    return np.asarray(views_of(outline, n_rows, noise_m).max(axis=2))


def _log_shares(density: FloatArray) -> Float32Array:
    """Return the logarithms of the share of points in each cell, from the density (v, rows, columns) on an outline."""
    # A cell is two columns wide
    shares = density * (2.0 / density.sum(axis=(1, 2), keepdims=True))
    evenly = 1.0 / (density.shape[1] * 2.0 * _HALF_VIEW_M / SECTION_CELL_M)
    return np.asarray(np.log((1.0 - _ELSEWHERE) * shares + _ELSEWHERE * evenly), np.float32)


def _pipe(half: float, beams: FloatArray, elevation: float) -> AnyArray:
    """Return where beams (n,) from the right meet a pipe, (n, 2) across and height. [m]."""
    facing = np.array([np.cos(elevation), np.sin(elevation)])
    upward = np.array([-np.sin(elevation), np.cos(elevation)])
    return np.asarray(half * (np.sqrt(1.0 - beams**2)[:, None] * facing + beams[:, None] * upward))


def _blurred(cells: FloatArray, noise_m: float, at: float | FloatArray) -> FloatArray:
    """Return the density in cells (n,) of points (k,) along a line with noise, (n, k). [m]."""
    return np.asarray(np.exp(-0.5 * ((cells[:, None] - at) / noise_m) ** 2))


def _face_m(outline: str, half: float) -> float:
    """Return how far the points of an outline are from its middle, on average. [m]."""
    return half * (0.25 * np.pi if outline == "pipe" else 1.0)


def _places(offset_m: float, middle_m: float | None) -> AnyArray:
    """Return the places (p,) int64 to try: all of them, or those near the points' own middle, less or with an offset."""
    if middle_m is None:
        return _places_about(())
    return _places_about(tuple(round((middle_m + side * offset_m) / _PLACE_STEP_M) for side in (-1, 0, 1)))


@lru_cache(maxsize=_KEPT_PLACES)
def _places_about(about: tuple[int, ...]) -> AnyArray:
    """Return the places (p,) int64 to try about some, or all of them."""
    most = round(_MOST_ACROSS_M / _PLACE_STEP_M)
    if not about:
        return np.arange(-most, most + 1)
    tried = np.add.outer(about, np.arange(-_NEAR, _NEAR + 1))
    return np.unique(np.clip(tried, -most, most))


def _distance_m(outline: str, points: FloatArray, half: float) -> FloatArray:
    """Return the distances (n,) of points (n, 2), across and height from its middle, from an outline. [m]."""
    across, height = np.abs(points.T)
    if outline == "flat":
        return np.asarray(across)
    if outline == "pipe":
        return np.asarray(np.abs(np.hypot(across, height) - half))
    inner = np.maximum(across - half, height - half)
    outside = np.hypot(np.maximum(across - half, 0.0), np.maximum(height - half, 0.0))
    return np.asarray(np.where(inner <= 0.0, -inner, outside))
