"""Planes of cells on disk: they come back bit for bit, and empty ones cost next to nothing."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from linework.errors import MachineError
from linework.files.array_file import opened_arrays, write_arrays
from linework.files.store.cell_tiles import SurfaceTiles
from linework.surface.cells import CellWindow

EDGE = np.dtype([("height", "f4"), ("label", "i4"), ("kind", "u1")])


def written(folder, *planes, n=16):
    tiles = SurfaceTiles(folder, n)
    tiles.write("cells", (0, 0), *planes)
    return tiles, folder / "cells.e0n0.arrays"


def same(a, b) -> bool:
    return a.dtype == b.dtype and a.shape == b.shape and a.tobytes() == b.tobytes()


@settings(deadline=None)
@given(
    dtype=st.sampled_from(["f4", "f8", "i4", "u1", "i2", EDGE]),
    n_values=st.integers(0, 40),
    seed=st.integers(0, 10**6),
    rows=st.tuples(st.integers(0, 16), st.integers(0, 16)).map(sorted),
)
def test_planes_come_back_bit_for_bit(tmp_path_factory, dtype, n_values, seed, rows):
    draw = np.random.default_rng(seed)
    plane = np.zeros((16, 16), dtype)
    if plane.dtype.kind == "f":
        plane[:] = np.nan
    at = draw.integers(0, 256, n_values)
    plane.reshape(-1)[at] = draw.integers(0, 3, n_values).astype(
        plane.dtype if plane.dtype.names is None else "u1"
    )
    tiles, _ = written(tmp_path_factory.mktemp("t"), plane, np.array([3, 1]))
    back, labels = tiles.read("cells", (0, 0))
    assert same(back, plane)
    assert labels.tolist() == [3, 1]
    if rows[0] < rows[1]:
        window = CellWindow(2, 16 - rows[1], rows[1] - rows[0], 9)
        part = tiles.part("cells", 0, (0, 0), window)
        assert same(part, np.ascontiguousarray(plane[rows[0] : rows[1], 2:11]))


def test_zeros_of_either_sign_and_nans_of_any_bits_are_kept(tmp_path):
    odd = np.array([0x7FC00000, 0x7FC00001, 0x80000000, 0], np.uint32).view(np.float32)
    plane = np.repeat(odd, 64).reshape(16, 16)
    tiles, path = written(tmp_path, plane)
    assert path.stat().st_size < 500
    assert same(tiles.read("cells", (0, 0))[0], plane)


@pytest.mark.parametrize(("n_points", "most_bytes"), [(1, 1_500), (100, 12_000)])
def test_a_tile_with_few_points_takes_few_bytes(tmp_path, n_points, most_bytes):
    """384 x 384 cells of three planes are 1.8 MB as they are."""
    height = np.full((384, 384), np.nan, np.float32)
    height.reshape(-1)[:: 384**2 // n_points][:n_points] = 7.0
    count = np.where(np.isnan(height), 0, 1).astype(np.int32)
    tiles, path = written(tmp_path, height, height, count, n=384)
    assert path.stat().st_size < most_bytes
    assert same(tiles.read("cells", (0, 0))[2], count)


def test_a_plane_full_of_values_stays_as_it_is(tmp_path):
    plane = np.random.default_rng(1).random((384, 384), dtype=np.float32)
    _, path = written(tmp_path, plane, n=384)
    assert plane.nbytes < path.stat().st_size < plane.nbytes + 1_000


def test_stretches_that_do_not_fill_the_plane_are_said(tmp_path):
    tiles, path = written(tmp_path, np.zeros((16, 16), np.float32))
    data = bytearray(path.read_bytes())
    at = data.index(np.array([16, 16, 256], np.int32).tobytes())
    data[at + 8 : at + 12] = np.int32(255).tobytes()
    path.write_bytes(data)
    with pytest.raises(MachineError, match=r"is damaged: stretches of 1 cells do not fill 16 x 16"):
        tiles.read("cells", (0, 0))


def test_headers_of_any_length_are_read(tmp_path):
    # Headers of 128 bytes are usual, those of many dimensions are longer
    arrays = np.arange(3.0), np.arange(2).reshape((1,) * 30 + (2,)), np.arange(5, dtype="u1")
    write_arrays(tmp_path / "a.arrays", *arrays)
    with opened_arrays(tmp_path / "a.arrays") as file:
        assert all(same(a, b) for a, b in zip(file.all(), arrays, strict=True))
