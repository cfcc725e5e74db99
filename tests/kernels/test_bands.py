"""The kernels that take a cross-section apart, against the same in numpy."""

from __future__ import annotations

import numpy as np
import pytest

from linework.kernels.radon.bands import (
    BAND_SHARE,
    DENSE_POINTS,
    GAP_CELLS,
    bands_of_rows,
    fold_of_rows,
    middles_of_rows,
    number_near,
)

U = (np.arange(60) + 0.5) * 0.01 - 0.30


def drawn(seed: int) -> np.ndarray:
    """A section of 1 to 5 bands, dense or of few points, some with gaps, and points at all heights."""
    rng = np.random.default_rng(seed)
    counts = rng.poisson(rng.choice([0.0, 0.002, 0.02]), (310, 60)).astype(np.float64)
    for _ in range(rng.integers(1, 6)):
        low, high = np.sort(rng.integers(0, 310, 2))
        middle, width = rng.integers(0, 55), rng.integers(1, 6)
        beam = rng.poisson(rng.choice([0.1, 0.5, 4.0]), (high - low, width)).astype(np.float64)
        counts[low:high, middle : middle + width] += beam * (rng.random((high - low, 1)) < 0.8)
    return counts


def bands_in_numpy(counts, first):
    """Runs of dense rows: averaged over three where points are few, so that gaps of as many close."""
    number = np.where(np.arange(len(counts)) >= first, counts.sum(axis=1), 0.0)
    if number.sum() < 60:
        return []
    density, gap, reference = number, 1, np.mean(np.sort(number)[-8:])
    if reference < DENSE_POINTS:
        density, gap = np.convolve(number, np.full(GAP_CELLS, 1.0 / GAP_CELLS), mode="same"), GAP_CELLS
        reference = np.mean(np.sort(density)[-8:])
    at = np.flatnonzero((density >= BAND_SHARE * reference) & (number > 0.0))
    runs = np.split(at, np.flatnonzero(np.diff(at) > gap + 1) + 1)
    share = 0.06 * number.sum()
    return [[r[0], r[-1] + 1] for r in runs if len(r) > 1 and number[r[0] : r[-1] + 1].sum() >= share]


def test_bands_are_runs_of_dense_rows() -> None:
    found = [(bands_of_rows(drawn(i), i % 90).tolist(), bands_in_numpy(drawn(i), i % 90)) for i in range(300)]
    assert all(own == expected for own, expected in found)
    # Few and many bands were compared, and none
    assert {len(own) for own, _ in found} >= {0, 1, 2, 3, 4}


@pytest.mark.parametrize("seed", range(20))
def test_middles_are_medians_of_the_points_of_each_row(seed: int) -> None:
    counts = drawn(seed)
    middles = middles_of_rows(counts, U)
    assert np.array_equal(np.isnan(middles), counts.sum(axis=1) == 0.0)
    for row in np.flatnonzero(counts.sum(axis=1)):
        points = np.repeat(U, counts[row].astype(int))
        assert middles[row] == np.quantile(points, 0.5, method="inverted_cdf")


@pytest.mark.parametrize("seed", range(20))
def test_points_near_the_places_of_their_rows_are_counted(seed: int) -> None:
    counts = drawn(seed)
    places = np.random.default_rng(seed).uniform(-0.3, 0.3, len(counts))
    near, total = number_near(counts, U, places, 0.05)
    assert near == counts[np.abs(U - places[:, None]) <= 0.05].sum()
    assert total == counts.sum()
    assert 0.0 < near < total


@pytest.mark.parametrize("seed", range(20))
def test_fold_is_the_variance_between_rows_less_that_within(seed: int) -> None:
    rng = np.random.default_rng(seed)
    at = rng.uniform(0.0, 0.05) * np.cos(np.linspace(0.0, 12.0, 31))[:, None]
    points = rng.normal(at, rng.uniform(0.003, 0.02), (31, 40))
    counts = np.stack([np.histogram(row, np.linspace(-0.3, 0.3, 61))[0] for row in points]).astype(float)
    counts[3] = 0.0
    counts[7, -1] = 5.0  # posts behind, farther off than is looked at

    columns = np.repeat(U, counts.sum(axis=0).astype(int))
    middle = np.quantile(columns, 0.5, method="inverted_cdf")
    rows = [np.repeat(U, row.astype(int)) for row in counts]
    rows = [row[np.abs(row - middle) <= 0.1] for row in rows]
    rows = [row for row in rows if len(row)]
    n, k, mean = sum(map(len, rows)), len(rows), np.concatenate(rows).mean()
    within = sum(((row - row.mean()) ** 2).sum() for row in rows) / (n - k)
    between = sum(len(row) * (row.mean() - mean) ** 2 for row in rows) - (k - 1) * within
    assert fold_of_rows(counts, U, 0.1) == pytest.approx(np.sqrt(max(between / n, 0.0)), abs=1e-9)


def test_a_row_of_one_point_each_has_no_fold() -> None:
    assert fold_of_rows(np.eye(20, 60), U, 0.1) == 0.0
