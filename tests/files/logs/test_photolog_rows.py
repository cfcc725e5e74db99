"""The van's log: images and keys placed on the trajectory, and written beside the lines."""

from __future__ import annotations

import json
import sqlite3
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.scenes.image_folders import stereo_folder

from linework.errors import InputError
from linework.files.images.series import open_stereo
from linework.files.logs.keys import read_events
from linework.files.logs.photolog import van_log
from linework.files.survey.open import open_survey
from linework.files.vectors.point_layers import point_layers, read_point_layers
from linework.files.vectors.read_write import points_left_out, read_lines, write_lines
from linework.model.lines import LineSet
from linework.model.logs import VanLog
from linework.model.trajectory import Trajectory
from linework.navigation.chainage import chainage_m, is_placed, places_at

EVENTS = "time_s,key,note\n0.25,m,manhole\n0.05,s,sign, bent\n9.0,x,\n"


def _east(n: int = 11) -> Trajectory:
    """Return a drive to the east at 10 m/s, ten poses a second."""
    time = np.arange(n) / 10.0
    xyz = np.stack([500_000.0 + 10.0 * time, np.full(n, 5_400_000.0), np.full(n, 100.0)], axis=1)
    return Trajectory(time, xyz, np.tile([0.0, 0.0, 90.0], (n, 1)))


@pytest.fixture
def log(tmp_path: Path) -> VanLog:
    """Return the log of a drive with six pairs and three keys, the last key after its end."""
    folder = stereo_folder(
        tmp_path, [0.05 + 0.1 * i for i in range(6)], more='[events]\nfile = "events.csv"\n'
    )
    (folder / "events.csv").write_text(EVENTS)
    survey = open_survey([folder])
    return van_log(survey, open_stereo(survey), _east())


def test_images_stand_where_the_left_camera_was(log: VanLog) -> None:
    photos = log.photos
    assert photos is not None and len(photos) == 6
    # 1 m ahead of the vehicle's origin, 0.25 m to the left (north), 2 m up
    np.testing.assert_allclose(photos.places.xyz[2], [500_003.5, 5_400_000.25, 102.0], atol=1e-6)
    assert photos.places.heading_deg == pytest.approx(90.0)
    assert photos.places.chainage_m == pytest.approx([0.5 + i for i in range(6)])
    assert photos.number.tolist() == list(range(6))


def test_keys_stand_where_they_were_pressed_in_order_of_time(log: VanLog) -> None:
    events = log.events
    assert events is not None
    assert (events.key, events.note) == (("s", "m"), ("sign, bent", "manhole"))
    np.testing.assert_allclose(events.places.xyz[1], [500_002.5, 5_400_000.0, 100.0], atol=1e-6)
    assert log.warnings == (
        "1 of 3 events cannot be placed, the first at 9.000 s (the trajectory runs from 0.000 to 1.000 s, "
        "or has a gap there)",
    )


def test_without_a_trajectory_nothing_has_a_place(log: VanLog) -> None:
    survey = open_survey([log.root])
    found = van_log(survey, open_stereo(survey), None)
    assert found.photos is not None and len(found.photos) == 0
    assert "6 images cannot be placed: there is no trajectory" in found.warnings


def test_without_attitude_the_way_gives_the_heading() -> None:
    drive = replace(_east(), attitude_deg=None)
    places = places_at(drive, np.array([0.5]), (1.0, 0.0, 2.0))
    assert places.heading_deg == pytest.approx([90.0])
    np.testing.assert_allclose(places.xyz, [[500_006.0, 5_400_000.0, 102.0]])


def test_a_van_at_rest_drives_nowhere() -> None:
    random = np.random.default_rng(0)
    time = np.arange(3000) / 50.0
    x = np.clip(10.0 * (time - 20.0), 0.0, 200.0)
    xyz = np.stack([x, 0.0 * x, 0.0 * x], axis=1) + random.normal(0.0, 0.02, (3000, 3))
    driven = chainage_m(Trajectory(time, xyz))
    assert driven[-1] == pytest.approx(200.0, abs=0.8)
    assert np.all(np.diff(driven) >= 0.0)


def test_a_bend_is_as_long_as_its_arc() -> None:
    angle = np.linspace(0.0, np.pi, 400)
    xyz = 25.0 * np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=1)
    assert chainage_m(Trajectory(np.arange(400.0), xyz))[-1] == pytest.approx(25.0 * np.pi, rel=2e-4)


def test_holes_and_ends_have_no_places() -> None:
    drive = Trajectory(np.array([0.0, 1.0, 7.0, 8.0]), np.zeros((4, 3)))
    times = np.array([-0.1, 0.0, 0.5, 1.0, 3.0, 7.0, 8.0, 8.1])
    assert is_placed(drive, times).tolist() == [False, True, True, True, False, True, True, False]


@pytest.mark.parametrize(
    ("content", "told"),
    [
        ("", "empty file"),
        ("time,key\n1,m\n", "missing column time_s"),
        ("time_s,key,note\nnoon,m,x\n1,,x\n", "none of its 2 lines has a time and a key"),
    ],
)
def test_bad_events_are_one_line(tmp_path: Path, content: str, told: str) -> None:
    (tmp_path / "events.csv").write_text(content)
    with pytest.raises(InputError, match=told):
        read_events(tmp_path / "events.csv")


