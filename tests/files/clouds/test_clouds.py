"""PLY and PCD files: the same points as of a laser file, in every encoding; damaged and odd files in one line."""

import contextlib
import struct

import numpy as np
import pytest
from tests.conftest import CRS, road_points

from linework.errors import InputError, LineworkWarning
from linework.files.clouds.lzf import unpacked_lzf
from linework.files.las.header import read_las_header
from linework.files.las.write import write_las
from linework.files.survey.open import open_survey
from linework.files.vectors.read_write import write_lines
from linework.library.read import read_points
from linework.model.lines import LineSet

PLY_TYPES = {"f4": "float", "f8": "double", "u2": "ushort", "u1": "uchar"}
PCD_TYPES = {"f4": ("F", 4), "f8": ("F", 8), "u2": ("U", 2), "u1": ("U", 1)}


def table_of(points, xyz="f8", intensity="u2"):
    """Return the points as a structured array: x, y, z, intensity, gps_time and a further column."""
    row = np.dtype([*((c, "<" + xyz) for c in "xyz"), ("intensity", "<" + intensity), ("gps_time", "<f8"), ("ring", "u1")])  # fmt: skip
    table = np.zeros(len(points), row)
    for i, c in enumerate("xyz"):
        table[c] = points.xyz[:, i]
    table["intensity"], table["gps_time"] = points.intensity, points.time_s
    table["ring"] = np.arange(len(points)) % 16
    return table


def text_of(table):
    rows = (" ".join(repr(float(v)) for v in row) for row in table.tolist())
    return ("\n".join(rows) + "\n").encode()


def ply(table, form="binary_little_endian", extra=""):
    names = "".join(f"property {PLY_TYPES[table.dtype[c].str[1:]]} {c}\n" for c in table.dtype.names)
    head = f"ply\nformat {form} 1.0\ncomment made by a test\n{extra}element vertex {len(table)}\n{names}end_header\n"
    body = {
        "ascii": lambda: text_of(table), "binary_little_endian": table.tobytes,
        "binary_big_endian": lambda: table.astype(table.dtype.newbyteorder(">")).tobytes(),
    }[form]()  # fmt: skip
    return head.encode() + body


def packed_lzf(data):
    """Return data as LZF: copies of bytes that repeat the 12 before, and runs of bytes as they are."""
    out, at = bytearray(), 0
    while at < len(data):
        n = 0
        while at >= 12 and n < 264 and at + n < len(data) and data[at + n] == data[at + n - 12]:
            n += 1
        if n >= 9:
            out += bytes([7 << 5, n - 9, 11])
            at += n
        elif n >= 3:
            out += bytes([(n - 2) << 5, 11])
            at += n
        else:
            run = data[at : at + 12]
            out += bytes([len(run) - 1]) + run
            at += len(run)
    return bytes(out)


def pcd(table, form="binary"):
    kinds = [PCD_TYPES[table.dtype[c].str[1:]] for c in table.dtype.names]
    head = (
        f"# .PCD v0.7\nVERSION 0.7\nFIELDS {' '.join(table.dtype.names)}\nSIZE {' '.join(str(s) for _, s in kinds)}\n"
        f"TYPE {' '.join(t for t, _ in kinds)}\nCOUNT {' '.join('1' for _ in kinds)}\nWIDTH {len(table)}\nHEIGHT 1\n"
        f"VIEWPOINT 0 0 0 1 0 0 0\nPOINTS {len(table)}\nDATA {form}\n"
    )
    if form == "ascii":
        return head.encode() + text_of(table)
    if form == "binary":
        return head.encode() + table.tobytes()
    block = b"".join(table[c].tobytes() for c in table.dtype.names)
    packed = packed_lzf(block)
    return head.encode() + struct.pack("<II", len(packed), len(block)) + packed


FORMS = {
    "ascii.ply": lambda t: ply(t, "ascii"), "little.ply": ply, "big.ply": lambda t: ply(t, "binary_big_endian"),
    "ascii.pcd": lambda t: pcd(t, "ascii"), "rows.pcd": pcd, "packed.pcd": lambda t: pcd(t, "binary_compressed"),
}  # fmt: skip


