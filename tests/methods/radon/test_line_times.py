"""When lines were measured: from the times of the points on them."""

import numpy as np
import pytest

from linework.kernels.tracking.times import times_near
from linework.methods.rails.stretches import with_times
from linework.model.lines import LineSet
from linework.model.points import Points

ORIGIN = np.array([500_000.0, 5_400_000.0, 100.0])


def slow_twin(xyz, time_s, vertices, owner, n_lines, reach):
    start, end = np.full(n_lines, np.nan), np.full(n_lines, np.nan)
    for line in range(n_lines):
        away = np.linalg.norm(xyz[:, None] - vertices[owner == line][None], axis=2).min(
            axis=1, initial=np.inf
        )
        if (away <= reach).any():
            start[line], end[line] = time_s[away <= reach].min(), time_s[away <= reach].max()
    return start, end


@pytest.mark.parametrize("form", [times_near, times_near.py_func])
@pytest.mark.parametrize("seed", range(5))
def test_the_kernel_equals_its_slow_twin_in_any_order(form, seed):
    rng = np.random.default_rng(seed)
    xyz = rng.uniform(0, [8, 5, 2], (600, 3)) + ORIGIN
    time_s = rng.uniform(0, 9, 600)
    vertices = rng.uniform(0, [8, 5, 2], (12, 3)) + ORIGIN
    vertices[0] = xyz[:, 0].min() - 5, xyz[:, 1].max() + 5, 100.0  # a line of its own, without points
    owner = np.sort(rng.integers(1, 5, 12))
    owner[0] = 0
    expected = slow_twin(xyz, time_s, vertices, owner, 6, 0.3)
    order = rng.permutation(600)
    for points, times in ((xyz, time_s), (xyz[order], time_s[order])):
        np.testing.assert_array_equal(form(points, times, vertices, owner, 6, 0.3), expected)
    assert np.isnan(expected[0][[0, 5]]).all()
    assert np.isfinite(expected[0]).any()


def test_lines_that_know_their_times_keep_them():
    line = np.array([[0.0, 0.0, 1.0], [0.5, 0.0, 1.0], [1.0, 0.0, 1.0]])
    points = Points(np.array([[0.1, 0.0, 0.9], [0.6, 0.1, 1.0], [0.5, 0.0, 0.0]]), time_s=[5.0, 6.0, 99.0])
    lines = LineSet.from_lines(
        [line, line], kind=["cable", "guardrail"], time_start_s=[1.0, np.nan], time_end_s=[2.0, np.nan]
    )
    timed = with_times(lines, points)
    assert timed.time_start_s.tolist() == [1.0, 5.0]
    assert timed.time_end_s.tolist() == [2.0, 6.0]
    assert with_times(lines, Points(points.xyz)) is lines
    assert len(with_times(LineSet.empty(), points)) == 0