def test_lines_that_are_no_events_are_counted(tmp_path: Path) -> None:
    (tmp_path / "e.csv").write_text('TIME_S,Key\r\n2,"b"\r\n\r\n1,a\r\nnan,c\r\n3\r\n')
    rows = read_events(tmp_path / "e.csv")
    assert (rows.time_s.tolist(), rows.key, rows.note) == ([1.0, 2.0], ("a", "b"), ("", ""))
    assert rows.warnings == (f"{tmp_path / 'e.csv'}: 2 of 4 lines left out, the first is line 5",)


def _lines() -> LineSet:
    xyz = np.array([[500_000.0, 5_400_000.0, 100.0], [500_010.0, 5_400_001.0, 100.0]])
    return LineSet.from_lines([xyz], kind=["lane_marking"], id=["a"])


@pytest.mark.parametrize("suffix", [".gpkg", ".geojson"])
def test_lines_with_points_beside_them_read_back_exactly(tmp_path: Path, log: VanLog, suffix: str) -> None:
    path = tmp_path / f"out{suffix}"
    write_lines(_lines(), path, kinds=("cable",), points=log)
    back = read_lines(path)
    assert back.id.tolist() == ["a"] and np.array_equal(back.xyz, _lines().xyz)
    assert points_left_out(path, log) == ()
    other = tmp_path / f"again{suffix}"
    write_lines(_lines(), other, kinds=("cable",), points=log)
    assert path.read_bytes() == other.read_bytes()


def test_a_geopackage_holds_the_layers(tmp_path: Path, log: VanLog) -> None:
    import pyogrio

    path = tmp_path / "out.gpkg"
    write_lines(_lines(), path, points=log)
    layers = {str(name): str(kind) for name, kind in pyogrio.list_layers(path) if kind}
    assert layers["photolog"] == layers["event"] == "Point Z"
    meta, _, _, values = pyogrio.raw.read(path, layer="photolog")
    table = dict(zip(meta["fields"], values, strict=True))
    assert table["left"][0] == "left/000000.png" and table["right"][5] == "right/000005.png"
    assert table["heading_deg"] == pytest.approx(90.0)
    meta, _, _, values = pyogrio.raw.read(path, layer="event", bbox=(500_002, 5_399_999, 500_003, 5_400_001))
    assert dict(zip(meta["fields"], values, strict=True))["note"].tolist() == ["manhole"]
    with sqlite3.connect(path) as db:
        assert db.execute("PRAGMA integrity_check").fetchone()[0] == "ok"
        kinds = dict(db.execute("SELECT table_name, geometry_type_name FROM gpkg_geometry_columns"))
    db.close()
    assert kinds == {"lane_marking": "LINESTRING", "photolog": "POINT", "event": "POINT"}


def test_a_geojson_holds_the_points_with_their_kind(tmp_path: Path, log: VanLog) -> None:
    path = tmp_path / "out.geojson"
    write_lines(_lines(), path, points=log)
    features = json.loads(path.read_text())["features"]
    assert [f["geometry"]["type"] for f in features] == ["LineString", *["Point"] * 8]
    assert features[-1]["properties"]["kind"] == "event" and features[-1]["properties"]["note"] == "manhole"
    assert features[1]["properties"]["chainage_m"] == 0.5


def test_points_go_through_both_formats_and_back(tmp_path: Path, log: VanLog) -> None:
    first = tmp_path / "a.gpkg"
    write_lines(_lines(), first, points=log)
    write_lines(read_lines(first), tmp_path / "b.geojson", points=read_point_layers(first))
    write_lines(read_lines(first), tmp_path / "c.gpkg", points=read_point_layers(tmp_path / "b.geojson"))
    assert (tmp_path / "c.gpkg").read_bytes() == first.read_bytes()


def test_lines_alone_have_no_point_layers(tmp_path: Path) -> None:
    for name in ("a.gpkg", "a.geojson", "a.dxf"):
        write_lines(_lines(), tmp_path / name)
        assert read_point_layers(tmp_path / name) == ()


def test_a_log_without_any_place_keeps_its_empty_layers(tmp_path: Path, log: VanLog) -> None:
    import pyogrio

    survey = open_survey([log.root])
    nothing = van_log(survey, open_stereo(survey), None)
    write_lines(_lines(), tmp_path / "out.gpkg", points=nothing)
    assert pyogrio.read_info(tmp_path / "out.gpkg", layer="event")["features"] == 0
    assert len(read_lines(tmp_path / "out.gpkg")) == 1
    write_lines(_lines(), tmp_path / "out.geojson", points=nothing)
    assert len(read_lines(tmp_path / "out.geojson")) == 1


@pytest.mark.parametrize("suffix", [".dxf", ".fgb"])
def test_formats_of_lines_leave_the_points_out_and_say_so(tmp_path: Path, log: VanLog, suffix: str) -> None:
    path = tmp_path / f"out{suffix}"
    write_lines(_lines(), path, points=log)
    assert path.is_file()
    assert points_left_out(path, log) == (
        f"{path}: photolog (6 points) and event (2 points) left out, {suffix} files hold only lines "
        "(.gpkg, .geojson, .json hold both)",
    )


def test_a_survey_without_cameras_and_events_has_no_layers(tmp_path: Path) -> None:
    (tmp_path / "survey.toml").write_text('crs = "local"\n')
    survey = open_survey([tmp_path])
    assert point_layers(van_log(survey, open_stereo(survey), _east())) == ()
