"""Every bad laser file ends in one line: the file, what is wrong with numbers, what to do."""

import io
import os
import struct

import laspy
import lazrs
import numpy as np
import pytest
from tests.oracles.las_in_memory import read_las
from tests.scenes.laser_files import copc_file, copc_info, drive_file, hierarchy, point_by_point

from linework.errors import CrsError, InputError, LineworkError
from linework.files.las.write import write_las
from linework.model.points import Points

UTM = "EPSG:25832+7837"


def sample(n=1000):
    rng = np.random.default_rng(7)
    xyz = rng.uniform(0, 50, (n, 3)) + np.array([500000, 5600000, 100])
    return Points(
        xyz, intensity=rng.integers(1, 60000, n).astype(np.float32), time_s=3e8 + np.arange(n) * 1e-4
    )


@pytest.fixture
def las(tmp_path):
    path = tmp_path / "drive.las"
    write_las(sample(), path, crs=UTM)
    return path


@pytest.fixture
def laz(tmp_path):
    path = tmp_path / "drive.laz"
    write_las(sample(), path, crs=UTM)
    return path


def patch(path, at, form, *values):
    data = bytearray(path.read_bytes())
    struct.pack_into("<" + form, data, at, *values)
    path.write_bytes(data)


def refusal(path, error=InputError, exit_code=3, crs=None):
    """The one line a user gets; its shape is the same for all."""
    with pytest.raises(error) as caught:
        read_las(path, crs=crs)
    line = str(caught.value)
    assert caught.value.exit_code == exit_code
    assert line.startswith(f"{path}: ")
    assert "\n" not in line
    assert len(line) - len(str(path)) < 300
    assert caught.value.advice, "no advice"
    assert line.endswith(".")
    return line.removeprefix(f"{path}: ")


def test_empty_file(tmp_path):
    path = tmp_path / "x.laz"
    path.touch()
    assert refusal(path) == "empty file (0 bytes). Copy the file again."


def test_missing_file(tmp_path):
    assert "No such file" in refusal(tmp_path / "x.laz")


def test_web_page_saved_as_laz(tmp_path):
    path = tmp_path / "x.laz"
    path.write_bytes(b"<!DOCTYPE html><html>404 not found</html>" * 20)
    assert "not a LAS/LAZ file" in refusal(path)


def test_cut_inside_the_header(las):
    las.write_bytes(las.read_bytes()[:200])
    assert "cut off inside the header: 200 of" in refusal(las)


def test_las_cut_at_a_record_boundary(las):
    data = las.read_bytes()
    las.write_bytes(data[: len(data) - 500 * 30])
    assert "header promises 1,000 points but the file holds 500 (cut off or damaged)" in refusal(las)


def test_las_cut_inside_a_record(las):
    data = las.read_bytes()
    las.write_bytes(data[: len(data) - 7])
    assert "promises 1,000 points but the file holds 999" in refusal(las)


@pytest.mark.parametrize("share", [0.3, 0.6, 0.9, 0.99])
def test_laz_cut(laz, share):
    data = laz.read_bytes()
    laz.write_bytes(data[: int(len(data) * share)])
    line = refusal(laz)
    assert "1,000 points" in line or "runs" in line or "should start" in line


@pytest.mark.parametrize("count", [4_000_000_000, 2**63, 2**64 - 1, 1001])
def test_too_many_points_promised(las, count):
    patch(las, 247, "Q", count)
    assert f"promises {count:,} points but the file holds 1,000" in refusal(las)


@pytest.mark.parametrize("count", [4_000_000_000, 2**63, 2**64 - 1])
def test_too_many_compressed_points_promised(laz, count):
    patch(laz, 247, "Q", count)
    assert f"promises {count:,} points" in refusal(laz)


def test_zero_points(tmp_path):
    path = tmp_path / "x.laz"
    write_las(sample(0), path, crs=UTM)
    assert "no points (0 in the header)" in refusal(path)


def test_fewer_points_promised_than_held(las):
    patch(las, 247, "Q", 900)
    content = read_las(las)
    assert len(content.points) == 900
    assert any("3,000 bytes after the last of 900 points" in w for w in content.warnings)


