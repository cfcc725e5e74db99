"""Missing dashes of a dashed line, from the rhythm of its other dashes or of its worn paint."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import gammainccinv

from linework.arrays import BoolArray, FloatArray, IntArray, distance_along
from linework.editing.edits.new_lines import foot_along
from linework.errors import UsageError
from linework.model.lines import LineSet

#: Tolerance of a whole dash's length, and of its place in the rhythm. [m]
WHOLE_DASH_M = 0.25
#: Fewest dashes that show a rhythm.
RHYTHM_DASHES = 4
#: Longest gap over which painters keep the phase. [m]
LONGEST_RHYTHM_GAP_M = 60.0


@dataclass(frozen=True, slots=True)
class DashRhythm:
    """Rhythm of the dashes along a line.

    Parameters
    ----------
    middle_m
        (k,) ascending: middles of the dashes that are there, along the line. [m]
    period_m, dash_m
        From middle to middle; length of one.
    """

    middle_m: FloatArray
    period_m: float
    dash_m: float


def with_missing_dashes(line: LineSet, dashes: LineSet) -> LineSet:
    """Return the missing dashes of a line.

    Parameters
    ----------
    line
        A single dashed line.
    dashes
        Those that are there.

    Returns
    -------
    LineSet
        New lines of kind "lane_marking_dash", all bridged: the rhythm says where they belong, nobody measured them.

    Raises
    ------
    UsageError
        There are too few to show a rhythm, or none is missing.
    """
    rhythm = rhythm_of(line, dashes)
    if rhythm is None:
        raise UsageError(
            f"{len(dashes)} dashes are too few or too irregular for a rhythm",
            where="dashes",
            advice="draw some of them first",
        )
    middles = missing_middles(rhythm, distance_along(line.xyz)[-1])
    if len(middles) == 0:
        raise UsageError("no dash is missing", where="dashes", advice="choose another line")
    return _dashes_at(line, dashes, middles[:, None] + np.array([-0.5, 0.5]) * rhythm.dash_m)


def dashes_by_paint(line: LineSet, dashes: LineSet, spans: FloatArray) -> tuple[LineSet, LineSet]:
    """Return the dashes of a line to delete and those to add, by the rhythm of the paint along it.

    Parameters
    ----------
    line
        A single line.
    dashes
        Those that are there.
    spans
        (k, 2) where along the line each begins and ends [m], as `dashes_in_paint` finds them.

    Notes
    -----
    A dash that is there and whole stays, also where it is longer than the paint's rhythm shows one, and one that somebody
    judged; pieces of a dash, and one that is several, give way to the whole of it. What comes is bridged: many dashes
    together say where it is, it was not seen itself.

    Raises
    ------
    UsageError
        None is missing.
    """
    comes, goes = missing_spans(line, dashes, spans)
    if not comes.any():
        raise UsageError("no dash is missing", where="dashes", advice="choose another line")
    return dashes.take(goes), _dashes_at(line, dashes, spans[comes])


def missing_spans(line: LineSet, dashes: LineSet, spans: FloatArray) -> tuple[BoolArray, BoolArray]:
    """Return which spans along a line (k,) need a new dash, and which dashes (n,) these replace."""
    there = _ends_along(line, dashes)
    lap = np.minimum(there[None, :, 1], spans[:, None, 1]) - np.maximum(there[None, :, 0], spans[:, None, 0])
    # The rhythm says where dashes are, and of worn paint too little of how long: a dash was measured at its ends
    length_m, is_one = np.diff(there, axis=1)[:, 0], np.count_nonzero(lap > 0.0, axis=0) <= 1
    too_long_m = length_m - np.diff(spans, axis=1)
    is_whole = (too_long_m >= -WHOLE_DASH_M) & (is_one | (too_long_m <= WHOLE_DASH_M))
    stays = is_whole | (dashes.review != "")
    comes = ~np.any((lap > 0.0) & stays, axis=1)
    return comes, np.any((lap > 0.0) & ~stays & comes[:, None], axis=0)


def rhythm_of(line: LineSet, dashes: LineSet) -> DashRhythm | None:
    """Return the rhythm of the dashes along a line, or None if they have none."""
    if len(dashes) < RHYTHM_DASHES:
        return None
    ends = _ends_along(line, dashes)
    length, middle = np.diff(ends, axis=1)[:, 0], ends.mean(axis=1)
    dash_m = float(np.quantile(length, 0.8))
    whole = np.sort(middle[np.abs(length - dash_m) <= WHOLE_DASH_M])
    apart = np.diff(whole)
    apart = apart[apart > dash_m]
    if len(apart) < RHYTHM_DASHES - 1:
        return None
    # The smallest common distance, then the mean over all distances that are multiples of it
    period_m = float(np.quantile(apart, 0.2))
    number = np.rint(apart / period_m)
    fits = (number <= 3) & (np.abs(apart - number * period_m) <= WHOLE_DASH_M * np.maximum(number, 1.0))
    if np.count_nonzero(fits) < RHYTHM_DASHES - 1 or 2 * np.count_nonzero(fits) < len(apart):
        return None
    period_m = float(np.sum(apart[fits]) / np.sum(number[fits]))
    return DashRhythm(np.sort(middle), period_m, dash_m) if period_m > dash_m + WHOLE_DASH_M else None


def missing_middles(rhythm: DashRhythm, length_m: float) -> FloatArray:
    """Return the middles of the missing dashes along a line [m].

    Between two that are there, a whole number of periods apart, and beyond the first and the last, as far as the
    line goes. Where the phase does not fit (a crossing, another pattern) nothing is missing.
    """
    middle, period = rhythm.middle_m, rhythm.period_m
    found: list[float] = []
    for a, b in zip(middle[:-1].tolist(), middle[1:].tolist(), strict=True):
        n = round((b - a) / period)
        if n >= 2 and b - a <= LONGEST_RHYTHM_GAP_M and abs(b - a - n * period) <= 2.0 * WHOLE_DASH_M:
            found += [a + k * (b - a) / n for k in range(1, n)]
    for start, way in ((float(middle[0]), -1.0), (float(middle[-1]), 1.0)):
        at = start + way * period
        while 0.5 * rhythm.dash_m - WHOLE_DASH_M <= at <= length_m - 0.5 * rhythm.dash_m + WHOLE_DASH_M:
            if abs(at - start) > LONGEST_RHYTHM_GAP_M:
                break
            found.append(at)
            at += way * period
    return np.sort(np.array(found, dtype=np.float64))


def _dashes_at(line: LineSet, dashes: LineSet, spans: FloatArray) -> LineSet:
    along = distance_along(line.xyz)
    span = np.clip(spans, 0.0, along[-1])
    xyz = np.stack([np.interp(span, along, column) for column in line.xyz.T], axis=-1)
    n = len(spans)
    return LineSet.from_lines(
        list(xyz),
        crs=line.crs,
        kind=np.full(n, "lane_marking_dash"),
        role=np.full(n, line.role[0]),
        pattern=np.full(n, "dashed"),
        method=np.full(n, "drawn"),
        width_m=np.full(n, float(np.median(dashes.width_m if len(dashes) else line.width_m))),
        bridged=np.ones(2 * n, dtype=np.bool_),
        sigma_xy_m=np.interp(span, along, line.sigma_xy_m).ravel(),
        sigma_z_m=np.interp(span, along, line.sigma_z_m).ravel(),
    )


def _ends_along(line: LineSet, dashes: LineSet) -> FloatArray:
    """Return the start and end of each dash along the line (k, 2) [m]."""
    along = distance_along(line.xyz)
    ends = [[foot_along(line.xyz, along, dashes[i].xyz[k]) for k in (0, -1)] for i in range(len(dashes))]
    return np.sort(np.array(ends, dtype=np.float64).reshape(-1, 2), axis=1)


# The rhythm of worn paint: dashes too faint to be detected one by one, estimated together along their line

#: Range of periods of dashed lines: from short dashes 1 m apart to 6 m of paint in 18 m. [m]
SHORTEST_PERIOD_M, LONGEST_PERIOD_M = 2.0, 18.0
#: Length of the window in which the phase is estimated, and its step. A line beside the axis of a bend is longer
#: or shorter by its offset over the radius: the windows follow that. [m]
RHYTHM_WINDOW_M, HOP_M = 40.0, 8.0
_STRETCH = 0.08
#: Least power over that of the noise: chance reaches it with exp(-12) among hundreds of periods.
LEAST_POWER = 12.0
#: Least share of the windows that must show the rhythm.
LEAST_WINDOW_SHARE = 0.25
_N_PERIODS, _N_NEAR, _N_PHASES = 600, 33, 48


def dashes_in_paint(step_m: float, brightness: FloatArray, weight: FloatArray) -> FloatArray:
    """Return the start and end of each dash along a line, by the rhythm of the paint.

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
    most dashes are not. Windows without it are passed over where it goes on within `LONGEST_RHYTHM_GAP_M`.
    """
    starts = np.arange(0.0, max(len(brightness) * step_m - RHYTHM_WINDOW_M, 0.0) + 1e-9, HOP_M)
    n = min(round(RHYTHM_WINDOW_M / step_m), len(brightness))
    first = np.rint(starts / step_m).astype(np.int64)
    index = first[:, None] + np.arange(n)
    b, w = brightness[index], weight[index]
    mean = np.sum(b * w, axis=1) / np.maximum(w.sum(axis=1), 1e-9)
    wave = np.where(w > 0.0, w * (b - mean[:, None]), 0.0)
    at = (np.arange(n) - 0.5 * (n - 1)) * step_m
    noise = np.maximum(np.sum(wave**2, axis=1), 1e-12)
    rates = np.linspace(1.0 / LONGEST_PERIOD_M, 1.0 / SHORTEST_PERIOD_M, _N_PERIODS)
    power = np.abs(wave @ np.exp(-2j * np.pi * np.outer(at, rates))) ** 2 / noise[:, None]
    best_rate = _rhythm_rate(rates, np.sum(power, axis=0), len(brightness) * step_m)
    if best_rate is None:
        return np.zeros((0, 2))
    rate = best_rate
    near = rate * np.linspace(1.0 - _STRETCH, 1.0 + _STRETCH, _N_NEAR)
    spectrum = wave @ np.exp(-2j * np.pi * np.outer(at, near))
    best = np.argmax(np.abs(spectrum), axis=1)
    rows = np.arange(len(starts))
    shows = np.abs(spectrum[rows, best]) ** 2 / noise >= LEAST_POWER
    # Two windows determine the rate between them
    if np.count_nonzero(shows) < max(LEAST_WINDOW_SHARE * len(starts), 2.0):
        return np.zeros((0, 2))
    middle = (first + 0.5 * (n - 1)) * step_m
    # Cycles since a crest, at the middle of each window that shows the rhythm
    cycles = _unwrapped(
        middle[shows], near[best[shows]], -np.angle(spectrum[rows, best])[shows] / (2 * np.pi)
    )
    return _spans(step_m, brightness, weight, (middle[shows], _smoothed(middle[shows], cycles)))


def _rhythm_rate(rates: FloatArray, power: FloatArray, length_m: float) -> float | None:
    """Return the rate [1/m] of the summed power (k,) of all windows that stands out of its surroundings, or None.

    Paint wears off in patches: its noise is strong at all long periods, where a rhythm is a peak. The noise at a rate is
    what the rates beside it show, more than a window resolves away: on the stronger side, because it falls with the rate.
    The half, double and triple rate are left out: a rhythm of short dashes is strong there, too.
    Sums of exponential powers are gamma distributed, with as many degrees as the line has windows.
    """
    k = int(np.argmax(power))
    apart = np.abs(rates - rates[k]) * RHYTHM_WINDOW_M
    beside = (apart >= 1.0) & (apart <= 3.0)
    for harmonic in (0.5, 2.0, 3.0):
        beside &= np.abs(rates - harmonic * rates[k]) * RHYTHM_WINDOW_M >= 1.0
    sides = [power[beside & (rates < rates[k])], power[beside & (rates > rates[k])]]
    around = max((float(side.mean()) for side in sides if len(side)), default=0.0)
    n_windows = max(length_m / RHYTHM_WINDOW_M, 1.0)
    most = float(gammainccinv(n_windows, np.exp(-LEAST_POWER))) / n_windows
    return float(rates[k]) if power[k] > most * around else None


def _unwrapped(middle: FloatArray, rate: FloatArray, cycles: FloatArray) -> FloatArray:
    """Return cycles counted on along the line (unwrapped), guided by the rates of the windows."""
    out = -cycles
    for i in range(1, len(out)):
        expected = out[i - 1] + 0.5 * (rate[i] + rate[i - 1]) * (middle[i] - middle[i - 1])
        out[i] += np.rint(expected - out[i])
    return out


def _smoothed(middle: FloatArray, cycles: FloatArray) -> FloatArray:
    """Return cycles smoothed by local straight-line fits: worn-off paint shifts single crests."""
    out = cycles.copy()
    for i, place in enumerate(middle):
        away = middle - place
        near = np.flatnonzero(np.abs(away) <= RHYTHM_WINDOW_M)
        if len(near) > 2:
            out[i] = np.polyfit(
                away[near], cycles[near], 1, w=1.0 - np.abs(away[near]) / (RHYTHM_WINDOW_M + HOP_M)
            )[1]
    return out


def _spans(
    step_m: float, brightness: FloatArray, weight: FloatArray, known: tuple[FloatArray, FloatArray]
) -> FloatArray:
    """Return the dashes of a rhythm whose cycles are given at some places along the line."""
    middle, cycles = known
    station: FloatArray = (np.arange(len(brightness), dtype=np.float64) + 0.5) * step_m
    cycle = _cycles_at(station, middle, cycles)
    away = np.abs(station - middle[_nearest(middle, station)])
    inside = away <= 0.5 * max(LONGEST_RHYTHM_GAP_M, RHYTHM_WINDOW_M)
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
    """Return the index of the value nearest to each of others."""
    halfway = 0.5 * (ascending[1:] + ascending[:-1])
    return np.searchsorted(halfway, values)


def _cycles_at(station: FloatArray, middle: FloatArray, cycles: FloatArray) -> FloatArray:
    """Return the cycles along the line, extrapolated beyond the outer windows at their rates."""
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
    """Return the start and end of the bright part of a period, in cycles around 0."""
    n = len(bright)
    around = np.roll(bright, n // 2)
    runs = np.flatnonzero(np.diff(np.concatenate([[0], around.astype(np.int8), [0]]))).reshape(-1, 2)
    low, high = max(runs.tolist(), key=lambda run: run[1] - run[0], default=[n // 2, n // 2 + 1])
    return low / n - 0.5, high / n - 0.5
