"""Read trajectories of all formats, recognised by suffix and content; write them as CSV."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from linework.arrays import FloatArray
from linework.crs import LOCAL
from linework.errors import InputError, MachineError
from linework.files.geodetic import EarthFrame
from linework.files.images.lists import read_times
from linework.files.logs.clock import in_seconds
from linework.files.logs.gnss import is_gnss_file, read_gnss
from linework.files.logs.tables import header_cells, read_table, write_table
from linework.files.logs.text import TextBlock, text_blocks
from linework.files.output.publish import publish
from linework.files.trajectories.content import TrajectoryContent, ordered_content
from linework.files.trajectories.kitti_poses import read_kitti_poses_content
from linework.files.trajectories.oxts import read_oxts_content
from linework.files.trajectories.sbet import read_sbet_content
from linework.files.trajectories.tum import read_tum_content
from linework.model.trajectory import Trajectory

_POSITION = ("time_s", "easting_m", "northing_m", "height_m")
_ATTITUDE = ("roll_deg", "pitch_deg", "heading_deg")
_SIGMA = ("sigma_e_m", "sigma_n_m", "sigma_z_m")
_HEADING_ALONE = "{path}: headings without roll and pitch are not used; images need all three"
_SIGMA_ATTITUDE = ("sigma_roll_deg", "sigma_pitch_deg", "sigma_heading_deg")


@dataclass(frozen=True, slots=True, kw_only=True)
class TrajectorySettings:
    """Settings for reading a trajectory.

    Parameters
    ----------
    frame
        CRS and heights that latitudes, longitudes and ellipsoidal heights are converted to.
    times_file, rate_hz
        Times of the poses of a KITTI poses.txt: a file, or a rate from 0 s; without both, the times.txt beside it.
    """

    frame: EarthFrame = EarthFrame(crs=LOCAL)
    times_file: Path | None = None
    rate_hz: float | None = None


def read_trajectory_content(path: Path, settings: TrajectorySettings | None = None) -> TrajectoryContent:
    """Read a trajectory of any format: CSV, SBET, KITTI's OXTS folder and poses, TUM, GNSS fixes.

    Rows are put in time order (stable); of rows with equal time the first is kept, the others counted.

    Raises
    ------
    InputError
        Unknown format, columns missing, lines that are not numbers (with the line), fewer than two positions.
    CrsError, ConfigError
        Latitudes and longitudes that cannot be transformed into the CRS.
    """
    settings = settings or TrajectorySettings()
    if path.is_dir():
        return read_oxts_content(path, settings.frame)
    if path.suffix.lower() in (".out", ".sbet"):
        return read_sbet_content(path, settings.frame)
    kind = _kind_of_text(path)
    if kind == "gnss":
        fixes = read_gnss(path, settings.frame)
        log = fixes.log
        lines = np.arange(1, len(log.time_s) + 1, dtype=np.float64)
        columns = {"xyz": log.xyz, "attitude_deg": None, "sigma_xyz_m": log.sigma_m}
        return ordered_content(
            path, log.time_s, lines, columns, warnings=fixes.warnings, epoch=fixes.epoch, unit="fix"
        )
    if kind == "tum":
        return read_tum_content(path)
    if kind == "kitti":
        return read_kitti_poses_content(path, _times_of_poses(path, settings))
    return _read_csv(path)


def _kind_of_text(path: Path) -> str:
    """Return the format of a text file by its first line of content: "gnss", "tum", "kitti" or "csv"."""
    if path.suffix.lower() == ".csv":
        return "csv"
    if is_gnss_file(path):
        return "gnss"
    for _, line in next(text_blocks(path), TextBlock(b"", 1)).lines():
        cells = line.split()
        if cells and not cells[0].startswith("#"):
            return {8: "tum", 12: "kitti"}.get(len(cells), "csv") if "," not in line else "csv"
    return "csv"


def _times_of_poses(path: Path, settings: TrajectorySettings) -> FloatArray:
    times_file = settings.times_file
    if times_file is None and settings.rate_hz is None:
        times_file = path.parent / "times.txt"
        if not times_file.is_file():
            raise InputError("poses without times", where=path,
                             advice="add [trajectory] times (a file) or rate_hz")  # fmt: skip
    if times_file is None:
        n_lines = sum(block.n_lines for block in text_blocks(path))
        return np.arange(n_lines) / float(settings.rate_hz or 1.0)
    return read_times(times_file)[0]


def _read_csv(path: Path) -> TrajectoryContent:
    """Read a CSV with ``time_s,easting_m,northing_m,height_m`` and, if there, attitudes and sigmas."""
    header, _ = next(text_blocks(path), TextBlock(b"", 1)).without_first_line()
    there = set(header_cells(header)[1])
    # Two antennas, or a compass: a heading alone is not an attitude, which images need
    is_heading_alone = "heading_deg" in there and not there & {"roll_deg", "pitch_deg"}
    groups = (_SIGMA,) if is_heading_alone else (_ATTITUDE, _SIGMA, _SIGMA_ATTITUDE)
    table = read_table(path, _POSITION, groups)
    columns = table.columns
    time_s, remarks = in_seconds(columns["time_s"], path)

    def group(names: tuple[str, ...]) -> FloatArray | None:
        return np.stack([columns[name] for name in names], axis=1) if names[0] in columns else None

    return ordered_content(
        path,
        time_s,
        table.line_numbers,
        {
            "xyz": group(_POSITION[1:]),
            "attitude_deg": group(_ATTITUDE),
            "sigma_xyz_m": group(_SIGMA),
            "sigma_attitude_deg": group(_SIGMA_ATTITUDE),
        },
        warnings=(
            *table.warnings,
            *remarks,
            *([_HEADING_ALONE.format(path=path)] if is_heading_alone else ()),
        ),
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
        write_table(part, names, rows)

    def verify(part: Path) -> None:
        back = np.loadtxt(part, delimiter=",", skiprows=1, ndmin=2)
        if not np.array_equal(back.reshape(-1, len(names)), rows):
            raise MachineError(
                "written file does not read back the same", where=path, advice="check the disk"
            )

    publish(path, write, verify, overwrite=overwrite)
