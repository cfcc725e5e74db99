"""Cells of tiles: what is counted, that order and splitting do not matter, and what is near."""

from __future__ import annotations

import numpy as np
import pytest

from linework.kernels.cells import tile_cells as kernels
from linework.workbench.views.layers import TileLayers, fill_between_points, layers_from_children
from linework.workbench.views.pyramid import FINEST, Lattice, MapTile


def columns(rng, n, side=16.0):
    x, y = rng.uniform(0.0, side, (2, n)).astype(np.float32)
    above = rng.choice(np.array([0.0, 0.02, 1.5, 6.0, np.nan], np.float32), n)
    return (
        x,
        y,
        (100.0 + np.nan_to_num(above)).astype(np.float32),
        above,
        rng.integers(1, 999, n).astype(np.uint16),
    )


def layers_of(parts, cell_m=1.0, n=16):
    sums = kernels.no_sums(n, n)
    for part in parts:
        kernels.add_points(part, (0.0, 0.0), cell_m, sums)
    return TileLayers(*kernels.layers_of(sums, cell_m))


def test_a_car_over_the_road_is_told_apart():
    at = np.full(5, 0.5, np.float32)
    above = np.array([0.0, 0.02, 1.4, 5.2, np.nan], np.float32)
    points = at, at, 50.0 + np.nan_to_num(above, nan=3.0), above, np.array([10, 30, 900, 900, 900], np.uint16)
    cells = layers_of([points])
    assert cells.density[15, 0] == 5.0
    assert cells.ground[15, 0] == pytest.approx(50.01)
    assert cells.stands[15, 0] == pytest.approx(5.19)
    # The cable overhead hides nothing
    assert cells.above[15, 0] == pytest.approx(1.4)
    # And the car does not shine on the road
    assert cells.bright[15, 0] == 20.0
    assert cells.density.sum() == 5.0
    assert np.isnan(cells.ground[0, 0])


def test_only_a_cable_is_shown_where_nothing_is_below():
    above = np.array([6.0, 6.5], np.float32)
    at = np.full(2, 0.5, np.float32)
    cells = layers_of([(at, at, above, above, np.ones(2, np.uint16))])
    assert cells.above[15, 0] == 6.5


def test_order_and_splitting_of_points_do_not_matter():
    rng = np.random.default_rng(1)
    points = columns(rng, 4000)
    mixed = rng.permutation(4000)
    parts = [tuple(c[mixed[i::3]] for c in points) for i in range(3)]
    for one, other in zip(layers_of([points]), layers_of(parts), strict=True):
        np.testing.assert_array_equal(one, other)


def test_four_cells_become_one():
    fine = layers_of([columns(np.random.default_rng(2), 3000)], cell_m=16.0 / 256, n=256)
    whole = layers_from_children([fine, None, None, None])
    part = whole.part(slice(0, 128), slice(0, 128))
    assert part.density.mean() == pytest.approx(fine.density.mean(), rel=1e-6)
    blocks = (
        np.where(fine.density > 0, fine.ground + fine.stands, -np.inf)
        .reshape(128, 2, 128, 2)
        .max(axis=(1, 3))
    )
    np.testing.assert_allclose(
        (part.ground + part.stands)[part.density > 0], blocks[np.isfinite(blocks)], rtol=1e-6
    )
    assert (whole.density[128:] == 0).all()
    assert np.isnan(whole.bright[:, 128:]).all()


def test_packing_keeps_what_is_seen():
    cells = layers_of([columns(np.random.default_rng(3), 4000)])
    for before, after in zip(cells, cells.packed().unpacked(), strict=True):
        np.testing.assert_allclose(after, before, rtol=1e-3, atol=1e-4)


def test_nearest_known_is_nearly_always_the_nearest():
    rng = np.random.default_rng(4)
    known = rng.random((60, 70)) < 0.03
    nearest = kernels.nearest_known_index(known, 5.0)
    rows, cols = np.nonzero(known)
    for r, c in np.ndindex(known.shape):
        apart = np.hypot(rows - r, cols - c)
        if nearest[r, c] < 0:
            assert apart.min() > 5.0 - 1.0
        else:
            own = np.hypot(nearest[r, c] // 70 - r, nearest[r, c] % 70 - c)
            assert known[nearest[r, c] // 70, nearest[r, c] % 70]
            assert own <= min(5.01, apart.min() + 0.5)


def test_holes_between_points_are_filled_but_no_farther():
    sums = kernels.no_sums(64, 64)
    at = np.array([0.5], np.float32)
    kernels.add_points((at, at, at, np.zeros(1, np.float32), np.ones(1, np.uint16)), (0.0, 0.0), 1 / 64, sums)
    cells = fill_between_points(TileLayers(*kernels.layers_of(sums, 1 / 64)), 1 / 64)
    rows, cols = np.nonzero(cells.density)
    reach = np.hypot(rows - 31, cols - 32).max() / 64
    assert 0.1 < reach <= 0.16


def test_tiles_nest_and_cover_the_survey():
    bounds = (499_740.5, 5_798_754.6, 508_004.6, 5_808_012.6)
    lattice = Lattice.of(bounds)
    document = lattice.document()
    west, north = document["origin"]
    for z, resolution in enumerate(document["resolutions"]):
        size = resolution * document["tile_px"]
        for east_m, north_m in ((bounds[0], bounds[1]), (bounds[2], bounds[3]), (bounds[0], bounds[3])):
            col, row = int((east_m - west) // size), int((north - north_m) // size)
            tile = lattice.tile(z, col, row)
            assert tile is not None
            assert tile.cell_m == resolution
            b = tile.bounds
            assert b.west <= east_m < b.east
            assert b.south <= north_m < b.north
    assert lattice.tile(len(document["resolutions"]), 0, 0) is None
    assert lattice.tile(0, -1, 0) is lattice.tile(-1, 0, 0) is lattice.tile(3, 0, 2**40) is None
    assert [child.parent for child in MapTile(1, -3, 4).children] == [MapTile(1, -3, 4)] * 4
    assert document["resolutions"][-1] == 2.0 ** (FINEST - 2)
