"""Lengths of dashes from the points at their ends: scan lines that cut all alike, and wear."""

import numpy as np
import pytest
from tests.conftest import CRS

from linework.evaluation.chainage.dash_ends import N_BEYOND, ends_of_dashes
from linework.evaluation.chainage.dash_lengths import dashes_of_stretch, likeliest_length
from linework.evaluation.chainage.paint_along import least_paint_ratios
from linework.evaluation.chainage.paint_points import paint_pieces
from linework.evaluation.chainage.rows import chainage_report
from linework.lines.crosscuts import axis_along
from linework.lines.dashes import MarkingRhythm
from linework.model.lines import LineSet
from linework.model.points import Points

WIDTH_M, DASH_M = 0.12, 3.0


def marking(found, period=9.0, n=11, first=4.0):
    """Return a dashed marking along x whose dashes were found with these lengths."""
    ends = [
        (first + k * period + 0.5 * (DASH_M - length), first + k * period + 0.5 * (DASH_M + length))
        for k, length in enumerate(np.broadcast_to(found, n).tolist())
    ]
    rows = [[[0.0, 0.0, 5.0], [first + n * period, 0.0, 5.0]], *([[a, 0, 5.0], [b, 0, 5.0]] for a, b in ends)]
    kinds = ["lane_marking", *["lane_marking_dash"] * n]
    return LineSet.from_lines(
        rows, kind=kinds, pattern="dashed", width_m=WIDTH_M, crs=CRS, id=[f"line {k}" for k in range(n + 1)]
    )


def cloud(
    spacing,
    *,
    period=9.0,
    n=11,
    first=4.0,
    tilt=0.0,
    worn=0.0,
    spots=0.0,
    seed=1,
    looks=1,
    noise=0.05,
    length=DASH_M,
):
    """Return scan lines across the marking; of `worn` of the dashes up to 1.5 m is gone at one end, of `spots` of the rest."""
    rng = np.random.default_rng(seed)
    begin = first + period * np.arange(n)
    end = begin + length
    gone = rng.uniform(0.0, 1.5, n) * (rng.random(n) < worn)
    at_begin = rng.random(n) < 0.5
    begin, end = begin + np.where(at_begin, gone, 0.0), end - np.where(at_begin, 0.0, gone)
    found = []
    for look in range(looks):
        y = np.linspace(-0.3, 0.3, 41)
        s = np.arange(0.013 + 0.4 * look * spacing, first + n * period, spacing)
        x = (s[:, None] + np.tan(tilt) * y).ravel()
        y = np.tile(y, len(s))
        x += rng.normal(0.0, 0.002, len(x))
        k = np.clip(((x - first + 1.0) / period).astype(int), 0, n - 1)
        is_paint = (np.abs(y) < WIDTH_M / 2) & (x > begin[k]) & (x < end[k]) & (rng.random(len(x)) >= spots)
        value = 100.0 * np.where(is_paint, 2.5, 1.0) * (1.0 + noise * rng.normal(size=len(x))) * (1.0 + look)
        found.append(
            Points(
                np.column_stack([x, y, np.full(len(x), 5.0)]),
                intensity=value.astype(np.float32),
                time_s=100.0 * look + x / 20.0,
            )
        )
    return Points.concatenate(found)


def within(points):
    def inside(bounds):
        x, y = points.xyz[:, 0], points.xyz[:, 1]
        return points.take((x >= bounds.west) & (x < bounds.east) & (y >= bounds.south) & (y < bounds.north))

    return inside


def seen_at(lines, points):
    return ends_of_dashes(lines, least_paint_ratios(paint_pieces(lines, within(points))), within(points))


def length_of(lines, points):
    """Return the length of the dashes and its deviation, as reported."""
    axis = axis_along("road", lines[0].xyz)
    report = chainage_report(lines, [axis], every_m=200.0, dashes=seen_at(lines, points))
    (row,) = (row for row in report.rows if row.quantity == "dash_length")
    return row.value, row.sigma


