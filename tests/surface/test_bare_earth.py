"""Which cells are bare earth, and what is known of the ground between them, on small scenes."""

import numpy as np
import pytest

from linework.model.points import Points
from linework.surface.bare_earth import bare_cells, bare_halo, block_halos
from linework.surface.blocks import BlockHeights, blocks_over
from linework.surface.cells import CellWindow
from linework.surface.config import RoadConfig
from linework.surface.road import find_ground

ORIGIN = np.array([400_000.0, 5_700_000.0, 50.0])


def cloud(east, north, up, seed=0):
    """Points at places, with 5 mm of noise, in a far-away frame."""
    heights = np.asarray(up) + np.random.default_rng(seed).normal(0, 0.005, len(east))
    return np.column_stack([east, north, heights]) + ORIGIN


def field(width=120.0, depth=120.0, per_m2=16, seed=1):
    rng = np.random.default_rng(seed)
    return rng.uniform(0, width, int(width * depth * per_m2)), rng.uniform(
        0, depth, int(width * depth * per_m2)
    )


def hill(east, north):
    return 6.0 * np.sin(east / 25.0) + 0.1 * north


def off_by(ground, east, north, up):
    places = cloud(east, north, np.zeros(len(east)))[:, :2]
    return ground.height_m(places) - 50.0 - up


def at(plane, ground, east, north):
    rows, cols = ground.grid.to_cell(cloud(east, north, np.zeros(len(east)))[:, :2])
    return plane[np.floor(rows).astype(int), np.floor(cols).astype(int)]


@pytest.mark.parametrize("side_m", [4.0, 12.0, 40.0, 90.0])
def test_a_flat_roof_of_any_size_is_not_ground(side_m):
    east, north = field(200.0, 200.0, per_m2=8)
    roof = (np.abs(east - 100) < side_m / 2) & (np.abs(north - 100) < side_m / 2)
    ground = find_ground(Points(cloud(east, north, np.where(roof, 5.0, 0.0))))
    inside = np.abs(east - 100) < side_m / 2 - 1
    inside &= np.abs(north - 100) < side_m / 2 - 1
    assert not at(ground.is_ground, ground, east[inside], north[inside]).any()
    assert not at(ground.is_road, ground, east[inside], north[inside]).any()
    assert at(ground.is_ground, ground, east[~roof], north[~roof]).mean() > 0.99


def test_the_crest_of_a_dam_is_ground():
    """6 m high, 9 m wide, banks of 1 in 1.5: narrower than the windows that a roof needs."""
    east, north = field(160.0, 80.0, per_m2=20)
    up = np.clip((18.0 - np.abs(north - 40.0) - 4.5) / 1.5, 0.0, 6.0)
    ground = find_ground(Points(cloud(east, north, up)))
    crest = np.abs(north - 40.0) < 4.0
    assert at(ground.is_ground, ground, east[crest], north[crest]).all()
    assert np.abs(off_by(ground, east[crest], north[crest], up[crest])).max() < 0.1


def test_trees_and_shrubs_on_a_hill_are_not_ground():
    east, north = field(per_m2=4, seed=3)
    up = hill(east, north)
    rng = np.random.default_rng(4)
    leaves = rng.random(len(east)) < 0.7
    above = np.where(leaves, rng.uniform(1.0, 18.0, len(east)), 0.0)
    ground = find_ground(Points(cloud(east, north, up + above)))
    error = np.abs(at(ground.ground_m, ground, east, north) + ground.z0_m - 50.0 - up)
    measured = at(ground.is_ground, ground, east, north)
    assert measured.mean() > 0.1
    # The slope within a cell is part of it
    assert np.sqrt(np.mean(error[measured] ** 2)) < 0.15
    assert np.mean(error[at(ground.is_known, ground, east, north)] > 0.5) < 0.005


def test_ground_below_a_lorry_is_interpolated_and_beyond_the_data_it_is_not_known():
    east, north = field(60.0, 40.0, per_m2=40)
    under = (np.abs(east - 30) < 6) & (np.abs(north - 20) < 1.25)
    up = 0.05 * east - 0.02 * north
    ground = find_ground(Points(cloud(east, north, np.where(under, 3.5, up))))
    middle = (np.abs(east - 30) < 5) & (np.abs(north - 20) < 0.7)
    e, n = east[middle], north[middle]
    assert at(ground.is_interpolated, ground, e, n).all()
    assert np.abs(off_by(ground, e, n, up[middle])).max() < 0.03
    assert at(ground.sigma, ground, e, n).max() < 0.05
    assert at(ground.distance_m, ground, e, n).max() == pytest.approx(1.5, abs=0.6)
    assert np.median(ground.slope[ground.is_ground]) == pytest.approx(np.hypot(0.05, 0.02), abs=0.02)
    beyond = find_ground(Points(np.concatenate([cloud(east, north, up), cloud([150.0], [20.0], [9.0])])))
    far = np.linspace(80.0, 140.0, 20)
    assert not at(beyond.is_known, beyond, far, np.full(20, 20.0)).any()
    assert np.isfinite(beyond.ground_m).all()


