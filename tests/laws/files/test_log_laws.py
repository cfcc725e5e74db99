"""Logs as they come: whatever happens to a file, rows are right or left out, and what is wrong is one line."""

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from tests.scenes import gnss_files as made
from tests.scenes.effort import examples

from linework.errors import InputError, LineworkError
from linework.files.geodetic import EarthFrame
from linework.files.logs.gnss import read_gnss
from linework.files.logs.tables import read_table
from linework.files.trajectories.read import read_trajectory_content

NAMES = ("time_s", "easting_m", "northing_m", "height_m")
LOCAL = EarthFrame(crs="local")
FEW = settings(
    max_examples=examples(60), deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)


def one_line(error):
    text = str(error)
    assert "\n" not in text
    assert all(c.isprintable() for c in text)
    assert len(text.split(": ", 1)[1]) < 300
    assert error.advice


def table_of(n=40):
    time = 3e8 + np.arange(n) / 10
    return np.round(np.stack([time, 5e5 + time % 7, 5.4e6 - time % 3, time % 2], axis=1), 3)


def text_of(rows, separator=",", end="\n", decimal="."):
    lines = [separator.join(NAMES)]
    lines += [separator.join(f"{value:.3f}" for value in row).replace(".", decimal) for row in rows.tolist()]
    return end.join(lines) + end


def written(folder, data, name="t.csv"):
    (folder / name).write_bytes(data)
    return folder / name


@FEW
@given(
    st.sampled_from([(",", "."), (";", "."), (";", ","), ("\t", "."), ("\t", ",")]),
    st.sampled_from(["\n", "\r\n", "\r"]),
    st.booleans(),
    st.lists(st.integers(1, 40), max_size=3),
)
def test_separators_line_ends_marks_and_blank_lines_do_not_matter(tmp_path, form, end, has_mark, blank):
    rows = table_of()
    lines = text_of(rows, form[0], "\n", form[1]).split("\n")
    for at in blank:
        lines.insert(at, " " * (at % 2))
    table = read_table(
        written(tmp_path, (b"\xef\xbb\xbf" if has_mark else b"") + end.join(lines).encode()), NAMES
    )
    np.testing.assert_array_equal(np.stack([table.columns[name] for name in NAMES], axis=1), rows)
    assert table.warnings == ()
    assert all(lines[int(number) - 1].startswith("3000000") for number in table.line_numbers)


@FEW
@given(st.data())
def test_a_table_that_is_damaged_gives_rows_of_it_or_one_line(tmp_path, data):
    rows = table_of(300)
    text = bytearray(text_of(rows).encode())
    header = text.index(b"\n") + 1
    for _ in range(data.draw(st.integers(1, 3))):
        at = data.draw(st.integers(header, len(text) - 1))
        what = data.draw(st.sampled_from([b"\0", b"nan", b",", b"\xff\xfe", b"x", b"\n", b"inf", b'"']))
        text[at : at + data.draw(st.integers(0, 4))] = what
    try:
        table = read_table(written(tmp_path, bytes(text)), NAMES)
    except InputError as error:
        one_line(error)
        return
    got = np.stack([table.columns[name] for name in NAMES], axis=1)
    assert np.isfinite(got).all()
    # A line that lost some digits is still numbers; at most one for each damage and its neighbour
    known = {tuple(row) for row in rows.tolist()}
    assert sum(tuple(row) not in known for row in got.tolist()) <= 6
    assert len(got) >= 294


@FEW
@given(st.integers(0, 2_000))
def test_a_table_that_is_cut_anywhere(tmp_path, n_bytes):
    rows = table_of(60)
    try:
        table = read_table(written(tmp_path, text_of(rows).encode()[:n_bytes]), NAMES)
    except InputError as error:
        one_line(error)
        return
    got = np.stack([table.columns[name] for name in NAMES], axis=1)
    # The last number may have lost digits
    np.testing.assert_array_equal(got[:-1], rows[: len(got) - 1])
    np.testing.assert_array_equal(got[-1, :3], rows[len(got) - 1, :3])


