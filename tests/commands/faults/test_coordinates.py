"""Numbers, CRS, geometry that lie: group B of the list of faults, as far as point files and coordinates go.

B05: one run works in one CRS; files of another are refused by name, there is no reprojection of points.
B06: data of zone 32 that call themselves zone 33 look as sound as any; only a trajectory can tell.
B09: no transformation is needed to find lines; those that are (to degrees, for KML) are refused where PROJ knows
only a ballpark, as for the datum of Xian 1980 here.
B13: points beyond the edge of their zone are where their coordinates say; lines are continuous there.
B14: nothing is measured by intensity that the kinds found today (guardrails, barriers, cables) depend on.
"""

from __future__ import annotations

import json
import math
import re
from pathlib import Path

import laspy
import numpy as np
import pyogrio
import pyproj
import pytest
import shapely
from laspy.vlrs.known import WktCoordinateSystemVlr
from tests.scenes.rail_scenes import rail_scene, straight

from linework.cli.app import main
from linework.errors import UsageError
from linework.files.trajectories.read import write_trajectory
from linework.files.vectors.read_write import read_lines, write_lines
from linework.model.lines import LineSet
from linework.model.trajectory import Trajectory

FOOT, US_FOOT = 0.3048, 1200 / 3937
#: Where the made-up road is [m]: whole multiples of the 1200 m that all lattices share.
PLACE = np.array([499_200.0, 4_500_000.0, 100.0])
UTM, OTHER = "EPSG:25832", "EPSG:25833"


@pytest.fixture(scope="module")
def scene():
    """(n, 3) points of 40 m of road with a guardrail, on steps of 0.1 mm [m from the place]."""
    rng = np.random.default_rng(4)
    return np.round(straight(rail_scene(rng, s=(2.13, 37.91)), 0.31), 4)


def cloud(path: Path, xyz, *, wkt="", keys=(), bit=None, scale=0.0001, intensity=500, time=None) -> Path:
    """Write points with any CRS records there can be, or none."""
    header = laspy.LasHeader(version="1.4", point_format=6)
    header.scales, header.offsets = [scale] * 3, np.floor(np.asarray(xyz).min(axis=0))
    if wkt:
        header.vlrs.append(WktCoordinateSystemVlr(wkt))
    if keys:
        values = [1, 1, 0, len(keys), *(v for key, value in keys for v in (key, 0, 1, value))]
        header.vlrs.append(laspy.VLR("LASF_Projection", 34735, "", np.array(values, "<u2").tobytes()))
    header.global_encoding.wkt = bool(wkt) if bit is None else bit
    header.global_encoding.gps_time_type = laspy.header.GpsTimeType.STANDARD
    las = laspy.LasData(header)
    las.xyz = xyz
    las.intensity = np.broadcast_to(intensity, len(xyz))
    las.gps_time = 3e8 + np.arange(len(xyz)) * 1e-5 if time is None else time
    path.parent.mkdir(parents=True, exist_ok=True)
    las.write(path)
    return path


def wkt_of(crs: str, form: str = "WKT2_2019") -> str:
    return pyproj.CRS.from_user_input(crs).to_wkt(form)


@pytest.fixture(scope="module")
def here(scene, tmp_path_factory):
    """The lines of the scene at its place, in metres."""
    folder = tmp_path_factory.mktemp("here")
    output = folder / "lines.gpkg"
    survey = cloud(folder / "a.las", scene + PLACE)
    assert (
        main(["extract", str(survey), "-o", str(output), "--crs", "local", "--quiet", "--workers", "1"]) == 0
    )
    return read_lines(output)


@pytest.fixture
def lines_of(linework, tmp_path):
    """Return a function that extracts a survey and gives its lines and what was said."""

    def run(*arguments: object) -> tuple[LineSet, dict, str]:
        output = tmp_path / "out" / "lines.gpkg"
        found = linework("extract", *arguments, "-o", output, "--overwrite", "--quiet", "--workers", "1")
        assert found.code == 0, found.stderr
        record = json.loads(output.with_name("run.json").read_text())
        assert_valid(output)
        return read_lines(output), record, found.stderr

    return run