@pytest.mark.parametrize(
    ("at", "form", "value", "words"),
    [
        (100, "I", 4_000_000_000, "4,000,000,000 variable length records"),
        (96, "I", 4_000_000_000, "points should start at byte 4,000,000,000"),
        (96, "I", 10, "points should start at byte 10"),
        (94, "H", 0, "header says it is 0 bytes"),
        (94, "H", 65535, "header says it is 65,535 bytes"),
        (104, "B", 63, "point format 63"),
        (105, "H", 0, "point records of 0 bytes"),
        (25, "B", 9, "LAS version 1.9"),
        (243, "I", 4_000_000_000, "4,000,000,000 extended records"),
        (131, "d", 0.0, "x scale is 0"),
        (131, "d", np.nan, "x scale is nan"),
        (139, "d", np.inf, "y scale is inf"),
        (147, "d", 1e-300, "z scale is 1e-300"),
        (155, "d", np.inf, "x offset is inf"),
        (163, "d", 1e300, "y offset is 1e+300"),
        (171, "d", np.nan, "z offset is nan"),
        (155, "d", 1e12, "x offset is 1e+12"),
    ],
)
def test_header_that_cannot_be_true(las, at, form, value, words):
    patch(las, at, form, value)
    assert words in refusal(las)


def test_records_of_65535_bytes(las):
    patch(las, 105, "H", 65535)
    assert "holds 0" in refusal(las)


def laszip_record(path):
    return path.read_bytes().index(b"laszip encoded") + 52


@pytest.mark.parametrize(
    ("at", "form", "value", "words"),
    [
        (0, "H", 99, "LAZ compressor 99"),
        (32, "H", 60000, "promises 60000 items"),
        (36, "H", 65535, "items add up to 65535"),
        (38, "H", 4, "LAZ items of version 4"),
    ],
)
def test_compression_that_cannot_be_true(laz, at, form, value, words):
    patch(laz, laszip_record(laz) + at, form, value)
    assert words in refusal(laz)


def chunk_table(path):
    start = struct.unpack_from("<I", path.read_bytes(), 96)[0]
    return start, struct.unpack_from("<q", path.read_bytes(), start)[0]


@pytest.mark.parametrize("n_chunks", [0, 4_000_000_000])
def test_damaged_chunk_table_is_done_without(laz, n_chunks):
    whole = read_las(laz)
    patch(laz, chunk_table(laz)[1] + 4, "I", n_chunks)
    content = read_las(laz)
    np.testing.assert_array_equal(content.points.xyz, whole.points.xyz)
    assert any("damaged chunk table" in w for w in content.warnings)


@pytest.mark.parametrize("place", [2**62, 0])
def test_chunk_table_elsewhere(laz, place):
    patch(laz, chunk_table(laz)[0], "q", place)
    assert f"chunk table at byte {place} is missing" in refusal(laz)


def test_chunk_whose_layers_do_not_fit(tmp_path):
    path = tmp_path / "x.laz"
    write_las(sample(120_000), path, crs=UTM)
    data = bytearray(path.read_bytes())
    start, _ = chunk_table(path)
    size = 30 + 4 + sum(struct.unpack_from("<10I", data, start + 8 + 30)[1:]) + 36
    data[start + 8 + size + 34 : start + 8 + size + 70] = b"\xff" * 36
    path.write_bytes(data)
    assert "chunk 2 after 50,000 points is damaged" in refusal(path)


@pytest.mark.parametrize("seed", range(5))
def test_damaged_body_is_refused_or_accounted_for(tmp_path, seed):
    path = tmp_path / "x.laz"
    write_las(sample(20000), path, crs=UTM)
    data = bytearray(path.read_bytes())
    start, table = chunk_table(path)
    for at in np.random.default_rng(seed).integers(start + 8 + 70, table, 200):
        data[at] ^= 0x55
    path.write_bytes(data)
    try:
        content = read_las(path)
    except InputError:
        assert "points 0 to 20,000 of 20,000 cannot be decoded" in refusal(path)
    else:  # changed bits may decode: what is out of this world is left out and counted
        assert len(content.points) + sum(content.n_rejected.values()) == 20000