def test_a_line_of_a_million_characters_and_one_of_a_megabyte_of_nothing(tmp_path):
    head = text_of(table_of()).encode()
    for tail in (b"9" * 1_000_000, b"\0" * 3_000_000, b" " * 2_000_000 + b"\n"):
        with pytest.raises(InputError, match="line 42 is longer than 10,000 characters") as caught:
            read_table(written(tmp_path, head + tail), NAMES)
        one_line(caught.value)


def test_many_blocks_are_one_table(tmp_path):
    rows = np.round(np.random.default_rng(1).uniform(0, 1e6, (60_000, 4)), 3)
    lines = text_of(rows).split("\n")
    lines[31_000] = "cut"
    table = read_table(written(tmp_path, "\r\n".join(lines).encode()), NAMES)
    kept = np.delete(rows, 30_999, axis=0)
    np.testing.assert_array_equal(np.stack([table.columns[name] for name in NAMES], axis=1), kept)
    np.testing.assert_array_equal(table.line_numbers[30_997:31_001], [30_999, 31_000, 31_002, 31_003])
    assert table.warnings == ("1 of 60000 lines left out, the first is line 31001",)


NMEA = "\r\n".join(
    [made.rmc("120000.00", "280524")]
    + [made.gga(f"1200{i // 10:02d}.{i % 10}0", 46.0 + i * 1e-7, 9.0, 250.0) for i in range(300)]
).encode()


@FEW
@given(st.data())
def test_damaged_nmea_never_gives_a_fix_elsewhere(tmp_path, data):
    text = bytearray(NMEA)
    for _ in range(data.draw(st.integers(1, 2))):
        at = data.draw(st.integers(70, len(text) - 1))
        text[at : at + data.draw(st.integers(0, 90))] = data.draw(st.binary(max_size=3))
    try:
        log = read_gnss(written(tmp_path, bytes(text), "a.nmea"), LOCAL).log
    except LineworkError as error:
        one_line(error)
        return
    assert len(log.time_s) >= 296
    # 30 m to the north
    assert np.abs(log.xyz[:, 0]).max() < 0.01
    assert np.abs(log.xyz[:, 1]).max() < 4.0


N_POS = 60
POS = {
    layout: made.pos(
        layout, [("2316", f"{1000 + i / 10:.3f}") for i in range(N_POS)],
        [(46.0 + i * 1e-7, 9.0, 250.0) for i in range(N_POS)], np.full((N_POS, 3), 0.02), base=(46.01, 9.0, 200.0),
    ).encode()
    for layout in made.POS_COLUMNS
}  # fmt: skip


@FEW
@given(st.sampled_from(sorted(POS)), st.data())
def test_a_damaged_pos_gives_finite_fixes_or_one_line(tmp_path, layout, data):
    text = bytearray(POS[layout])
    for _ in range(data.draw(st.integers(1, 3))):
        at = data.draw(st.integers(0, len(text) - 1))
        what = data.draw(
            st.sampled_from([b"\0", b"nan", b"%", b"\n", b"-", b"inf", b"9" * 400, b" ", b"UTC", b":"])
        )
        text[at : at + data.draw(st.integers(0, 40))] = what
    try:
        log = read_gnss(written(tmp_path, bytes(text), "a.pos"), LOCAL).log
    except LineworkError as error:
        one_line(error)
        return
    assert np.isfinite(log.xyz).all()
    assert np.isfinite(log.sigma_m).all()
    assert np.all(np.diff(log.time_s) > 0.0)
    assert set(log.quality.tolist()) <= set(range(1, 8))


@FEW
@given(st.data())
def test_damaged_binary_and_pose_files_are_one_line_or_a_trajectory(tmp_path, data):
    name = data.draw(st.sampled_from(["a.out", "a.txt", "a.pos", "a.tum", "a.nmea", "a.csv"]))
    content = data.draw(
        st.one_of(
            st.binary(max_size=600),
            st.text(alphabet="0123456789.,-+eE \n%$#GPGA*\t\0", max_size=600).map(str.encode),
            st.lists(st.floats(), max_size=80).map(lambda v: np.array(v, dtype="<f8").tobytes()),
        )
    )
    try:
        path = read_trajectory_content(written(tmp_path, content, name)).trajectory
    except LineworkError as error:
        one_line(error)
        return
    assert len(path) >= 2
    assert np.isfinite(path.xyz).all()