@pytest.fixture
def refused(linework, tmp_path):
    """Return a function that extracts, expects a refusal that leaves nothing behind, and gives the line."""

    def run(path: Path, *arguments: object, output="lines.gpkg", code: int = 3) -> str:
        found = linework("extract", path, *arguments, "-o", tmp_path / "out" / output, "--quiet")
        assert found.code == code, found.stderr
        assert found.stderr == f"{found.line}\n"
        assert len(found.line.replace(str(tmp_path), "")) <= 300
        assert not (tmp_path / "out").exists() or list((tmp_path / "out").iterdir()) == []
        return found.line.removeprefix("error: ")

    return run


def assert_valid(path: Path) -> None:
    """Every line that was published has a length, and finite vertices of which no two neighbours are one."""
    for layer in ("guardrail", "barrier", "cable"):
        geometry = shapely.from_wkb(pyogrio.raw.read(path, layer=layer)[2])
        assert shapely.is_valid(geometry).all()
        assert (shapely.length(geometry) > 0).all()
        assert np.isfinite(shapely.get_coordinates(geometry, include_z=True)).all()


def assert_same(found: LineSet, expected: LineSet, shift=(0.0, 0.0, 0.0), within_m=1e-4) -> None:
    assert len(expected) > 0
    assert found.kind.tolist() == expected.kind.tolist()
    assert found.offsets.tolist() == expected.offsets.tolist()
    np.testing.assert_allclose(found.xyz - shift, expected.xyz, atol=within_m, rtol=0)


# B01, B02, B04 to B06: what the file says of its CRS


def test_b01_no_crs(refused, scene, tmp_path):
    path = cloud(tmp_path / "a.las", scene + PLACE)
    assert refused(path) == f"{path}: the file does not state its CRS. Give --crs EPSG:... or --crs local."


KEYS = ((1024, 1), (3072, 25832))


@pytest.mark.parametrize(
    "records",
    [
        {"keys": KEYS, "bit": True},
        {"wkt": wkt_of(UTM), "bit": False},
        {"wkt": wkt_of(UTM), "keys": KEYS},
        {"wkt": wkt_of(UTM, "WKT1_GDAL"), "keys": KEYS, "bit": False},
    ],
    ids=["bit, but keys", "WKT, but no bit", "both", "both, no bit"],
)
def test_b02_what_is_there_is_read(linework, scene, tmp_path, records):
    path = cloud(tmp_path / "a.las", scene[:100] + PLACE, **records)
    found = linework("info", path, "--json", "--quiet")
    assert found.code == 0, found.stderr
    assert json.loads(found.stdout)["crs"]["name"] == "ETRS89 / UTM zone 32N (EPSG:25832)"


def test_b02_both_and_different(refused, scene, tmp_path):
    path = cloud(tmp_path / "a.las", scene + PLACE, wkt=wkt_of(UTM), keys=((1024, 1), (3072, 25833)))
    assert refused(path) == (
        f"{path}: two different CRSs: its WKT says ETRS89 / UTM zone 32N (EPSG:25832), its GeoTIFF keys says ETRS89 / UTM"
        " zone 33N (EPSG:25833). Correct the header."
    )


@pytest.mark.parametrize("form", ["WKT1_GDAL", "WKT2_2019"])
def test_b04_degrees(refused, scene, tmp_path, form):
    xyz = scene / [77_000, 111_000, 1] + [11.03, 45.88, 190.0]
    path = cloud(tmp_path / "a.las", xyz, wkt=wkt_of("EPSG:4326", form), scale=1e-7)
    line = refused(path)
    assert re.fullmatch(
        re.escape(f"{path}: CRS 'WGS 84' is geographic (degrees), lengths need metres. Transform to a")
        + ".*",
        line,
    )


def test_b05_two_zones_in_one_run(refused, scene, tmp_path):
    cloud(tmp_path / "in" / "a.las", scene + PLACE, wkt=wkt_of(UTM))
    path = cloud(tmp_path / "in" / "b.las", scene + PLACE + 1200.0, wkt=wkt_of(OTHER))
    assert refused(path.parent) == (
        f"{path}: 1 of 2 files have another CRS: b.las ETRS89 / UTM zone 33N (EPSG:25833), a.las ETRS89 / UTM zone 32N"
        " (EPSG:25832). Transform them to one CRS, or extract them one by one."
    )


