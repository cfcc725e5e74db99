"""E57 files: the same points as of a laser file, with poses and flags; damaged and odd files in one line."""

import math
import struct
import sys

import numpy as np
import pytest
from pye57 import libe57
from scipy.spatial import cKDTree
from tests.conftest import CRS, road_points

from linework.errors import InputError, LineworkWarning
from linework.files.las.header import read_las_header
from linework.files.las.write import write_las
from linework.library.read import read_points

QUARTER_TURN = (math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5))
ORIGIN = np.array([500_000.0, 5_400_000.0, 100.0])


def structure(file, values):
    node = libe57.StructureNode(file)
    for name, value in values.items():
        node.set(name, structure(file, value) if isinstance(value, dict) else value)
    return node


def numbers(file, names, values):
    return {name: libe57.FloatNode(file, float(v)) for name, v in zip(names, values, strict=True)}


def write_e57(path, scans, coordinates=""):
    """Write scans: (columns, further), where further may hold pose, limits, start, kinds of fields."""
    file = libe57.ImageFile(str(path), "w")
    file.extensionsAdd("", libe57.E57_V1_0_URI)
    file.extensionsAdd("x", "http://example.org/x")
    root = file.root()
    root.set("formatName", libe57.StringNode(file, "ASTM E57 3D Imaging Data File"))
    root.set("guid", libe57.StringNode(file, "{a}"))
    root.set("versionMajor", libe57.IntegerNode(file, 1))
    root.set("versionMinor", libe57.IntegerNode(file, 0))
    root.set("coordinateMetadata", libe57.StringNode(file, coordinates))
    data3d = libe57.VectorNode(file, True)
    root.set("data3D", data3d)
    for columns, further in scans:
        scan = libe57.StructureNode(file)
        scan.set("guid", libe57.StringNode(file, "{b}"))
        if "pose" in further:
            rotation, translation = further["pose"]
            parts = {
                "rotation": numbers(file, "wxyz", rotation),
                "translation": numbers(file, "xyz", translation),
            }
            scan.set("pose", structure(file, parts))
        if "limits" in further:
            names = ("intensityMinimum", "intensityMaximum")
            scan.set("intensityLimits", structure(file, numbers(file, names, further["limits"])))
        if "start" in further:
            scan.set(
                "acquisitionStart", structure(file, numbers(file, ["dateTimeValue"], [further["start"]]))
            )
        prototype, buffers = libe57.StructureNode(file), libe57.VectorSourceDestBuffer()
        arrays = {name: np.array(values, np.float64) for name, values in columns.items()}
        for name, array in arrays.items():
            prototype.set(name, further.get("kinds", {}).get(name, libe57.FloatNode)(file))
            buffers.append(libe57.SourceDestBuffer(file, name, array, max(len(array), 1), True, True))
        points = libe57.CompressedVectorNode(file, prototype, libe57.VectorNode(file, True))
        scan.set("points", points)
        data3d.append(scan)
        writer = points.writer(buffers)
        if len(array):
            writer.write(len(array))
        writer.close()
    file.close()
    return path


def columns_of(points, origin=ORIGIN, **more):
    local = points.xyz - origin
    return (
        {f"cartesian{c}": local[:, i] for i, c in enumerate("XYZ")} | {"intensity": points.intensity} | more
    )


def single(file):
    return libe57.FloatNode(file, 0.0, libe57.E57_SINGLE)


def millimetres(file):
    return libe57.ScaledIntegerNode(file, 0, -(2**30), 2**30, 0.001, 0.0)


def flag(file):
    return libe57.IntegerNode(file, 0, 0, 2)


POSE = {"pose": ((1, 0, 0, 0), ORIGIN)}


def check_places(found, expected):
    """The store rounds to 0.1 mm, and has an order of its own."""
    assert len(found) == len(expected)
    away, nearest = cKDTree(expected).query(found.xyz)
    assert away.max() < 2e-4 and len(set(nearest.tolist())) == len(expected)


