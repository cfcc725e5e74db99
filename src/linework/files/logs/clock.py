"""Time scales of a survey: GPS seconds (of the week, adjusted, since 1980) and Unix seconds."""

from __future__ import annotations

from typing import Final

import numpy as np

from linework.arrays import FloatArray, IntArray
from linework.errors import InputError
from linework.imaging.pairing import certain_times

WEEK_S: Final = 604_800.0
#: Adjusted standard GPS time (LAS 1.4) is GPS time less this. [s]
_ADJUSTED_S = 1e9
#: Start of GPS time, 1980-01-06, in seconds since 1970.
_GPS_BEGAN_S = 315_964_800.0
#: Days that follow a leap second since GPS time began (IERS Bulletin C); GPS - UTC is their number.
_LEAPS = (
    "1981-07-01", "1982-07-01", "1983-07-01", "1985-07-01", "1988-01-01", "1990-01-01", "1991-01-01",
    "1992-07-01", "1993-07-01", "1994-07-01", "1996-01-01", "1997-07-01", "1999-01-01", "2006-01-01",
    "2009-01-01", "2012-07-01", "2015-07-01", "2017-01-01",
)  # fmt: skip
_LEAP_UTC_S = np.array(_LEAPS, dtype="datetime64[s]").astype(np.float64)
#: Smaller times are not absolute: as seconds since 1970 the year 2001, as GPS seconds 2011. [s]
_LEAST_ABSOLUTE_S = 1e9
#: Larger times are seconds since 1970: the year 2020, as GPS seconds 2030. [s]
_LEAST_UNIX_S = 1.6e9
_DAY_S = 86_400.0
_SOME_WEEK = 2300
_NAMES = {
    "gps_week": "GPS seconds of the week", "gps_adjusted": "adjusted GPS seconds", "gps": "GPS seconds",
    "unix": "seconds since 1970", "utc_day": "seconds of the day, UTC",
}  # fmt: skip


def gps_of_unix(unix_s: FloatArray) -> FloatArray:
    """Convert UTC in seconds since 1970 to GPS seconds.

    >>> float(gps_of_unix(np.array(1.7e9))) - (1.7e9 - 315_964_800.0)
    18.0
    """
    leaps = np.searchsorted(_LEAP_UTC_S, unix_s, side="right")
    return np.asarray(unix_s - _GPS_BEGAN_S + leaps, dtype=np.float64)


def unix_of_gps(gps_s: FloatArray) -> FloatArray:
    """Convert GPS seconds to UTC in seconds since 1970.

    >>> float(unix_of_gps(gps_of_unix(np.array(1.7e9))))
    1700000000.0
    """
    leaps = np.searchsorted(_LEAP_UTC_S - _GPS_BEGAN_S + np.arange(1, len(_LEAPS) + 1), gps_s, side="right")
    return np.asarray(gps_s + _GPS_BEGAN_S - leaps, dtype=np.float64)


def epoch_by_values(time_s: FloatArray) -> str:
    """Return the epoch of times (n,) [s] by their range: "gps_week", "gps_adjusted", "gps" or "unix".

    >>> [epoch_by_values(np.array([t])) for t in (3e5, 4.5e8, 1.4e9, 1.7e9)]
    ['gps_week', 'gps_adjusted', 'gps', 'unix']
    """
    low, high = float(np.min(time_s)), float(np.max(time_s))
    # A drive over the end of a week may count beyond it
    if low >= 0.0 and high <= 2 * WEEK_S:
        return "gps_week"
    if high < _LEAST_ABSOLUTE_S:
        return "gps_adjusted"
    return "gps" if high < _LEAST_UNIX_S else "unix"


