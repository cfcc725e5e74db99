"""Trajectories as CSV: exact round trip, bad lines counted with their numbers."""

import numpy as np
import pytest

from linework.errors import InputError, OutputExistsError
from linework.files.trajectories.read import read_trajectory_content, write_trajectory
from linework.model.trajectory import Trajectory

HEAD = "time_s,easting_m,northing_m,height_m"


def path_of(n=50, *, full=True):
    rng = np.random.default_rng(3)
    time = 3e8 + np.cumsum(rng.uniform(0.001, 0.1, n))
    xyz = rng.uniform(0, 100, (n, 3)) + np.array([500000.0, 5600000.0, 100])
    return (
        Trajectory(time, xyz, rng.uniform(-5, 5, (n, 3)), rng.uniform(0.01, 1, (n, 3)))
        if full
        else Trajectory(time, xyz)
    )


@pytest.mark.parametrize("full", [True, False])
def test_round_trip_is_exact(tmp_path, full):
    trajectory = path_of(full=full)
    write_trajectory(trajectory, tmp_path / "t.csv")
    back = read_trajectory_content(tmp_path / "t.csv").trajectory
    np.testing.assert_array_equal(back.time_s, trajectory.time_s)
    np.testing.assert_array_equal(back.xyz, trajectory.xyz)
    for name in ("attitude_deg", "sigma_xyz_m"):
        expected, found = getattr(trajectory, name), getattr(back, name)
        assert (expected is None) == (found is None)
        if expected is not None:
            np.testing.assert_array_equal(found, expected)
    with pytest.raises(OutputExistsError):
        write_trajectory(trajectory, tmp_path / "t.csv")


def content_of(tmp_path, text, encoding="utf-8"):
    path = tmp_path / "t.csv"
    path.write_bytes(text.encode(encoding))
    return read_trajectory_content(path)


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig"])
def test_line_ends_byte_order_mark_extra_columns_and_order(tmp_path, end, encoding):
    lines = ["Height_m, note,time_s ,easting_m,northing_m", "7,a,1,2,3", "", '8,"b, c",2,3,4', "9,,3,4,5"]
    content = content_of(tmp_path, end.join(lines) + end, encoding)
    np.testing.assert_array_equal(content.trajectory.time_s, [1, 2, 3])
    np.testing.assert_array_equal(content.trajectory.xyz, [[2, 3, 7], [3, 4, 8], [4, 5, 9]])
    assert content.warnings == ()


def test_unsorted_and_duplicate_times_are_sorted_and_counted(tmp_path):
    rows = ["1,10,0,0", "3,30,0,0", "2,20,0,0", "3,31,0,0", "4,40,0,0"]
    content = content_of(tmp_path, "\n".join([HEAD, *rows]))
    np.testing.assert_array_equal(content.trajectory.xyz[:, 0], [10, 20, 30, 40])
    assert content.warnings == (
        "time runs backwards 1 times, first at line 4: sorted",
        "1 rows with a repeated time left out",
    )


@pytest.mark.parametrize(
    "bad", ["99,1,2", "nan,1,2,3", "99,1,inf,3", "99,1,x,3", "99,1,,3", "9\0,1,2,3", "99,1"]
)
def test_a_bad_line_is_left_out_and_named(tmp_path, bad):
    rows = [f"{i},1,2,3" for i in range(10)]
    content = content_of(tmp_path, "\n".join([HEAD, *rows, bad]))
    assert len(content.trajectory) == 10
    assert content.warnings == ("1 of 11 lines left out, the first is line 12",)


def refusal(tmp_path, text):
    path = tmp_path / "t.csv"
    path.write_bytes(text.encode())
    with pytest.raises(InputError) as caught:
        read_trajectory_content(path)
    line = str(caught.value)
    assert line.startswith(f"{path}: ")
    assert "\n" not in line
    assert caught.value.advice
    assert len(line) - len(str(path)) < 300
    return line


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "empty file"),
        ("time_s,easting_m\n1,2\n", "missing columns northing_m, height_m"),
        (HEAD + ",roll_deg\n1,2,3,4,5\n", "missing columns pitch_deg, heading_deg"),
        (HEAD + "\n", "no rows"),
        (HEAD + "\n1,2,3,4\n", "1 position, a trajectory needs at least 2"),
        (HEAD + "\n" + "1,0;2,0;3,0;4,0\n" * 5, "no usable rows (5 lines"),
        (HEAD + "\n" + "1,2,3,4\n2,2,3,nan\n" * 5, "line 3 and 4 other of 10 lines are not finite numbers"),
        (HEAD + "\n1,2,3,4\n2,2,3,4\n" + "9" * 20000, "line 4 is longer than 10,000 characters"),
        ("\x00\x01\x02" * 1000, "is not a table of text"),
    ],
)
def test_files_that_are_no_trajectory(tmp_path, text, words):
    assert words in refusal(tmp_path, text)


def test_a_heading_alone_is_a_path_without_attitude(tmp_path):
    """From two antennas: the positions are used, and that images need more is a warning."""
    text = "time_s,easting_m,northing_m,height_m,heading_deg,sigma_heading_deg\n1,1,2,3,90,1\n2,2,2,3,90,1\n3,3,2,3,90,1\n"
    (tmp_path / "t.csv").write_text(text)
    content = read_trajectory_content(tmp_path / "t.csv")
    assert content.trajectory.attitude_deg is None and len(content.trajectory.xyz) == 3
    assert any("headings without roll and pitch are not used" in text for text in content.warnings)
    (tmp_path / "u.csv").write_text(text.replace("sigma_heading_deg", "roll_deg"))
    with pytest.raises(InputError, match="missing column pitch_deg"):
        read_trajectory_content(tmp_path / "u.csv")