@pytest.mark.parametrize("name", FORMS)
def test_points_are_those_of_a_laser_file(tmp_path, name):
    points = road_points()
    write_las(points, tmp_path / "a.laz", crs=CRS)
    expected = read_points(tmp_path / "a.laz")
    exact = table_of(expected)
    (tmp_path / name).write_bytes(FORMS[name](exact))
    found = read_points(tmp_path / name, crs=CRS, carry="ring")
    order, own = np.argsort(expected.time_s), np.argsort(found.time_s)
    np.testing.assert_allclose(found.xyz[own], expected.xyz[order], atol=1e-6)
    np.testing.assert_array_equal(found.intensity[own], expected.intensity[order])
    np.testing.assert_allclose(found.time_s[own], expected.time_s[order], atol=1e-6)
    assert sorted(set(found.columns["ring"].tolist())) == list(range(16))
    assert found.crs == expected.crs


def test_header_says_what_is_there(tmp_path):
    (tmp_path / "a.pcd").write_bytes(pcd(table_of(road_points())))
    header = read_las_header(tmp_path / "a.pcd")
    assert header.n_points == 400 and header.has_time and list(header.columns) == ["ring"]


def test_intensities_between_0_and_1_are_scaled_and_that_is_stated(tmp_path):
    points = road_points()
    table = table_of(points, intensity="f4")
    table["intensity"] = np.linspace(0.0, 1.0, len(table))
    (tmp_path / "a.ply").write_bytes(ply(table))
    with pytest.warns(LineworkWarning, match="intensities from 0 to 1 are scaled"):
        found = read_points(tmp_path / "a.ply", crs=CRS)
    assert (found.intensity.min(), found.intensity.max()) == (0, 65_535)


def test_local_coordinates_may_have_32_bits(tmp_path):
    points = road_points(east_m=100.0, north_m=50.0)
    (tmp_path / "a.ply").write_bytes(ply(table_of(points, xyz="f4")))
    found = read_points(tmp_path / "a.ply", crs="local")
    assert np.sort(found.xyz[:, 0]) == pytest.approx(np.sort(points.xyz[:, 0]), abs=1e-4)


def test_beams_without_a_return_are_left_out_and_counted(tmp_path):
    table = table_of(road_points())
    table["x"][:5] = np.nan
    (tmp_path / "a.pcd").write_bytes(pcd(table))
    with pytest.warns(LineworkWarning, match=r"5 of 400 points \(1.2 %\) left out"):
        assert len(read_points(tmp_path / "a.pcd", crs=CRS)) == 395


def test_faces_after_the_points_are_passed_over(tmp_path):
    data = ply(table_of(road_points()))
    faces = b"element face 1\nproperty list uchar int vertex_indices\nend_header\n"
    (tmp_path / "a.ply").write_bytes(data.replace(b"end_header\n", faces) + b"\x03" + bytes(12))
    assert len(read_points(tmp_path / "a.ply", crs=CRS)) == 400


def test_a_folder_is_read_and_laser_files_go_first(tmp_path):
    (tmp_path / "a.ply").write_bytes(ply(table_of(road_points())))
    (tmp_path / "b.pcd").write_bytes(pcd(table_of(road_points(seed=2))))
    assert len(read_points(tmp_path, crs=CRS)) == 800
    write_las(road_points(), tmp_path / "c.laz", crs=CRS)
    (warning,) = open_survey(tmp_path).warnings
    assert "2 files of other formats (.pcd, .ply) are not read" in warning
    assert len(read_points(tmp_path)) == 400


def test_lines_are_extracted_and_described(linework, tmp_path):
    survey = tmp_path / "survey"
    survey.mkdir()
    (survey / "a.ply").write_bytes(ply(table_of(road_points())))
    found = linework("info", survey / "a.ply", "--crs", CRS)
    assert found.code == 0 and "a.ply: PLY, 400 points" in found.stdout
    found = linework(
        "extract", survey / "a.ply", "--crs", CRS, "-o", tmp_path / "a.gpkg", "--features", "cable"
    )
    assert found.code == 0, found.stderr
    found = linework("extract", survey / "a.ply", "-o", tmp_path / "b.gpkg", "--features", "cable")
    assert found.code == 3 and "--crs" in found.line