def to_survey_time(
    time_s: FloatArray,
    epoch: str,
    survey_epoch: str,
    *,
    week: int | None = None,
    near_s: float | None = None,
    where: object = None,
) -> FloatArray:
    """Convert times to the survey's epoch.

    Parameters
    ----------
    time_s
        (n,) [s].
    epoch, survey_epoch
        "gps_week", "gps_adjusted", "gps" or "unix"; `epoch` also "utc_day" (seconds of a day, UTC).
    week
        GPS week of seconds of the week, where known.
    near_s
        A time of the survey, in its epoch: an unknown week or day is the one that brings the times nearest to it.

    Raises
    ------
    InputError
        The week or the day of the times is unknown.

    Examples
    --------
    >>> float(to_survey_time(np.array([1.7e9]), "unix", "gps_adjusted")[0])
    384035218.0
    """
    time_s = np.asarray(time_s, dtype=np.float64)
    if epoch == survey_epoch or len(time_s) == 0:
        return time_s
    if near_s is None and (epoch == "utc_day" or (epoch == "gps_week" and week is None)):
        unknown, advice = _NAMES[epoch], "give [time] week" if epoch == "gps_week" else "log RMC or ZDA, too"
        raise InputError(
            f"times are {unknown}, but the {'week' if epoch == 'gps_week' else 'day'} is unknown",
            where=where,
            advice=advice,
        )
    if epoch == "utc_day":
        # Any recent week has today's leap seconds
        week = _SOME_WEEK if week is None and survey_epoch == "gps_week" else week
        near_unix = unix_of_gps(_to_gps(np.array([near_s]), survey_epoch, week))[0]
        time_s, epoch = time_s + _DAY_S * np.round((near_unix - time_s[0]) / _DAY_S), "unix"
    elif epoch == "gps_week" and week is None:
        near_gps = _to_gps(np.array([near_s]), survey_epoch, None)[0]
        week = round((near_gps - float(time_s[0])) / WEEK_S)
    gps = _to_gps(time_s, epoch, week)
    if survey_epoch == "gps_week":
        if week is None:
            weeks = gps[0] / WEEK_S
            week = int(np.floor(weeks) if near_s is None else np.round(weeks - near_s / WEEK_S))
        return gps - WEEK_S * week
    if survey_epoch == "unix":
        return unix_of_gps(gps)
    return gps - (_ADJUSTED_S if survey_epoch == "gps_adjusted" else 0.0)


def _to_gps(time_s: FloatArray, epoch: str, week: int | None) -> FloatArray:
    if epoch == "unix":
        return gps_of_unix(time_s)
    if epoch == "gps_week":
        return time_s + WEEK_S * (week or 0)
    return time_s + (_ADJUSTED_S if epoch == "gps_adjusted" else 0.0)


def fitted_times(
    time_s: FloatArray, epoch: str, span_s: tuple[float, float], span_epoch: str, *, week: int | None = None
) -> tuple[FloatArray, tuple[str, ...]]:
    """Convert times to the epoch of another recording of the same drive; return warnings about it.

    Times that already overlap the other recording are left unchanged, whatever epoch is stated.

    Parameters
    ----------
    epoch
        Epoch of the times; "": by their range.
    span_s, span_epoch
        First and last time of the other recording, and its epoch ("": by its range).
    week
        GPS week, where either is in seconds of the week.
    """
    if _overlap(time_s, span_s):
        return time_s, ()
    epoch = epoch or epoch_by_values(time_s)
    span_epoch = span_epoch or epoch_by_values(np.array(span_s))
    converted = to_survey_time(time_s, epoch, span_epoch, week=week, near_s=span_s[0])
    # Old receivers count weeks modulo 1024
    for n_rounds in (0, 1, 2):
        moved = converted + n_rounds * 1024 * WEEK_S
        if _overlap(moved, span_s):
            remarks = [f"converted to {_NAMES[span_epoch]}"] * (epoch != span_epoch)
            remarks += [f"{1024 * n_rounds} weeks added (week rollover of the receiver)"] * (n_rounds > 0)
            return moved, (f"times are {_NAMES[epoch]}: {', and '.join(remarks)}",)
    return time_s, ()


def _overlap(time_s: FloatArray, span_s: tuple[float, float]) -> bool:
    return len(time_s) > 0 and float(np.min(time_s)) <= span_s[1] and float(np.max(time_s)) >= span_s[0]


def known_offsets(time_s: float, epoch: str) -> list[tuple[float, str]]:
    """Return known offsets of a clock [s] from mistaken time scales, and their names.

    Parameters
    ----------
    time_s, epoch
        Approximate time, for the leap seconds of that day; today's where the epoch does not tell the day.

    >>> known_offsets(4.0e8, "gps_adjusted")[2]
    (-18.0, 'UTC taken for GPS time')
    """
    leaps = float(len(_LEAPS))
    if epoch in ("unix", "gps", "gps_adjusted"):
        unix_s = time_s if epoch == "unix" else float(unix_of_gps(_to_gps(np.array(time_s), epoch, None)))
        leaps = float(np.searchsorted(_LEAP_UTC_S, unix_s, side="right"))
    # TAI is ahead of GPS time by 19 s, and by the leap seconds since 1972 of UTC
    differences = [(1.0, "a leap second", "a leap second"), (leaps, "GPS time taken for UTC", "UTC taken for GPS time"),
                   (19.0, "TAI taken for GPS time", "GPS time taken for TAI"),
                   (leaps + 19.0, "TAI taken for UTC", "UTC taken for TAI")]  # fmt: skip
    return [
        (sign * size, names[sign < 0.0])
        for size, *names in sorted(differences)
        for sign in (-1.0, 1.0)
    ]  # fmt: skip


#: Larger times are not seconds in any epoch (the year 5138 since 1970).
_MOST_SECONDS = 1e11
#: GPS receivers count weeks modulo this number.
_WEEKS_OF_RECEIVERS = 1024
#: Longest pause of a log around the end of a week. [s]
_MOST_PAUSE_S = 86_400.0
#: Longest step and duration of a drive's log [s]: whole numbers with larger steps over more time are not seconds.
_MOST_STEP_S = 5.0
_MOST_DRIVE_S = 86_400.0


