"""Published lines come back exactly; a re-run changes its own lines only, and failures leave what was there."""

import os
import pwd
import subprocess
import threading
from dataclasses import fields

import numpy as np
import psycopg
import pytest
from tests.files.postgis.server import running_server
from tests.files.vectors.test_vectors import sample
from tests.scenes.map_scenes import road_lines

from linework.errors import CrsError, InputError, LineworkError, MachineError, UsageError
from linework.files.postgis.address import database_address
from linework.files.postgis.tables import ewkb_of_line, line_of_ewkb
from linework.files.postgis.write import Published, publish_lines
from linework.files.vectors.read_write import read_lines, write_lines
from linework.lines.along import PaintStretch
from linework.lines.names import with_ids
from linework.model.lines import LineSet


@pytest.fixture(scope="module")
def server():
    with running_server() as found:
        yield found


@pytest.fixture
def address(server, request):
    """Return the address of a schema of the test's own."""
    name = "t" + str(abs(hash(request.node.name)) % 10**9)
    yield database_address(server.url(), schema=name)
    server.run(f"DROP SCHEMA IF EXISTS {name} CASCADE")


def back(address, **query):
    text = "&".join(f"{k}={v}" for k, v in {"schema": address.schema, **query}.items())
    return read_lines(f"{address.url}?{text}")


def assert_same(a, b):
    for f in fields(LineSet):
        x, y = getattr(a, f.name), getattr(b, f.name)
        assert np.array_equal(x, y, equal_nan=x.dtype.kind == "f") if isinstance(x, np.ndarray) else x == y, (
            f.name
        )


@pytest.mark.parametrize("crs", ["EPSG:25832+7837", "EPSG:25832", "local"])
def test_lines_come_back_exactly(address, crs):
    lines = with_ids(sample(crs), ())
    assert publish_lines(lines, address, "drive 1") == Published(5, 0, 0, 0)
    assert_same(back(address), lines)
    assert_same(back(address, layer="cable"), lines["cable"])


def test_the_database_has_measures_srids_views_and_indices(server, address):
    lines = road_lines()
    publish_lines(lines, address, "drive")
    at = address.schema
    rows = server.run(f"SELECT id, ST_SRID(geom), ST_M(ST_EndPoint(geom)), ST_Length(ST_Force2D(geom)), "
                      f"ST_Z(ST_StartPoint(geom)), length_m FROM {at}.line ORDER BY number")  # fmt: skip
    assert [row[0] for row in rows] == lines.id.tolist()
    assert {row[1] for row in rows} == {25832}
    for i, row in enumerate(rows):
        assert row[2] == pytest.approx(row[3], abs=1e-6) and row[4] == lines[i].xyz[0, 2]
    assert server.run(f"SELECT count(*) FROM {at}.guardrail") == [(1,)]
    assert "COMPOUNDCRS" in server.run(f"SELECT crs_wkt FROM {at}.survey")[0][0]
    # PostGIS finds places by chainage, and by their box with the index
    (text,) = server.run(f"SELECT ST_AsText(ST_LocateAlong(geom, 10.0)) FROM {at}.line WHERE id = 'rail'")[0]
    assert text.startswith("MULTIPOINT ZM")
    assert server.run(
        f"SELECT count(*) FROM pg_indexes WHERE schemaname = '{at}' AND indexdef LIKE '%gist%'"
    ) == [(1,)]
    assert server.run(f"SELECT survey, written, kept FROM {at}.run") == [("drive", 9, 0)]


def test_measures_of_lines_in_feet_are_metres(server, address):
    xyz = np.array([[980_000.0, 200_000.0, 30.0], [980_100.0, 200_000.0, 30.0]])
    publish_lines(
        LineSet.from_lines([xyz], crs="EPSG:2263+6360", kind="guardrail", id="rail"), address, "drive"
    )
    query = (
        f"SELECT ST_SRID(geom), ST_M(ST_EndPoint(geom)), length_m, ST_Length(geom) FROM {address.schema}.line"
    )
    ((srid, measure, length_m, in_feet),) = server.run(query)
    assert (srid, in_feet) == (2263, 100.0) and measure == length_m == pytest.approx(100 * 1200 / 3937)
    np.testing.assert_array_equal(back(address).xyz, xyz)


