"""Check of clocks, signs and units: dead reckoning against the fixes, window by window.

Separate from `locate`, which cuts a drive into sections: this decides where the clock of one section jumps, and corrects
it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from linework.arrays import AnyArray, FloatArray
from linework.model.logs import GnssLog
from linework.navigation.dead_reckoning import DeadReckoning, Motion, reckon

#: Length of a window: dead reckoning keeps its shape over it, also with a poor gyro. [s]
_WINDOW_S = 60.0
#: Tried offsets: GPS time is 18 s ahead of UTC, TAI 19 s ahead of GPS and 37 s ahead of UTC. [s]
_LAGS_S = np.arange(-160, 161) * 0.25
#: Known offsets. [s]
_NAMED_S = {
    18.0: "GPS time against UTC", 19.0: "TAI against GPS time", 37.0: "TAI against UTC", 1.0: "one second"
}  # fmt: skip
#: Least offset of clocks; smaller ones are delays, which the filter estimates. [s]
_LEAST_LAG_S = 0.5
#: Factors of gyros that are read by mistake with the wrong sign or unit.
_GYRO_FACTORS = {
    1.0: "", -1.0: "with the wrong sign", 180.0 / np.pi: "in radians instead of degrees",
    np.pi / 180.0: "in degrees instead of radians",
    -180.0 / np.pi: "with the wrong sign, and in radians instead of degrees",
    -np.pi / 180.0: "with the wrong sign, and in degrees instead of radians",
}  # fmt: skip
#: Fixes that a window counts as, at most: errors of fixes near in time are correlated.
_FIXES_OF_WINDOW = 20
#: Residual where there is nothing to compare. [m]
_NOTHING_M = 1e6
#: Logarithm of the likelihood ratio from which a correction is accepted.
_EVIDENCE = 12.0


@dataclass(frozen=True, slots=True)
class CheckedMotion:
    """Stretches of one clock each, and the motion with signs and units corrected.

    Parameters
    ----------
    stretches
        Fixes (slice) of each, and the offset of their time stamps, later than gyro and wheels. [s]
    gyro_factor, way_factor
        Factors that readings were multiplied by.
    """

    motion: Motion
    stretches: tuple[tuple[slice, float], ...]
    gyro_factor: float
    way_factor: float
    warnings: tuple[str, ...]


def checked_against_fixes(motion: Motion, gnss: GnssLog) -> CheckedMotion:
    """Compare dead reckoning with the fixes, and correct differences of a clock, a sign or a unit."""
    windows = _windows(gnss)
    factor, evidence, residual = 1.0, *_evidence(motion, gnss, windows)
    if len(windows) and not _is_explained(residual, evidence):
        tried = {f: _evidence(_turned(motion, f), gnss, windows) for f in _GYRO_FACTORS}
        # The sign and unit with the least residuals, whatever the clock
        left = {f: np.sum(np.log(np.min(r, axis=1))) for f, (_, r) in tried.items()}
        best = min(left, key=lambda f: left[f])
        if left[1.0] - left[best] > _EVIDENCE / _FIXES_OF_WINDOW:
            factor, (evidence, residual) = best, tried[best]
    warnings = []
    if factor != 1.0:
        motion = _turned(motion, factor)
        warnings.append(
            f"gyro: against GNSS it turns {_GYRO_FACTORS[factor]}: readings multiplied by {factor:.4g}"
        )
    cuts = _cuts(evidence)
    lags = [_lag(evidence[a:b]) for a, b in pairwise(cuts)]
    bounds = [_bound(motion, gnss, windows, c, lags[i : i + 2]) for i, c in enumerate(cuts[1:-1])]
    firsts = [0, *bounds, len(gnss.time_s)]
    stretches = []
    for i, lag in enumerate(lags):
        part = slice(firsts[i], firsts[i + 1])
        exact = lag if abs(lag) < _LEAST_LAG_S else _refined(motion, gnss, part, lag)
        stretches.append((part, exact))
    warnings += _said(gnss, stretches)
    motion, way_factor, said = _scaled(motion, gnss, windows)
    return CheckedMotion(motion, tuple(stretches), factor, way_factor, (*warnings, *said))


def _turned(motion: Motion, factor: float) -> Motion:
    """Return the motion with turn rates multiplied by a factor."""
    return replace(motion, turn_radps=motion.turn_radps * factor)


def _windows(gnss: GnssLog) -> list[AnyArray]:
    """Return the fixes (about one a second) of each minute with at least ten."""
    t = gnss.time_s
    if len(t) < 10:
        return []
    picked = np.unique(np.searchsorted(t, np.arange(t[0], t[-1], 1.0)))
    number = ((t[picked] - t[0]) // _WINDOW_S).astype(np.int64)
    return [w for n in np.unique(number) if len(w := picked[number == n]) >= 10]


def _evidence(motion: Motion, gnss: GnssLog, windows: list[AnyArray]) -> tuple[FloatArray, FloatArray]:
    """Return log-likelihood ratio against no lag, and residual [m], (windows, lags) each."""
    reckoned = reckon(motion, np.zeros(0))
    residual = np.stack([_residuals(reckoned, gnss, w, _LAGS_S) for w in windows] or [np.ones(len(_LAGS_S))])
    none = residual[:, len(_LAGS_S) // 2, None]
    n = np.array([min(len(w), _FIXES_OF_WINDOW) for w in windows] or [0])
    return n[:, None] * np.log(none / residual), residual


def _residuals(reckoned: DeadReckoning, gnss: GnssLog, window: AnyArray, lags_s: AnyArray) -> FloatArray:
    """Return the median residual of the fixes of a window from dead reckoning at each lag, (lags,) [m].

    ``fix = a + b way + c (way bent by a gyro's bias)`` with complex a, b, c, by least squares, reweighted three times.
    """
    t, fix = gnss.time_s[window], gnss.xyz[window, :2] @ np.array([1.0, 1.0j])
    at = t[None, :] - lags_s[:, None]
    inside = (at >= reckoned.time_s[0]) & (at <= reckoned.time_s[-1])
    way = np.interp(at, reckoned.time_s, reckoned.xy[:, 0]) + 1.0j * np.interp(
        at, reckoned.time_s, reckoned.xy[:, 1]
    )
    way = way - way[:, :1]
    since = at - at[:, :1]
    step = np.diff(way, axis=1, prepend=way[:, :1])
    bent = np.cumsum(step * since, axis=1) / _WINDOW_S
    size = max(float(np.abs(way).max()), 1.0)
    columns = np.stack([np.ones_like(way), way / size, bent / size], axis=2)
    weight = inside.astype(np.float64)
    for _ in range(4):
        weighted = columns.conj() * weight[:, :, None]
        normal = np.einsum("lni,lnj->lij", weighted, columns) + 1e-9 * np.eye(3)
        right = np.einsum("lni,n->li", weighted, fix - fix[0])
        solved = np.linalg.solve(normal, right[:, :, None])
        left = np.abs(fix - fix[0] - (columns @ solved)[:, :, 0])
        level = np.median(left, axis=1, keepdims=True) + 1e-3
        weight = inside / (1.0 + (left / (2.0 * level)) ** 2)
    # Neither a fit to noise nor one to half a window is evidence about clocks
    floor = float(np.median(gnss.sigma_m[window, :2]))
    found = np.maximum(np.median(left, axis=1), floor)
    return np.where(inside.mean(axis=1) > 0.9, found, _NOTHING_M)


def _is_explained(residual: FloatArray, evidence: FloatArray) -> bool:
    """Return whether, with the best common lag, the residuals of most windows are those of a valid gyro: 2 m."""
    best = int(np.argmax(evidence.sum(axis=0)))
    return bool(np.mean(residual[:, best] < 2.0 + 3.0 * np.min(residual)) > 0.7)


def _lag(evidence: FloatArray) -> float:
    """Return the lag of windows of one clock [s]; 0 where none is clearly better."""
    total = evidence.sum(axis=0)
    best = int(np.argmax(total))
    return float(_LAGS_S[best]) if total[best] > _EVIDENCE and abs(_LAGS_S[best]) >= _LEAST_LAG_S else 0.0


def _cuts(evidence: FloatArray) -> list[int]:
    """Return the windows at which the clock jumps, with 0 and the end, by repeated bisection while it pays."""
    n = len(evidence)
    whole = evidence.sum(axis=0).max()
    best, at = -np.inf, 0
    for k in range(1, n):
        both = evidence[:k].sum(axis=0).max() + evidence[k:].sum(axis=0).max()
        if both > best and abs(_lag(evidence[:k]) - _lag(evidence[k:])) >= _LEAST_LAG_S:
            best, at = both, k
    if best - whole <= _EVIDENCE:
        return [0, n]
    return _cuts(evidence[:at])[:-1] + [at + c for c in _cuts(evidence[at:])]


def _bound(motion: Motion, gnss: GnssLog, windows: list[AnyArray], cut: int, lags: list[float]) -> int:
    """Return the first fix after a jump: where both clocks together leave least."""
    near = np.concatenate(windows[max(cut - 2, 0) : cut + 2])
    reckoned = reckon(motion, np.zeros(0))

    def left(k: int) -> float:
        parts = (near[:k], lags[0]), (near[k:], lags[1])
        found = [len(p) * np.log(_residuals(reckoned, gnss, p, np.array([lag]))[0]) for p, lag in parts]
        return float(np.sum(found))

    # Stamps that jump leave a gap as long as the jump: it is there, if there is one
    dt = np.diff(gnss.time_s)
    odd = np.abs(dt - np.median(dt) - (lags[1] - lags[0])) < 0.3 * abs(lags[1] - lags[0])
    gaps = np.flatnonzero(odd) + 1
    gaps = gaps[(gaps > near[3]) & (gaps < near[-4])]
    if len(gaps):
        return int(min(gaps, key=lambda g: left(int(np.searchsorted(near, g)))))
    return int(near[min(range(4, len(near) - 4), key=left)])


def _refined(motion: Motion, gnss: GnssLog, part: slice, lag: float) -> float:
    """Return the lag to a fiftieth of a second."""
    fixes = GnssLog(gnss.time_s[part], gnss.xyz[part], gnss.sigma_m[part])
    windows, reckoned = _windows(fixes), reckon(motion, np.zeros(0))
    lags = lag + np.arange(-15, 16) * 0.02
    if not windows:
        return lag
    total = np.sum([np.log(_residuals(reckoned, fixes, w, lags)) for w in windows], axis=0)
    best = float(lags[int(np.argmin(total))])
    # A clock is off by whole seconds; the rest is a delay, which the filter estimates
    return float(round(best)) if abs(best - round(best)) <= 0.3 else best


def _said(gnss: GnssLog, stretches: list[tuple[slice, float]]) -> list[str]:
    warnings = []
    for i, (part, lag) in enumerate(stretches):
        named = _NAMED_S.get(round(abs(lag), 2), "")
        which = f"{abs(lag):.2f} s{f' ({named})' if named else ''}"
        later = f"{which} {'later' if lag > 0 else 'earlier'} than those of gyro and wheels"
        if i > 0:
            jump = lag - stretches[i - 1][1]
            warnings.append(
                f"clock jumps by {jump:+.2f} s at {gnss.time_s[part.start]:.2f} s: split there"
                + (f"; from there on GNSS stamps are {later}: taken into account" if lag else "")
            )
        elif lag:
            warnings.append(f"GNSS stamps are {later}: taken into account, times are those of GNSS")
    return warnings


def _scaled(motion: Motion, gnss: GnssLog, windows: list[AnyArray]) -> tuple[Motion, float, list[str]]:
    """Correct a wrong tick or unit of speed, where distances differ by more than wheels do."""
    reckoned = reckon(motion, np.zeros(0))
    ratios = []
    for w in windows:
        inside = w[(gnss.time_s[w] >= reckoned.time_s[0]) & (gnss.time_s[w] <= reckoned.time_s[-1])]
        fixes = gnss.xyz[inside, :2]
        way = reckoned.at(gnss.time_s[inside]).xy
        # Over 5 s the shape of the path does not matter
        far, told = (np.hypot(*(v[5:] - v[:-5]).T) if len(v) > 5 else np.zeros(0) for v in (fixes, way))
        moved = told > 5.0 * np.median(gnss.sigma_m) + 2.0
        ratios.append(far[moved] / told[moved])
    ratio = np.concatenate(ratios) if ratios else np.zeros(0)
    factor = float(np.median(ratio)) if len(ratio) >= 10 else 1.0
    # Worn and soft tyres change a wheel by 2 %
    if abs(factor - 1.0) < 0.05 or not motion.has_ways:
        return motion, 1.0, []
    unit = {3.6: " (m/s instead of km/h?)", 1.0 / 3.6: " (km/h instead of m/s?)"}
    hint = next((text for f, text in unit.items() if abs(factor / f - 1.0) < 0.05), "")
    said = f"wheels: the distance by GNSS is {factor:.3f} times theirs{hint}: taken into account"
    return replace(motion, way_m=motion.way_m * factor, tick_m=motion.tick_m * factor), factor, [said]
