"""Read RTKLIB solutions: .pos files, geographic, geocentric or as baselines, GPS time or UTC.

Separate from `gnss`, which recognises formats: here a header states the columns, the angles, the time system and the
base station. Layouts as the manual of RTKLIB 2.4.2 describes them (appendix B.1).
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pyproj

from linework.arrays import FloatArray
from linework.errors import InputError
from linework.files.geodetic import EarthFrame, project_places
from linework.files.logs.clock import WEEK_S, gps_of_unix
from linework.files.logs.fixes import GnssContent, RawFixes, usable_fixes
from linework.files.logs.text import bad_lines_warning, text_blocks
from linework.model.logs import FIX_QUALITIES

_DATE = re.compile(r"\d{4}/\d\d/\d\d")
_REFERENCE = re.compile(r"%\s*(?:ref|slave) pos\s*:(.*)")
_DATUM = re.compile(r"lat/lon/height=([^/,\s]+)")
#: 1980-01-06 in seconds since 1970.
_GPS_BEGAN_S = 315_964_800.0
#: Columns after the position: quality, satellites, three standard deviations and three roots of covariances.
_N_AFTER = 8
#: Weeks since 1980 that a solution may have, and its years.
_MOST_WEEKS, _FIRST_YEAR, _LAST_YEAR = 8192.0, 1980, 2136
#: Larger numbers are neither a position nor a standard deviation: a thousand radii of the earth. [m]
_MOST_M = 1e10
#: Numbers of a position: degrees and height, or degrees, minutes and seconds twice, and height.
_N_DEGREES, _N_DMS = 3, 7
#: Columns of a row: time, position, quality, then the roots of the covariances.
_PLACE, _QUALITY, _ROOTS = slice(1, 4), 4, slice(5, 11)


class _Layout(NamedTuple):
    """What the line that names the columns says."""

    is_utc: bool
    kind: str

    @property
    def n_place(self) -> int:
        """Number of columns of the position."""
        return _N_DMS if self.kind == "dms" else _N_DEGREES


#: Layouts by the name of their first column after the time.
_KINDS = {
    "latitude(deg)": "degrees",
    "latitude(d'\")": "dms",
    "x-ecef(m)": "ecef",
    "e-baseline(m)": "baseline",
}


@dataclass(slots=True)
class _Solutions:
    """Content of a file as far as it is read.

    Parameters
    ----------
    rows, numbers
        Time, position, quality and roots of covariances of the solutions, and their lines.
    bad
        Lines that cannot be used.
    n_none
        Number of solutions without a position.
    reference_deg
        Position of the base: latitude, longitude [deg], height [m].
    """

    rows: list[list[float]]
    numbers: list[int]
    bad: list[int]
    layout: _Layout | None = None
    n_none: int = 0
    reference_deg: tuple[float, float, float] | None = None
    has_geoid_heights: bool = False


def read_rtklib_pos(path: Path, frame: EarthFrame) -> GnssContent:
    """Read a .pos file; times become GPS seconds.

    Sigmas are the solution's own; geocentric covariances are rotated to east, north, up. Solutions of quality 0 are
    none. A baseline begins at the base of `frame`, or where there is none at that of the file's header.

    Raises
    ------
    InputError
        No header, an unknown layout, a baseline from an unknown base, or more than 1 % of the lines unusable.
    """
    found = _Solutions([], [], [])
    for block in text_blocks(path):
        for number, line in block.lines():
            if line.startswith("%"):
                _take_comment(found, line, number, path)
            elif line.strip():
                _take_row(found, line, number)
    if found.layout is None:
        raise InputError("no header line that names the columns (%  GPST  latitude(deg) ...)", where=path,
                         advice="write it with the header on")  # fmt: skip
    remarks = bad_lines_warning(
        path, found.bad, len(found.rows) + found.n_none, "solutions",
        advice="expected time, position, Q, ns and six standard deviations",
    )  # fmt: skip
    if not found.rows:
        raise InputError(f"none of the {found.n_none} solutions has a position (Q = 0)", where=path,
                         advice="compute it with other observations")  # fmt: skip
    if found.n_none:
        remarks = (*remarks, f"{found.n_none} solutions without a position (Q = 0) left out")
    values = np.array(found.rows, dtype=np.float64)
    time_s = gps_of_unix(values[:, 0] + _GPS_BEGAN_S) if found.layout.is_utc else values[:, 0]
    places, sigma = _geographic(found, values, frame, path)
    raw = RawFixes(
        time_s, places, sigma, np.array(found.numbers, dtype=np.float64), values[:, _QUALITY].astype(np.int64)
    )
    fixes, more = usable_fixes(path, raw)
    if found.has_geoid_heights:
        frame = replace(frame, geoid=0.0)
        more = (*more, "heights are above the geoid: used unchanged")
    placed = project_places(fixes.places, frame, where=path)
    return GnssContent(fixes.log(placed.xyz), (*remarks, *more, *placed.warnings), "gps")


# Lines


def _take_comment(found: _Solutions, line: str, number: int, path: Path) -> None:
    """Take what a line of the header says."""
    found.has_geoid_heights |= "/geodetic" in line
    if (datum := _DATUM.search(line)) is not None and datum[1] != "WGS84":
        raise InputError(f"positions in the datum {datum[1]:.20}, expected WGS84", where=path,
                         advice="write them in WGS84")  # fmt: skip
    if (stated := _REFERENCE.match(line)) is not None:
        reference = _position(stated[1].replace(",", " ").replace(";", " ").split())
        if reference is not None and found.reference_deg not in (None, reference):
            raise InputError(f"line {number} states another base position than the header", where=path,
                             advice="keep one file per base position")  # fmt: skip
        found.reference_deg = reference or found.reference_deg
    if re.search(r"\bQ\b\W+\bns\b", line):
        layout = _layout(line, path)
        if found.layout not in (None, layout):
            raise InputError(f"line {number} names other columns or times than the header", where=path,
                             advice="keep one file per layout")  # fmt: skip
        found.layout = layout


def _layout(line: str, path: Path) -> _Layout:
    """Return what the line that names the columns says."""
    system = re.split(r"[\s,;]+", line.lstrip("% "))[0]
    if system not in ("GPST", "UTC"):
        # A word that is no time system could be anything of a file that is no log
        system = system if re.fullmatch("[A-Z]{2,5}", system) else "not known"
        raise InputError(f"time system {system}, expected GPST or UTC", where=path,
                         advice="convert it with another time system")  # fmt: skip
    kind = next((kind for name, kind in _KINDS.items() if name in line), None)
    if kind is None:
        raise InputError("other columns, expected latitude, x-ecef(m) or e-baseline(m)", where=path,
                         advice="write positions as degrees, as x/y/z or as e/n/u")  # fmt: skip
    return _Layout(system == "UTC", kind)


def _position(cells: list[str]) -> tuple[float, float, float] | None:
    """Return latitude, longitude [deg] and height [m] of a base in any layout; None for anything else."""
    try:
        if len(cells) == _N_DMS:
            place = _degrees(cells[:3]), _degrees(cells[3:6]), float(cells[6])
        else:
            x, y, z = (float(cell) for cell in cells)
            place = x, y, z
            if not all(abs(value) < _MOST_M for value in place):
                return None
            # Degrees are below 360, and geocentric coordinates of places on earth are not all
            if max(abs(x), abs(y)) > 360.0:
                latitude, longitude, height = _from_geocentric(np.array([[x, y, z]]))[0].tolist()
                place = latitude, longitude, height
    except ValueError:
        return None
    is_usable = bool(np.isfinite(place).all()) and abs(place[0]) <= 90.0 and any(place)
    return place if is_usable else None


def _degrees(cells: list[str]) -> float:
    """Return an angle from degrees, minutes and seconds.

    >>> _degrees(["-0", "30", "36.0"])
    -0.51
    """
    whole, minutes, seconds = (abs(float(cell)) for cell in cells)
    size = whole + minutes / 60.0 + seconds / 3600.0
    return -size if cells[0].startswith("-") else size


def _take_row(found: _Solutions, line: str, number: int) -> None:
    """Take a solution; lines before the header belong to no layout."""
    row = None if found.layout is None else _row(line, found.layout.n_place)
    if row is None:
        found.bad.append(number)
    elif row[_QUALITY] == 0.0:
        found.n_none += 1
    else:
        found.rows.append(row)
        found.numbers.append(number)


def _row(line: str, n_place: int) -> list[float] | None:
    """Return time in seconds since 1980 in the file's time system, position, quality and roots of covariances."""
    cells = line.replace(",", " ").replace(";", " ").split()
    if len(cells) < 2 + n_place + _N_AFTER:
        return None
    after = cells[2 + n_place : 2 + n_place + _N_AFTER]
    try:
        if n_place == _N_DMS:
            place = [_degrees(cells[2:5]), _degrees(cells[5:8]), float(cells[8])]
        else:
            place = [float(cell) for cell in cells[2:5]]
        values = [*place, *(float(cell) for cell in (after[0], *after[2:]))]
        time = _seconds(cells)
    except ValueError:
        return None
    is_known = values[3] in range(len(FIX_QUALITIES))
    # NaN is not below the limit either
    return [time, *values] if is_known and all(abs(value) < _MOST_M for value in values) else None


