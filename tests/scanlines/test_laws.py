"""What holds for any input: order of points, tiles, and places far from the origin do not change scan lines."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from linework.errors import UsageError
from linework.model.points import Points
from linework.scanlines.recover import recover_scan_lines
from linework.scanlines.timing import scanner_timing
from linework.simulation.simulate import simulate_survey

COLUMNS = ("rank", "position_m", "direction", "spacing_along_m", "spacing_across_m", "beam", "line")
#: What lies within this distance of a point decides about it; see `recover_scan_lines`. [m]
BUFFER_M = 5.0


@pytest.fixture(scope="module", params=["default", "tilted", "spinning16", "airborne", "unordered"])
def surveyed(request):
    kind = "tilted" if request.param == "unordered" else request.param
    survey = simulate_survey(
        "urban", 3, 40.0, points_per_m=None if kind == "airborne" else 3000.0, scanner=kind
    )
    points = survey.points
    if request.param == "unordered":
        points = Points(points.xyz)
    return request.param, points, scanner_timing(points)


def test_the_order_of_the_points_does_not_matter(surveyed):
    _, points, _ = surveyed
    lines = recover_scan_lines(points)
    for seed in range(2):
        order = np.random.default_rng(seed).permutation(len(points))
        shuffled = recover_scan_lines(points.take(order))
        assert (shuffled.kind, shuffled.how, shuffled.n_lines) == (lines.kind, lines.how, lines.n_lines)
        for name in COLUMNS:
            np.testing.assert_array_equal(getattr(shuffled, name), getattr(lines, name)[order], err_msg=name)
        np.testing.assert_array_equal(order[shuffled.order], lines.order)
        np.testing.assert_array_equal(shuffled.line_time_s, lines.line_time_s)


def test_tiles_give_the_lines_of_the_whole(surveyed):
    kind, points, timing = surveyed
    whole = recover_scan_lines(points, timing)
    buffer = (
        120.0 * timing.spacing_m
        if kind == "unordered"
        else max(BUFFER_M, 2.0 * timing.half_chord_m + timing.leap_m)
    )
    low, high = points.xyz[:, :2].min(axis=0), points.xyz[:, :2].max(axis=0)
    middle = 0.5 * (low + high)
    for core in ((low, middle), (middle, high)):
        away = np.maximum(core[0] - points.xyz[:, :2], points.xyz[:, :2] - core[1]).max(axis=1)
        tile = np.flatnonzero(away < buffer)
        part = recover_scan_lines(points.take(tile), timing)
        own = np.flatnonzero(away[tile] < 0.0)
        if len(own) == 0:
            continue
        at = tile[own]
        assert len(tile) < len(points)
        # Which points are of one line: the same, wherever the lines have their numbers
        pairs = cKDTree(points.xyz[at]).query_pairs(0.3, output_type="ndarray")[:100_000]
        together = part.line[own][pairs[:, 0]] == part.line[own][pairs[:, 1]]
        np.testing.assert_array_equal(together, whole.line[at][pairs[:, 0]] == whole.line[at][pairs[:, 1]])
        np.testing.assert_array_equal(part.beam[own], whole.beam[at])
        # Points of one line that something far behind parts in the whole may be neighbours in the tile that lacks it
        same = (part.direction[own] == whole.direction[at]) | np.isnan(whole.direction[at])
        assert np.mean(same) > 0.998
        near = whole.spacing_along_m[at] < 1.0
        assert np.mean((part.spacing_along_m[own] == whole.spacing_along_m[at])[near]) > 0.998
        # The nearest point of the next line is looked for from the last one found: among leaves another may be as near
        near = whole.spacing_across_m[at] < 1.0
        assert np.mean((part.spacing_across_m[own] == whole.spacing_across_m[at])[near]) > 0.98


def test_lines_of_a_part_need_the_columns_of_the_whole():
    points = simulate_survey("straight", 1, 40.0, points_per_m=2000.0, scanner="tilted").points
    timing = scanner_timing(points)
    with pytest.raises(UsageError, match="no column 'point_source_id', which tells lasers and heads apart"):
        recover_scan_lines(Points(points.xyz, time_s=points.time_s), timing)
    other = scanner_timing(points.take(points["scanner_channel"] == 0))
    assert other.used == ("point_source_id",)
    assert recover_scan_lines(points.take(points["scanner_channel"] == 0), timing).n_lines > 100
