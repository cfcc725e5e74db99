"""Laser files: what is written reads back, every format reads right, feet become metres."""

import struct
from dataclasses import replace

import laspy
import numpy as np
import pyproj
import pytest
from tests.oracles.las_in_memory import read_las

from linework.crs import parse_crs
from linework.errors import CrsError, UsageError
from linework.files.las.batches import _rounded_batch
from linework.files.las.header import read_las_header
from linework.files.las.write import write_las
from linework.model.points import Points

UTM = "EPSG:25832+7837"


def sample(n=3000, seed=7):
    rng = np.random.default_rng(seed)
    xyz = np.round(rng.uniform(0, 50, (n, 3)) + np.array([500000, 5600000, 100]), 3)
    return Points(
        xyz, intensity=rng.integers(1, 60000, n).astype(np.float32), time_s=3e8 + np.arange(n) * 1e-4
    )


@pytest.mark.parametrize("suffix", [".las", ".laz"])
@pytest.mark.parametrize("crs", [UTM, "local"])
def test_round_trip(tmp_path, suffix, crs):
    points, path = sample(), tmp_path / f"a{suffix}"
    write_las(points, path, crs=crs)
    content = read_las(path, crs=None if crs == UTM else crs)
    np.testing.assert_allclose(content.points.xyz, points.xyz, atol=1e-6)
    np.testing.assert_array_equal(content.points.intensity, points.intensity)
    np.testing.assert_array_equal(content.points.time_s, points.time_s)
    assert content.crs == parse_crs(crs)
    assert content.gps_time_kind == "adjusted"
    assert (content.n_promised, content.n_rejected, content.warnings) == (3000, {}, ())
    assert (content.version, content.point_format) == ("1.4", 6)


def test_reads_what_laspy_reads(tmp_path):
    path = tmp_path / "a.laz"
    write_las(sample(60000), path, crs=UTM)
    with laspy.open(path) as reader:
        expected = reader.read()
    content = read_las(path)
    np.testing.assert_array_equal(content.points.xyz, expected.xyz)
    np.testing.assert_array_equal(content.points.intensity, expected.intensity)


def test_equal_points_give_equal_bytes(tmp_path):
    for name in ("a.laz", "b.laz"):
        write_las(sample(), tmp_path / name, crs=UTM)
    assert (tmp_path / "a.laz").read_bytes() == (tmp_path / "b.laz").read_bytes()


def test_eight_bit_intensity_is_clipped(tmp_path):
    points = Points(np.zeros((3, 3)), intensity=np.array([10, 255, 4000], dtype=np.float32))
    write_las(points, tmp_path / "a.las", crs="local", intensity_bits=8)
    np.testing.assert_array_equal(read_las(tmp_path / "a.las", crs="local").points.intensity, [10, 255, 255])


def test_no_intensity_and_no_time_are_said(tmp_path):
    write_las(Points(np.zeros((3, 3))), tmp_path / "a.las", crs="local")
    content = read_las(tmp_path / "a.las", crs="local")
    assert content.points.intensity is None
    assert content.points.time_s is None
    assert content.gps_time_kind == "none"
    assert content.warnings == ("no intensity (0 for all points)", "no GPS time (0 for all points)")


#: The LAZ library writes no waveform formats (4, 5, 9, 10).
FORMATS = [(n, ".las") for n in range(11)] + [(n, ".laz") for n in (0, 1, 2, 3, 6, 7, 8)]


@pytest.mark.parametrize(("point_format", "suffix"), FORMATS)
def test_all_point_formats(tmp_path, point_format, suffix):
    path = tmp_path / f"a{suffix}"
    header = laspy.LasHeader(point_format=point_format, version="1.4" if point_format > 5 else "1.3")
    header.scales, header.offsets = [0.01, 0.02, 0.005], [100.0, -200.0, 5.0]
    header.add_extra_dim(laspy.ExtraBytesParams("depth", "f4"))
    data = laspy.LasData(header)
    data.x, data.y, data.z = np.arange(7.0) + 100, -np.arange(7.0) * 3, np.arange(7.0) / 2
    data.intensity = np.arange(7) * 100
    data.classification = [2, 2, 2, 1, 1, 5, 6]
    if "gps_time" in header.point_format.dimension_names:
        data.gps_time = np.arange(7) + 1000.5
    data.write(path)
    content = read_las(path, crs="local")
    np.testing.assert_allclose(content.points.xyz, np.stack([data.x, data.y, data.z], axis=1), atol=1e-9)
    np.testing.assert_array_equal(content.points.intensity, np.arange(7) * 100)
    assert content.n_rejected == {}
    if content.points.time_s is not None:
        np.testing.assert_array_equal(content.points.time_s, np.arange(7) + 1000.5)
        assert content.gps_time_kind == "week"