def test_the_outermost_bright_point_and_those_beyond_it():
    lines, points = marking(DASH_M), cloud(0.16, tilt=0.5)
    seen = seen_at(lines, points)
    assert len(seen) == 11 and seen.begin.shape == (11, N_BEYOND)
    true = 4.0 + 9.0 * np.arange(11)
    assert np.all(seen.begin[:, 0] > true) and np.all(seen.begin[:, 1] < true + 0.01)
    assert np.all(seen.end[:, 0] < true + DASH_M) and np.all(seen.end[:, 1] > true + DASH_M - 0.01)
    assert np.all(np.diff(seen.begin, axis=1) <= 0.0) and np.all(np.diff(seen.end, axis=1) >= 0.0)
    assert np.all(seen.n_bright == seen.n_pairs)
    # Without brightness nothing is seen
    assert len(seen_at(lines, Points(points.xyz))) == 0


def test_dashes_are_in_the_order_of_their_marking_whatever_tiles_they_lie_in():
    lines, points = marking(DASH_M), cloud(0.16)
    turned = LineSet.from_lines(
        [lines[0].xyz[::-1], *(lines[k].xyz for k in range(1, len(lines)))],
        kind=lines.kind, pattern="dashed", width_m=WIDTH_M, crs=CRS,
    )  # fmt: skip
    one, other = seen_at(lines, points), seen_at(turned, points)
    assert np.allclose(lines.length_m[0] - other.end[::-1, 0], one.begin[:, 0], atol=1e-6)


def test_looks_with_a_brightness_of_their_own_are_compared_with_the_road_in_each():
    seen = seen_at(marking(DASH_M), cloud(0.16, looks=2))
    true = 4.0 + 9.0 * np.arange(11)
    for place, inside in ((seen.begin - true[:, None], 1.0), (true[:, None] + DASH_M - seen.end, 1.0)):
        # Two looks are twice as dense as one: bright and dark points are 6 and 10 cm from each other
        assert np.all(inside * place[:, 0] > -0.01) and np.all(place[:, 1] < 0.01)
        assert np.all(place[:, 0] - place[:, 1] < 0.11)


def test_noise_of_the_road_is_no_paint():
    seen = seen_at(marking(DASH_M), cloud(0.16, noise=0.3))
    assert np.all(seen.begin[:, 0] > 4.0 + 9.0 * np.arange(11) - 0.01)


@pytest.mark.parametrize(("spacing", "error"), [(0.15, 0.09), (0.163, 0.02), (0.21, 0.025)])
def test_scan_lines_at_a_part_of_the_period_leave_the_length_open(spacing, error):
    """Of lines 15 cm apart 60 fit into 9 m, which cut all dashes alike; others cut each in another place."""
    found, sigma = length_of(marking(DASH_M + 0.1), cloud(spacing))
    assert abs(found - DASH_M) < min(error, 2.5 * sigma)
    is_alike = spacing == 0.15
    assert (0.03 < sigma < 0.12) if is_alike else sigma < 0.02


def test_lines_alone_say_nothing_of_what_cuts_all_dashes_alike():
    lines = marking(DASH_M + 0.1)
    axis = axis_along("road", lines[0].xyz)
    (row,) = (r for r in chainage_report(lines, [axis], every_m=200.0).rows if r.quantity == "dash_length")
    assert row.value == pytest.approx(DASH_M + 0.1) and row.sigma < 0.02


def test_where_lines_and_points_disagree_the_length_is_unknown():
    """Lengths are compared up to 0.6 m from that of the lines: beyond, the end of that range is no measurement."""
    assert length_of(marking(DASH_M - 0.9), cloud(0.163)) == (None, None)


