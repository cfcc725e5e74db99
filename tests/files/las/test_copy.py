"""Copies of laser files with other classes: what changes, and that nothing else does."""

import struct

import laspy
import numpy as np
import pytest
from tests.scenes.laser_files import COMPRESSED_FORMATS, copc_file, drive_file

from linework.errors import InputError
from linework.files.las.columns import columns_of_las
from linework.files.las.copy import check_copy, copy_classified
from linework.files.las.header import read_las_header
from linework.methods.classes.point_class import ASPRS_CLASSES, PointClass, asprs_numbers
from linework.model.tile import LaserGains

KINDS = list(PointClass)
N = 1200


def by_turns(xyz, intensity):
    """Give the points all classes by turns, and their line the number of their class."""
    classes = (np.arange(len(xyz)) % len(KINDS)).astype(np.uint8)
    return classes, classes.astype(np.uint32) * 1000


def copied(path, target, classify=by_turns):
    return copy_classified(path, target, (1.0, 1.0), classify, lambda n: None)


def differing(one, two):
    """Return the names of the dimensions of two files that differ."""
    return [
        name
        for name in one.point_format.dimension_names
        if not np.array_equal(np.asarray(one[name]), np.asarray(two[name]))
    ]


@pytest.mark.parametrize(
    ("point_format", "suffix"),
    [*((f, ".laz") for f in COMPRESSED_FORMATS), (0, ".las"), (3, ".las"), (6, ".las"), (7, ".las")],
)
def test_only_the_class_changes_and_the_line_is_added(tmp_path, point_format, suffix):
    path, target = tmp_path / f"a{suffix}", tmp_path / f"b{suffix}"
    original = laspy.read(drive_file(path, point_format, N, user_data=np.arange(N) % 250))
    found = copied(path, target)
    copy = laspy.read(target)
    assert differing(original, copy) == ["classification"]
    turn = np.arange(N) % len(KINDS)
    assert np.array_equal(np.asarray(copy["line_number"]), turn * 1000)
    wide = np.array([ASPRS_CLASSES[kind][0] for kind in KINDS])[turn]
    assert np.array_equal(np.asarray(copy["classification"]), asprs_numbers(point_format)[turn])
    if point_format < 6:
        assert np.asarray(copy["classification"]).max() < 13
        assert np.array_equal(np.asarray(copy["road_class"]), wide)
    else:
        assert np.array_equal(np.asarray(copy["classification"]), wide)
    assert found.counts == {kind: int(np.count_nonzero(turn == kind)) for kind in KINDS}
    # The header: where points begin, how many records there are, and how long those of points are
    one, two = path.read_bytes()[:227], target.read_bytes()[:227]
    changed = {i for i in range(227) if one[i] != two[i]}
    assert changed <= {*range(96, 104), 105, 106}
    check_copy(target, N)


def test_noise_and_withheld_points_keep_their_class(tmp_path):
    for point_format in (1, 6):
        path, target = tmp_path / f"{point_format}.laz", tmp_path / f"{point_format}-copy.laz"
        classes = np.zeros(N, np.uint8)
        classes[:100] = 7
        withheld = np.zeros(N, np.uint8)
        withheld[100:150] = 1
        drive_file(path, point_format, N, classification=classes, withheld=withheld)
        found = copied(path, target)
        copy = laspy.read(target)
        assert found.n_kept == 150
        assert np.asarray(copy["classification"])[:150].tolist() == [7] * 100 + [0] * 50
        assert not np.asarray(copy["line_number"])[:150].any()
        assert np.asarray(copy["withheld"]).sum() == 50


