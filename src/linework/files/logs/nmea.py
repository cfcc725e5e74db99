"""NMEA sentences of a GNSS receiver: GGA with the date of RMC or ZDA and the sigmas of GST.

Separate from `gnss`, which recognises formats: NMEA gives dates, heights and sigmas in sentences of their own.
"""

from __future__ import annotations

import datetime
import functools
import math
import operator
import re
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from pynmeagps import VALNONE, NMEAReader
from pynmeagps.exceptions import NMEAMessageError, NMEAParseError, NMEAStreamError, NMEATypeError

from linework.arrays import FloatArray
from linework.errors import InputError
from linework.files.geodetic import EarthFrame, project_places
from linework.files.logs.clock import gps_of_unix
from linework.files.logs.fixes import GnssContent, RawFixes, usable_fixes
from linework.files.logs.text import bad_lines_warning, text_blocks
from linework.files.trajectories.oxts import UP_PER_PLAN
from linework.model.logs import FIX_QUALITIES

_WANTED = re.compile(r"[A-Z]{2}(GGA|RMC|ZDA|GST),")
_DAY_S = 86_400.0
#: Ranging error by quality of the fix [m]; times HDOP it is the error in plan: code, code with corrections, encrypted
#: code, phase with fixed and with float ambiguities. Estimated (6) and manual (7) positions are not fixes.
_RANGE_SIGMA_M = {1: 2.5, 2: 0.7, 3: 2.0, 4: 0.01, 5: 0.25, 8: 2.5}
#: Kinds of fixes by the quality of GGA; encrypted code is code.
_QUALITIES = {
    code: FIX_QUALITIES.index(name)
    for code, name in (
        (1, "single"), (2, "differential"), (3, "single"), (4, "fixed"), (5, "float"), (8, "unknown"),
    )
}  # fmt: skip
#: HDOP where a receiver gives none: usual under open sky.
_USUAL_HDOP = 1.0


@dataclass(slots=True)
class _Log:
    """Content of the sentences read so far.

    Parameters
    ----------
    fixes
        Day, seconds of the day, latitude, longitude, altitude, separation, quality, HDOP, line number.
    sigmas
        East, north, up by day and second of the day.
    first_days
        Days since 1970 of day 0, by the dated sentences.
    """

    fixes: list[tuple[float, ...]] = field(default_factory=list)
    sigmas: dict[tuple[int, float], tuple[float, float, float]] = field(default_factory=dict)
    first_days: list[int] = field(default_factory=list)
    n_without_fix: int = 0
    day: int = 0
    last_s: float = 0.0


def read_nmea(path: Path, frame: EarthFrame) -> GnssContent:
    """Read the fixes of an NMEA log; times become GPS seconds.

    Ellipsoidal heights are altitude plus geoid separation. Sigmas are those of GST; without GST, the ranging error of
    the fix quality times HDOP. Sentences with a wrong checksum are counted and left out.

    Returns
    -------
    GnssContent
        Without a date in any sentence: seconds of the first day, epoch "utc_day".

    Raises
    ------
    InputError
        No fix, or more than 1 % of the sentences damaged.
    """
    log, bad, n_good, n_others = _Log(), list[int](), 0, 0
    for block in text_blocks(path):
        for number, line in block.lines():
            n_others += "$" not in line and bool(line.strip())
            for sentence in line.split("$")[1:]:
                if _is_sound(sentence) and _take(log, sentence, number):
                    n_good += 1
                else:
                    bad.append(number)
    remarks = bad_lines_warning(path, bad, n_good, "sound NMEA sentences", advice="expected $..GGA sentences")
    if not log.fixes:
        raise InputError(f"no fix among {n_good} sentences", where=path, advice="expected $..GGA with a fix")
    values = np.array(log.fixes, dtype=np.float64)
    seconds, epoch, more = _times(log, values)
    places, undulation, odd = _heights(values)
    if log.n_without_fix:
        odd = (*odd, f"{log.n_without_fix} of {log.n_without_fix + len(values)} epochs have no fix")
    quality = np.array([_QUALITIES[int(code)] for code in values[:, 6]], dtype=np.int64)
    raw = RawFixes(
        seconds, np.column_stack([places, undulation]), _sigmas(log, values), values[:, 8], quality
    )
    fixes, left_out = usable_fixes(path, raw)
    placed = project_places(fixes.places[:, :3], frame, undulation_m=fixes.places[:, 3], where=path)
    if n_others:
        odd = (*odd, f"{n_others} lines hold no NMEA sentence")
    warnings = (*remarks, *more, *odd, *left_out, *placed.warnings)
    return GnssContent(fixes.log(placed.xyz), warnings, epoch)


