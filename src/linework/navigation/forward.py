"""The filter of a drive while it is being driven: logs arrive piece by piece, poses come out.

`linework.navigation.locate` positions a drive that is over: it filters all of it forward, and smooths it backward. Here
only the past is known, and only the last seconds of the logs are kept, so that memory does not grow with the drive.
"""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Any, TypeVar

import numpy as np

from linework.arrays import FloatArray
from linework.errors import InputError
from linework.kernels import navigation as kernel
from linework.model.logs import GnssLog, GyroLog, NavigationLogs, WheelLog
from linework.model.trajectory import Trajectory
from linework.navigation.dead_reckoning import DeadReckoning, Motion, reckon
from linework.navigation.filter import FilterEstimate, FilterProblem, filter_problem, filter_states
from linework.navigation.motion import TurnRates, motion_of
from linework.navigation.noise import NoiseModel, fit_noise, initial_noise
from linework.navigation.poses import trajectory_at
from linework.navigation.stretch import Sensors, first_problem, of_speed_alone

AnyLog = TypeVar("AnyLog", GnssLog, GyroLog, WheelLog)
#: Time that a reading may come late: receivers answer within a second, and tilts are smoothed over a quarter. [s]
LATE_S = 2.0
#: Time before the last estimate that is kept: stops are recognised by the fixes ten seconds around them. [s]
_KEPT_S = 20.0
#: Time after which the noise of the sensors is fitted: three correlation times of the slow error of the fixes. [s]
_NOISE_S = 90.0
#: Longest time without a heading that is waited for: a van that stands needs no more. [s]
_STANDING_S = 120.0
#: Pause of both gyro and wheels from which the path is unknown, as in `linework.navigation.locate`. [s]
_PAUSE_S = 5.0
#: Fewest fixes to begin with.
_LEAST_FIXES = 5
#: Least sigma of a fix, as in `linework.navigation.locate`. [m]
_LEAST_SIGMA_M = 0.003


