"""Lines smoothed through measured places: a Kalman filter along the line, a Rauch-Tung-Striebel smoother back.

H. E. Rauch, F. Tung, C. T. Striebel (1965), doi:10.2514/3.3166.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from linework.arrays import FloatArray

#: Variances that a line in plan begins with: a place known to a metre, any direction, any curvature down to a bend of
#: 2 m. [m^2, -, 1/m^2]
FIRST_PLANE = (1.0, 1.0, 0.25)
#: Variances that heights begin with: 10 m, and any grade. [m^2, -]
FIRST_HEIGHT = (100.0, 1.0)
#: State of a line beside an axis: offset across [m], direction, curvature [1/m], offset up [m], grade.
BESIDE_ACROSS, BESIDE_HEADING, BESIDE_CURVATURE, BESIDE_UP, BESIDE_GRADE = range(5)
#: Variances that it begins with: a place known to a metre, a direction to 0.3, a curvature to 0.1 / m, a grade to 0.3.
FIRST_BESIDE = (1.0, 0.1, 0.01, 1.0, 0.1)


@njit(cache=True, nogil=True)
def smooth_plane(
    t: FloatArray, xy: FloatArray, variance: FloatArray, change: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Smooth places in plan along a line whose curvature is a random walk.

    The state is the place, the direction and the curvature vector, each in x and y; both axes share one covariance.

    Parameters
    ----------
    t
        (n,) ascending: distance along the line. [m]
    xy
        (n, 2) measured places. [m]
    variance
        (n,) variance of a measurement [m^2]; inf where nothing was measured.
    change
        (n,) density of the curvature's random walk up to each place. [1/m^3]

    Returns
    -------
    states
        (n, 3, 2): place [m], direction, curvature [1/m].
    covariance
        (n, 3, 3) of the states, the same for both axes.
    innovation
        (n,) squared innovation over its variance, of both axes (expected: 2); 0 where nothing was measured.
    """
    n = len(t)
    state, cov = np.zeros((n, 3, 2)), np.zeros((n, 3, 3))
    state_before, cov_before = np.zeros((n, 3, 2)), np.zeros((n, 3, 3))
    innovation = np.zeros(n)
    step, noise = np.eye(3), np.zeros((3, 3))
    x, p = np.zeros((3, 2)), np.zeros((3, 3))
    x[0] = xy[0]
    p[0, 0], p[1, 1], p[2, 2] = FIRST_PLANE
    for k in range(n):
        if k > 0:
            d = t[k] - t[k - 1]
            step[0, 1], step[0, 2], step[1, 2] = d, 0.5 * d * d, d
            q = change[k]
            noise[0, 0], noise[0, 1], noise[0, 2] = q * d**5 / 20.0, q * d**4 / 8.0, q * d**3 / 6.0
            noise[1, 0], noise[1, 1], noise[1, 2] = q * d**4 / 8.0, q * d**3 / 3.0, q * d**2 / 2.0
            noise[2, 0], noise[2, 1], noise[2, 2] = q * d**3 / 6.0, q * d**2 / 2.0, q * d
            x = step @ x
            p = step @ p @ step.T + noise
        state_before[k], cov_before[k] = x, p
        if np.isfinite(variance[k]):
            s = p[0, 0] + variance[k]
            gain = p[:, 0] / s
            e0, e1 = xy[k, 0] - x[0, 0], xy[k, 1] - x[0, 1]
            innovation[k] = (e0 * e0 + e1 * e1) / s
            row = p[0].copy()
            for i in range(3):
                x[i, 0] += gain[i] * e0
                x[i, 1] += gain[i] * e1
                for j in range(3):
                    p[i, j] -= gain[i] * row[j]
        state[k], cov[k] = x, p
    for k in range(n - 2, -1, -1):
        d = t[k + 1] - t[k]
        step[0, 1], step[0, 2], step[1, 2] = d, 0.5 * d * d, d
        back = cov[k] @ step.T @ np.linalg.inv(cov_before[k + 1])
        state[k] += back @ (state[k + 1] - state_before[k + 1])
        cov[k] += back @ (cov[k + 1] - cov_before[k + 1]) @ back.T
    return state, cov, innovation