def test_a_rerun_changes_its_own_lines_only(server, address):
    lines = road_lines()
    publish_lines(lines, address, "a")
    publish_lines(lines, address, "b")
    before = server.run(f"SELECT id, xmin FROM {address.schema}.line WHERE survey = 'b' ORDER BY id")
    assert publish_lines(lines, address, "a") == Published(0, 9, 0, 0)
    moved = lines.with_columns(xyz=lines.xyz + (lines.id[lines.line_of_vertex] == "rail")[:, None] * 0.01)
    assert publish_lines(moved.take(lines.id != "wall"), address, "a") == Published(3, 5, 1, 0)
    assert_same(back(address, survey="a"), moved.take(lines.id != "wall"))
    assert server.run(f"SELECT id, xmin FROM {address.schema}.line WHERE survey = 'b' ORDER BY id") == before
    with pytest.raises(UsageError, match="2 surveys: a, b"):
        back(address)


def test_reviewed_lines_stay(server, address):
    lines = road_lines()
    publish_lines(lines, address, "a")
    at = address.schema
    server.run(f"UPDATE {at}.line SET review = 'accepted', note = 'seen' WHERE id = 'rail'")
    server.run(f"UPDATE {at}.line SET review = 'rejected' WHERE id = 'wall'")
    other = lines.with_columns(xyz=lines.xyz + np.array([0, 0, 0.01]), id=np.char.add("new ", lines.id))
    done = publish_lines(other, address, "a")
    assert (done.written, done.removed, done.kept) == (7, 7, 2)
    found = back(address)
    rail = found["guardrail"]
    assert rail.id.tolist() == ["rail"] and rail.note.tolist() == ["seen"]
    np.testing.assert_array_equal(rail.xyz, lines["guardrail"].xyz)
    assert "barrier" not in found.kinds and len(found) == 8
    assert server.run(f"SELECT id FROM {at}.line WHERE kind = 'barrier'") == [("wall",)]
    # A decision in the file is newer than the one in the database
    judged = lines.with_columns(
        review=np.where(lines.id == "rail", "edited", ""), xyz=lines.xyz + np.array([0, 0, 0.02])
    )
    publish_lines(judged, address, "a")
    assert back(address)["guardrail"].review.tolist() == ["edited"]


def test_a_writer_needs_no_more_than_the_tables(server, address):
    publish_lines(road_lines(), address, "a")
    at = address.schema
    server.run(f"DROP ROLE IF EXISTS w_{at}")
    server.run(f"CREATE ROLE w_{at} LOGIN")
    own = database_address(server.url(user=f"w_{at}"), schema=at)
    with pytest.raises(MachineError, match="no permission"):
        publish_lines(road_lines(), own, "a")
    server.run(f"GRANT USAGE ON SCHEMA {at} TO w_{at}")
    server.run(f"GRANT SELECT, INSERT, UPDATE, DELETE ON ALL TABLES IN SCHEMA {at} TO w_{at}")
    assert publish_lines(road_lines().take([0, 1]), own, "a").removed == 7
    server.run(f"DROP OWNED BY w_{at}")
    server.run(f"DROP ROLE w_{at}")


def many_lines(n=2000, vertices=50):
    rng = np.random.default_rng(1)
    steps = np.concatenate([np.full((n, vertices, 1), 0.7), rng.normal(0, 0.05, (n, vertices, 2))], axis=2)
    xyz = np.cumsum(steps, axis=1) + rng.uniform(0, 5000, (n, 1, 3)) + np.array([500_000, 5_400_000, 100.0])
    return LineSet(xyz=xyz.reshape(-1, 3), offsets=np.arange(n + 1) * vertices, crs="EPSG:25832+7837",
                   kind=["guardrail"] * n, id=[f"r{i}" for i in range(n)])  # fmt: skip


