"""What a killed run leaves: journal, lines of tiles, folder; and what the next one makes of it."""

import json

import numpy as np
import pytest

from linework.errors import InputError, MachineError, OutputExistsError, UsageError
from linework.files.output.journal import Journal, JournalEntry
from linework.files.output.locks import hold_lock
from linework.files.output.parts import read_part, write_part
from linework.model.lines import LineSet
from linework.runs.opened import work_folder
from linework.runs.resume import (
    describe_run,
    fingerprint_of,
    is_result_of_run,
    run_folder,
)


def some_lines():
    xyz = np.array([[5e5, 5.4e6, 1.0], [5e5 + 1, 5.4e6, 1.5], [5e5 + 2, 5.4e6, 2.0]])
    return LineSet.from_lines(
        [xyz, xyz + 3], kind=["guardrail", "cable"], id=["a", "ü"], sigma_xy_m=np.arange(6.0)
    )


def test_a_part_comes_back_exactly_and_gives_the_same_bytes(tmp_path):
    one, two = (write_part(some_lines(), tmp_path / name) for name in ("a.arrays", "b.arrays"))
    assert one == two
    assert (tmp_path / "a.arrays").read_bytes() == (tmp_path / "b.arrays").read_bytes()
    back = read_part(LineSet, tmp_path / "a.arrays", one)
    for name in LineSet.__dataclass_fields__:
        np.testing.assert_array_equal(getattr(back, name), getattr(some_lines(), name))


def test_a_part_that_was_altered_or_is_gone_is_none(tmp_path):
    path = tmp_path / "a.arrays"
    sha256 = write_part(some_lines(), path)
    data = bytearray(path.read_bytes())
    data[200] ^= 1
    path.write_bytes(data)
    assert read_part(LineSet, path, sha256) is None
    path.unlink()
    assert read_part(LineSet, path, sha256) is None


def test_a_part_that_cannot_be_written_is_the_machines_fault(tmp_path):
    with pytest.raises(MachineError, match="cannot be written"):
        write_part(some_lines(), tmp_path / "missing" / "a.arrays")


def test_what_is_entered_stays(tmp_path):
    journal = Journal(tmp_path / "j.sqlite")
    journal.enter(JournalEntry("e0n0", "ab", {"n_lines": 3}))
    journal.enter(JournalEntry("e0n0", "cd", {"n_lines": 4}))
    journal.note_output("lines.gpkg", "ef")
    journal.close()
    again = Journal(tmp_path / "j.sqlite")
    assert again.done() == {"e0n0": JournalEntry("e0n0", "cd", {"n_lines": 4})}
    assert again.noted_output("lines.gpkg") == "ef"
    assert again.noted_output("other.gpkg") == ""
    again.close()


class Killed(Exception):
    """Stands for the end of a process in the middle of a run."""


def begin(tmp_path, described, *, resume, then=None):
    (tmp_path / "runs").mkdir(exist_ok=True)
    with run_folder(tmp_path, tmp_path / "lines.gpkg", described, resume=resume) as run:
        seen = run.is_resumed, sorted(run.journal.done())
        if then:
            then(run)
    return seen


def stop_after_one(run):
    run.journal.enter(JournalEntry("e0n0", "ab", {}))
    raise Killed


def test_a_run_goes_on_where_it_was_or_begins_anew(tmp_path):
    with pytest.raises(Killed):
        begin(tmp_path, {"a": 1}, resume=True, then=stop_after_one)
    assert begin(tmp_path, {"a": 1}, resume=True) == (True, ["e0n0"])
    assert begin(tmp_path, {"a": 1}, resume=True) == (False, []), "what is finished leaves nothing to resume"
    with pytest.raises(Killed):
        begin(tmp_path, {"a": 1}, resume=False, then=stop_after_one)
    assert begin(tmp_path, {"a": 1}, resume=False) == (False, [])


