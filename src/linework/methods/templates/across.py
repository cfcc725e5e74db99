"""Where across a line an edge of some kind lies, from the points of a station: how likely each offset is.

Separate from `parallel`, because it needs neither line nor template: offsets, heights and brightness in, evidence out.
All evidence is a log ratio against there being no such edge, so that of several stations, and of several kinds of edge, it
adds up. Profiles of ground are straight pieces that meet, brightness is level in pieces; each piece's own parameters are
integrated out (linear models with Gaussian priors), so that a profile with more pieces has to earn them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from scipy.special import ndtr

from linework.arrays import BoolArray, FloatArray, IntArray

#: Offsets that are compared: to both sides of the expected place. [m]
SOUGHT_M, _STEP_M = 0.40, 0.01
SOUGHT_OFFSETS_M: FloatArray = np.round(np.arange(-SOUGHT_M, SOUGHT_M + 0.5 * _STEP_M, _STEP_M), 6)
#: Points this far from the expected place are used: 35 cm on either side of the farthest offset show what is there.
USED_M = SOUGHT_M + 0.35
#: Bins across: a face is upright within two (DIN 483: 10 mm of batter and more), paint is wider than four.
_BIN_M = 0.02
#: Spread of heights of a bin on even ground: texture of asphalt and joints of paving. [m]
_TEXTURE_M = 0.005
#: Ground this far above or below the expected height is another surface, or stands on it. [m]
_LAYER_M = 0.35
#: Widths of the face of a step: from upright to a mountable kerb. [m]
_FACES_M = (0.02, 0.04, 0.06, 0.10, 0.15, 0.25)
#: A step this high is as likely a step as a joint: kerbs are lowered to 3 cm for wheelchairs (DIN 18040-3), joints and
#: roots lift slabs by 1 cm. [m]
_STEP_HIGH_M = 0.02
#: Points on a face: between these shares of its height, and this far beyond its ends, as the noise of scanners is across
#: (1 cm for those of mobile mapping); fewer points say nothing of it. Its lean: up to that of a mountable kerb. [m]
_FACE_MARGIN, _SCATTER_M, _NOISE_M, _LEAST_ON_FACE, _LEAN = 0.15, 0.04, 0.01, 4, 1.0
#: Points of a station that are compared with every face and every offset: eight times as many as a mobile scanner leaves
#: on half a metre of kerb (600 on a square metre), a tenth of what one on a tripod does, in arrays of 10 MB.
_MOST_POINTS = 4000
#: No offset is less likely than this [log]: no profile of a station rules one out.
_UNLIKELY = 12.0
#: Standard deviations before the points are seen: slope of ground, of a face, change at a break [m/m]; of brightness from
#: one surface to another, relative.
_SLOPE, _FACE_SLOPE, _BREAK_SLOPE, _CONTRAST = 0.1, 5.0, 0.3, 0.3
#: Spread of brightness of one surface from bin to bin, and brightest paint, relative to what is usual there.
_GRAIN, _BRIGHTEST = 0.05, 6.0
#: Widths of stripes: 10 cm to stop lines of 50 cm. [m]
_STRIPES_M = (0.10, 0.12, 0.15, 0.20, 0.25, 0.30, 0.50)
#: Spread of the points of a rail or a wire across [m]; share of the points near the expected height that are its own; as
#: many points say how sure it is, as they share the errors of one pass.
_THING_M, _OWN_SHARE, _MOST_TOLD = 0.03, 0.5, 20
#: Height of a rail's or wire's points about the expected height. [m]
_THING_HIGH_M = 0.4
#: A rail's upper edge: among its points, this quantile.
_UPPER = 0.9


@dataclass(frozen=True, slots=True)
class EdgeEvidence:
    """What a station's points say of an edge at each of `SOUGHT_OFFSETS_M`.

    Parameters
    ----------
    log_ratio
        (k,) of the likelihood with the edge there to that without any; 0 without points.
    height_m, sigma_m
        (k,) height of the edge if it is there, from the expected height, and its standard deviation; NaN: unknown. [m]
    """

    log_ratio: FloatArray
    height_m: FloatArray
    sigma_m: FloatArray

    @property
    def total(self) -> float:
        """The log ratio of an edge anywhere among the offsets to none."""
        return float(np.logaddexp.reduce(self.log_ratio) - np.log(len(self.log_ratio)))


def edge_evidence(edge: str, across_m: FloatArray, up_m: FloatArray, bright: FloatArray) -> EdgeEvidence:
    """Return what points say of an edge of a kind (see `NODE_EDGES`), relative to where it is expected.

    Parameters
    ----------
    across_m, up_m
        (n,) offsets and heights of the points of a station from the expected place. [m]
    bright
        (n,) intensities in any unit.
    """
    near = np.abs(across_m) <= USED_M
    across_m, up_m, bright = across_m[near], up_m[near], bright[near]
    if edge in ("rail", "wire"):
        return _of_thing(across_m, up_m, is_rail=edge == "rail")
    ground = np.abs(up_m) <= _LAYER_M
    across_m, up_m, bright = across_m[ground], up_m[ground], bright[ground]
    level = _Bins.of(across_m, up_m, _TEXTURE_M, np.median)
    if edge in ("foot", "top"):
        return _of_step(level, edge, across_m, up_m)
    if edge == "break":
        return _of_break(level)
    if edge in ("shade", "stripe"):
        return _of_brightness(edge, level, across_m, bright)
    return nothing_said()


def nothing_said() -> EdgeEvidence:
    """Return the evidence of no points."""
    k = len(SOUGHT_OFFSETS_M)
    return EdgeEvidence(np.zeros(k), np.full(k, np.nan), np.full(k, np.nan))


#: Middles of all bins across. [m]
_ACROSS_M: FloatArray = _BIN_M * np.arange(0.5 - round(USED_M / _BIN_M), round(USED_M / _BIN_M), 1.0)
#: Fewest bins with points on each side of the expected place.
_EACH_SIDE = 4


@dataclass(frozen=True, slots=True)
class _Bins:
    """What was measured in each bin (b,), and its weight: 1 / variance; 0 without points."""

    value: FloatArray
    weight: FloatArray

    @classmethod
    def of(
        cls, at: FloatArray, value: FloatArray, least: float, middle: Callable[[FloatArray], Any]
    ) -> _Bins:
        """Return the bins of points; `least`: the standard deviation of one with many points."""
        number = np.floor(at / _BIN_M).astype(np.int64) + len(_ACROSS_M) // 2
        inside = (number >= 0) & (number < len(_ACROSS_M))
        number, value = number[inside], value[inside]
        order = np.lexsort((value, number))
        bins, starts, counts = np.unique(number[order], return_index=True, return_counts=True)
        parts = np.split(value[order], starts[1:]) if len(bins) else []
        spreads = np.array([part.std() for part in parts], dtype=np.float64)
        # A single point may be as far off as the points of any bin
        usual = float(np.median(spreads[counts > 1])) if np.any(counts > 1) else least
        spreads = np.where(counts > 1, spreads, np.maximum(usual, least))
        values, weights = np.zeros(len(_ACROSS_M)), np.zeros(len(_ACROSS_M))
        values[bins] = [middle(part) for part in parts]
        weights[bins] = 1.0 / (least**2 + spreads**2 / np.maximum(counts, 1))
        return cls(values, weights)

    @property
    def n(self) -> int:
        """Number of bins with points."""
        return int((self.weight > 0.0).sum())

    @property
    def is_enough(self) -> bool:
        """Whether there are bins on both sides."""
        has, half = self.weight > 0.0, len(_ACROSS_M) // 2
        return bool(min(has[:half].sum(), has[half:].sum()) >= _EACH_SIDE)


@dataclass(frozen=True, slots=True)
class _Models:
    """Linear models of a profile.

    Parameters
    ----------
    basis
        (b, g, p): columns of g models at all bins.
    squares
        (b, g * p * p): products of the columns.
    prior, log_prior
        (p, p): the inverse covariance of their coefficients, and half the log of its determinant.
    """

    basis: FloatArray
    squares: FloatArray
    prior: FloatArray
    log_prior: float

    @classmethod
    def of(cls, basis: FloatArray, prior: FloatArray) -> _Models:
        squares = (basis[..., :, None] * basis[..., None, :]).reshape(len(basis), -1)
        return cls(basis, squares, prior, 0.5 * float(np.linalg.slogdet(prior)[1]))

    def fitted(self, bins: _Bins) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the log marginal likelihood (g,), coefficients (g, p) and their covariances (g, p, p)."""
        _, g, p = self.basis.shape
        normal = (bins.weight @ self.squares).reshape(g, p, p) + self.prior
        right = ((bins.weight * bins.value) @ self.basis.reshape(len(self.basis), -1)).reshape(g, p)
        covariance = np.linalg.inv(normal)
        found = np.einsum("gij,gj->gi", covariance, right)
        left = float(bins.weight @ bins.value**2) - np.einsum("gi,gi->g", found, right)
        log = -0.5 * left - 0.5 * np.log(np.linalg.det(normal)) + self.log_prior
        return log, found, np.asarray(covariance, dtype=np.float64)


