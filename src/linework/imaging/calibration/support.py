"""Which corrections of a calibration the corners support, and the calibration with those alone."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from linework.arrays import BoolArray, FloatArray, IntArray
from linework.imaging.calibration.bundle import Bundle, CornerWindow, ReducedWindow, misfit_px
from linework.imaging.calibration.parameters import (
    NAMES,
    PARAMETERS,
    CalibrationParameter,
    adjusted_rig,
    prior_of,
)
from linework.model.camera import StereoRig

#: Chance that any correction of a right calibration is taken for one: spread over all parameters (Bonferroni).
_MISTAKEN = 0.02
#: A parameter is determined where its sigma is less than this part of what was known before.
_DETERMINED = 0.33
#: Error that all corners may have in common, of which neither their noise nor the differences of windows tell: finding a
#: place between pixels is biased by some hundredths of one (Schreier et al. 2000, doi:10.1117/1.1314593). [pixels]
_COMMON_PX = 0.03
#: Steps of the first fit of all parameters, from errors of degrees and per cents; of each later one; and rounds of both.
_FIRST_STEPS, _NEXT_STEPS, _ROUNDS = 10, 4, 4
#: Fewest windows that say how far windows disagree, and fewest corners in them.
LEAST_WINDOWS, LEAST_CORNERS = 4, 100
_P = len(PARAMETERS)
_NO_BETTER = "the residuals are no smaller with the corrections: none is made"


@dataclass(frozen=True, slots=True)
class Finding:
    """What the corners say of one parameter.

    Parameters
    ----------
    parameter
        Which.
    correction, sigma
        Its value beside the given one and its standard deviation, estimated with the corrections that are supported
        and no others. [unit of the parameter]
    is_supported
        Whether the correction is made.
    reason
        Why, or why not.
    """

    parameter: CalibrationParameter
    correction: float
    sigma: float
    is_supported: bool
    reason: str


@dataclass(frozen=True, slots=True)
class CornerCalibration:
    """A calibration adjusted to corners.

    Parameters
    ----------
    rig
        With the corrections that are supported.
    time_offset_s
        To be added to the times of images. [s]
    findings
        One for each of `PARAMETERS`.
    n_windows, n_pairs, n_corners, n_pixels
        Windows of pairs, their pairs, corners followed in them, and places where these were seen.
    sigma_px
        Standard deviation of a coordinate of a corner. [pixels]
    sigma_moves
        (6,) standard deviations of the poses within a window, estimated: forward, left, up [m]; roll, pitch, heading
        [rad].
    before_px, after_px
        Median residual of corners with the poses of the trajectory as they are. [pixels]
    """

    rig: StereoRig
    time_offset_s: float
    findings: tuple[Finding, ...]
    n_windows: int
    n_pairs: int
    n_corners: int
    n_pixels: int
    sigma_px: float
    sigma_moves: FloatArray
    before_px: float
    after_px: float


def calibrated_by_corners(
    rig: StereoRig, windows: Sequence[CornerWindow], *, progress: Callable[[int, int], None] | None = None
) -> CornerCalibration:
    """Return the calibration of a rig, corrected where corners followed over pairs support it.

    Parameters
    ----------
    rig
        As given.
    windows
        Corners of some pairs in a row each, spread over the survey.
    progress
        Told rounds done and their number.

    Raises
    ------
    ValueError
        Too few windows or corners; the message has the numbers.

    Notes
    -----
    All parameters are fitted at first, with the sizes of residuals and of errors of poses. Then corrections are added
    one by one to the given calibration: the one that most improves windows that it was not fitted to (of those that do so
    alike, the first of `PARAMETERS`), as long as it is different from 0 by a test at 2 % for all together. Sigmas are the larger of those of the normal equations and
    those by which windows differ, and have added what is taken as given (`CONSIDERED`) and what an error that all corners
    have in common would change.

    References
    ----------
    B. Triggs et al., "Bundle adjustment - a modern synthesis", 1999, doi:10.1007/3-540-44480-7_21; H. White,
    "Maximum likelihood estimation of misspecified models", Econometrica 50 (1982), doi:10.2307/1912526.
    """
    bundle = Bundle(rig, windows)
    n_corners = sum(len(fit.landmarks) for fit in bundle.fits)
    if len(bundle.fits) < LEAST_WINDOWS or n_corners < LEAST_CORNERS:
        plural = "" if len(bundle.fits) == 1 else "s"
        raise ValueError(
            f"{n_corners} corners followed in {len(bundle.fits)} window{plural} of pairs, at least {LEAST_CORNERS} in "
            f"{LEAST_WINDOWS} are needed"
        )
    told = progress or (lambda _done, _n: None)
    told(0, _ROUNDS)
    every = np.arange(len(NAMES)) < _P
    bundle.fit(every, _FIRST_STEPS)
    given_px = float(np.median(misfit_px(rig, windows, np.zeros(len(NAMES)))))
    chosen = np.zeros(_P, dtype=bool)
    for done in range(1, _ROUNDS + 1):
        reduced = bundle.reduce()
        before, chosen = chosen, _chosen(reduced)
        told(done, _ROUNDS)
        if done > 1 and (chosen == before).all():
            break
        _refit(bundle, chosen)
    reduced, chosen = _tested(bundle, chosen)
    findings = _findings(reduced, chosen, _rounded(bundle.x, reduced, chosen))
    x = _used(findings)
    adjusted_px = float(np.median(misfit_px(rig, windows, x)))
    if adjusted_px > given_px:
        findings = tuple(
            replace(f, is_supported=False, reason=_NO_BETTER) if f.is_supported else f for f in findings
        )
        x, adjusted_px = _used(findings), given_px
    told(_ROUNDS, _ROUNDS)
    new, offset = adjusted_rig(rig, x)
    return CornerCalibration(
        new, offset, findings, len(bundle.fits), sum(len(fit.moves) for fit in bundle.fits), n_corners,
        sum(len(fit.tracks) for fit in bundle.fits), bundle.sigma_px, bundle.sigma_moves,
        before_px=given_px, after_px=adjusted_px,
    )  # fmt: skip


def _refit(bundle: Bundle, chosen: BoolArray) -> None:
    """Fit the chosen parameters, with all others as they are given."""
    free = np.concatenate([chosen, np.zeros(len(NAMES) - _P, dtype=bool)])
    bundle.x = np.where(free, bundle.x, 0.0)
    bundle.fit(free, _NEXT_STEPS)


def _tested(bundle: Bundle, chosen: BoolArray) -> tuple[list[ReducedWindow], BoolArray]:
    """Return the reduced windows and the parameters of which each passes the test as it is fitted in the end.

    What fails is dropped and the others are fitted again, until none fails or none is left.
    """
    while True:
        reduced = bundle.reduce()
        found = _estimated(reduced, chosen)
        fails = np.abs(bundle.x[found.index]) <= _least_t(len(reduced)) * found.sigma
        if not fails.any():
            return reduced, chosen
        chosen = chosen.copy()
        chosen[found.index[fails]] = False
        _refit(bundle, chosen)


def _rounded(x: FloatArray, windows: Sequence[ReducedWindow], chosen: BoolArray) -> FloatArray:
    """Return the corrections to a thousandth of their sigmas, 0 for what is not chosen.

    Sums differ in their last bits from machine to machine; the calibration, and the lines found with it, do not.
    """
    found, rounded = _estimated(windows, chosen), np.zeros(len(x))
    for k, sigma in zip(found.index.tolist(), found.sigma.tolist(), strict=True):
        rounded[k] = round(float(x[k]), 3 - math.floor(math.log10(sigma)))
    return rounded


def _used(findings: Sequence[Finding]) -> FloatArray:
    """Return the corrections that are made, in the order of all parameters."""
    used = {f.parameter.name: f.correction for f in findings if f.is_supported}
    return np.array([used.get(name, 0.0) for name in NAMES])


@dataclass(frozen=True, slots=True)
class _Estimate:
    """Parameters estimated together: their indices, values, sigmas, and the misfit of each window left out."""

    index: IntArray
    x: FloatArray
    sigma: FloatArray
    left_out: FloatArray

    def of(self, k: int) -> tuple[float, float]:
        i = int(np.flatnonzero(self.index == k)[0])
        return float(self.x[i]), float(self.sigma[i])


def _estimated(windows: Sequence[ReducedWindow], chosen: BoolArray) -> _Estimate:
    a, c = np.flatnonzero(chosen).astype(np.int64), np.arange(_P, len(NAMES))
    n = len(windows)
    if not len(a):
        return _Estimate(a, np.zeros(0), np.zeros(0), np.zeros(n))
    own = [w.normal[np.ix_(a, a)] for w in windows]
    right = [w.right[a] for w in windows]
    prior = np.diag(1.0 / prior_of()[a] ** 2)
    whole, total = sum(own) + prior, sum(right)
    covariance = np.linalg.inv(whole)
    x = covariance @ total
    scores = np.stack([b - N @ x for N, b in zip(own, right, strict=True)])
    between = covariance @ (scores.T @ scores * n / (n - 1)) @ covariance
    gain = covariance @ sum(w.normal[np.ix_(a, c)] for w in windows)
    considered = (gain**2) @ prior_of()[c] ** 2
    common = _COMMON_PX / np.sqrt(np.mean([w.effect_px[a] ** 2 for w in windows], axis=0))
    sigma = np.sqrt(np.maximum(np.diag(covariance), np.diag(between)) + considered + common**2)
    left_out = np.empty(n)
    for i, (N, b) in enumerate(zip(own, right, strict=True)):
        others = np.linalg.solve(whole - N, total - b)
        left_out[i] = 0.5 * others @ N @ others - b @ others
    return _Estimate(a, x, sigma, left_out)


def _least_t(n_windows: int) -> float:
    """Return how many sigmas a correction must be from 0, by Student's distribution for as many windows."""
    from scipy.stats import t

    return float(t.ppf(1.0 - 0.5 * _MISTAKEN / _P, n_windows - 1))


