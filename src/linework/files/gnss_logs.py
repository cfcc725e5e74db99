"""Read GNSS fixes: CSV in coordinates of the survey or in degrees."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from linework.errors import InputError
from linework.files.geodetic import EarthFrame, to_places
from linework.files.tables import read_table
from linework.files.time_order import in_time_order
from linework.model.logs import GnssLog

_GRID = ("easting_m", "northing_m", "height_m")
_DEGREES = ("latitude_deg", "longitude_deg", "ellipsoid_height_m")
_SIGMA = ("sigma_e_m", "sigma_n_m", "sigma_z_m")


@dataclass(frozen=True, slots=True)
class GnssContent:
    """Fixes as read, with what was odd about the file."""

    log: GnssLog
    warnings: tuple[str, ...] = ()


def read_gnss(path: Path, frame: EarthFrame) -> GnssContent:
    """Read GNSS fixes of any kind.

    Parameters
    ----------
    frame
        What latitudes, longitudes and ellipsoidal heights become.

    Raises
    ------
    InputError, CrsError, ConfigError
        The file or its places cannot be used.
    """
    return _read_csv(path, frame)


def _read_csv(path: Path, frame: EarthFrame) -> GnssContent:
    """Read ``time_s``, three columns of position and three of sigma."""
    table = read_table(path, ("time_s", *_SIGMA), (_GRID, _DEGREES), one_of=True)
    columns, warnings = table.columns, list(table.warnings)
    sigma = np.stack([columns[name] for name in _SIGMA], axis=1)
    fixes = np.flatnonzero((sigma > 0.0).all(axis=1))
    if len(fixes) < len(sigma):
        warnings.append(
            f"{len(sigma) - len(fixes)} of {len(sigma)} fixes have a sigma of 0 or below: left out"
        )
    order, said = in_time_order(columns["time_s"][fixes], table.line_numbers[fixes])
    kept = fixes[order]
    if len(kept) == 0:
        raise InputError("no fix with sigmas above 0", where=path, advice="sigmas are in metres")
    warnings += said
    if _GRID[0] in columns:
        xyz = np.stack([columns[name][kept] for name in _GRID], axis=1)
    else:
        places = to_places(*(columns[name][kept] for name in _DEGREES), frame, where=path)
        xyz = places.xyz
        warnings += places.warnings
    return GnssContent(GnssLog(columns["time_s"][kept], xyz, sigma[kept]), tuple(warnings))