def driven(path: Path, place, *, swapped=False) -> Path:
    """Write the trajectory of a drive past the scene."""
    along = np.linspace(-5.0, 45.0, 101)
    xyz = straight(np.column_stack([along, 0 * along, 0 * along]), 0.31) + place
    if swapped:
        xyz = xyz[:, [1, 0, 2]]
    write_trajectory(Trajectory(3e8 + (along + 5.0) / 50.0 * 2.0 - 0.5, xyz), path)
    return path


@pytest.mark.parametrize(
    ("place", "swapped", "apart"),
    [(PLACE + np.array([4e5, 0, 0]), False, "400.0 km"), (PLACE, True, r"5,65\d.\d km")],
    ids=["B06 another zone", "B07 north before east"],
)
def test_b06_b07_a_trajectory_somewhere_else(refused, scene, tmp_path, place, swapped, apart):
    path = cloud(tmp_path / "a.las", scene + PLACE, wkt=wkt_of(UTM))
    trajectory = driven(tmp_path / "trajectory.csv", place, swapped=swapped)
    assert re.fullmatch(
        rf"{re.escape(str(trajectory))}: trajectory and points are {apart} apart: east \d+ to \d+, north \d+ to \d+ against"
        r" east \d+ to \d+, north \d+ to \d+\. Check that both are in the same CRS, with east before north\.",
        refused(path, "--trajectory", trajectory),
    )


# B03: feet


@pytest.mark.parametrize(
    ("crs", "form", "horizontal", "vertical"),
    [
        ("EPSG:2225", "WKT1_GDAL", US_FOOT, US_FOOT),
        ("EPSG:2263+6360", "WKT2_2019", US_FOOT, US_FOOT),
        ("EPSG:2992+8228", "WKT1_GDAL", FOOT, FOOT),
        ("EPSG:2992+6360", "WKT2_2019", FOOT, US_FOOT),
        ("EPSG:2991+8228", "WKT2_2019", 1.0, FOOT),
        ("EPSG:2263+5703", "WKT1_GDAL", US_FOOT, 1.0),
    ],
)
def test_b03_feet_give_the_lines_of_metres(lines_of, here, scene, tmp_path, crs, form, horizontal, vertical):
    """Thresholds stay metres. Feet are stored in steps of 0.03 mm."""
    feet = (scene + PLACE) / [horizontal, horizontal, vertical]
    lines, record, _ = lines_of(cloud(tmp_path / "feet.las", feet, wkt=wkt_of(crs, form)))
    assert_same(lines, here, within_m=1e-3)
    assert {axis.unit_name for axis in pyproj.CRS(record["crs"]["wkt"]).axis_info} == {"metre"}
    (said,) = [text for text in record["warnings"] if "feet converted to metres" in text]
    assert f"(x, y times {horizontal:.10g}, z times {vertical:.10g})" in said


# B08, B09: to degrees, for KML


def test_b08_outside_the_projection(refused, lines_of, scene, tmp_path):
    far = cloud(tmp_path / "a.las", scene + np.array([2e7, 9e7, 100.0]), wkt=wkt_of(UTM))
    assert len(lines_of(far)[0]) > 0
    (tmp_path / "out" / "lines.gpkg").unlink()
    for rest in (tmp_path / "out").iterdir():
        rest.unlink()
    assert re.search(
        r"lines\.kml: PROJ knows no exact transformation from ETRS89 / UTM zone 32N \(EPSG:25832\) to degrees\. Write \.gpkg,"
        r" \.geojson or \.dxf\.$",
        refused(far, output="lines.kml"),
    )


def test_b09_only_a_ballpark_is_known(refused, scene, tmp_path):
    path = cloud(tmp_path / "a.las", scene + PLACE, wkt=wkt_of("EPSG:2345"))
    assert re.search(
        r"no exact transformation from Xian 1980 .* to degrees\.", refused(path, output="lines.kml")
    )


# B10, B11, B12: numbers


