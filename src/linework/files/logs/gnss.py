"""Read GNSS fixes: CSV in coordinates of the survey or in degrees, NMEA, RTKLIB's .pos."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from linework.files.geodetic import EarthFrame, project_places
from linework.files.logs.fixes import GnssContent, RawFixes, usable_fixes
from linework.files.logs.nmea import read_nmea
from linework.files.logs.rtklib import read_rtklib_pos
from linework.files.logs.tables import read_table
from linework.files.logs.text import TextBlock, text_blocks

GRID_COLUMNS = ("easting_m", "northing_m", "height_m")
DEGREE_COLUMNS = ("latitude_deg", "longitude_deg", "ellipsoid_height_m")
SIGMA_COLUMNS = ("sigma_e_m", "sigma_n_m", "sigma_z_m")
#: Lines searched for the format: a receiver may write other messages first.
_FIRST_LINES = 1000


def read_gnss(path: Path, frame: EarthFrame) -> GnssContent:
    """Read GNSS fixes of any format, recognised by the first lines.

    Parameters
    ----------
    frame
        CRS and heights that latitudes, longitudes and ellipsoidal heights are converted to.

    Raises
    ------
    InputError, CrsError, ConfigError
        The file or its places cannot be used.
    """
    kind = _kind(path)
    if kind == "nmea":
        return read_nmea(path, frame)
    return read_rtklib_pos(path, frame) if kind == "pos" else _read_csv(path, frame)


def is_gnss_file(path: Path) -> bool:
    """Return whether a file holds NMEA sentences or is a .pos of RTKLIB."""
    return _kind(path) != "csv"


def _kind(path: Path) -> str:
    if path.suffix.lower() == ".csv":
        return "csv"
    if path.suffix.lower() in (".nmea", ".pos"):
        return path.suffix.lower()[1:]
    for number, line in next(text_blocks(path), TextBlock(b"", 1)).lines():
        if line.startswith("%"):
            return "pos"
        if "$G" in line:
            return "nmea"
        if number > _FIRST_LINES:
            break
    return "csv"


def _read_csv(path: Path, frame: EarthFrame) -> GnssContent:
    """Read ``time_s``, three columns of position and three of sigma."""
    table = read_table(path, ("time_s", *SIGMA_COLUMNS), (GRID_COLUMNS, DEGREE_COLUMNS), one_of=True)
    columns = table.columns
    names = GRID_COLUMNS if GRID_COLUMNS[0] in columns else DEGREE_COLUMNS
    places, sigma = (np.stack([columns[name] for name in group], axis=1) for group in (names, SIGMA_COLUMNS))
    fixes, remarks = usable_fixes(path, RawFixes(columns["time_s"], places, sigma, table.line_numbers))
    warnings, xyz = (*table.warnings, *remarks), fixes.places
    if names == DEGREE_COLUMNS:
        placed = project_places(fixes.places, frame, where=path)
        warnings, xyz = (*warnings, *placed.warnings), placed.xyz
    return GnssContent(fixes.log(xyz), warnings)
