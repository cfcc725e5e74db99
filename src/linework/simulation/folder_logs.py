"""The navigation logs of a simulated survey as part of its folder."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from linework.arrays import FloatArray
from linework.model.logs import GnssLog, GyroLog, NavigationLogs, WheelLog
from linework.simulation.logs import made_logs
from linework.simulation.sensors import GNSS_2_CM, GYROS, SensorGrades, WheelGrade
from linework.simulation.simulate import SimulatedSurvey, drives_of

#: A good van: phase GNSS at 10 Hz, the second best gyro, wheels that are worn differently.
_VAN = SensorGrades(
    gnss=replace(GNSS_2_CM, rate_hz=10.0),
    gyro=replace(GYROS[1], rate_hz=100.0),
    wheels=WheelGrade(scale_left=0.011, scale_right=-0.004, rate_hz=50.0),
)


def survey_logs(survey: SimulatedSurvey) -> NavigationLogs:
    """Return what the van's navigation sensors logged in all passes; between passes they pause."""
    rng = np.random.default_rng([survey.scenario.seed, 61])
    origin = survey.scenario.origin_m
    return joined_logs([made_logs(d, _VAN, rng, origin_m=origin) for d in drives_of(survey.scenario)])


def joined_logs(parts: Sequence[NavigationLogs]) -> NavigationLogs:
    """Return logs one after another; wheels count on."""
    gyros = [p.gyro for p in parts if p.gyro is not None]
    wheels = [p.wheels for p in parts if p.wheels is not None]
    counts: list[FloatArray] = []
    for log in wheels:
        assert log.ticks is not None
        counts.append(log.ticks + (counts[-1][-1] if counts else 0.0))
    return replace(
        parts[0],
        gnss=GnssLog(
            np.concatenate([p.gnss.time_s for p in parts]),
            np.concatenate([p.gnss.xyz for p in parts]),
            np.concatenate([p.gnss.sigma_m for p in parts]),
        ),
        gyro=GyroLog(
            np.concatenate([g.time_s for g in gyros]),
            np.concatenate([g.yaw_rate_radps for g in gyros]),
            np.concatenate([g.roll_pitch_rad for g in gyros if g.roll_pitch_rad is not None]),
        ),
        wheels=WheelLog(np.concatenate([w.time_s for w in wheels]), np.concatenate(counts)),
    )


def write_logs(logs: NavigationLogs, folder: Path) -> str:
    """Write gnss.csv, gyro.csv and wheels.csv; return the tables of the survey.toml that name them."""
    gnss = np.column_stack([logs.gnss.xyz, logs.gnss.sigma_m])
    names = "easting_m,northing_m,height_m,sigma_e_m,sigma_n_m,sigma_z_m"
    _write(folder / "gnss.csv", names, logs.gnss.time_s, gnss, "%.4f")
    settings = '\n[navigation]\ngnss = "gnss.csv"\n'
    if logs.gyro is not None:
        gyro, names = np.degrees(logs.gyro.yaw_rate_radps)[:, None], "yaw_rate_dps"
        if logs.gyro.roll_pitch_rad is not None:
            gyro = np.column_stack([gyro, np.degrees(logs.gyro.roll_pitch_rad)])
            names += ",roll_deg,pitch_deg"
        _write(folder / "gyro.csv", names, logs.gyro.time_s, gyro, "%.6f")
        settings += 'gyro = "gyro.csv"\n'
    if logs.wheels is not None:
        ticks, speed = logs.wheels.ticks, logs.wheels.speed_mps
        if ticks is not None:
            _write(folder / "wheels.csv", "left_ticks,right_ticks", logs.wheels.time_s, ticks, "%.0f")
        elif speed is not None:
            _write(folder / "wheels.csv", "speed_mps", logs.wheels.time_s, speed[:, None], "%.4f")
        settings += 'wheels = "wheels.csv"\n'
    lever = [float(v) for v in logs.gnss_lever_m]
    return (
        settings
        + f"\n[vehicle]\ntick_m = {logs.tick_m!r}\ntrack_m = {logs.track_m!r}\ngnss_lever_m = {lever}\n"
    )


def _write(path: Path, names: str, time_s: FloatArray, values: FloatArray, form: str) -> None:
    rows = np.column_stack([time_s, values])
    formats = ["%.6f", *[form] * values.shape[1]]
    np.savetxt(path, rows, delimiter=",", fmt=formats, header=f"time_s,{names}", comments="")
