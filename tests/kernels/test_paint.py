"""Kernels of the detection of paint against slow obvious twins."""

from __future__ import annotations

import numpy as np
import pytest

from linework.kernels.paint.paint_points import MOST_VISITS, dark_level, smallest, split_into_visits, visit_of
from linework.kernels.paint.stripe_bands import band_on_shoulder, narrower_band
from linework.kernels.paint.stripe_extent import dash_at, extent
from linework.kernels.paint.stripe_fit import (
    FIT_UNKNOWNS,
    FIT_WIDTH,
    STRIP_COLUMNS,
    STRIP_HEIGHT,
    STRIP_U,
    STRIP_V,
)
from linework.kernels.paint.stripe_height import height_of
from linework.kernels.paint.stripe_search import (
    BAND_LEFT,
    BAND_RIGHT,
    MOST_STRIPES,
    direction,
    edges_of,
    stripes_across,
)
from linework.kernels.paint.stripes import clipped
from linework.kernels.tracking.small_systems import factor, inverse_of_three, solve, solve_two


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(20)


def test_selection_is_that_of_a_sort(rng: np.random.Generator) -> None:
    for n in (1, 2, 7, 60):
        values = rng.integers(0, 20, n).astype(np.float64)
        for k in range(n):
            assert smallest(values.copy(), k, len(values)) == np.sort(values)[k]


def test_the_dark_level_does_not_see_the_bright_half(rng: np.random.Generator) -> None:
    road = rng.normal(100.0, 10.0, 4000)
    level, spread = dark_level(road.copy())
    assert level == pytest.approx(100.0, abs=1.0) and spread == pytest.approx(10.0, abs=1.0)
    level, spread = dark_level(np.concatenate([road, rng.normal(300.0, 20.0, 4000)]))
    assert level < 115.0 and spread < 20.0


def test_visits_are_parted_by_time_whatever_the_order(rng: np.random.Generator) -> None:
    true = rng.integers(0, 3, 200)
    times = 10.0 * true + rng.uniform(0.0, 2.0, 200)
    visit, spans = np.zeros(200, dtype=np.int64), np.zeros((MOST_VISITS, 2))
    assert split_into_visits(times, 200, visit, spans) == 3
    assert len(set(zip(true.tolist(), visit.tolist(), strict=True))) == 3
    assert visit_of(float(times[5]), spans, 3) == visit[5]


def test_more_visits_than_there_is_room_for_join_others() -> None:
    times = np.arange(20.0) * 5.0
    visit, spans = np.zeros(20, dtype=np.int64), np.zeros((MOST_VISITS, 2))
    assert split_into_visits(times, 20, visit, spans) <= MOST_VISITS
    assert visit.max() < MOST_VISITS


def test_systems_are_solved_as_numpy_does(rng: np.random.Generator) -> None:
    a = rng.normal(size=(6, 6))
    matrix, right, out = a @ a.T + np.eye(6), rng.normal(size=6), np.zeros(6)
    lower = matrix.copy()
    factor(lower)
    solve(lower, right, out)
    np.testing.assert_allclose(out, np.linalg.solve(matrix, right), rtol=1e-9)


def test_two_and_three_unknowns_are_solved_as_numpy_does(rng: np.random.Generator) -> None:
    for n in (2, 3):
        rows = rng.normal(size=(8, n))
        matrix, right = rows.T @ rows, rng.normal(size=n)
        upper = matrix[np.triu_indices(n)]
        if n == 2:
            np.testing.assert_allclose(solve_two(*upper, *right), np.linalg.solve(matrix, right), rtol=1e-9)
        else:
            inverse = np.linalg.inv(matrix)[np.triu_indices(n)]
            np.testing.assert_allclose(inverse_of_three(*upper), inverse, rtol=1e-9)


