"""Drives of minutes without a scene: speed, bends, grades and sway, exact to the integration at 100 Hz."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from linework.arrays import FloatArray
from linework.simulation.sensors.drive import POSE_RATE_HZ, Drive

_GRID_M = 0.5


@dataclass(frozen=True, slots=True)
class DriveKind:
    """How a van drives on one kind of road.

    Parameters
    ----------
    speed_mps
        Range of cruising speeds.
    leg_m
        Range of lengths between one event (turn, bend, stop) and the next.
    turn_share
        Share of the events that are turns at junctions, by 90 degrees.
    stop_share
        Share of the events that are stops of 3 to 30 s.
    radius_m
        Range of radii of all other bends.
    bend_deg
        They turn by up to this.
    accel_mps2
        Pulling away and braking.
    grade
        Largest slope. [m/m]
    turn_m
        Range of radii of turns at junctions.
    """

    speed_mps: tuple[float, float]
    leg_m: tuple[float, float]
    turn_share: float
    stop_share: float
    radius_m: tuple[float, float]
    bend_deg: float
    accel_mps2: float
    grade: float
    turn_m: tuple[float, float] = (8.0, 15.0)


URBAN = DriveKind((8.3, 13.9), (60.0, 300.0), 0.4, 0.3, (30.0, 150.0), 60.0, 1.5, 0.06)
MOTORWAY = DriveKind((27.8, 36.1), (300.0, 1500.0), 0.0, 0.0, (900.0, 4000.0), 60.0, 0.8, 0.04)


def long_drive(kind: DriveKind, duration_s: float, rng: np.random.Generator) -> Drive:
    """Return a drive that starts with 5 s at rest, local frame, time from 0.

    Notes
    -----
    Over the way driven, curvature and slope change linearly (clothoids, parabolic crests). Heights and plan
    follow from speed, slope and curvature by the midpoint rule at 100 Hz, so that what wheels and gyros
    measure between two poses is exactly what these poses differ by.
    """
    length = duration_s * kind.speed_mps[1]
    s = np.arange(0.0, length, _GRID_M)
    curvature, limit, stops = _events(kind, s, rng)
    slope = _wandering(s, 2.0 * kind.grade / 0.06 * 150.0, rng) * kind.grade
    t, v = _timetable(s, limit, stops, kind.accel_mps2, rng)
    time = np.arange(0.0, duration_s, 1.0 / POSE_RATE_HZ)
    way = _way_at(time, t, s, v)
    middle = 0.5 * (way[1:] + way[:-1])
    pitch, yaw_change = np.arctan(np.interp(middle, s, slope)), np.interp(middle, s, curvature)
    step = np.diff(way)
    yaw = rng.uniform(-np.pi, np.pi) + np.concatenate([[0.0], np.cumsum(yaw_change * step)])
    middle_yaw = 0.5 * (yaw[1:] + yaw[:-1])
    steps = step[:, None] * np.stack(
        [np.cos(pitch) * np.cos(middle_yaw), np.cos(pitch) * np.sin(middle_yaw), np.sin(pitch)], axis=1
    )
    xyz = np.concatenate([np.zeros((1, 3)), np.cumsum(steps, axis=0)])
    roll, body_pitch = _attitude(time, way, s, slope, curvature, rng)
    return Drive(time, xyz, roll, body_pitch, yaw, np.zeros_like(xyz))


def _events(
    kind: DriveKind, s: FloatArray, rng: np.random.Generator
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return curvature (left positive) and speed limit over the distance driven, and where the van stops."""
    curvature = np.zeros_like(s)
    limit = np.full_like(s, rng.uniform(*kind.speed_mps))
    stops = []
    at = rng.uniform(*kind.leg_m)
    while at < s[-1]:
        limit[s >= at] = rng.uniform(*kind.speed_mps)
        what, side = rng.random(), rng.choice([-1.0, 1.0])
        if what < kind.stop_share:
            stops.append(at)
            at += rng.uniform(*kind.leg_m)
            continue
        is_turn = what < kind.stop_share + kind.turn_share
        radius = rng.uniform(*kind.turn_m) if is_turn else rng.uniform(*kind.radius_m)
        angle = np.pi / 2.0 if is_turn else np.radians(rng.uniform(0.2, 1.0) * kind.bend_deg)
        # Clothoid in, arc, clothoid out; together they turn by the angle
        ramp = min(radius * angle / 2.0, max(4.0, 0.3 * radius))
        end = at + radius * angle + ramp
        knots = [at, at + ramp, end - ramp, end]
        curvature += side * np.interp(s, knots, [0.0, 1.0 / radius, 1.0 / radius, 0.0])
        inside = (s >= at) & (s <= end)
        limit[inside] = np.minimum(limit[inside], np.sqrt(2.0 * radius))
        at = end + rng.uniform(*kind.leg_m)
    return curvature, limit, np.asarray(stops)