def _with(chosen: BoolArray, k: int) -> BoolArray:
    return np.asarray(chosen | (np.arange(_P) == k))


def _chosen(windows: Sequence[ReducedWindow]) -> BoolArray:
    """Return which parameters are supported, (p,) bool, one added after the other."""
    least = _least_t(len(windows))
    chosen = np.zeros(_P, dtype=bool)
    for _ in range(_P):
        now = _estimated(windows, chosen).left_out.sum()
        tried: dict[int, FloatArray] = {}
        for k in np.flatnonzero(~chosen).tolist():
            found = _estimated(windows, _with(chosen, k))
            x, sigma = found.of(k)
            if abs(x) > least * sigma and found.left_out.sum() < now:
                tried[k] = found.left_out
        if not tried:
            break
        chosen = _with(chosen, _first_of_the_best(tried))
        # Corrections that stood in for the new one are not needed any more
        found = _estimated(windows, chosen)
        still = np.abs(found.x) > least * found.sigma
        chosen[found.index[~still]] = False
    return chosen


def _first_of_the_best(left_out: Mapping[int, FloatArray]) -> int:
    """Return the first parameter whose misfit over windows left out is the least, or within its standard error of that.

    References
    ----------
    L. Breiman et al., "Classification and Regression Trees", 1984: the rule of one standard error.
    """
    best = min(left_out.values(), key=lambda misfit: float(misfit.sum()))
    for k, misfit in left_out.items():
        worse = misfit - best
        if worse.sum() <= np.sqrt(len(worse)) * worse.std(ddof=1):
            return k
    raise AssertionError("the best is as good as itself")


def _findings(windows: Sequence[ReducedWindow], chosen: BoolArray, x: FloatArray) -> tuple[Finding, ...]:
    least, now = _least_t(len(windows)), _estimated(windows, chosen)
    found = []
    for k, parameter in enumerate(PARAMETERS):
        other = _estimated(windows, _with(chosen, k))
        value, sigma = other.of(k)
        if chosen[k]:
            without = _estimated(windows, chosen & (np.arange(_P) != k))
            n = int((now.left_out < without.left_out).sum())
            reason = f"{abs(x[k]) / sigma:.0f} sigma; {n} of {len(windows)} windows left out improve"
            found.append(Finding(parameter, float(x[k]), sigma, is_supported=True, reason=reason))
            continue
        if sigma > _DETERMINED * parameter.prior:
            reason = f"not determined: needs {parameter.needs}"
        elif abs(value) <= least * sigma:
            reason = (
                f"the given value agrees: {abs(value) / sigma:.1f} sigma, at least {least:.1f} are needed"
            )
        else:
            reason = "windows left out do not improve"
        found.append(Finding(parameter, value, sigma, is_supported=False, reason=reason))
    return tuple(found)
