"""Read what the van's navigation sensors logged: GNSS, gyro and wheel files named in a survey.toml."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from linework.errors import ConfigError
from linework.files.geodetic import EarthFrame
from linework.files.gnss_logs import read_gnss
from linework.files.tables import Table, read_table
from linework.files.time_order import in_time_order
from linework.model.logs import GyroLog, NavigationLogs, WheelLog
from linework.model.survey import Survey

_TICKS = ("left_ticks", "right_ticks")
_TILT = ("roll_deg", "pitch_deg")


@dataclass(frozen=True, slots=True)
class NavigationContent:
    """The logs of a drive as read, with what was odd about the files."""

    logs: NavigationLogs
    warnings: tuple[str, ...] = ()


def read_navigation_logs(survey: Survey) -> NavigationContent:
    """Read the files that [navigation] names; what is known of the vehicle comes from [vehicle].

    Columns of the CSV files: see the manual. Rows are put in time order, each time once; lines that are no
    numbers are left out and counted. The values stay as logged: counters that wrap, clocks that jump and
    fixes that lie far off are the filter's.

    Raises
    ------
    ConfigError
        The survey names no GNSS log.
    InputError
        A file cannot be used: with its name and the line.
    """
    named = survey.settings.get("navigation", {})
    if "gnss" not in named:
        raise ConfigError("no GNSS log: [navigation] names none", where=survey.root,
                          advice='add [navigation] gnss = "FILE" to the survey.toml')  # fmt: skip
    gnss = read_gnss(survey.root / named["gnss"], EarthFrame.of(survey))
    warnings = [f"{Path(named['gnss']).name}: {text}" for text in gnss.warnings]
    gyro, wheels = None, None
    if "gyro" in named:
        gyro, said = _read_gyro(survey.root / named["gyro"])
        warnings += said
    if "wheels" in named:
        wheels, said = _read_wheels(survey.root / named["wheels"])
        warnings += said
    vehicle = survey.settings.get("vehicle", {})
    x, y, z = (float(v) for v in vehicle.get("gnss_lever_m", (0.0, 0.0, 0.0)))
    known = {key: float(vehicle[key]) for key in ("tick_m", "track_m") if key in vehicle}
    logs = NavigationLogs(gnss=gnss.log, gyro=gyro, wheels=wheels, gnss_lever_m=(x, y, z), **known)
    return NavigationContent(logs, tuple(warnings))


def _read_gyro(path: Path) -> tuple[GyroLog, list[str]]:
    """Read ``time_s,yaw_rate_dps[,roll_deg,pitch_deg]``."""
    table, said = _in_order(read_table(path, ("time_s", "yaw_rate_dps"), (_TILT,)), path)
    columns = table.columns
    tilt = None
    if _TILT[0] in columns:
        tilt = np.radians(np.stack([columns[name] for name in _TILT], axis=1))
    return GyroLog(columns["time_s"], np.radians(columns["yaw_rate_dps"]), tilt), said


def _read_wheels(path: Path) -> tuple[WheelLog, list[str]]:
    """Read ``time_s,left_ticks,right_ticks`` or ``time_s,speed_mps``."""
    table, said = _in_order(read_table(path, ("time_s",), (_TICKS, ("speed_mps",)), one_of=True), path)
    columns = table.columns
    if _TICKS[0] in columns:
        return WheelLog(columns["time_s"], np.stack([columns[name] for name in _TICKS], axis=1)), said
    return WheelLog(columns["time_s"], speed_mps=columns["speed_mps"]), said


def _in_order(table: Table, path: Path) -> tuple[Table, list[str]]:
    """Return the rows of a table in strictly increasing time, and the warnings with the file's name."""
    kept, said = in_time_order(table.columns["time_s"], table.line_numbers)
    columns = {name: values[kept] for name, values in table.columns.items()}
    warnings = [f"{path.name}: {text}" for text in (*table.warnings, *said)]
    return Table(columns, table.line_numbers[kept]), warnings
