"""Points of things that passed while a spinning lidar looked, and of things that stand there."""

import numpy as np

from linework.scanlines.passing import is_passing

TURNS = np.arange(60)


def looked(*, sees, height_m, ground=0.0):
    """Return heights, cells and turns of one cell: turns that see a thing see it at a height, all others the ground."""
    z = np.where(sees, ground + height_m, ground)
    return z, np.zeros(len(TURNS), np.int64), TURNS


def test_a_car_that_drives_through_is_left_out():
    sees = (TURNS >= 30) & (TURNS < 50)
    z, cell, turn = looked(sees=sees, height_m=0.8)
    assert np.array_equal(is_passing(z, cell, turn), sees)
    # Two cars, one behind the other
    sees |= (TURNS > 5) & (TURNS < 12)
    z, cell, turn = looked(sees=sees & (TURNS < 40), height_m=1.5)
    assert np.array_equal(is_passing(z, cell, turn), sees & (TURNS < 40))


def test_what_stands_there_stays():
    # A parked car hides the ground from all turns, a rail from some of them, a thin one is hit now and then
    assert not is_passing(*looked(sees=TURNS >= 0, height_m=0.8)).any()
    assert not is_passing(*looked(sees=TURNS % 3 > 0, height_m=0.7)).any()
    assert not is_passing(*looked(sees=TURNS % 4 == 0, height_m=0.7)).any()


def test_kerbs_and_what_hangs_over_the_road_stay():
    sees = (TURNS >= 30) & (TURNS < 50)
    assert not is_passing(*looked(sees=sees, height_m=0.15)).any()
    assert not is_passing(*looked(sees=sees, height_m=2.3)).any()


def test_a_car_that_stops_until_the_end_was_no_obstacle_before():
    sees = TURNS >= 45
    assert np.array_equal(is_passing(*looked(sees=sees, height_m=0.8)), sees)
    # It stood there for most of the time: nobody knows what is the exception
    assert not is_passing(*looked(sees=TURNS >= 20, height_m=0.8)).any()


def test_neither_order_nor_other_cells_change_anything():
    rng = np.random.default_rng(1)
    cell, turn = rng.integers(0, 12, 5000), rng.integers(0, 60, 5000)
    z = rng.normal(0.0, 0.01, 5000) + 0.7 * (
        (turn > 3 * cell) & (turn < 3 * cell + 12) & (rng.random(5000) < 0.8)
    )
    found = is_passing(z, cell, turn)
    assert found.sum() > 200
    order = rng.permutation(5000)
    assert np.array_equal(is_passing(z[order], cell[order] - 2**40, turn[order] + 10**9), found[order])
    one = cell == 3
    assert np.array_equal(is_passing(z[one], cell[one], turn[one]), found[one])
    assert not len(is_passing(z[:0], cell[:0], turn[:0]))