def test_no_crs(tmp_path):
    path = tmp_path / "x.laz"
    write_las(sample(), path, crs="local")
    assert refusal(path, CrsError) == 'the file does not state its CRS. Give crs="EPSG:..." or crs="local".'
    assert read_las(path, crs="local").crs == "local"


def with_wkt(path, wkt):
    """Rewrite a file with another CRS text."""
    with laspy.open(path) as reader:
        data = reader.read()
    data.header.vlrs.clear()
    data.header.vlrs.append(laspy.vlrs.known.WktCoordinateSystemVlr(wkt))
    data.write(path)


def test_degrees(las):
    import pyproj

    with_wkt(las, pyproj.CRS.from_epsg(4326).to_wkt("WKT1_GDAL"))
    assert "'WGS 84' is geographic (degrees)" in refusal(las, CrsError)
    refusal(las, CrsError, crs="local")


def test_crs_that_is_not_understood(las):
    with_wkt(las, 'PROJCS["broken",')
    assert "WKT is not understood" in refusal(las, CrsError)
    assert "taken from the CRS that was given" in read_las(las, crs=UTM).warnings[-1]


def test_conflicting_crs(las):
    line = refusal(las, CrsError, crs="EPSG:28992")
    assert "EPSG:25832+7837" in line
    assert "EPSG:28992" in line
    assert "two different CRSs" in refusal(las, CrsError, crs="local")


def test_another_vertical_datum_is_a_conflict(las):
    assert "EPSG:25832+5783" in refusal(las, CrsError, crs="EPSG:25832+5783")
    assert read_las(las, crs="EPSG:25832").crs == read_las(las).crs


@pytest.mark.parametrize(
    "text", ["http://127.0.0.1:1/crs", "/etc/passwd", "EPSG:999999", "x" * 70000, "", "+proj=utm"]
)
def test_texts_that_are_no_crs(las, text):
    with pytest.raises(CrsError) as caught:
        read_las(las, crs=text)
    assert str(caught.value).startswith("crs: ")
    assert len(str(caught.value)) < 300


def test_pipe_never_blocks(tmp_path):
    path = tmp_path / "pipe.laz"
    os.mkfifo(path)
    assert "is not a regular file" in refusal(path)


def test_folder_instead_of_file(tmp_path):
    assert "is not a regular file" in refusal(tmp_path)


def test_names_with_control_characters_stay_on_one_line(tmp_path):
    path = tmp_path / "a\nb\x1b[31m.laz"
    path.touch()
    with pytest.raises(LineworkError) as caught:
        read_las(path)
    assert "\n" not in str(caught.value)
    assert "\x1b" not in str(caught.value)


def test_vlr_with_bytes_that_are_no_text(las):
    data = bytearray(las.read_bytes())
    data[26:58] = b"\xff" * 32
    at = struct.unpack_from("<H", data, 94)[0]
    data[at + 22 : at + 54] = b"\xfe" * 32
    las.write_bytes(data)
    assert len(read_las(las).points) == 1000


def test_noise_and_withheld_points_are_left_out_and_counted(tmp_path):
    path = tmp_path / "x.laz"
    header = laspy.LasHeader(version="1.4", point_format=6)
    data = laspy.LasData(header)
    data.x = data.y = data.z = np.arange(10.0)
    data.classification = [1, 7, 18, 2, 2, 2, 2, 2, 2, 2]
    data.withheld = [0, 0, 0, 1, 0, 0, 0, 0, 0, 0]
    data.write(path)
    content = read_las(path, crs="local")
    assert content.n_rejected == {"noise class": 2, "withheld": 1}
    assert content.n_promised == 10
    np.testing.assert_allclose(content.points.xyz[:, 0], [0, 4, 5, 6, 7, 8, 9])


