"""Further columns of laser files: through the decoder and the tile store, as laspy reads them."""

import laspy
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.oracles.store_twin import steps_of
from tests.scenes.effort import examples
from tests.scenes.places import REAL

from linework.errors import InputError, UsageError
from linework.files.las.columns import columns_of_las
from linework.files.las.decoder import DecoderLimits
from linework.files.las.header import RECORD_BYTES, read_las_header
from linework.files.store.build import build_store
from linework.files.store.in_memory import read_survey_points
from linework.files.store.read import PointStore
from linework.files.survey.open import open_survey
from linework.model.grid import Bounds, Grid, Image

#: Extra dimensions of every type, some of them scaled.
EXTRA = [
    laspy.ExtraBytesParams("label", "u1", "classes"),
    laspy.ExtraBytesParams("tilt", "i2", "scaled", scales=np.array([0.01]), offsets=np.array([-5.0])),
    laspy.ExtraBytesParams("p_paint", "f4"),
    laspy.ExtraBytesParams("range", "f8"),
    laspy.ExtraBytesParams("signed", "i1"),
    laspy.ExtraBytesParams("wide", "u4", scales=np.array([1e-4]), offsets=np.array([1000.0])),
    laspy.ExtraBytesParams("long", "i8"),
    laspy.ExtraBytesParams("counts", "u8"),
    laspy.ExtraBytesParams("small", "u2"),
    laspy.ExtraBytesParams("deep", "i4"),
]
SCALARS = tuple(sorted(dimension.name for dimension in EXTRA))
STANDARD = (
    "classification", "edge_of_flight_line", "number_of_returns", "point_source_id", "return_number", "scan_angle",
    "scan_direction_flag", "user_data",
)  # fmt: skip
COLOURS = ("blue", "green", "red")


def written(path, *, version="1.4", point_format=7, n=1200, seed=1, extra=EXTRA, first_s=3e8):
    """Write a file with laspy, and return it as laspy reads it."""
    rng = np.random.default_rng(seed)
    header = laspy.LasHeader(version=version, point_format=point_format)
    header.scales, header.offsets = np.full(3, 0.001), np.array([500_000.0, 5_400_000.0, 100.0])
    header.global_encoding.gps_time_type = laspy.header.GpsTimeType.STANDARD
    header.add_extra_dims(list(extra))
    data = laspy.LasData(header)
    xyz = np.round(rng.uniform(0, 150, (n, 3)), 3) + header.offsets
    data.x, data.y, data.z = xyz.T
    data.intensity = rng.integers(1, 4000, n)
    data.gps_time = first_s + np.arange(n) * 0.01
    for dimension in extra:
        kind = np.dtype(dimension.type)
        if dimension.scales is not None:
            data[dimension.name] = rng.uniform(0, 100, n) + dimension.offsets
        elif kind.kind == "f":
            data[dimension.name] = rng.normal(size=n)
        else:
            data[dimension.name] = rng.integers(np.iinfo(kind).min // 2, np.iinfo(kind).max // 2, n).astype(
                kind
            )
    data.classification = rng.integers(8, 16, n)
    data.return_number, data.number_of_returns = rng.integers(1, 4, n), rng.integers(3, 6, n)
    data.user_data, data.point_source_id = rng.integers(0, 256, n), rng.integers(0, 65536, n)
    data.scan_direction_flag, data.edge_of_flight_line = rng.integers(0, 2, (2, n))
    if point_format >= 6:
        data.scan_angle = rng.integers(-30_000, 30_000, n)
        data.scanner_channel = rng.integers(0, 4, n)
    else:
        data.scan_angle_rank = rng.integers(-90, 90, n)
    if hasattr(data, "red"):
        for name in COLOURS:
            data[name] = rng.integers(0, 65536, n)
    data.write(path)
    return laspy.read(path)