def test_copies_with_classes_are_made_of_laser_files_only(linework, tmp_path):
    survey = tmp_path / "survey"
    survey.mkdir()
    (survey / "a.ply").write_bytes(WHOLE[".ply"])
    lines = LineSet.from_lines(
        [[[500_000, 5_400_000, 100], [500_030, 5_400_000, 100]]], kind=["guardrail"], crs=CRS
    )
    write_lines(lines, tmp_path / "lines.gpkg")
    found = linework(
        "classify", survey, "--crs", CRS, "--lines", tmp_path / "lines.gpkg", "-o", tmp_path / "out"
    )
    assert found.code == 3 and "copies with classes are made of .las and .laz files only" in found.line


def changed(data, old, new):
    assert old in data
    return data.replace(old, new, 1)


TABLE = table_of(road_points())
WHOLE = {".ply": ply(TABLE), ".pcd": pcd(TABLE)}
HOSTILE = [
    (".ply", b"", "empty file"),
    (".ply", b"\x89PNG\r\n", "not a PLY file"),
    (".ply", WHOLE[".ply"][:60], "cut off inside the header"),
    (".ply", WHOLE[".ply"][:-9], "header promises 400 points but the file holds"),
    (".ply", changed(WHOLE[".ply"], b"vertex 400", b"vertex 999999999999"), "header promises 999,999,999,999 points"),
    (".ply", changed(WHOLE[".ply"], b"vertex 400", b"vertex -4"), "the number of vertex is '-4'"),
    (".ply", changed(WHOLE[".ply"], b"double y", b"double q"), "points without y"),
    (".ply", changed(WHOLE[".ply"], b"double y", b"quad y"), "unknown type 'quad'"),
    (".ply", changed(WHOLE[".ply"], b"double y", b"double x"), "two columns named x"),
    (".ply", changed(WHOLE[".ply"], b"little_endian", b"zipped"), "PLY format 'binary_zipped'"),
    (".ply", changed(WHOLE[".ply"], b"property double x", b"property list uchar int f\nproperty double x"), "lists are not read"),
    (".ply", ply(TABLE, extra="element camera 1\nproperty float f\n"), "vertices are not the first element"),
    (".ply", ply(table_of(road_points(), xyz="f4")), "as 32-bit numbers, which are 0.5 m apart: no offset"),
    (".ply", changed(ply(TABLE, "ascii"), b"\n5", b"\nfive 5"), "cannot be read"),
    (".ply", ply(TABLE[:0]), "no points"),
    (".pcd", b"", "empty file"),
    (".pcd", b"<html>\nDATA ascii\n", "not a PCD file: no line FIELDS"),
    (".pcd", WHOLE[".pcd"][:80], "cut off inside the header"),
    (".pcd", WHOLE[".pcd"][:-1], "header promises 400 points but the file holds"),
    (".pcd", changed(WHOLE[".pcd"], b"POINTS 400", b"POINTS 4e9"), "POINTS is '4e9'"),
    (".pcd", changed(WHOLE[".pcd"], b"SIZE 8 8", b"SIZE 8"), "6 fields, but 5 sizes"),
    (".pcd", changed(WHOLE[".pcd"], b"SIZE 8 8", b"SIZE 8 3"), "field y of type F and 3 bytes"),
    (".pcd", changed(WHOLE[".pcd"], b"COUNT 1", b"COUNT 99999"), "field x of 99,999 values"),
    (".pcd", changed(WHOLE[".pcd"], b"DATA binary", b"DATA zip"), "PCD data 'zip'"),
    (".pcd", pcd(TABLE, "binary_compressed")[:-40], "compressed bytes"),
    (".pcd", changed(pcd(TABLE, "binary_compressed"), b"POINTS 400", b"POINTS 401"), "bytes for 401 points"),
    (".pcd", pcd(table_of(road_points(), xyz="f4")), "as 32-bit numbers, which are 0.5 m apart: no offset"),
    (".pcd", pcd(TABLE, "ascii")[:-60], "cannot be read"),
]  # fmt: skip


