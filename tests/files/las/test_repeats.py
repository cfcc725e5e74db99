"""Points that are there twice: told from a sample that the points' own places choose."""

import numpy as np
import pytest

from linework.files.las import repeats
from linework.files.las.repeats import PointSample, repeated_elsewhere, repeated_inside, sample_bits


def drive(n, seed=1, low=0.0):
    rng = np.random.default_rng(seed)
    xyz = np.round(rng.uniform(low, low + 40, (n, 3)), 3)
    return xyz, rng.integers(0, 4000, n).astype(np.uint16), 3e8 + np.arange(n) * 1e-3


def sample_of(parts, bits=0, *, timed=True):
    sample = PointSample(bits)
    for xyz, intensity, time in parts:
        sample.add(xyz, intensity, time if timed else None)
    return sample.numbers()


@pytest.mark.parametrize("bits", [0, 4])
def test_the_sample_does_not_depend_on_order_or_batches(bits):
    xyz, intensity, time = drive(20_000)
    order = np.random.default_rng(2).permutation(20_000)
    halves = [(xyz[i], intensity[i], time[i]) for i in np.array_split(order, 7)]
    whole = sample_of([(xyz, intensity, time)], bits)
    np.testing.assert_array_equal(whole, sample_of(halves, bits))
    assert len(whole) == 20_000 if bits == 0 else 800 < len(whole) < 1_800


@pytest.mark.parametrize("bits", [0, 4])
@pytest.mark.parametrize("timed", [True, False])
def test_a_file_merged_with_itself(bits, timed):
    part = drive(20_000)
    (said,) = repeated_inside(sample_of([part, part], bits, timed=timed), has_time=timed)
    assert (
        said == f"about 50% of the points repeat others (same place{', time' if timed else ''} and intensity)"
    )
    assert repeated_inside(sample_of([part], bits, timed=timed), has_time=timed) == ()


def test_places_seen_again_later_are_no_repeats():
    xyz, intensity, time = drive(5_000)
    again = xyz, intensity, time + 60.0
    assert repeated_inside(sample_of([(xyz, intensity, time), again]), has_time=True) == ()


def test_few_points_say_nothing():
    part = drive(40)
    assert repeated_inside(sample_of([part, part]), has_time=True) == ()


def test_files_that_hold_each_others_points():
    a, b, c = drive(5_000, 1), drive(5_000, 2), drive(5_000, 3)
    d = tuple(np.concatenate([column[:600], own]) for column, own in zip(a, drive(2_400, 4), strict=True))
    samples = [sample_of(parts) for parts in ([a], [b], [a, b, c], [c], [c], [d])]
    found = repeated_elsewhere(samples, has_time=True)
    assert found[0] == (2, 1.0)
    assert found[1] == (2, 1.0)
    assert found[3] == (2, 1.0)
    assert found[4] == (2, 1.0)
    assert found[5] == (0, pytest.approx(0.2)) or found[5] == (2, pytest.approx(0.2))
    assert found[2][1] < 0.4


def test_of_two_equal_files_the_later_one_is_named():
    a = sample_of([drive(1_000)])
    assert repeated_elsewhere([a, a], has_time=True) == {1: (0, 1.0)}
    assert repeated_elsewhere([a, a, a], has_time=True) == {1: (0, 1.0), 2: (0, 1.0)}


def test_files_side_by_side_are_no_repeats():
    samples = [sample_of([drive(3_000, i, 100.0 * i)]) for i in range(4)]
    assert repeated_elsewhere(samples, has_time=True) == {}
    assert repeated_elsewhere([], has_time=True) == {}


def test_points_that_share_their_eastings_do_not_fill_the_memory(monkeypatch):
    monkeypatch.setattr(repeats, "_MOST_OF_A_FILE", 1_000)
    xyz, intensity, time = drive(900)
    xyz[:, 0] = 0.0
    assert len(sample_of([(xyz, intensity, time)] * 5, bits=3)) == 1_800


def test_surveys_are_sampled_alike_whatever_their_size():
    for n in (70_000, 1_000_000, 50_000_000, 4_000_000_000):
        assert 2**15 <= n / 2 ** sample_bits(n) <= 2**16
