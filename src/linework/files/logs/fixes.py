"""Results of the readers of GNSS logs: fixes with usable sigmas, in time order."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from linework.arrays import AnyArray, FloatArray
from linework.errors import InputError
from linework.files.logs.clock import in_seconds, in_time_order
from linework.model.logs import GnssLog


@dataclass(frozen=True, slots=True)
class GnssContent:
    """Fixes as read, and warnings about the file.

    Parameters
    ----------
    warnings
        One line each.
    epoch
        Epoch of the times as the file states it: "gps" or "utc_day"; "" where it does not.
    """

    log: GnssLog
    warnings: tuple[str, ...] = ()
    epoch: str = ""


@dataclass(frozen=True, slots=True)
class RawFixes:
    """Fixes as rows of a file.

    Parameters
    ----------
    time_s
        (n,) [s].
    places
        (n, 3): latitude, longitude [deg], ellipsoidal height [m], or coordinates of the survey [m].
    sigma_m
        (n, 3) [m]: east, north, up; 0 or below where the receiver gives none.
    line_numbers
        (n,) line of each in the file.
    quality
        (n,) int64 kinds of the fixes, as in `linework.model.logs.GnssLog`; None where they are not stated.
    """

    time_s: FloatArray
    places: FloatArray
    sigma_m: FloatArray
    line_numbers: FloatArray
    quality: AnyArray | None = None

    def log(self, xyz: FloatArray) -> GnssLog:
        """Return the fixes with their positions (n, 3) in the survey."""
        return GnssLog(self.time_s, xyz, self.sigma_m, self.quality)


def usable_fixes(path: Path, fixes: RawFixes) -> tuple[RawFixes, tuple[str, ...]]:
    """Return the fixes with sigmas above 0 in strictly increasing time, and warnings about the others.

    Raises
    ------
    InputError
        None is left.
    """
    warnings: list[str] = []
    time_s, remarks = in_seconds(fixes.time_s, path)
    good = np.flatnonzero((fixes.sigma_m > 0.0).all(axis=1))
    if len(good) < len(time_s):
        warnings.append(
            f"{len(time_s) - len(good)} of {len(time_s)} fixes have a sigma of 0 or below: left out"
        )
    order, more = in_time_order(time_s[good], fixes.line_numbers[good])
    kept = good[order]
    if len(kept) == 0:
        raise InputError("no fix with sigmas above 0", where=path, advice="sigmas are in metres")
    quality = None if fixes.quality is None else fixes.quality[kept]
    usable = RawFixes(
        time_s[kept], fixes.places[kept], fixes.sigma_m[kept], fixes.line_numbers[kept], quality
    )
    return usable, (*remarks, *warnings, *more)