def test_a_connection_that_is_lost_in_the_middle_leaves_what_was_there(server, address, monkeypatch):
    """The server ends the connection while rows are sent, as an operator or a restart does."""
    from linework.files.postgis import write

    lines = road_lines()
    publish_lines(lines, address, "a")
    whole = write.rows_of_lines

    def interrupted(*arguments):
        for i, row in enumerate(whole(*arguments)):
            if i == 1000:
                server.run(
                    "SELECT pg_terminate_backend(pid) FROM pg_stat_activity WHERE application_name = 'linework'"
                )
            yield row

    monkeypatch.setattr(write, "rows_of_lines", interrupted)
    with pytest.raises(MachineError, match="it was lost; nothing was changed"):
        publish_lines(many_lines(20_000), address, "a")
    monkeypatch.undo()
    assert_same(back(address), lines)
    assert server.run(f"SELECT count(*) FROM {address.schema}.run") == [(1,)]


def test_a_full_disk_leaves_what_was_there(server, address):
    """The error of a full disk, raised while rows are stored: the server reports and rolls back as for a real one."""
    lines = road_lines()
    publish_lines(lines, address, "a")
    server.run(
        f"CREATE FUNCTION {address.schema}.full() RETURNS trigger LANGUAGE plpgsql AS $$ BEGIN "
        "RAISE EXCEPTION 'could not extend file: No space left on device' USING ERRCODE = 'disk_full'; END $$"
    )
    server.run(
        f"CREATE TRIGGER is_full AFTER INSERT ON {address.schema}.line EXECUTE FUNCTION {address.schema}.full()"
    )
    with pytest.raises(MachineError, match="disk is full, nothing was changed") as caught:
        publish_lines(many_lines(), address, "a")
    assert "Free some space" in str(caught.value)
    assert_same(back(address), lines)


@pytest.fixture
def small_disk(server):
    """Yield the name of a tablespace on a disk of 8 MB."""
    folder = server.folder / "small"
    folder.mkdir()
    mounted = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", "size=8m", "tmpfs", str(folder)], capture_output=True
    )
    if mounted.returncode:
        pytest.skip("mounting a small disk is not allowed here")
    try:
        if os.geteuid() == 0:
            os.chown(folder, pwd.getpwnam("postgres").pw_uid, -1)
        server.run(f"CREATE TABLESPACE small LOCATION '{folder}'")
        yield "small"
    finally:
        server.run("DROP TABLESPACE IF EXISTS small")
        subprocess.run(["umount", "-l", str(folder)], check=True)


def test_a_disk_that_is_really_full_leaves_what_was_there(server, address, small_disk):
    """A million vertices onto a disk of 8 MB: it runs full while the server merges them."""
    lines, at = road_lines(), address.schema
    publish_lines(lines, address, "a")
    server.run(f"ALTER TABLE {at}.line SET TABLESPACE {small_disk}")
    try:
        with pytest.raises(MachineError, match="disk is full, nothing was changed") as caught:
            publish_lines(many_lines(20_000), address, "a")
        assert "\n" not in str(caught.value) and "No space left on device" in str(caught.value)
        assert_same(back(address), lines)
        assert server.run(f"SELECT count(*) FROM {at}.run") == [(1,)]
        # And goes on as soon as there is room
        assert publish_lines(lines, address, "a") == Published(0, 9, 0, 0)
    finally:
        server.run(f"DROP SCHEMA {at} CASCADE")


