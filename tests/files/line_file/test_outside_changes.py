"""What other programs do to a drawing's file, open or not, is taken over and lost nowhere."""

import sqlite3
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
import shapely
from tests.scenes.drawing_scenes import none, same, shifted, some_lines, whole

from linework.errors import OutputExistsError
from linework.files.line_file.file import CHANGED_OUTSIDE, LineFile
from linework.files.line_file.tables import connect_database, shape_of
from linework.files.vectors.gpkg_schema import geometry_blobs
from linework.files.vectors.read_write import read_lines, write_lines
from linework.model.changes import Change


@pytest.fixture
def path(tmp_path: Path) -> Path:
    write_lines(some_lines(), tmp_path / "lines.gpkg")
    return tmp_path / "lines.gpkg"


def elsewhere(path: Path, *statements: tuple[str, tuple]) -> None:
    """Do what QGIS does: write to the layers, knowing nothing of the other tables."""
    with closing(connect_database(path)) as db:
        for statement, values in statements:
            db.execute(statement, values)


def vertex_moved(path: Path, layer: str, fid: int) -> tuple[str, tuple]:
    with closing(sqlite3.connect(path)) as db:
        (blob,) = db.execute(f'SELECT geom FROM "{layer}" WHERE fid = ?', (fid,)).fetchone()
    xyz = shapely.get_coordinates(shape_of(blob), include_z=True)
    xyz[1] += [0.25, 0.5, 0.0]
    return (
        f'UPDATE "{layer}" SET geom = ? WHERE fid = ?',
        (geometry_blobs(np.array([shapely.LineString(xyz)]), -1)[0], fid),
    )


def drawn(layer: str, xyz: list, **fields: object) -> tuple[str, tuple]:
    blob = geometry_blobs(np.array([shapely.LineString(xyz)]), -1)[0]
    names = "".join(f', "{name}"' for name in fields)
    return (
        f'INSERT INTO "{layer}" (geom{names}) VALUES (?{", ?" * len(fields)})',
        (blob, *fields.values()),
    )


@pytest.mark.parametrize("is_open", [False, True])
def test_changes_of_others_become_one_edit_that_can_be_taken_back(path, is_open):
    first = some_lines()
    changes = [
        vertex_moved(path, "guardrail", 1),
        ("DELETE FROM cable WHERE fid = 1", ()),
        ("UPDATE road_boundary SET note = 'cracked' WHERE fid = 2", ()),
        drawn("fence", [[0, 0, 1], [9, 0, 1]]),
    ]
    with LineFile.opened(path, crs="local") as drawing:
        line = shifted(first.take([0])).with_columns(kind=["fence"], id=[""])
        fence = drawing.commit(Change("draw", none(), line), who="Ann").change.after
        if is_open:
            elsewhere(path, *changes)
            assert drawing.commit(Change("delete", fence, none()), who="Ann").number == 3
    if not is_open:
        elsewhere(path, *changes)
    with LineFile.opened(path, crs="local") as drawing:
        edit = drawing.history()[is_open]
        assert (edit.number, edit.who, edit.change.action) == (2, "", CHANGED_OUTSIDE)
        before, after = edit.change.before, edit.change.after
        assert sorted(before.kind.tolist()) == ["cable", "guardrail", "road_boundary"]
        assert sorted(after.kind.tolist()) == ["fence", "guardrail", "road_boundary"]
        assert set(after.review.tolist()) == {"edited", "drawn"}
        rail, was = after["guardrail"], first["guardrail"]
        assert np.isnan(rail.sigma_xy_m).tolist() == [k == 1 for k in range(len(rail.xyz))]
        assert np.array_equal(rail.sigma_xy_m[2:], was.sigma_xy_m[2:])
        assert np.allclose(rail.xyz[1] - was.xyz[1], [0.25, 0.5, 0.0])
        edge = after["road_boundary"]
        assert (edge.note[0], np.isnan(edge.sigma_xy_m).any()) == ("cracked", False)
        assert same(read_lines(path), drawing.lines)
        for _ in range(3 if is_open else 2):
            drawing.undo(who="")
        assert same(drawing.lines, first)
    whole(path)


