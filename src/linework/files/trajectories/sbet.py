"""Read smoothed trajectories of inertial systems: SBET, 17 little-endian float64 per record.

Separate from `read`, which recognises formats: this one is binary, and its records are checked by the ranges of their
values.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from linework.arrays import BoolArray, FloatArray
from linework.errors import InputError
from linework.files.geodetic import EarthFrame, convergence_deg, project_places
from linework.files.input import regular_file_bytes
from linework.files.logs.clock import WEEK_S, in_seconds
from linework.files.logs.text import bad_lines_warning
from linework.files.trajectories.content import TrajectoryContent, ordered_content

_N_CELLS = 17
_RECORD_BYTES = 8 * _N_CELLS
#: Most records that are read: a day at 200 Hz; more would not fit into memory.
_MAX_RECORDS = 200 * 86_400


def read_sbet_content(path: Path, frame: EarthFrame) -> TrajectoryContent:
    """Read an SBET: time of the week, latitude, longitude, height, velocities, roll, pitch, heading, wander angle.

    Parameters
    ----------
    frame
        CRS and heights to convert to.

    Returns
    -------
    TrajectoryContent
        Of the point the file describes (the inertial unit). Heading = platform heading - wander angle - meridian
        convergence.

    Raises
    ------
    InputError
        No whole record, more than 1 % of the records impossible.
    """
    n_bytes = regular_file_bytes(path)
    n, rest = divmod(n_bytes, _RECORD_BYTES)
    if n == 0 or n > _MAX_RECORDS:
        raise InputError(
            f"{n_bytes:,} bytes, expected {_RECORD_BYTES} per record of an SBET and at most {_MAX_RECORDS:,} records",
            where=path, advice="check what this file is",
        )  # fmt: skip
    records = np.fromfile(path, dtype="<f8", count=n * _N_CELLS).reshape(n, _N_CELLS)
    good = _possible(records)
    remarks = bad_lines_warning(
        path, (np.flatnonzero(~good) + 1).tolist(), int(good.sum()), "time, latitude, longitude, height and angles",
        advice="check that this is an SBET", unit="record",
    )  # fmt: skip
    if rest:
        remarks = (*remarks, f"the last record is cut off ({rest} of {_RECORD_BYTES} bytes)")
    numbers, records = np.flatnonzero(good).astype(np.float64) + 1.0, records[good]
    time_s, more = in_seconds(records[:, 0], path)
    latitude, longitude = np.degrees(records[:, 1:3]).T
    places = project_places(np.column_stack([latitude, longitude, records[:, 3]]), frame, where=path)
    roll, pitch, platform, wander = np.degrees(records[:, 7:11]).T
    heading = (platform - wander - convergence_deg(latitude, longitude, frame)) % 360.0
    return ordered_content(
        path, time_s, numbers, {"xyz": places.xyz, "attitude_deg": np.stack([roll, pitch, heading], axis=1)},
        warnings=(*remarks, *more, *places.warnings), epoch="gps_week", unit="record",
    )  # fmt: skip


def _possible(records: FloatArray) -> BoolArray:
    """Return (n,) bool: which records hold numbers within their ranges."""
    with np.errstate(invalid="ignore"):
        time, latitude, longitude, height = records[:, :4].T
        turns = np.abs(records[:, 7:11])
        return np.asarray(
            (time >= 0.0) & (time <= 2 * WEEK_S) & (np.abs(latitude) <= np.pi / 2)
            & (np.abs(longitude) <= 2 * np.pi) & (np.abs(height) < 2e4) & (turns <= 4 * np.pi).all(axis=1)
        )  # fmt: skip
