"""Front wheels: their distances in distances of the rear wheels, and back.

In a turn the front wheels travel farther than the rear axle, where the vehicle frame has its origin, since they also
move sideways. Over a step in which the vehicle turns by T, a rear wheel travels r and the front wheel on its side

    f = sqrt(r^2 + (L T)^2),    r_left - r_right = t T    (T clockwise)

with the wheelbase L and the track t: each wheel rolls in the direction in which its hub moves, as steered wheels do
but for the slip of their tyres of a few degrees, which changes a distance by a tenth of a per cent. f / r is
1 / cos of the steering angle (R. N. Jazar, Vehicle Dynamics, 2nd ed., 7.1, kinematic steering).
"""

from __future__ import annotations

import numpy as np

from linework.arrays import FloatArray

#: Largest sine of a steering angle: wheels are turned by up to 45 degrees; 53 leave room for the noise of a step.
_MOST_SINE = 0.8
#: Largest square of its tangent in the turn by the difference of the wheels, which goes to infinity at 45 degrees.
_MOST_TANGENT_SQUARE = 0.5
#: Shorter steps are rest. [m]
_LEAST_STEP_M = 1e-9


def rear_steps(step_m: FloatArray, turn_rad: FloatArray, wheelbase_m: float) -> tuple[FloatArray, FloatArray]:
    """Return the distances of the rear wheels from those of the front wheels, and their changes by a wheel's scale.

    Parameters
    ----------
    step_m
        (n, 2) distances of the left and the right front wheel, negative backward. [m]
    turn_rad
        (n,) turn of the vehicle in the same time. [rad]
    wheelbase_m
        0 where the rear wheels are counted: distances stay as they are.

    Returns
    -------
    (n, 2) distances of the rear wheels, and (n, 2) their derivatives by the scale of the wheel: f^2 / r. [m]

    Examples
    --------
    A quarter of a circle of 9 m, which the middle of a front axle 3 m ahead runs at 9.49 m:

    >>> front = np.pi / 2 * np.hypot(9.0, 3.0) * np.ones((1, 2))
    >>> rear, _ = rear_steps(front, np.array([np.pi / 2]), 3.0)
    >>> rear.round(3).tolist(), round(np.pi / 2 * 9.0, 3)
    ([[14.137, 14.137]], 14.137)
    """
    if wheelbase_m == 0.0:
        return step_m, step_m
    aside = np.abs(wheelbase_m * turn_rad)[:, None]
    moved = np.abs(step_m) > _LEAST_STEP_M
    sine = np.minimum(np.divide(aside, np.abs(step_m), out=np.zeros_like(step_m), where=moved), _MOST_SINE)
    cosine = np.sqrt(1.0 - sine * sine)
    return step_m * cosine, step_m / cosine


def front_steps(step_m: FloatArray, turn_rad: FloatArray, wheelbase_m: float) -> FloatArray:
    """Return the distances (n,) of front wheels whose rear wheels travel `step_m` (n,) while the vehicle turns (n,)."""
    if wheelbase_m == 0.0:
        return step_m
    return np.asarray(np.copysign(np.hypot(step_m, wheelbase_m * turn_rad), step_m))


def turns_of_wheels(step_m: FloatArray, track_m: float, wheelbase_m: float) -> FloatArray:
    """Return the clockwise turns (n,) [rad] that the distances (n, 2) [m] of the left and the right wheel show.

    Notes
    -----
    Of front wheels, f_l^2 - f_r^2 = 2 v t T and (f_l^2 + f_r^2) / 2 = v^2 + (L^2 + t^2 / 4) T^2 for the distance v of
    the middle of the rear axle: a quadratic equation for v^2, whose larger root is a steering angle below 45 degrees.
    """
    if wheelbase_m == 0.0:
        return np.asarray((step_m[:, 0] - step_m[:, 1]) / track_m)
    square = step_m**2
    difference, mean = square[:, 0] - square[:, 1], 0.5 * square.sum(axis=1)
    inner = mean**2 - (wheelbase_m**2 + 0.25 * track_m**2) * (difference / track_m) ** 2
    middle = np.sqrt(0.5 * (mean + np.sqrt(np.maximum(inner, 0.0))))
    moved = middle > _LEAST_STEP_M
    turn = np.divide(difference, 2.0 * middle * track_m, out=np.zeros_like(middle), where=moved)
    # Backward, the wheel that travels farther is on the other side
    return np.asarray(np.where(step_m.sum(axis=1) < 0.0, -turn, turn))


def turn_by_scale(
    far_m: FloatArray, turn_rad: FloatArray, wheelbase_m: float
) -> tuple[FloatArray, FloatArray]:
    """Return by how much the distance depends on the turn, and the turn on the wheels' scales, (n,) each.

    Parameters
    ----------
    far_m, turn_rad
        (n,) distances of the middle of the rear axle [m], and turns [rad].

    Returns
    -------
    Derivative of the distance by the turn, -L^2 T / v [m/rad]; and the factor 1 / (1 - tan^2) of the derivative of the
    turn by the scales, where the turn is that of the wheels: a longer way of one wheel is turn, which is way of both.
    """
    if wheelbase_m == 0.0:
        return np.zeros_like(far_m), np.ones_like(far_m)
    moved = np.abs(far_m) > _LEAST_STEP_M
    tangent = np.divide(wheelbase_m * turn_rad, far_m, out=np.zeros_like(far_m), where=moved)
    most = _MOST_SINE / np.sqrt(1.0 - _MOST_SINE**2)
    by_turn = -wheelbase_m * np.clip(tangent, -most, most)
    return by_turn, 1.0 / (1.0 - np.minimum(tangent**2, _MOST_TANGENT_SQUARE))