def _seconds(cells: list[str]) -> float:
    """Return a date and time, or week and seconds, in seconds since 1980."""
    if _DATE.fullmatch(cells[0]):
        if not _FIRST_YEAR <= int(cells[0][:4]) <= _LAST_YEAR:
            raise ValueError("no year of GPS")
        moment = np.datetime64(f"{cells[0].replace('/', '-')}T{cells[1]}", "ns")
        return float(moment.astype(np.int64)) / 1e9 - _GPS_BEGAN_S
    week, seconds = float(cells[0]), float(cells[1])
    if not (0.0 <= week <= _MOST_WEEKS and 0.0 <= seconds < WEEK_S):
        raise ValueError("no week and seconds of it")
    return week * WEEK_S + seconds


# Positions


def _geographic(
    found: _Solutions, values: FloatArray, frame: EarthFrame, path: Path
) -> tuple[FloatArray, FloatArray]:
    """Return latitude, longitude [deg], height [m], and sigmas east, north, up [m] of solutions, (n, 3) each."""
    assert found.layout is not None
    places, roots = values[:, _PLACE], values[:, _ROOTS]
    if found.layout.kind in ("degrees", "dms"):
        # sdn, sde, sdu stand there
        return places, roots[:, [1, 0, 2]]
    if found.layout.kind == "ecef":
        places = _from_geocentric(places)
        return places, _sigmas_of_geocentric(roots, places)
    base = frame.base_deg or found.reference_deg
    if base is None:
        raise InputError(
            "holds baselines from a base whose position its header does not state (% ref pos)", where=path,
            advice="add [gnss] base_deg = [latitude, longitude, ellipsoidal height] to the survey.toml",
        )  # fmt: skip
    origin = np.array([base])
    to_geocentric = pyproj.Transformer.from_pipeline(
        "+proj=pipeline +step +proj=unitconvert +xy_in=deg +xy_out=rad +step +proj=cart +ellps=WGS84"
    )
    start = np.array(to_geocentric.transform(base[1], base[0], base[2]))
    return _from_geocentric(start + places @ _axes(origin)[0]), roots[:, :3]


