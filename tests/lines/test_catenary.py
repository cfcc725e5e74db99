"""The catenary: the curve, its fit, its sigma, and where two of them meet."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from linework.lines.catenary import Catenary, CatenaryFit, fit_catenary, meeting_stations

LEVEL = Catenary.from_lowest(20.0, 6.0, 250.0)


def textbook(s, s0, z0, a):
    return z0 + a * (np.cosh((s - s0) / a) - 1.0)


def test_the_curve_is_the_textbook_one():
    s = np.linspace(-10.0, 60.0, 71)
    assert np.allclose(LEVEL.height_at(s), textbook(s, 20.0, 6.0, 250.0), atol=1e-12)
    assert np.allclose(LEVEL.slope_at(s), np.sinh((s - 20.0) / 250.0), atol=1e-12)


def test_reference_station_is_free():
    fit = fit_catenary(np.linspace(0, 50, 60), LEVEL.height_at(np.linspace(0, 50, 60)))
    s = np.linspace(-5, 70, 40)
    assert np.allclose(fit.curve.height_at(s), LEVEL.height_at(s), atol=1e-9)
    assert fit.sigma_m < 1e-9


@given(st.floats(8.0, 200.0), st.floats(-0.3, 0.3), st.floats(0.0, 0.05), st.integers(0, 10**6))
def test_fit_recovers_any_hanging_wire(length, slope, share, seed):
    wire = Catenary(0.4 * length, 7.0, slope, 8.0 * share / length)
    s = np.sort(np.random.default_rng(seed).uniform(0.0, length, 40))
    fit = fit_catenary(s, wire.height_at(s))
    assert np.allclose(fit.curve.height_at(s), wire.height_at(s), atol=1e-6)


def test_straight_is_a_line():
    s = np.array([0.0, 10.0, 20.0])
    fit = fit_catenary(s, 5.0 + 0.1 * s, straight=True)
    assert fit.curve.curvature_per_m == 0.0
    assert np.allclose(fit.curve.height_at(np.array([30.0])), 8.0)


def test_weights_silence_points():
    s = np.linspace(0, 40, 30)
    z = LEVEL.height_at(s)
    z[7] += 3.0
    weights = np.ones(30)
    weights[7] = 0.0
    assert abs(fit_catenary(s, z, weights).curve.curvature_per_m - 1 / 250) < 1e-9
    assert abs(fit_catenary(s, z).curve.curvature_per_m - 1 / 250) > 1e-4


def test_too_few_points_are_an_error():
    with pytest.raises(ValueError, match="2 points, a catenary needs at least 3"):
        fit_catenary(np.array([0.0, 1.0]), np.array([5.0, 5.0]))


def test_height_sigma_is_honest():
    rng = np.random.default_rng(5)
    s = np.linspace(0, 40, 50)
    at = np.array([0.0, 10.0, 20.0, 40.0, 45.0])
    ratios = []
    for _ in range(200):
        fit = fit_catenary(s, LEVEL.height_at(s) + rng.normal(0, 0.02, 50))
        ratios.append((fit.curve.height_at(at) - LEVEL.height_at(at)) / fit.height_sigma_at(at))
    assert np.all(np.abs(np.sqrt(np.mean(np.square(ratios), axis=0)) - 1.0) < 0.15)


def test_curvature_sigma_is_honest():
    rng = np.random.default_rng(6)
    s = np.linspace(0, 40, 50)
    fits: list[CatenaryFit] = [
        fit_catenary(s, LEVEL.height_at(s) + rng.normal(0, 0.02, 50)) for _ in range(200)
    ]
    ratio = [(f.curve.curvature_per_m - 1 / 250) / f.curvature_sigma_per_m for f in fits]
    assert abs(np.std(ratio) - 1.0) < 0.15


def test_neighbouring_spans_meet_at_their_support():
    left = Catenary(20.0, 7.0, 0.0, 8.0 / 40.0**2)
    right = Catenary(60.0, 7.0, 0.0, 8.0 / 40.0**2)
    stations = meeting_stations(left, right, 30.0, 50.0)
    assert len(stations) == 1
    assert stations[0] == pytest.approx(40.0, abs=1e-6)
    assert left.height_at(stations) == pytest.approx(right.height_at(stations), abs=1e-9)


def test_wires_one_above_another_meet_nowhere():
    upper = Catenary(LEVEL.station_m, LEVEL.height_m + 0.4, LEVEL.slope, LEVEL.curvature_per_m)
    assert len(meeting_stations(LEVEL, upper, 0.0, 40.0)) == 0