@njit(cache=True, nogil=True)
def smooth_height(
    t: FloatArray, z: FloatArray, variance: FloatArray, change: float
) -> tuple[FloatArray, FloatArray]:
    """Smooth heights along a line whose grade is a random walk.

    Parameters
    ----------
    t
        (n,) ascending: distance along the line. [m]
    z
        (n,) measured heights. [m]
    variance
        (n,) variance of a measurement [m^2]; inf where nothing was measured.
    change
        Density of the grade's random walk. [1/m]

    Returns
    -------
    (n,) heights [m] and (n,) their variances [m^2].
    """
    n = len(t)
    h, g = np.zeros(n), np.zeros(n)
    p00, p01, p11 = np.zeros(n), np.zeros(n), np.zeros(n)
    # State and covariance before each measurement: height, grade, and their three covariances
    b = np.zeros((n, 5))
    a0, a1, c01 = z[0], 0.0, 0.0
    c00, c11 = FIRST_HEIGHT
    for k in range(n):
        if k > 0:
            d = t[k] - t[k - 1]
            a0 += d * a1
            c00 += 2.0 * d * c01 + d * d * c11 + change * d**3 / 3.0
            c01 += d * c11 + change * d * d / 2.0
            c11 += change * d
        b[k] = a0, a1, c00, c01, c11
        if np.isfinite(variance[k]):
            s = c00 + variance[k]
            e, k0, k1 = z[k] - a0, c00 / s, c01 / s
            a0, a1 = a0 + k0 * e, a1 + k1 * e
            c11 -= k1 * c01
            c01 -= k0 * c01
            c00 -= k0 * c00
        h[k], g[k], p00[k], p01[k], p11[k] = a0, a1, c00, c01, c11
    for k in range(n - 2, -1, -1):
        d = t[k + 1] - t[k]
        q0, q1, q00, q01, q11 = b[k + 1]
        det = q00 * q11 - q01 * q01
        # The covariance of this state with the next, times the inverse of the covariance of the next
        m00, m01 = p00[k] + d * p01[k], p01[k]
        m10, m11 = p01[k] + d * p11[k], p11[k]
        g00, g01 = (m00 * q11 - m01 * q01) / det, (m01 * q00 - m00 * q01) / det
        g10, g11 = (m10 * q11 - m11 * q01) / det, (m11 * q00 - m10 * q01) / det
        e0, e1 = h[k + 1] - q0, g[k + 1] - q1
        d00, d01, d11 = p00[k + 1] - q00, p01[k + 1] - q01, p11[k + 1] - q11
        h[k] += g00 * e0 + g01 * e1
        g[k] += g10 * e0 + g11 * e1
        p00[k] += g00 * g00 * d00 + 2.0 * g00 * g01 * d01 + g01 * g01 * d11
        p01[k] += g00 * (g10 * d00 + g11 * d01) + g01 * (g10 * d01 + g11 * d11)
        p11[k] += g10 * g10 * d00 + 2.0 * g10 * g11 * d01 + g11 * g11 * d11
    return h, np.maximum(p00, 0.0)


