"""Read and write trajectories: CSV with the columns of the manual."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from linework.errors import InputError, MachineError
from linework.files.publish import publish
from linework.files.tables import read_table
from linework.files.time_order import in_time_order
from linework.model.arrays import FloatArray
from linework.model.trajectory import Trajectory

_POSITION = ("time_s", "easting_m", "northing_m", "height_m")
_ATTITUDE = ("roll_deg", "pitch_deg", "heading_deg")
_SIGMA = ("sigma_e_m", "sigma_n_m", "sigma_z_m")
_SIGMA_ATTITUDE = ("sigma_roll_deg", "sigma_pitch_deg", "sigma_heading_deg")


@dataclass(frozen=True, slots=True)
class TrajectoryContent:
    """A trajectory as read, with what was odd about the file."""

    trajectory: Trajectory
    warnings: tuple[str, ...] = ()


def read_trajectory(path: Path) -> Trajectory:
    """Read a trajectory (see `read_trajectory_content`)."""
    return read_trajectory_content(path).trajectory


def read_trajectory_content(path: Path) -> TrajectoryContent:
    """Read a CSV with ``time_s,easting_m,northing_m,height_m`` and, if there, attitudes and sigmas.

    Rows are put in time order (stable); of rows with equal time the first is kept, the others counted.

    Raises
    ------
    InputError
        Columns missing, lines that are not numbers (with the line number), fewer than two positions.
    """
    table = read_table(path, _POSITION, (_ATTITUDE, _SIGMA, _SIGMA_ATTITUDE))
    columns = table.columns
    time = columns["time_s"]
    kept, said = in_time_order(time, table.line_numbers)
    if len(kept) < 2:
        raise InputError(
            f"{len(kept)} position, a trajectory needs at least 2", where=path, advice="check the file"
        )

    def group(names: tuple[str, ...]) -> FloatArray | None:
        if names[0] not in columns:
            return None
        return np.stack([columns[name][kept] for name in names], axis=1)

    xyz = group(_POSITION[1:])
    assert xyz is not None
    trajectory = Trajectory(time[kept], xyz, group(_ATTITUDE), group(_SIGMA), group(_SIGMA_ATTITUDE))
    return TrajectoryContent(trajectory, (*table.warnings, *said))


def write_trajectory(trajectory: Trajectory, path: Path, *, overwrite: bool = False) -> None:
    """Write a trajectory as CSV; every number reads back exactly.

    Raises
    ------
    OutputExistsError, MachineError
        As for `publish`.
    """
    names, blocks = list(_POSITION), [trajectory.time_s[:, None], trajectory.xyz]
    for group, values in (
        (_ATTITUDE, trajectory.attitude_deg),
        (_SIGMA, trajectory.sigma_xyz_m),
        (_SIGMA_ATTITUDE, trajectory.sigma_attitude_deg),
    ):
        if values is not None:
            names += group
            blocks.append(values)
    rows = np.concatenate(blocks, axis=1)

    def write(part: Path) -> None:
        with part.open("w", encoding="utf-8", newline="") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow(names)
            writer.writerows(rows.tolist())

    def verify(part: Path) -> None:
        back = np.loadtxt(part, delimiter=",", skiprows=1, ndmin=2)
        if not np.array_equal(back.reshape(-1, len(names)), rows):
            raise MachineError(
                "written file does not read back the same", where=path, advice="check the disk"
            )

    publish(path, write, verify, overwrite=overwrite)
