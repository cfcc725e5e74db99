"""How often a place was really measured: the true scan lines, passes and beams with points near it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from linework.arrays import AnyArray, FloatArray, IntArray
from linework.simulation.simulate import SimulatedSurvey


@dataclass(frozen=True, slots=True)
class Crossings:
    """Independent measurements at stations.

    Parameters
    ----------
    n_sweeps, n_strips, n_beams
        (k,) int64: how many different scan lines, passes (flight strips, stations) and beams have points there.
    n_points
        (k,) int64.
    """

    n_sweeps: IntArray
    n_strips: IntArray
    n_beams: IntArray
    n_points: IntArray


def count_crossings(survey: SimulatedSurvey, stations: FloatArray, within_m: float) -> Crossings:
    """Return how many scan lines, passes and beams have points within a distance of each station, by their truth.

    Points of one scan line share its error, however many they are: the number of scan lines is the number of
    independent measurements (n_eff) of a line at that station.

    Parameters
    ----------
    stations
        (k, 3) float64 [m, world]: places on a line, such as `truth.xyz`.
    within_m
        Distance in space. [m]

    Examples
    --------
    >>> from linework.simulation.simulate import simulate_survey
    >>> survey = simulate_survey("straight", 1, 40.0, points_per_m=2000, scanner="one")
    >>> middle = survey.trajectory.xyz[len(survey.trajectory) // 2][None]
    >>> found = count_crossings(survey, middle, 0.5)
    >>> bool(found.n_points[0] > found.n_sweeps[0] > 1), found.n_beams.tolist()
    (True, [1])
    """
    near = cKDTree(stations).sparse_distance_matrix(
        cKDTree(survey.points.xyz), within_m, output_type="ndarray"
    )
    station, point = near["i"].astype(np.int64), near["j"].astype(np.int64)
    k = len(stations)
    return Crossings(
        n_sweeps=_different(station, survey.sweep[point], k),
        n_strips=_different(station, survey.strip[point], k),
        n_beams=_different(station, survey.beam[point], k),
        n_points=np.bincount(station, minlength=k),
    )


def _different(station: IntArray, number: AnyArray, k: int) -> IntArray:
    """Return how many different numbers each of `k` stations has."""
    pairs = np.unique(np.stack([station, number.astype(np.int64)], axis=1), axis=0)
    return np.bincount(pairs[:, 0], minlength=k)