@pytest.mark.parametrize("kind", [libe57.FloatNode, single, millimetres])
def test_points_are_those_of_a_laser_file(tmp_path, kind):
    points = road_points()
    write_las(points, tmp_path / "a.laz", crs=CRS)
    expected = read_points(tmp_path / "a.laz")
    kinds = {f"cartesian{c}": kind for c in "XYZ"}
    columns = columns_of(expected, timeStamp=expected.time_s - 1e9)
    write_e57(tmp_path / "a.e57", [(columns, {**POSE, "kinds": kinds, "start": 1e9, "limits": (0, 65_535)})])
    found = read_points(tmp_path / "a.e57", crs=CRS)
    own, order = np.argsort(found.time_s), np.argsort(expected.time_s)
    np.testing.assert_allclose(found.time_s[own], expected.time_s[order], atol=1e-6)
    atol = {libe57.FloatNode: 1e-8, single: 1e-5, millimetres: 5.01e-4}[kind]
    np.testing.assert_allclose(found.xyz[own], expected.xyz[order], atol=atol, rtol=0)
    np.testing.assert_array_equal(found.intensity[own], expected.intensity[order])


def test_each_scan_has_its_pose_and_its_number(tmp_path):
    points = road_points()
    first, second = points.xyz[:100], points.xyz[100:]
    position = ORIGIN + np.array([7.0, -3.0, 2.0])
    away = second - position
    turned = np.stack([away[:, 1], -away[:, 0], away[:, 2]], axis=1)  # by a quarter, backwards
    write_e57(tmp_path / "a.e57", [
        ({f"cartesian{c}": (first - ORIGIN)[:, i] for i, c in enumerate("XYZ")}, POSE),
        ({f"cartesian{c}": [] for c in "XYZ"}, POSE),
        ({f"cartesian{c}": turned[:, i] for i, c in enumerate("XYZ")}, {"pose": (QUARTER_TURN, position)}),
    ])  # fmt: skip
    with pytest.warns(LineworkWarning, match="no intensity"):
        found = read_points(tmp_path / "a.e57", crs=CRS, carry="point_source_id")
    check_places(found, points.xyz)
    source = found.columns["point_source_id"]
    assert [int((source == k).sum()) for k in (1, 2, 3)] == [100, 0, 300]


def test_spherical_coordinates(tmp_path):
    points = road_points()
    x, y, z = (points.xyz - ORIGIN + (0.5, 0.5, 3.0)).T
    columns = {
        "sphericalRange": np.sqrt(x * x + y * y + z * z), "sphericalAzimuth": np.arctan2(y, x),
        "sphericalElevation": np.arctan2(z, np.hypot(x, y)), "sphericalInvalidState": np.arange(400) % 4 == 1,
    }  # fmt: skip
    further = {"pose": ((1, 0, 0, 0), ORIGIN - (0.5, 0.5, 3.0)), "kinds": {"sphericalInvalidState": flag}}
    write_e57(tmp_path / "a.e57", [(columns, further)])
    with pytest.warns(LineworkWarning, match="no intensity"):
        found = read_points(tmp_path / "a.e57", crs=CRS)
    check_places(found, points.xyz[np.arange(400) % 4 != 1])


def test_flagged_points_and_places_without_numbers_are_left_out(tmp_path):
    columns = columns_of(
        road_points(), cartesianInvalidState=np.arange(400) % 5, isIntensityInvalid=np.ones(400)
    )
    columns["cartesianInvalidState"][columns["cartesianInvalidState"] > 2] = 0
    columns["cartesianX"][::5] = np.nan
    kinds = {"cartesianInvalidState": flag, "isIntensityInvalid": flag}
    write_e57(tmp_path / "a.e57", [(columns, {**POSE, "kinds": kinds})])
    with pytest.warns(LineworkWarning) as warned:
        found = read_points(tmp_path / "a.e57", crs=CRS)
    texts = " ".join(str(one.message) for one in warned)
    assert "no intensity" in texts and "80 absurd coordinates, 160 without a return" in texts
    assert len(found) == 160 and found.intensity is None


@pytest.mark.parametrize(
    ("low", "high", "expected"), [(0.0, 1.0, (0, 65_535)), (0.0, 255.0, (0, 255)), (-20.0, 0.0, (0, 65_535))]
)
@pytest.mark.parametrize("is_stated", [True, False])
def test_intensities_are_brought_to_those_of_laser_files(tmp_path, low, high, expected, is_stated):
    columns = columns_of(road_points())
    columns["intensity"] = np.linspace(low, high, 400)
    further = {**POSE, "limits": (low, high)} if is_stated else POSE
    write_e57(tmp_path / "a.e57", [(columns, further)])
    found = read_points(tmp_path / "a.e57", crs=CRS)
    assert (found.intensity.min(), found.intensity.max()) == expected


def integers(file):
    return libe57.IntegerNode(file, 0, 0, 2**31 - 1)