def test_pieces_of_road_that_holes_part_are_all_road_without_a_path():
    """Four pieces with holes of 10 to 60 m; a footway behind a kerb is none of them."""
    east, north = field(320.0, 13.0, per_m2=30)
    hole = np.zeros(len(east), dtype=bool)
    for start, end in ((60, 70), (120, 150), (200, 260)):
        hole |= (east > start) & (east < end)
    up = np.where(north > 10.0, 0.12, 0.0)
    ground = find_ground(Points(cloud(east[~hole], north[~hole], up[~hole])))
    road = ~hole & (north > 1) & (north < 9)
    for start, end in ((2, 58), (72, 118), (152, 198), (262, 318)):
        piece = road & (east > start) & (east < end)
        assert at(ground.is_road, ground, east[piece], north[piece]).mean() > 0.98
    footway = ~hole & (north > 11)
    assert not at(ground.is_road, ground, east[footway], north[footway]).any()
    assert at(ground.is_ground, ground, east[footway], north[footway]).all()


def test_a_forest_without_a_road_has_none():
    rng = np.random.default_rng(7)
    n = 30_000
    east, north = rng.uniform(0, 150, (2, n))
    up = hill(east, north) + np.where(rng.random(n) < 0.85, rng.uniform(2.0, 20.0, n), rng.normal(0, 0.05, n))
    ground = find_ground(Points(cloud(east, north, up)))
    assert not ground.is_road.any()
    assert ground.is_ground.any()


@pytest.mark.parametrize("is_dense", [False, True])
@pytest.mark.parametrize("cell_m", [0.25, 0.5, 1.3])
def test_bare_cells_do_not_depend_on_the_window(cell_m, is_dense):
    config = RoadConfig(cell_m=cell_m)
    rng = np.random.default_rng(11)
    n, halo = 700, bare_halo(config)
    rows, cols = np.mgrid[:n, :n] * cell_m
    height = (hill(cols, rows) + np.where(rng.random((n, n)) < 0.3, rng.uniform(0, 8, (n, n)), 0)).astype(
        np.float32
    )
    height[rng.random((n, n)) < 0.2] = np.nan
    whole = CellWindow(-37, 1009, n, n)
    padded = np.pad(height, halo, constant_values=np.nan)
    # Blocks are found in parts that share some of them, as tiles do
    columns = [CellWindow(-37, 1009, n, 333), CellWindow(296, 1009, n, n - 333)]
    tiles = {
        size: [BlockHeights.of(tile, height[whole.part(tile)], size) for tile in columns]
        for size in block_halos(config)
    }

    def blocks_around(window):
        return {
            size: BlockHeights.united(size, blocks_over(window, size).grown(n_around), tiles[size])
            for size, n_around in block_halos(config).items()
        }

    expected = bare_cells(whole, padded, halo, blocks_around(whole), is_dense, config)
    assert 0.05 < expected[0].mean() < 0.95
    for west, south, n_rows, n_cols in ((0, 1020, 90, 61), (-37, 1009, 50, 50), (300, 1300, 33, 128)):
        part = CellWindow(west, south, n_rows, n_cols)
        around = padded[whole.grown(halo).part(part.grown(halo))]
        found = bare_cells(part, around, halo, blocks_around(part), is_dense, config)
        for one, other in zip(found, expected, strict=True):
            assert np.array_equal(one, other[whole.part(part)])


