"""Read the navigation logs that a survey.toml names: GNSS, gyro and wheels."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from linework.errors import ConfigError, InputError
from linework.files.geodetic import EarthFrame
from linework.files.logs.base import less_base_errors
from linework.files.logs.clock import epoch_by_values, fitted_times, in_seconds, in_time_order, to_survey_time
from linework.files.logs.fixes import GnssContent
from linework.files.logs.gnss import read_gnss
from linework.files.logs.tables import NumberTable, read_table
from linework.model.logs import GnssLog, GyroLog, NavigationLogs, WheelLog
from linework.model.survey import Survey

_TICKS = ("left_ticks", "right_ticks")
_TILT = ("roll_deg", "pitch_deg")
_Log = TypeVar("_Log", GyroLog, WheelLog)


@dataclass(frozen=True, slots=True)
class NavigationContent:
    """The logs of a drive as read, and warnings about the files."""

    logs: NavigationLogs
    warnings: tuple[str, ...] = ()


def read_navigation_logs(survey: Survey) -> NavigationContent:
    """Read the logs named in [navigation]; the vehicle's measures come from [vehicle].

    Columns of the CSV files: see the manual. Rows are put in time order, each time once; lines without numbers are
    left out and counted. Values stay as logged: the filter handles counters that wrap, clocks that jump and outlying
    fixes.

    Raises
    ------
    ConfigError
        The survey names no GNSS log, or counts the front wheels of a vehicle without a wheelbase.
    InputError
        A file cannot be used; with its name and the line.
    """
    named = survey.settings.get("navigation", {})
    if "gnss" not in named:
        raise ConfigError("no GNSS log: [navigation] names none", where=survey.root,
                          advice='add [navigation] gnss = "FILE" to the survey.toml')  # fmt: skip
    gnss = less_base_errors(read_gnss(survey.root / named["gnss"], EarthFrame.of(survey)), survey)
    warnings = [f"{Path(named['gnss']).name}: {text}" for text in gnss.warnings]
    gyro, wheels = None, None
    if "gyro" in named:
        gyro, remarks = _read_gyro(survey.root / named["gyro"])
        warnings += remarks
    if "wheels" in named:
        wheels, remarks = _read_wheels(survey.root / named["wheels"])
        warnings += remarks
    # One clock for all
    time = survey.settings.get("time", {})
    fixes, epoch = _on_the_surveys_clock(gnss, time, gyro or wheels)
    gyro, remarks = _on_the_clock_of(fixes, epoch, gyro, named.get("gyro", ""), survey)
    wheels, more = _on_the_clock_of(fixes, epoch, wheels, named.get("wheels", ""), survey)
    vehicle = survey.settings.get("vehicle", {})
    x, y, z = (float(v) for v in vehicle.get("gnss_lever_m", (0.0, 0.0, 0.0)))
    known = {key: float(vehicle[key]) for key in ("tick_m", "track_m") if key in vehicle}
    known["wheelbase_m"] = front_wheelbase_m(survey)
    logs = NavigationLogs(gnss=fixes, gyro=gyro, wheels=wheels, gnss_lever_m=(x, y, z), **known)
    return NavigationContent(logs, (*warnings, *remarks, *more))


def front_wheelbase_m(survey: Survey) -> float:
    """Return the wheelbase where the front wheels are counted [m], 0 where the rear wheels are."""
    vehicle = survey.settings.get("vehicle", {})
    if vehicle.get("axle", "rear") == "rear":
        return 0.0
    if "wheelbase_m" not in vehicle:
        raise ConfigError('vehicle.axle is "front", but there is no wheelbase_m', where=survey.settings_file or survey.root,
                          advice="add the distance of the axles in metres: [vehicle] wheelbase_m = 3.2")  # fmt: skip
    return float(vehicle["wheelbase_m"])


def _on_the_surveys_clock(
    gnss: GnssContent, time: Mapping[str, Any], other: GyroLog | WheelLog | None
) -> tuple[GnssLog, str]:
    """Return the fixes in the epoch of [time], else of the other logs, else in adjusted GPS seconds; and that epoch.

    Fixes of a file that does not state its epoch stay unchanged.
    """
    stated = str(time.get("epoch", ""))
    if not gnss.epoch:
        return gnss.log, stated
    epoch = stated or (epoch_by_values(other.time_s) if other is not None else "gps_adjusted")
    near_s = None if other is None else float(other.time_s[0])
    if gnss.epoch == "utc_day" and near_s is None:
        return gnss.log, stated
    time_s = to_survey_time(gnss.log.time_s, gnss.epoch, epoch, week=time.get("week"), near_s=near_s)
    return replace(gnss.log, time_s=time_s), epoch


def _on_the_clock_of(
    gnss: GnssLog, epoch: str, log: _Log | None, name: str, survey: Survey
) -> tuple[_Log | None, list[str]]:
    """Return a log in the epoch of the fixes, and warnings.

    Raises
    ------
    InputError
        No common time; with both intervals.
    """
    if log is None:
        return None, []
    span = float(gnss.time_s[0]), float(gnss.time_s[-1])
    stated = survey.settings.get("time", {})
    time_s, remarks = fitted_times(
        log.time_s, str(stated.get("epoch", "")), span, epoch, week=stated.get("week")
    )
    start, end = float(time_s[0]), float(time_s[-1])
    if start > span[1] or end < span[0]:
        raise InputError(
            f"from {start:.1f} to {end:.1f} s, the GNSS fixes from {span[0]:.1f} to {span[1]:.1f} s: no common time",
            where=survey.root / name, advice="check the epochs ([time] epoch)",
        )  # fmt: skip
    return replace(log, time_s=time_s), [f"{Path(name).name}: {text}" for text in remarks]


def _read_gyro(path: Path) -> tuple[GyroLog, list[str]]:
    """Read ``time_s,yaw_rate_dps[,roll_deg,pitch_deg]``."""
    table, remarks = _in_order(read_table(path, ("time_s", "yaw_rate_dps"), (_TILT,)), path)
    columns = table.columns
    tilt = None
    if _TILT[0] in columns:
        tilt = np.radians(np.stack([columns[name] for name in _TILT], axis=1))
    return GyroLog(columns["time_s"], np.radians(columns["yaw_rate_dps"]), tilt), remarks


def _read_wheels(path: Path) -> tuple[WheelLog, list[str]]:
    """Read ``time_s,left_ticks,right_ticks`` or ``time_s,speed_mps``."""
    table, remarks = _in_order(read_table(path, ("time_s",), (_TICKS, ("speed_mps",)), one_of=True), path)
    columns = table.columns
    if _TICKS[0] in columns:
        return WheelLog(columns["time_s"], np.stack([columns[name] for name in _TICKS], axis=1)), remarks
    return WheelLog(columns["time_s"], speed_mps=columns["speed_mps"]), remarks


def _in_order(table: NumberTable, path: Path) -> tuple[NumberTable, list[str]]:
    """Return the rows of a table in strictly increasing time, and the warnings with the file's name."""
    time_s, odd = in_seconds(table.columns["time_s"], path)
    kept, remarks = in_time_order(time_s, table.line_numbers)
    columns = {name: values[kept] for name, values in {**table.columns, "time_s": time_s}.items()}
    warnings = [f"{path.name}: {text}" for text in (*table.warnings, *odd, *remarks)]
    return NumberTable(columns, table.line_numbers[kept]), warnings
