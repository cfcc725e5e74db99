"""Filter forward and smoother backward over the nodes of a drive."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from linework.arrays import FloatArray, IntArray
from linework.kernels import navigation as kernel
from linework.model.logs import GnssLog
from linework.navigation.dead_reckoning import DeadReckoning, Motion, steps_between
from linework.navigation.noise import NoiseModel

#: Longest step between nodes; the path between two is dead reckoned in full. [s]
_NODE_S = 0.5
#: Time to either side over which speed is taken; only the delay of fixes needs it. [s]
_SPEED_S = 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class FilterProblem:
    """A drive as input of the filter: nodes, steps between them, fixes at some of them.

    Parameters
    ----------
    time_s
        (n,) times of the nodes. [s]
    steps
        (n - 1, 19); see `linework.kernels.navigation`.
    read
        (n, 3) roll and pitch as read [rad], speed over two seconds [m/s].
    fix_of
        (n,) int64 index of the fix at a node, -1: none.
    fixes, sigma_m
        (m, 3) positions from a local origin, and their sigmas. [m]
    lever_m
        (3,) of the antenna. [m, vehicle]
    x0, sigma0
        (16,) state at the first node, and its standard deviations.
    """

    time_s: FloatArray
    steps: FloatArray
    read: FloatArray
    fix_of: IntArray
    fixes: FloatArray
    sigma_m: FloatArray
    lever_m: FloatArray
    x0: FloatArray
    sigma0: FloatArray


@dataclass(frozen=True, slots=True)
class FilterEstimate:
    """States (n, 16) and covariances (n, 16, 16) at the nodes, and innovations of the fixes.

    Parameters
    ----------
    innovation_m, innovation_sigma_m
        (m, 3) fix minus expectation, and its sigma. [m]
    added_m2
        (m, 2) variance added to outlying fixes, in plan and in height. [m2]
    likelihood
        Logarithm of the likelihood of all innovations.
    jump
        (n - 1,) jumps of the gyro's bias over their sigmas; empty for a filter.
    """

    x: FloatArray
    p: FloatArray
    innovation_m: FloatArray
    innovation_sigma_m: FloatArray
    added_m2: FloatArray
    likelihood: float
    jump: FloatArray


def filter_problem(
    motion: Motion,
    reckoned: DeadReckoning,
    gnss: GnssLog,
    x0: FloatArray,
    sigma0: FloatArray,
    lever_m: FloatArray,
) -> FilterProblem:
    """Return the problem with nodes at all fixes and at least every half second.

    Parameters
    ----------
    gnss
        Fixes within the span of `reckoned`, from a local origin.
    """
    first, last = reckoned.time_s[0], reckoned.time_s[-1]
    nodes = _filled(np.unique(np.concatenate([[first], gnss.time_s, [last]])), _NODE_S)
    fix_of = np.full(len(nodes), -1)
    fix_of[np.searchsorted(nodes, gnss.time_s)] = np.arange(len(gnss.time_s))
    tilt = [np.interp(nodes, motion.turn_time_s, t) for t in motion.tilt_rad.T]
    before, after = np.maximum(nodes - _SPEED_S, first), np.minimum(nodes + _SPEED_S, last)
    way = reckoned.at(after).way_m - reckoned.at(before).way_m
    read = np.column_stack([*tilt, way.mean(axis=1) / (after - before)])
    return FilterProblem(
        time_s=nodes, steps=steps_between(motion, reckoned, nodes), read=read, fix_of=fix_of,
        fixes=np.ascontiguousarray(gnss.xyz), sigma_m=np.ascontiguousarray(gnss.sigma_m),
        lever_m=lever_m, x0=x0, sigma0=sigma0,
    )  # fmt: skip


def _filled(times: FloatArray, step_s: float) -> FloatArray:
    """Return times (n,) with others inserted where they are farther apart than `step_s`."""
    n = np.maximum(np.ceil(np.diff(times) / step_s - 1e-9).astype(np.int64), 1)
    start = np.repeat(times[:-1], n)
    part = np.arange(n.sum()) - np.repeat(np.cumsum(n) - n, n)
    return np.append(start + part * np.repeat(np.diff(times) / n, n), times[-1])


def filter_states(
    problem: FilterProblem,
    noise: NoiseModel,
    doubt: FloatArray | None = None,
    *,
    p0: FloatArray | None = None,
) -> FilterEstimate:
    """Filter forward: the estimate at each moment from the past alone.

    Parameters
    ----------
    doubt
        (m, 2) variance added to each fix in plan and in height [m2]; None: by its own innovation.
    p0
        (16, 16) covariance at the first node, where the filter continues an earlier one; None: by `sigma0`.
    """
    if doubt is None:
        doubt = np.full((len(problem.fixes), 2), np.nan)
    sigma0 = problem.sigma0.copy()
    if noise.speed_mps:
        sigma0[kernel.SPEED] = noise.speed_mps
    sigma0[kernel.PITCH] = sigma0[kernel.ROLL] = noise.tilt_rad
    x, p, innovation, spread, added, likelihood = kernel.filter_forward(
        problem.x0, np.diag(sigma0**2) if p0 is None else p0, problem.steps, problem.read, problem.fix_of, problem.fixes,
        problem.sigma_m, doubt, problem.lever_m, noise.row(),
    )  # fmt: skip
    return FilterEstimate(x, p, innovation, spread, added, float(likelihood), np.zeros(0))


def smooth_states(problem: FilterProblem, noise: NoiseModel, forward: FilterEstimate) -> FilterEstimate:
    """Smooth backward: the estimate at each moment from the whole drive."""
    x, p, jump = kernel.smooth_backward(forward.x, forward.p, problem.steps, noise.row())
    residual, spread = _residuals(problem, noise, x, p)
    return FilterEstimate(x, p, residual, spread, forward.added_m2, forward.likelihood, jump)


def outlier_variances(residual_m: FloatArray, sigma_m: FloatArray) -> FloatArray:
    """Return the variances (m, 2) in plan and in height [m2] to add to fixes far from the smoothed path.

    Beyond the gate (99.9 %) they grow with the fourth power of the distance: fixes farthest off pull least.

    Parameters
    ----------
    residual_m, sigma_m
        (m, 3) residuals and their standard deviations. [m]
    """
    s2 = sigma_m**2
    plan = 0.5 * np.sum(s2[:, :2], axis=1)
    nis = np.sum(residual_m[:, :2] ** 2 / s2[:, :2], axis=1)
    excess = np.maximum(nis / kernel.GATE_PLAN, 1.0)
    up = np.maximum(residual_m[:, 2] ** 2 / s2[:, 2] / kernel.GATE_UP, 1.0)
    return np.stack([plan * (excess**2 - 1.0), s2[:, 2] * (up**2 - 1.0)], axis=1)


def _residuals(
    problem: FilterProblem, noise: NoiseModel, x: FloatArray, p: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the residuals (m, 3) of the fixes from smoothed states, and their standard deviations (m, 3) [m]."""
    n = len(problem.fixes)
    residual, spread = np.empty((n, 3)), np.empty((n, 3))
    H, row = np.empty((3, kernel.N_STATES)), noise.row()
    white = noise.gnss_factor**2 * (1.0 - noise.wander_share)
    for k in np.flatnonzero(problem.fix_of >= 0).tolist():
        j = problem.fix_of[k]
        expected = kernel.antenna(x[k], problem.read[k], problem.lever_m, problem.sigma_m[j], row, H)
        residual[j] = problem.fixes[j] - expected
        own = np.einsum("ij,jk,ik->i", H, p[k], H)
        spread[j] = np.sqrt(own + white * problem.sigma_m[j] ** 2 + row[kernel.TICK_VAR])
    return residual, spread