def expected(data, name):
    """Return a column as laspy has it, float32."""
    if name == "scan_angle":
        if data.header.point_format.id < 6:
            return np.asarray(data.scan_angle_rank, np.float32)
        return (np.asarray(data.scan_angle, np.float64) * 0.006).astype(np.float32)
    return np.asarray(data[name], np.float64).astype(np.float32)


def by_time(points, *names):
    order = np.argsort(points.time_s)
    return [points[name][order] for name in names]


@pytest.mark.parametrize(
    ("name", "version", "point_format"),
    [("a.las", "1.2", 1), ("a.laz", "1.2", 3), ("a.las", "1.4", 6), ("a.laz", "1.4", 7), ("a.laz", "1.3", 3)],
)
def test_every_type_reads_as_laspy_reads_it(tmp_path, name, version, point_format):
    data = written(tmp_path / name, version=version, point_format=point_format)
    channel = ("scanner_channel",) if point_format >= 6 else ()
    names = (*SCALARS, *STANDARD, *channel, *(COLOURS if hasattr(data, "red") else ()))
    survey = open_survey([tmp_path / name], crs="EPSG:25832", carry=names)
    points = read_survey_points(survey).points
    assert tuple(points.columns) == tuple(sorted(names)) == survey.carry
    for name, column in zip(names, by_time(points, *names), strict=True):
        assert column.dtype == np.float32
        np.testing.assert_array_equal(column, expected(data, name), err_msg=name)


def test_one_column_of_many_is_read_alone(tmp_path):
    data = written(tmp_path / "a.laz")
    points = read_survey_points(open_survey([tmp_path / "a.laz"], crs="local", carry="deep")).points
    assert tuple(points.columns) == ("deep",)
    np.testing.assert_array_equal(by_time(points, "deep")[0], expected(data, "deep"))


def test_batches_files_tiles_limits_and_heights(tmp_path):
    """A column stays with its points: through batches, files, strays, rectangles and lowest heights."""
    files = [written(tmp_path / f"{i}.laz", seed=i, first_s=3e8 + 100 * i) for i in range(3)]
    survey = open_survey([tmp_path], crs="local", carry=("p_paint", "label"))
    (tmp_path / "store").mkdir()
    limits = DecoderLimits(batch_points=350)
    facts = build_store(survey, tmp_path / "store", n_threads=2, limits=limits)
    assert facts.columns == ("label", "p_paint")
    store = PointStore.open(tmp_path / "store")
    xyz = np.concatenate([data.xyz for data in files])
    time = np.concatenate([data.gps_time for data in files])
    paint = np.concatenate([expected(data, "p_paint") for data in files])

    def assert_those(points, chosen):
        assert 0 < np.count_nonzero(chosen) < len(xyz)
        order = np.argsort(points.time_s)
        assert np.array_equal(points.time_s[order], time[chosen])
        assert np.array_equal(points["p_paint"][order], paint[chosen])
        assert np.array_equal(steps_of(points.xyz[order]), steps_of(xyz[chosen]))

    bounds = Bounds(500_010.0, 5_400_020.0, 500_099.5, 5_400_130.25)
    inside = (xyz[:, 0] >= bounds.west) & (xyz[:, 0] < bounds.east)
    inside &= (xyz[:, 1] >= bounds.south) & (xyz[:, 1] < bounds.north)
    assert_those(store.points(bounds), inside)
    assert_those(store.points(bounds, ordered=False), inside)
    low = Image(np.full((320, 320), 150.0, np.float32), Grid(499_999.5, 5_400_159.5, 0.5, 0.5, 320, 320))
    assert_those(store.points(bounds, lowest=low, above_m=30.0), inside & (xyz[:, 2] >= 180.0))


def test_strays_take_their_columns_along(tmp_path):
    data = written(tmp_path / "a.las", extra=EXTRA[:1])
    data.z[5] = 90_000.0
    data.write(tmp_path / "a.las")
    content = read_survey_points(open_survey([tmp_path / "a.las"], crs="local", carry="label"))
    assert content.rejected == {"far from all others": 1}
    np.testing.assert_array_equal(by_time(content.points, "label")[0], np.delete(expected(data, "label"), 5))


