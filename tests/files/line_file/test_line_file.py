"""Lines on disk: every change is saved when `commit` returns, readable by others, and can be taken back."""

import sqlite3
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from pathlib import Path

import numpy as np
import pyogrio
import pytest
from tests.scenes.drawing_scenes import none, same, shifted, some_lines, whole

from linework.crs import parse_crs
from linework.errors import (
    CrsError,
    InputError,
    LineworkError,
    OutputExistsError,
    StaleError,
    UsageError,
)
from linework.files.line_file.file import LineFile
from linework.files.vectors.gpkg import read_own_gpkg
from linework.files.vectors.read_write import read_lines, write_lines
from linework.model.changes import Change
from linework.model.lines import LineSet


@pytest.fixture
def path(tmp_path: Path) -> Path:
    write_lines(some_lines(), tmp_path / "lines.gpkg")
    return tmp_path / "lines.gpkg"


def test_what_is_committed_is_read_back_by_all_readers(path):
    with LineFile.opened(path, crs="local") as drawing:
        assert same(drawing.lines, some_lines())
        one = drawing.lines.take([1])
        edit = drawing.commit(Change("move", one, shifted(one)), who="Ann")
        assert (edit.number, edit.who, drawing.revision) == (1, "Ann", 1)
        # While it is open, too
        assert same(read_lines(path), drawing.lines)
        held = drawing.lines
    assert same(read_own_gpkg(path), held)
    assert not same(held, some_lines())
    layers = [pyogrio.read_info(path, layer=str(kind))["features"] for kind in sorted(set(held.kind))]
    assert sum(layers) == 6
    whole(path)


def test_what_comes_again_under_its_key_is_saved_once(path):
    line = LineSet.from_lines([[[0, 0, 0], [5, 0, 1]]], kind=["cable"], review=["drawn"])
    change = Change("draw", none(), line)
    with LineFile.opened(path, crs="local") as drawing:
        first = drawing.commit(change, who="Ann", key="k1")
        assert drawing.saved_as("k2") is None and drawing.saved_as("") is None
    # Also when the file was closed in between, and something else was done
    with LineFile.opened(path, crs="local") as drawing:
        drawing.commit(change, who="Ann", key="k2")
        again = drawing.commit(change, who="Ann", based_on=0, key="k1")
        assert (again.number, again.change.after.id.tolist()) == (
            first.number,
            first.change.after.id.tolist(),
        )
        assert same(again.change.after, first.change.after)
        assert (drawing.revision, len(drawing.lines)) == (2, len(some_lines()) + 2)
    whole(path)


def test_a_missing_file_is_begun(tmp_path):
    crs = parse_crs("EPSG:25832", where="")
    with LineFile.opened(tmp_path / "new.gpkg", crs=crs) as drawing:
        assert len(drawing.lines) == 0
        line = LineSet.from_lines([[[0, 0, 0], [5, 0, 1]]], crs=crs, kind=["cable"], review=["drawn"])
        edit = drawing.commit(Change("draw", LineSet.empty(crs), line), who="")
        assert edit.change.after.id[0].startswith("cable-")
    assert read_lines(tmp_path / "new.gpkg").id.tolist() == edit.change.after.id.tolist()


def test_rejected_lines_stay_in_the_file_but_readers_do_not_see_them(path):
    with LineFile.opened(path, crs="local") as drawing:
        one = drawing.lines.take([0])
        drawing.commit(Change("reject", one, one.with_columns(review=["rejected"])), who="")
        assert len(drawing.lines) == 6
    assert one.id[0] not in read_lines(path).id
    assert len(read_lines(path)) == 5
    there = read_own_gpkg(path, rejected=True)
    assert there.kind[there.id == one.id[0]].tolist() == [one.kind[0]]
    assert pyogrio.read_info(path, layer="rejected")["features"] == 1
    # Others rename, move or remove lines: read by the way for foreign files, they are not there either
    with closing(sqlite3.connect(path)) as db:
        db.execute("DELETE FROM vertex WHERE rowid = 1")
        db.commit()
    assert len(read_lines(path)) == 5
    with LineFile.opened(path, crs="local") as drawing:
        drawing.undo(who="")
        drawing.undo(who="")
        assert same(drawing.lines, some_lines())
    assert len(read_lines(path)) == 6


