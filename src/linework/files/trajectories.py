"""Read and write trajectories: CSV with the columns of the manual."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np

from linework.errors import MachineError
from linework.files.publish import publish
from linework.files.tables import read_table
from linework.files.trajectory_content import TrajectoryContent, ordered_content
from linework.model.arrays import FloatArray
from linework.model.trajectory import Trajectory

_POSITION = ("time_s", "easting_m", "northing_m", "height_m")
_ATTITUDE = ("roll_deg", "pitch_deg", "heading_deg")
_SIGMA = ("sigma_e_m", "sigma_n_m", "sigma_z_m")
_SIGMA_ATTITUDE = ("sigma_roll_deg", "sigma_pitch_deg", "sigma_heading_deg")


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

    def group(names: tuple[str, ...]) -> FloatArray | None:
        return np.stack([columns[name] for name in names], axis=1) if names[0] in columns else None

    return ordered_content(
        path,
        columns["time_s"],
        table.line_numbers,
        {
            "xyz": group(_POSITION[1:]),
            "attitude_deg": group(_ATTITUDE),
            "sigma_xyz_m": group(_SIGMA),
            "sigma_attitude_deg": group(_SIGMA_ATTITUDE),
        },
        warnings=table.warnings,
    )


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
