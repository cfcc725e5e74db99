"""Turns of a spinning lidar are levelled by the ground that they share."""

import numpy as np

from linework.scanlines.turn_heights import TurnCells, turn_planes


def cells_seen(rng, *, n_turns=40, n_cells=300, noise_m=0.005, height_m=0.05, tilt=0.005, share=0.4):
    """Return mean heights of level ground in cells, and the planes by which turns are too high."""
    place = rng.uniform(0.0, 40.0, (n_cells, 2))
    turn, cell = np.nonzero(rng.random((n_turns, n_cells)) < share)
    plane = rng.normal(0.0, 1.0, (n_turns, 3)) * [height_m, tilt, tilt]
    plane -= plane.mean(axis=0)
    away = place[cell] - 20.0
    z = 0.01 * place[cell, 0] + plane[turn, 0] + np.einsum("ij,ij->i", away, plane[turn, 1:])
    xyz = np.column_stack([place[cell], z + rng.normal(0.0, noise_m, len(turn))])
    return TurnCells(turn, cell, xyz), plane


def test_planes_are_found_to_the_noise():
    cells, plane = cells_seen(np.random.default_rng(1))
    found = turn_planes(cells)
    truth = plane[:, 0, None] + plane[:, 1:] @ (np.array([[10.0, 10.0], [30.0, 12.0], [18.0, 33.0]]) - 20.0).T
    places = np.array([[10.0, 10.0], [30.0, 12.0], [18.0, 33.0]])
    for i, place in enumerate(places):
        at = found.at(np.arange(len(plane)), np.tile(place, (len(plane), 1)))
        assert np.std(at - truth[:, i]) < 0.002
    assert found.apart_m > 0.05
    assert 0.004 < found.left_apart_m < 0.006
    assert found.common_sigma_m < 0.03


def test_what_is_no_ground_moves_nothing():
    rng = np.random.default_rng(2)
    cells, plane = cells_seen(rng)
    xyz = cells.xyz.copy()
    odd = rng.random(len(cells)) < 0.15
    xyz[odd, 2] += rng.uniform(0.1, 0.25, odd.sum())
    found = turn_planes(TurnCells(cells.turn, cells.cell, xyz))
    at = found.at(np.arange(len(plane)), np.full((len(plane), 2), 20.0))
    assert np.std(at - plane[:, 0]) < 0.003


def test_the_order_of_cells_changes_nothing_that_counts():
    rng = np.random.default_rng(3)
    cells, _ = cells_seen(rng)
    order = rng.permutation(len(cells))
    one, other = turn_planes(cells), turn_planes(cells.take(order))
    assert np.allclose(one.plane, other.plane, atol=1e-9)


def test_a_turn_that_saw_nothing_is_like_those_beside_it():
    cells, _ = cells_seen(np.random.default_rng(4), tilt=0.0)
    found = turn_planes(cells.take(np.flatnonzero(cells.turn != 20)))
    at = found.at(np.array([19, 20, 21]), np.full((3, 2), 20.0))
    assert min(at[0], at[2]) - 1e-6 <= at[1] <= max(at[0], at[2]) + 1e-6


def test_without_common_ground_there_is_nothing_to_level():
    cells, _ = cells_seen(np.random.default_rng(5))
    # Each turn its own place, as of a profile scanner
    apart = TurnCells(cells.turn, 1000 * cells.turn + cells.cell, cells.xyz)
    assert turn_planes(apart) is None
    assert turn_planes(TurnCells.empty()) is None