@pytest.mark.parametrize("angle_deg", [0.0, 17.0, 83.0, 171.0])
def test_the_direction_is_that_of_the_stripe(rng: np.random.Generator, angle_deg: float) -> None:
    # Scan lines 0.2 m apart at 40 degrees: the points are dense along them, not along the stripe
    s, line = rng.uniform(-0.9, 0.9, 2000), 0.2 * rng.integers(-5, 6, 2000)
    cos, sin = np.cos(np.radians(40.0)), np.sin(np.radians(40.0))
    work = np.zeros((2000, 5))
    work[:, 0], work[:, 1] = s * cos - line * sin, s * sin + line * cos
    a = np.radians(angle_deg)
    work[:, 3] = np.abs(-work[:, 0] * np.sin(a) + work[:, 1] * np.cos(a)) < 0.08
    found = np.degrees(direction(work, 2000, 0.5))
    assert abs((found - angle_deg + 90.0) % 180.0 - 90.0) < 6.0


@pytest.mark.parametrize(
    ("radius", "strip", "widths"),
    [
        (0.5, 0.5, [0.5, 0.12]),  # A line on a strip of half its brightness
        (0.5, 0.0, [0.12]),  # The same line on plain road
        (1.0, 0.5, [0.5]),  # Bins of 5 cm, where points are sparse, do not resolve a line on a strip
    ],
)
def test_a_line_on_a_strip_is_found_where_its_edges_are_resolved(
    rng: np.random.Generator, radius: float, strip: float, widths: list[float]
) -> None:
    n = 3000
    work = np.zeros((n, 5))
    work[:, 0], work[:, 1] = rng.uniform(-1.4 * radius, 1.4 * radius, (2, n))
    v = np.abs(work[:, 1])
    brightness = np.where(v < 0.06, 1.0, np.where(v < 0.25, strip, 0.0))
    work[:, 3] = brightness + 0.1 * rng.normal(size=n)
    out = np.zeros((MOST_STRIPES, 3))
    m = stripes_across(work, n, 0.0, radius, 4.0, out)
    assert (out[:m, BAND_LEFT] - out[:m, BAND_RIGHT]).tolist() == pytest.approx(widths, abs=0.06)


@pytest.mark.parametrize(("gap", "least"), [(0.0, 20), (0.35, 15), (1.0, 0)])
def test_two_lines_are_parted_where_the_gap_is_darker_than_both(gap: float, least: int) -> None:
    # 20 points/m2 from the air: the spot of the beam brightens the 0.28 m between two lines
    n, parted = 160, 0
    for seed in range(20):
        rng = np.random.default_rng(seed)
        work = np.zeros((n, 5))
        work[:, 0], work[:, 1] = rng.uniform(-1.4, 1.4, (2, n))
        v = np.abs(work[:, 1])
        work[:, 3] = np.where(v < 0.14, gap, v < 0.4) + 0.1 * rng.normal(size=n)
        out = np.zeros((MOST_STRIPES, 3))
        m = stripes_across(work, n, 0.0, 1.0, 4.0, out)
        bands = out[np.argsort(out[:m, BAND_RIGHT]) if m else slice(0)]
        parted += m == 2 and bands[0, BAND_LEFT] < 0.0 < bands[1, BAND_RIGHT]
    assert least <= parted <= (20 if least else 0)


@pytest.mark.parametrize(("rest", "band"), [(0.5, (13, 17)), (0.02, (-1, -1))])
def test_a_line_lies_on_a_strip_that_stands_out_without_it(rest: float, band: tuple[int, int]) -> None:
    profile = np.zeros(30)
    profile[10:20], profile[13:17] = rest, 1.0
    number, total = 10.0 * np.arange(31.0), np.concatenate([[0.0], np.cumsum(10.0 * profile)])
    found = narrower_band(number, total, 0.01, *edges_of(number, total), (10, 20), 1, 4.0)
    assert found[:2] == band


