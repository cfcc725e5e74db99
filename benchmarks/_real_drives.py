"""Recorded drives: the GNSS is hidden for stretches, and what the filter says there is scored against it."""

import csv

import numpy as np
from pyproj import Transformer

from linework.model.logs import GnssLog, GyroLog, NavigationLogs, WheelLog
from linework.navigation.locate import locate_drive

#: Length of the hidden stretches, and how far apart their starts are. [s]
HIDDEN_S, EVERY_S = (10.0, 30.0, 60.0), 15.0


def report_real(folder):
    for name, logs in (("dresden", dresden(folder)), ("berlin", berlin(folder))):
        whole = locate_drive(logs, rate_hz=10.0)
        print(f"{name}: {whole.distance_m:.0f} m, {len(logs.gnss.time_s)} fixes; {whole.stretches[0].noise}")
        print(f"  {dict(whole.stretches[0].estimates)} {whole.warnings}")
        for length in HIDDEN_S:
            print("  " + hidden(logs, length))


def hidden(logs, length_s):
    """Hide one stretch at a time; return the errors against the hidden fixes."""
    time = logs.gnss.time_s
    starts = np.arange(time[0] + 30.0, time[-1] - length_s - 20.0, EVERY_S)
    largest, ends, ratio, ways = [], [], [], []
    for start in starts:
        gone = (time > start) & (time < start + length_s)
        seen = GnssLog(time[~gone], logs.gnss.xyz[~gone], logs.gnss.sigma_m[~gone])
        located = locate_drive(
            NavigationLogs(gnss=seen, gyro=logs.gyro, wheels=logs.wheels, tick_m=logs.tick_m,
                           track_m=logs.track_m, gnss_lever_m=logs.gnss_lever_m),
            rate_hz=10.0,
        )  # fmt: skip
        known = logs.gnss.xyz[gone]
        off = []
        for poses in (located.trajectory, located.forward):
            at = np.stack([np.interp(time[gone], poses.time_s, c) for c in poses.xyz.T], axis=1)
            off.append(np.hypot(*(at - known)[:, :2].T))
        poses = located.trajectory
        sigma = np.hypot(*[np.interp(time[gone], poses.time_s, c) for c in poses.sigma_xyz_m[:, :2].T])
        sigma = np.hypot(
            sigma, np.hypot(*logs.gnss.sigma_m[gone, :2].T) * located.stretches[0].noise.gnss_factor
        )
        largest.append(off[0].max())
        ends.append(off[1].max())
        ratio.append(np.mean((off[0] / sigma) ** 2))
        ways.append(np.sum(np.hypot(*np.diff(known[:, :2], axis=0).T)))
    largest, ends, ways = np.array(largest), np.array(ends), np.array(ways)
    return (
        f"{length_s:3.0f} s hidden, {len(starts)} times, way {np.median(ways):.0f} m: largest error smoothed "
        f"{np.median(largest):.2f} m (95 %: {np.percentile(largest, 95):.2f}), real time {np.median(ends):.2f} "
        f"({np.percentile(ends, 95):.2f}), gain {np.sqrt(np.mean(largest**2) / np.mean(ends**2)):.2f}, "
        f"of the way {100.0 * np.median(largest / ways):.2f} %, rms(error/sigma) {np.sqrt(np.mean(ratio)):.2f}"
    )


def dresden(folder):
    """A telephone's gyro, speed and GPS (yaw rate positive to the left): a row per gyro reading, fixes repeated until the next."""
    with (folder / "dresden.csv").open() as file:
        rows = list(csv.DictReader(file))
    column = {k: np.array([float(r[k]) for r in rows]) for k in rows[0] if k not in ("date", "time")}
    time = column["millis"] / 1000.0
    time -= time[0]
    new = np.flatnonzero(np.diff(np.array([float(r["time"]) for r in rows]), prepend=-1.0))
    place = Transformer.from_crs("EPSG:4326", "EPSG:25833", always_xy=True)
    east, north = place.transform(column["longitude"][new], column["latitude"][new])
    hdop, vdop = column["hdop"][new], column["vdop"][new]
    # The receiver says epe; one sigma of a code receiver is about 1.5 m times the dilution
    sigma = 1.5 * np.stack([hdop / np.sqrt(2.0), hdop / np.sqrt(2.0), vdop], axis=1)
    gnss = GnssLog(time[new], np.stack([east, north, column["altitude"][new]], axis=1), sigma)
    wheels = WheelLog(time[new], speed_mps=column["speed"][new] / 3.6)
    return NavigationLogs(gnss=gnss, gyro=GyroLog(time, -np.radians(column["yawrate"])), wheels=wheels)


def berlin(folder):
    """Wheel speed and yaw rate of a car (x forward, z up) with a reference in ECEF, taken as GNSS of 2 cm."""
    odometry = np.loadtxt(folder / "berlin_odometry_first140s.txt", usecols=range(1, 8))
    reference = np.loadtxt(folder / "berlin_reference_first140s.txt", usecols=range(1, 5))
    place = Transformer.from_crs("EPSG:4978", "EPSG:32633")
    east, north, up = place.transform(*reference[:, 1:4].T)
    sigma = np.tile([0.02, 0.02, 0.04], (len(reference), 1))
    gnss = GnssLog(reference[:, 0], np.stack([east, north, up], axis=1), sigma)
    return NavigationLogs(
        gnss=gnss,
        gyro=GyroLog(odometry[:, 0], -odometry[:, 6]),
        wheels=WheelLog(odometry[:, 0], speed_mps=odometry[:, 1]),
    )
