"""Times as a log has them: milliseconds and nanoseconds told from seconds, the end of the week passed over."""

from __future__ import annotations

import numpy as np

from linework.arrays import FloatArray
from linework.errors import InputError
from linework.files.survey_time import WEEK_S

#: Beyond this no second of any epoch lies (the year 5138 since 1970).
_MOST_SECONDS = 1e11
#: GPS receivers count weeks to 1024 and begin again.
_WEEKS_OF_RECEIVERS = 1024
#: Logs pause for less than a day around the end of a week.
_MOST_PAUSE_S = 86_400.0
#: A recording of a drive has a row at least every so many seconds, and lasts less than a day: whole numbers with
#: larger steps over more than that are no seconds.
_MOST_STEP_S = 5.0
_MOST_DRIVE_S = 86_400.0


def in_seconds(time: FloatArray, where: object = None) -> tuple[FloatArray, tuple[str, ...]]:
    """Return times of a log in seconds that run on over the end of a week, and what was odd.

    Parameters
    ----------
    time
        (n,) finite, in the order of the file.

    Raises
    ------
    InputError
        All times are the same (all zero, for one).

    Examples
    --------
    >>> in_seconds(np.array([604799.0, 604799.5, 0.0, 0.5]))[0].tolist()
    [604799.0, 604799.5, 604800.0, 604800.5]
    >>> in_seconds(np.array([1395837505119.25, 1395837505219.25]))[0].tolist()
    [1395837505.11925, 1395837505.21925]
    """
    if len(time) > 1 and time.min() == time.max():
        raise InputError(
            f"all {len(time)} times are {time[0]:g}", where=where, advice="a log without times cannot be used"
        )
    warnings = []
    unit, per_second = _unit(time)
    if per_second != 1.0:
        time = time / per_second
        warnings.append(f"times are in {unit}: taken as such")
    steps = np.diff(time)
    for n_weeks in (1, _WEEKS_OF_RECEIVERS):
        round_s = n_weeks * WEEK_S
        ends = np.flatnonzero((steps < -round_s + _MOST_PAUSE_S) & (steps > -round_s - _MOST_STEP_S))
        if len(ends):
            time = time + round_s * np.searchsorted(ends, np.arange(len(time)), side="left")
            what = "the GPS week ends" if n_weeks == 1 else "the count of GPS weeks begins again"
            warnings.append(f"{what} within the log, after {time[ends[0]]:.2f} s: times run on")
            steps = np.diff(time)
    return time, tuple(warnings)


def _unit(time: FloatArray) -> tuple[str, float]:
    """Return the unit of times and how many there are in a second."""
    units = (("milliseconds", 1e3), ("microseconds", 1e6), ("nanoseconds", 1e9))
    steps = np.abs(np.diff(time[:10_000]))
    step = float(np.median(steps)) if len(steps) else 0.0
    if float(np.abs(time).max(initial=0.0)) < _MOST_SECONDS:
        is_short = step < _MOST_STEP_S or float(np.ptp(time)) < _MOST_DRIVE_S
        if is_short or np.any(time[:10_000] % 1.0):
            return "seconds", 1.0
    # Steps of 5 ms to 5 s, in each unit
    return next((unit for unit in units if step < _MOST_STEP_S * unit[1]), units[-1])
