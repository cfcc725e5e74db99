"""What the maker of a GeoPackage put into it is not executed: views, triggers, virtual tables, computed columns."""

import sqlite3
from contextlib import closing
from pathlib import Path

import numpy as np
import pyogrio
import pytest
import shapely
from tests.scenes.drawing_scenes import none, shifted, some_lines

from linework.crs import parse_crs
from linework.errors import InputError
from linework.files.line_file.file import LineFile
from linework.files.vectors.gpkg_guard import ForeignSchemaError, check_geopackage, check_schema
from linework.files.vectors.read_write import read_lines, write_lines
from linework.model.changes import Change

#: A view that never ends, listed as a layer of lines.
ENDLESS = """CREATE VIEW road AS WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n)
  SELECT i AS fid, NULL AS geom FROM n WHERE i < 0;
INSERT INTO gpkg_contents (table_name, data_type, srs_id) VALUES ('road', 'features', -1);
INSERT INTO gpkg_geometry_columns VALUES ('road', 'geom', 'LINESTRING', -1, 1, 0)"""
#: Each view has ten times the columns of the one before.
WIDE = ";".join(
    ["CREATE VIEW v0 AS SELECT 1 AS a", *(f"CREATE VIEW v{i} AS SELECT {', '.join(f'a{k}.*' for k in range(10))} FROM "
     + ", ".join(f"v{i - 1} AS a{k}" for k in range(10)) for i in range(1, 8))]
)  # fmt: skip
COMPUTED = """ALTER TABLE guardrail ADD COLUMN big TEXT AS (hex(zeroblob(900000000))) VIRTUAL"""
TEXTS = "CREATE VIRTUAL TABLE words USING fts5(text)"
RUN_ON_READING = {"view": ENDLESS, "wide": WIDE, "computed": COMPUTED, "module": TEXTS}
#: Triggers that ruin the file behind an edit, under names of the standard's.
RUN_ON_EDITING = {
    "empties": "CREATE TRIGGER x AFTER INSERT ON vertex BEGIN DELETE FROM cable; END",
    "named as the standard's": 'CREATE TRIGGER "rtree_cable_geom_update7" AFTER DELETE ON guardrail WHEN OLD.geom NOT NULL'
    " BEGIN DELETE FROM cable; END",
    "after a right one": """CREATE TRIGGER rtree_x AFTER DELETE ON guardrail BEGIN DELETE FROM rtree_cable_geom WHERE id = OLD.fid;
      DELETE FROM cable WHERE 1; END""",
    "drops the edit": "CREATE TRIGGER x BEFORE INSERT ON guardrail BEGIN SELECT RAISE(IGNORE); END",
    "in comments": "CREATE /* ON gpkg_x */ TRIGGER x AFTER INSERT ON /**/ vertex BEGIN DELETE FROM cable; END",
    "on the list": "CREATE TRIGGER x AFTER UPDATE ON gpkg_contents BEGIN DELETE FROM cable; END",
    "recursive": """CREATE TRIGGER x AFTER INSERT ON vertex BEGIN INSERT INTO vertex (line) WITH RECURSIVE n(i) AS
      (SELECT 1 UNION ALL SELECT i + 1 FROM n) SELECT i FROM n; END""",
}


@pytest.fixture
def path(tmp_path: Path) -> Path:
    write_lines(some_lines(), tmp_path / "lines.gpkg")
    return tmp_path / "lines.gpkg"


def add(path: Path, script: str) -> None:
    with closing(sqlite3.connect(path)) as db:
        db.executescript(script)


@pytest.mark.parametrize("script", RUN_ON_READING.values(), ids=RUN_ON_READING)
def test_what_runs_when_it_is_read_is_refused_by_every_reader(linework, path, tmp_path, script):
    add(path, script)
    with pytest.raises(ForeignSchemaError, match="holds a"):
        read_lines(path)
    with pytest.raises(ForeignSchemaError), LineFile.opened(path, crs="local"):
        pass
    sound = tmp_path / "sound.gpkg"
    write_lines(some_lines(), sound)
    for arguments in (
        ("convert", path, tmp_path / "out.geojson"),
        ("evaluate", path, sound),
        ("evaluate", sound, path),
    ):
        found = linework(*arguments)
        assert found.code == 3
        assert found.line.startswith(f"error: {path}: holds a")
        assert found.line.endswith("Save Features As).")


def test_what_runs_when_it_is_read_is_refused_by_extract_and_serve(linework, las_file, path):
    add(path, ENDLESS)
    before = path.read_bytes()
    for arguments in (
        ("extract", las_file, "-o", path, "--overwrite"),
        ("serve", las_file, "--lines", path, "--no-browser"),
    ):
        found = linework(*arguments, "--quiet")
        assert (found.code, "holds a view, road," in found.line) == (3, True), (arguments[0], found.stderr)
        assert path.read_bytes() == before


