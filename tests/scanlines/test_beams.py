"""Biases of beams against those that a survey was simulated with."""

import numpy as np
import pytest

from linework.model.points import Points
from linework.scanlines.beams import beam_biases
from linework.scanlines.recover import recover_scan_lines
from linework.simulation.simulate import simulate_survey


def test_gains_of_lasers_are_those_they_were_simulated_with_but_for_range_and_incidence():
    survey = simulate_survey("straight", 4, 60.0, points_per_m=12_000.0, scanner="spinning16")
    lines = recover_scan_lines(survey.points)
    found = beam_biases(survey.points, lines)
    head = survey.scenario.scanners[0]
    known = np.isfinite(found.gain_sigma)
    assert np.count_nonzero(known) >= 5
    true = np.log(np.asarray(head.gain))[found.beam[known]]
    logs = np.log(found.gain[known])
    # Range and incidence change smoothly from laser to laser
    own, smooth = (
        v - np.polyval(np.polyfit(found.beam[known], v, 3), found.beam[known]) for v in (logs, true)
    )
    assert np.corrcoef(own, smooth)[0, 1] > 0.75
    # Within a cell of asphalt all lasers see about the same brightness afterwards
    cell = np.floor(survey.points.xyz[:, :2] / 0.5).astype(np.int64)
    _, cell = np.unique(cell[:, 0] * 10**7 + cell[:, 1], return_inverse=True)
    before, after = (
        _between_beams(cell, found.index, v)
        for v in (survey.points.intensity, found.intensities(survey.points.intensity))
    )
    assert after < 0.6 * before
    corrected = found.intensities(survey.points.intensity)
    assert corrected.dtype == np.float32
    assert corrected[0] == pytest.approx(survey.points.intensity[0] / found.gain[found.index[0]], rel=1e-5)


def _between_beams(cell, beam, intensity):
    """Return the median over cells of how much the medians of their lasers differ, in logarithms."""
    spread = []
    for own in np.split(np.argsort(cell, kind="stable"), np.cumsum(np.bincount(cell))[:-1]):
        bright = [
            np.median(intensity[own][beam[own] == b])
            for b in np.unique(beam[own])
            if np.sum(beam[own] == b) >= 5
        ]
        bright = [b for b in bright if b > 0]
        if len(bright) > 1:
            spread.append(np.std(np.log(bright)))
    assert len(spread) > 20
    return np.median(spread)


def level_ground(biases, gains, seed=1):
    """Return a lidar's points on a level field whose beams are off by known heights and gains."""
    rng = np.random.default_rng(seed)
    n = 60_000
    beam = rng.integers(0, len(biases), n)
    xy = rng.uniform(0.0, 20.0, (n, 2))
    slope = 0.02 * xy[:, 0]
    z = slope + np.asarray(biases)[beam] + rng.normal(0.0, 0.01, n)
    # Bright patches with sharp edges
    ground = np.where(np.sin(xy[:, 0]) > 0.8, 90.0, 30.0)
    intensity = ground * np.asarray(gains)[beam] * np.exp(rng.normal(0.0, 0.1, n))
    time = np.sort(rng.uniform(0.0, 2.0, n))
    return Points(np.column_stack([xy, z]), intensity=intensity, time_s=time, ring=beam)


def test_heights_and_gains_are_known_to_millimetres_and_percent():
    biases = np.array([0.0, 0.012, -0.02, 0.005, 0.03, 0.0])
    gains = np.array([1.0, 1.2, 0.8, 1.1, 0.9, 1.4])
    points = level_ground(biases, gains)
    found = beam_biases(points, recover_scan_lines(points))
    np.testing.assert_array_equal(found.beam, np.arange(6))
    off = found.height_m - (biases - biases.mean())
    np.testing.assert_allclose(off - off.mean(), 0.0, atol=0.001)
    assert np.all(found.height_sigma_m < 0.001)
    assert np.abs(off / found.height_sigma_m).max() < 6.0
    ratio = found.gain / gains
    np.testing.assert_allclose(ratio / ratio.mean(), 1.0, atol=0.02)
    corrected = found.heights(points.xyz[:, 2]) - 0.02 * points.xyz[:, 0]
    assert np.std(corrected) < 0.0105 < np.std(points.xyz[:, 2] - 0.02 * points.xyz[:, 0])
    assert np.sum(found.height_m[found.index]) == pytest.approx(0.0, abs=1e-6 * len(points))


def test_one_beam_alone_has_no_bias():
    points = level_ground([0.02] * 6, [1.0] * 6)
    alone = Points(points.xyz, intensity=points.intensity, time_s=points.time_s)
    found = beam_biases(alone, recover_scan_lines(alone))
    assert found.height_m.tolist() == [0.0]
    assert found.gain.tolist() == [1.0]
    assert np.isnan(found.height_sigma_m).all()
    without = Points(points.xyz, time_s=points.time_s, ring=points["ring"])
    assert np.all(beam_biases(without, recover_scan_lines(without)).gain == 1.0)


def test_values_of_other_points_are_refused():
    points = level_ground([0.0] * 6, [1.0] * 6)
    found = beam_biases(points, recover_scan_lines(points))
    with pytest.raises(ValueError, match="z: shape"):
        found.heights(points.xyz[:10, 2])