def test_undo_and_redo_over_restarts(path):
    states = [some_lines()]
    for k in range(4):
        with LineFile.opened(path, crs="local") as drawing:
            one = drawing.lines.take([k % 3])
            drawing.commit(Change("move", one, shifted(one, 1.0 + k)), who=f"person {k}")
            states.append(drawing.lines)
    for back in (3, 2, 1, 0):
        with LineFile.opened(path, crs="local") as drawing:
            edit = drawing.undo(who="Bea")
            assert edit.undoes == back + 1
            assert same(drawing.lines, states[back])
            assert same(read_lines(path), states[back])
            assert (drawing.can_undo, drawing.can_redo) == (back > 0, True)
    with LineFile.opened(path, crs="local") as drawing:
        assert drawing.undo(who="") is None
        assert drawing.undone == {1, 2, 3, 4}
        for forth in (1, 2, 3):
            drawing.redo(who="")
            assert same(drawing.lines, states[forth])
        drawing.undo(who="")
        assert same(drawing.lines, states[2])
        one = drawing.lines.take([5])
        drawing.commit(Change("move", one, shifted(one)), who="")
        assert not drawing.can_redo
        assert drawing.redo(who="") is None
        history = drawing.history()
    assert [e.number for e in history] == list(range(13, 0, -1))
    assert [e.change.action for e in history[:6]] == ["move", "undo", "redo", "redo", "redo", "undo"]
    assert same(history[-1].change.before, some_lines().take([0]))
    assert history[-1].who == "person 0"
    whole(path)


def test_since_tells_what_came_and_what_went(path):
    with LineFile.opened(path, crs="local") as drawing:
        a, b = drawing.lines.take([0]), drawing.lines.take([1])
        drawing.commit(Change("move", a, shifted(a)), who="")
        drawing.commit(Change("delete", b, none()), who="")
    with LineFile.opened(path, crs="local") as drawing:
        came, went = drawing.since(0)
        assert (len(came), went) == (5, ())
        came, went = drawing.since(1)
        assert (came.id.tolist(), went) == ([], (b.id[0],))
        drawing.undo(who="")
        came, went = drawing.since(1)
        assert (came.id.tolist(), went) == ([b.id[0]], ())
        drawing.undo(who="")
        came, went = drawing.since(2)
        assert (set(came.id.tolist()), went) == ({a.id[0], b.id[0]}, ())
        assert len(drawing.since(4)[0]) == 0


def test_who_was_second_is_told_so_and_nothing_is_saved(path):
    with LineFile.opened(path, crs="local") as drawing:
        one = drawing.lines.take([2])
        moved = drawing.commit(Change("move", one, shifted(one)), who="Ann").change.after
        with pytest.raises(StaleError, match="has changed since"):
            drawing.commit(Change("move", moved, shifted(moved)), who="Bea", based_on=0)
        with pytest.raises(StaleError, match="has changed since"):
            drawing.commit(Change("move", one, shifted(one)), who="Bea")
        with pytest.raises(StaleError, match="2 edits are missing"):
            drawing.commit(Change("move", moved, shifted(moved)), who="Bea", based_on=3)
        drawing.commit(Change("delete", moved, none()), who="Ann", based_on=1)
        with pytest.raises(StaleError, match="no longer exists"):
            drawing.commit(Change("move", moved, shifted(moved)), who="Bea")
        assert drawing.revision == 2


@pytest.mark.parametrize(
    ("columns", "words"),
    [
        ({"note": ["x" * 10_000_000]}, "note of 10,000,000 characters, at most 1,000"),
        ({"role": ["x" * 400]}, "role of 400 characters"),
        ({"note": ["a\0b"]}, "cannot be stored"),
        ({"note": ["\ud800"]}, "cannot be stored"),
        ({"xyz": np.full((4, 3), np.nan)}, "not finite"),
        ({"xyz": np.zeros((4, 3))}, "no length"),
    ],
)
def test_lines_that_cannot_be_saved_are_refused(path, columns, words):
    with LineFile.opened(path, crs="local") as drawing:
        one = drawing.lines.take([0])
        with pytest.raises(UsageError, match=words):
            drawing.commit(Change("set", one, one.with_columns(**columns)), who="")
        with pytest.raises(UsageError, match="two lines have the id"):
            drawing.commit(Change("draw", none(), one), who="")
        assert (drawing.revision, len(drawing.lines)) == (0, 6)


def test_names_of_any_kind(path):
    said = {
        "note": ['it\'s "so"; DROP TABLE edit; \u2014 \u4e2d\u6587 \U0001f6a7\nsecond line'],
        "role": ["a'b"],
    }
    with LineFile.opened(path, crs="local") as drawing:
        one = drawing.lines.take([0])
        hostile = one.with_columns(**said, kind=['x"; DROP TABLE vertex; --'], id=["it's"])
        drawing.commit(Change("set", one, hostile), who='Bobby"; DROP TABLE edit; --')
        for kind in ("photolog", "rejected", "edit", "line_version", "gpkg_contents", "wall", "Mauer \u00e4"):
            drawing.commit(Change("draw", none(), shifted(one).with_columns(kind=[kind], id=[""])), who="")
        held = drawing.lines
    assert same(read_lines(path), held)
    with LineFile.opened(path, crs="local") as drawing:
        assert same(drawing.lines, held)
        assert drawing.history()[-1].who == 'Bobby"; DROP TABLE edit; --'
    whole(path)


def test_a_second_workbench_is_refused(path):
    with (
        LineFile.opened(path, crs="local"),
        pytest.raises(OutputExistsError, match="another workbench or run has it open"),
        LineFile.opened(path, crs="local"),
    ):
        pass