def test_b10_times_that_are_no_numbers(lines_of, scene, tmp_path):
    """Coordinates and intensities of laser files are whole numbers: only times can be none."""
    time = 3e8 + np.arange(len(scene)) * 1e-5
    time[:5], time[5:7] = np.nan, np.inf
    lines, record, _ = lines_of(cloud(tmp_path / "a.las", scene + PLACE, time=time), "--crs", "local")
    assert record["counts"]["points_rejected"] == {"impossible time": 7}
    assert record["counts"]["points_used"] == len(scene) - 7
    assert np.isfinite(lines.time_start_s).all()
    assert np.isfinite(lines.time_end_s).all()


@pytest.mark.parametrize("away", [(1e8, 0, 0), (3e6, -3e6, 0), (0, 0, 9e7)])
def test_b11_a_point_far_away(lines_of, here, scene, tmp_path, away):
    """The point comes in a file of its own, whose steps reach that far."""
    near = cloud(tmp_path / "in" / "a.las", scene + PLACE)
    cloud(tmp_path / "in" / "b.las", [PLACE, PLACE + away], scale=0.1)
    lines, record, _ = lines_of(near.parent, "--crs", "local")
    assert sum(record["counts"]["points_rejected"].values()) == 1
    assert_same(lines, here, within_m=1e-3)


@pytest.mark.parametrize("place", [(20_000_400.0, 20_000_400.0, 100.0), (-499_200.0, -4_500_000.0, 100.0)])
def test_b12_lines_move_with_the_points(lines_of, here, scene, tmp_path, place):
    """No coordinate is a 32-bit float anywhere: at 2e7 m its steps would be 2 m."""
    there = lines_of(cloud(tmp_path / "b.las", scene + place), "--crs", "local")[0]
    assert_same(there, here, np.array(place) - PLACE)


def test_b13_over_the_edge_of_a_zone(lines_of, here, scene, tmp_path):
    """East of 180 degrees in zone 60 south: eastings run on, so do the lines."""
    place = np.array([842_400.0, 8_400_000.0, 100.0])
    there = lines_of(cloud(tmp_path / "b.las", scene + place, wkt=wkt_of("EPSG:32760")))[0]
    assert_same(there, here, place - PLACE)


#: Longitudes of 180 degrees in zone 60 south, and the pole, in the middle of the scene.
ACROSS = {"EPSG:32760": (823_440.0, 8_400_000.0), "EPSG:32661": (1_999_980.0, 1_999_990.0)}


@pytest.mark.parametrize("crs", ACROSS, ids=["antimeridian", "pole"])
def test_b13_lines_over_the_antimeridian_and_the_pole(lines_of, linework, here, scene, tmp_path, crs):
    """In metres they run on; in the degrees of KML no vertex is lost, or anywhere else."""
    place = np.array([*ACROSS[crs], 100.0])
    path = cloud(tmp_path / "b.las", scene + place, wkt=wkt_of(crs))
    there = lines_of(path)[0]
    # The lattices lie otherwise than at the usual place: the same lines, not the same vertices
    assert there.kind.tolist() == here.kind.tolist()
    np.testing.assert_allclose(there.length_m, here.length_m, atol=0.5)
    kml = tmp_path / "out" / "lines.kml"
    assert linework("convert", tmp_path / "out" / "lines.gpkg", kml).code == 0
    text = re.findall(r"<coordinates>(.*?)</coordinates>", kml.read_text())
    degrees = np.array([[float(v) for v in vertex.split(",")] for line in text for vertex in line.split()])
    assert len(degrees) == len(there.xyz)
    assert (np.abs(degrees[:, 0]) <= 180).all()
    back = pyproj.Transformer.from_crs("EPSG:4326", crs, always_xy=True).transform(*degrees[:, :2].T)
    np.testing.assert_allclose(np.column_stack(back), there.xyz[:, :2], atol=0.002)
    assert np.ptp(degrees[:, 0]) > 90, "the scene lies across"


# B14: intensity


@pytest.mark.parametrize(
    ("name", "largest", "step", "said"),
    [
        ("8 bits", 255, 1, False), ("12 bits, shifted", 4095, 16, False), ("16 bits", 65535, 1, False),
        ("none", 0, 1, True), ("saturated", -65535, 1, False),
    ],
)  # fmt: skip
def test_b14_intensities_of_any_kind(lines_of, here, scene, tmp_path, name, largest, step, said):
    values = np.random.default_rng(1).integers(0, max(largest, 0) + 1, len(scene)) * step
    intensity = values if largest >= 0 else 65535
    lines, record, _ = lines_of(
        cloud(tmp_path / "a.las", scene + PLACE, intensity=intensity), "--crs", "local"
    )
    assert_same(lines, here, within_m=0.0)
    assert any("no intensity" in text for text in record["warnings"]) == said


