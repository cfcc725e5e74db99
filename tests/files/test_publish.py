"""Outputs appear whole or not at all."""

import errno
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from linework.errors import MachineError, OutputExistsError
from linework.files.output.publish import check_output, part_path, publish, publish_folder
from linework.files.output.record import hash_file, write_json


def writer(text):
    return lambda part: part.write_text(text)


def fine(part):
    assert part.exists()


def failing(error):
    def fail(part):
        part.write_text("half")
        part.with_name(part.name + "-journal").write_text("x")
        raise error

    return fail


def only(folder):
    return sorted(p.name for p in folder.iterdir())


def test_appears_with_its_content(tmp_path):
    publish(tmp_path / "new" / "a.txt", writer("whole"), fine)
    assert (tmp_path / "new" / "a.txt").read_text() == "whole"
    assert only(tmp_path / "new") == ["a.txt"]


def test_existing_output_is_not_touched(tmp_path):
    path = tmp_path / "a.txt"
    path.write_text("old")
    with pytest.raises(OutputExistsError) as caught:
        publish(path, failing(AssertionError("work was done")), fine)
    assert str(caught.value) == f"{path}: output exists already. Choose another name or give overwrite=True."
    assert caught.value.exit_code == 6
    assert path.read_text() == "old"


def test_overwrite_keeps_the_old_file_until_the_new_is_verified(tmp_path):
    path = tmp_path / "a.txt"
    path.write_text("old")

    def verify(part):
        assert path.read_text() == "old"
        raise MachineError("does not verify", where=part)

    with pytest.raises(MachineError) as caught:
        publish(path, writer("new"), verify, overwrite=True)
    assert str(caught.value).startswith(f"{path}: ")
    assert path.read_text() == "old"
    publish(path, writer("new"), fine, overwrite=True)
    assert path.read_text() == "new"
    assert only(tmp_path) == ["a.txt"]


@pytest.mark.parametrize(
    ("number", "words"),
    [
        (errno.ENOSPC, "No space left on device (errno 28). Free some space"),
        (errno.EDQUOT, "quota is used up"),
        (errno.EROFS, "read-only"),
        (errno.EACCES, "you may write to"),
        (errno.EIO, "check the disk"),
    ],
)
def test_the_machines_refusals_are_one_line(tmp_path, number, words):
    path = tmp_path / "a.txt"
    with pytest.raises(MachineError) as caught:
        publish(path, failing(OSError(number, os.strerror(number))), fine)
    assert caught.value.exit_code == 5
    assert str(caught.value).startswith(f"{path}: cannot be written: ")
    assert words in str(caught.value)
    assert only(tmp_path) == []


@pytest.mark.parametrize("error", [KeyboardInterrupt(), ValueError("bug"), SystemExit(1)])
def test_nothing_is_left_whatever_interrupts(tmp_path, error):
    with pytest.raises(type(error)):
        publish(tmp_path / "a.txt", failing(error), fine)
    assert only(tmp_path) == []


def test_parent_that_is_a_file(tmp_path):
    (tmp_path / "file").write_text("x")
    with pytest.raises(MachineError, match="is not a folder"):
        check_output(tmp_path / "file" / "a.txt")
    with pytest.raises(MachineError, match="Not a directory"):
        check_output(tmp_path / "file" / "deeper" / "a.txt")


def test_folder_that_cannot_be_written_to():
    # The tests may run as root, who may write everywhere but here
    with pytest.raises(MachineError, match="cannot be written"):
        check_output(Path("/proc/a.txt"))


def test_name_of_a_folder(tmp_path):
    with pytest.raises(OutputExistsError, match="is a folder"):
        check_output(tmp_path, overwrite=True)


def test_long_names(tmp_path):
    path = tmp_path / ("ä" * 125 + ".gpkg")
    publish(path, writer("x"), fine)
    assert path.read_text() == "x"
    with pytest.raises(MachineError, match="shorter name"):
        publish(tmp_path / ("a" * 300), writer("x"), fine)


def test_parts_of_dead_processes_are_removed_and_of_living_ones_kept(tmp_path):
    dead = subprocess.Popen([sys.executable, "-c", ""])
    dead.wait()
    for pid in (dead.pid, os.getppid()):
        (tmp_path / f".a.{pid}.part.txt").write_text("half")
    (tmp_path / f".a.{dead.pid}.part.txt-journal").write_text("half")
    (tmp_path / f".b.{dead.pid}.part.txt").write_text("of another output")
    publish(tmp_path / "a.txt", writer("x"), fine)
    assert only(tmp_path) == sorted([f".a.{os.getppid()}.part.txt", f".b.{dead.pid}.part.txt", "a.txt"])