def _prior(*deviations: tuple[tuple[float, ...], float]) -> FloatArray:
    """Return the inverse covariance (p, p) from combinations of coefficients and their standard deviations."""
    parts = [np.outer(combination, combination) / sigma**2 for combination, sigma in deviations]
    return np.asarray(np.sum(parts, axis=0))


def _bent(knots: FloatArray) -> FloatArray:
    """Return (b, g, 2 + k) columns of pieces that meet at knots (g, k): 1, x, and how far x is beyond each knot."""
    at = _ACROSS_M[:, None, None]
    ones = np.ones((len(_ACROSS_M), len(knots), 1))
    return np.concatenate([ones, ones * at, np.maximum(at - knots, 0.0)], axis=2)


@cache
def _even_models() -> _Models:
    return _Models.of(_bent(np.zeros((1, 0))), _prior(((1.0, 0.0), 0.5), ((0.0, 1.0), _SLOPE)))


def _straight(bins: _Bins) -> tuple[float, FloatArray]:
    """Return the log marginal likelihood of even ground, and its height and slope."""
    log, found, _ = _even_models().fitted(bins)
    return float(log[0]), found[0]


def _tempered(log: FloatArray, none: float, bins: _Bins) -> FloatArray:
    """Return log ratios, less sure where even the best model leaves more than the spread of the bins explains."""
    left = -2.0 * float(max(log.max(), none)) / bins.n
    return np.asarray((log - none) / max(left, 1.0))


