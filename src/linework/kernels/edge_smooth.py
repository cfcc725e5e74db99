"""A line on a smooth road, smoothed through what images show of it: across and height together."""

from __future__ import annotations

import numpy as np
from numba import njit

from linework.arrays import FloatArray


@njit(cache=True, nogil=True)
def smooth_beside(
    information: FloatArray, right: FloatArray, spacing: float, bending: float, grading: float
) -> tuple[FloatArray, FloatArray]:
    """Smooth offsets across and up from a course, whose curvature and grade wander.

    Parameters
    ----------
    information : (n, 2, 2) sum of h h' / variance over what was seen at each station, h = (1, lift) [1/m^2]
    right : (n, 2) sum of h seen / variance [1/m]
    spacing : between stations [m]
    bending, grading : densities of the random walks of curvature and grade [1/m^3, 1/m]

    Returns
    -------
    (n, 2) offset across and up. [m]
    (n, 2, 2) their covariance. [m^2]

    References
    ----------
    H. E. Rauch, F. Tung, C. T. Striebel (1965), doi:10.2514/3.3166.
    """
    n, d = len(right), spacing
    f = np.eye(5)
    f[0, 1], f[0, 2], f[1, 2], f[3, 4] = d, 0.5 * d * d, d, d
    q = np.zeros((5, 5))
    q[0, 0], q[1, 1], q[2, 2] = bending * d**5 / 20.0, bending * d**3 / 3.0, bending * d
    q[0, 1] = q[1, 0] = bending * d**4 / 8.0
    q[0, 2] = q[2, 0] = bending * d**3 / 6.0
    q[1, 2] = q[2, 1] = bending * d**2 / 2.0
    q[3, 3], q[4, 4] = grading * d**3 / 3.0, grading * d
    q[3, 4] = q[4, 3] = grading * d**2 / 2.0
    before, p_before = np.zeros((n, 5)), np.zeros((n, 5, 5))
    state, cov = np.zeros((n, 5)), np.zeros((n, 5, 5))
    x, p = np.zeros(5), np.zeros((5, 5))
    # A place known to a metre, a direction to 0.3, a curvature to 0.1 / m, a grade to 0.3
    p[0, 0], p[1, 1], p[2, 2], p[3, 3], p[4, 4] = 1.0, 0.1, 0.01, 1.0, 0.1
    seen = np.zeros((2, 5))
    seen[0, 0], seen[1, 3] = 1.0, 1.0
    for k in range(n):
        if k > 0:
            x = f @ x
            p = f @ p @ f.T + q
        before[k], p_before[k] = x, p
        if information[k, 0, 0] > 0.0:
            hp = seen @ p
            gain = hp.T @ np.linalg.inv(np.eye(2) + information[k] @ hp @ seen.T)
            x = x + gain @ (right[k] - information[k] @ (seen @ x))
            p = p - gain @ information[k] @ hp
            p = 0.5 * (p + p.T)
        state[k], cov[k] = x, p
    for k in range(n - 2, -1, -1):
        back = cov[k] @ f.T @ np.linalg.inv(p_before[k + 1])
        state[k] += back @ (state[k + 1] - before[k + 1])
        cov[k] += back @ (cov[k + 1] - p_before[k + 1]) @ back.T
    offsets, spread = np.zeros((n, 2)), np.zeros((n, 2, 2))
    for k in range(n):
        offsets[k, 0], offsets[k, 1] = state[k, 0], state[k, 3]
        spread[k, 0, 0], spread[k, 1, 1] = cov[k, 0, 0], cov[k, 3, 3]
        spread[k, 0, 1] = spread[k, 1, 0] = cov[k, 0, 3]
    return offsets, spread