@pytest.mark.parametrize(
    "further",
    [
        {"kinds": {"intensity": integers}}, {"limits": (0, 2.0**32 - 1)}, {"limits": (-2048, 2.0**24)},
        {"limits": (-3.4e38, 3.4e38)},
    ],
)  # fmt: skip
def test_limits_of_a_type_of_numbers_are_not_those_of_intensities(tmp_path, further):
    columns = columns_of(road_points())
    columns["intensity"] = np.linspace(0, 4095, 400).round()
    write_e57(tmp_path / "a.e57", [(columns, {**POSE, **further})])
    found = read_points(tmp_path / "a.e57", crs=CRS)
    np.testing.assert_array_equal(np.sort(found.intensity), columns["intensity"])


def test_flagged_points_do_not_count_for_the_range_of_intensities(tmp_path):
    columns = columns_of(road_points(), cartesianInvalidState=np.zeros(400), isIntensityInvalid=np.zeros(400))
    columns["intensity"] = np.linspace(0.0, 1.0, 400)
    columns["isIntensityInvalid"][7], columns["intensity"][7] = 1, -1e10
    columns["cartesianInvalidState"][9], columns["intensity"][9] = 1, 1e9
    kinds = {"cartesianInvalidState": flag, "isIntensityInvalid": flag}
    without = {name: values for name, values in columns.items() if not name.startswith("intensity")}
    for scans in ([columns], [columns, without]):
        write_e57(tmp_path / "a.e57", [(scan, {**POSE, "kinds": kinds}) for scan in scans])
        found = read_points(tmp_path / "a.e57", crs=CRS)
        used = np.delete(columns["intensity"], [7, 9])
        expected = np.rint(np.concatenate([used * 65_535, np.zeros(1 + 399 * (len(scans) - 1))]))
        np.testing.assert_array_equal(np.sort(found.intensity), np.sort(expected))


def test_coordinates_of_flagged_points_are_not_checked(tmp_path):
    points = road_points()
    columns = columns_of(points, cartesianInvalidState=np.arange(400) % 40 == 0)
    columns["cartesianX"][::40] = 99_999.0
    kinds = {f"cartesian{c}": single for c in "XYZ"} | {"cartesianInvalidState": flag}
    write_e57(tmp_path / "a.e57", [(columns, {**POSE, "kinds": kinds})])
    check_places(read_points(tmp_path / "a.e57", crs=CRS), points.xyz[np.arange(400) % 40 != 0])
    del columns["cartesianInvalidState"]
    write_e57(tmp_path / "b.e57", [(columns, {**POSE, "kinds": kinds})])
    with pytest.raises(InputError, match="up to 99,999 m as 32-bit numbers"):
        read_points(tmp_path / "b.e57", crs=CRS)


def test_time_stamps_of_several_scans_need_the_start_of_each(tmp_path):
    points = road_points()
    stamped = columns_of(points, timeStamp=points.time_s)
    later = {**stamped, "timeStamp": points.time_s - 1e9}
    write_e57(tmp_path / "a.e57", [(stamped, POSE)])
    assert np.array_equal(np.sort(read_points(tmp_path / "a.e57", crs=CRS).time_s), np.sort(points.time_s))
    aside = {"pose": ((1, 0, 0, 0), np.add(ORIGIN, (0.0, 50.0, 0.0)))}
    write_e57(tmp_path / "b.e57", [(stamped, {**POSE, "start": 0.0}), (later, {**aside, "start": 1e9})])
    twice = np.sort(np.concatenate([points.time_s, points.time_s]))
    np.testing.assert_allclose(np.sort(read_points(tmp_path / "b.e57", crs=CRS).time_s), twice, atol=1e-6)
    write_e57(tmp_path / "c.e57", [(stamped, POSE), (later, {**aside, "start": 1e9})])
    with pytest.warns(LineworkWarning, match="do not state their start"):
        found = read_points(tmp_path / "c.e57", crs=CRS)
    assert found.time_s is None and len(found) == 800


@pytest.mark.parametrize("has_own", [True, False])
def test_fields_of_extensions_are_left_out(tmp_path, has_own):
    columns = columns_of(road_points()) | {"x:intensity": np.full(400, 9.0)}
    expected = np.sort(columns["intensity"])
    if not has_own:
        del columns["intensity"]
    write_e57(tmp_path / "a.e57", [(columns, POSE)])
    if has_own:
        assert np.array_equal(np.sort(read_points(tmp_path / "a.e57", crs=CRS).intensity), expected)
    else:
        with pytest.warns(LineworkWarning, match="no intensity"):
            assert len(read_points(tmp_path / "a.e57", crs=CRS)) == 400


