"""Epochs of GPS time and UTC, weeks that end, milliseconds, clocks that are off."""

import datetime

import numpy as np
import pytest

from linework.errors import InputError
from linework.files.logs.clock import (
    epoch_by_values,
    fitted_times,
    gps_of_unix,
    in_seconds,
    known_offsets,
    to_survey_time,
    unix_of_gps,
)

WEEK = 604800.0


def test_leap_seconds_at_dates_whose_gps_time_is_published():
    # GPS week 0 began on 1980-01-06, the second roll-over of 1024 weeks was on 2019-04-07 00:00:00 GPS = -18 s UTC
    rollover = datetime.datetime(2019, 4, 6, 23, 59, 42, tzinfo=datetime.UTC).timestamp()
    assert float(gps_of_unix(np.array(rollover))) == 2048 * WEEK
    first = datetime.datetime(1999, 8, 21, 23, 59, 47, tzinfo=datetime.UTC).timestamp()
    assert float(gps_of_unix(np.array(first))) == 1024 * WEEK
    # Round a leap second: 2016-12-31 23:59:59 and the second after the leap
    leap = datetime.datetime(2017, 1, 1, tzinfo=datetime.UTC).timestamp()
    before, after = gps_of_unix(np.array([leap - 1, leap]))
    assert after - before == 2.0
    np.testing.assert_array_equal(unix_of_gps(np.array([before, after])), [leap - 1, leap])


EPOCHS = ("gps_week", "gps_adjusted", "gps", "unix")


@pytest.mark.parametrize("first", EPOCHS)
@pytest.mark.parametrize("second", EPOCHS)
def test_there_and_back(first, second):
    gps = 2301 * WEEK + 345_600.25 + np.arange(5.0)
    start = to_survey_time(gps, "gps", first, week=2301)
    assert epoch_by_values(start) == first
    there = to_survey_time(start, first, second, week=2301)
    assert epoch_by_values(there) == second
    np.testing.assert_array_equal(to_survey_time(there, second, "gps", week=2301), gps)


def test_the_week_comes_from_a_time_of_the_survey():
    adjusted = 2301 * WEEK + 100.0 - 1e9
    got = to_survey_time(np.array([604_790.0, 604_810.0]), "gps_week", "gps_adjusted", near_s=adjusted)
    np.testing.assert_allclose(got, [adjusted - 110.0, adjusted - 90.0])
    with pytest.raises(InputError, match="seconds of the week, but the week is unknown"):
        to_survey_time(np.array([5.0]), "gps_week", "unix")


def test_times_that_fit_are_left_alone_whatever_is_said():
    time = np.arange(10.0)
    assert fitted_times(time, "unix", (5.0, 8.0), "gps_adjusted") == (time, ())


def test_times_of_another_epoch_are_converted_if_they_then_fit():
    adjusted = 2301 * WEEK - 1e9 + 1000.0 + np.arange(10.0)
    span = (float(adjusted[2]), float(adjusted[5]))
    for epoch in ("gps_week", "gps", "unix"):
        logged = to_survey_time(adjusted, "gps_adjusted", epoch)
        got, (said,) = fitted_times(logged, "", span, "")
        np.testing.assert_allclose(got, adjusted, atol=1e-6)
        assert said.endswith("converted to adjusted GPS seconds")
    nowhere, said = fitted_times(adjusted - 5e6, "", span, "")
    assert said == ()
    assert nowhere[0] == adjusted[0] - 5e6


def test_a_receiver_that_counts_weeks_to_1024():
    adjusted = 2301 * WEEK - 1e9 + np.arange(10.0)
    span = (float(adjusted[2]), float(adjusted[5]))
    for epoch, words in (("gps_adjusted", ""), ("unix", "converted to adjusted GPS seconds, and ")):
        early = to_survey_time(adjusted - 1024 * WEEK, "gps_adjusted", epoch)
        got, (said,) = fitted_times(early, epoch, span, "gps_adjusted")
        np.testing.assert_allclose(got, adjusted, atol=1e-6)
        assert said.endswith(f": {words}1024 weeks added (week rollover of the receiver)")


@pytest.mark.parametrize(
    ("unit", "per_second"), [("milliseconds", 1e3), ("microseconds", 1e6), ("nanoseconds", 1e9)]
)
@pytest.mark.parametrize("start", [1.7e9, 302_400.0])
def test_units_are_told_by_size_or_by_steps(unit, per_second, start):
    time = start + np.arange(20_000) / 100
    got, said = in_seconds(np.round(time * per_second))
    np.testing.assert_allclose(got, time, atol=1e-5)
    assert said == (f"times are in {unit}: converted to seconds",)


@pytest.mark.parametrize("time", [[0.0, 100.0], [0.0, 86_000.0], [1e8, 1e8 + 1e5 + 0.5], [7.0]])
def test_seconds_stay_seconds(time):
    got, said = in_seconds(np.array(time))
    assert got.tolist() == time
    assert said == ()


def test_the_end_of_a_week_and_of_1024_weeks():
    got, (said,) = in_seconds(np.array([604_799.9, 0.0, 0.1]))
    np.testing.assert_allclose(got, [604_799.9, 604_800.0, 604_800.1])
    assert said == "the GPS week ends within the log, after 604799.90 s: times continued"
    begun = 1024 * WEEK
    got, (said,) = in_seconds(np.array([begun - 1, 0.5, 1.0]))
    np.testing.assert_allclose(got, [begun - 1, begun + 0.5, begun + 1])
    # Rows in another order are not the end of a week
    assert in_seconds(np.array([5000.0, 1.0, 3.0]))[1] == ()


def test_a_log_without_times():
    with pytest.raises(InputError, match=r"t\.csv: all 3 times are 0\."):
        in_seconds(np.zeros(3), "t.csv")


def test_offsets_have_names():
    today = dict(known_offsets(4.0e8, "gps_adjusted"))
    assert sorted(map(abs, today)) == [1, 1, 18, 18, 19, 19, 37, 37]
    assert today[-18.0] == "UTC taken for GPS time"
    assert today[18.0] == "GPS time taken for UTC"
    assert today[19.0] == "TAI taken for GPS time"
    assert dict(known_offsets(1.317e9, "unix"))[-15.0] == "UTC taken for GPS time"  # 2011