def in_seconds(time: FloatArray, where: object = None) -> tuple[FloatArray, tuple[str, ...]]:
    """Return the times of a log in seconds, continuous over the end of a week, and warnings.

    Parameters
    ----------
    time
        (n,) float64, finite, in the order of the file, in any unit.

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
        warnings.append(f"times are in {unit}: converted to seconds")
    steps = np.diff(time)
    for n_weeks in (1, _WEEKS_OF_RECEIVERS):
        round_s = n_weeks * WEEK_S
        ends = np.flatnonzero((steps < -round_s + _MOST_PAUSE_S) & (steps > -round_s - _MOST_STEP_S))
        if len(ends):
            time = time + round_s * np.searchsorted(ends, np.arange(len(time)), side="left")
            what = "the GPS week ends" if n_weeks == 1 else "the count of GPS weeks begins again"
            warnings.append(f"{what} within the log, after {time[ends[0]]:.2f} s: times continued")
            steps = np.diff(time)
    return time, tuple(warnings)


def _unit(time: FloatArray) -> tuple[str, float]:
    """Return the unit of times and the number of units per second."""
    units = (("milliseconds", 1e3), ("microseconds", 1e6), ("nanoseconds", 1e9))
    steps = np.abs(np.diff(time[:10_000]))
    step = float(np.median(steps)) if len(steps) else 0.0
    if float(np.abs(time).max(initial=0.0)) < _MOST_SECONDS:
        is_short = step < _MOST_STEP_S or float(np.ptp(time)) < _MOST_DRIVE_S
        if is_short or np.any(time[:10_000] % 1.0):
            return "seconds", 1.0
    # Steps of 5 ms to 5 s, in each unit
    return next((unit for unit in units if step < _MOST_STEP_S * unit[1]), units[-1])


#: Rows in doubt per backward step where two rows are swapped; a clock that was set back leaves more.
_ROWS_OF_A_SWAP = 2
#: Share of rows in doubt up to which a clock was set back; a log appended to itself leaves all in doubt.
_MOST_IN_DOUBT = 0.5


def in_time_order(
    time_s: FloatArray, line_numbers: FloatArray, *, unit: str = "line"
) -> tuple[IntArray, tuple[str, ...]]:
    """Return the rows to use, in strictly increasing time, and warnings.

    Rows are put in time order (stable); of rows with equal time the first is kept, the others are counted. Where
    the clock was set back, the same times occur twice: rows with these times are left out, because it is unknown
    which of the two passes they belong to.

    Parameters
    ----------
    time_s
        (n,) float64 [s], in the order of the file.
    line_numbers
        (n,) line of each row in the file.
    unit
        What `line_numbers` count.

    Examples
    --------
    >>> in_time_order(np.array([1.0, 3.0, 2.0, 3.0]), np.arange(2.0, 6.0))[0].tolist()
    [0, 2, 1]
    """
    if len(time_s) == 0:
        return np.zeros(0, np.int64), ()
    backward = np.flatnonzero(np.diff(time_s) < 0)
    if len(backward) == 0:
        rows, warnings = np.arange(len(time_s)), list[str]()
    else:
        first = f"at {unit} {int(line_numbers[backward[0] + 1])}"
        rows, warnings = _set_back(time_s, backward, first)
        rows = rows[np.argsort(time_s[rows], kind="stable")]
    kept = rows[np.concatenate([[True], np.diff(time_s[rows]) > 0])]
    if len(kept) < len(rows):
        warnings.append(f"{len(rows) - len(kept)} rows with a repeated time left out")
    return kept.astype(np.int64), tuple(warnings)


def _set_back(time_s: FloatArray, backward: IntArray, first: str) -> tuple[IntArray, list[str]]:
    """Return the rows whose time is certain (all, where rows are only out of order), and a warning.

    Parameters
    ----------
    backward
        Rows after which time runs backwards.
    first
        Place of the first of these in the file, for the warning.
    """
    is_new = np.diff(time_s, prepend=-np.inf) != 0.0
    in_doubt = is_new & ~certain_times(time_s)
    n = int(np.count_nonzero(in_doubt))
    if n <= _ROWS_OF_A_SWAP * len(backward) or n > _MOST_IN_DOUBT * len(time_s):
        return np.arange(len(time_s)), [f"time runs backwards {len(backward)} times, first {first}: sorted"]
    remarks = (
        f"the clock was set back {len(backward)} times, first after {time_s[backward[0]]:.3f} s by"
        f" {time_s[backward[0]] - time_s[backward[0] + 1]:.3f} s {first}: {n} rows whose time occurs twice left out"
    )
    return np.flatnonzero(~in_doubt), [remarks]
