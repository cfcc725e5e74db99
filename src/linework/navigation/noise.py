"""Noise model of the sensors: first values, and its fit to a drive by maximum likelihood."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import log

import numpy as np

from linework.arrays import FloatArray
from linework.kernels import navigation as kernel


@dataclass(frozen=True, slots=True, kw_only=True)
class NoiseModel:
    """Noise of all sensors of a van.

    Parameters
    ----------
    gyro_noise
        Angular random walk. [rad/sqrt(s)]
    bias_walk
        Random walk of the gyro's bias. [rad/s/sqrt(s)]
    wheel_noise
        Random walk of the distance. [m/sqrt(m)]
    scale_walk
        Random walk of the wheels' scales: half a per mille over 10 km, as tyres warm up. [1/sqrt(m)]
    tilt_rad
        Slow error of the vertical gyro; without one, the slopes of the road. [rad]
    tilt_s, tilt_m
        Correlation time [s] and distance [m] of that; inf: none.
    gnss_factor
        True sigma of the GNSS over that reported by the receiver.
    wander_share
        Share of the variance of the GNSS that is slow.
    wander_s
        Correlation time of that. [s]
    speed_mps
        Slow error of a speed log, which is late and filtered; 0: distances are counted. [m/s]
    speed_s
        Correlation time of that. [s]
    tick_m
        Nominal travel per count, 0 without counts. [m]
    track_m
        Distance of the counted wheels. [m]
    """

    gyro_noise: float
    bias_walk: float
    wheel_noise: float
    scale_walk: float = 5e-6
    tilt_rad: float = 0.01
    tilt_s: float = 200.0
    tilt_m: float = np.inf
    gnss_factor: float = 1.0
    wander_share: float = 0.5
    wander_s: float = 30.0
    speed_mps: float = 0.0
    speed_s: float = 3.0
    tick_m: float = 0.0
    track_m: float = 1.5

    def row(self) -> FloatArray:
        """Return the noise as input of the kernels, (16,)."""
        row = np.zeros(kernel.N_NOISE)
        row[kernel.GYRO_VAR] = self.gyro_noise**2
        row[kernel.BIAS_WALK] = self.bias_walk**2
        row[kernel.WHEEL_VAR] = self.wheel_noise**2
        row[kernel.SCALE_WALK] = self.scale_walk**2
        row[kernel.TILT_VAR] = self.tilt_rad**2
        row[kernel.PER_TILT_S], row[kernel.PER_TILT_M] = 1.0 / self.tilt_s, 1.0 / self.tilt_m
        row[kernel.GNSS_FACTOR] = self.gnss_factor
        row[kernel.SHARE], row[kernel.PER_WANDER_S] = self.wander_share, 1.0 / self.wander_s
        # A count is off by up to one tick, uniformly distributed
        row[kernel.TICK_VAR] = self.tick_m**2 / 12.0
        row[kernel.TRACK_M] = self.track_m
        # Where unknown, speed changes by 3 m/s and turn rate by 0.2 rad/s within a second (braking, a junction)
        row[kernel.ACCEL_VAR], row[kernel.TURN_ACCEL_VAR] = 3.0**2, 0.2**2
        row[kernel.SPEED_VAR], row[kernel.PER_SPEED_S] = self.speed_mps**2, 1.0 / self.speed_s
        return row


def initial_noise(tick_m: float, track_m: float, *, gyro_noise: float | None, has_tilt: bool) -> NoiseModel:
    """Return the noise assumed before the drive is evaluated.

    Parameters
    ----------
    tick_m
        Nominal travel per count [m]; 0: the wheels report a speed.
    gyro_noise
        From its readings [rad/sqrt(s)]; None: turns come from the difference of the wheels, with an error of a few
        millimetres per square root of a metre.
    """
    # Wheels slip by about 0.5 % of a metre, 0.05 % of 100 m
    model = NoiseModel(
        gyro_noise=0.004 if gyro_noise is None else gyro_noise,
        # 10 deg/h in an hour, between the best and the worst gyros that vans carry
        bias_walk=np.radians(10.0) / 3600.0 / 60.0,
        wheel_noise=0.005, speed_mps=0.0 if tick_m else 0.1, tick_m=tick_m, track_m=track_m,
    )  # fmt: skip
    if has_tilt:
        return replace(model, tilt_rad=np.radians(0.5), tilt_s=200.0)
    # Roads rise by 3.5 %, and change that over 200 m
    return replace(model, tilt_rad=np.radians(2.0), tilt_s=np.inf, tilt_m=200.0)


#: Standard deviation of each value about its first guess, as a factor: log-normal priors.
_FACTORS = {
    "gyro_noise": 2.0, "bias_walk": 5.0, "wheel_noise": 3.0, "tilt_rad": 2.0, "gnss_factor": 1.5,
    "wander_s": 4.0, "speed_mps": 3.0,
}  # fmt: skip
#: Factors of the steps of the search, coarse and fine.
_STEPS = (3.0, 1.7)
#: Slow shares of the GNSS variance that are tried.
_SHARES = (0.001, 0.02, 0.3, 0.6, 0.85, 0.97)


def fit_noise(first: NoiseModel, likelihood: Callable[[NoiseModel], float]) -> NoiseModel:
    """Return the noise of maximum likelihood for the innovations, near its first guess.

    Parameters
    ----------
    first
        Centre of the log-normal priors.
    likelihood
        Returns the logarithm of the likelihood of the innovations of the drive.

    Notes
    -----
    Steps along one value after the other by a factor of 3, then 1.7; about 40 runs of the filter.
    """
    factors = {name: factor for name, factor in _FACTORS.items() if getattr(first, name) > 0.0}

    def score(model: NoiseModel) -> float:
        far = sum(
            (log(getattr(model, name) / getattr(first, name)) / log(factor)) ** 2
            for name, factor in factors.items()
        )
        return likelihood(model) - 0.5 * far

    best, best_score = first, score(first)
    for factor in _STEPS:
        for name in ("wander_share", *factors):
            tried = [replace(best, wander_share=share) for share in _SHARES if share != best.wander_share]
            if name != "wander_share":
                value = getattr(best, name)
                tried = [replace(best, **{name: value * f}) for f in (factor, 1.0 / factor)]
            # Slow errors do not show in innovations: a receiver is never assumed better than it reports
            tried = [model for model in tried if model.gnss_factor >= 1.0]
            for model in tried:
                found = score(model)
                if found > best_score:
                    best, best_score = model, found
    return best
