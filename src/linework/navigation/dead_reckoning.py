"""Dead reckoning: turn rates of the gyro and distances of the wheels, integrated between any two times."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from linework.arrays import BoolArray, FloatArray
from linework.kernels import navigation as kernel
from linework.navigation.front_wheels import rear_steps, turn_by_scale

#: Longest step of the integration; a van turns by less than 2 degrees in it. [s]
_GRID_S = 0.05
#: Slip of the difference of two tyres: a few millimetres per square root of a metre. [m/sqrt(m)]
_SLIP_M = 0.003
#: Relative uncertainty of the track: a twentieth.
_TRACK_SHARE = 0.05
#: Least variance of a turn by the difference of the wheels. [rad2]
_LEAST_TURN_VAR = 1e-8
#: Sideways slip of tyres per acceleration across, 0.1 degree per m/s^2 [rad s2/m], and in straight driving [rad].
_SIDE_SLIP, _SIDE_DRIFT = 0.002, 0.001
#: Pitch of the body beside its axis: sway, 0.1 degree [rad], and squat per acceleration, 0.2 degree per m/s^2 [rad s2/m].
_SWAY, _SQUAT = 0.002, 0.003
#: Acceleration beyond which a step counts as this: differences of counts exaggerate it. [m/s2]
_MOST_ACCEL = 3.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Motion:
    """Valid readings of gyros and wheels, in SI units.

    Parameters
    ----------
    turn_time_s, turn_radps
        (n,) times [s] and turn rates, clockwise [rad/s].
    way_time_s, way_m
        (m,) times [s], and (m, 2) distances of the left and the right wheel [m].
    tilt_rad
        (n, 2) roll and pitch at `turn_time_s`; zeros without a vertical gyro. [rad]
    no_turn, no_way
        (k, 2) spans in which turns or distances are not known. [s]
    at_rest
        (k, 2) spans in which the van stands. [s]
    wheels_turn
        Turns come from the difference of the wheels.
    wheels_apart
        The two wheels are counted separately.
    tick_m, track_m
        Travel per count, 0 without counts, and distance of the wheels. [m]
    wheelbase_m
        From the rear axle to the wheels of `way_m`, where these are the front wheels; 0: they are the rear wheels. [m]
    """

    turn_time_s: FloatArray
    turn_radps: FloatArray
    way_time_s: FloatArray
    way_m: FloatArray
    tilt_rad: FloatArray
    no_turn: FloatArray
    no_way: FloatArray
    at_rest: FloatArray
    wheels_turn: bool = False
    wheels_apart: bool = True
    tick_m: float = 0.0
    track_m: float = 1.5
    wheelbase_m: float = 0.0

    @property
    def span_s(self) -> tuple[float, float]:
        """First and last time covered by both gyro and wheels. [s]."""
        first = max(self.turn_time_s[0], self.way_time_s[0])
        return float(first), float(min(self.turn_time_s[-1], self.way_time_s[-1]))

    @property
    def has_ways(self) -> bool:
        """Whether there are wheels; otherwise distances are only approximate."""
        return not (len(self.no_way) > 0 and np.isinf(self.no_way[0, 0]))

    def between(self, first_s: float, last_s: float) -> Motion:
        """Return the readings between two times [s], both included."""
        turn, way = (
            slice(np.searchsorted(t, first_s), np.searchsorted(t, last_s, side="right"))
            for t in (self.turn_time_s, self.way_time_s)
        )
        return replace(
            self, turn_time_s=self.turn_time_s[turn], turn_radps=self.turn_radps[turn],
            tilt_rad=self.tilt_rad[turn], way_time_s=self.way_time_s[way], way_m=self.way_m[way],
        )  # fmt: skip


@dataclass(frozen=True, slots=True)
class DeadReckoning:
    """The path by gyro and wheels alone, from (0, 0) and heading 0.

    Parameters
    ----------
    time_s
        (n,) times. [s]
    heading_rad
        (n,) clockwise. [rad]
    way_m
        (n, 2) distances of the left and the right rear wheel. [m]
    by_scale_m
        (n, 2) their derivatives by the scales of the counted wheels: the same where these are the rear wheels. [m]
    xy
        (n, 2) y along the initial heading, x to the right of it. [m]
    rise_m
        (n,) by the pitch of the vertical gyro. [m]
    """

    time_s: FloatArray
    heading_rad: FloatArray
    way_m: FloatArray
    by_scale_m: FloatArray
    xy: FloatArray
    rise_m: FloatArray

    def at(self, time_s: FloatArray) -> DeadReckoning:
        """Return the path at other times (k,) [s], by linear interpolation."""

        def between(values: FloatArray) -> FloatArray:
            columns = values.reshape(len(values), -1).T
            return np.stack([np.interp(time_s, self.time_s, c) for c in columns], axis=1)

        return DeadReckoning(
            time_s, between(self.heading_rad)[:, 0], between(self.way_m), between(self.by_scale_m),
            between(self.xy), between(self.rise_m)[:, 0],
        )  # fmt: skip


def reckon(motion: Motion, also_s: FloatArray) -> DeadReckoning:
    """Integrate turn rates and distances over the whole span.

    Parameters
    ----------
    also_s
        (k,) times that the result must contain. [s]
    """
    first, last = motion.span_s
    grid = [motion.turn_time_s, np.arange(first, last, _GRID_S), also_s, np.array([first, last])]
    time = np.unique(np.concatenate(grid))
    time = time[(time >= first) & (time <= last)]
    rate = np.interp(time, motion.turn_time_s, motion.turn_radps)
    heading = _integral(time, rate)
    way = np.stack([np.interp(time, motion.way_time_s, column) for column in motion.way_m.T], axis=1)
    by_scale = way
    if motion.wheelbase_m:
        # Front wheels: what the rear ones travel meanwhile
        rear, change = rear_steps(np.diff(way, axis=0), np.diff(heading), motion.wheelbase_m)
        by_scale = np.concatenate([way[:1], way[0] + np.cumsum(change, axis=0)])
        way = np.concatenate([way[:1], way[0] + np.cumsum(rear, axis=0)])
    step = np.diff(way.mean(axis=1))
    middle = 0.5 * (heading[1:] + heading[:-1])
    pitch = np.interp(0.5 * (time[1:] + time[:-1]), motion.turn_time_s, motion.tilt_rad[:, 1])
    xy = np.zeros((len(time), 2))
    xy[1:] = np.cumsum(step[:, None] * np.stack([np.sin(middle), np.cos(middle)], axis=1), axis=0)
    rise = np.concatenate([[0.0], np.cumsum(step * np.sin(pitch))])
    return DeadReckoning(time, heading, way, by_scale, xy, rise)


def _integral(x: FloatArray, y: FloatArray) -> FloatArray:
    """Return the integral of y(x) up to each x, (n,), by the trapezoidal rule."""
    return np.concatenate([[0.0], np.cumsum(0.5 * np.diff(x) * (y[1:] + y[:-1]))])


def steps_between(motion: Motion, reckoned: DeadReckoning, nodes_s: FloatArray) -> FloatArray:
    """Return the steps between nodes (n,) [s] as input of the kernels, (n - 1, 19)."""
    at = reckoned.at(nodes_s)
    first, last = nodes_s[:-1], nodes_s[1:]
    dt, turn, way = np.diff(nodes_s), np.diff(at.heading_rad), np.diff(at.way_m, axis=0)
    far = way.mean(axis=1)
    steps = np.zeros((len(dt), kernel.N_STEP))
    steps[:, kernel.DT], steps[:, kernel.TURN_READ] = dt, turn
    steps[:, kernel.LEFT_M], steps[:, kernel.RIGHT_M] = way.T
    by_scale = np.diff(at.by_scale_m, axis=0)
    steps[:, kernel.LEFT_BY], steps[:, kernel.RIGHT_BY] = by_scale.T
    steps[:, kernel.FAR_BY_TURN], by_wheels = turn_by_scale(far, turn, motion.wheelbase_m)
    steps[:, kernel.ANTENNA_AHEAD], steps[:, kernel.ASIDE] = _chords(at, far, turn)
    sine = np.divide(np.diff(at.rise_m), far, out=np.full(len(far), np.nan), where=np.abs(far) > 0.01)
    pitch = np.interp(0.5 * (first + last), motion.turn_time_s, motion.tilt_rad[:, 1])
    steps[:, kernel.PITCH_READ] = np.where(np.isnan(sine), pitch, np.arcsin(np.clip(sine, -0.5, 0.5)))
    steps[:, kernel.AT_REST] = _inside(first, last, motion.at_rest)
    for column, spans in ((kernel.SPEED_FREE, motion.no_way), (kernel.TURN_FREE, motion.no_turn)):
        free = _touched(first, last, spans).astype(np.float64)
        steps[:, column] = free + (np.diff(free, prepend=0.0) > 0.0)
    steps[steps[:, kernel.SPEED_FREE] > 0.0, kernel.AT_REST] = 0.0
    steps[:, kernel.WHEELS_TURN] = motion.wheels_turn * by_wheels
    _compare_wheels(steps, motion, way, turn)
    _allow_for_springs(steps, far, turn, dt)
    return steps


def _chords(at: DeadReckoning, far: FloatArray, turn: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the end of a step of unit length, ahead and to the right of its start, (n,) each."""
    east, north = np.diff(at.xy, axis=0).T
    sin_h, cos_h = np.sin(at.heading_rad[:-1]), np.cos(at.heading_rad[:-1])
    moved = np.abs(far) > 1e-6
    ahead = np.divide(east * sin_h + north * cos_h, far, out=np.cos(0.5 * turn), where=moved)
    aside = np.divide(east * cos_h - north * sin_h, far, out=np.sin(0.5 * turn), where=moved)
    # Moving forth and back within a step has no chord
    fair = np.hypot(ahead, aside) <= 1.0 + 1e-6
    return np.where(fair, ahead, np.cos(0.5 * turn)), np.where(fair, aside, np.sin(0.5 * turn))