def test_file_is_synced_before_it_is_renamed_and_its_folder_after(tmp_path, monkeypatch):
    calls = []
    sync, replace = os.fsync, type(tmp_path).replace
    monkeypatch.setattr(
        os, "fsync", lambda fd: (calls.append(str(Path(f"/proc/self/fd/{fd}").readlink())), sync(fd))[1]
    )
    monkeypatch.setattr(type(tmp_path), "replace", lambda a, b: (calls.append("rename"), replace(a, b))[1])
    publish(tmp_path / "a.txt", writer("x"), fine)
    assert calls == [str(part_path(tmp_path / "a.txt")), "rename", str(tmp_path)]


def test_failing_sync_publishes_nothing(tmp_path, monkeypatch):
    def fail(fd):
        raise OSError(errno.EIO, "Input/output error")

    monkeypatch.setattr(os, "fsync", fail)
    with pytest.raises(MachineError, match="Input/output error"):
        publish(tmp_path / "a.txt", writer("x"), fine)
    assert only(tmp_path) == []


def test_output_that_appears_meanwhile_is_kept(tmp_path):
    path = tmp_path / "a.txt"

    def write(part):
        part.write_text("ours")
        path.write_text("theirs")

    with pytest.raises(OutputExistsError, match="appeared"):
        publish(path, write, fine)
    assert path.read_text() == "theirs"


def folder_writer(part):
    (part / "deep").mkdir()
    (part / "a.txt").write_text("a")
    (part / "deep" / "b.txt").write_text("b")


def test_folder_appears_whole(tmp_path):
    publish_folder(tmp_path / "out", folder_writer, fine)
    assert only(tmp_path / "out") == ["a.txt", "deep"]
    assert only(tmp_path) == ["out"]


def test_folder_with_content_is_refused_and_with_overwrite_keeps_what_is_not_ours(tmp_path):
    out = tmp_path / "out"
    out.mkdir()
    (out / "mine.txt").write_text("mine")
    (out / "a.txt").write_text("old")
    with pytest.raises(OutputExistsError, match="not empty"):
        publish_folder(out, folder_writer, fine)
    publish_folder(out, folder_writer, fine, overwrite=True)
    assert (out / "mine.txt").read_text() == "mine"
    assert (out / "a.txt").read_text() == "a"
    assert only(tmp_path) == ["out"]


def test_folder_that_fails_leaves_nothing(tmp_path):
    def write(part):
        folder_writer(part)
        raise OSError(errno.ENOSPC, "No space left on device")

    with pytest.raises(MachineError, match="Free some space"):
        publish_folder(tmp_path / "out", write, fine)
    assert only(tmp_path) == []


def test_folder_named_like_a_file(tmp_path):
    (tmp_path / "out").write_text("x")
    with pytest.raises(OutputExistsError, match="is a file"):
        publish_folder(tmp_path / "out", folder_writer, fine, overwrite=True)


def test_json_and_hash(tmp_path):
    path = tmp_path / "run.json"
    write_json({"b": 1, "a": ["ä", 0.1]}, path)
    assert path.read_text(encoding="utf-8") == '{\n  "b": 1,\n  "a": [\n    "ä",\n    0.1\n  ]\n}\n'
    (tmp_path / "abc").write_bytes(b"abc")
    assert hash_file(tmp_path / "abc").startswith("ba7816bf8f01cfea")
    with pytest.raises(ValueError, match="JSON"):
        write_json({"a": float("nan")}, tmp_path / "nan.json")


def test_names_that_are_not_text_are_escaped_in_records(tmp_path):
    name = os.fsdecode(b"n\xff.laz")
    write_json({"file": name}, tmp_path / "run.json")
    assert json.loads((tmp_path / "run.json").read_text(encoding="utf-8")) == {"file": name}


def test_a_part_left_under_our_own_number_is_no_obstacle(tmp_path):
    """In a container every process may have the same number."""
    part_path(tmp_path / "a.txt").write_text("half")
    publish(tmp_path / "a.txt", writer("whole"), fine)
    part_path(tmp_path / "out").mkdir()
    (part_path(tmp_path / "out") / "half.txt").write_text("half")
    publish_folder(tmp_path / "out", folder_writer, fine)
    assert only(tmp_path) == ["a.txt", "out"]
    assert only(tmp_path / "out") == ["a.txt", "deep"]


def test_two_threads_do_not_write_one_part(tmp_path):
    path = tmp_path / "a.txt"

    def write(part):
        part.write_text("ours")
        with pytest.raises(OutputExistsError, match="by this program already"):
            publish(path, writer("theirs"), fine)

    publish(path, write, fine)
    assert path.read_text() == "ours"