def _from_geocentric(xyz: FloatArray) -> FloatArray:
    """Return latitude, longitude [deg] and height [m] of geocentric positions, (n, 3)."""
    to_geographic = pyproj.Transformer.from_pipeline(
        "+proj=pipeline +step +inv +proj=cart +ellps=WGS84 +step +proj=unitconvert +xy_in=rad +xy_out=deg"
    )
    longitude, latitude, height = to_geographic.transform(xyz[:, 0], xyz[:, 1], xyz[:, 2], errcheck=False)
    return np.stack([latitude, longitude, height], axis=1)


def _axes(places: FloatArray) -> FloatArray:
    """Return the geocentric directions east, north and up, (n, 3, 3), at latitudes and longitudes [deg]."""
    lat, lon = np.radians(places[:, :2]).T
    zero = np.zeros_like(lon)
    return np.stack([
        -np.sin(lon), np.cos(lon), zero,
        -np.sin(lat) * np.cos(lon), -np.sin(lat) * np.sin(lon), np.cos(lat),
        np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat),
    ], axis=1).reshape(-1, 3, 3)  # fmt: skip


def _sigmas_of_geocentric(roots: FloatArray, places: FloatArray) -> FloatArray:
    """Return sigmas east, north, up (n, 3) [m] from roots of covariances with their signs: x, y, z, xy, yz, zx."""
    xx, yy, zz, xy, yz, zx = (np.sign(roots) * roots**2).T
    covariance = np.stack([xx, xy, zx, xy, yy, yz, zx, yz, zz], axis=1).reshape(-1, 3, 3)
    axes = _axes(places)
    variance = np.einsum("nij,njk,nik->ni", axes, covariance, axes)
    return np.asarray(np.sqrt(np.maximum(variance, 0.0)))