def test_fields_are_compared_once_for_all_scans(tmp_path, monkeypatch):
    from linework.files.clouds import e57_points

    calls = []
    compare = e57_points.e57_columns
    monkeypatch.setattr(e57_points, "e57_columns", lambda scans: calls.append(1) or compare(scans))
    counts = []
    for n in (1, 6):
        scan = columns_of(road_points()), {**POSE, "limits": (0, 65_535)}
        path = write_e57(tmp_path / f"{n}.e57", [scan] * n)
        calls.clear()
        batches = e57_points.read_e57_batches(
            path, read_las_header(path), factors=(1.0, 1.0), carry=(), batch_points=1000
        )
        assert sum(len(batch.xyz) for batch in batches) == 400 * n
        counts.append(len(calls))
    assert counts[0] == counts[1] > 0


def test_batches_do_not_change_what_is_read(tmp_path):
    from linework.files.clouds.e57_points import read_e57_batches

    scan = columns_of(road_points()), {"pose": (QUARTER_TURN, ORIGIN)}
    path = write_e57(tmp_path / "a.e57", [scan, scan])
    header = read_las_header(path)
    found = []
    for n in (7, 100_000):
        batches = read_e57_batches(path, header, factors=(1.0, 1.0), carry=(), batch_points=n)
        found.append(np.concatenate([batch.xyz.copy() for batch in batches]))
    assert found[0].tobytes() == found[1].tobytes() and len(found[0]) == 800


def test_the_crs_is_taken_from_the_file(linework, tmp_path):
    import pyproj

    survey = tmp_path / "survey"
    survey.mkdir()
    scan = columns_of(road_points()), POSE
    path = write_e57(survey / "a.e57", [scan, scan], pyproj.CRS("EPSG:25832").to_wkt("WKT1_GDAL"))
    found = linework("info", path)
    assert found.code == 0 and "a.e57: E57, 800 points" in found.stdout and "EPSG:25832" in found.stdout
    found = linework("extract", path, "-o", tmp_path / "a.gpkg", "--features", "cable")
    assert found.code == 0, found.stderr
    found = linework("extract", path, "--crs", "EPSG:25833", "-o", tmp_path / "b.gpkg", "--features", "cable")
    assert found.code == 3 and "two different CRSs" in found.line


def test_without_the_library_the_line_names_the_extra(tmp_path, monkeypatch):
    path = write_e57(tmp_path / "a.e57", [(columns_of(road_points()), POSE)])
    monkeypatch.setitem(sys.modules, "pye57", None)
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(Exception, match=r"a\.e57: needs the package pye57.*linework\[e57\]"):
        read_points(path, crs=CRS)


def with_sums(data):
    """Return the pages of a file with checksums that fit: CRC-32C, most significant byte first."""
    table = []
    for k in range(256):
        for _ in range(8):
            k = k >> 1 ^ (0x82F63B78 if k & 1 else 0)
        table.append(k)
    pages = []
    for at in range(0, len(data), 1024):
        page, crc = data[at : at + 1020], 0xFFFFFFFF
        for byte in page:
            crc = crc >> 8 ^ table[(crc ^ byte) & 255]
        pages.append(page + struct.pack(">I", crc ^ 0xFFFFFFFF))
    return b"".join(pages)


def xml_changed(old, new):
    """Return a change of the description of a file: text of the same length, or padded by it."""

    def change(data):
        start, length = struct.unpack_from("<QQ", data, 24)
        logical = b"".join(data[at : at + 1020] for at in range(0, len(data), 1024))
        at = start // 1024 * 1020 + start % 1024
        text = logical[at : at + length]
        assert old in text
        text = text.replace(old, new)
        body = logical[:at] + text
        body += bytes(-len(body) % 1020)
        data = b"".join(body[k : k + 1020] + bytes(4) for k in range(0, len(body), 1020))
        head = data[:16] + struct.pack("<QQQ", len(data), start, len(text)) + data[40:]
        return with_sums(head)

    return change


def byte_changed(at):
    return lambda data: data[:at] + bytes([data[at] ^ 0x55]) + data[at + 1 :]


