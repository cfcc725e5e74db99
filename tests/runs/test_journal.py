"""What a killed run leaves: journal, lines of tiles, folder; and what the next one makes of it."""

import json
import shutil

import numpy as np
import pytest

from linework.errors import InputError, MachineError, OutputExistsError, UsageError
from linework.files.output.journal import Journal, JournalEntry
from linework.files.output.locks import hold_lock
from linework.files.output.parts import read_part, write_part
from linework.model.lines import LineSet
from linework.runs.opened import work_folder
from linework.runs.opened.made import LIST, claim
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


@pytest.fixture
def work(tmp_path):
    """Return a work folder with a store of 5 bytes, an unfinished run of 3, and a store that was never finished."""
    folder = work_folder.work_folder(tmp_path)
    for name, file, content in (
        ("stores/x", "0.points", b"12345"),
        ("stores/.y.part", "0.points", b"12"),
        ("runs/r", "journal.sqlite", b"123"),
    ):
        claim(folder, name.replace(".y.part", "y"))
        (folder / name).mkdir()
        (folder / name / file).write_bytes(content)
    return folder


def test_clean_removes_what_linework_made_and_the_folder(work):
    assert work_folder.existing_work_folders(work.parent) == [work]
    assert work_folder.clean_work_folder(work) == work_folder.Cleaned(10, ())
    assert not work.exists()


def test_a_folder_of_the_user_stays(tmp_path):
    (tmp_path / "mine").mkdir()
    work_folder.clean_work_folder(work_folder.work_folder(tmp_path, tmp_path / "mine"))
    assert list((tmp_path / "mine").iterdir()) == []


def test_clean_leaves_what_others_put_there(work):
    others = [work / "note.txt", work / "stores" / "precious.npy", work / "runs" / "r" / "holiday.jpg"]
    others += [work / "runs" / "mine" / "result.json", work / "stores" / "abc-def.lock"]
    others += [
        work / "stores" / "x" / "lines.gpkg",
        work / "runs" / "r" / "notes.json",
        work / "stores" / "x" / "a.npy",
    ]
    for path in others:
        path.parent.mkdir(exist_ok=True)
        path.write_text("mine")
    cleaned = work_folder.clean_work_folder(work)
    assert cleaned.n_bytes == 10
    assert all(path.read_text() == "mine" for path in others)
    assert {work / "note.txt", work / "runs" / "r" / "holiday.jpg", work / "runs" / "mine"} <= set(
        cleaned.kept
    )
    # A second time there is nothing of linework, and nothing more goes
    again = work_folder.clean_work_folder(work)
    assert again.n_bytes == 0
    assert all(path.read_text() == "mine" for path in others)


def test_folders_of_others_are_not_cleaned_whatever_they_are_called(tmp_path):
    for name in ("stores", "runs"):
        (tmp_path / name / "x").mkdir(parents=True)
        (tmp_path / name / "x" / "0.points").write_text("mine")
    (tmp_path / "build.lock").touch()
    with pytest.raises(InputError, match="linework-made"):
        work_folder.clean_work_folder(tmp_path)
    # Used as a work folder, it holds things of both
    folder = work_folder.work_folder(tmp_path / "survey", tmp_path)
    claim(folder, "stores/y")
    (folder / "stores" / "y").mkdir()
    with pytest.raises(OutputExistsError, match="not made by linework"):
        claim(folder, "stores/x")
    work_folder.clean_work_folder(folder)
    assert not (folder / "stores" / "y").exists()
    assert [(tmp_path / name / "x" / "0.points").read_text() for name in ("stores", "runs")] == ["mine"] * 2
    assert (tmp_path / "build.lock").exists()


@pytest.mark.parametrize("name", ["linework-made.txt", "stores", "runs", ".", "stores/x"])
def test_nothing_is_written_through_a_link(tmp_path, name):
    """A survey that was unpacked from an archive may hold links to any place."""
    outside = tmp_path / "outside"
    outside.mkdir()
    (outside / "diary.txt").write_text("mine")
    beside = tmp_path / "survey" / ".linework"
    (beside if name != "." else beside.parent).mkdir(parents=True)
    (beside / name).parent.mkdir(parents=True, exist_ok=True)
    (beside if name == "." else beside / name).symlink_to(
        outside / "diary.txt" if name.endswith(".txt") else outside
    )
    with pytest.raises(OutputExistsError, match="is a link, and links are not followed"):
        claim(work_folder.work_folder(tmp_path / "survey"), "stores/x")
    assert [path.name for path in outside.iterdir()] == ["diary.txt"]
    assert (outside / "diary.txt").read_text() == "mine"


def test_links_are_not_followed(work, tmp_path):
    elsewhere = tmp_path / "elsewhere"
    for name in ("x", "r"):
        (elsewhere / name).mkdir(parents=True)
        (elsewhere / name / "0.points").write_text("mine")
    # In place of a store, in a run, and in place of the folder of runs
    shutil.rmtree(work / "stores" / "x")
    (work / "stores" / "x").symlink_to(elsewhere / "x")
    (work / "runs" / "r" / "more").symlink_to(elsewhere / "x")
    cleaned = work_folder.clean_work_folder(work)
    assert set(cleaned.kept) >= {work / "stores" / "x", work / "runs" / "r" / "more"}
    shutil.rmtree(work / "runs")
    (work / "runs").symlink_to(elsewhere)
    work_folder.clean_work_folder(work)
    with pytest.raises(OutputExistsError, match="is a link"):
        claim(work, "stores/x")
    # And as a whole
    work.rename(tmp_path / "moved")
    work.symlink_to(tmp_path / "moved")
    with pytest.raises(InputError, match="links are not followed"):
        work_folder.clean_work_folder(work)
    assert [(elsewhere / name / "0.points").read_text() for name in ("x", "r")] == ["mine"] * 2


def test_a_list_from_elsewhere_names_nothing_outside(work, tmp_path):
    (tmp_path / "precious").mkdir()
    (tmp_path / "precious" / "0.points").write_text("mine")
    with (work / LIST).open("a") as file:
        file.write(
            f"../precious\n{tmp_path}/precious\nstores/../../precious\nstores/x/../../../precious\n\xff\n"
        )
    work_folder.clean_work_folder(work)
    assert (tmp_path / "precious" / "0.points").read_text() == "mine"


def test_clean_waits_for_nobody(tmp_path):
    folder = work_folder.work_folder(tmp_path)
    claim(folder, "stores/x")
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
