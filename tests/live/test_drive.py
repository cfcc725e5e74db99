"""A drive that is followed: what arrives late, half written, twice or not at all; and what a kill leaves."""

from __future__ import annotations

import json
import resource
import shutil
import signal
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from tests.scenes.live_drives import (
    FIRST_S,
    N_PAIRS,
    ORIGIN,
    PAIR_S,
    SOLID,
    Filling,
    stripe_offsets,
    write_live_source,
)

from linework import read_lines
from linework.files.vectors.point_layers import read_point_layers

END_S = FIRST_S + N_PAIRS * PAIR_S


@pytest.fixture(scope="module")
def source(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("live") / "source"
    folder.mkdir()
    write_live_source(folder)
    return folder


@pytest.fixture
def filling(source, tmp_path) -> Filling:
    return Filling(source, tmp_path / "van").begin()


@pytest.fixture
def output(tmp_path) -> Path:
    return tmp_path / "lines.gpkg"


def layer(output, name):
    return next(found for found in read_point_layers(output) if found.name == name)


def record(output):
    return json.loads(output.with_name(output.name + ".live.json").read_text())


def test_lines_photolog_and_keys_of_a_drive(filling, output):
    drive = filling.drive(output)
    filling.go(drive, 6.0)
    drive.operator.press("manhole", "press-0001", 0.5)
    filling.go(drive, END_S + 2.5)
    drive.finish(filling.now_s)
    assert filling.lines == []
    assert record(output)["pairs"] == {"looked": N_PAIRS, "skipped": 0, "failed": 0, "no position": 0}
    lines = read_lines(output)
    # Both solid stripes, where they are painted
    found = stripe_offsets(lines)
    assert all(min(abs(offset - known) for offset in found) < 0.05 for known in SOLID)
    assert lines.length_m.max() > 0.8 * 15.0 * N_PAIRS * PAIR_S
    photos = layer(output, "photolog")
    assert len(photos.xyz) == N_PAIRS
    expected = ORIGIN[0] + 15.0 * (np.asarray(photos.fields["time_s"]) - FIRST_S)
    assert np.abs(photos.xyz[:, 0] - expected).max() < 0.15
    assert np.ptp(np.diff(np.asarray(photos.fields["chainage_m"]))) < 0.3
    events = layer(output, "event")
    assert events.fields["key"].tolist() == ["manhole"]
    # Half a second before it was acknowledged, and the newest reading is some hundredths old
    assert events.fields["time_s"][0] == pytest.approx(5.5, abs=0.03)
    assert events.xyz[0, 0] - ORIGIN[0] == pytest.approx(15.0 * (5.5 - FIRST_S), abs=0.6)


def test_the_extraction_afterwards_has_the_keys_on_the_smoothed_trajectory(
    filling, output, linework, tmp_path
):
    drive = filling.drive(output)
    filling.go(drive, 6.0)
    drive.operator.press("manhole", "press-0001", 0.0)
    drive.operator.press("cracks, fine", "press-0002", 0.0)
    filling.go(drive, 8.0)
    drive.operator.press("cracks, fine", "press-0003", 0.0)
    filling.go(drive, END_S + 2.5)
    drive.finish(filling.now_s)
    final = tmp_path / "final.gpkg"
    outcome = linework("extract", filling.folder, "-o", final, "--workers", 1, "--quiet")
    assert outcome.code == 0, outcome.stderr
    events = layer(final, "event")
    assert events.fields["key"].tolist() == ["manhole", "cracks, fine", "cracks, fine"]
    assert [text or "" for text in events.fields["span"]] == ["", "begin", "end"]
    live = layer(output, "event")
    assert np.abs(events.xyz - live.xyz).max() < 0.2
    assert not np.array_equal(events.xyz, live.xyz)


def test_images_that_are_still_written_are_tried_again(filling, output):
    drive = filling.drive(output)
    filling.go(drive, 5.0)
    row = filling.rows("left", 5.0, 5.2)
    whole = (filling.source / row[0].split(",")[0]).read_bytes()
    half = filling.folder / row[0].split(",")[0]
    half.write_bytes(whole[: len(whole) // 2])
    filling.append("left", row, images=False)
    filling.append("right", filling.rows("right", 5.0, 5.2))
    filling.fill(5.2, only={"gnss", "gyro", "wheels"})
    filling.settle(drive)
    before = drive.status(filling.now_s).counts["looked"]
    filling.go(drive, 6.0)
    # The others are not held up
    assert drive.status(filling.now_s).counts["looked"] > before
    half.write_bytes(whole)
    filling.go(drive, END_S + 2.5)
    drive.finish(filling.now_s)
    assert record(output)["pairs"]["looked"] == N_PAIRS
    assert filling.lines == []


def test_an_image_that_stays_half_is_named_once(filling, output):
    drive = filling.drive(output)
    filling.go(drive, 5.0)
    row = filling.rows("left", 5.0, 5.2)
    whole = (filling.source / row[0].split(",")[0]).read_bytes()
    (filling.folder / row[0].split(",")[0]).write_bytes(whole[:1000])
    filling.append("left", row, images=False)
    filling.fill(5.2, only={"gnss", "gyro", "wheels", "right"})
    filling.go(drive, END_S + 2.5)
    assert [line.split("/")[-1] for line in filling.lines] == [
        "0005.png: PNG cut off after 1,000 bytes. Copy the file again, or leave it out: left out"
    ]
    drive.finish(filling.now_s)
    assert record(output)["pairs"] == {"looked": N_PAIRS - 1, "skipped": 0, "failed": 1, "no position": 0}
    assert [found["file"] for found in record(output)["failed"]] == ["left/0005.png"]


def test_lines_of_the_lists_in_any_order_change_nothing(filling, source, output, tmp_path):
    plain = filling.drive(output)
    filling.go(plain, END_S + 2.5)
    plain.finish(filling.now_s)
    other = Filling(source, tmp_path / "mixed").begin()
    drive = other.drive(tmp_path / "mixed.gpkg")
    while other.time_s < END_S + 2.4:
        start = other.time_s
        for side in ("left", "right"):
            other.append(side, other.rows(side, start, start + 1.0)[:: -1 if side == "left" else 1])
        for name in ("wheels", "gnss", "gyro"):
            other.append(name, other.rows(name, start, start + 1.0))
        other.time_s = start + 1.0
        other.settle(drive)
    drive.finish(other.now_s)
    assert other.lines == []
    a, b = read_lines(output), read_lines(tmp_path / "mixed.gpkg")
    assert stripe_offsets(a) == pytest.approx(stripe_offsets(b), abs=0.02)
    assert record(tmp_path / "mixed.gpkg")["pairs"]["looked"] == N_PAIRS
    times = np.asarray(layer(tmp_path / "mixed.gpkg", "photolog").fields["time_s"])
    assert (np.diff(times) > 0).all()


def test_an_image_without_its_partner_is_named_once(filling, output):
    drive = filling.drive(output)
    filling.go(drive, 5.0)
    filling.fill(5.2, only={"gnss", "gyro", "wheels", "left"})
    filling.go(drive, END_S)
    filling.stopped = {"left", "right"}
    filling.wait(drive, 12.0)
    alone = [line for line in filling.lines if "other camera" in line]
    assert alone == ["0005.png: the image of the other camera has not come: left out"]


def test_logs_that_stop_are_named_once_and_it_goes_on(filling, output):
    drive = filling.drive(output)
    filling.go(drive, 6.0)
    filling.stopped = {"gyro"}
    filling.go(drive, 10.0)
    assert [line for line in filling.lines if "gyro" in line] == [
        "gyro.csv: nothing new for 3 s: positions are less certain, or missing"
    ]
    looked = drive.status(filling.now_s).counts["looked"]
    assert looked == pytest.approx((10.0 - FIRST_S) / PAIR_S, abs=1)
    filling.stopped = set()
    filling.append("gyro", filling.rows("gyro", 6.0, 10.0))
    filling.go(drive, END_S + 2.5)
    drive.finish(filling.now_s)
    assert "gyro.csv: runs again" in filling.lines
    assert len(layer(output, "photolog").xyz) == N_PAIRS


def test_where_all_logs_end_the_last_pairs_are_placed_too(filling, output):
    drive = filling.drive(output)
    filling.go(drive, END_S + 0.1)
    filling.wait(drive, 12.0)
    assert len(layer(output, "photolog").xyz) == N_PAIRS
    assert record(output)["pairs"]["no position"] == 0


def test_a_log_without_its_columns_is_named_once_and_the_pairs_are_looked_at(filling, output):
    (filling.folder / "gyro.csv").write_text("time_s,rate\n")
    drive = filling.drive(output)
    filling.go(drive, 8.0)
    assert sum("gyro.csv: missing column yaw_rate_dps" in line for line in filling.lines) == 1
    assert drive.status(filling.now_s).counts["looked"] == pytest.approx((8.0 - FIRST_S) / PAIR_S, abs=1)


def test_pairs_too_far_behind_are_skipped_and_named(filling, output):
    drive = filling.drive(output, longest_lag_s=1.0)
    filling.fill(END_S + 2.5)
    filling.settle(drive)
    drive.finish(filling.now_s)
    n = record(output)["pairs"]["skipped"]
    assert 0 < n < N_PAIRS
    assert record(output)["skipped"] == [f"left/{i:04d}.png" for i in range(n)]
    assert filling.lines == [f"{n} pairs skipped to keep up: 0000.png to {n - 1:04d}.png"]
    # They are in the photolog all the same
    assert len(layer(output, "photolog").xyz) == N_PAIRS


def test_killed_at_any_time_it_continues_where_it_was(filling, output, source, tmp_path):
    plain = Filling(source, tmp_path / "plain").begin()
    whole = plain.drive(tmp_path / "plain.gpkg")
    plain.go(whole, END_S + 2.5)
    whole.finish(plain.now_s)
    acknowledged = []
    for k, until_s in enumerate(np.linspace(5.0, END_S + 2.5, 11)):
        drive = filling.drive(output)  # what the one before had in memory is gone
        filling.go(drive, float(until_s))
        saved = drive.status(filling.now_s).saved_pairs
        acknowledged.append(drive.operator.press("manhole", f"press-{k:04d}", 0.0))
        again = filling.drive(output)
        counts = again.status(filling.now_s).counts
        assert counts["looked"] >= saved
        assert again.operator.presses() == acknowledged
    drive.finish(filling.now_s)
    assert record(output)["pairs"] == record(tmp_path / "plain.gpkg")["pairs"]
    assert len(layer(output, "photolog").xyz) == N_PAIRS
    # The last was pressed after the last reading
    assert len(layer(output, "event").xyz) == len(acknowledged) - 1
    assert record(output)["driven_m"] == pytest.approx(record(tmp_path / "plain.gpkg")["driven_m"], abs=0.5)
    found, expected = stripe_offsets(read_lines(output)), stripe_offsets(read_lines(tmp_path / "plain.gpkg"))
    assert all(min(abs(a - b) for a in found) < 0.05 for b in expected)


@contextmanager
def full_disk(n_bytes):
    """Let no file grow beyond a size, as a full disk does."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (n_bytes, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
        signal.signal(signal.SIGXFSZ, handler)


def test_a_full_disk_is_named_once_and_nothing_is_lost(filling, output):
    from linework.errors import MachineError

    drive = filling.drive(output)
    filling.go(drive, 6.0)
    drive.operator.press("manhole", "press-0001", 0.0)
    filling.go(drive, 7.0)
    before = output.read_bytes()
    for _ in range(3):
        filling.fill(filling.time_s + 3.0)
        with full_disk(60):
            with pytest.raises(MachineError):
                drive.operator.press("manhole", "press-0002", 0.0)
            filling.settle(drive)
    assert output.read_bytes() == before
    assert sum("live.jsonl" in line for line in filling.lines) == 1
    assert sum("lines.gpkg" in line for line in filling.lines) == 1
    drive.operator.press("manhole", "press-0002", 0.0)
    filling.go(drive, END_S + 2.5)
    drive.finish(filling.now_s)
    assert "journal: written again" in filling.lines
    assert "output: written again" in filling.lines
    again = filling.drive(output)
    assert again.status(filling.now_s).counts["looked"] == N_PAIRS
    assert [press.press for press in again.operator.presses()] == ["press-0001", "press-0002"]
    shutil.rmtree(filling.folder)


def test_an_undone_press_is_gone_and_a_repeated_one_counts_once(filling, output):
    drive = filling.drive(output)
    filling.go(drive, 5.0)
    first = drive.operator.press("manhole", "press-0001", 0.0)
    assert drive.operator.press("manhole", "press-0001", 3.0) == first
    begin = drive.operator.press("cracks, fine", "press-0002", 0.0)
    end = drive.operator.press("cracks, fine", "press-0003", 0.0)
    assert (begin.span, end.span) == ("begin", "end")
    drive.operator.undo("press-0003")
    # The stretch is open again
    assert list(drive.operator.newest()[1]) == ["cracks, fine"]
    drive.operator.undo("press-0001")
    assert filling.drive(output).operator.presses() == [begin]


def test_a_press_before_any_log_is_refused(filling, output):
    from linework.errors import InputError

    drive = filling.drive(output)
    with pytest.raises(InputError, match="the time is not known"):
        drive.operator.press("manhole", "press-0001", 0.0)


def test_after_some_way_the_next_file_begins(filling, output, monkeypatch):
    monkeypatch.setattr("linework.live.stretches.LIVE_STRETCH_M", 30.0)
    monkeypatch.setattr("linework.live.drive.FILE_M", 60.0)
    drive = filling.drive(output)
    filling.go(drive, 10.0)
    drive = filling.drive(output)  # killed in between
    filling.go(drive, END_S + 2.5)
    drive.finish(filling.now_s)
    files = [output, *(output.with_name(f"lines-{i}.gpkg") for i in (2, 3))]
    assert sorted(output.parent.glob("*.gpkg")) == sorted(files)
    photos = [layer(path, "photolog").fields["pair"].tolist() for path in files]
    assert [number for own in photos for number in own] == list(range(N_PAIRS))
    # The first holds the way to the first pair
    lines = [found for path in files if len(found := read_lines(path))]
    assert len(lines) > 1
    assert sum(one.length_m.sum() for one in lines) > 2 * 0.8 * 15.0 * N_PAIRS * PAIR_S
    for before, after in pairwise(lines):
        assert before.xyz[:, 0].max() < after.xyz[:, 0].min() + 1.0