@pytest.mark.parametrize(
    ("times", "bit", "kind", "n_warnings"),
    [
        ([3.0e8, 3.1e8], True, "adjusted", 0),
        ([3.0e8, 3.1e8], False, "adjusted", 1),
        ([1000.0, 604000.0], False, "week", 0),
        ([1000.0, 604000.0], True, "week", 1),
        ([-5.0e8, -4.9e8], True, "adjusted", 0),
        ([1.3e9, 1.31e9], True, "gps", 1),
        ([3.0e17, 3.1e17], True, "none", 1),
        ([0.0, 0.0], True, "none", 1),
    ],
)
def test_time_kinds_are_told_by_their_values(tmp_path, times, bit, kind, n_warnings):
    path = tmp_path / "a.las"
    write_las(
        Points(np.zeros((2, 3)), intensity=np.ones(2, np.float32), time_s=np.array(times)), path, crs="local"
    )
    data = bytearray(path.read_bytes())
    data[6] = int(bit)
    path.write_bytes(data)
    content = read_las(path, crs="local")
    assert content.gps_time_kind == kind
    assert len(content.warnings) == n_warnings, content.warnings
    assert (content.points.time_s is None) == (kind == "none")


def test_times_that_are_not_finite_are_rejected(tmp_path):
    path = tmp_path / "a.las"
    times = np.array([3e8, np.nan, 3e8 + 1, np.inf])
    write_las(Points(np.zeros((4, 3)), intensity=np.ones(4, np.float32), time_s=times), path, crs="local")
    content = read_las(path, crs="local")
    assert content.n_rejected == {"impossible time": 2}
    np.testing.assert_array_equal(content.points.time_s, [3e8, 3e8 + 1])


US_FOOT, FOOT = 1200 / 3937, 0.3048


@pytest.mark.parametrize(
    ("crs", "horizontal", "vertical"),
    [
        ("EPSG:2225", US_FOOT, US_FOOT),
        ("EPSG:2263+6360", US_FOOT, US_FOOT),
        ("EPSG:2994", FOOT, FOOT),
        ("EPSG:2992+6360", FOOT, US_FOOT),
        ("EPSG:2991+6360", 1.0, US_FOOT),
        ("EPSG:2263+5703", US_FOOT, 1.0),
    ],
)
@pytest.mark.parametrize("form", ["WKT1_GDAL", "WKT2_2019"])
def test_feet_become_metres(tmp_path, crs, horizontal, vertical, form):
    path = tmp_path / "a.las"
    xyz = np.array([[2_000_000.0, 500_000.0, 300.0], [2_000_010.0, 500_020.0, 310.0]])
    write_las(Points(xyz), path, crs="local")
    with laspy.open(path) as reader:
        data = reader.read()
    data.header.vlrs.append(
        laspy.vlrs.known.WktCoordinateSystemVlr(pyproj.CRS.from_user_input(crs).to_wkt(form))
    )
    data.write(path)
    content = read_las(path)
    np.testing.assert_allclose(content.points.xyz, xyz * [horizontal, horizontal, vertical], atol=1e-6)
    assert any("feet converted to metres" in w for w in content.warnings)
    # The metric twin is the same place on earth
    plan = pyproj.CRS.from_wkt(content.crs)
    plan = plan.sub_crs_list[0] if plan.is_compound else plan
    own = pyproj.CRS.from_user_input(crs)
    own = own.sub_crs_list[0] if own.is_compound else own
    back = pyproj.Transformer.from_crs(plan, own, always_xy=True)
    east, north = back.transform(content.points.xyz[:, 0], content.points.xyz[:, 1])
    np.testing.assert_allclose(np.stack([east, north], axis=1), xyz[:, :2], atol=1e-6)


def geotiff_keys(path, *keys):
    """Give a file GeoTIFF keys in place of a WKT."""
    with laspy.open(path) as reader:
        data = reader.read()
    values = [1, 1, 0, len(keys)] + [v for key, value in keys for v in (key, 0, 1, value)]
    raw = struct.pack(f"<{len(values)}H", *values)
    data.header.vlrs.append(laspy.VLR("LASF_Projection", 34735, "keys", raw))
    data.write(path)


@pytest.fixture
def plain(tmp_path):
    path = tmp_path / "a.las"
    write_las(
        Points(np.array([[5e5, 5.6e6, 100.0]]), intensity=np.ones(1, np.float32), time_s=np.full(1, 3e8)),
        path,
        crs="local",
    )
    return path


def test_geotiff_keys(plain):
    geotiff_keys(plain, (1024, 1), (3072, 25832), (4096, 7837))
    assert read_las(plain).crs == parse_crs(UTM)