def test_points_left_out_take_their_columns_along(tmp_path):
    data = written(tmp_path / "a.laz")
    data.classification[10:20] = 7
    data.gps_time[400] = np.nan
    data.write(tmp_path / "a.laz")
    content = read_survey_points(open_survey([tmp_path / "a.laz"], crs="local", carry="label"))
    kept = np.delete(np.arange(1200), [*range(10, 20), 400])
    assert content.rejected == {"noise class": 10, "impossible time": 1}
    np.testing.assert_array_equal(by_time(content.points, "label")[0], expected(data, "label")[kept])


def test_values_that_stand_for_none_become_nan(tmp_path):
    extra = [
        laspy.ExtraBytesParams(
            "height", "i2", no_data=np.array([-999]), scales=np.array([0.1]), offsets=np.array([0.0])
        )
    ]
    written(tmp_path / "a.laz", extra=extra)
    data = laspy.read(tmp_path / "a.laz")
    data.points.array["height"][:3] = -999
    data.write(tmp_path / "a.laz")
    points = read_survey_points(open_survey([tmp_path / "a.laz"], crs="local", carry="height")).points
    column = by_time(points, "height")[0]
    assert np.isnan(column[:3]).all()
    np.testing.assert_array_equal(column[3:], expected(laspy.read(tmp_path / "a.laz"), "height")[3:])


def test_dimensions_of_several_values_are_columns_each(tmp_path):
    data = written(tmp_path / "a.laz", extra=EXTRA[:1])
    data.add_extra_dim(laspy.ExtraBytesParams("normal", "3f4"))
    data.add_extra_dim(laspy.ExtraBytesParams("last", "u2"))
    data["normal"] = np.random.default_rng(2).normal(size=(1200, 3))
    data["last"] = np.arange(1200)
    data.write(tmp_path / "b.laz")
    names = ("last", "normal[0]", "normal[2]")
    points = read_survey_points(open_survey([tmp_path / "b.laz"], crs="local", carry=names)).points
    last, first, third = by_time(points, *names)
    assert np.array_equal(last, np.arange(1200))
    assert np.array_equal(np.stack([first, third], axis=1), np.asarray(data["normal"], np.float32)[:, [0, 2]])


def test_a_name_that_no_file_has_is_refused_with_those_there_are(tmp_path):
    written(tmp_path / "a.laz", extra=EXTRA[:3], point_format=6)
    with pytest.raises(InputError) as caught:
        read_survey_points(open_survey([tmp_path / "a.laz"], crs="local", carry="p_piant"))
    assert str(caught.value) == (
        f"{tmp_path / 'a.laz'}: no column 'p_piant'; it has label, tilt, p_paint, classification, return_number,"
        " number_of_returns, user_data, point_source_id, scan_angle, scan_direction_flag,"
        " edge_of_flight_line, scanner_channel. Did you mean p_paint?"
    )
    with pytest.raises(InputError, match=r"no column 'zzz'.* Name one of these"):
        read_survey_points(open_survey([tmp_path / "a.laz"], crs="local", carry="zzz"))


def test_a_file_that_lacks_a_column_has_nan_there_and_a_warning(tmp_path):
    with_paint = written(tmp_path / "a.laz", seed=1)
    written(tmp_path / "b.laz", seed=2, extra=EXTRA[:1], first_s=3e8 + 100)
    content = read_survey_points(open_survey([tmp_path], crs="local", carry=("label", "p_paint")))
    assert content.warnings == ("1 of 2 files have no column 'p_paint': NaN there",)
    paint, label = by_time(content.points, "p_paint", "label")
    assert np.array_equal(paint[:1200], expected(with_paint, "p_paint"))
    assert np.isnan(paint[1200:]).all()
    assert not np.isnan(label).any()


