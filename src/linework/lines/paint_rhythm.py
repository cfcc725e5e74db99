"""The rhythm of worn paint: dashes that are too faint to be found one by one, seen together along their line."""

from __future__ import annotations

import numpy as np

from linework.arrays import BoolArray, FloatArray, IntArray
from linework.lines.edited_dashes import LONGEST_GAP_M

#: Dashed lines repeat within this: short dashes 1 m apart, to 6 m of paint on 12 m. [m]
SHORTEST_M, LONGEST_M = 2.0, 18.0
#: The phase is told from so much of the line at once, every so far. A line beside a bend's axis stretches by its
#: distance over the radius: that is followed from window to window. [m]
WINDOW_M, HOP_M = 40.0, 8.0
_STRETCH = 0.08
#: So much stronger than noise of the same spread is no chance among the hundreds of periods that are tried (exp(-12)).
LEAST_POWER = 12.0
#: Of a line's windows so many have to show it.
LEAST_SHARE = 0.25
_N_PERIODS, _N_NEAR, _N_PHASES = 600, 33, 48


def dashes_in_paint(step_m: float, brightness: FloatArray, weight: FloatArray) -> FloatArray:
    """Return where along a line its dashes begin and end, by the rhythm of the paint.

    Parameters
    ----------
    step_m
        Of the stations along the line.
    brightness, weight
        (n,) mean brightness of the points at each station, and how many they are; weight 0: none.

    Returns
    -------
    (k, 2)
        Along the line [m]; none where no rhythm is seen.

    Notes
    -----
    Period by the power spectra of windows, summed; phase by each window's own, followed along the line; length of a
    dash by all periods folded into one. What is worn off of one dash is there of the others: the rhythm is seen where
    most dashes are not. Windows without it are passed over where it goes on within `LONGEST_GAP_M`.
    """
    starts = np.arange(0.0, max(len(brightness) * step_m - WINDOW_M, 0.0) + 1e-9, HOP_M)
    n = min(round(WINDOW_M / step_m), len(brightness))
    first = np.rint(starts / step_m).astype(np.int64)
    index = first[:, None] + np.arange(n)
    b, w = brightness[index], weight[index]
    mean = np.sum(b * w, axis=1) / np.maximum(w.sum(axis=1), 1e-9)
    wave = np.where(w > 0.0, w * (b - mean[:, None]), 0.0)
    noise = np.maximum(np.sum(wave**2, axis=1), 1e-12)
    at = (np.arange(n) - 0.5 * (n - 1)) * step_m
    rates = 1.0 / np.geomspace(SHORTEST_M, LONGEST_M, _N_PERIODS)
    power = np.abs(wave @ np.exp(-2j * np.pi * np.outer(at, rates))) ** 2 / noise[:, None]
    rate = float(rates[int(np.argmax(np.sum(power, axis=0)))])
    near = rate * np.linspace(1.0 - _STRETCH, 1.0 + _STRETCH, _N_NEAR)
    spectrum = wave @ np.exp(-2j * np.pi * np.outer(at, near))
    best = np.argmax(np.abs(spectrum), axis=1)
    rows = np.arange(len(starts))
    shows = np.abs(spectrum[rows, best]) ** 2 / noise >= LEAST_POWER
    # Two windows know the rate between them
    if np.count_nonzero(shows) < max(LEAST_SHARE * len(starts), 2.0):
        return np.zeros((0, 2))
    middle = (first + 0.5 * (n - 1)) * step_m
    # Cycles since a crest, at the middle of each window that shows it
    cycles = _unwrapped(
        middle[shows], near[best[shows]], -np.angle(spectrum[rows, best])[shows] / (2 * np.pi)
    )
    return _spans(step_m, brightness, weight, (middle[shows], _smoothed(middle[shows], cycles)))