@pytest.mark.parametrize("face", [0.0, 1.5])
def test_paint_stands_out_beside_the_bright_face_of_a_kerb(face: float) -> None:
    # The face is up to eight times as bright as the paint, and scatters as much
    found = 0
    for seed in range(20):
        rng = np.random.default_rng(seed)
        work = np.zeros((400, 5))
        work[:, 0], work[:, 1] = rng.uniform(-1.7, 1.7, (2, len(work)))
        v = work[:, 1]
        work[:, 3] = np.where(np.abs(v) < 0.08, 0.2, 0.0) + 0.05 * rng.normal(size=len(work))
        at_kerb = np.abs(v - 0.4) < 0.08
        work[at_kerb, 3] += face * rng.uniform(0.2, 1.0, np.count_nonzero(at_kerb))
        out = np.zeros((MOST_STRIPES, 3))
        m = stripes_across(work, len(work), 0.0, 1.0, 4.0, out)
        found += bool(np.any(np.abs(out[:m, :2].mean(axis=1)) < 0.06))
    assert found >= 18


def test_a_wide_band_that_scatters_is_one_band() -> None:
    bands = []
    for seed in range(20):
        rng = np.random.default_rng(seed)
        work = np.zeros((500, 5))
        work[:, 0], work[:, 1] = rng.uniform(-0.85, 0.85, (2, len(work)))
        paint = np.abs(work[:, 1]) < 0.25
        work[:, 3] = np.where(paint, 1.0, 0.0) + np.where(paint, 0.4, 0.05) * rng.normal(size=len(work))
        bands.append(stripes_across(work, len(work), 0.0, 0.5, 4.0, np.zeros((MOST_STRIPES, 3))))
    assert np.mean(bands) < 1.5


@pytest.mark.parametrize("is_left", [False, True])
@pytest.mark.parametrize(
    ("shoulder", "bins", "band"), [(0.5, 12, (10, 15)), (0.02, 12, (-1, -1)), (0.5, 6, (-1, -1))]
)
def test_a_line_lies_along_one_side_of_a_strip(
    shoulder: float, bins: int, band: tuple[int, int], is_left: bool
) -> None:
    # A strip that is no brighter than the road, and one as narrow as a blurred edge, are none
    profile = np.zeros(36)
    profile[10:15], profile[15 : 15 + bins] = 1.0, shoulder
    outer = 10, 15 + bins
    if is_left:
        profile, outer = profile[::-1].copy(), (36 - outer[1], 26)
        band = (36 - band[1], 36 - band[0]) if band[0] >= 0 else band
    number, total = 10.0 * np.arange(37.0), np.concatenate([[0.0], np.cumsum(10.0 * profile)])
    found = band_on_shoulder(number, total, 0.01, *edges_of(number, total), outer, 4.0)
    assert found[:2] == band


@pytest.mark.parametrize("is_left", [False, True])
def test_paint_beside_a_bright_shoulder_has_its_own_width(is_left: bool) -> None:
    # From the air, 22 points/m2: paint 0.3 m wide as the spot blurs it, and dust as bright as half of it over 0.5 m
    right = 0
    for seed in range(20):
        rng = np.random.default_rng(seed)
        work = np.zeros((400, 5))
        work[:, 0], work[:, 1] = rng.uniform(-1.7, 1.7, (2, len(work)))
        v = work[:, 1] if is_left else -work[:, 1]
        work[:, 3] = np.where(np.abs(v) < 0.15, 1.0, np.where((v > 0.15) & (v < 0.65), 0.5, 0.0))
        work[:, 3] += 0.1 * rng.normal(size=len(work))
        out = np.zeros((MOST_STRIPES, 3))
        m = stripes_across(work, len(work), 0.0, 1.0, 4.0, out)
        width, middle = out[:m, BAND_LEFT] - out[:m, BAND_RIGHT], out[:m, :2].mean(axis=1)
        right += bool(np.any((np.abs(width - 0.3) < 0.11) & (np.abs(middle) < 0.06)))
    assert right >= 18