@pytest.mark.parametrize("name", ["intensity", "x", "gps_time"])
def test_what_is_read_in_any_case_is_no_further_column(tmp_path, name):
    with pytest.raises(UsageError, match=f"carry: '{name}' is read in any case"):
        open_survey([tmp_path], carry=("label", name))


def test_descriptions_that_cannot_be_true_are_passed_over(tmp_path):
    """Bytes that no description covers, types that do not exist, and columns beyond the record."""
    written(tmp_path / "a.las", extra=EXTRA[:4])
    content = bytearray((tmp_path / "a.las").read_bytes())
    first = content.index(b"label\0")  # of the first description, 4 bytes after its begin

    def names(change):
        damaged = bytearray(content)
        change(damaged)
        (tmp_path / "b.las").write_bytes(bytes(damaged))
        return [name for name in read_las_header(tmp_path / "b.las").columns if name in SCALARS]

    def write(at, *values):
        return lambda data: data.__setitem__(slice(at, at + len(values)), bytes(values))

    assert names(lambda _: None) == ["label", "tilt", "p_paint", "range"]
    assert names(write(first - 2, 99)) == []
    assert names(write(first + 192 - 2, 0, 2)) == ["label", "p_paint", "range"]
    # Of the 15 extra bytes, 1 + 8 + 4 + 8 are described: the last ones would be beyond the record
    assert names(write(first + 192 - 2, 10)) == ["label", "tilt", "p_paint"]
    assert names(write(first, *b"\xff\xfe")) == ["tilt", "p_paint", "range"]


@settings(max_examples=examples(400), deadline=None)
@given(
    point_format=st.integers(0, 10), n_extra=st.integers(0, 60), data=st.data(),
    kinds=st.lists(st.tuples(st.integers(0, 255), st.integers(0, 255)), max_size=4),
)  # fmt: skip
def test_whatever_the_descriptions_say_columns_lie_inside_the_record(point_format, n_extra, data, kinds):
    content = bytearray(data.draw(st.binary(min_size=0, max_size=192 * 4 + 7)))
    for i, (kind, options) in enumerate(kinds):
        if 192 * (i + 1) <= len(content):
            content[192 * i + 2 : 192 * i + 6] = bytes([kind, options, 97 + i, 0])
    n_bytes = RECORD_BYTES[point_format] + n_extra
    columns = columns_of_las(
        point_format, n_bytes, RECORD_BYTES[point_format], [(b"LASF_Spec", 4, bytes(content))]
    )
    raw = np.frombuffer(data.draw(st.binary(min_size=3 * n_bytes, max_size=3 * n_bytes)), np.uint8).reshape(
        3, n_bytes
    )
    out = np.empty(3, np.float32)
    for column in columns.values():
        size = np.dtype(column.dtype).itemsize
        assert 14 <= column.offset <= n_bytes - size
        column.values(
            np.ascontiguousarray(raw[:, column.offset : column.offset + size]).view(column.dtype)[:, 0], out
        )


@pytest.mark.skipif(not REAL.is_dir(), reason=f"no real surveys in {REAL}")
@pytest.mark.parametrize("name", ["als_road_t0717_0743.laz", "als_road_t1664_1689.laz"])
def test_real_extra_dimensions(name):
    data = laspy.read(REAL / "als-roads" / name)
    names = ("classification", "red", "roadclass")
    points = read_survey_points(open_survey([REAL / "als-roads" / name], crs="local", carry=names)).points
    assert len(points) == len(data.points)
    ours = np.lexsort((*(points[name] for name in names), *steps_of(points.xyz).T))
    theirs = np.lexsort((*(expected(data, name) for name in names), *steps_of(data.xyz).T))
    for name in names:
        assert np.array_equal(points[name][ours], expected(data, name)[theirs])