@cache
def _step_models() -> tuple[FloatArray, _Models]:
    """Return the ends (g, 2) of every face [m], and the models of a step there."""
    ends = [(at, at + face) for face in _FACES_M for at in SOUGHT_OFFSETS_M[::2] - 0.5 * face]
    knots = np.array(ends)
    prior = _prior(
        ((1.0, 0.0, 0.0, 0.0), 0.5), ((0.0, 1.0, 0.0, 0.0), _SLOPE), ((0.0, 0.0, 1.0, 0.0), _FACE_SLOPE),
        ((0.0, 1.0, 1.0, 1.0), _SLOPE),
    )  # fmt: skip
    return knots, _Models.of(_bent(knots), prior)


def _of_step(level: _Bins, edge: str, across_m: FloatArray, up_m: FloatArray) -> EdgeEvidence:
    if not level.is_enough:
        return nothing_said()
    knots, models = _step_models()
    log, found, covariance = models.fitted(level)
    none = _straight(level)[0]
    ratio = _tempered(log, none, level)
    rise = found[:, 2] * (knots[:, 1] - knots[:, 0])
    ratio += np.log(rise**2 / (rise**2 + _STEP_HIGH_M**2) + 1e-9)
    # The foot of a step that rises is its first end; of one that falls, its second
    second = ((rise < 0.0) if edge == "foot" else (rise >= 0.0)).astype(np.int64)
    rows = np.arange(len(knots))
    ends = [_values_at(knots, found, covariance, np.full(len(knots), end)) for end in (0, 1)]
    height, sigma = (np.stack([end[k] for end in ends])[second, rows] for k in (0, 1))
    heights = np.stack([ends[0][0], ends[1][0]], axis=1)
    at, spread = _on_face(across_m, up_m, knots, heights, second)
    return _spread(at, spread, ratio - np.log(len(_FACES_M)), height, sigma)