def test_other_parameters_are_refused_with_the_difference(tmp_path):
    with pytest.raises(Killed):
        begin(tmp_path, {"settings": {"cell_m": 0.2}, "b": 1}, resume=True, then=stop_after_one)
    with pytest.raises(UsageError, match=r"lines.gpkg: the run to resume was begun with settings.cell_m = 0.2, now it is"
                       r" 0.3. Give the same again, or run without resume=True"):  # fmt: skip
        begin(tmp_path, {"settings": {"cell_m": 0.3}, "b": 1}, resume=True)
    assert begin(tmp_path, {"settings": {"cell_m": 0.3}, "b": 1}, resume=False) == (False, [])


def test_a_damaged_journal_is_not_believed(tmp_path):
    with pytest.raises(Killed):
        begin(tmp_path, {"a": 1}, resume=True, then=stop_after_one)
    (journal,) = tmp_path.glob("runs/*/journal.sqlite")
    journal.write_bytes(b"nonsense" * 1000)
    assert begin(tmp_path, {"a": 1}, resume=True) == (True, [])


def test_two_processes_on_one_output_are_refused(tmp_path):
    def second(_):
        with pytest.raises(OutputExistsError, match="another run is using it"):
            begin(tmp_path, {"a": 1}, resume=True)

    begin(tmp_path, {"a": 1}, resume=True, then=second)


def test_an_output_is_known_by_what_was_noted_of_it(tmp_path):
    output = tmp_path / "lines.gpkg"
    output.write_bytes(b"lines")
    assert not is_result_of_run(tmp_path, output)

    def publish(run):
        from linework.files.output.record import hash_file

        run.journal.note_output("lines.gpkg", hash_file(output))
        raise Killed

    with pytest.raises(Killed):
        begin(tmp_path, {"a": 1}, resume=True, then=publish)
    assert is_result_of_run(tmp_path, output)
    output.write_bytes(b"edited")
    assert not is_result_of_run(tmp_path, output)


def test_a_run_is_described_by_inputs_parameters_and_program(tmp_path):
    one = describe_run({"a": 1}, {tmp_path / "x.laz": "12"})
    assert {"inputs", "a", "code", "versions"} <= set(one)
    assert fingerprint_of(one) == fingerprint_of(json.loads(json.dumps(one)))
    assert fingerprint_of(one) != fingerprint_of(describe_run({"a": 1}, {tmp_path / "x.laz": "13"}))


def test_clean_removes_ours_only(tmp_path):
    folder = work_folder.work_folder(tmp_path)
    assert folder == tmp_path / ".linework"
    (folder / "stores" / "x").mkdir()
    (folder / "stores" / "x" / "points").write_bytes(b"12345")
    (folder / "note.txt").write_text("mine")
    assert work_folder.existing_work_folders(tmp_path) == [folder]
    assert work_folder.clean_work_folder(folder) == 5
    assert [p.name for p in folder.iterdir()] == ["note.txt"]
    with pytest.raises(InputError, match="not a work folder"):
        work_folder.clean_work_folder(folder)


def test_clean_waits_for_nobody(tmp_path):
    folder = work_folder.work_folder(tmp_path)
    with (
        hold_lock(folder / "store-x.lock", shared=True, keep=True),
        pytest.raises(OutputExistsError, match="another run is using it"),
    ):
        work_folder.clean_work_folder(folder)
    work_folder.clean_work_folder(folder)
    assert not folder.exists()


def test_a_folder_that_cannot_be_written_is_replaced_by_the_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    (tmp_path / "survey").mkdir()
    (tmp_path / "survey" / ".linework").write_text("a file is in the way")
    folder = work_folder.work_folder(tmp_path / "survey")
    assert folder.parent == tmp_path / "cache" / "linework"
    with pytest.raises(MachineError, match="not a folder"):
        work_folder.work_folder(tmp_path, tmp_path / "survey" / ".linework")
