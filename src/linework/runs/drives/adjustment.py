"""Correction of a path over time, from what its drives measured of the same lines: sparse, robust least squares.

The errors of a trajectory change slowly. Each coordinate is taken for a Gauss-Markov process of first order with the
standard deviations of the trajectory; lines that two drives measured say how much the errors of both differ.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from linework.arrays import FloatArray, IntArray, offsets_of
from linework.model.columns import Columns, column
from linework.model.trajectory import Trajectory
from linework.runs.drives.separate import DriveSpan

#: Distance of the knots of a correction: errors of positions change over seconds at least. [s]
KNOT_S = 1.5
#: Time over which errors are related: satellites and their corrections change over tens of seconds, of which this is the
#: lower end. A shorter time follows the ties more closely, and trusts less in stretches between them. [s]
_RELATED_S = 10.0
#: Least deviation of a trajectory that states none, in plan and in height: phase GNSS at its best. [m]
_PHASE_M = (0.02, 0.03)
#: Residuals beyond this many deviations lose weight as 1 / residual (Huber, 1964): 95 % efficiency without outliers.
_HUBER = 1.345
_N_WEIGHTINGS = 10
#: Knots whose covariances are found at a time: bounds the memory. [knots]
_AT_ONCE = 128


@dataclass(frozen=True, slots=True)
class DriveTies(Columns):
    """n differences between what two drives measured of one feature.

    Parameters
    ----------
    time_s, other_s
        (n,) when the one drive and the other passed. [s]
    normal
        (n, 3) unit vector along which the difference is measured.
    apart_m
        (n,) position of the feature by the other drive minus that by the one, along the normal. [m]
    sigma_m
        (n,) standard deviation of the difference, without that of the paths. [m]
    """

    time_s: FloatArray = column()
    other_s: FloatArray = column()
    normal: FloatArray = column(np.float64, 3)
    apart_m: FloatArray = column()
    sigma_m: FloatArray = column()


@dataclass(frozen=True)
class PathCorrection:
    """What is added to positions of all drives, by their times.

    Parameters
    ----------
    knot_s
        (k,) ascending. [s]
    xyz_m
        (k, 3) correction at the knots. [m]
    normal
        (3k, 3k) sparse normal matrix of the corrections, the inverse of their covariance. [1/m²]
    """

    knot_s: FloatArray
    xyz_m: FloatArray
    normal: Any

    @cached_property
    def covariance_m2(self) -> FloatArray:
        """(k, 3, 3) covariance of the corrected path at each knot [m²]: found when it is first asked for."""
        return _covariances(self.normal)

    def at(self, time_s: FloatArray) -> FloatArray:
        """Return the corrections at times (n,), (n, 3) [m]; beyond the ends that of the end."""
        return np.stack([np.interp(time_s, self.knot_s, c) for c in self.xyz_m.T], axis=1)

    def covariance_at(self, time_s: FloatArray) -> FloatArray:
        """Return the covariance of the corrected path at times (n,), at the nearest knot, (n, 3, 3) [m²]."""
        k = np.clip(
            np.searchsorted(0.5 * (self.knot_s[1:] + self.knot_s[:-1]), time_s), 0, len(self.knot_s) - 1
        )
        return np.asarray(self.covariance_m2[k])

    def moved(self, path: Trajectory) -> Trajectory:
        """Return the corrected path, with its sigmas."""
        variance = np.diagonal(self.covariance_at(path.time_s), axis1=1, axis2=2)
        return Trajectory(path.time_s, path.xyz + self.at(path.time_s), path.attitude_deg, np.sqrt(variance),
                          path.sigma_attitude_deg)  # fmt: skip


def adjusted_path(drives: Sequence[DriveSpan], path: Trajectory, ties: DriveTies) -> PathCorrection:
    """Return the correction of a path that makes its drives agree.

    Parameters
    ----------
    path
        With its sigmas; where it states none, all drives are taken for equally good, and the differences say how good.

    Notes
    -----
    Stated sigmas are enlarged by one factor in plan and one in height where the differences contradict them, and those of
    the ties by one factor where the residuals do.
    """
    knots = [_knots(drive) for drive in drives]
    knot_s = np.concatenate(knots)
    first = offsets_of([len(k) for k in knots])
    sigma = _prior_sigma(knot_s, path, ties)
    prior = sparse.block_diag(
        [_prior(k, sigma[a : a + len(k)]) for k, a in zip(knots, first[:-1], strict=True)]
    )
    prior = prior.tocsc()
    A = (
        _design(ties.other_s, ties.normal, drives, knots, first)
        - _design(ties.time_s, ties.normal, drives, knots, first)
    ).tocsc()
    weight = 1.0 / ties.sigma_m**2
    factor, scale = np.ones(len(ties)), 1.0
    found: FloatArray = np.zeros(3 * len(knot_s))
    for _ in range(_N_WEIGHTINGS):
        normal = (A.T @ A.multiply((weight * factor / scale**2)[:, None]) + prior).tocsc()
        found = splu(normal).solve(-(A.T @ (weight * factor / scale**2 * ties.apart_m)))
        residual = (ties.apart_m + A @ found) / ties.sigma_m
        scale = max(1.0, 1.4826 * float(np.median(np.abs(residual)))) if len(residual) else 1.0
        factor = np.minimum(1.0, _HUBER * scale / np.maximum(np.abs(residual), 1e-9))
    normal = (A.T @ A.multiply((weight * factor / scale**2)[:, None]) + prior).tocsc()
    return PathCorrection(knot_s, found.reshape(-1, 3), normal)


def _knots(drive: DriveSpan) -> FloatArray:
    start = float(drive.time_s[0])
    # A drive may be a single pose
    end = max(float(drive.time_s[-1]), start + KNOT_S)
    return np.linspace(start, end, max(math.ceil((end - start) / KNOT_S), 1) + 1)


def _prior_sigma(knot_s: FloatArray, path: Trajectory, ties: DriveTies) -> FloatArray:
    """Return the standard deviations (k, 3) of the path at its knots before it is adjusted [m]."""
    stated = path.sigma_xyz_m
    is_stated = stated is not None and bool(np.isfinite(stated).all() and (stated > 0).all())
    values = stated if is_stated and stated is not None else np.ones((len(path), 3))

    def at(time_s: FloatArray) -> FloatArray:
        return np.stack([np.interp(time_s, path.time_s, c) for c in values.T], axis=1)

    found = at(knot_s)
    both = at(ties.time_s) ** 2 + at(ties.other_s) ** 2
    for axes, least_m in ((slice(0, 2), _PHASE_M[0]), (slice(2, 3), _PHASE_M[1])):
        own = np.abs(ties.normal[:, 2]) > 0.5 if axes.start == 2 else np.abs(ties.normal[:, 2]) < 0.5
        expected = np.sum(ties.normal[own] ** 2 * both[own], axis=1)
        size2 = np.maximum(ties.apart_m[own] ** 2 - ties.sigma_m[own] ** 2, 0.0)
        # Few independent errors: the mean of all, but for those that cannot be of one feature
        inner = size2 <= np.quantile(size2, 0.95) if len(size2) else np.zeros(0, dtype=bool)
        factor = math.sqrt(float(size2[inner].mean() / expected[inner].mean())) if inner.any() else 0.0
        found[:, axes] *= max(factor, 1.0) if is_stated else max(factor, least_m)
    return found


def _prior(knot_s: FloatArray, sigma_m: FloatArray) -> Any:
    """Return the weights (3k, 3k) of one drive's knots by a Gauss-Markov process of first order."""
    kept = np.exp(-np.diff(knot_s) / _RELATED_S)
    n = len(knot_s)
    gain = 1.0 / np.sqrt(1.0 - kept**2)
    # Whitened: the first value, then each minus what is kept of the one before
    rows = sparse.diags([np.concatenate([[1.0], gain]), -gain * kept], [0, -1], shape=(n, n))
    white = sparse.kron(rows, sparse.identity(3)) @ sparse.diags(1.0 / sigma_m.ravel())
    return white.T @ white


