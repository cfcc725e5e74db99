"""Laws of making a store: batches, order and threads change nothing; times are counted the same in any portions."""

import tempfile
from pathlib import Path

import laspy
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.oracles.las_in_memory import read_las
from tests.scenes.effort import examples

from linework.files.las.decode_process import decode_file
from linework.files.las.decoder_messages import Decoded, DecodeTask
from linework.files.las.tally import TimeCounts
from linework.files.store.extent import stray_limits
from linework.files.store.read import PointStore
from linework.files.store.write import write_index

#: Few different values, so that points share places and times; some far away, noise, times that are none.
PLACES = st.sampled_from([0.0, 0.001, 63.999, 64.0, -0.001, 700.0, 90_000.0])
TIMES = st.sampled_from([1.0, 2.5, 2.5000001, 600.0, np.nan])
POINTS = st.tuples(PLACES, PLACES, PLACES, st.integers(0, 3), st.sampled_from([1, 1, 1, 7]), TIMES)


def write(rows, path):
    header = laspy.LasHeader(version="1.4", point_format=6)
    header.scales = [0.001] * 3
    data = laspy.LasData(header)
    data.x, data.y, data.z = (np.array([row[axis] for row in rows]) for axis in range(3))
    data.intensity = [row[3] for row in rows]
    data.classification = [row[4] for row in rows]
    data.gps_time = [row[5] for row in rows]
    data.write(path)


def stored(path, folder, **settings_):
    """What a store of this one file holds, and what is said of it, but for the order it came in."""
    folder.mkdir()
    task = DecodeTask(path=path, target=folder / "0.points", **settings_)
    done = decode_file(task, lambda message: None)
    done = Decoded.from_document(done.to_document() | {"in_time_order": None, "sample": None})
    write_index(folder, done.runs, {}, stray_limits(done.runs, [done.height_counts]))
    points = PointStore.open(folder).points()
    said = {name: getattr(done, name) for name in Decoded.__slots__ if name not in ("runs", "repeats")}
    return points, said


@pytest.mark.parametrize("suffix", [".las", ".laz"])
@settings(max_examples=examples(40), deadline=None)
@given(rows=st.lists(POINTS, min_size=1, max_size=60), data=st.data())
def test_a_store_does_not_depend_on_batches_order_or_decoder(suffix, rows, data):
    usable = [row for row in rows if row[4] != 7 and not np.isnan(row[5])]
    if not usable:
        rows = [*rows, (0.0, 0.0, 0.0, 1, 1, 1.0)]
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write(rows, folder / f"a{suffix}")
        write(data.draw(st.permutations(rows)), folder / f"b{suffix}")
        points, said = stored(folder / f"a{suffix}", folder / "whole")
        portions = data.draw(st.integers(1, len(rows)))
        sequential = data.draw(st.booleans())
        again, said_again = stored(
            folder / f"b{suffix}", folder / "parts", batch_points=portions, is_sequential=sequential
        )
        assert said == said_again
        for column in ("xyz", "intensity", "time_s"):
            np.testing.assert_array_equal(getattr(points, column), getattr(again, column))
        read = read_las(folder / f"a{suffix}", crs="local", batch_points=portions)
        assert read.n_promised == len(rows) == len(read.points) + sum(read.n_rejected.values())
        assert (len(read.points), read.n_rejected) == (said["n_points"], said["n_rejected"])
        if len(points) == len(read.points):
            np.testing.assert_allclose(
                np.sort(read.points.xyz, axis=0), np.sort(points.xyz, axis=0), rtol=0, atol=5.1e-5
            )


ANY_TIMES = st.lists(
    st.floats(-1e9, 4e9, allow_nan=False) | st.sampled_from([0.0, -1e-17, -5e-324, 3e8, 3e8 + 4096]),
    min_size=1,
)


@given(times=ANY_TIMES, data=st.data())
def test_times_are_counted_the_same_in_any_portions(times, data):
    whole = TimeCounts()
    whole.add(np.array(times))
    parts = TimeCounts()
    rest = data.draw(st.permutations(times))
    while rest:
        n = data.draw(st.integers(1, len(rest)))
        part = TimeCounts()
        part.add(np.array(rest[:n]))
        parts.merge(part)
        rest = rest[n:]
    assert whole == parts == TimeCounts.from_document(whole.to_document())
    assert whole.counts.sum() == len(times)
    assert len(whole.counts) <= 4096
    assert whole.share_within(min(times), max(times)) == 1.0
    assert whole.share_within(max(times) + 1.0, 1e10) == 0.0
    # Within a bucket at either end, the share is that of the times themselves
    width, start, end = (
        2.0**whole.level,
        *sorted(data.draw(st.tuples(st.floats(-1e9, 4e9), st.floats(-1e9, 4e9)))),
    )
    inside = sum(start <= t <= end for t in times)
    wide = sum(start - width <= t <= end + width for t in times)
    narrow = sum(start + width <= t <= end - width for t in times)
    assert narrow / len(times) - 1e-9 <= whole.share_within(start, end) <= wide / len(times) + 1e-9
    assert narrow <= inside <= wide
