"""Laws of files: lines come back as they were; no damaged laser file does more than raise one line."""

import struct
from dataclasses import fields

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from tests.oracles.las_in_memory import read_las
from tests.scenes.effort import examples

from linework.crs import parse_crs
from linework.errors import LineworkError
from linework.files.las.write import write_las
from linework.files.trajectories.read import read_trajectory_content, write_trajectory
from linework.files.vectors.fields import OPTIONAL_FIELDS, fields_of_kind, layer_names
from linework.files.vectors.read_write import read_lines, write_lines
from linework.model.columns import column_types
from linework.model.lines import CANDIDATE, KINDS, LINE_COLUMNS, VERTEX_COLUMNS, LineSet
from linework.model.points import Points
from linework.model.trajectory import Trajectory

IN_FOLDER = settings(
    max_examples=examples(25), deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
NUMBERS = st.floats(-1e7, 1e7, allow_nan=False, width=64)
#: Any text a database and JSON can hold: no surrogates, no NUL.
TEXTS = st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\0"), max_size=12)
CRSS = st.sampled_from(["local", "EPSG:25832", "EPSG:25832+7837", "EPSG:2180"])


def strategy_of(name):
    kind = column_types(LineSet)[name].dtype
    if name == "kind":
        return st.sampled_from((*KINDS, CANDIDATE)) | TEXTS
    return {np.str_: TEXTS, np.bool_: st.booleans(), np.float64: NUMBERS | st.just(np.nan)}[kind]


@st.composite
def line_sets(draw):
    counts = draw(st.lists(st.integers(2, 5), max_size=4))
    n = sum(counts)
    # Each vertex somewhere else: lines without length are refused
    xyz = draw(st.lists(st.tuples(NUMBERS, NUMBERS, NUMBERS), min_size=n, max_size=n, unique=True))
    columns = {name: draw(st.lists(strategy_of(name), min_size=n, max_size=n)) for name in VERTEX_COLUMNS}
    m = len(counts)
    columns |= {name: draw(st.lists(strategy_of(name), min_size=m, max_size=m)) for name in LINE_COLUMNS}
    offsets = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
    return LineSet(xyz=np.array(xyz).reshape(-1, 3), offsets=offsets, crs=parse_crs(draw(CRSS)), **columns)


@pytest.mark.parametrize("suffix", [".gpkg", ".geojson"])
@IN_FOLDER
@given(lines=line_sets())
def test_lines_come_back_as_they_were(tmp_path, suffix, lines):
    path = tmp_path / f"lines{suffix}"
    write_lines(lines, path, kinds=["guardrail"], overwrite=True)
    back = read_lines(path)
    for f in fields(LineSet):
        expected, found = getattr(lines, f.name), getattr(back, f.name)
        if f.name in OPTIONAL_FIELDS:  # some are fields of some layers only
            here = [bool(fields_of_kind(layer, [f.name])) for layer in layer_names(lines)]
            expected = np.where(here, expected, "" if expected.dtype.kind == "U" else np.nan)
        if f.name == "crs":
            assert found == expected
        else:
            np.testing.assert_array_equal(found, expected, err_msg=f.name)


@IN_FOLDER
@given(
    start=st.floats(-1e9, 2e9, allow_nan=False),
    # Those of a drive: whole numbers far apart are read as milliseconds, and so on
    steps=st.lists(st.floats(0.001, 4.0), min_size=1, max_size=7),
    data=st.data(),
)
def test_trajectories_come_back_as_they_were(tmp_path, start, steps, data):
    times = start + np.concatenate([[0.0], np.cumsum(steps)])
    n = len(times)
    rows = st.lists(st.tuples(NUMBERS, NUMBERS, NUMBERS), min_size=n, max_size=n)
    xyz, attitude = data.draw(rows), data.draw(st.none() | rows)
    trajectory = Trajectory(times, np.array(xyz), None if attitude is None else np.array(attitude))
    write_trajectory(trajectory, tmp_path / "t.csv", overwrite=True)
    back = read_trajectory_content(tmp_path / "t.csv").trajectory
    np.testing.assert_array_equal(back.time_s, trajectory.time_s)
    np.testing.assert_array_equal(back.xyz, trajectory.xyz)
    assert (back.attitude_deg is None) == (attitude is None)


@IN_FOLDER
@given(
    xyz=st.lists(st.tuples(*[st.floats(-1e6, 1e6)] * 3), min_size=1, max_size=20),
    suffix=st.sampled_from([".las", ".laz"]),
)
def test_points_come_back_within_half_a_millimetre(tmp_path, xyz, suffix):
    points = Points(np.array(xyz))
    write_las(points, tmp_path / f"a{suffix}", crs="local", overwrite=True)
    back = read_las(tmp_path / f"a{suffix}", crs="local").points
    assert np.abs(back.xyz - points.xyz).max() <= 0.0005 + 1e-9


@pytest.fixture(scope="module", params=[".las", ".laz"])
def sound(request, tmp_path_factory):
    rng = np.random.default_rng(5)
    xyz = np.cumsum(rng.normal(0, 0.1, (3000, 3)), axis=0)
    path = tmp_path_factory.mktemp("sound") / f"a{request.param}"
    write_las(Points(xyz, intensity=rng.random(3000) * 5000), path, crs="EPSG:25832")
    return path


WORDS = st.sampled_from([0, 1, 2**31 - 1, 2**31, 2**32 - 1, 4_000_000_000]) | st.integers(0, 2**32 - 1)


@settings(
    max_examples=examples(300), deadline=5000, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(data=st.data())
def test_no_change_to_a_laser_file_does_more_than_raise_one_line(tmp_path, sound, data):
    content = bytearray(sound.read_bytes())
    for _ in range(data.draw(st.integers(1, 3))):
        at = data.draw(st.integers(0, 1200) | st.integers(0, len(content) - 4))
        struct.pack_into("<I", content, at, data.draw(WORDS))
    cut = data.draw(st.integers(0, len(content)) | st.just(len(content)))
    path = tmp_path / f"b{sound.suffix}"
    path.write_bytes(content[:cut])
    try:
        read = read_las(path)
    except LineworkError as error:
        assert error.exit_code == 3
        assert error.advice
        assert "\n" not in str(error)
    else:
        assert len(read.points) + sum(read.n_rejected.values()) == read.n_promised
        assert np.isfinite(read.points.xyz).all()
        assert read.points.time_s is None or np.isfinite(read.points.time_s).all()
