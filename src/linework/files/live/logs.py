"""The navigation logs of a survey while they grow, and the survey's clock by them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from linework.arrays import FloatArray
from linework.errors import ConfigError, InputError
from linework.files.geodetic import EarthFrame, project_places
from linework.files.live.growing import GrowingTable
from linework.files.logs.gnss import DEGREE_COLUMNS, GRID_COLUMNS, SIGMA_COLUMNS, is_gnss_file
from linework.files.logs.sensors import front_wheelbase_m
from linework.model.logs import GnssLog, GyroLog, NavigationLogs, WheelLog
from linework.model.survey import Survey

_TICKS, _SPEED, _TILT = ("left_ticks", "right_ticks"), ("speed_mps",), ("roll_deg", "pitch_deg")
#: Part of a log that is read where `linework live` is started in the middle of a drive: three minutes at 100 Hz with
#: lines of 100 bytes, enough for a heading and the noise of the sensors. [bytes]
_LAST_BYTES = 2_000_000


@dataclass(frozen=True, slots=True)
class NewReadings:
    """Readings that were appended to the logs, and lines that could not be used, by the name of the file."""

    gnss: GnssLog | None = None
    gyro: GyroLog | None = None
    wheels: WheelLog | None = None
    bad: tuple[tuple[str, int], ...] = ()

    def newest_s(self) -> dict[str, float]:
        """Return the time of the newest reading of each log that has new ones. [s]."""
        logs = {"gnss": self.gnss, "gyro": self.gyro, "wheels": self.wheels}
        return {name: float(log.time_s[-1]) for name, log in logs.items() if log is not None and len(log)}


class GrowingLogs:
    """The logs that [navigation] names, read as they are appended to.

    Parameters
    ----------
    survey
        Its logs may be missing still.

    Raises
    ------
    ConfigError
        There is no GNSS log, or neither gyro nor wheels, or the GNSS log is not CSV.

    Notes
    -----
    All logs must have one clock, and seconds; `linework locate` also mends other clocks and units, which takes the
    whole drive.
    """

    def __init__(self, survey: Survey) -> None:
        named = survey.settings.get("navigation", {})
        where = survey.settings_file or survey.root
        if "gnss" not in named or not ({"gyro", "wheels"} & set(named)):
            missing = "gnss" if "gnss" not in named else "gyro or wheels"
            raise ConfigError(f"[navigation] names no {missing}: the van could not be followed", where=where,
                              advice=f"add {missing.split()[0]} = FILE to [navigation]")  # fmt: skip
        self._frame = EarthFrame.of(survey)
        self._tables: dict[str, GrowingTable] = {}
        for name in ("gnss", "gyro", "wheels"):
            if name in named:
                self._tables[name] = _table(name, survey.root / named[name])
        gnss = self._tables["gnss"].path
        if gnss.suffix.lower() in (".nmea", ".pos") or (gnss.is_file() and is_gnss_file(gnss)):
            raise ConfigError(f"{gnss.name} is not CSV: its fixes cannot be read while it grows", where=where,
                              advice="let the receiver's program write CSV; linework extract reads this log")  # fmt: skip
        vehicle = survey.settings.get("vehicle", {})
        x, y, z = (float(v) for v in vehicle.get("gnss_lever_m", (0.0, 0.0, 0.0)))
        known: dict[str, Any] = {key: float(vehicle[key]) for key in ("tick_m", "track_m") if key in vehicle}
        #: The vehicle's measures, without any readings.
        known["wheelbase_m"] = front_wheelbase_m(survey)
        self.vehicle = NavigationLogs(gnss=GnssLog.empty(), gnss_lever_m=(x, y, z), **known)

    @property
    def files(self) -> dict[str, Path]:
        """The logs by their name in [navigation]."""
        return {name: table.path for name, table in self._tables.items()}

    def skip_to_last(self) -> None:
        """Leave out all but the last minutes of the logs."""
        for table in self._tables.values():
            table.skip_to_last(_LAST_BYTES)

    def readings(self) -> NewReadings:
        """Return the readings that were appended since the last call, each log in time order.

        Raises
        ------
        InputError, CrsError
            A log lacks a column, or its positions cannot be transformed.
        """
        new = NewReadings()
        bad = []
        for name, table in self._tables.items():
            found, n_bad = table.numbers()
            if n_bad:
                bad.append((table.path.name, n_bad))
            if found and len(found["time_s"]):
                found_log: dict[str, Any] = {name: self._log(name, _in_order(found))}
                new = replace(new, **found_log)
        return replace(new, bad=tuple(bad))

    def _log(self, name: str, columns: dict[str, FloatArray]) -> GnssLog | GyroLog | WheelLog:
        time_s = columns["time_s"]
        if name == "gyro":
            tilt = np.stack([columns[c] for c in _TILT], axis=1) if _TILT[0] in columns else None
            return GyroLog(
                time_s, np.radians(columns["yaw_rate_dps"]), None if tilt is None else np.radians(tilt)
            )
        if name == "wheels":
            if _TICKS[0] in columns:
                return WheelLog(time_s, np.stack([columns[c] for c in _TICKS], axis=1))
            return WheelLog(time_s, speed_mps=columns["speed_mps"])
        names = GRID_COLUMNS if GRID_COLUMNS[0] in columns else DEGREE_COLUMNS
        places, sigma = (np.stack([columns[c] for c in group], axis=1) for group in (names, SIGMA_COLUMNS))
        good = (sigma > 0.0).all(axis=1)
        time_s, places, sigma = time_s[good], places[good], sigma[good]
        if names == DEGREE_COLUMNS and len(places):
            places = project_places(places, self._frame, where=self._tables["gnss"].path).xyz
        return GnssLog(time_s, places, sigma)


def _table(name: str, path: Path) -> GrowingTable:
    if name == "gyro":
        return GrowingTable(path, ("time_s", "yaw_rate_dps"), (_TILT,))
    if name == "wheels":
        return GrowingTable(path, ("time_s",), (_TICKS, _SPEED), one_of=True)
    return GrowingTable(path, ("time_s", *SIGMA_COLUMNS), (GRID_COLUMNS, DEGREE_COLUMNS), one_of=True)


def _in_order(columns: dict[str, FloatArray]) -> dict[str, FloatArray]:
    """Return the rows in strictly increasing time, of several at one time the first."""
    _, first = np.unique(columns["time_s"], return_index=True)
    return {name: values[first] for name, values in columns.items()}


class SurveyClock:
    """The survey's time now, by the newest times in its files and when they arrived on this machine's clock.

    Notes
    -----
    A reading arrives some time after it was taken. The least of these delays over the last minute is that of the
    program that writes the log, which is some hundredths of a second where it does not hold lines back.
    """

    #: Time over which the least delay is taken: clocks of computers drift by less than 6 ms in it (100 ppm). [s]
    KEPT_S = 60.0

    def __init__(self) -> None:
        self._seen: list[tuple[float, float]] = []

    def arrived(self, time_s: float, now_s: float) -> None:
        """Take in that a reading of a time [s, survey] was there at a time of this machine [s, monotonic]."""
        self._seen = [(at, ahead) for at, ahead in self._seen if at > now_s - self.KEPT_S]
        ahead = time_s - now_s
        # What is no better than a later one is not needed any more
        self._seen = [(at, known) for at, known in self._seen if known > ahead]
        self._seen.append((now_s, ahead))

    def time_s(self, now_s: float) -> float | None:
        """Return the survey's time at a time of this machine [s, monotonic]; None before anything arrived."""
        return now_s + max(ahead for _, ahead in self._seen) if self._seen else None


def check_readable(logs: GrowingLogs) -> None:
    """Refuse logs whose header does not name what is needed; those without one yet are waited for.

    Raises
    ------
    InputError
        With the missing columns.
    """
    for path in logs.files.values():
        if path.is_dir():
            raise InputError("is a folder, expected a log", where=path, advice="correct [navigation]")
    logs.readings()
