"""Write a simulated survey as a survey folder: survey.toml, points, trajectory, images, truth."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from linework.arrays import AnyArray, FloatArray
from linework.errors import MachineError
from linework.files.images.read import write_grey_png
from linework.files.las.header import read_las_header
from linework.files.las.write import write_las
from linework.files.output.publish import publish_folder
from linework.files.survey.calibration import cameras_text, table_of_camera
from linework.files.trajectories.read import write_trajectory
from linework.files.vectors.read_write import write_lines
from linework.model.camera import StereoRig
from linework.model.lines import KINDS
from linework.model.logs import GnssLog, GyroLog, NavigationLogs, WheelLog
from linework.simulation.sensors.cameras import StereoDrive, images_of, observed_in_images
from linework.simulation.sensors.logs import GNSS_2_CM, GYROS, SensorGrades, WheelGrade, simulate_logs
from linework.simulation.simulate import SIMULATED_CRS, SimulatedSurvey, drives_of


def write_survey_folder(
    survey: SimulatedSurvey,
    folder: Path,
    *,
    overwrite: bool = False,
    cameras: StereoDrive | None = None,
    counts_front: bool = False,
    advance: Callable[[int, int], None] | None = None,
) -> None:
    """Write the survey; the folder appears whole or not at all.

    Parameters
    ----------
    survey
        From `simulate_survey`.
    folder
        New, empty, or with `overwrite` one whose files of the same names are replaced.
    cameras
        What takes stereo images along the way, from `stereo_survey`; None: no images.
    counts_front
        Whether the front wheels are counted.
    advance
        Told how many pairs of images are drawn, and how many there are.

    Raises
    ------
    OutputExistsError
        The folder is not empty and `overwrite` is not set.
    MachineError
        The disk is full, the place is read-only, or what was written does not read back.
    """
    parts = _per_strip(survey)

    def write(part: Path) -> None:
        (part / "points").mkdir()
        bits = survey.scenario.sensor.intensity_bits
        for i, index in enumerate(parts):
            target = part / "points" / f"{_strip_name(survey)}_{i + 1}.laz"
            write_las(survey.points.take(index), target, crs=survey.crs, intensity_bits=bits)
        if survey.trajectory is not None:
            write_trajectory(survey.trajectory, part / "trajectory.csv")
        # A layer for every kind, also where the survey has none of it
        write_lines(survey.truth, part / "truth.gpkg", kinds=KINDS)
        settings = _survey_toml(survey, len(parts))
        if survey.scenario.is_driven:
            settings += write_logs(survey_logs(survey, counts_front=counts_front), part)
        if cameras is not None:
            write_images(cameras, part, advance)
            seen = observed_in_images(survey.truth, cameras)
            write_lines(survey.truth.with_columns(observed=seen), part / "truth_images.gpkg", kinds=KINDS)
            settings += cameras_toml(cameras.rig)
        (part / "survey.toml").write_text(settings, encoding="utf-8", newline="\n")

    def verify(part: Path) -> None:
        held = sum(read_las_header(p).n_points for p in sorted((part / "points").glob("*.laz")))
        if held != len(survey.points):
            raise MachineError(f"{held} of {len(survey.points)} points were written", where=folder)

    publish_folder(folder, write, verify, overwrite=overwrite)


def _per_strip(survey: SimulatedSurvey) -> list[AnyArray]:
    """Return the points of each pass, flight strip or station, in time order."""
    scenario = survey.scenario
    n = len(scenario.flights or scenario.stations or scenario.passes)
    return [np.flatnonzero(survey.strip == i) for i in range(n)]


def _strip_name(survey: SimulatedSurvey) -> str:
    scenario = survey.scenario
    return "strip" if scenario.flights else "station" if scenario.stations else "pass"


def _survey_toml(survey: SimulatedSurvey, n_strips: int) -> str:
    scenario = survey.scenario
    made_with = f", scanner {scenario.scanner}" if scenario.scanner != "default" else ""
    made_with += ", hard conditions" if scenario.conditions is not None else ""
    made_with += ", holes" if scenario.holes_m else ""
    # By name: a pass that an older survey of more passes left in the folder is not taken for ours
    files = ", ".join(f'"points/{_strip_name(survey)}_{i + 1}.laz"' for i in range(n_strips))
    trajectory = '\n[trajectory]\nfile = "trajectory.csv"\n' if survey.trajectory is not None else ""
    return f"""\
# Simulated by linework: road "{scenario.kind}", seed {scenario.seed}, {scenario.length_m:g} m{made_with}; no real place.
name = "simulated {scenario.kind} {scenario.seed}"
crs = "{SIMULATED_CRS}"

[time]
epoch = "gps_adjusted"

[points]
files = [{files}]
{trajectory}"""


# The stereo images of a simulated survey as part of its folder


def write_images(drive: StereoDrive, folder: Path, advance: Callable[[int, int], None] | None = None) -> None:
    """Write left/000000.png and so on, the same for right, and the lists left.csv and right.csv.

    Parameters
    ----------
    advance
        Told how many pairs are written, and how many there are.
    """
    lists = {"left": ["file,time_s"], "right": ["file,time_s"]}
    for side in lists:
        (folder / side).mkdir()
    for pair in images_of(drive):
        for side, image in (("left", pair.left), ("right", pair.right)):
            name = f"{side}/{pair.number:06d}.png"
            write_grey_png(image, folder / name)
            lists[side].append(f"{name},{pair.time_s:.6f}")
        if advance:
            advance(pair.number + 1, len(drive))
    for side, lines in lists.items():
        (folder / f"{side}.csv").write_text("\n".join(lines) + "\n", encoding="utf-8", newline="\n")


def cameras_toml(rig: StereoRig) -> str:
    """Return the tables [cameras.left] and [cameras.right] of a survey.toml."""
    sides = (("left", rig.left), ("right", rig.right))
    return cameras_text(
        {side: {"images": f"{side}.csv", **table_of_camera(camera)} for side, camera in sides}
    )


# The navigation logs of a simulated survey as part of its folder


def van_grades() -> SensorGrades:
    """Return the sensors of a good van: phase GNSS at 10 Hz, the second best gyro, wheels that are worn differently."""
    return SensorGrades(
        gnss=replace(GNSS_2_CM, rate_hz=10.0),
        gyro=replace(GYROS[1], rate_hz=100.0),
        wheels=WheelGrade(scale_left=0.011, scale_right=-0.004, rate_hz=50.0),
    )


def survey_logs(survey: SimulatedSurvey, *, counts_front: bool = False) -> NavigationLogs:
    """Return what the van's navigation sensors logged in all passes; between passes they pause."""
    rng = np.random.default_rng([survey.scenario.seed, 61])
    van = replace(van_grades(), counts_front=counts_front)
    origin = survey.scenario.origin_m
    return joined_logs([simulate_logs(d, van, rng, origin_m=origin) for d in drives_of(survey.scenario)])


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
    settings += f"\n[vehicle]\ntick_m = {logs.tick_m!r}\ntrack_m = {logs.track_m!r}\n"
    if logs.wheelbase_m:
        settings += f'axle = "front"\nwheelbase_m = {logs.wheelbase_m!r}\n'
    return settings + f"gnss_lever_m = {lever}\n"


def _write(path: Path, names: str, time_s: FloatArray, values: FloatArray, form: str) -> None:
    rows = np.column_stack([time_s, values])
    formats = ["%.6f", *[form] * values.shape[1]]
    np.savetxt(path, rows, delimiter=",", fmt=formats, header=f"time_s,{names}", comments="")