def _compare_wheels(steps: FloatArray, motion: Motion, way: FloatArray, turn: FloatArray) -> None:
    """Set the turn by the difference of the wheels, and its variance, in the steps (n, 19)."""
    difference = (way[:, 0] - way[:, 1]) / motion.track_m
    # Two counts off by a tick at either end; slip of the tyres; uncertainty of the track
    var = 4.0 * motion.tick_m**2 / 12.0 / motion.track_m**2
    # A front wheel's error is 1 / cos of the steering angle as large in the distance of the rear wheel
    far, by_scale = way.mean(axis=1), 0.5 * (steps[:, kernel.LEFT_BY] + steps[:, kernel.RIGHT_BY])
    var = var * np.divide(by_scale, far, out=np.ones(len(far)), where=far != 0.0)
    var = var + (_SLIP_M / motion.track_m) ** 2 * np.abs(way.mean(axis=1)) + (_TRACK_SHARE * turn) ** 2
    usable = motion.wheels_apart and not motion.wheels_turn
    steps[:, kernel.WHEEL_TURN] = difference
    known = usable & (steps[:, kernel.SPEED_FREE] == 0.0)
    steps[:, kernel.WHEEL_TURN_VAR] = np.where(known, np.maximum(var, _LEAST_TURN_VAR), np.inf)


