"""What the points across a line show: a stripe of paint, a step, or something that stands or hangs; with the residuals.

Separate from `evidence`, because it needs no survey: offsets and values in, fits out.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from linework.arrays import BoolArray, FloatArray

#: Width of the bins across a line: a stripe or a kerb's face is wider, the spacing of points wider than a tenth of it. [m]
ACROSS_BIN_M = 0.02
#: Fewest points of a bin, and fewest bins, that are fitted.
LEAST_POINTS, FEWEST_ACROSS_BINS = 2, 12
#: Widest stripe: stop lines and crossings have 50 cm. [m]
WIDEST_PAINT_M = 0.50
#: Farthest from the line that its stripe is looked for: beyond half the distance of the two stripes of a double line lies
#: the other one. [m]
NEAR_LINE_M = 0.12
#: Spread of heights on even ground: texture of asphalt and noise of scanners. [m]
TEXTURE_M = 0.005
#: Bins on each side of a step, at least.
_EACH_SIDE = 5
#: Share of a stripe's bins that are brighter than half way up, at least; of a double line with its gap it is two thirds.
_PAINTED_SHARE = 0.8
#: Times that points far from a middle are left out of the next one.
_ROUNDS = 8


@dataclass(frozen=True, slots=True)
class AcrossFit:
    """A fit across a line.

    Parameters
    ----------
    offset_m, value
        (k,) middles of the bins, positive to the right [m], and what was measured in them: brightness, or height [m].
    fitted
        (k,) values of the fit.
    at_m
        Offset of what was found from the line. [m]
    size
        Contrast of a stripe (paint by asphalt), or height of a step, positive where the right is higher [m].
    width_m
        Of a stripe; NaN for a step. [m]
    explained
        Share of the variation that the fit explains, beyond a level or a plane, 0 to 1.
    """

    offset_m: FloatArray
    value: FloatArray
    fitted: FloatArray
    at_m: float
    size: float
    width_m: float
    explained: float

    @property
    def residual(self) -> float:
        """Root mean square of what the fit leaves."""
        return float(np.sqrt(np.mean((self.value - self.fitted) ** 2)))


def stripe_across(offset_m: FloatArray, brightness: FloatArray) -> AcrossFit | None:
    """Return the stripe that fits brightness (n,) at offsets (n,) [m] best, by least squares; None: too few points.

    A stripe is brighter than both sides, which are alike: of all widths and positions, the one that leaves least. Stripes
    farther from the line than `NEAR_LINE_M` are taken out first.
    """
    at, value, weight = _binned(offset_m, brightness, np.mean)
    kept = np.ones(len(at), dtype=np.bool_)
    while kept.sum() >= FEWEST_ACROSS_BINS:
        found = _best_stripe(at[kept], value[kept], weight[kept])
        if found is None:
            return None
        middle, width, bright, dark, explained = found
        if abs(middle) <= NEAR_LINE_M:
            fitted = np.where(np.abs(at - middle) <= 0.5 * width, bright, dark)
            return AcrossFit(at, value, fitted, middle, bright / max(dark, 1e-9), width, explained)
        kept &= np.abs(at - middle) > 0.5 * width + ACROSS_BIN_M
    return None


def _best_stripe(
    at: FloatArray, value: FloatArray, weight: FloatArray
) -> tuple[float, float, float, float, float] | None:
    """Return middle and width [m], brightness on it and beside it, and what it explains, of the stripe that leaves least."""
    total = _left(value, weight, np.ones(len(at), dtype=np.bool_))[0]
    widths = np.arange(3 * ACROSS_BIN_M, WIDEST_PAINT_M + 0.5 * ACROSS_BIN_M, ACROSS_BIN_M)
    # In the middle of a bin, or between two
    middles = np.concatenate([at, at + 0.5 * ACROSS_BIN_M])
    width, middle = (part.ravel() for part in np.meshgrid(widths, middles, indexing="ij"))
    reach = 0.5 * width + 1e-9
    first, last = np.searchsorted(at, middle - reach, side="right"), np.searchsorted(at, middle + reach)
    fits = (last - first >= 2) & (last - first <= len(at) - _EACH_SIDE)
    width, middle, first, last = (part[fits] for part in (width, middle, first, last))
    # Sums over the bins of a stripe as differences of sums up to its ends, of the value from its mean to keep digits
    centred = value - np.average(value, weights=weight)
    sums = np.stack([np.r_[0.0, np.cumsum(part)] for part in (weight, weight * centred, weight * centred**2)])
    inside = sums[:, last] - sums[:, first]
    outside = sums[:, -1:] - inside
    left = inside[2] - inside[1] ** 2 / inside[0] + outside[2] - outside[1] ** 2 / outside[0]
    is_brighter = inside[1] / inside[0] > outside[1] / outside[0]
    for k in np.argsort(left, kind="stable").tolist():
        if left[k] >= total:
            break
        stripe = np.zeros(len(at), dtype=np.bool_)
        stripe[first[k] : last[k]] = True
        bright, dark = _left(value, weight, stripe)[1], _left(value, weight, ~stripe)[1]
        # Two stripes and the gap between them are not one
        if is_brighter[k] and np.mean(value[stripe] > 0.5 * (bright + dark)) >= _PAINTED_SHARE:
            return float(middle[k]), float(width[k]), bright, dark, _explained(total, float(left[k]))
    return None


def step_across(offset_m: FloatArray, height_m: FloatArray) -> AcrossFit | None:
    """Return the step that fits heights (n,) at offsets (n,) [m] best, by least squares; None: too few points.

    Left and right of it the ground is even and may fall. What it explains is counted beyond one even ground without a step.
    """
    at, value, weight = _binned(offset_m, height_m, np.median)
    # A bin whose points disagree, as in a hedge or on a face, says little: its weight is that of its median's accuracy
    spread = _binned(offset_m, height_m, lambda part: np.median(np.abs(part - np.median(part))))[1]
    weight /= np.hypot(spread, TEXTURE_M) ** 2
    if len(at) < FEWEST_ACROSS_BINS:
        return None
    total = float((weight * (value - _even(at, value, weight, np.ones(len(at), dtype=np.bool_))) ** 2).sum())
    least, found = np.inf, (0.0, value, 0.0)
    for k in range(_EACH_SIDE, len(at) - _EACH_SIDE + 1):
        right = np.arange(len(at)) >= k
        fitted = np.where(right, _even(at, value, weight, right), _even(at, value, weight, ~right))
        left_over = float((weight * (value - fitted) ** 2).sum())
        if left_over < least:
            middle = 0.5 * (at[k - 1] + at[k])
            step = _even(at, value, weight, right, middle) - _even(at, value, weight, ~right, middle)
            least, found = left_over, (float(middle), fitted, float(step[0]))
    middle, fitted, step_m = found
    return AcrossFit(at, value, fitted, middle, step_m, float("nan"), _explained(total, least))


def middle_of_points(
    offset_m: FloatArray, height_m: FloatArray, within_m: float
) -> tuple[BoolArray, float, float]:
    """Return which points (n,) belong to what stands or hangs near (0, 0), and the offset and height of its middle [m].

    The middle moves to that of the points within a radius, until it stays; NaN without points there.
    """
    middle = np.zeros(2)
    near = np.zeros(len(offset_m), dtype=np.bool_)
    for _ in range(_ROUNDS):
        again = np.hypot(offset_m - middle[0], height_m - middle[1]) <= within_m
        if not again.any():
            return again, float("nan"), float("nan")
        middle = np.array([offset_m[again].mean(), height_m[again].mean()])
        if np.array_equal(again, near):
            break
        near = again
    return near, float(middle[0]), float(middle[1])


def _binned(
    offset_m: FloatArray, value: FloatArray, of: Callable[[FloatArray], Any]
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return middles of the bins that hold enough points, the mean or median in each, and the number of points."""
    if len(offset_m) == 0:
        return np.zeros(0), np.zeros(0), np.zeros(0)
    number = np.floor(offset_m / ACROSS_BIN_M).astype(np.int64)
    order = np.argsort(number, kind="stable")
    bins, starts, counts = np.unique(number[order], return_index=True, return_counts=True)
    kept = counts >= LEAST_POINTS
    parts = np.split(value[order], starts[1:])
    values = np.array(
        [float(of(part)) for part, is_kept in zip(parts, kept.tolist(), strict=True) if is_kept]
    )
    return (bins[kept] + 0.5).astype(np.float64) * ACROSS_BIN_M, values, counts[kept].astype(np.float64)


def _left(value: FloatArray, weight: FloatArray, chosen: BoolArray) -> tuple[float, float]:
    """Return the weighted sum of squares about the mean of the chosen values, and that mean."""
    mean = float(np.average(value[chosen], weights=weight[chosen]))
    return float((weight[chosen] * (value[chosen] - mean) ** 2).sum()), mean


def _even(
    at: FloatArray, value: FloatArray, weight: FloatArray, chosen: BoolArray, where: float | None = None
) -> FloatArray:
    """Return the straight line through the chosen values at all bins, or at one offset (1,)."""
    middle = float(np.average(at[chosen], weights=weight[chosen]))
    mean = float(np.average(value[chosen], weights=weight[chosen]))
    step, w = at[chosen] - middle, weight[chosen]
    slope = float((w * step * (value[chosen] - mean)).sum() / max(float((w * step**2).sum()), 1e-12))
    return mean + slope * ((at if where is None else np.array([where])) - middle)


def _explained(total: float, left: float) -> float:
    return float(np.clip(1.0 - left / total, 0.0, 1.0)) if total > 0.0 else 0.0
