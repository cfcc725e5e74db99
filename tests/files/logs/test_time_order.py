"""Rows of a log in time order: shuffled, doubled, by a clock that was set back."""

import numpy as np

from linework.files.logs.clock import in_time_order


def ordered(time):
    time = np.asarray(time, dtype=np.float64)
    kept, said = in_time_order(time, np.arange(len(time)) + 2.0)
    assert np.all(np.diff(time[kept]) > 0)
    return time[kept], said


def test_shuffled_rows_are_sorted():
    time = np.arange(200) / 10
    got, said = ordered(np.random.default_rng(1).permutation(time))
    np.testing.assert_array_equal(got, time)
    assert len(said) == 1
    assert said[0].endswith(": sorted")


def test_two_rows_that_changed_places_are_sorted():
    time = np.arange(200) / 10
    time[[50, 51]] = time[[51, 50]]
    got, said = ordered(time)
    assert len(got) == 200
    assert said == ("time runs backwards 1 times, first at line 53: sorted",)


def test_files_in_the_wrong_order_and_one_file_twice():
    time = np.arange(100) / 10
    got, _ = ordered(np.concatenate([time[60:], time[:60]]))
    np.testing.assert_array_equal(got, time)
    got, said = ordered(np.concatenate([time, time]))
    np.testing.assert_array_equal(got, time)
    assert said[-1] == "100 rows with a repeated time left out"


def test_a_clock_that_is_set_back_leaves_the_doubtful_times_out():
    time = np.arange(1000) / 100
    time[400:] -= 1.0005  # between the stamps of before
    got, (said,) = ordered(time)
    assert not np.any((got >= 3.0) & (got < 3.98))
    assert len(got) > 795
    assert said.startswith(
        "the clock was set back 1 times, first after 3.990 s by 0.990 s at line 402: 200 rows"
    )


def test_a_clock_that_stands_still_counts_once():
    got, said = ordered([0.0, 1.0, 1.0, 1.0, 2.0])
    assert got.tolist() == [0, 1, 2]
    assert said == ("2 rows with a repeated time left out",)