@njit(cache=True, nogil=True)
def smooth_beside(
    information: FloatArray, right: FloatArray, spacing: float, bending: float, grading: float
) -> tuple[FloatArray, FloatArray]:
    """Smooth the offsets of a line from an axis, across and up together, from sightings in images.

    A sighting measures a sum of both offsets, h x with h = (1, lift). Curvature and grade are random walks.

    Parameters
    ----------
    information
        (n, 2, 2) sum of h h' / variance over the sightings at each station. [1/m^2]
    right
        (n, 2) sum of h times the measured sum / variance. [1/m]
    spacing
        Of the stations. [m]
    bending, grading
        Densities of the random walks of curvature and grade. [1/m^3, 1/m]

    Returns
    -------
    offsets
        (n, 2) across and up. [m]
    spread
        (n, 2, 2) their covariance. [m^2]
    """
    n, d = len(right), spacing
    f = np.eye(5)
    (
        f[BESIDE_ACROSS, BESIDE_HEADING],
        f[BESIDE_ACROSS, BESIDE_CURVATURE],
        f[BESIDE_HEADING, BESIDE_CURVATURE],
        f[BESIDE_UP, BESIDE_GRADE],
    ) = d, 0.5 * d * d, d, d
    q = np.zeros((5, 5))
    q[BESIDE_ACROSS, BESIDE_ACROSS], q[BESIDE_HEADING, BESIDE_HEADING] = (
        bending * d**5 / 20.0,
        bending * d**3 / 3.0,
    )
    q[BESIDE_CURVATURE, BESIDE_CURVATURE] = bending * d
    q[BESIDE_ACROSS, BESIDE_HEADING] = q[BESIDE_HEADING, BESIDE_ACROSS] = bending * d**4 / 8.0
    q[BESIDE_ACROSS, BESIDE_CURVATURE] = q[BESIDE_CURVATURE, BESIDE_ACROSS] = bending * d**3 / 6.0
    q[BESIDE_HEADING, BESIDE_CURVATURE] = q[BESIDE_CURVATURE, BESIDE_HEADING] = bending * d**2 / 2.0
    q[BESIDE_UP, BESIDE_UP], q[BESIDE_GRADE, BESIDE_GRADE] = grading * d**3 / 3.0, grading * d
    q[BESIDE_UP, BESIDE_GRADE] = q[BESIDE_GRADE, BESIDE_UP] = grading * d**2 / 2.0
    before, p_before = np.zeros((n, 5)), np.zeros((n, 5, 5))
    state, cov = np.zeros((n, 5)), np.zeros((n, 5, 5))
    x, p = np.zeros(5), np.zeros((5, 5))
    (
        p[BESIDE_ACROSS, BESIDE_ACROSS],
        p[BESIDE_HEADING, BESIDE_HEADING],
        p[BESIDE_CURVATURE, BESIDE_CURVATURE],
        p[BESIDE_UP, BESIDE_UP],
        p[BESIDE_GRADE, BESIDE_GRADE],
    ) = FIRST_BESIDE
    observed = np.zeros((2, 5))
    observed[0, BESIDE_ACROSS], observed[1, BESIDE_UP] = 1.0, 1.0
    for k in range(n):
        if k > 0:
            x = f @ x
            p = f @ p @ f.T + q
        before[k], p_before[k] = x, p
        if information[k, 0, 0] > 0.0:
            hp = observed @ p
            gain = hp.T @ np.linalg.inv(np.eye(2) + information[k] @ hp @ observed.T)
            x = x + gain @ (right[k] - information[k] @ (observed @ x))
            p = p - gain @ information[k] @ hp
            p = 0.5 * (p + p.T)
        state[k], cov[k] = x, p
    for k in range(n - 2, -1, -1):
        back = cov[k] @ f.T @ np.linalg.inv(p_before[k + 1])
        state[k] += back @ (state[k + 1] - before[k + 1])
        cov[k] += back @ (cov[k + 1] - p_before[k + 1]) @ back.T
    offsets, spread = np.zeros((n, 2)), np.zeros((n, 2, 2))
    for k in range(n):
        offsets[k, 0], offsets[k, 1] = state[k, BESIDE_ACROSS], state[k, BESIDE_UP]
        spread[k, 0, 0], spread[k, 1, 1] = cov[k, BESIDE_ACROSS, BESIDE_ACROSS], cov[k, BESIDE_UP, BESIDE_UP]
        spread[k, 0, 1] = spread[k, 1, 0] = cov[k, BESIDE_ACROSS, BESIDE_UP]
    return offsets, spread