def _allow_for_springs(steps: FloatArray, far: FloatArray, turn: FloatArray, dt: FloatArray) -> None:
    """Set the variances of movements of the body off its axis, in the steps (n, 19).

    Tyres slip sideways by about 0.1 degree per m/s^2, bodies squat by 0.2 degrees per m/s^2 and sway by 0.1
    (R. N. Jazar, Vehicle Dynamics, 2nd ed., 10.3 and 14.2), for about a second.
    """
    speed = far / dt
    across = np.abs(speed * turn / dt)
    accel = np.abs(np.gradient(speed)) / np.maximum(dt, 0.05) if len(dt) > 1 else np.zeros(len(dt))
    accel = np.minimum(accel, _MOST_ACCEL)
    steps[:, kernel.SIDE_VAR] = ((_SIDE_SLIP * across * speed) ** 2 + (_SIDE_DRIFT * speed) ** 2) * dt
    steps[:, kernel.UP_VAR] = ((_SWAY * speed) ** 2 + 2.0 * (_SQUAT * accel * speed) ** 2) * dt


def _inside(first: FloatArray, last: FloatArray, spans: FloatArray) -> BoolArray:
    """Return which steps lie within one of the spans (k, 2), (n,) bool."""
    if len(spans) == 0:
        return np.zeros(len(first), dtype=bool)
    i = np.clip(np.searchsorted(spans[:, 0], first, side="right") - 1, 0, len(spans) - 1)
    return np.asarray((first >= spans[i, 0]) & (last <= spans[i, 1]))


def _touched(first: FloatArray, last: FloatArray, spans: FloatArray) -> BoolArray:
    """Return which steps overlap one of the spans (k, 2), (n,) bool."""
    touched = np.zeros(len(first), dtype=bool)
    for start, end in spans:
        touched |= (first < end) & (last > start)
    return touched
