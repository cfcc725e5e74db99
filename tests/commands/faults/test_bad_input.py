"""Bad input: one line that names the file and says what to do, the right exit code, nothing left behind."""

from __future__ import annotations

import json
import os
import struct
from pathlib import Path

import laspy
import numpy as np
import pyproj
import pytest
from laspy.vlrs.known import WktCoordinateSystemVlr
from tests.conftest import CRS, road_points

from linework.files.las.write import write_las

# Places in a LAS 1.4 header
N_POINTS_OLD, SCALES, OFFSETS, N_POINTS = 107, 131, 155, 247


@pytest.fixture
def output(tmp_path: Path) -> Path:
    return tmp_path / "out" / "lines.gpkg"


@pytest.fixture
def refused(linework, output, tmp_path):
    """Return a function that extracts, expects a refusal that leaves nothing behind, and gives the line."""

    def run(*arguments: object, code: int = 3) -> str:
        before = besides_work_folders(tmp_path)
        found = linework("extract", *arguments, "-o", output)
        assert found.code == code, found.stderr
        assert found.stdout == ""
        assert besides_work_folders(tmp_path) == before
        line = found.line
        assert line.endswith(".")
        assert len(line.split(". ")) >= 2, f"no advice: {line}"
        return line

    return run


def besides_work_folders(folder: Path) -> list[Path]:
    """Return what lies in a folder, without the points that are kept for the next run."""
    return sorted(path for path in folder.rglob("*") if ".linework" not in path.parts)


def patched(path: Path, place: int, form: str, *values: float) -> Path:
    """Return `path` after its bytes at `place` were replaced."""
    data = bytearray(path.read_bytes())
    struct.pack_into(form, data, place, *values)
    path.write_bytes(data)
    return path


def with_crs(path: Path, wkt: str, *, scale: float = 0.001, xyz: np.ndarray | None = None, **columns) -> Path:
    """Write points with any CRS record there can be, or none (wkt "")."""
    header = laspy.LasHeader(version="1.4", point_format=6)
    header.scales, header.offsets = (
        [scale] * 3,
        np.floor((road_points().xyz if xyz is None else xyz).min(axis=0)),
    )
    header.global_encoding.wkt = bool(wkt)
    if wkt:
        header.vlrs.append(WktCoordinateSystemVlr(wkt))
    points = road_points()
    las = laspy.LasData(header)
    las.xyz = points.xyz if xyz is None else xyz
    las.intensity = columns.get("intensity", points.intensity)
    las.gps_time = columns.get("gps_time", points.time_s)
    path.parent.mkdir(parents=True, exist_ok=True)
    las.write(path)
    return path


def test_a_file_that_is_not_there(refused, tmp_path):
    missing = tmp_path / "missing.laz"
    assert refused(missing).startswith(f"error: {missing}: ")


def test_an_empty_file(refused, las_file):
    las_file.write_bytes(b"")
    assert f"{las_file}: empty file (0 bytes)" in refused(las_file)


@pytest.mark.parametrize("kept", [100, 300, 0.5, 0.99])
def test_a_truncated_laz(refused, las_file, kept):
    data = las_file.read_bytes()
    las_file.write_bytes(data[: kept if isinstance(kept, int) else int(len(data) * kept)])
    assert str(las_file) in refused(las_file)


def test_a_las_cut_between_two_points_says_how_many_are_missing(refused, tmp_path):
    path = tmp_path / "a.las"
    write_las(road_points(), path, crs=CRS)
    path.write_bytes(path.read_bytes()[: -30 * 100])
    line = refused(path)
    assert "400" in line
    assert "300" in line


def test_something_else_named_laz(refused, tmp_path):
    path = tmp_path / "page.laz"
    path.write_text("<html><body>404 not found</body></html>" * 20)
    assert str(path) in refused(path)


def test_zero_points(refused, las_file):
    patched(las_file, N_POINTS_OLD, "<I", 0)
    patched(las_file, N_POINTS, "<Q", 0)
    assert "no points" in refused(las_file)


def test_a_header_that_promises_what_the_file_cannot_hold(refused, las_file):
    patched(las_file, N_POINTS, "<Q", 4_000_000_000)
    assert "4,000,000,000" in refused(las_file)