def test_dimensions_and_records_that_are_there_stay(tmp_path):
    path, target = tmp_path / "a.laz", tmp_path / "b.laz"
    las = laspy.read(drive_file(tmp_path / "first.laz", 6, N))
    las.add_extra_dim(laspy.ExtraBytesParams("amplitude", "f4"))
    las["amplitude"] = np.arange(N)
    las.vlrs.append(laspy.VLR("maker", 7, "a record", b"\1\2\3"))
    las.evlrs = laspy.vlrs.vlrlist.VLRList([laspy.VLR("maker", 8, "behind", b"end of it")])
    las.write(path)
    copied(path, target)
    copy = laspy.read(target)
    assert differing(laspy.read(path), copy) == ["classification"]
    assert list(copy.point_format.extra_dimension_names) == ["amplitude", "line_number"]
    records = {(v.user_id, v.record_id): v.record_data_bytes() for v in copy.vlrs}
    assert records["maker", 7] == b"\1\2\3"
    assert [v.record_data_bytes() for v in copy.evlrs] == [b"end of it"]
    names = records["LASF_Spec", 0]
    assert names[64 * 16 : 65 * 16] == b"\x40Footway".ljust(16, b"\0")


def test_bytes_without_a_description_keep_their_place(tmp_path):
    path, target = tmp_path / "a.las", tmp_path / "b.las"
    data = bytearray(drive_file(path, 6, 10).read_bytes())
    start, record = struct.unpack_from("<I", data, 96)[0], struct.unpack_from("<H", data, 105)[0]
    body = b"".join(bytes(data[start + i * record : start + (i + 1) * record]) + b"\7\7\7" for i in range(10))
    struct.pack_into("<H", data, 105, record + 3)
    path.write_bytes(bytes(data[:start]) + body)
    copied(path, target)
    header = read_las_header(target)
    assert header.columns["line_number"].offset == 33
    raw = target.read_bytes()[header.point_offset :]
    assert raw[30:33] == b"\7\7\7"
    assert columns_of_las(6, 34, 30, [])  # the numbers of formats are those of the standard


def test_a_copc_file_becomes_a_laz_file_without_its_index(tmp_path):
    path, target = tmp_path / "a.copc.laz", tmp_path / "b.laz"
    copc_file(path, n=N)
    found = copied(path, target)
    assert found.left_out == ("the index of a COPC file",)
    copy = laspy.read(target)
    assert differing(laspy.read(path), copy) == ["classification"]
    assert b"copc" not in target.read_bytes()


def test_what_is_refused(tmp_path):
    path, target = drive_file(tmp_path / "a.laz", 6, N), tmp_path / "b.laz"
    copied(path, target)
    with pytest.raises(
        InputError, match=r"b\.laz: has the dimension line_number already.*Classify the original"
    ):
        copied(target, tmp_path / "c.laz")
    data = bytearray(path.read_bytes())
    path.write_bytes(data[: len(data) // 2])
    with pytest.raises(InputError, match=r"a\.laz"):
        copied(path, tmp_path / "d.laz")


def test_numbers_of_classes_are_those_of_the_standard_or_free():
    reserved = set(range(19, 64))
    numbers = [number for number, _ in ASPRS_CLASSES.values()]
    assert len(set(numbers)) == len(KINDS) == len(ASPRS_CLASSES)
    assert not reserved & set(numbers)
    assert all(len(name) <= 15 for _, name in ASPRS_CLASSES.values())


def test_points_are_classified_without_the_gains_of_their_lasers_which_the_copy_keeps(tmp_path):
    path, target = tmp_path / "a.laz", tmp_path / "b.laz"
    laser = np.arange(N) % 2
    original = laspy.read(drive_file(path, 6, N, user_data=laser))
    asked = []

    def ask(xyz, intensity):
        asked.append(intensity)
        return by_turns(xyz, intensity)

    gains = LaserGains("user_data", np.array([0.5, 2.0]))
    copy_classified(path, target, (1.0, 1.0), ask, lambda n: None, gains)
    kept = np.asarray(original.intensity, dtype=np.float32)
    assert np.array_equal(np.concatenate(asked), kept / np.where(laser == 0, 0.5, 2.0).astype(np.float32))
    assert differing(original, laspy.read(target)) == ["classification"]