class ForwardFilter:
    """The forward filter of `locate_drive`, fed with the logs as they arrive.

    Parameters
    ----------
    sensors
        The vehicle's measures (`tick_m`, `track_m`, `gnss_lever_m`); readings in it are the first ones.
    rate_hz
        Poses per second. [Hz]

    Notes
    -----
    All logs are on one clock. Clocks, signs and units are not checked against the fixes, which takes minutes of
    driving: `linework locate` does that for the whole drive. A fix that comes more than ``LATE_S`` late is not used.
    """

    def __init__(self, sensors: NavigationLogs, *, rate_hz: float = 50.0) -> None:
        self._logs, self._rate_hz = sensors, rate_hz
        self._noise: NoiseModel | None = None
        self._is_fitted = False
        self._begin()
        #: Readings that came too late, or twice.
        self.n_late = 0
        #: The newest estimate (x, y, z of the world), its sigma in plan [m] and time [s]; None before the first.
        self.newest: tuple[FloatArray, float, float] | None = None

    @property
    def is_running(self) -> bool:
        """Whether there is a heading, so that poses come out."""
        return bool(np.isfinite(self._given_s))

    def add(
        self, gnss: GnssLog | None = None, gyro: GyroLog | None = None, wheels: WheelLog | None = None
    ) -> None:
        """Add readings, in any order; those older than what was estimated already are left out."""
        new: dict[str, Any] = {"gnss": gnss, "gyro": gyro, "wheels": wheels}
        for name, rows in new.items():
            if rows is None or len(rows) == 0:
                continue
            own = getattr(self._logs, name)
            known = own if own is not None else rows.take(np.zeros(0, dtype=np.int64))
            kept = rows.take(np.flatnonzero(rows.time_s > self._until_s))
            joined = _in_order(known, kept)
            self.n_late += len(known) + len(rows) - len(joined)  # of two at one time the first counts
            self._logs = replace(self._logs, **{name: joined})

    def advance(self, late_s: float = LATE_S) -> Trajectory:
        """Return the poses since the last call that will not change any more.

        Parameters
        ----------
        late_s
            Time for which readings may still come: poses of that time are left out. 0: the drive is over. [s]

        Returns
        -------
        Trajectory
            With attitudes and sigmas; without poses where nothing new is certain.
        """
        try:
            motion, turns, _ = motion_of(self._logs)
        except (InputError, ValueError, IndexError):
            return Trajectory.empty()  # fewer than two readings yet
        motion = self._after_pause(motion)
        if min(len(motion.turn_time_s), len(motion.way_time_s)) < 2:
            return Trajectory.empty()
        first, last = motion.span_s
        gnss = self._fixes(max(first, self._until_s), last)
        if self._x is None:
            found = self._first(motion, turns, gnss)
        elif last - self._until_s > 1.0 / self._rate_hz:
            found = self._next(motion, gnss)
        else:
            return Trajectory.empty()
        return Trajectory.empty() if found is None else self._poses(motion, turns, *found, late_s)

    def _begin(self) -> None:
        self._x: FloatArray | None = None
        self._p: FloatArray | None = None
        self._was_free = (False, False)
        self._origin = np.zeros(3)
        #: Times up to which all is estimated and forgotten, and up to which poses were returned. [s]
        self._until_s = self._given_s = -np.inf

    def _after_pause(self, motion: Motion) -> Motion:
        """Return the motion after the last pause of all sensors; the filter begins again there."""
        time = np.unique(np.concatenate([motion.turn_time_s, motion.way_time_s]))
        long = np.flatnonzero(np.diff(time) > _PAUSE_S)
        if len(long) == 0:
            return motion
        resumed = float(time[long[-1] + 1])
        if resumed > self._given_s and self.is_running:
            self._begin()
        return motion.between(resumed, float(time[-1]))

    def _fixes(self, after_s: float, last_s: float) -> GnssLog:
        """Return the fixes of a time from a local origin, with sigmas that receivers can keep."""
        log = self._logs.gnss
        chosen = log.take(np.flatnonzero((log.time_s > after_s) & (log.time_s <= last_s)))
        if self._x is None and len(chosen):
            self._origin = np.round(np.median(chosen.xyz, axis=0))
        sigma = np.maximum(chosen.sigma_m, _LEAST_SIGMA_M)
        return GnssLog(chosen.time_s, chosen.xyz - self._origin, sigma)

    def _first(
        self, motion: Motion, turns: TurnRates | None, gnss: GnssLog
    ) -> tuple[FilterProblem, FilterEstimate, DeadReckoning] | None:
        """Return the first estimates, once the van has moved far enough for a heading; else None."""
        if len(gnss) < _LEAST_FIXES:
            return None
        reckoned = reckon(motion, gnss.time_s)
        sensors = _sensors_of(self._logs, turns)
        try:
            problem = first_problem(motion, reckoned, gnss, sensors)
        except InputError:
            self._forget(float(gnss.time_s[-1]) - _STANDING_S)
            return None
        if not motion.has_ways:
            problem, reckoned = of_speed_alone(problem, motion, gnss)
        if self._noise is None:
            self._noise = initial_noise(
                motion.tick_m, motion.track_m, gyro_noise=sensors.gyro_noise, has_tilt=sensors.has_tilt
            )
        if not self._is_fitted and problem.time_s[-1] - problem.time_s[0] >= _NOISE_S:
            self._noise = fit_noise(self._noise, lambda model: filter_states(problem, model).likelihood)
            self._is_fitted = True
        return problem, filter_states(problem, self._noise), reckoned

    def _next(
        self, motion: Motion, gnss: GnssLog
    ) -> tuple[FilterProblem, FilterEstimate, DeadReckoning] | None:
        """Return the estimates after the last certain one, which is the first node."""
        assert self._x is not None and self._p is not None and self._noise is not None
        reckoned = reckon(motion, np.append(gnss.time_s, self._until_s))
        start = int(np.searchsorted(reckoned.time_s, self._until_s))
        reckoned = DeadReckoning(*(getattr(reckoned, column.name)[start:] for column in fields(reckoned)))
        if len(reckoned.time_s) < 2 or reckoned.time_s[0] != self._until_s:
            return None
        lever = np.asarray(self._logs.gnss_lever_m, dtype=np.float64)
        problem = filter_problem(motion, reckoned, gnss, self._x, np.zeros(kernel.N_STATES), lever)
        if not motion.has_ways:
            problem, reckoned = of_speed_alone(problem, motion, gnss)
        for column, was_free in zip((kernel.SPEED_FREE, kernel.TURN_FREE), self._was_free, strict=True):
            if was_free and problem.steps[0, column] > 0.0:
                problem.steps[0, column] = 1.0  # it continues to be free, it does not begin to
        return problem, filter_states(problem, self._noise, p0=self._p), reckoned

    def _poses(
        self,
        motion: Motion,
        turns: TurnRates | None,
        problem: FilterProblem,
        estimate: FilterEstimate,
        reckoned: DeadReckoning,
        late_s: float,
    ) -> Trajectory:
        """Return the poses that are certain, and keep the last certain estimate to continue from."""
        nodes, rate = problem.time_s, self._rate_hz
        sigma = float(np.sqrt(np.maximum(estimate.p[-1, 0, 0] + estimate.p[-1, 1, 1], 0.0)))
        self.newest = estimate.x[-1, :3] + self._origin, sigma, float(nodes[-1])
        k = int(np.searchsorted(nodes, nodes[-1] - late_s, side="right")) - 1
        if k < 1:
            return Trajectory.empty()
        first, until = max(self._given_s, float(nodes[0])), float(nodes[k])
        time = np.arange(np.floor(first * rate) + 1.0, np.floor(until * rate) + 1.0) / rate
        time = time[(time >= nodes[0]) & (time <= until)]
        tilt = np.zeros(2) if turns is None else turns.tilt_sigma_rad
        poses = trajectory_at(
            time, problem, estimate, motion, reckoned, origin_m=self._origin, tilt_sigma_rad=tilt
        )
        self._given_s = max(self._given_s, until)
        if self._is_fitted:
            self._x, self._p, self._until_s = estimate.x[k], estimate.p[k], until
            free = problem.steps[k - 1, [kernel.SPEED_FREE, kernel.TURN_FREE]] > 0.0
            self._was_free = bool(free[0]), bool(free[1])
            self._forget(until - _KEPT_S)
        return poses

    def _forget(self, before_s: float) -> None:
        """Drop the readings before a time [s]."""
        for name in ("gnss", "gyro", "wheels"):
            log = getattr(self._logs, name)
            if log is not None and len(log) and log.time_s[0] < before_s:
                rest = log.take(np.flatnonzero(log.time_s >= before_s))
                self._logs = replace(self._logs, **{name: rest})


def _in_order(known: AnyLog, new: AnyLog) -> AnyLog:
    """Return the readings of both in strictly increasing time; of two at one time the first stays."""
    _, first = np.unique(np.concatenate([known.time_s, new.time_s]), return_index=True)
    others = new.by_name()
    return replace(
        known,
        **{name: np.concatenate([own, others[name]])[first] for name, own in known.by_name().items()},
    )


def _sensors_of(logs: NavigationLogs, turns: TurnRates | None) -> Sensors:
    """Return what the first problem needs to know of the sensors."""
    return Sensors(
        gyro_noise=None if turns is None else turns.noise,
        tilt_sigma_rad=np.zeros(2) if turns is None else turns.tilt_sigma_rad,
        has_tilt=logs.gyro is not None and logs.gyro.roll_pitch_rad is not None,
        lever_m=np.asarray(logs.gnss_lever_m, dtype=np.float64),
    )