@pytest.mark.parametrize(
    ("table", "code", "error", "words"),
    [
        ("line", "check_violation", InputError, "refused by the database"),
        ("run", "out_of_memory", MachineError, "nothing was changed"),
        ("paint", "disk_full", MachineError, "disk is full, nothing was changed"),
    ],
)
def test_any_error_in_the_middle_leaves_what_was_there(server, address, table, code, error, words):
    lines, at = road_lines(), address.schema
    publish_lines(lines, address, "a", paint=paint_of(lines, 80.0))
    server.run(
        f"CREATE FUNCTION {at}.fails() RETURNS trigger LANGUAGE plpgsql AS $$ BEGIN "
        f"RAISE EXCEPTION 'it does not work' USING ERRCODE = '{code}'; END $$"
    )
    server.run(f"CREATE TRIGGER fails BEFORE INSERT ON {at}.{table} EXECUTE FUNCTION {at}.fails()")
    paint = server.run(f"SELECT * FROM {at}.paint ORDER BY id, from_m")
    moved = lines.with_columns(xyz=lines.xyz + 0.01)
    with pytest.raises(error, match=words) as caught:
        publish_lines(moved, address, "a", paint=paint_of(moved, 20.0))
    assert "\n" not in str(caught.value)
    assert_same(back(address), lines)
    assert server.run(f"SELECT count(*) FROM {at}.run") == [(1,)]
    assert server.run(f"SELECT * FROM {at}.paint ORDER BY id, from_m") == paint


def paint_of(lines, left):
    """Return stretches of 10 m of the markings, the first of each hidden."""
    found = []
    for i in np.flatnonzero(lines.kind == "lane_marking").tolist():
        for k in range(2):
            known = {"remaining_paint": (left, 3.0), "contrast": (2.5, 0.1), "width": (0.12, 0.01)}
            values = known if k else dict.fromkeys(known, (None, None))
            found.append(PaintStretch(i, 10.0 * k, 10.0 * (k + 1), values, float(k)))
    return found


def test_what_is_left_of_the_paint_stands_by_stretches_with_their_places(server, address):
    lines, at = road_lines(), address.schema
    publish_lines(lines, address, "a", paint=paint_of(lines, 80.0))
    n_markings = int((lines.kind == "lane_marking").sum())
    rows = server.run(
        f"SELECT id, from_m, to_m, remaining_paint, sigma_remaining_paint, contrast, sigma_contrast, painted_width_m, "
        f"sigma_painted_width_m, measured_share FROM {at}.paint ORDER BY id, from_m"
    )
    assert len(rows) == 2 * n_markings > 0
    assert rows[0][1:] == (0.0, 10.0, *[None] * 6, 0.0)
    assert rows[1][1:] == (10.0, 20.0, 80.0, 3.0, 2.5, 0.1, 0.12, 0.01, 1.0)
    for length, start in server.run(
        f"SELECT ST_Length(ST_Force2D(geom)), ST_M(ST_StartPoint(ST_GeometryN(geom, 1))) "
        f"FROM {at}.lane_marking_paint WHERE from_m = 10"
    ):
        assert length == pytest.approx(10.0, abs=1e-6) and start == pytest.approx(10.0)
    # Without points again: what was measured holds for lines that are the same, and for no others
    changed = str(lines.id[lines.kind == "lane_marking"][0])
    is_changed = (lines.id == changed)[lines.line_of_vertex]
    moved = lines.with_columns(xyz=lines.xyz + is_changed[:, None] * 0.01)
    publish_lines(moved, address, "a")
    left = {row[0] for row in server.run(f"SELECT id FROM {at}.paint")}
    assert changed not in left and len(left) == n_markings - 1
    publish_lines(moved.take(moved.kind != "lane_marking"), address, "a")
    assert server.run(f"SELECT count(*) FROM {at}.paint") == [(0,)]


def test_a_reviewed_marking_keeps_its_paint(server, address):
    lines, at = road_lines(), address.schema
    publish_lines(lines, address, "a", paint=paint_of(lines, 80.0))
    name = str(lines.id[lines.kind == "lane_marking"][0])
    server.run(f"UPDATE {at}.line SET review = 'accepted' WHERE id = '{name}'")
    publish_lines(lines, address, "a", paint=paint_of(lines, 20.0))
    values = dict(server.run(f"SELECT id, remaining_paint FROM {at}.paint WHERE from_m = 10"))
    assert values.pop(name) == 80.0 and set(values.values()) == {20.0}


