"""Images are paired by their times, whatever is missing and however the cameras' stamps wander."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from linework.imaging.pairing import certain_times, pair_by_time

_shown = st.lists(st.booleans(), min_size=12, max_size=60)


@given(_shown, _shown, st.integers(0, 2**32 - 1), st.floats(0.02, 2.0))
def test_missing_images_shift_no_pair(
    left: list[bool], right: list[bool], seed: int, interval_s: float
) -> None:
    n = min(len(left), len(right))
    in_left, in_right = np.flatnonzero(left[:n]), np.flatnonzero(right[:n])
    # A camera that misses most of its images has another rate: tolerance goes with the faster one
    if max(len(in_left), len(in_right)) < 0.7 * n:
        in_left = np.arange(n)
    wander = np.random.default_rng(seed).uniform(-0.1, 0.1, size=(2, n)) * interval_s
    moments = 4.0e8 + interval_s * np.arange(n)
    found = pair_by_time((moments + wander[0])[in_left], (moments + wander[1])[in_right])
    paired = list(zip(in_left[found.left].tolist(), in_right[found.right].tolist(), strict=True))
    assert paired == [(i, i) for i in sorted({*in_left.tolist()} & {*in_right.tolist()})]


@given(
    st.lists(st.floats(0.0, 10.0), min_size=1, max_size=30),
    st.lists(st.floats(0.0, 10.0), min_size=1, max_size=30),
)
def test_each_is_the_others_nearest_and_none_is_used_twice(left: list[float], right: list[float]) -> None:
    left_s, right_s = np.unique(left), np.unique(right)
    found = pair_by_time(left_s, right_s)
    assert np.all(np.diff(found.left) > 0) and np.all(np.diff(found.right) > 0)
    for i, j in zip(found.left, found.right, strict=True):
        apart = abs(left_s[i] - right_s[j])
        assert apart < found.tolerance_s
        assert apart == np.abs(right_s - left_s[i]).min() == np.abs(left_s - right_s[j]).min()


@given(st.lists(st.integers(0, 20), min_size=1, max_size=40))
def test_certain_times_are_those_written_in_one_stretch_only(times: list[int]) -> None:
    """Against the slow way: cut where time runs backwards, keep what lies in no other stretch."""
    time_s = np.array(times, dtype=np.float64)
    is_first = [i == 0 or times[i] != times[i - 1] for i in range(len(times))]
    stretches: list[list[int]] = []
    for i in range(len(times)):
        if is_first[i]:
            if not stretches or times[i] < times[stretches[-1][-1]]:
                stretches.append([])
            stretches[-1].append(i)
    expected = np.zeros(len(times), dtype=bool)
    for own in stretches:
        others = [(times[s[0]], times[s[-1]]) for s in stretches if s is not own]
        for i in own:
            expected[i] = not any(low <= times[i] <= high for low, high in others)
    assert certain_times(time_s).tolist() == expected.tolist()