def test_the_rise_of_the_ground_is_unknown_without_points_on_both_sides(rng: np.random.Generator) -> None:
    fit, strip = np.zeros(FIT_UNKNOWNS), np.zeros((400, STRIP_COLUMNS))
    fit[FIT_WIDTH] = 0.12
    strip[:, STRIP_U], strip[:, STRIP_V] = rng.uniform(-0.5, 0.5, 400), rng.uniform(-0.15, 0.15, 400)
    strip[:, STRIP_HEIGHT] = np.where(strip[:, STRIP_V] > 0.0, 0.02, 0.0)

    def rise_of(points: np.ndarray) -> float:
        return height_of(points, (-0.5, 0.5), fit, 0.0, 0.09)[-1]

    assert rise_of(strip) == pytest.approx(0.02, abs=0.003)
    assert np.isnan(rise_of(strip[strip[:, STRIP_V] > -0.06]))
    assert np.isnan(rise_of(strip[:3]))


def test_the_extent_is_the_best_stretch_of_paint() -> None:
    u = np.arange(-0.49, 0.5, 0.02)
    strip = np.column_stack([u, np.zeros_like(u), np.zeros_like(u), np.zeros_like(u)])
    # Paint from -0.2 to 0.3 with a worn place in it, and a speck beyond
    strip[(u > -0.2) & (u < 0.3), 2] = 1.0
    strip[(u > 0.0) & (u < 0.06), 2] = 0.0
    strip[np.abs(u - 0.45) < 0.005, 2] = 1.0
    begin, end, parts = extent(strip, 0.5, np.array([0.0, 0.0, 0.12, 0.0, 0.0, 1.0]))
    assert begin == pytest.approx(-0.2, abs=0.011) and end == pytest.approx(0.3, abs=0.011)
    assert parts == 5


@pytest.mark.parametrize("at", [-1.9, -1.0, -0.2, 0.2, 1.0, 1.9])
def test_two_dashes_in_one_search_area_are_told_apart(at: float) -> None:
    # Dashes of 1.5 m with as long a gap between, seen by scan lines 0.55 m apart, three points each
    u = (np.arange(-1.9, 2.0, 0.55)[:, None] + np.array([-0.05, 0.0, 0.05])).ravel()
    strip = np.column_stack([u, np.zeros_like(u), (np.abs(u) > 0.7).astype(float), np.zeros_like(u)])
    fit = np.array([0.0, 0.0, 0.12, 0.0, 0.0, 0.8])
    begin, end, _ = extent(strip, 2.0, fit)
    assert begin < -1.5 and end > 1.5, "one begin and one end hold both"
    begin, end = dash_at(strip, 2.0, fit, (begin, end), at)
    assert (begin < -1.5 and -1.0 < end < 0.0) if at < 0.0 else (0.0 < begin < 1.0 and end > 1.5)


def test_a_worn_place_does_not_end_a_line() -> None:
    u = np.arange(-1.9, 2.0, 0.1)
    strip = np.column_stack([u, np.zeros_like(u), np.ones_like(u), np.zeros_like(u)])
    strip[np.abs(u) < 0.3, 2] = 0.0
    fit = np.array([0.0, 0.0, 0.12, 0.0, 0.0, 1.0])
    whole = extent(strip, 2.0, fit)[:2]
    assert dash_at(strip, 2.0, fit, whole, -1.0) == whole


def test_a_line_is_clipped_to_a_cell() -> None:
    assert clipped(0.0, 0.1, 1.0, 0.0, (-1.0, 1.0), (-0.2, 0.0, 0.3, 0.5)) == (-0.2, 0.3)
    begin, end = clipped(0.0, 0.6, 1.0, 0.0, (-1.0, 1.0), (-0.2, 0.0, 0.3, 0.5))
    assert begin > end, "it passes by"