@pytest.mark.parametrize("value", [float("nan"), float("inf"), 0.0])
def test_a_scale_that_is_no_scale(refused, las_file, value):
    patched(las_file, SCALES, "<d", value)
    assert "scale" in refused(las_file)


def test_an_offset_that_is_no_number(refused, las_file):
    patched(las_file, OFFSETS, "<d", float("nan"))
    assert "offset" in refused(las_file)


def test_coordinates_at_the_end_of_the_world(refused, las_file):
    patched(las_file, OFFSETS, "<d", 1e12)
    assert str(las_file) in refused(las_file)


def test_times_that_are_no_numbers_are_left_out_and_counted(linework, tmp_path, output):
    times = road_points().time_s.copy()
    times[:7] = np.nan
    path = with_crs(tmp_path / "a.las", pyproj.CRS("EPSG:25832").to_wkt(), gps_time=times)
    found = linework("extract", path, "-o", output, "--quiet", "--json")
    assert found.code == 0, found.stderr
    counts = json.loads(found.stdout)["counts"]
    assert counts["points_used"] == 393
    assert list(counts["points_rejected"].values()) == [7]


def test_no_intensity_is_said_and_survived(linework, tmp_path, output):
    path = with_crs(tmp_path / "a.las", pyproj.CRS("EPSG:25832").to_wkt(), intensity=np.zeros(400, np.uint16))
    found = linework("extract", path, "-o", output)
    assert found.code == 0
    assert "warning: a.las: no intensity" in found.stderr


def test_no_crs(refused, linework, tmp_path, output):
    path = with_crs(tmp_path / "a.las", "")
    assert "--crs" in refused(path)
    assert linework("extract", path, "-o", output, "--crs", "EPSG:25832").code == 0


def test_degrees(refused, tmp_path):
    xyz = road_points().xyz / [1e5, 1e5, 1.0]
    path = with_crs(tmp_path / "a.las", pyproj.CRS("EPSG:4326").to_wkt(), scale=1e-7, xyz=xyz)
    assert "degree" in refused(path)


@pytest.mark.parametrize("crs", ["local", CRS])
@pytest.mark.parametrize("length_m", [40.0, 5_000.0])
def test_degrees_called_metres(refused, tmp_path, crs, length_m):
    rng = np.random.default_rng(3)
    xyz = rng.uniform(0, [length_m, 40, 12], (2000, 3)) / [77_000, 111_000, 1] + [11.03, 45.88, 190.0]
    xyz[7] = 60.0, 2.0, 300.0  # a stray point does not hide them
    path = with_crs(
        tmp_path / "degrees.las", "", scale=1e-7, xyz=xyz, intensity=1 + xyz[:, 0], gps_time=3e8 + xyz[:, 2]
    )
    line = refused(path, "--crs", crs)
    assert "degrees.las: coordinates are geographic (degrees)" in line
    assert "45.88" in line


def test_the_option_and_the_file_name_different_crss(refused, las_file):
    line = refused(las_file, "--crs", "EPSG:25833")
    assert "25832" in line
    assert "25833" in line


def test_two_files_in_two_crss(refused, las_file):
    write_las(road_points(), las_file.with_name("b.laz"), crs="EPSG:25833+7837")
    line = refused(las_file.parent)
    assert "25832" in line
    assert "25833" in line


def test_a_crs_that_is_an_address_is_not_fetched(refused, las_file):
    assert "--crs" in refused(las_file, "--crs", "http://127.0.0.1:9/crs")


@pytest.mark.parametrize("suffix", [".gpkg", ".geojson"])
def test_lines_of_a_survey_in_feet_are_in_the_metric_twin(linework, tmp_path, suffix):
    wkt = pyproj.CRS("EPSG:2263+6360").to_wkt()
    with_crs(tmp_path / "a.las", wkt, xyz=road_points().xyz * 3937 / 1200, scale=0.0001)
    output = tmp_path / f"lines{suffix}"
    found = linework("extract", tmp_path / "a.las", "-o", output)
    assert found.code == 0, found.stderr
    record = json.loads((tmp_path / "run.json").read_text())
    assert {axis.unit_name for axis in pyproj.CRS(record["crs"]["wkt"]).axis_info} == {"metre"}