@pytest.mark.parametrize("script", RUN_ON_EDITING.values(), ids=RUN_ON_EDITING)
def test_a_trigger_of_others_is_not_run_by_an_edit(linework, path, tmp_path, script):
    add(path, script)
    lines = read_lines(path)
    with pytest.raises(ForeignSchemaError, match="a trigger"), LineFile.opened(path, crs="local"):
        pass
    assert read_lines(path) == lines
    assert linework("convert", path, tmp_path / "new.gpkg").code == 0
    with LineFile.opened(tmp_path / "new.gpkg", crs="local") as line_file:
        assert len(line_file.lines) == len(lines)


def test_a_trigger_that_comes_while_the_file_is_open_is_not_run(path):
    with LineFile.opened(path, crs="local") as line_file:
        line = line_file.lines.take([0])
        line_file.commit(Change("move", line, shifted(line)), who="Ann")
        add(path, RUN_ON_EDITING["empties"])
        for _ in range(2):
            with pytest.raises(ForeignSchemaError):
                line_file.commit(Change("delete", line_file.lines.take([1]), none()), who="Ann")
        with closing(sqlite3.connect(path)) as db:
            assert db.execute("SELECT count(*) FROM cable").fetchone()[0] > 0
            db.execute("DROP TRIGGER x")
        line_file.commit(Change("delete", line_file.lines.take([1]), none()), who="Ann")


def test_files_of_gdal_with_its_triggers_are_read_and_may_be_edited(tmp_path):
    """GDAL's triggers for the index in each of its forms, for its counts, and those of the standard for images."""
    path = tmp_path / "lines.gpkg"
    write_lines(some_lines().with_columns(crs=parse_crs("EPSG:25832")), path)
    shapes = shapely.to_wkb(shapely.linestrings([[[0, 0, 1], [9, 9, 1]], [[1, 1, 0], [5, 5, 0]]]))
    for layer in ("kerbs", "two words", 'a "quoted" one'):
        pyogrio.raw.write(
            path, shapes, [np.array(["x", None], dtype=object)], ["mark"], layer=layer, driver="GPKG",
            geometry_type="LineString Z", crs="EPSG:25832", append=True,
        )  # fmt: skip
    with closing(sqlite3.connect(path)) as db:
        triggers = db.execute("SELECT count(*) FROM sqlite_master WHERE type = 'trigger'").fetchone()[0]
        assert triggers > 30
        check_schema(db, path, to_edit=True)
    check_geopackage(path)
    assert {"kerbs", "two words", 'a "quoted" one'} <= set(read_lines(path).kind.tolist())
    crs = parse_crs("EPSG:25832")
    with LineFile.opened(path, crs=crs) as line_file:
        line = line_file.lines.take([0])
        line_file.commit(Change("move", line, shifted(line)), who="Ann")
    # As QGIS before 2024 has them: other forms of spacing and quoting
    add(path, """CREATE TRIGGER "rtree_old_geom_update1" AFTER UPDATE OF `geom` ON "kerbs"
  WHEN OLD.[fid] = NEW."fid" AND
       (NEW.geom NOTNULL AND NOT ST_IsEmpty(NEW."geom"))
BEGIN
  insert or replace into "rtree_kerbs_geom" VALUES (NEW.fid, ST_MinX(NEW.geom), ST_MaxX(NEW.geom),
    ST_MinY(NEW.geom), ST_MaxY(NEW.geom));
END;""")  # fmt: skip
    with LineFile.opened(path, crs=crs):
        pass


def test_a_file_with_a_hundred_thousand_tables_is_refused_soon(tmp_path):
    path = tmp_path / "many.gpkg"
    with closing(sqlite3.connect(path)) as db:
        db.execute("CREATE TABLE t (a)")
        db.execute("PRAGMA writable_schema = ON")
        rows = ((f"t{i}", f"t{i}", f"CREATE TABLE t{i} (a)") for i in range(100_000))
        db.executemany("INSERT INTO sqlite_master VALUES ('table', ?, ?, 2, ?)", rows)
        db.commit()
    with pytest.raises(ForeignSchemaError, match="more than 10,000"):
        read_lines(path)


@pytest.mark.parametrize("sql", ["CREATE", "CREATE TEMP VIEW v AS SELECT 1", "create/**/view v as select 1"])
def test_a_list_of_tables_that_was_written_by_hand(path, sql):
    with closing(sqlite3.connect(path)) as db:
        db.execute("PRAGMA writable_schema = ON")
        db.execute("INSERT INTO sqlite_master VALUES ('table', 'v', 'v', 0, ?)", (sql,))
        db.commit()
    with pytest.raises(InputError):
        read_lines(path)


def test_a_log_of_writes_beside_a_file_of_others_stays_a_file(path):
    """A journal of rubbish is neither applied nor waited for."""
    path.with_name("lines.gpkg-journal").write_bytes(
        b"\xd9\xd5\x05\xf9\x20\xa1\x63\xd7" + bytes(range(256)) * 8
    )
    before = path.read_bytes()
    try:
        assert read_lines(path) == some_lines()
    except InputError as error:
        assert str(path) in str(error)
    assert path.read_bytes() == before
