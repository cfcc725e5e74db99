"""Paint that is worn, under a spinning scanner whose lasers see things differently bright."""

from __future__ import annotations

import numpy as np
import pytest

import linework
from linework.scanlines.sampled import gains_of_points

LENGTH_M = 30.0
ORIGIN = np.array([500_000.0, 5_600_000.0, 100.0])


def worn_line(seed: int, paint: float = 1.4) -> linework.Points:
    """Return a road of 16 lasers with gains of 0.4 to 2.5, and a line of 12 cm that is 1.4 times as bright."""
    rng = np.random.default_rng(seed)
    n = int(LENGTH_M * 8 * 800)
    x, y = rng.uniform(0.0, LENGTH_M, n), rng.uniform(-4.0, 4.0, n)
    ring = rng.integers(0, 16, n)
    gain = np.exp(np.linspace(-0.9, 0.9, 16))[(7 * ring) % 16]
    bright = np.where(np.abs(y - 1.0) < 0.06, paint, 1.0) * gain * rng.lognormal(0.0, 0.1, n)
    xyz = np.column_stack([x, y, rng.normal(0.0, 0.005, n)]) + ORIGIN
    return linework.Points(
        xyz, intensity=np.round(2000.0 * bright), time_s=x / 10.0, crs="EPSG:25832", ring=ring
    )


@pytest.mark.parametrize("turned", [False, True])
def test_gains_of_lasers_are_found_in_any_order(turned):
    points = worn_line(9895)
    gains = gains_of_points(points.take(np.arange(len(points))[:: -1 if turned else 1]))
    expected = np.exp(np.linspace(-0.9, 0.9, 16))[(7 * np.arange(16)) % 16]
    assert gains.column == "ring"
    ratio = gains.gain / expected
    assert np.ptp(np.log(ratio)) < 0.02
    assert gains.gain.tobytes() == gains_of_points(points).gain.tobytes()


def test_lasers_may_have_any_numbers():
    points = worn_line(9895)
    far = linework.Points(
        points.xyz,
        intensity=points.intensity,
        time_s=points.time_s,
        crs="EPSG:25832",
        ring=points.columns["ring"] + 60_000,
    )
    gains = gains_of_points(far)
    assert gains.gain[60_000:].tobytes() == gains_of_points(points).gain.tobytes()
    assert (
        gains.without(far).intensity.tobytes() == gains_of_points(points).without(points).intensity.tobytes()
    )


def test_points_of_one_laser_keep_their_intensities():
    points = worn_line(9896)
    single = linework.Points(points.xyz, intensity=points.intensity, time_s=points.time_s, crs="EPSG:25832")
    gains = gains_of_points(single)
    assert gains.column == ""
    assert gains.without(single) is single


def test_worn_paint_is_found_whatever_the_lasers_gains():
    lines = linework.extract(worn_line(9897), kinds=("lane_marking",), adjust=False)
    assert lines.kind.tolist() == ["lane_marking"]
    assert np.abs(lines.xyz[:, 1] - ORIGIN[1] - 1.0).max() <= 0.02
    assert np.ptp(lines.xyz[:, 0]) >= 0.95 * LENGTH_M