def test_feet_become_metres_and_it_is_said(linework, tmp_path):
    wkt = pyproj.CRS("EPSG:2263+6360").to_wkt()
    foot = 1200 / 3937
    with_crs(tmp_path / "a.las", wkt, xyz=road_points().xyz / foot, scale=0.0001)
    found = linework("info", tmp_path / "a.las", "--json")
    assert found.code == 0, found.stderr
    document = json.loads(found.stdout)
    extent = document["extent_m"]
    assert extent["east"] - extent["west"] == pytest.approx(40.0, abs=0.5)
    assert document["height_m"]["median"] == pytest.approx(100.0, abs=0.1)
    assert any("feet" in text or "foot" in text for text in document["warnings"])


def test_a_folder_without_laser_files(refused, tmp_path):
    (tmp_path / "notes.txt").write_text("nothing here")
    assert "folder without" in refused(tmp_path)


def test_a_pipe_does_not_block(refused, tmp_path):
    path = tmp_path / "pipe.laz"
    os.mkfifo(path)
    assert "not a regular file" in refused(path)


def test_all_files_damaged(refused, las_file):
    las_file.write_bytes(b"LASF" + bytes(500))
    assert str(las_file) in refused(las_file.parent)


def test_a_damaged_file_among_good_ones(linework, las_file, output):
    bad = las_file.with_name("b.laz")
    bad.write_bytes(las_file.read_bytes()[:-200])
    found = linework("extract", las_file.parent, "-o", output)
    assert found.code == 4
    assert f"1 of 2 files left out: {bad}: " in found.line
    (failure,) = json.loads(output.with_name("run.json").read_text())["failures"]
    assert failure["file"] == str(bad)
    assert output.exists()


def test_the_output_exists(refused, las_file, output):
    output.parent.mkdir()
    output.write_text("precious")
    line = refused(las_file, code=6)
    assert line.startswith(f"error: {output}: ")
    assert "--overwrite" in line
    assert output.read_text() == "precious"


def test_the_output_is_refused_before_the_survey_is_looked_at(linework, tmp_path, output):
    output.parent.mkdir()
    output.touch()
    assert linework("extract", tmp_path / "missing.laz", "-o", output).code == 6


def test_the_outputs_folder_is_a_file(refused, las_file, output):
    output.parent.write_text("a file")
    assert str(output) in refused(las_file, code=5)


def test_an_unknown_format(refused, las_file, tmp_path, linework):
    found = linework("extract", las_file, "-o", tmp_path / "lines.doc")
    assert found.code == 2
    assert ".gpkg" in found.line


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--features", "hedge"], "hedge"),
        (["--method", "magic"], "magic"),
        (["--method", "photo"], "photo"),
        (["--workers", "1000000"], "'--workers'"),
        (["--no-such-option"], "--no-such-option"),
    ],
)
def test_arguments_that_make_no_sense(refused, las_file, arguments, said):
    assert said in refused(las_file, *arguments, code=2)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[radon]\nno_such_m = 1.0\n", "radon.no_such_m"),
        ("[radon]\ncell_m = -1.0\n", "radon.cell_m"),
        ("[radon]\ncell_m = 'wide'\n", "radon.cell_m"),
        ("[magic]\n", "magic"),
        ("radon = \n", "is not TOML"),
    ],
)
def test_a_run_file_that_makes_no_sense(refused, las_file, tmp_path, text, said):
    path = tmp_path / "run.toml"
    path.write_text(text)
    line = refused(las_file, "--config", path, code=2)
    assert line.startswith(f"error: {path}: ")
    assert said in line


def test_a_trajectory_that_is_not_one(refused, las_file, tmp_path):
    path = tmp_path / "trajectory.csv"
    path.write_text("time_s,easting_m\n1,2\n3,4\n")
    line = refused(las_file, "--trajectory", path)
    assert "northing_m" in line


def test_a_name_that_would_write_on_the_terminal(refused, tmp_path):
    path = tmp_path / "a\x1b[31m\n.laz"
    path.write_bytes(b"")
    line = refused(path)
    assert "\\x1b[31m\\n.laz" in line