def _timetable(
    s: FloatArray, limit: FloatArray, stops: FloatArray, accel: float, rng: np.random.Generator
) -> tuple[FloatArray, FloatArray]:
    """Return when the van is at each place of `s`, and how fast; it stands there at starts and stops."""
    square = limit**2 * (1.0 + 0.1 * _wandering(s, 200.0, rng))
    square[0] = 0.0
    is_stop = np.zeros(len(s), dtype=bool)
    is_stop[np.searchsorted(s, stops)] = True
    square[is_stop] = 0.0
    for i in range(1, len(s)):
        square[i] = min(square[i], square[i - 1] + 2.0 * accel * _GRID_M)
    for i in range(len(s) - 2, -1, -1):
        square[i] = min(square[i], square[i + 1] + 2.0 * accel * _GRID_M)
    v = np.sqrt(square)
    waiting = np.where(is_stop, rng.uniform(3.0, 30.0, len(s)), 0.0)
    waiting[0] = 5.0
    t = np.concatenate([[0.0], np.cumsum(2.0 * _GRID_M / (v[1:] + v[:-1]) + waiting[:-1])])
    # The van leaves after it has waited
    return t + waiting, v


def _way_at(time: FloatArray, leaving: FloatArray, s: FloatArray, v: FloatArray) -> FloatArray:
    """Return how far the van has come at any time: constant acceleration between the places of the timetable."""
    i = np.clip(np.searchsorted(leaving, time, side="right") - 1, 0, len(s) - 2)
    accel = (v[i + 1] ** 2 - v[i] ** 2) / (2.0 * _GRID_M)
    after = np.clip(time - leaving[i], 0.0, 2.0 * _GRID_M / (v[i + 1] + v[i]))
    way = np.minimum(s[i] + v[i] * after + 0.5 * accel * after**2, s[i + 1])
    return np.where(time < leaving[0], 0.0, way)


def _attitude(
    time: FloatArray,
    way: FloatArray,
    s: FloatArray,
    slope: FloatArray,
    curvature: FloatArray,
    rng: np.random.Generator,
) -> tuple[FloatArray, FloatArray]:
    """Return roll and pitch of the body: crossfall and slope, and what springs add."""
    speed = np.gradient(way, time)
    accel = np.gradient(speed, time)
    across = speed**2 * np.interp(way, s, curvature)
    # A fraction of a degree, at body frequencies of about 1 Hz, and only while rolling
    rate, phase = rng.uniform(0.7, 1.6, 2), rng.uniform(0.0, 6.0, 2)
    sway = np.clip(speed, 0.0, 1.0)[:, None] * np.sin(2.0 * np.pi * time[:, None] * rate + phase)
    roll = 0.02 * _wandering(way, 300.0, rng) + 0.005 * across + 0.003 * sway[:, 0]
    pitch = np.arctan(np.interp(way, s, slope)) + 0.003 * accel + 0.0015 * sway[:, 1]
    return np.asarray(roll), np.asarray(pitch)


def _wandering(x: FloatArray, wave: float, rng: np.random.Generator) -> FloatArray:
    """Return a smooth value between -1 and 1 that changes over about `wave`."""
    knots = np.arange(x.min() - wave, x.max() + 2.0 * wave, 0.5 * wave)
    raw = np.interp(x, knots, rng.uniform(-1.0, 1.0, len(knots)))
    width = max(int(0.5 * wave / max(np.median(np.diff(x)), 1e-3)), 1)
    if width >= len(x) or width < 2:
        return np.asarray(raw)
    padded = np.pad(raw, (width // 2, width - 1 - width // 2), mode="edge")
    total = np.concatenate([[0.0], np.cumsum(padded)])
    return np.asarray((total[width:] - total[:-width]) / width)