DAMAGES = [
    ("empty file", lambda data: b""),
    ("not an E57 file", lambda data: b"PK\x03\x04" + data[4:]),
    ("cut off inside the header", lambda data: data[:30]),
    ("cut off or damaged", lambda data: data[:-1024]),
    ("cut off or damaged", lambda data: data + bytes(1024)),
    ("E57 version 2", lambda data: data[:8] + struct.pack("<I", 2) + data[12:]),
    ("pages of 0 bytes", lambda data: data[:40] + bytes(8) + data[48:]),
    ("its description should be", lambda data: data[:24] + struct.pack("<Q", 1 << 60) + data[32:]),
    ("its description should be", lambda data: data[:32] + struct.pack("<Q", 1 << 60) + data[40:]),
    ("cannot be read", byte_changed(1030)),
    ("cannot be read", byte_changed(3000)),
    ("its description is not XML", xml_changed(b"</data3D>", b"</data3Q>")),
    ("declares a document type", xml_changed(b"<e57Root", b'<!DOCTYPE e57Root [<!ENTITY a SYSTEM "file:///etc/passwd">]><e57Root')),
    ("another encoding than UTF-8", xml_changed(b'encoding="UTF-8"', b'encoding="UTF-7"')),
    ("promises 999,999,999,999 points but", xml_changed(b'recordCount="400"', b'recordCount="999999999999"')),
    ("the number of points is '-4'", xml_changed(b'recordCount="400"', b'recordCount="-4"')),
    ("", xml_changed(b'recordCount="400"', b'recordCount="500"')),
    ("points without coordinates (fields: cartesianX, cartesianQ", xml_changed(b"cartesianY", b"cartesianQ")),
    ("two fields named cartesianX", xml_changed(b"cartesianY", b"cartesianX")),
    ("no points element", xml_changed(b"prototype", b"grototype")),
    ("no points", xml_changed(b'recordCount="400"', b'recordCount="0"')),
    ("pose/translation is not 3 numbers", xml_changed(b"<x type=\"Float\">5", b"<x type=\"Float\">nan5")),
    ("a quaternion of length 0 is not a rotation", xml_changed(b'<w type="Float">1<', b'<w type="Float">0<')),
    ("", xml_changed(b'fileOffset="48"', b'fileOffset="999999"')),
    ("more than 524,288 tags", xml_changed(b"</e57Root>", b"<a/>" * 524_288 + b"</e57Root>")),
    ("more than 524,288 tags or attributes", xml_changed(b"</e57Root>", b"<a" + b" b=''" * 524_288 + b"/></e57Root>")),
    ("", xml_changed(b'fileOffset="48"', b'fileOffset="0"')),
]  # fmt: skip


@pytest.mark.parametrize(("words", "damage"), DAMAGES, ids=[f"{i} {w}" for i, (w, _) in enumerate(DAMAGES)])
def test_odd_and_damaged_files_are_one_line(linework, tmp_path, words, damage):
    survey = tmp_path / "survey"
    survey.mkdir()
    path = write_e57(survey / "a.e57", [(columns_of(road_points()), POSE)])
    path.write_bytes(damage(path.read_bytes()))
    found = linework("extract", path, "--crs", CRS, "-o", tmp_path / "a.gpkg", "--features", "cable")
    assert found.code == 3, found.stderr
    assert str(path) in found.line and words in found.line
    assert not (tmp_path / "a.gpkg").exists() and not (tmp_path / "run.json").exists()


def test_files_made_anew_by_the_test_are_read(tmp_path):
    path = write_e57(tmp_path / "a.e57", [(columns_of(road_points()), POSE)])
    path.write_bytes(xml_changed(b"{b}", b"{c}")(path.read_bytes()))
    assert len(read_points(path, crs=CRS)) == 400


def test_coordinates_of_32_bits_without_an_offset_are_refused(tmp_path):
    kinds = {f"cartesian{c}": single for c in "XYZ"}
    write_e57(tmp_path / "a.e57", [(columns_of(road_points(), origin=0.0), {"kinds": kinds})])
    with pytest.raises(InputError, match=r"as 32-bit numbers, which are 0\.5 m apart: no offset"):
        read_points(tmp_path / "a.e57", crs=CRS)


def test_any_byte_changed_is_an_error_or_the_right_points(tmp_path):
    path = write_e57(tmp_path / "a.e57", [(columns_of(road_points()), POSE)])
    data, expected = path.read_bytes(), read_points(path, crs=CRS).xyz
    rng = np.random.default_rng(7)
    for at in rng.integers(len(data), size=12).tolist():
        path.write_bytes(byte_changed(at)(data))
        try:
            found = read_points(path, crs=CRS)
        except InputError:
            continue
        check_places(found, expected)
