"""Read RTKLIB solutions: .pos files, geographic or geocentric, GPS time or UTC.

Separate from `gnss`, which recognises formats: here a header states the columns, the angles and the time system.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pyproj

from linework.arrays import FloatArray
from linework.errors import InputError
from linework.files.geodetic import EarthFrame, project_places
from linework.files.logs.clock import WEEK_S, gps_of_unix
from linework.files.logs.fixes import GnssContent, RawFixes, usable_fixes
from linework.files.logs.text import bad_lines_warning, text_blocks
from linework.model.logs import GnssLog

_DATE = re.compile(r"\d{4}/\d\d/\d\d")
#: 1980-01-06 in seconds since 1970.
_GPS_BEGAN_S = 315_964_800.0
#: Columns after the time: three of position, quality, satellites, six of covariance.
_N_CELLS = 11


@dataclass(frozen=True, slots=True)
class _Header:
    """Content of the header lines, which begin with %."""

    is_utc: bool
    is_geocentric: bool
    has_geoid_heights: bool


def read_rtklib_pos(path: Path, frame: EarthFrame) -> GnssContent:
    """Read a .pos file; times become GPS seconds.

    Sigmas are the solution's own (sde, sdn, sdu; geocentric covariances are rotated to east, north, up).

    Raises
    ------
    InputError
        No header, an unknown layout, or more than 1 % of the lines unusable.
    """
    comments, rows, numbers, bad = [], [], [], []
    for block in text_blocks(path):
        for number, line in block.lines():
            if line.startswith("%"):
                comments.append(line)
            elif line.strip():
                row = _row(line)
                if row is None:
                    bad.append(number)
                else:
                    rows.append(row)
                    numbers.append(number)
    header = _header(comments, path)
    remarks = bad_lines_warning(
        path, bad, len(rows), "solutions", advice="expected time, position, Q, ns and six standard deviations"
    )
    values = np.array(rows, dtype=np.float64)
    time_s = gps_of_unix(values[:, 0] + _GPS_BEGAN_S) if header.is_utc else values[:, 0]
    if header.is_geocentric:
        places, sigma = _from_geocentric(values)
    else:
        # sdn, sde, sdu stand there
        places, sigma = values[:, 1:4], values[:, [7, 6, 8]]
    fixes, more = usable_fixes(path, RawFixes(time_s, places, sigma, np.array(numbers, dtype=np.float64)))
    if header.has_geoid_heights:
        frame = replace(frame, geoid=0.0)
        more = (*more, "heights are above the geoid: used unchanged")
    placed = project_places(fixes.places, frame, where=path)
    log = GnssLog(fixes.time_s, placed.xyz, fixes.sigma_m)
    return GnssContent(log, (*remarks, *more, *placed.warnings), "gps")


def _header(comments: list[str], path: Path) -> _Header:
    """Return the content of the header; its last line with "Q" names the columns."""
    named = next((line for line in reversed(comments) if re.search(r"\bQ\b\s+\bns\b", line)), "")
    words = named.lstrip("% ").split()
    if not words:
        raise InputError("no header line that names the columns (%  GPST  latitude(deg) ...)", where=path,
                         advice="write it with the header on")  # fmt: skip
    if words[0] not in ("GPST", "UTC"):
        # A word that is no time system could be anything of a file that is no log
        system = words[0] if re.fullmatch("[A-Z]{2,5}", words[0]) else "not known"
        raise InputError(f"time system {system}, expected GPST or UTC", where=path,
                         advice="convert it with another time system")  # fmt: skip
    is_geocentric = "x-ecef(m)" in named
    if not is_geocentric and "latitude(deg)" not in named:
        raise InputError("other columns, expected latitude(deg) or x-ecef(m)", where=path,
                         advice="write positions as degrees or as x/y/z")  # fmt: skip
    return _Header(words[0] == "UTC", is_geocentric, any("/geodetic" in line for line in comments))


def _row(line: str) -> list[float] | None:
    """Return the time in seconds since 1980 in the file's time system, and the numbers of a line."""
    cells = line.replace(",", " ").replace(";", " ").split()
    if len(cells) < 2 + _N_CELLS:
        return None
    try:
        values = [float(cell) for cell in cells[2 : 2 + _N_CELLS]]
        if _DATE.fullmatch(cells[0]):
            moment = np.datetime64(f"{cells[0].replace('/', '-')}T{cells[1]}", "ns")
            time = float(moment.astype(np.int64)) / 1e9 - _GPS_BEGAN_S
        else:
            time = float(cells[0]) * WEEK_S + float(cells[1])
    except ValueError:
        return None
    return [time, *values] if np.isfinite([time, *values]).all() else None


def _from_geocentric(values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return latitude, longitude [deg], height [m], and sigmas east, north, up [m] of geocentric solutions."""
    to_geographic = pyproj.Transformer.from_pipeline(
        "+proj=pipeline +step +inv +proj=cart +ellps=WGS84 +step +proj=unitconvert +xy_in=rad +xy_out=deg"
    )
    longitude, latitude, height = to_geographic.transform(
        values[:, 1], values[:, 2], values[:, 3], errcheck=False
    )
    # Roots of the covariances, with their signs: sdx, sdy, sdz, sdxy, sdyz, sdzx
    xx, yy, zz, xy, yz, zx = (np.sign(values[:, 6:12]) * values[:, 6:12] ** 2).T
    covariance = np.stack([xx, xy, zx, xy, yy, yz, zx, yz, zz], axis=1).reshape(-1, 3, 3)
    lon, lat = np.radians(longitude), np.radians(latitude)
    zero = np.zeros_like(lon)
    axes = np.stack([
        -np.sin(lon), np.cos(lon), zero,
        -np.sin(lat) * np.cos(lon), -np.sin(lat) * np.sin(lon), np.cos(lat),
        np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat),
    ], axis=1).reshape(-1, 3, 3)  # fmt: skip
    variance = np.einsum("nij,njk,nik->ni", axes, covariance, axes)
    return np.stack([latitude, longitude, height], axis=1), np.sqrt(np.maximum(variance, 0.0))
