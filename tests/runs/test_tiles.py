"""Which tiles a survey is worked in."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from linework.model.grid import Bounds
from linework.runs.settings import TilingConfig
from linework.runs.tiles import plan_tiles

BLOCK_M = 64.0


def plan(extent, count_in=lambda bounds: 1, buffer_m=40.0, blocks=None, **settings):
    if blocks is None:
        east = np.arange(np.floor(extent.west / BLOCK_M), np.floor(extent.east / BLOCK_M) + 1)
        north = np.arange(np.floor(extent.south / BLOCK_M), np.floor(extent.north / BLOCK_M) + 1)
        blocks = np.stack(np.meshgrid(east, north), axis=-1).reshape(-1, 2).astype(np.int64)
    return plan_tiles(extent, blocks, BLOCK_M, count_in, buffer_m, TilingConfig(**settings))


def test_a_small_survey_is_one_tile_that_holds_points_on_its_far_edges():
    (tile,) = plan(Bounds(3.2, -4.0, 900.0, 30.5))
    assert tile.core == Bounds(3.0, -4.0, 901.0, 31.0)
    assert tile.extent == tile.core.grown(40.0)
    assert tile.tile_id == "e3n-4s898"


@pytest.mark.parametrize("extent", [Bounds(0, 0, np.nan, 1), Bounds(5, 0, 4, 1)])
def test_a_plan_needs_sound_extents(extent):
    with pytest.raises(ValueError, match="extent"):
        plan(extent, blocks=np.zeros((1, 2), np.int64))


def test_cores_without_points_are_left_out():
    def count_in(bounds):
        return int(bounds.west < 100 or bounds.east > 4000)

    tiles = plan(Bounds(0.0, 0.0, 4090.0, 10.0), count_in)
    assert [tile.core.west for tile in tiles] == [0.0, 3584.0]


def test_dense_tiles_are_divided_as_far_as_that_helps():
    def count_in(bounds):  # 1 point per square metre in the first 100 m, else nearly none
        inside = max(0.0, min(bounds.east, 100.0) - max(bounds.west, 0.0))
        return int(inside * (bounds.north - bounds.south)) + 1

    tiles = plan(
        Bounds(0.0, 0.0, 1500.0, 500.0), count_in, buffer_m=10.0, max_points=10_000, least_core_m=64.0
    )
    assert all(count_in(t.extent) <= 10_000 or t.core.width_m == 64.0 for t in tiles)
    assert {t.core.width_m for t in tiles} >= {64.0, 128.0, 512.0}
    assert len({t.tile_id for t in tiles}) == len(tiles)


def test_tiles_whose_parts_would_have_nearly_all_of_their_points_are_not_divided():
    def count_in(bounds):  # 4 million points within 20 m, wherever cores meet; two blocks away nearly none
        return 4_000_000 if bounds.west < 74.0 and bounds.east > 54.0 else 1

    (tile,) = plan(Bounds(-30.0, -30.0, 94.0, 48.0), count_in)  # its buffers reach over all of it
    assert tile.core == Bounds(-30.0, -30.0, 95.0, 49.0)
    tiles = plan(Bounds(-30.0, -30.0, 700.0, 48.0), count_in)
    assert {tile.core.width_m for tile in tiles} == {512.0}
    halves = plan(
        Bounds(-30.0, -30.0, 94.0, 48.0), lambda bounds: int(1e5 * (bounds.east - bounds.west)), 8.0
    )
    assert {tile.core.width_m for tile in halves} == {64.0}


@given(
    west=st.floats(-1e6, 1e6), south=st.floats(-1e6, 1e6), width=st.floats(1.0, 4000.0), height=st.floats(1.0, 4000.0),
    core_m=st.sampled_from([100.0, 512.0, 777.7]), shift=st.floats(-1e4, 1e4), seed=st.integers(0, 99),
)  # fmt: skip
def test_every_point_is_in_exactly_one_core(west, south, width, height, core_m, shift, seed):
    xy = np.random.default_rng(seed).uniform([west, south], [west + width, south + height], (50, 2))
    xy = np.round(xy, 4)
    extent = Bounds(*xy.min(axis=0).tolist(), *xy.max(axis=0).tolist())

    def count_in(bounds):
        inside = (xy >= [bounds.west, bounds.south]) & (xy < [bounds.east, bounds.north])
        return int(inside.all(axis=1).sum())

    blocks = np.unique(np.floor(xy / BLOCK_M), axis=0).astype(np.int64)
    settings = {"core_m": core_m, "shift_east_m": shift, "shift_north_m": -shift, "max_points": 10_000}
    tiles = plan(extent, count_in, blocks=blocks, **settings)
    assert sum(count_in(tile.core) for tile in tiles) == len(xy)
    assert all(count_in(tile.core) for tile in tiles)