def _on_face(
    across_m: FloatArray, up_m: FloatArray, knots: FloatArray, heights: FloatArray, which: IntArray
) -> tuple[FloatArray, FloatArray]:
    """Return where the face of each step (g,) has its foot or top, and the standard deviation, in metres.

    A steep face is hit by many points whose heights say where on it they lie, and whose offsets scatter by the noise of
    the scanner: fitted as heights over offsets, it would come out as wide as they scatter. Offsets are fitted over heights.
    """
    across_m, up_m = _some(across_m, up_m)
    rows = np.arange(len(knots))
    low, high = heights.min(axis=1)[:, None], heights.max(axis=1)[:, None]
    margin = _FACE_MARGIN * (high - low)
    on = (up_m > low + margin) & (up_m < high - margin)
    on &= (across_m > knots[:, :1] - _SCATTER_M) & (across_m < knots[:, 1:] + _SCATTER_M)
    middle = 0.5 * (low + high)
    up = up_m - middle
    n, sum_u = on.sum(axis=1), (on * up).sum(axis=1)
    # x = x0 + lean * up, by least squares; the lean is known before to be within that of a mountable kerb
    var = _NOISE_M**2
    a, b, c = n + var / 1.0, sum_u, (on * up**2).sum(axis=1) + var / _LEAN**2
    r0, r1 = (on * across_m).sum(axis=1), (on * up * across_m).sum(axis=1)
    det = a * c - b * b
    x0, lean = (c * r0 - b * r1) / det, (a * r1 - b * r0) / det
    end = heights[rows, which] - middle[:, 0]
    at, spread = x0 + lean * end, _NOISE_M * np.sqrt((c - 2.0 * b * end + a * end**2) / det)
    few = n < _LEAST_ON_FACE
    at = np.where(few, knots[rows, which], at)
    return at, np.where(few, _NOISE_M, spread)