def _design(
    time_s: FloatArray,
    normal: FloatArray,
    drives: Sequence[DriveSpan],
    knots: Sequence[FloatArray],
    first: IntArray,
) -> Any:
    """Return the matrix (n, 3k) by which knots give the correction along normals at times."""
    n = len(time_s)
    left, share = np.zeros(n, dtype=np.int64), np.zeros(n)
    for drive, own_s, start in zip(drives, knots, first[:-1].tolist(), strict=True):
        own = drive.holds(time_s)
        k = np.clip(np.searchsorted(own_s, time_s[own], side="right") - 1, 0, len(own_s) - 2)
        left[own] = start + k
        share[own] = np.clip((time_s[own] - own_s[k]) / np.maximum(own_s[k + 1] - own_s[k], 1e-9), 0.0, 1.0)
    rows = np.repeat(np.arange(n), 3)
    axis = np.tile(np.arange(3), n)
    parts = []
    for at, part in ((left, 1.0 - share), (left + 1, share)):
        values = (part[:, None] * normal).ravel()
        parts.append(
            sparse.csc_matrix((values, (rows, np.repeat(3 * at, 3) + axis)), shape=(n, 3 * int(first[-1])))
        )
    return parts[0] + parts[1]


def _covariances(normal: Any) -> FloatArray:
    """Return the diagonal blocks (k, 3, 3) of the inverse of the normal matrix."""
    solve, n = splu(normal).solve, normal.shape[0] // 3
    blocks = np.zeros((n, 3, 3))
    for start in range(0, n, _AT_ONCE):
        many = np.arange(3 * start, 3 * min(start + _AT_ONCE, n))
        right = np.zeros((3 * n, len(many)))
        right[many, np.arange(len(many))] = 1.0
        part = solve(right)[many].reshape(-1, 3, len(many) // 3, 3)
        blocks[start : start + len(part)] = part[np.arange(len(part)), :, np.arange(len(part))]
    return 0.5 * (blocks + blocks.transpose(0, 2, 1))