# B15, B16: little, and degenerate


def collinear(n):
    return np.linspace(0, 30, n)[:, None] * [1.0, 0.3, 0.01]


FLAT = np.random.default_rng(2).uniform(0, [40, 8, 0], (4000, 3))


@pytest.mark.parametrize(
    "xyz",
    [
        np.zeros((1, 3)), np.array([[0, 0, 0], [0.5, 0.2, 0]]), np.array([[0, 0, 0], [900.0, 0, 0]]),
        collinear(700), FLAT, np.zeros((700, 3)), np.repeat(np.array([[0.0, 0, 0], [0, 0, 5]]), 300, axis=0),
    ],
    ids=["1 point", "2 points", "2 points far apart", "collinear", "one height", "one place", "two heights"],
)  # fmt: skip
def test_b15_little_to_find_lines_in(lines_of, tmp_path, xyz):
    path = cloud(tmp_path / "a.las", xyz + PLACE)
    lines, record, said = lines_of(path, "--crs", "local")
    assert len(lines) == 0
    assert record["counts"]["points_used"] == len(xyz)
    assert (
        said.splitlines()[-1]
        == f"warning: {tmp_path / 'out' / 'lines.gpkg'}: nothing found; its layers are empty."
    )


@pytest.mark.parametrize(
    ("vertices", "said"),
    [
        (np.zeros((0, 3)), "line 1 has 0 vertices, at least 2 make a line. Leave such lines out."),
        (np.zeros((1, 3)), "line 1 has 1 vertices, at least 2 make a line. Leave such lines out."),
        (np.ones((3, 3)), "line 1 has no length, all its 3 vertices are at one place. Leave such lines out."),
        (
            np.array([[0, 0, 0], [math.nan, 1, 1]]),
            "line 1 has a coordinate that is not finite. Leave such lines out.",
        ),
    ],
)
@pytest.mark.parametrize("suffix", [".gpkg", ".geojson", ".dxf"])
def test_b16_what_is_no_line_is_not_written(tmp_path, vertices, said, suffix):
    path = tmp_path / f"lines{suffix}"
    lines = LineSet.from_lines([np.array([[0, 0, 0], [1, 1, 1.0]]), vertices], kind=["cable", "cable"])
    with pytest.raises(UsageError) as caught:
        write_lines(lines, path)
    assert str(caught.value) == f"{path}: {said}"
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("suffix", [".gpkg", ".geojson"])
def test_b16_odd_lines_come_back_as_they_were(tmp_path, suffix):
    """Repeated vertices, a line that crosses itself, one of a hundred thousand vertices, a plumb line."""
    turn = np.linspace(0, 4 * np.pi, 100_000)
    odd = [
        np.array([[0, 0, 0], [0, 0, 0], [1, 0, 0], [1, 0, 0.0]]),
        np.array([[0, 0, 0], [2, 2, 0], [2, 0, 0], [0, 2, 0.0]]),
        np.column_stack([turn * np.cos(turn), turn * np.sin(turn), turn]),
        np.array([[5, 5, 0], [5, 5, 9.0]]),
    ]
    lines = LineSet.from_lines(odd, kind=["cable"] * 4)
    write_lines(lines, tmp_path / f"lines{suffix}")
    back = read_lines(tmp_path / f"lines{suffix}", crs="local")
    np.testing.assert_array_equal(back.xyz, lines.xyz)
    assert back.offsets.tolist() == lines.offsets.tolist()


def test_b16_a_line_of_a_million_vertices_comes_back(tmp_path):
    turn = np.linspace(0, 4 * np.pi, 1_000_000)
    spiral = np.column_stack([turn * np.cos(turn), turn * np.sin(turn), turn])
    write_lines(LineSet.from_lines([spiral], kind="cable"), tmp_path / "lines.geojson")
    back = read_lines(tmp_path / "lines.geojson", crs="local")
    np.testing.assert_array_equal(back.xyz, spiral)
