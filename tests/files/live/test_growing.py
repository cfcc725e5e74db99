"""Files that grow: each line once, whole; and what is appended is there, or not at all."""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
import pytest

from linework.errors import InputError
from linework.files.live.events import EventsFile, Press
from linework.files.live.growing import GrowingFile, GrowingTable
from linework.files.live.journal import LiveJournal
from linework.files.live.logs import GrowingLogs, SurveyClock
from linework.files.logs.keys import read_events
from linework.files.output.appended import AppendedFile
from linework.files.survey.open import open_survey


def append(path, text):
    with path.open("a", newline="") as file:
        file.write(text)


def test_half_lines_wait_for_their_end(tmp_path):
    path = tmp_path / "a.csv"
    file = GrowingFile(path)
    assert file.lines() == []
    append(path, "one\r\ntw")
    assert file.lines() == ["one"]
    append(path, "o\nthree")
    assert file.lines() == ["two"]
    append(path, "\n")
    assert file.lines() == ["three"]
    assert file.lines() == []


def test_a_file_that_is_replaced_is_read_from_its_start(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("time_s,x\n1,2\n3,4\n")
    table = GrowingTable(path, ("time_s", "x"))
    assert table.numbers()[0]["x"].tolist() == [2.0, 4.0]
    path.write_text("x,time_s\n9,8\n")
    assert table.numbers()[0]["x"].tolist() == [9.0]


def test_rows_by_any_pieces_are_those_of_the_whole_file(tmp_path):
    rng = np.random.default_rng(1)
    text = "\ufefftime_s;x\n" + "".join(f"{i},5;{i * i}\n" for i in range(200)) + "bad\n1;nan\n7,5;3\n"
    whole = tmp_path / "whole.csv"
    whole.write_text(text, encoding="utf-8")
    expected = GrowingTable(whole, ("time_s", "x")).numbers()
    grown = tmp_path / "grown.csv"
    table, found, n_bad = GrowingTable(grown, ("time_s", "x")), [], 0
    data = text.encode()
    cuts = [0, *np.sort(rng.integers(0, len(data), 40)).tolist(), len(data)]
    for a, b in itertools.pairwise(cuts):
        with grown.open("ab") as file:
            file.write(data[a:b])
        columns, bad = table.numbers()
        found += columns["x"].tolist() if columns else []
        n_bad += bad
    assert found == expected[0]["x"].tolist()
    assert n_bad == expected[1] == 2


def test_the_last_part_of_a_long_log(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("time_s,x\n" + "".join(f"{i},{i}\n" for i in range(1000)))
    table = GrowingTable(path, ("time_s", "x"))
    table.skip_to_last(100)
    x = table.numbers()[0]["x"]
    assert x[-1] == 999
    assert 5 < len(x) < 15
    assert np.all(np.diff(x) == 1)


def test_missing_columns_are_named(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("time_s,y\n1,2\n")
    with pytest.raises(InputError, match="missing column x"):
        GrowingTable(path, ("time_s", "x")).rows()


def test_half_a_line_left_by_a_cut_of_the_power_is_removed(tmp_path):
    path = tmp_path / "a.txt"
    path.write_text("one\ntwo\nthr")
    file = AppendedFile(path)
    assert file.lines() == ["one", "two"]
    file.append("four\n")
    assert path.read_text() == "one\ntwo\nfour\n"


def test_a_journal_is_read_back_without_its_damaged_lines(tmp_path):
    journal = LiveJournal(tmp_path / "live.jsonl")
    journal.note({"pair": 1})
    assert list(LiveJournal(tmp_path / "live.jsonl").records()) == []
    assert journal.save() == 1
    append(tmp_path / "live.jsonl", '{"pair": 2\n[1]\n{"pair": 3}\n{"pa')
    assert list(LiveJournal(tmp_path / "live.jsonl").records()) == [{"pair": 1}, {"pair": 3}]


def test_presses_are_a_log_of_keys(tmp_path):
    path = tmp_path / "events.csv"
    file = EventsFile(path)
    file.add(Press(2.5, 'sign, "old"', "", "press-1"))
    file.add(Press(1.0, "cracks", "begin", "press-2", "wide, long"))
    again = EventsFile(path)
    assert again.presses == file.presses
    assert list(again.open_spans()) == ["cracks"]
    rows = read_events(path)
    assert rows.key == ("cracks", 'sign, "old"')
    assert rows.span == ("begin", "")
    assert rows.note == ("wide, long", "")
    again.remove("press-2")
    assert EventsFile(path).presses == file.presses[:1]


def test_a_log_of_keys_of_others_is_not_continued(tmp_path):
    (tmp_path / "events.csv").write_text("time_s,key,note\n1.0,tree,\n")
    with pytest.raises(InputError, match="not written by linework live"):
        EventsFile(tmp_path / "events.csv")


def test_the_clock_is_that_of_the_reading_that_came_with_the_least_delay():
    clock = SurveyClock()
    assert clock.time_s(5.0) is None
    for now, delay in ((100.0, 0.9), (101.0, 0.05), (102.0, 0.5), (103.0, 2.0)):
        clock.arrived(now + 7000.0 - delay, now)
    assert clock.time_s(104.0) == pytest.approx(7104.0 - 0.05)
    clock.arrived(7200.0 - 0.3, 200.0)
    assert clock.time_s(200.0) == pytest.approx(7200.0 - 0.3)


@pytest.mark.parametrize(("axle", "wheelbase_m"), [("front", 3.2), ("rear", 0.0)])
def test_the_counted_wheels_are_those_of_the_survey(tmp_path: Path, axle: str, wheelbase_m: float) -> None:
    (tmp_path / "survey.toml").write_text(
        'name = "van"\ncrs = "EPSG:25832+7837"\n[navigation]\ngnss = "gnss.csv"\nwheels = "wheels.csv"\n'
        f'[vehicle]\naxle = "{axle}"\nwheelbase_m = 3.2\n'
    )
    assert GrowingLogs(open_survey([tmp_path])).vehicle.wheelbase_m == wheelbase_m
