"""The path of what carries the scanners: where a vehicle, an aircraft or a tripod is at any time, and how it is turned."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from linework.arrays import FloatArray
from linework.model.trajectory import Trajectory
from linework.simulation.roads.road import Road
from linework.simulation.roads.scenario import Flight, Pass, Station

#: Rate at which poses are computed and reported; between them the van moves 0.1 to 0.2 m and poses are
#: linear to 0.1 mm.
POSE_RATE_HZ = 100.0


@dataclass(frozen=True, slots=True)
class Drive:
    """True poses of one pass, local frame.

    Parameters
    ----------
    time_s
        (n,) [s, GPS adjusted].
    xyz
        (n, 3) [m, local]: origin of the vehicle frame.
    roll_rad, pitch_rad
        (n,): right side down, nose up positive.
    yaw_rad
        (n,): direction of x, anticlockwise from east, without jumps.
    error_m
        (n, 3): what the reported pose, and with it every point, is off by.
    """

    time_s: FloatArray
    xyz: FloatArray
    roll_rad: FloatArray
    pitch_rad: FloatArray
    yaw_rad: FloatArray
    error_m: FloatArray


def drive(road: Road, spec: Pass, length_m: float, rng: np.random.Generator) -> Drive:
    """Return the poses of one pass from end to end, with a slowly wandering offset and speed."""
    s = np.arange(0.0, length_m + 0.05, 0.1)
    wave, phase = rng.uniform(40.0, 150.0, 3), rng.uniform(0.0, 2.0 * np.pi, 3)
    swing = np.sin(2.0 * np.pi * s[:, None] / wave + phase)
    q = spec.q_m + spec.wander_m * (swing[:, 0] + 0.5 * swing[:, 1]) / 1.5
    speed = spec.speed_mps * (1.0 + 0.10 * swing[:, 2])
    if spec.direction < 0:
        s, q, speed = s[::-1], q[::-1], speed[::-1]
    xyz = road.on_ground(s, q)
    step = np.linalg.norm(np.diff(xyz, axis=0), axis=1)
    t = np.concatenate([[0.0], np.cumsum(2.0 * step / (speed[1:] + speed[:-1]))])
    tilt = (road.ground_height(s, q + 0.5) - road.ground_height(s, q - 0.5)) * spec.direction
    d = np.gradient(xyz, axis=0)
    yaw = np.unwrap(np.arctan2(d[:, 1], d[:, 0]))
    pitch = np.arctan2(d[:, 2], np.hypot(d[:, 0], d[:, 1]))
    time = np.arange(0.0, t[-1], 1.0 / POSE_RATE_HZ)
    at = np.stack([np.interp(time, t, column) for column in (*xyz.T, np.arctan(tilt), pitch, yaw)], axis=1)
    # Springs: a fraction of a degree, at body frequencies of about 1 Hz
    sway = 0.003 * np.sin(2.0 * np.pi * time[:, None] * rng.uniform(0.7, 1.6, 2) + rng.uniform(0.0, 6.0, 2))
    drift = np.cos(2.0 * np.pi * time / 60.0 + rng.uniform(0.0, 6.0))
    error = np.asarray(spec.pose_error_m)[None] * (0.8 + 0.2 * drift[:, None])
    return Drive(
        spec.start_time_s + time,
        at[:, :3],
        at[:, 3] + sway[:, 0],
        at[:, 4] + 0.5 * sway[:, 1],
        at[:, 5],
        error,
    )


def reported_trajectory(drives: Sequence[Drive], origin_m: tuple[float, float, float]) -> Trajectory:
    """Return the trajectory as the survey reports it, all passes one after another."""
    attitude = [
        np.stack(
            [np.degrees(d.roll_rad), np.degrees(d.pitch_rad), (90.0 - np.degrees(d.yaw_rad)) % 360.0], axis=1
        )
        for d in drives
    ]
    return Trajectory(
        np.concatenate([d.time_s for d in drives]),
        np.concatenate([d.xyz + d.error_m for d in drives]) + np.asarray(origin_m),
        np.concatenate(attitude),
    )


# Scanners that no vehicle carries


def flown(flight: Flight, rng: np.random.Generator) -> Drive:
    """Return an aircraft's poses: straight on, wandering by metres and swaying over 4 to 20 s."""
    time = np.arange(0.0, flight.length_m / flight.speed_mps, 1.0 / POSE_RATE_HZ)
    period = rng.uniform((40.0, 40.0, 6.0, 4.0, 8.0), (90.0, 90.0, 20.0, 12.0, 20.0))
    wave = np.sin(2.0 * np.pi * time[:, None] / period + rng.uniform(0.0, 2.0 * np.pi, 5))
    along, across = flight.speed_mps * time, 3.0 * wave[:, 0]
    cos, sin = np.cos(flight.heading_rad), np.sin(flight.heading_rad)
    way = np.stack([cos * along - sin * across, sin * along + cos * across, 2.0 * wave[:, 1]], axis=1)
    return Drive(
        flight.start_time_s + time,
        np.asarray(flight.start_m) + way,
        flight.sway_rad * wave[:, 2],
        0.5 * flight.sway_rad * wave[:, 3],
        flight.heading_rad + flight.sway_rad * wave[:, 4],
        np.broadcast_to(np.asarray(flight.pose_error_m), way.shape),
    )


def stood(station: Station) -> Drive:
    """Return a tripod's pose, from when its scan begins to its end."""
    still, twice = np.zeros(2), np.ones((2, 1))
    return Drive(
        station.start_time_s + np.array([0.0, station.duration_s]),
        twice * np.asarray(station.place_m),
        still,
        still,
        still + station.yaw_rad,
        twice * np.asarray(station.pose_error_m),
    )
