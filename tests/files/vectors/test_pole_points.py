"""Poles are points in files, and upright lines in sets of lines."""

from __future__ import annotations

import sqlite3

import ezdxf
import numpy as np
import pyogrio
import pytest
import shapely

from linework.errors import LineworkWarning
from linework.files.vectors.gpkg import read_poles
from linework.files.vectors.pole_points import is_point, points_last
from linework.files.vectors.read_write import read_lines, write_lines
from linework.model.lines import POLE, LineSet

UTM = "EPSG:25832+7837"
FEET = np.array([[500000.125, 5800000.375, 31.0625], [500040.0, 5800003.1, 30.87]])
HEIGHTS = np.array([8.3, 43.0721])


def sample():
    """Return a cable between two poles, the poles first."""
    poles = [
        np.stack([foot, foot + np.array([0.0, 0.0, up])]) for foot, up in zip(FEET, HEIGHTS, strict=True)
    ]
    wire = np.linspace(poles[0][1], poles[1][1], 12)
    return LineSet.from_lines(
        [*poles, wire], crs=UTM, id=["pole-1", "pole-2", "cable-1"], kind=[POLE, POLE, "cable"],
        form=["pole", "tower", ""], height_m=[*HEIGHTS, np.nan], confidence=[0.93, 0.5, 0.88],
        network=["n-1"] * 3, circuit=["", "", "c-1"], span=["", "", "s-1"],
        sigma_xy_m=np.repeat([0.012345678, 0.3, 0.01], [2, 2, 12]), sigma_z_m=np.repeat([0.1, np.nan, 0.02], [2, 2, 12]),
    )  # fmt: skip


@pytest.mark.parametrize("suffix", ["gpkg", "geojson", "parquet"])
def test_poles_and_networks_are_read_back_exactly(tmp_path, suffix):
    path = tmp_path / f"lines.{suffix}"
    write_lines(sample(), path)
    assert read_lines(path) == points_last(sample())


@pytest.mark.parametrize("suffix", ["fgb", "dxf", "landxml"])
def test_formats_without_columns_of_vertices_keep_places_and_fields(tmp_path, suffix):
    path, lines = tmp_path / f"lines.{suffix}", points_last(sample())
    write_lines(sample(), path)
    back = read_lines(path)
    assert np.array_equal(back.xyz, lines.xyz)
    for name in ("id", "kind", "form", "network", "circuit", "span"):
        assert getattr(back, name).tolist() == getattr(lines, name).tolist()
    assert np.array_equal(back.height_m, lines.height_m, equal_nan=True)


@pytest.mark.parametrize("suffix", ["gpkg", "geojson", "parquet"])
def test_what_only_a_part_of_a_pole_shows_is_kept(tmp_path, suffix):
    path, seen = tmp_path / f"truth.{suffix}", np.ones(16, dtype=bool)
    seen[0] = False
    truth = sample().with_columns(observed=seen)
    write_lines(truth, path)
    back = read_lines(path)
    assert sorted(back.id.tolist()) == sorted(truth.id.tolist())
    pole = back.take(back.id == "pole-1")
    assert pole.observed.tolist() == [False, True]


def test_a_geopackage_has_a_layer_of_styled_points(tmp_path):
    path = tmp_path / "lines.gpkg"
    write_lines(sample(), path)
    meta, _, shapes, values = pyogrio.raw.read(path, layer="pole")
    assert meta["geometry_type"] == "Point Z"
    assert np.array_equal(shapely.get_coordinates(shapely.from_wkb(shapes), include_z=True), FEET)
    fields = dict(zip(meta["fields"], values, strict=True))
    assert fields["height_m"].tolist() == HEIGHTS.tolist()
    assert fields["network"].tolist() == ["n-1"] * 2 and "circuit" not in fields
    with sqlite3.connect(path) as db:
        (style,) = db.execute("SELECT styleQML FROM layer_styles WHERE f_table_name = 'pole'").fetchone()
    assert 'type="marker"' in style and "<layerGeometryType>0<" in style
    assert read_poles(path) == sample().take([0, 1])


def test_a_geopackage_that_others_edited_still_has_poles(tmp_path):
    path = tmp_path / "lines.gpkg"
    write_lines(sample(), path)
    with sqlite3.connect(path) as db:
        db.execute("DELETE FROM vertex")
    back = read_lines(path)
    assert sorted(back.kind.tolist()) == ["cable", "pole", "pole"]
    poles = back.take(back.kind == POLE)
    assert np.array_equal(poles.xyz[1::2, 2], FEET[:, 2] + HEIGHTS)


def test_drawings_show_how_high_poles_are(tmp_path):
    write_lines(sample(), tmp_path / "lines.dxf")
    points = ezdxf.readfile(tmp_path / "lines.dxf").modelspace().query("POINT")
    assert [point.dxf.layer for point in points] == ["pole", "pole"]
    assert [point.dxf.thickness for point in points] == HEIGHTS.tolist()
    write_lines(sample(), tmp_path / "lines.kml")
    text = (tmp_path / "lines.kml").read_text()
    assert text.count("<Point><extrude>1</extrude>") == 2 and ",39.362<" in text
    write_lines(sample(), tmp_path / "lines.landxml")
    assert (tmp_path / "lines.landxml").read_text().count('code="pole"') == 2


def test_lines_without_networks_have_no_columns_of_networks(tmp_path):
    path = tmp_path / "lines.gpkg"
    write_lines(sample().take([2]).with_columns(network=[""], circuit=[""], span=[""]), path)
    fields = set(pyogrio.read_info(path, layer="cable")["fields"])
    assert "clearance_m" in fields and not fields & {"network", "circuit", "span"}


def test_what_leans_stays_a_line(tmp_path):
    """A line of the kind that is not upright is no point: nothing of it is lost."""
    lines = sample()
    xyz = lines.xyz.copy()
    xyz[1, 0] += 0.5
    lines = lines.with_columns(xyz=xyz)
    assert not is_point(lines).any()
    write_lines(lines, tmp_path / "lines.gpkg")
    back = read_lines(tmp_path / "lines.gpkg")
    assert np.array_equal(back.xyz, lines.xyz)


@pytest.mark.parametrize("edit", ["height_m = NULL", "height_m = -1.0"])
def test_poles_without_a_height_are_left_out(tmp_path, edit):
    path = tmp_path / "lines.gpkg"
    write_lines(sample(), path)
    with sqlite3.connect(path) as db:
        for (trigger,) in db.execute("SELECT name FROM sqlite_master WHERE type = 'trigger'").fetchall():
            db.execute(f'DROP TRIGGER "{trigger}"')  # they need functions of GeoPackage
        db.execute(f"UPDATE pole SET {edit} WHERE id = 'pole-1'")
    assert read_poles(path).id.tolist() == ["pole-2"]
    with pytest.warns(LineworkWarning, match="layer pole"):
        back = read_lines(path)
    assert sorted(back.id.tolist()) == ["cable-1", "pole-2"]