def test_a_line_that_was_split_or_copied_elsewhere_gets_a_name_of_its_own(path):
    first = some_lines()
    with LineFile.opened(path, crs="local"):
        pass
    name = str(first["guardrail"].id[0])
    elsewhere(path, drawn("guardrail", [[0, 0, 0], [4, 0, 0]], id=name, kind="guardrail"))
    with LineFile.opened(path, crs="local") as drawing:
        lines = drawing.lines
    assert len(set(lines.id.tolist())) == len(lines) == 7
    assert same(lines.take(np.isin(lines.id, first.id)), first)


def test_what_was_changed_before_the_first_opening_is_as_it_stands(path):
    """Without a history nobody knows what was there: lines are taken in, with the sigmas of those that still fit."""
    first = some_lines()
    elsewhere(
        path,
        vertex_moved(path, "guardrail", 1),
        ("DELETE FROM cable WHERE fid = 1", ()),
        ("UPDATE road_boundary SET id = NULL WHERE fid = 1", ()),
        drawn("lane_marking", [[0, 0, 1], [9, 0, 1], [9, 9, 1]], kind=None),
        drawn("lane_marking", [[5, 5, 5], [5, 5, 5]]),
        ("INSERT INTO lane_marking (id) VALUES ('no place')", ()),
    )
    with LineFile.opened(path, crs="local") as drawing:
        lines = drawing.lines
        assert (drawing.revision, drawing.can_undo) == (0, False)
    assert same(read_lines(path), lines)
    assert len(lines) == 6
    assert len(set(lines.id.tolist()) - {""}) == 6
    assert np.array_equal(lines["guardrail"].sigma_xy_m, first["guardrail"].sigma_xy_m)
    edge = first["road_boundary"]
    assert np.isin(edge.sigma_xy_m, lines["road_boundary"].sigma_xy_m).all()
    whole(path)


def test_heights_that_were_not_drawn_are_those_of_the_next_vertex(path):
    with LineFile.opened(path, crs="local"):
        pass
    place = some_lines().xyz[0]
    nan = float("nan")
    elsewhere(path, drawn("cable", [[place[0] + 0.1, place[1], nan], [place[0], place[1] + 0.1, nan]]))
    with LineFile.opened(path, crs="local") as drawing:
        new = drawing.lines.take(drawing.lines.review == "drawn")
    assert new.xyz[:, 2].tolist() == [place[2]] * 2
    assert np.isnan(new.sigma_z_m).all()


def test_while_another_program_writes_nothing_is_saved_and_nothing_lost(path, monkeypatch):
    monkeypatch.setattr("linework.files.line_file.tables.WAIT_S", 0.05)
    with LineFile.opened(path, crs="local") as drawing:
        one = drawing.lines.take([0])
        with closing(sqlite3.connect(path, isolation_level=None)) as other:
            other.execute("BEGIN IMMEDIATE")
            with pytest.raises(OutputExistsError, match="another program is writing it"):
                drawing.commit(Change("move", one, shifted(one)), who="")
            other.execute("ROLLBACK")
        assert drawing.commit(Change("move", one, shifted(one)), who="").number == 1


def test_a_program_that_keeps_its_own_log_of_writes_does_not_disturb(path):
    """QGIS holds files in the mode WAL while it edits."""
    with closing(sqlite3.connect(path, isolation_level=None)) as other:
        other.execute("PRAGMA journal_mode = WAL")
        other.execute("SELECT count(*) FROM cable").fetchone()
        with LineFile.opened(path, crs="local") as drawing:
            one = drawing.lines.take([0])
            drawing.commit(Change("move", one, shifted(one)), who="")
            held = drawing.lines
    assert same(read_lines(path), held)
    with LineFile.opened(path, crs="local") as drawing:
        assert same(drawing.lines, held)
    whole(path)


def test_layers_and_tables_of_others_are_left_alone(path):
    with closing(sqlite3.connect(path)) as db:
        db.execute("CREATE TABLE mine (fid INTEGER PRIMARY KEY, geom LINESTRING, name TEXT)")
        db.execute("INSERT INTO mine VALUES (1, NULL, 'stays')")
        db.execute(
            "INSERT INTO gpkg_contents (table_name, data_type, identifier) VALUES ('mine', 'features', 'm')"
        )
        db.execute("INSERT INTO gpkg_geometry_columns VALUES ('mine', 'geom', 'LINESTRING', -1, 1, 0)")
        db.commit()
    with LineFile.opened(path, crs="local") as drawing:
        assert len(drawing.lines) == 6
    with closing(sqlite3.connect(path)) as db:
        assert db.execute("SELECT * FROM mine").fetchall() == [(1, None, "stays")]