def not_ours(path: Path) -> None:
    path.unlink()
    pyogrio.raw.write(
        path,
        geometry=np.array([None], dtype=object),
        field_data=[np.array(["a"], dtype=object)],
        fields=["id"],
        geometry_type="LineString",
        crs="EPSG:25832",
        layer="roads",
    )


def cut(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:40_000])


def text(path: Path) -> None:
    path.write_text("hello")


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
@pytest.mark.parametrize("spoil", [not_ours, cut, text])
def test_files_that_cannot_be_edited_are_refused_in_one_line(path, spoil):
    spoil(path)
    before = path.read_bytes()
    with pytest.raises(InputError) as error, LineFile.opened(path, crs="local"):
        pass
    assert str(error.value).startswith(f"{path}: ")
    assert len(str(error.value).splitlines()) == 1
    assert path.read_bytes() == before


def test_other_formats_and_other_places_are_refused(path, tmp_path):
    with pytest.raises(UsageError, match="cannot edit"), LineFile.opened(tmp_path / "a.dxf", crs="local"):
        pass
    crs = parse_crs("EPSG:25832", where="")
    with pytest.raises(CrsError, match="survey is in"), LineFile.opened(path, crs=crs):
        pass
    history = tmp_path / "damaged.gpkg"
    history.write_bytes(path.read_bytes())
    with LineFile.opened(history, crs="local"):
        pass
    with closing(sqlite3.connect(history)) as db:
        db.execute("UPDATE line_version SET content = x'00'")
        db.commit()
    with pytest.raises(LineworkError, match="history is damaged"), LineFile.opened(history, crs="local"):
        pass


def test_a_file_that_is_replaced_while_it_is_open_takes_no_more_changes(path):
    with LineFile.opened(path, crs="local") as drawing:
        one = drawing.lines.take([0])
        copy = path.with_name("copy.gpkg")
        copy.write_bytes(path.read_bytes())
        copy.replace(path)
        with pytest.raises(OSError, match="removed or replaced"):
            drawing.commit(Change("move", one, shifted(one)), who="")
        path.unlink()
        with pytest.raises(OSError, match="removed or replaced"):
            drawing.undo(who="")


def test_threads_take_turns(path):
    with LineFile.opened(path, crs="local") as drawing, ThreadPoolExecutor(4) as threads:
        line = some_lines(1).with_columns(id=[""])
        edits = list(
            threads.map(lambda k: drawing.commit(Change("draw", none(), line), who=str(k)), range(20))
        )
        assert sorted(edit.number for edit in edits) == list(range(1, 21))
        assert len(set(drawing.lines.id.tolist())) == 26
    whole(path)


def test_any_edits_and_all_of_them_undone(path):
    rng = np.random.default_rng(11)
    with LineFile.opened(path, crs="local") as drawing:
        states = [drawing.lines]
        for _ in range(60):
            lines = drawing.lines
            chosen = rng.permutation(len(lines))[: rng.integers(0, 3)]
            before = lines.take(chosen)
            kind = str(rng.choice(["cable", "fence", "lane_marking", "lane_marking_dash"]))
            review = str(rng.choice(["accepted", "edited", "rejected", ""]))
            after = LineSet.concatenate(
                [shifted(before), some_lines(1).with_columns(id=[""])][rng.integers(0, 2) :]
            )
            after = after.with_columns(kind=[kind] * len(after), review=[review] * len(after))
            drawing.commit(Change("any", before, after), who="")
            states.append(drawing.lines)
    assert same(read_own_gpkg(path, rejected=True), states[-1])
    whole(path)
    with LineFile.opened(path, crs="local") as drawing:
        for state in reversed(states[:-1]):
            drawing.undo(who="")
            assert same(drawing.lines, state)
    assert same(read_own_gpkg(path, rejected=True), some_lines())
    whole(path)


def test_poles_stay_in_a_file_whose_lines_are_edited(tmp_path):
    """They are points of a layer of their own, which edits of lines do not touch and readers still read."""
    pole = LineSet.from_lines(
        [[[1.0, 2.0, 3.0], [1.0, 2.0, 11.5]]], kind=["pole"], height_m=[8.5], id=["pole-1"]
    )
    written = LineSet.concatenate([some_lines(), pole.with_columns(crs=some_lines().crs)])
    write_lines(written, tmp_path / "lines.gpkg")
    with LineFile.opened(tmp_path / "lines.gpkg", crs="local") as drawing:
        assert same(drawing.lines, some_lines())
        one = drawing.lines.take([1])
        drawing.commit(Change("move", one, shifted(one)), who="Ann")
    back = read_lines(tmp_path / "lines.gpkg")
    assert len(back) == len(written)
    assert np.array_equal(back["pole"].xyz, pole.xyz) and back["pole"].height_m.tolist() == [8.5]