def _is_sound(sentence: str) -> bool:
    """Return whether the checksum of a sentence is right."""
    content, _, checksum = sentence.strip().partition("*")
    try:
        return functools.reduce(operator.xor, content.encode("ascii"), 0) == int(checksum, 16)
    except ValueError:  # no ASCII, or no number
        return False


def _take(log: _Log, sentence: str, number: int) -> bool:
    """Add a sentence with a correct checksum to the log; return whether it could be parsed."""
    if (wanted := _WANTED.match(sentence)) is None:
        return True
    kind = wanted[1]
    if kind in ("RMC", "ZDA") and log.first_days and log.day < len(log.first_days):
        return True  # one date per day is enough
    try:
        message: Any = NMEAReader.parse(b"$" + sentence.strip().encode("ascii"), validate=VALNONE)
    except (NMEAMessageError, NMEAParseError, NMEAStreamError, NMEATypeError, ValueError):
        return False
    time = getattr(message, "time", None)
    if not isinstance(time, datetime.time):
        log.n_without_fix += kind == "GGA"
        return True  # before the first fix there is no time
    second = time.hour * 3600.0 + time.minute * 60.0 + time.second + time.microsecond / 1e6
    if second < log.last_s - _DAY_S / 2:
        log.day += 1
    log.last_s = second
    if kind == "GGA":
        _take_fix(log, message, second, number)
    elif kind == "GST":
        sigma = (message.stdLong, message.stdLat, message.stdAlt)
        if all(_is_number(value) for value in sigma):
            log.sigmas[log.day, second] = sigma
    elif (date := _date_of(message, kind)) is not None:
        log.first_days.append((date - datetime.date(1970, 1, 1)).days - log.day)
    return True


def _take_fix(log: _Log, gga: Any, second: float, number: int) -> None:
    if gga.quality not in _RANGE_SIGMA_M or not all(map(_is_number, (gga.lat, gga.lon, gga.alt))):
        log.n_without_fix += 1
        return
    separation = gga.sep if _is_number(gga.sep) else np.nan
    hdop = gga.HDOP if _is_number(gga.HDOP) and gga.HDOP > 0.0 else _USUAL_HDOP
    log.fixes.append((log.day, second, gga.lat, gga.lon, gga.alt, separation, gga.quality, hdop, number))


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and math.isfinite(value)


def _date_of(message: Any, kind: str) -> datetime.date | None:
    """Return the date of a sentence; None for an RMC without a fix, whose date may be wrong."""
    if kind == "RMC":
        is_date = message.status == "A" and isinstance(message.date, datetime.date)
        return message.date if is_date else None
    try:
        return datetime.date(message.year, message.month, message.day)
    except (TypeError, ValueError):
        return None


def _times(log: _Log, values: FloatArray) -> tuple[FloatArray, str, tuple[str, ...]]:
    """Return the times of the fixes, their epoch, and warnings."""
    seconds = values[:, 0] * _DAY_S + values[:, 1]
    if not log.first_days:
        return seconds, "utc_day", ("no date (RMC, ZDA): times are seconds of the first day, UTC",)
    first, count = Counter(log.first_days).most_common(1)[0]
    remarks: tuple[str, ...] = ()
    if count < len(log.first_days):
        remarks = (
            f"{len(log.first_days) - count} of {len(log.first_days)} dates contradict the others: not used",
        )
    return gps_of_unix(first * _DAY_S + seconds), "gps", remarks


def _heights(values: FloatArray) -> tuple[FloatArray, FloatArray, tuple[str, ...]]:
    """Return latitude, longitude [deg] and ellipsoidal height [m] (n, 3), geoid separation (n,) [m], and warnings."""
    separation, remarks = values[:, 5], tuple[str, ...]()
    known = np.isfinite(separation)
    if not known.any():
        separation = np.zeros(len(values))
        remarks = ("no geoid separation: altitudes used as heights above the ellipsoid",)
    elif not known.all():
        at = np.arange(len(values))
        separation = np.interp(at, at[known], separation[known])
    return np.column_stack([values[:, 2:4], values[:, 4] + separation]), separation, remarks


def _sigmas(log: _Log, values: FloatArray) -> FloatArray:
    """Return (n, 3) sigmas east, north, up [m]: from GST, else by the quality of the fix."""
    plan = np.array([_RANGE_SIGMA_M[int(quality)] for quality in values[:, 6]]) * values[:, 7] / np.sqrt(2.0)
    sigma = plan[:, None] * [1.0, 1.0, UP_PER_PLAN * np.sqrt(2.0)]
    for i, (day, second) in enumerate(values[:, :2].tolist()):
        if (remarks := log.sigmas.get((int(day), second))) is not None:
            sigma[i] = remarks
    return np.asarray(sigma, dtype=np.float64)