def test_tables_of_an_earlier_version_get_the_columns_they_lack(server, address):
    lines, at = road_lines(), address.schema
    publish_lines(lines, address, "a")
    server.run(f"DROP TABLE {at}.paint CASCADE")
    server.run(f"ALTER TABLE {at}.line DROP COLUMN form CASCADE")
    assert publish_lines(lines, address, "a", paint=paint_of(lines, 50.0)).written > 0
    assert_same(back(address), lines)
    assert server.run(f"SELECT count(*) FROM {at}.paint") != [(0,)]
    assert server.run(f"SELECT count(*) FROM {at}.lane_marking WHERE form IS NULL")[0][0] > 0


def test_two_at_once_wait_for_each_other(address):
    lines = many_lines(500)
    failures = []

    def publish(step):
        try:
            publish_lines(lines.with_columns(xyz=lines.xyz + step), address, "a")
        except LineworkError as error:
            failures.append(error)

    publish_lines(lines, address, "a")
    threads = [threading.Thread(target=publish, args=(step,)) for step in (1.0, 2.0)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not failures
    assert any(np.array_equal(back(address).xyz, lines.xyz + step) for step in (1.0, 2.0))


@pytest.mark.parametrize(
    ("change", "error", "words"),
    [
        (lambda s: s.with_columns(crs="EPSG:25833"), CrsError, "is there in .*25832.* are in .*25833"),
        (lambda s: s.with_columns(id=["x"] * 9), UsageError, "9 lines have the id x"),
        (lambda s: s.with_columns(xyz=s.xyz * np.nan), UsageError, "not finite"),
    ],
)
def test_lines_that_are_refused(address, change, error, words):
    publish_lines(road_lines(), address, "a")
    with pytest.raises(error, match=words):
        publish_lines(change(road_lines()), address, "a")
    assert_same(back(address), road_lines())


def test_what_cannot_be_reached_is_one_line(server, tmp_path):
    for url, words in (
        ("postgresql://127.0.0.1:1/x", "no connection"),
        (server.url("nothing"), "no connection"),
        (f"{server.url()}?schema=empty_one", "no lines of linework there"),
        (server.url("postgres"), "the database has no PostGIS"),
    ):
        with pytest.raises((MachineError, InputError), match=words) as caught:
            read_lines(url)
        assert "\n" not in str(caught.value)


def test_the_commands(linework, server, address, tmp_path, monkeypatch):
    write_lines(road_lines(), tmp_path / "drive.gpkg")
    found = linework("publish", tmp_path / "drive.gpkg", address.url, "--schema", address.schema)
    assert found.code == 0 and found.stdout.startswith("9 lines written, 0 unchanged")
    there = f"{address.url}?schema={address.schema}&layer=guardrail"
    found = linework("convert", there, tmp_path / "rail.geojson")
    assert found.code == 0, found.stderr
    assert_same(read_lines(tmp_path / "rail.geojson"), road_lines()["guardrail"])
    found = linework("evaluate", f"{address.url}?schema={address.schema}", tmp_path / "drive.gpkg")
    assert found.code == 0 and "100.0" in found.stdout
    secret = address.url.replace("postgres@", "postgres:s3cret@")
    for arguments in (("publish", tmp_path / "drive.gpkg", secret), ("convert", secret, tmp_path / "x.gpkg")):
        found = linework(*arguments)
        assert found.code == 2 and "a password in an address" in found.line and "s3cret" not in found.stderr
    assert linework("publish", tmp_path / "drive.gpkg", "mysql://x/y").code == 2
    assert linework("publish", tmp_path / "drive.gpkg", address.url, "--schema", 'x"; drop').code == 2


def test_places_as_bytes():
    xyz = np.random.default_rng(0).normal(size=(7, 3))
    np.testing.assert_array_equal(line_of_ewkb(ewkb_of_line(xyz, 25832, np.arange(7.0))), xyz)
    assert psycopg.__version__ >= "3.2"
