"""One clock for a survey: GPS seconds of the week, adjusted or since 1980, and seconds since 1970."""

from __future__ import annotations

from typing import Final

import numpy as np

from linework.arrays import FloatArray
from linework.errors import InputError

WEEK_S: Final = 604_800.0
#: Adjusted standard GPS time (LAS 1.4) is GPS time less this.
_ADJUSTED_S = 1e9
#: 1980-01-06, where GPS time begins, in seconds since 1970.
_GPS_BEGAN_S = 315_964_800.0
#: Days on which a leap second had just been put in since GPS time began (IERS Bulletin C): GPS - UTC is their number.
_LEAPS = (
    "1981-07-01", "1982-07-01", "1983-07-01", "1985-07-01", "1988-01-01", "1990-01-01", "1991-01-01",
    "1992-07-01", "1993-07-01", "1994-07-01", "1996-01-01", "1997-07-01", "1999-01-01", "2006-01-01",
    "2009-01-01", "2012-07-01", "2015-07-01", "2017-01-01",
)  # fmt: skip
_LEAP_UTC_S = np.array(_LEAPS, dtype="datetime64[s]").astype(np.float64)
#: Seconds since 1970 until 2001, GPS seconds until 2011: earlier drives are none of these.
_LEAST_ABSOLUTE_S = 1e9
#: As seconds since 1970 the year 2020, as GPS seconds 2030: larger numbers are the former.
_LEAST_UNIX_S = 1.6e9
_DAY_S = 86_400.0
_SOME_WEEK = 2300
_NAMES = {
    "gps_week": "GPS seconds of the week", "gps_adjusted": "adjusted GPS seconds", "gps": "GPS seconds",
    "unix": "seconds since 1970", "utc_day": "seconds of the day, UTC",
}  # fmt: skip


def gps_of_unix(unix_s: FloatArray) -> FloatArray:
    """Return GPS seconds of UTC, given as seconds since 1970.

    >>> float(gps_of_unix(np.array(1.7e9))) - (1.7e9 - 315_964_800.0)
    18.0
    """
    leaps = np.searchsorted(_LEAP_UTC_S, unix_s, side="right")
    return np.asarray(unix_s - _GPS_BEGAN_S + leaps, dtype=np.float64)


def unix_of_gps(gps_s: FloatArray) -> FloatArray:
    """Return UTC as seconds since 1970 of GPS seconds.

    >>> float(unix_of_gps(gps_of_unix(np.array(1.7e9))))
    1700000000.0
    """
    leaps = np.searchsorted(_LEAP_UTC_S - _GPS_BEGAN_S + np.arange(1, len(_LEAPS) + 1), gps_s, side="right")
    return np.asarray(gps_s + _GPS_BEGAN_S - leaps, dtype=np.float64)


def epoch_by_values(time_s: FloatArray) -> str:
    """Return which epoch times have by their range: "gps_week", "gps_adjusted", "gps" or "unix".

    >>> [epoch_by_values(np.array([t])) for t in (3e5, 4.5e8, 1.4e9, 1.7e9)]
    ['gps_week', 'gps_adjusted', 'gps', 'unix']
    """
    low, high = float(np.min(time_s)), float(np.max(time_s))
    # A drive over the end of a week may run on
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
    """Return times in the survey's epoch.

    Parameters
    ----------
    time_s
        (n,) [s].
    epoch, survey_epoch
        "gps_week", "gps_adjusted", "gps" or "unix": of the times, and of the survey; times also "utc_day".
    week
        GPS week of seconds of the week, where known.
    near_s
        A time of the survey, in its epoch: without `week`, or of a day, the times are of the week or the day that
        brings them nearest.

    Raises
    ------
    InputError
        Seconds of the week or the day of which nobody knows which.

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
        raise InputError(f"times are {unknown}, and nothing says of which", where=where, advice=advice)
    if epoch == "utc_day":
        # Any week of these years has the leap seconds of today
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
    """Return times in the epoch of another recording of the same drive, and what was done to them.

    Times that lie within the other's as they stand are left alone, whatever is said of their epoch.

    Parameters
    ----------
    epoch
        Of the times; "" where nothing says it: their range does.
    span_s, span_epoch
        First and last time of the other recording, and its epoch ("": by its range).
    week
        GPS week where one of both is seconds of the week.
    """
    if _overlap(time_s, span_s):
        return time_s, ()
    epoch = epoch or epoch_by_values(time_s)
    span_epoch = span_epoch or epoch_by_values(np.array(span_s))
    converted = to_survey_time(time_s, epoch, span_epoch, week=week, near_s=span_s[0])
    # Old receivers count weeks to 1024 and begin again
    for n_rounds in (0, 1, 2):
        moved = converted + n_rounds * 1024 * WEEK_S
        if _overlap(moved, span_s):
            said = [f"converted to {_NAMES[span_epoch]}"] * (epoch != span_epoch)
            said += [f"{1024 * n_rounds} weeks added, which the receiver did not count"] * (n_rounds > 0)
            return moved, (f"times are {_NAMES[epoch]}: {', and '.join(said)}",)
    return time_s, ()


def _overlap(time_s: FloatArray, span_s: tuple[float, float]) -> bool:
    return len(time_s) > 0 and float(np.min(time_s)) <= span_s[1] and float(np.max(time_s)) >= span_s[0]


def known_offsets(time_s: float, epoch: str) -> list[tuple[float, str]]:
    """Return by how many seconds a clock may be ahead because one time was taken for another, and which.

    Parameters
    ----------
    time_s, epoch
        About when it was: the leap seconds of that day count. Those of today where the epoch does not tell.

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
