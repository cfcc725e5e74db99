"""A tracked line smoothed through the centres of its boxes, with the standard deviation of every vertex.

Kang, Lee and Lee (2023) join the centres by chords. Here a Kalman filter along the line and its smoother weigh every
centre by its variance, let the curvature change as fast as that of roads, and give the standard deviation of each
vertex, over gaps too.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import maximum_filter1d

from linework.arrays import BoolArray, FloatArray, IntArray
from linework.kernels.tracking.smooth import smooth_height, smooth_plane
from linework.kernels.tracking.track import CLOTHOID_M, SHARED, STRAIGHT_RADIUS_M, TIGHTEST_M
from linework.model.boxes import BoxSet

#: Distance of the stations that are added in gaps. [m]
SMOOTH_STATION_M = 1.0
#: Density of the grade's random walk: it changes by as much as in a vertical curve of 500 m radius. [1/m]
GRADE_CHANGE = 1.0 / 500.0**2
#: A centre farther off the line than this many standard deviations is given less weight (Huber 1964).
HUBER = 2.0
#: Smallest standard deviation of a number at one place. [m]
LEAST_VALUE_NOISE_M = 0.002
#: The curvature at a place counts as the largest within this distance: it changes before the bend. [m]
_NEAR_M = 5.0
#: Radius that the first pass expects, between that of a road and that of a kerb at a corner. [m]
_FIRST_RADIUS_M = 50.0
#: Standard deviation of a normal distribution over the median of its absolute deviations.
_MAD = 1.4826


@dataclass(frozen=True, slots=True)
class SmoothLine:
    """A smoothed line at ascending stations.

    Parameters
    ----------
    t_m
        (n,) float64 [m]: distance along the line from the centre of its first box.
    xyz
        (n, 3) float64 [m, from the survey's local origin].
    normal
        (n, 2) float64: unit vector to the left of the line.
    sigma_xy_m, sigma_z_m
        (n,) float64 [m]: standard deviations across the line and of its height.
    box
        (n,) int64: the box at the station, -1 if there is none.
    """

    t_m: FloatArray
    xyz: FloatArray
    normal: FloatArray
    sigma_xy_m: FloatArray
    sigma_z_m: FloatArray
    box: IntArray

    @property
    def is_measured(self) -> BoolArray:
        """Whether there is a box at each station, (n,) bool."""
        return np.asarray(self.box >= 0)


def smooth_line(
    boxes: BoxSet, box: IntArray, ends_m: tuple[float, float], shared: float = SHARED
) -> SmoothLine:
    """Return the smoothed line through boxes.

    Parameters
    ----------
    box
        (k,) int64, k >= 2: the boxes in the order of the line.
    ends_m
        Lengths that the line continues before the first and behind the last centre. [m]
    shared
        Number of neighbouring boxes that err as one.
    """
    t, at = _stations(boxes.along(box), ends_m)
    k, measured = box[np.maximum(at, 0)], at >= 0
    xy, z = boxes.centre[k, :2], boxes.centre[k, 2]
    variance = np.where(measured, shared * boxes.sigma_v_m[k] ** 2, np.inf)
    change = _change(np.full(len(t), 1.0 / _FIRST_RADIUS_M))
    states, _, _ = smooth_plane(t, xy, variance, change)
    # Again, with the curvature of the first pass, and less weight for centres off the line
    direction = states[:, 1] / np.maximum(np.linalg.norm(states[:, 1], axis=1), 1e-9)[:, None]
    curvature = np.abs(direction[:, 0] * states[:, 2, 1] - direction[:, 1] * states[:, 2, 0])
    change = _change(_largest_near(np.minimum(curvature, 1.0 / TIGHTEST_M), t))
    off = np.abs(np.sum((xy - states[:, 0]) * _left(direction), axis=1))
    variance *= np.maximum(off / (HUBER * np.sqrt(variance)), 1.0) ** 2
    states, cov, _ = smooth_plane(t, xy, variance, change)
    direction = states[:, 1] / np.maximum(np.linalg.norm(states[:, 1], axis=1), 1e-9)[:, None]
    variance_z = np.where(measured, shared * boxes.sigma_z_m[k] ** 2, np.inf)
    height, height_var = smooth_height(t, z, variance_z, GRADE_CHANGE)
    return SmoothLine(
        t, np.column_stack([states[:, 0], height]), _left(direction),
        np.sqrt(cov[:, 0, 0]), np.sqrt(height_var), np.where(measured, k, -1),
    )  # fmt: skip


def smooth_value(t_m: FloatArray, value: FloatArray, change: float) -> tuple[FloatArray, FloatArray]:
    """Return a number smoothed along a line (the height of a kerb), (n,), and its standard deviation, (n,).

    NaN are filled from around them. The noise is estimated from the differences of neighbours (their median, so that
    ramps do not count).

    Parameters
    ----------
    t_m
        (n,) ascending: distance along the line. [m]
    value
        (n,) [m].
    change
        Density of the random walk of its slope. [1/m]
    """
    known = np.isfinite(value)
    if not known.any():
        return np.full(len(t_m), np.nan), np.full(len(t_m), np.nan)
    steps = np.abs(np.diff(value[known]))
    noise = max(_MAD * float(np.median(steps)) / math.sqrt(2.0) if len(steps) else 0.0, LEAST_VALUE_NOISE_M)
    variance = np.where(known, SHARED * noise**2, np.inf)
    first = value[np.argmax(known)]
    smoothed, var = smooth_height(t_m, np.where(known, value, first), variance, change)
    return smoothed, np.sqrt(var)


def _stations(t: FloatArray, ends_m: tuple[float, float]) -> tuple[FloatArray, IntArray]:
    """Return distances along the line, gaps and ends filled, and the index of the centre at each (-1: none)."""
    added = [
        np.linspace(a, b, int(np.ceil((b - a) / SMOOTH_STATION_M)) + 1)[1:-1]
        for a, b in itertools.pairwise(t.tolist())
        if b - a > 1.5 * SMOOTH_STATION_M
    ]
    before = [np.array([-ends_m[0]])] if ends_m[0] > 0.0 else []
    behind = [np.array([t[-1] + ends_m[1]])] if ends_m[1] > 0.0 else []
    extra = np.concatenate([np.zeros(0), *before, *added, *behind])
    every = np.concatenate([t, extra])
    order = np.argsort(every, kind="stable")
    return every[order], np.concatenate([np.arange(len(t)), np.full(len(extra), -1)])[order]


def _change(curvature: FloatArray) -> FloatArray:
    """Return the density [1/m^3] of the curvature's random walk that builds this curvature up over a clothoid."""
    return np.asarray((curvature + 1.0 / STRAIGHT_RADIUS_M) ** 2 / CLOTHOID_M)


def _largest_near(values: FloatArray, t_m: FloatArray) -> FloatArray:
    """Return the largest value within `_NEAR_M` along the line (stations are about evenly spaced)."""
    spacing = max(float(np.median(np.diff(t_m))), 0.05) if len(t_m) > 1 else 1.0
    size = 2 * int(np.ceil(_NEAR_M / spacing)) + 1
    return np.asarray(maximum_filter1d(values, size, mode="nearest"))


def _left(direction: FloatArray) -> FloatArray:
    """Return the unit vectors (n, 2) to the left of directions (n, 2)."""
    return np.stack([-direction[:, 1], direction[:, 0]], axis=1)