def test_geotiff_keys_with_an_old_vertical_code(plain):
    geotiff_keys(plain, (1024, 1), (3072, 32617), (4096, 5103))
    assert read_las(plain).crs == parse_crs("EPSG:32617+5703")


def test_geotiff_keys_with_heights_in_feet(plain):
    geotiff_keys(plain, (1024, 1), (3072, 32617), (4096, 5703), (4099, 9003))
    content = read_las(plain)
    np.testing.assert_allclose(content.points.xyz[0], [5e5, 5.6e6, 100.0 * US_FOOT])
    assert "NAVD88" in content.crs


def test_geotiff_keys_with_heights_in_feet_of_no_datum(plain):
    geotiff_keys(plain, (1024, 1), (3072, 32617), (4099, 9002))
    np.testing.assert_allclose(read_las(plain).points.xyz[0], [5e5, 5.6e6, 30.48])


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        (((1024, 2), (2048, 4326)), "EPSG:4326 is geographic"),
        (((1024, 1), (3072, 32767)), "without EPSG code"),
        (((1024, 1), (3072, 32617), (3076, 9003)), "a unit of 0.3048"),
        (((1024, 1), (3072, 1)), "EPSG:1, which PROJ does not know"),
        (((1024, 1),), "does not state its CRS"),
    ],
)
def test_geotiff_keys_that_do_not_help(plain, keys, words):
    geotiff_keys(plain, *keys)
    with pytest.raises(CrsError, match=words):
        read_las(plain)


def test_wkt_and_geotiff_keys_that_differ(tmp_path):
    path = tmp_path / "a.las"
    write_las(sample(), path, crs=UTM)
    geotiff_keys(path, (1024, 1), (3072, 25833))
    with pytest.raises(CrsError) as caught:
        read_las(path)
    assert "EPSG:25832" in str(caught.value)
    assert "EPSG:25833" in str(caught.value)


def test_crs_whose_first_axis_is_north_keeps_east_first(tmp_path):
    path = tmp_path / "a.las"
    points = Points(np.array([[500_000.0, 480_000.0, 1.0]]))
    write_las(points, path, crs="EPSG:2180")
    np.testing.assert_allclose(read_las(path).points.xyz, points.xyz)


def test_batches_are_bounded_in_bytes(tmp_path):
    write_las(sample(), tmp_path / "a.laz", crs=UTM)
    header = read_las_header(tmp_path / "a.laz")
    large = replace(header, n_points=10**9, record_bytes=60_000, laz=None)
    assert 100 < _rounded_batch(large, 500_000) * 60_000 <= 32 << 20
    assert _rounded_batch(replace(large, record_bytes=30), 500_000) == 500_000
    whole_chunks = _rounded_batch(replace(header, n_points=10**9), 500_000)
    assert whole_chunks % header.laz.chunk_size == 0
    assert 500_000 <= whole_chunks <= (32 << 20) / 30


@pytest.mark.parametrize("batch_points", [1, 999, 50_000])
def test_what_is_read_does_not_depend_on_batches(tmp_path, batch_points):
    write_las(sample(), tmp_path / "a.laz", crs=UTM)
    whole, again = read_las(tmp_path / "a.laz"), read_las(tmp_path / "a.laz", batch_points=batch_points)
    np.testing.assert_array_equal(whole.points.xyz, again.points.xyz)
    np.testing.assert_array_equal(whole.points.time_s, again.points.time_s)


def test_times_that_are_none_cost_no_points(tmp_path):
    times = np.array([0.0, np.nan, 0.0, np.inf])
    write_las(
        Points(np.zeros((4, 3)), intensity=np.ones(4, np.float32), time_s=times),
        tmp_path / "a.las",
        crs="local",
    )
    content = read_las(tmp_path / "a.las", crs="local")
    assert (len(content.points), content.n_rejected, content.points.time_s) == (4, {}, None)
    assert content.warnings == ("no GPS time (0 for all points)",)


def test_progress_counts_up_to_all(tmp_path):
    write_las(sample(), tmp_path / "a.laz", crs=UTM)
    seen = []
    read_las(tmp_path / "a.laz", progress=seen.append)
    assert seen[-1] == 3000


@pytest.mark.parametrize(
    ("xyz", "name", "words"),
    [
        (np.array([[np.nan, 0, 0]]), "a.laz", "not all finite"),
        (np.array([[0, 0, 0], [1e8, 0, 0]]), "a.laz", "reach 5e\\+07 m"),
        (np.zeros((1, 3)), "a.txt", "expected .las or .laz"),
    ],
)
def test_points_that_cannot_be_written(tmp_path, xyz, name, words):
    with pytest.raises(UsageError, match=words):
        write_las(Points(xyz), tmp_path / name, crs="local")
    assert list(tmp_path.iterdir()) == []
