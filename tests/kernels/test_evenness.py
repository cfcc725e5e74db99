"""How uneven the ground beside a box is, on ground made by hand."""

import numpy as np
import pytest

from linework.kernels.boundaries.evenness import unevenness_beside
from linework.kernels.cells import floor, places

SIDE_M = 12.0


def beside(height, *, per_m2=60.0, noise_m=0.0, form=places.EDGE, turned=False, seed=1):
    """Unevenness to the left (south, if turned) and right of a box in the middle of a square [m2]."""
    rng = np.random.default_rng(seed)
    x, y = rng.uniform(0.0, SIDE_M, (2, int(per_m2 * SIDE_M**2)))
    xyz = np.column_stack([x, y, height(x, y) + rng.normal(0.0, noise_m, len(x))])
    col, row = (np.floor(xyz[:, k] / floor.FINE_M).astype(np.int64) for k in range(2))
    n = round(SIDE_M / floor.FINE_M)
    span = np.array([0, 0, n, n])
    points, _, starts = floor.sort_by_cell(
        xyz, np.zeros(len(x), dtype=np.float32), np.zeros(3), col, row, span
    )
    box = np.zeros((1, places.COLUMNS))
    box[0, [places.BOX_X, places.BOX_Y, places.BOX_UX, places.FORM]] = 6.1, 6.2, -1.0 if turned else 1.0, form
    sums = floor.cell_sums(points, starts, span)
    return unevenness_beside(sums, span, box)[0]


def waves(x, y):
    """Two waves of 2 m, 1.0 cm rms each: 1.4 cm, of which the means of cells of 0.5 m keep 1.3."""
    return 0.0141 * (np.sin(np.pi * x) + np.sin(np.pi * (0.6 * x + 0.8 * y)))


def even(x, y):
    """A grade of 6 %, a crossfall of 3 %, a crown."""
    return 0.06 * x + 0.03 * y - 0.002 * (y - 6.0) ** 2


@pytest.mark.parametrize(("per_m2", "noise_m"), [(20.0, 0.02), (60.0, 0.02), (400.0, 0.02), (400.0, 0.002)])
def test_noise_is_no_unevenness_and_waves_are(per_m2, noise_m):
    windows = range(12)
    flat = np.array([beside(even, per_m2=per_m2, noise_m=noise_m, seed=k) for k in windows])
    wavy = np.array([beside(waves, per_m2=per_m2, noise_m=noise_m, seed=k) for k in windows])
    # The errors that points of a cell share are taken off, 4 mm at 2 cm of noise
    assert np.median(flat) < 0.002**2
    assert np.sqrt(np.median(wavy)) == pytest.approx(0.0125, abs=0.002)


def test_left_and_right_are_told_apart():
    def half(x, y):
        return np.where(y > 6.2, 0.0, waves(x, y))

    for turned in (False, True):
        found = beside(half, noise_m=0.003, turned=turned)[:: -1 if turned else 1]
        assert found[0] < 0.003**2 and found[1] > 0.010**2


def test_a_car_on_the_road_is_no_unevenness():
    def with_wheels(x, y):
        return np.where((np.abs(x - 5.0) < 0.2) & (np.abs(y - 8.0) < 0.2), 0.3, 0.0)

    assert beside(with_wheels, noise_m=0.003)[0] < 0.003**2


def test_what_is_not_known_is_said():
    assert np.isnan(beside(waves, per_m2=3.0)).all()
    assert np.isnan(beside(waves, form=places.KERB)).all()
    # A wall may stand in a garden
    assert (beside(waves, form=places.BARRIER) > 0.01**2).all()