def test_what_silent_blocks_say_of_their_neighbours_does_not_depend_on_the_window():
    """A pit in one block counts, unless those beside it, which have one cell each, are pits; and so from afar."""
    config, size = RoadConfig(), 4
    n, halo, edge, row = 400, bare_halo(config), 31, 50
    height = np.zeros((n, n), np.float32)
    height[:, : size * edge] = -1.3
    for r in (row - 1, row, row + 1):
        lone, beside = (
            np.s_[size * r : size * (r + 1), size * c : size * (c + 1)] for c in (edge + 16, edge + 17)
        )
        height[lone] = height[beside] = np.nan
        height[size * r, size * (edge + 16)] = 0.0
    height[size * row, size * (edge + 16)] = -3.0
    height[size * row + 1, size * (edge + 17)] = height[size * row + 2, size * (edge + 17) + 2] = 5.0
    whole = CellWindow(0, 0, n, n)
    padded = np.pad(height, halo, constant_values=np.nan)

    def found_in(window):
        own = {k: BlockHeights.of(whole, height, k) for k in block_halos(config)}
        around = {
            k: BlockHeights.united(k, blocks_over(window, k).grown(m), [own[k]])
            for k, m in block_halos(config).items()
        }
        near = padded[whole.grown(halo).part(window.grown(halo))]
        return bare_cells(window, near, halo, around, True, config)

    expected = found_in(whole)
    part = CellWindow(0, 0, n, size * (edge + 1))
    for one, other in zip(found_in(part), expected, strict=True):
        assert np.array_equal(one, other[whole.part(part)])


@pytest.mark.parametrize(("per_m2", "share"), [(4, 0.03), (16, 0.03), (16, 0.1)])
def test_a_smooth_canopy_with_few_points_below_is_not_ground(per_m2, share):
    east, north = field(per_m2=per_m2, seed=7)
    rng = np.random.default_rng(8)
    leaves = np.where(rng.random(len(east)) < share, 0.0, rng.uniform(12.0, 18.0, len(east)))
    ground = find_ground(Points(cloud(east, north, hill(east, north) + leaves)))
    off_m = np.abs(at(ground.ground_m, ground, east, north) + ground.z0_m - 50.0 - hill(east, north))
    assert (off_m[at(ground.is_ground, ground, east, north)] > 1.0).mean() < 0.02


def with_strays(xyz, share, depth_m, seed):
    """Points with a share of them again up to a depth below: reflected twice, or out of a saturated receiver."""
    rng = np.random.default_rng(seed)
    stray = xyz[rng.random(len(xyz)) < share]
    return np.concatenate(
        [xyz, stray - np.column_stack([np.zeros((len(stray), 2)), rng.uniform(0.1, 1, len(stray)) * depth_m])]
    )


@pytest.mark.parametrize("depth_m", [2.0, 30.0])
@pytest.mark.parametrize(("per_m2", "share"), [(6, 0.002), (60, 0.004), (240, 0.01)])
def test_stray_points_below_a_narrow_road_leave_its_ground(per_m2, share, depth_m):
    east, north = field(160.0, 12.0, per_m2=per_m2)
    xyz = cloud(east, north, 0.01 * east)
    clean = find_ground(Points(xyz))
    ground = find_ground(Points(with_strays(xyz, share, depth_m, seed=3)))
    assert ground.is_ground.sum() > 0.99 * clean.is_ground.sum()
    assert (np.abs(off_by(ground, east, north, 0.01 * east)) > 0.2).mean() < 0.01


def test_ground_seen_in_single_cells_below_a_crop_is_ground():
    """1.5 m high and as flat as a road from above; a ray in 200 reaches the soil."""
    east, north = field(60.0, 60.0, per_m2=40)
    soil = np.random.default_rng(4).random(len(east)) < 0.005
    ground = find_ground(Points(cloud(east, north, np.where(soil, 0.0, 1.5))))
    inside = soil & (np.abs(east - 30) < 20) & (np.abs(north - 30) < 20)
    assert at(ground.is_ground, ground, east[inside], north[inside]).mean() > 0.9


def with_scattered(xyz, n, seed):
    """Points with others anywhere around, up to 20 m below and 60 m above: rain, birds, a receiver that fires by itself."""
    low, high = np.subtract(xyz.min(axis=0), 20), np.add(xyz.max(axis=0), [20, 20, 60])
    return np.concatenate([xyz, np.random.default_rng(seed).uniform(low, high, (n, 3))])


@pytest.mark.parametrize("n", [300, 3000])
def test_points_anywhere_around_a_road_leave_its_ground(n):
    east, north = field(100.0, 14.0, per_m2=200)
    xyz = cloud(east, north, 0.01 * east)
    ground = find_ground(Points(with_scattered(xyz, n, seed=5)))
    assert at(ground.is_road, ground, east, north).mean() > 0.98
    assert (np.abs(off_by(ground, east, north, 0.01 * east)) > 0.2).mean() < 0.01
    assert ground.is_ground.sum() < 1.02 * 4 * 100 * 14


def test_single_points_are_the_ground_of_a_thin_survey():
    east, north = field(100.0, 60.0, per_m2=2)
    ground = find_ground(Points(cloud(east, north, hill(east, north))))
    assert at(ground.is_ground, ground, east, north).mean() > 0.99