def test_noise_in_old_point_formats(tmp_path):
    path = tmp_path / "x.las"
    data = laspy.LasData(laspy.LasHeader(version="1.2", point_format=1))
    data.x = data.y = data.z = np.arange(4.0)
    data.classification = [7, 18, 2, 2]  # 18 had no meaning then
    data.withheld = [0, 0, 0, 1]
    data.write(path)
    assert read_las(path, crs="local").n_rejected == {"noise class": 1, "withheld": 1}


def test_only_noise(tmp_path):
    path = tmp_path / "x.las"
    data = laspy.LasData(laspy.LasHeader(version="1.4", point_format=6))
    data.x = data.y = data.z = np.arange(4.0)
    data.classification = [7, 7, 7, 7]
    data.write(path)
    assert "no usable points among 4 (4 noise class)" in refusal(path, crs="local")


def test_absurd_coordinates_are_rejected_and_counted(las):
    patch(las, 131, "d", 1e4)  # steps of 10 km: x reaches 2.5e8 m
    patch(las, struct.unpack_from("<I", las.read_bytes(), 96)[0], "i", 5)
    content = read_las(las)
    assert len(content.points) == 1000 - content.n_rejected["absurd coordinates"]
    assert (np.abs(content.points.xyz) < 1e8).all()


COPC_LIES = [
    (hierarchy, 24, "i", 2**31 - 1),
    (hierarchy, 24, "i", -1),
    (hierarchy, 28, "i", 2**31 - 1),
    (hierarchy, 28, "i", -5),
    (hierarchy, 28, "i", -1),
    (copc_info, 24, "d", np.nan),
    (copc_info, 32, "d", 0.0),
    (copc_info, 40, "Q", 2**60),
    (copc_info, 48, "Q", 2**63),
]


@pytest.mark.parametrize(("part", "place", "form", "value"), COPC_LIES)
def test_the_hierarchy_of_a_copc_file_is_never_followed(tmp_path, part, place, form, value):
    path = copc_file(tmp_path / "x.copc.laz")
    whole = read_las(path, crs="local")
    patch(path, part(path.read_bytes()) + place, form, value)
    content = read_las(path, crs="local")
    np.testing.assert_array_equal(content.points.xyz, whole.points.xyz)
    assert content.warnings == ()


@pytest.mark.parametrize("counts", [(100, 100, 100, 99), (100, 100, 100, 4_000_000_000), (200, 0, 100, 100)])
def test_chunks_of_own_sizes_that_are_listed_wrong(tmp_path, counts):
    """The table of a COPC file says how many points each chunk has, and so do the chunks."""
    path = copc_file(tmp_path / "x.copc.laz", n=400, n_chunks=4)
    data = path.read_bytes()
    start, table = chunk_table(path)
    record = data.index(b"laszip encoded") + 52
    vlr = lazrs.LazVlr(data[record : record + 46])
    stream = io.BytesIO(data)
    stream.seek(start)
    sizes = [size for _, size in lazrs.read_chunk_table(stream, vlr)]
    stream = io.BytesIO(data)
    stream.seek(table)
    lazrs.write_chunk_table(stream, list(zip(counts, sizes, strict=True)), vlr)
    path.write_bytes(stream.getvalue())
    assert "damaged chunk table, and chunks of different sizes" in refusal(path, crs="local")


def test_points_of_old_compressors_are_read(tmp_path):
    expected = read_las(drive_file(tmp_path / "x.las", 1), crs="local").points
    found = read_las(point_by_point(tmp_path / "x.laz"), crs="local").points
    np.testing.assert_array_equal(found.xyz, expected.xyz)
    np.testing.assert_array_equal(found.time_s, expected.time_s)


def test_records_behind_the_points_are_not_points(las):
    data = bytearray(las.read_bytes())
    struct.pack_into("<QI", data, 235, len(data), 1)
    las.write_bytes(bytes(data) + struct.pack("<H16sHQ32s", 0, b"other", 1, 8, b"") + bytes(8))
    assert read_las(las).warnings == ()
    patch(las, 247, "Q", 1001)
    assert "the file holds 1,000 before other records at byte" in refusal(las)
