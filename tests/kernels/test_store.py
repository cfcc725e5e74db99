"""Sorting, choosing and summing of the tile store's kernels, against slow and obvious twins."""

import numpy as np
import pytest

from linework.kernels.store import order as store_order
from linework.kernels.store import pack as store


def sorted_twin(keys, times, intensities):
    return np.lexsort((intensities, times, keys))


def in_order(keys, times, intensities):
    room = tuple(np.empty(len(keys), dtype) for dtype in (np.uint64, np.int32, np.uint64, np.int32))
    store_order.sort_points(keys, times.view(np.uint64), intensities, room)
    assert np.array_equal(np.sort(room[1]), np.arange(len(keys)))
    assert np.array_equal(room[0], keys[room[1]])
    return room[1]


def some_keys(rng, n, kind):
    if kind == "any":
        return rng.integers(0, 2**64, n, dtype=np.uint64)
    if kind == "one cell":  # 0.5 m, heights within a metre
        y, x, z = rng.integers(0, 5000, n), rng.integers(0, 5000, n), rng.integers(9_000_000, 9_010_000, n)
        return ((y << 37) | (x << 24) | z).astype(np.uint64) | (np.uint64(8000) << np.uint64(50))
    if kind == "one line":  # a wall along an axis: y is the same for all
        return rng.integers(0, 2**37, n).astype(np.uint64)
    if kind == "one column":  # only heights differ
        return rng.integers(0, 40, n).astype(np.uint64)
    return np.full(n, 7, np.uint64)


@pytest.mark.parametrize("kind", ["any", "one cell", "one line", "one column", "equal"])
@pytest.mark.parametrize("n", [0, 1, 2, 15, 16, 17, 33, 1000, 50_000])
def test_sorts_as_lexsort_does(kind, n):
    rng = np.random.default_rng(n)
    keys = some_keys(rng, n, kind)
    times, intensities = rng.integers(-3, 3, n) / 4.0, rng.integers(0, 5, n).astype(np.uint16)
    order, twin = in_order(keys, times, intensities), sorted_twin(keys, times, intensities)
    for column in (keys, times, intensities):
        assert np.array_equal(column[order], column[twin])


@pytest.mark.parametrize("keys", [np.arange(40_000), np.arange(40_000)[::-1], np.arange(40_000) // 300 * 300])
def test_sorts_what_is_in_order_or_reversed(keys):
    keys = keys.astype(np.uint64)
    zeros = np.zeros(len(keys))
    order = in_order(keys, zeros, zeros.astype(np.uint16))
    assert np.array_equal(keys[order], np.sort(keys))


def test_times_without_a_number_have_a_place_too():
    times = np.array([np.nan, 1.0, -np.inf, np.inf, -1.0, 0.0, -0.0])
    order = in_order(np.zeros(7, np.uint64), times, np.zeros(7, np.uint16))
    assert order.tolist() == [2, 4, 6, 5, 1, 3, 0]


def a_run(rng, n):
    keys, times = (rng.integers(0, 2**64, n, dtype=np.uint64) for _ in range(2))
    return keys, times, rng.integers(0, 2**16, n).astype(np.uint16)


@pytest.mark.parametrize("n", [1, 2, 3, 4, 5, 8])
def test_every_flipped_bit_changes_the_checksum(n):
    columns = a_run(np.random.default_rng(n), n)
    sound = store.checksum(*columns)
    for column in columns:
        view = column.view(np.uint8)
        for i in range(len(view)):
            for bit in range(8):
                view[i] ^= 1 << bit
                assert store.checksum(*columns) != sound
                view[i] ^= 1 << bit
    assert store.checksum(*columns) == sound


def test_swapped_and_lost_words_change_the_checksum():
    keys, times, intensities = a_run(np.random.default_rng(3), 100)
    sound = store.checksum(keys, times, intensities)
    swapped = keys.copy()
    swapped[[10, 50]] = keys[[50, 10]]
    zeroed = times.copy()
    zeroed[20:60] = 0
    assert (
        len({sound, store.checksum(swapped, times, intensities), store.checksum(times, keys, intensities)})
        == 3
    )
    assert store.checksum(keys, zeroed, intensities) != sound
    assert store.checksum(keys[:-1], times, intensities) != sound


def test_first_damaged_names_the_run():
    rng = np.random.default_rng(5)
    keys, times, intensities = a_run(rng, 30)
    starts, has_time = np.array([0, 10, 10, 30]), np.array([True, False, False])
    sums = np.array(
        [
            store.checksum(keys[a:b], times[a : b if timed else a], intensities[a:b])
            for a, b, timed in zip(starts, starts[1:], has_time, strict=False)
        ],
        np.uint64,
    )
    assert store_order.first_damaged(keys, times, intensities, starts, has_time, sums) == -1
    times[15] += 1  # a run without times: what stands there is not looked at
    assert store_order.first_damaged(keys, times, intensities, starts, has_time, sums) == -1
    intensities[29] += 1
    assert store_order.first_damaged(keys, times, intensities, starts, has_time, sums) == 2


def test_blocks_are_counted_however_many_they_are():
    rng = np.random.default_rng(6)
    n = 5000
    corners = rng.permutation(n) - n // 2
    xyz = np.stack([corners * 64.0 + 1, corners[::-1] * 64.0 + 2, corners * 1677.7216 + 3], axis=1)
    keys, owners, heights = np.empty(n, np.uint64), np.empty(n, np.int32), np.zeros(2**22, np.int64)
    is_sound, codes, counts, low, high = store.pack_points(xyz, keys, owners, heights, 2**21)
    assert is_sound
    assert (counts == 1).all()
    assert len(np.unique(codes)) == n
    found = store.blocks_of(codes)[owners]
    assert np.array_equal(found, np.stack([corners, corners[::-1], corners], axis=1))
    assert heights.sum() == n
    assert heights[[low, high]].min() >= 1
    assert not heights[:low].any()
    assert not heights[high + 1 :].any()


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf, 2e8, -2e8, 1e300])
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_coordinates_too_far_are_told(bad, axis):
    xyz = np.zeros((3, 3))
    xyz[1, axis] = bad
    keys, owners, heights = np.empty(3, np.uint64), np.empty(3, np.int32), np.zeros(2**22, np.int64)
    assert not store.pack_points(xyz, keys, owners, heights, 2**21)[0]
