"""Positioning of a stretch of a drive with one clock: initial state, filter, smoother, poses at any rate.

Separate from `locate`, which cuts a drive by pauses and clocks: this runs filter and smoother on one stretch.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from linework.arrays import BoolArray, FloatArray
from linework.errors import InputError
from linework.kernels import navigation as kernel
from linework.model.logs import GnssLog
from linework.model.trajectory import Trajectory
from linework.navigation.dead_reckoning import DeadReckoning, Motion, reckon
from linework.navigation.filter import (
    FilterEstimate,
    FilterProblem,
    filter_problem,
    filter_states,
    outlier_variances,
    smooth_states,
)
from linework.navigation.located import DriveStretch, LocatedDrive, NavigationConfig, kept_poses
from linework.navigation.noise import NoiseModel, fit_noise, initial_noise
from linework.navigation.poses import trajectory_at
from linework.navigation.wheels import spans_of

#: Standard deviations of the initial state: bias (phones have 0.3 deg/s, others less) [rad/s], scales [1].
_SIGMA_BIAS_RADPS, _SIGMA_GYRO_SCALE, _SIGMA_WHEEL_SCALE = np.radians(0.3), 0.03, 0.03
#: Standard deviation of a delay of GNSS time stamps (computing, serial lines, USB). [s]
_SIGMA_DELAY_S = 0.2
#: Evidence from which a delay or a jump of the bias is accepted: logarithm of the likelihood ratio, and sigmas.
_EVIDENCE, _JUMP_SIGMAS = 10.0, 5.0
#: Least time without fixes of an outage; at least three intervals of the receiver. [s]
_OUTAGE_S = 3.0
#: Standard deviations of the initial position [m] and heading [rad].
_SIGMA_PLACE_M, _SIGMA_HEADING_RAD = 100.0, np.radians(10.0)
#: Share of the largest jump in a span of steps that the bias may jump in too.
_JUMP_SHARE = 0.9
#: Standard deviation of a jump of the bias. [rad/s]
_JUMP_RADPS = np.radians(0.1)


@dataclass(frozen=True, slots=True, kw_only=True)
class Sensors:
    """Properties of the sensors.

    Parameters
    ----------
    gyro_noise
        Angular random walk [rad/sqrt(s)]; None: no gyro.
    tilt_sigma_rad
        (2,) noise of roll and pitch. [rad]
    lever_m
        (3,) of the antenna. [m, vehicle]
    """

    gyro_noise: float | None
    tilt_sigma_rad: FloatArray
    has_tilt: bool
    lever_m: FloatArray


def locate_stretch(
    motion: Motion, fixes: GnssLog, sensors: Sensors, config: NavigationConfig, *, rate_hz: float
) -> LocatedDrive:
    """Return a positioned stretch, with poses at `rate_hz`.

    Raises
    ------
    InputError
        When the van hardly moves, or no position is certain enough.
    """
    # Local origin, and the time common to gyro, wheels and GNSS
    first, last = motion.span_s
    gnss, origin = _from_origin(fixes, first, last)
    # Dead reckoning from end to end, fitted to the first fixes
    reckoned = reckon(motion, gnss.time_s)
    problem = first_problem(motion, reckoned, gnss, sensors)
    if not motion.has_ways:
        problem, reckoned = of_speed_alone(problem, motion, gnss)
    # Noise of the sensors by maximum likelihood of the fixes
    noise = initial_noise(
        motion.tick_m, motion.track_m, gyro_noise=sensors.gyro_noise, has_tilt=sensors.has_tilt
    )
    noise = fit_noise(noise, lambda model: filter_states(problem, model).likelihood)
    problem, noise, said = _with_delay(problem, noise)
    # Forward, then backward; fixes far from the smoothed path get less weight the next time
    forward = filter_states(problem, noise)
    estimate = smooth_states(problem, noise, forward)
    problem, steps_said = _with_bias_jumps(problem, noise, estimate)
    estimate, doubt = _reweighted(problem, noise, estimate)
    # Poses at any rate, except too far from a fix or too uncertain
    time = np.arange(np.ceil(first * rate_hz) / rate_hz, last, 1.0 / rate_hz)

    def poses(of: FilterEstimate) -> Trajectory:
        return trajectory_at(
            time, problem, of, motion, reckoned, origin_m=origin, tilt_sigma_rad=sensors.tilt_sigma_rad
        )

    trajectory = poses(estimate)
    outages = _outages(gnss.time_s, (first, last))
    kept = _kept(time, gnss.time_s, outages, trajectory.sigma_xyz_m, config)
    return LocatedDrive(
        trajectory=kept_poses(trajectory, kept),
        forward=kept_poses(poses(forward), kept),
        distance_m=float(np.sum(np.hypot(*np.diff(estimate.x[:, :2], axis=0).T))),
        outages_s=outages,
        left_out_s=spans_of(~kept[1:] | ~kept[:-1], time),
        fix_time_s=gnss.time_s,
        residual_m=estimate.innovation_m,
        residual_sigma_m=estimate.innovation_sigma_m,
        is_outlier=doubt[:, 0] > 0.0,
        stretches=(_account(problem, estimate, noise, sensors),),
        warnings=(*said, *steps_said),
    )


def _from_origin(fixes: GnssLog, first_s: float, last_s: float) -> tuple[GnssLog, FloatArray]:
    """Return the fixes of a time span [s] from a local origin, and that origin (3,) [m, world]."""
    inside = (fixes.time_s >= first_s) & (fixes.time_s <= last_s)
    origin = np.round(np.median(fixes.xyz, axis=0))
    return GnssLog(fixes.time_s[inside], fixes.xyz[inside] - origin, fixes.sigma_m[inside]), origin


def _reweighted(
    problem: FilterProblem, noise: NoiseModel, estimate: FilterEstimate
) -> tuple[FilterEstimate, FloatArray]:
    """Smooth twice more, with less weight for outlying fixes; return the estimate and their added variances (m, 2)."""
    doubt = outlier_variances(estimate.innovation_m, estimate.innovation_sigma_m)
    for _ in range(2):
        problem = replace(problem, x0=estimate.x[0])
        estimate = smooth_states(problem, noise, filter_states(problem, noise, doubt))
        doubt = outlier_variances(estimate.innovation_m, estimate.innovation_sigma_m)
    return estimate, doubt


def first_problem(motion: Motion, reckoned: DeadReckoning, gnss: GnssLog, sensors: Sensors) -> FilterProblem:
    """Return nodes and steps, and the initial state: dead reckoning fitted to the first fixes."""
    fit = first_heading(reckoned.at(gnss.time_s).xy, gnss.xyz[:, :2], gnss.sigma_m[:, 0])
    if fit is None:
        raise InputError(
            f"the van hardly moves from {gnss.time_s[0]:.1f} to {gnss.time_s[-1]:.1f} s: its heading is not known",
            where="navigation",
            advice="give a log with some metres driven while there are fixes",
        )
    x0, sigma0 = np.zeros(kernel.N_STATES), np.zeros(kernel.N_STATES)
    x0[:4] = fit.east_m, fit.north_m, gnss.xyz[0, 2] - sensors.lever_m[2], fit.heading_rad
    sigma0[:3], sigma0[kernel.NAV_HEADING] = _SIGMA_PLACE_M, _SIGMA_HEADING_RAD
    if not motion.wheels_turn:
        sigma0[kernel.BIAS], sigma0[kernel.GYRO_SCALE] = _SIGMA_BIAS_RADPS, _SIGMA_GYRO_SCALE
    sigma0[kernel.LEFT] = sigma0[kernel.RIGHT] = _SIGMA_WHEEL_SCALE
    sigma0[kernel.WANDER :] = 1.0
    return filter_problem(motion, reckoned, gnss, x0, sigma0, sensors.lever_m)


def of_speed_alone(
    problem: FilterProblem, motion: Motion, gnss: GnssLog
) -> tuple[FilterProblem, DeadReckoning]:
    """Leave all distances to the estimated speed: those taken from fixes would use the fixes twice."""
    steps, read = problem.steps.copy(), problem.read.copy()
    steps[:, [kernel.LEFT_M, kernel.RIGHT_M, kernel.LEFT_BY, kernel.RIGHT_BY]] = 0.0
    read[:, kernel.READ_SPEED] = 0.0
    still = replace(motion, way_m=np.zeros_like(motion.way_m))
    return replace(problem, steps=steps, read=read), reckon(still, gnss.time_s)


def _with_delay(problem: FilterProblem, noise: NoiseModel) -> tuple[FilterProblem, NoiseModel, list[str]]:
    """Let the filter estimate the delay of the GNSS time stamps, where that makes the fixes more probable."""
    sigma0 = problem.sigma0.copy()
    sigma0[kernel.DELAY] = _SIGMA_DELAY_S
    late = replace(problem, sigma0=sigma0)
    if filter_states(late, noise).likelihood - filter_states(problem, noise).likelihood < _EVIDENCE:
        return problem, noise, []
    noise = fit_noise(noise, lambda model: filter_states(late, model).likelihood)
    last = filter_states(late, noise)
    delay, sigma = last.x[-1, kernel.DELAY], np.sqrt(last.p[-1, kernel.DELAY, kernel.DELAY])
    which = "later" if delay > 0 else "earlier"
    said = f"GNSS stamps are {abs(delay):.3f} s {which} than those of gyro and wheels (sigma {sigma:.3f} s): taken into account"
    return late, noise, [said]


def _with_bias_jumps(
    problem: FilterProblem, noise: NoiseModel, estimate: FilterEstimate
) -> tuple[FilterProblem, list[str]]:
    """Let the bias of the gyro jump where the fixes show that it does."""
    base = filter_states(problem, noise).likelihood
    jump = np.abs(estimate.jump)
    spans = spans_of(jump > _JUMP_SIGMAS, np.arange(len(jump) + 1.0)).astype(np.int64)
    if len(spans) == 0:
        return problem, []
    said = []
    for first, last in spans:
        peak = first + int(np.argmax(jump[first:last]))
        at = np.flatnonzero(jump[first:last] > _JUMP_SHARE * jump[peak]) + first
        steps = problem.steps.copy()
        steps[at, kernel.BIAS_VAR] = _JUMP_RADPS**2 / len(at)
        with_jump = replace(problem, steps=steps)
        gained = filter_states(with_jump, noise).likelihood - base
        if gained < _EVIDENCE:
            continue
        problem, base = with_jump, base + gained
        said.append(
            f"gyro: its bias jumps about {problem.time_s[peak]:.1f} s (GNSS, {jump[peak]:.0f} sigmas): allowed for"
        )
    return problem, said


def _outages(fix_time_s: FloatArray, span_s: tuple[float, float]) -> FloatArray:
    """Return the spans (k, 2) without fixes. [s]."""
    least = max(_OUTAGE_S, 3.0 * float(np.median(np.diff(fix_time_s))))
    ends = np.concatenate([[span_s[0]], fix_time_s, [span_s[1]]])
    return spans_of(np.diff(ends) > least, ends)


def _kept(
    time_s: FloatArray,
    fix_time_s: FloatArray,
    outages_s: FloatArray,
    sigma_m: FloatArray | None,
    config: NavigationConfig,
) -> BoolArray:
    """Return which poses (n,) are near enough to a fix and certain enough, (n,) bool."""
    assert sigma_m is not None
    kept = np.hypot(sigma_m[:, 0], sigma_m[:, 1]) <= config.max_sigma_m
    for start, end in outages_s:
        if end - start <= config.longest_outage_s:
            continue
        from_start = time_s - start if start >= fix_time_s[0] else np.full(len(time_s), np.inf)
        to_end = end - time_s if end <= fix_time_s[-1] else np.full(len(time_s), np.inf)
        far = np.minimum(from_start, to_end) > 0.5 * config.longest_outage_s
        kept &= ~((time_s > start) & (time_s < end) & far)
    if not kept.any():
        raise InputError(
            f"no position is certain to {config.max_sigma_m:g} m from {time_s[0]:.1f} to {time_s[-1]:.1f} s",
            where="navigation",
            advice="check sigmas and outages of the GNSS log",
        )
    return kept


def _account(
    problem: FilterProblem, estimate: FilterEstimate, noise: NoiseModel, sensors: Sensors
) -> DriveStretch:
    """Return the estimates of the sensors at the end of the stretch."""
    named = [("wheel_scale_left", kernel.LEFT, 1.0), ("wheel_scale_right", kernel.RIGHT, 1.0)]
    if sensors.gyro_noise is not None:
        named += [
            ("gyro_bias_deg_h", kernel.BIAS, np.degrees(3600.0)), ("gyro_scale", kernel.GYRO_SCALE, -1.0)
        ]  # fmt: skip
    if problem.sigma0[kernel.DELAY] > 0.0:
        named.append(("gnss_delay_s", kernel.DELAY, 1.0))
    if np.all(problem.steps[:, kernel.SPEED_FREE]):
        named = [n for n in named if not n[0].startswith("wheel")]
    sigma = np.sqrt(np.diagonal(estimate.p[-1]))
    return DriveStretch(
        first_s=float(problem.time_s[0]),
        last_s=float(problem.time_s[-1]),
        estimates={name: (float(estimate.x[-1, i] * f), float(sigma[i] * abs(f))) for name, i, f in named},
        noise=noise,
    )


# Initial position and heading: dead reckoning fitted to the first fixes

#: Least length of the path that is fitted: in sigmas of the fixes, and that of a street corner [m].
_LEAST_SIGMAS, _LEAST_M = 20.0, 15.0


@dataclass(frozen=True, slots=True)
class PathFit:
    """A path fitted to fixes: position [m] and heading [rad] of its origin, scale, residuals.

    Parameters
    ----------
    residual_m
        (n,) distances of the fixes. [m]
    """

    east_m: float
    north_m: float
    heading_rad: float
    scale: float
    residual_m: FloatArray


def fit_onto_fixes(way_xy: FloatArray, fixes_xy: FloatArray, *, robust: bool = True) -> PathFit:
    """Fit a path (n, 2) to fixes (n, 2) [m] by rotation, shift and scale, by least squares.

    With complex numbers: ``fix = origin + scale e^(-i heading) way``; `robust` reduces the weight of outliers.
    """
    way, fix = way_xy @ np.array([1.0, 1.0j]), fixes_xy @ np.array([1.0, 1.0j])
    weight = np.ones(len(way))
    for _ in range(8 if robust else 1):
        weight /= weight.sum()
        way_mean, fix_mean = weight @ way, weight @ fix
        centred = way - way_mean
        turn = np.sum(weight * centred.conj() * (fix - fix_mean)) / np.sum(weight * np.abs(centred) ** 2)
        residual = np.abs(fix - fix_mean - turn * centred)
        level = np.median(residual) + 1e-3
        weight = 1.0 / (1.0 + (residual / (2.0 * level)) ** 2)
    origin = fix_mean - turn * way_mean
    return PathFit(
        float(origin.real), float(origin.imag), float(-np.angle(turn)), float(np.abs(turn)), residual
    )


def first_heading(way_xy: FloatArray, fixes_xy: FloatArray, sigma_m: FloatArray) -> PathFit | None:
    """Return the fit of the first part of a path (n, 2) to fixes (n, 2) with sigmas (n,) [m]; None without movement."""
    far = np.maximum.accumulate(np.hypot(*(way_xy - way_xy[0]).T))
    needed = np.maximum(_LEAST_SIGMAS * np.median(sigma_m), _LEAST_M)
    enough = np.flatnonzero(far >= needed)
    n = min(max(int(enough[0]) + 1, 4), len(way_xy)) if len(enough) else len(way_xy)
    if n < 3 or far[n - 1] < 3.0 * np.median(sigma_m) or far[n - 1] < 1.0:
        return None
    return fit_onto_fixes(way_xy[:n], fixes_xy[:n])