def _some(across_m: FloatArray, up_m: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return `_MOST_POINTS` of more points: evenly from their order across, so that theirs in the file does not matter."""
    if len(across_m) <= _MOST_POINTS:
        return across_m, up_m
    order = np.lexsort((up_m, across_m))
    chosen = order[np.linspace(0, len(order) - 1, _MOST_POINTS).astype(np.int64)]
    return across_m[chosen], up_m[chosen]


def _spread(
    at: FloatArray, spread: FloatArray, ratio: FloatArray, height: FloatArray, sigma: FloatArray
) -> EdgeEvidence:
    """Return the evidence of models whose edges lie anywhere, with standard deviations, at the offsets."""
    grid = SOUGHT_OFFSETS_M
    wide = np.hypot(spread, 0.5 * _STEP_M)[:, None]
    share = _STEP_M / (np.sqrt(2.0 * np.pi) * wide) * np.exp(-0.5 * ((at[:, None] - grid) / wide) ** 2)
    log = ratio[:, None] + np.log(share + 1e-300)
    total = np.logaddexp.reduce(log, axis=0)
    weight = np.exp(log - total)
    mean = (weight * height[:, None]).sum(axis=0)
    variance = (weight * (sigma[:, None] ** 2 + (height[:, None] - mean) ** 2)).sum(axis=0)
    return EdgeEvidence(np.maximum(total, -_UNLIKELY), mean, np.sqrt(variance))


@cache
def _break_models() -> _Models:
    prior = _prior(((1.0, 0.0, 0.0), 0.5), ((0.0, 1.0, 0.0), _SLOPE), ((0.0, 0.0, 1.0), _BREAK_SLOPE))
    return _Models.of(_bent(SOUGHT_OFFSETS_M[:, None]), prior)


def _of_break(level: _Bins) -> EdgeEvidence:
    if not level.is_enough:
        return nothing_said()
    log, found, covariance = _break_models().fitted(level)
    ratio = _tempered(log, _straight(level)[0], level)
    at = SOUGHT_OFFSETS_M[:, None]
    height, sigma = _values_at(at, found, covariance, np.zeros(len(at), dtype=np.int64))
    return EdgeEvidence(ratio, height, sigma)


def _values_at(
    knots: FloatArray, found: FloatArray, covariance: FloatArray, which: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return heights (g,) of models at one of their knots, and their standard deviations."""
    at = knots[np.arange(len(knots)), which]
    row = np.concatenate([np.ones((len(at), 1)), at[:, None], np.maximum(at[:, None] - knots, 0.0)], axis=1)
    height = np.einsum("gi,gi->g", row, found)
    return height, np.sqrt(np.einsum("gi,gij,gj->g", row, covariance, row))


@cache
def _brightness_models(edge: str) -> tuple[FloatArray, _Models]:
    """Return the offset (g,) of each model of brightness [m], and the models; those of "": of one surface."""
    n = len(_ACROSS_M)
    if not edge:
        return np.zeros(1), _Models.of(np.ones((n, 1, 1)), _prior(((1.0,), 1.0)))
    at = SOUGHT_OFFSETS_M
    if edge == "shade":
        inside = _ACROSS_M[:, None] > at
    else:
        at = np.repeat(at, len(_STRIPES_M))
        half_m = np.tile(0.5 * np.array(_STRIPES_M), len(SOUGHT_OFFSETS_M))
        # The share of a bin that is painted
        inside = np.clip((half_m - np.abs(_ACROSS_M[:, None] - at)) / _BIN_M + 0.5, 0.0, 1.0)
    basis = np.stack([np.ones(inside.shape), inside.astype(np.float64)], axis=2)
    return at, _Models.of(basis, _prior(((1.0, 0.0), 1.0), ((0.0, 1.0), _CONTRAST)))


def _of_brightness(edge: str, level: _Bins, across_m: FloatArray, bright: FloatArray) -> EdgeEvidence:
    usual = float(np.median(bright)) if len(bright) else 0.0
    if not level.is_enough or usual <= 0.0:
        return nothing_said()
    bins = _Bins.of(across_m, np.minimum(bright / usual, _BRIGHTEST) - 1.0, _GRAIN, np.mean)
    none, *_ = _brightness_models("")[1].fitted(bins)
    at, models = _brightness_models(edge)
    log, found, covariance = models.fitted(bins)
    ratio = _tempered(log, float(none[0]), bins)
    if edge == "stripe":
        # Paint is brighter than what it lies on
        ratio += np.log(2.0 * ndtr(found[:, 1] / np.sqrt(covariance[:, 1, 1])) + 1e-9) - np.log(
            len(_STRIPES_M)
        )
    _, (height, slope) = _straight(level)
    sigma = np.full(len(at), 1.0 / np.sqrt(level.weight.sum()))
    return _spread(at, np.zeros(len(at)), ratio, height + slope * at, sigma)


def _of_thing(across_m: FloatArray, up_m: FloatArray, *, is_rail: bool) -> EdgeEvidence:
    high: BoolArray = np.abs(up_m) <= _THING_HIGH_M
    x, z = _some(across_m[high], up_m[high])
    if len(x) < 3:
        return nothing_said()
    apart = (x[:, None] - SOUGHT_OFFSETS_M) / _THING_M
    density = np.exp(-0.5 * apart**2) / (np.sqrt(2.0 * np.pi) * _THING_M)
    own = _OWN_SHARE * density * 2.0 * USED_M
    ratio = np.log(own + 1.0 - _OWN_SHARE).sum(axis=0) * min(1.0, _MOST_TOLD / len(x))
    weight = own / (own + 1.0 - _OWN_SHARE)
    height, sigma = np.full(len(SOUGHT_OFFSETS_M), np.nan), np.full(len(SOUGHT_OFFSETS_M), np.nan)
    for k in np.flatnonzero(weight.max(axis=0) > _OWN_SHARE).tolist():
        mine = z[weight[:, k] > _OWN_SHARE]
        height[k] = float(np.quantile(mine, _UPPER) if is_rail else np.median(mine))
        sigma[k] = float(max(mine.std() / np.sqrt(len(mine)), 0.005))
    return EdgeEvidence(np.asarray(ratio), height, sigma)