def test_worn_ends_do_not_shorten_dashes():
    # Lines restore worn dashes like each other, here 20 cm too short
    errors = []
    for seed in range(6):
        found, sigma = length_of(marking(DASH_M - 0.2), cloud(0.163, worn=0.6, spots=0.3, seed=seed))
        errors.append(((found - DASH_M), sigma))
    error, sigma = np.array(errors).T
    assert np.sqrt(np.mean(error**2)) < 0.03
    assert 0.3 < np.sqrt(np.mean((error / sigma) ** 2)) < 2.0


def test_a_period_that_was_taken_from_worn_dashes_is_found_anew():
    points, lines = cloud(0.163), marking(DASH_M)
    seen = seen_at(lines, points)
    first = 4.0 + 9.07 * np.arange(11)
    dashes = np.column_stack([first, first + DASH_M])
    stretch = dashes_of_stretch(seen.begin, seen.end, 1.0, dashes, MarkingRhythm(DASH_M, 6.07))
    assert stretch.period.value_m == pytest.approx(9.0, abs=0.01) and stretch.period.sigma_m < 0.02
    assert likeliest_length(DASH_M, stretch.likelihood).value_m == pytest.approx(DASH_M, abs=0.02)


def test_where_nothing_was_hit_the_length_stays_open():
    blank = np.full((4, N_BEYOND), np.nan)
    dashes = np.column_stack([9.0 * np.arange(4), 9.0 * np.arange(4) + DASH_M])
    stretch = dashes_of_stretch(blank, blank, 0.9, dashes, MarkingRhythm(DASH_M, 6.0))
    assert likeliest_length(DASH_M, stretch.likelihood).sigma_m > 0.3


def test_a_marking_may_have_dashes_of_two_lengths():
    long = np.where(np.arange(22) < 11, DASH_M, DASH_M - 0.2)
    lines = marking(DASH_M, n=22)
    axis = axis_along("road", lines[0].xyz)
    dashes = seen_at(lines, cloud(0.163, n=22, length=long))
    rows = [
        r
        for r in chainage_report(lines, [axis], every_m=100.0, dashes=dashes).rows
        if r.quantity == "dash_length"
    ]
    assert [row.value for row in rows[:2]] == pytest.approx([DASH_M, DASH_M - 0.2], abs=0.03)


def places(outermost, beyond):
    """Return points at the ends of dashes every 9 m, each outermost bright one and, so far apart, those beyond it."""
    return np.array([9.0 * k + end + beyond * np.arange(N_BEYOND) for k, end in enumerate(outermost)])


def test_what_patches_of_wear_took_from_most_ends_is_not_missed():
    begin = places(np.zeros(10), -0.15)
    end = places([3.0, 2.0, 2.3, 1.5, 2.58, 2.7, 1.8, 3.0, 2.35, 2.5], 0.15)
    dashes = np.column_stack([9.0 * np.arange(10), 9.0 * np.arange(10) + 2.6])
    stretch = dashes_of_stretch(begin, end, 0.95, dashes, MarkingRhythm(2.6, 6.4))
    # 3.0 m from bright to bright point, 3.3 m from dark to dark
    assert 3.0 <= likeliest_length(2.6, stretch.likelihood).value_m <= 3.3


def test_dark_points_among_bright_ones_are_no_ends():
    begin, dashes = (
        places(np.zeros(8), -0.15),
        np.column_stack([9.0 * np.arange(8), 9.0 * np.arange(8) + 3.0]),
    )
    # Each ends at 3.0 m or, where the last points were dark by chance, a few points of 1 cm before it
    end = places(3.0 - 0.01 * np.array([0, 1, 0, 2, 1, 0, 0, 3]), 0.01)
    half, whole = (
        likeliest_length(
            3.0, dashes_of_stretch(begin, end, share, dashes, MarkingRhythm(3.0, 6.0)).likelihood
        )
        for share in (0.5, 0.98)
    )
    assert half.value_m > whole.value_m + 0.004