def _unwrapped(middle: FloatArray, rate: FloatArray, cycles: FloatArray) -> FloatArray:
    """Return cycles that count up along the line: between windows as many as their rates say, nearly."""
    out = -cycles
    for i in range(1, len(out)):
        expected = out[i - 1] + 0.5 * (rate[i] + rate[i - 1]) * (middle[i] - middle[i - 1])
        out[i] += np.rint(expected - out[i])
    return out


def _smoothed(middle: FloatArray, cycles: FloatArray) -> FloatArray:
    """Return cycles by straight lines through those of the windows about each: what is worn off shifts a crest."""
    out = cycles.copy()
    for i, place in enumerate(middle):
        away = middle - place
        near = np.flatnonzero(np.abs(away) <= WINDOW_M)
        if len(near) > 2:
            out[i] = np.polyfit(away[near], cycles[near], 1, w=1.0 - np.abs(away[near]) / (WINDOW_M + HOP_M))[
                1
            ]
    return out


def _spans(
    step_m: float, brightness: FloatArray, weight: FloatArray, known: tuple[FloatArray, FloatArray]
) -> FloatArray:
    """Return the dashes of a rhythm whose cycles are known at some places along the line."""
    middle, cycles = known
    station: FloatArray = (np.arange(len(brightness), dtype=np.float64) + 0.5) * step_m
    cycle = _cycles_at(station, middle, cycles)
    away = np.abs(station - middle[_nearest(middle, station)])
    inside = away <= 0.5 * max(LONGEST_GAP_M, WINDOW_M)
    shape = _folded(cycle[inside], brightness[inside], weight[inside])
    half = 0.5 * (np.quantile(shape, 0.1) + np.quantile(shape, 0.9))
    low, high = _crest(shape > half)
    turns = np.arange(np.floor(cycle[0]) - 1, np.ceil(cycle[-1]) + 2)
    spans = np.stack(
        [np.interp(turns + edge, cycle, station, left=np.nan, right=np.nan) for edge in (low, high)], axis=1
    )
    spans = spans[np.isfinite(spans).all(axis=1)]
    within: FloatArray = spans[np.interp(spans.mean(axis=1), station, inside.astype(np.float64)) > 0.5]
    return within


def _nearest(ascending: FloatArray, values: FloatArray) -> IntArray:
    """Return which of some values is nearest to each of others."""
    halfway = 0.5 * (ascending[1:] + ascending[:-1])
    return np.searchsorted(halfway, values)


def _cycles_at(station: FloatArray, middle: FloatArray, cycles: FloatArray) -> FloatArray:
    """Return the cycles along the line; beyond the first and the last window at the rate of those nearest."""
    k = min(4, len(middle) - 1)
    rate = (
        (cycles[k] - cycles[0]) / (middle[k] - middle[0]),
        (cycles[-1] - cycles[-1 - k]) / (middle[-1] - middle[-1 - k]),
    )
    inner = np.interp(station, middle, cycles)
    before, behind = np.minimum(station - middle[0], 0.0), np.maximum(station - middle[-1], 0.0)
    out: FloatArray = inner + before * rate[0] + behind * rate[1]
    return out


def _folded(cycle: FloatArray, brightness: FloatArray, weight: FloatArray) -> FloatArray:
    """Return the mean brightness over one period."""
    phase = np.floor((cycle % 1.0) * _N_PHASES).astype(np.int64) % _N_PHASES
    some = np.nan_to_num(brightness) * weight
    count = np.bincount(phase, weights=weight, minlength=_N_PHASES)
    return np.asarray(np.bincount(phase, weights=some, minlength=_N_PHASES) / np.maximum(count, 1e-9))


def _crest(bright: BoolArray) -> tuple[float, float]:
    """Return where the bright part of a period begins and ends, in cycles: it lies about 0."""
    n = len(bright)
    around = np.roll(bright, n // 2)
    runs = np.flatnonzero(np.diff(np.concatenate([[0], around.astype(np.int8), [0]]))).reshape(-1, 2)
    low, high = max(runs.tolist(), key=lambda run: run[1] - run[0], default=[n // 2, n // 2 + 1])
    return low / n - 0.5, high / n - 0.5
