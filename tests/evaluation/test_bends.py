"""Deviations of values between two lines, where they bend from station to station."""

import numpy as np
import pytest

from linework.evaluation.chainage.bends import with_bends
from linework.evaluation.chainage.crossings import crossings_at
from linework.evaluation.chainage.samples import Sample, station_samples
from linework.lines.crosscuts import axis_along, cross_cuts
from linework.model.lines import LineSet

DROP_M = (0.12, 0.12, 0.12, 0.12, 0.04, 0.04)


@pytest.mark.parametrize("start_m", [0.0, 0.25, 0.5, 100.5, 101.5, 123456.5])
def test_bends_are_seen_wherever_chainages_begin(start_m):
    kerb = [Sample(start_m + k, 4.0, "kerb", "upstand", "a", value, 0.002) for k, value in enumerate(DROP_M)]
    sigma = [one.sigma for one in with_bends(kerb)]
    np.testing.assert_allclose(sigma, [0.002, 0.002, 0.02, 0.02, 0.02, 0.02], atol=0.001)


def test_a_width_that_goes_over_to_another_line_is_no_bend():
    # The left boundary ends at 10.5 m, where a bay begins whose boundary lies 2.5 m farther out
    axis = axis_along("R", np.array([[0.0, 0.0, 0.0], [20.0, 0.0, 0.0]]))

    def widths(*left):
        rows = [[[0, -4, 0], [20, -4, 0]], *left]
        n_vertices = sum(len(row) for row in rows)
        lines = LineSet.from_lines(
            rows, kind=["road_boundary"] * len(rows), sigma_xy_m=np.full(n_vertices, 0.01)
        )
        crossings = crossings_at(lines, cross_cuts(lines, axis), len(axis.station_m))
        samples = with_bends(station_samples(axis, crossings))
        return [(one.value, one.sigma) for one in samples if one.quantity == "carriageway_width"]

    value, sigma = np.transpose(widths([[0, 4, 0], [10.5, 4, 0]], [[10.5, 6.5, 0], [20, 6.5, 0]]))
    np.testing.assert_allclose(value[[0, 10, 11, 20]], [8.0, 8.0, 10.5, 10.5])
    np.testing.assert_allclose(sigma, np.hypot(0.01, 0.01))
    one_line = widths([[0, 4, 0], [10.0, 4, 0], [16.0, 6.5, 0], [20, 6.5, 0]])
    assert one_line[10][1] > 0.1