@pytest.mark.parametrize(("suffix", "data", "words"), HOSTILE, ids=[f"{s[1:]} {w}" for s, _, w in HOSTILE])
def test_odd_and_damaged_files_are_one_line(linework, tmp_path, suffix, data, words):
    survey = tmp_path / "survey"
    survey.mkdir()
    path = survey / f"a{suffix}"
    path.write_bytes(data)
    found = linework("extract", path, "--crs", CRS, "-o", tmp_path / "a.gpkg", "--features", "cable")
    assert found.code == 3, found.stderr
    assert str(path) in found.line and words in found.line
    assert not (tmp_path / "a.gpkg").exists() and not (tmp_path / "run.json").exists()


def test_a_damaged_file_among_good_ones_is_left_out(linework, tmp_path):
    survey = tmp_path / "survey"
    survey.mkdir()
    (survey / "a.ply").write_bytes(WHOLE[".ply"])
    (survey / "b.ply").write_bytes(WHOLE[".ply"][:-9])
    found = linework("extract", survey, "--crs", CRS, "-o", tmp_path / "a.gpkg", "--features", "cable")
    assert found.code == 4 and "b.ply" in found.line


@pytest.mark.parametrize("data", [b"\x20", b"\xe0", b"\xe0\x01", b"\x80\x05", b"\x02ab", b"\x02abc\x20\x09"])
def test_damaged_lzf_is_an_error_and_never_more_than_was_promised(data):
    with pytest.raises(ValueError, match=r"bytes instead|before the start"):
        unpacked_lzf(data, 20)


def test_lzf_with_any_byte_changed_never_grows():
    block = TABLE["x"].tobytes()[:600]
    packed = packed_lzf(block)
    assert unpacked_lzf(packed, len(block)) == block
    rng = np.random.default_rng(4)
    for _ in range(300):
        wrong = bytearray(packed)
        wrong[rng.integers(len(wrong))] = rng.integers(256)
        with contextlib.suppress(ValueError):
            assert len(unpacked_lzf(bytes(wrong), len(block))) == len(block)


def test_unknown_suffixes_name_those_that_are_read(tmp_path):
    (tmp_path / "a.xyz").write_text("1 2 3")
    with pytest.raises(InputError, match=r"expected \.las, \.laz, \.ply, \.pcd, \.e57 or survey\.toml"):
        read_points(tmp_path / "a.xyz")


def test_one_bright_point_does_not_darken_its_file(tmp_path):
    found = []
    for name, bright in (("a", 0.9), ("b", 6.0)):
        table = table_of(road_points(), intensity="f4")
        table["intensity"] = 0.3
        table["intensity"][0] = bright
        path = tmp_path / f"{name}.ply"
        path.write_bytes(ply(table))
        with pytest.warns(LineworkWarning, match="intensities from 0 to 1 are scaled"):
            found.append(np.median(read_points(path, crs=CRS).intensity))
    assert found[0] == found[1] == pytest.approx(0.3 * 65_535, abs=1.0)


@pytest.mark.parametrize(
    ("rows", "problem"),
    [
        ("1 2 3 4\n5 6\n", "4 values in a line of 3"),
        ("1 2 3\n" + "4 " * 40_000, "a line of more than 65,536"),
    ],
)
def test_text_has_one_line_per_point(tmp_path, rows, problem):
    path = tmp_path / "a.ply"
    names = "".join(f"property double {c}\n" for c in "xyz")
    path.write_text(f"ply\nformat ascii 1.0\nelement vertex 2\n{names}end_header\n{rows}")
    with pytest.raises(InputError, match=problem):
        read_points(path, crs=CRS)


def test_only_32_bit_coordinates_are_judged(tmp_path):
    row = np.dtype([("x", "<f8"), ("y", "<f8"), ("z", "<f4")])
    table = np.array([(500_000.25, 5_000_000.5, 30.0), (500_001.25, 5_000_001.5, 31.0)], row)
    (tmp_path / "a.ply").write_bytes(ply(table))
    with pytest.warns(LineworkWarning, match="no intensity"):
        found = read_points(tmp_path / "a.ply", crs=CRS)
    assert sorted(found.xyz[:, 2].tolist()) == [30.0, 31.0]


def test_a_number_without_end_is_one_line(tmp_path):
    path = tmp_path / "a.ply"
    path.write_text("ply\nformat ascii 1.0\nelement vertex " + "9" * 5_000 + "\nend_header\n")
    with pytest.raises(InputError, match="expected a whole number"):
        read_points(path, crs=CRS)
