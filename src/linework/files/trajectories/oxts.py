"""Read trajectories from KITTI's OXTS folders: one text file per pose, and a file of times."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from linework.arrays import FloatArray
from linework.errors import InputError
from linework.files.geodetic import EarthFrame, convergence_deg, project_places
from linework.files.logs.text import bad_lines_warning, text_blocks
from linework.files.trajectories.content import TrajectoryContent, ordered_content

#: Latitude, longitude [deg], altitude [m], roll, pitch, yaw [rad]; then velocities, accelerations, rates.
_N_POSE = 6
_ACCURACY = 23
_MAX_BYTES = 10_000
#: Ratio of the sigma of height to that in plan for satellite positions: all satellites are above.
UP_PER_PLAN = 1.5


def read_oxts_content(folder: Path, frame: EarthFrame) -> TrajectoryContent:
    """Read ``data/*.txt`` and ``timestamps.txt`` of an oxts folder, or of the drive folder around it.

    Parameters
    ----------
    frame
        CRS and heights to convert to; in a local one the first pose is the origin, and a warning states where on
        earth that is.

    Returns
    -------
    TrajectoryContent
        Of the OXTS unit; times are seconds since 1970 by the clock of the timestamps. KITTI's roll is right side
        down positive as ours, its pitch nose down positive, its yaw 0 to the east and anticlockwise.

    Raises
    ------
    InputError
        No files, no times, or more than 1 % of them unusable.
    """
    if (folder / "oxts").is_dir():
        folder = folder / "oxts"
    files = sorted((folder / "data").glob("*.txt"))
    if not files:
        raise InputError("holds no data/*.txt", where=folder, advice="name the oxts folder of a KITTI drive")
    times = read_timestamps(folder / "timestamps.txt")
    rows = [_pose_of(file) for file in files]
    lines = _lines_of(files, len(times), folder)
    time_s = np.array([times[line] for line in lines])
    good = np.array([row is not None for row in rows]) & np.isfinite(time_s)
    bad = [int(i) + 1 for i in np.flatnonzero(~good)]
    remarks = bad_lines_warning(
        folder, bad, int(good.sum()), "poses with a time", advice="copy the folder again", unit="file"
    )
    values = np.array([rows[i] for i in np.flatnonzero(good)], dtype=np.float64)
    places = project_places(values[:, :3], frame, where=folder)
    roll, pitch, yaw = np.degrees(values[:, 3:6]).T
    heading = (90.0 - yaw - convergence_deg(values[:, 0], values[:, 1], frame)) % 360.0
    accuracy = values[:, 6]
    sigma = accuracy[:, None] * [1.0, 1.0, UP_PER_PLAN] if np.all(accuracy > 0.0) else None
    return ordered_content(
        folder, time_s[good], np.flatnonzero(good).astype(np.float64) + 1.0,
        {"xyz": places.xyz, "attitude_deg": np.stack([roll, -pitch, heading], axis=1), "sigma_xyz_m": sigma},
        warnings=(*remarks, *places.warnings), epoch="unix", unit="file",
    )  # fmt: skip


def read_timestamps(path: Path) -> FloatArray:
    """Read dates such as ``2011-09-26 13:02:25.964389445`` as (n,) seconds since 1970; NaN where a line is not a date."""
    found = []
    for block in text_blocks(path):
        for _, line in block.lines():
            if line.strip():
                found.append(_seconds(line.strip()))
    return np.array(found, dtype=np.float64)


def _seconds(text: str) -> float:
    try:
        moment = np.datetime64(text, "ns")
    except ValueError:
        return float("nan")
    return float(moment.astype(np.int64)) / 1e9 if not np.isnat(moment) else float("nan")


def _pose_of(file: Path) -> list[float] | None:
    """Return latitude, longitude, altitude, roll, pitch, yaw and accuracy [m, 0: not given]; None where damaged."""
    try:
        with file.open("rb") as opened:
            cells = opened.read(_MAX_BYTES).split()
        row = [float(cell) for cell in cells]
    except (OSError, ValueError):
        return None
    if len(row) < _N_POSE or not np.isfinite(row[:_N_POSE]).all():
        return None
    accuracy = row[_ACCURACY] if len(row) > _ACCURACY and np.isfinite(row[_ACCURACY]) else 0.0
    return [*row[:_N_POSE], accuracy]


def _lines_of(files: Sequence[Path], n_times: int, folder: Path) -> list[int]:
    """Return the line of the times that belongs to each file: by the number in its name where one is missing."""
    if len(files) == n_times:
        return list(range(n_times))
    numbers = [int(file.stem) if re.fullmatch(r"\d{1,12}", file.stem) else n_times for file in files]
    if max(numbers) >= n_times:
        raise InputError(f"{len(files)} files of data, but {n_times} times", where=folder / "timestamps.txt",
                         advice="there is one line for every file")  # fmt: skip
    return numbers
