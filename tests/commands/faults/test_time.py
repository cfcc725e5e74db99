"""Times and trajectories that lie: C01 to C06, C10 and C17 of the list of faults, through `linework extract`."""

from __future__ import annotations

import laspy
import numpy as np
import pytest
from tests.scenes.rail_scenes import rail_scene, straight

from linework.files.las.write import write_las
from linework.files.logs.clock import to_survey_time
from linework.files.vectors.read_write import read_lines
from linework.model.points import Points

#: 2024-05-26 00:00 GPS, adjusted: a Sunday, on which a GPS week begins; and what is left of the week before.
SUNDAY_S = 2316 * 604_800.0 - 1e9
LOW = np.array([500_000.0, 5_400_000.0, 100.0])
HEAD = "time_s,easting_m,northing_m,height_m"
SPEED_MPS = 2.0


def points_of(start_s):
    xyz = straight(rail_scene(np.random.default_rng(4), s=(2.13, 37.91)), 0.31)
    along = xyz[:, 0] * np.cos(0.31) + xyz[:, 1] * np.sin(0.31)
    order = np.argsort(along, kind="stable")
    xyz, time = xyz[order], start_s + along[order] / SPEED_MPS
    return Points(np.round(xyz + LOW, 3), intensity=np.full(len(xyz), 900.0, np.float32), time_s=time)


def trajectory_of(start_s):
    """Return rows of the drive along the points, from 2 s before to 2 s after them, 20 a second."""
    time = np.arange(-40, 440) / 20
    along = time * SPEED_MPS
    places = np.stack([along * np.cos(0.31), along * np.sin(0.31), np.zeros(len(time))], axis=1) + LOW
    return np.column_stack([start_s + time, np.round(places, 3)])


def text_of(rows):
    return "\n".join([HEAD, *(",".join(map(repr, row)) for row in rows.tolist())]) + "\n"


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Return a folder with points that are scanned from one second before to 19 s after a week begins."""
    folder = tmp_path_factory.mktemp("drive")
    write_las(points_of(SUNDAY_S - 1.0), folder / "a.laz", crs="EPSG:25832")
    (folder / "survey.toml").write_text('[points]\nfiles = ["a.laz"]\n[trajectory]\nfile = "t.csv"\n')
    return folder


@pytest.fixture
def survey(made):
    """Return that folder with a sound trajectory; its points are decoded once for all tests."""
    (made / "t.csv").write_text(text_of(trajectory_of(SUNDAY_S - 1.0)))
    return made


def extracted(linework, folder, *more):
    return linework(
        "extract", folder, "-o", folder / "out.gpkg", "--features", "guardrail", "--overwrite", *more
    )


def lines_of(folder):
    lines = read_lines(folder / "out.gpkg")
    assert len(lines) == 1
    return lines


def same(a, b):
    np.testing.assert_array_equal(a.xyz, b.xyz)
    np.testing.assert_array_equal(a.time_start_s, b.time_start_s)


@pytest.fixture
def expected(linework, survey):
    """Return the lines of the sound survey."""
    if not (survey / "sound.gpkg").exists():
        outcome = linework("extract", survey, "-o", survey / "sound.gpkg", "--features", "guardrail")
        assert outcome.code == 0, outcome.stderr
        assert "warning" not in outcome.stderr
    return read_lines(survey / "sound.gpkg")


@pytest.mark.parametrize("epoch", ["gps_week", "gps", "unix"])
def test_c01_c02_trajectories_of_any_epoch_give_the_same_lines(linework, survey, expected, epoch):
    rows = trajectory_of(SUNDAY_S - 1.0)
    rows[:, 0] = to_survey_time(rows[:, 0], "gps_adjusted", epoch)
    if epoch == "gps_week":  # the count begins again within the drive
        rows[:, 0] %= 604_800.0
    (survey / "t.csv").write_text(text_of(rows))
    outcome = extracted(linework, survey)
    assert outcome.code == 0
    assert "converted to adjusted GPS seconds" in outcome.stderr
    assert ("the GPS week ends within the log" in outcome.stderr) == (epoch == "gps_week")
    same(lines_of(survey), expected)


def test_c01_points_in_seconds_of_the_week(linework, tmp_path, expected):
    points = points_of(SUNDAY_S - 100.0)
    header = laspy.LasHeader(point_format=1, version="1.2")
    header.scales, header.offsets = [0.001] * 3, np.floor(LOW)
    record = laspy.LasData(header)
    record.xyz, record.intensity = points.xyz, points.intensity.astype(np.uint16)
    record.gps_time = points.time_s - SUNDAY_S + 604_800.0
    record.write(str(tmp_path / "a.las"))
    toml = 'crs = "EPSG:25832"\n[points]\nfiles = ["a.las"]\n[trajectory]\nfile = "t.csv"\n'
    (tmp_path / "survey.toml").write_text(toml)
    (tmp_path / "t.csv").write_text(text_of(trajectory_of(SUNDAY_S - 100.0)))
    outcome = extracted(linework, tmp_path)
    assert outcome.code == 0, outcome.stderr
    assert "adjusted GPS seconds: converted to GPS seconds of the week" in outcome.stderr
    np.testing.assert_allclose(lines_of(tmp_path).xyz, expected.xyz, atol=1e-3)


def test_c03_utc_is_named(linework, survey, expected):
    (survey / "t.csv").write_text(text_of(trajectory_of(SUNDAY_S - 19.0)))
    outcome = extracted(linework, survey)
    assert outcome.code == 0
    assert (
        "+18 s added to the times of the trajectory would make them fit: UTC taken for GPS time?"
        in outcome.stderr
    )


def test_c04_a_clock_that_is_set_back(linework, survey, expected):
    rows = trajectory_of(SUNDAY_S - 1.0)
    rows[200:, 0] -= 0.98
    (survey / "t.csv").write_text(text_of(rows))
    outcome = extracted(linework, survey)
    assert outcome.code == 0
    assert "t.csv: the clock was set back 1 times, first after" in outcome.stderr
    assert "at line 202" in outcome.stderr


def test_c05_shuffled_and_doubled_rows(linework, survey, expected):
    rows = trajectory_of(SUNDAY_S - 1.0)
    rows = np.concatenate([rows, rows[:7]])
    (survey / "t.csv").write_text(text_of(np.random.default_rng(2).permutation(rows)))
    outcome = extracted(linework, survey)
    assert outcome.code == 0
    assert "times, first at line" in outcome.stderr
    assert "7 rows with a repeated time left out" in outcome.stderr
    same(lines_of(survey), expected)


def test_c06_nanoseconds_and_no_times(linework, survey, expected):
    rows = trajectory_of(SUNDAY_S - 1.0)
    lines = [f"{round(t * 1000) * 1_000_000},{e!r},{n!r},{h!r}" for t, e, n, h in rows.tolist()]
    (survey / "t.csv").write_text("\n".join([HEAD, *lines]))
    outcome = extracted(linework, survey)
    assert outcome.code == 0
    assert "t.csv: times are in nanoseconds: converted to seconds" in outcome.stderr
    same(lines_of(survey), expected)
    rows[:, 0] = 0.0
    (survey / "t.csv").write_text(text_of(rows))
    outcome = extracted(linework, survey)
    assert outcome.code == 3
    assert outcome.line.endswith("t.csv: all 480 times are 0. A log without times cannot be used.")


def test_c10_a_trajectory_of_another_day_or_another_place(linework, survey):
    rows = trajectory_of(SUNDAY_S - 1.0)
    (survey / "t.csv").write_text(text_of(rows + np.array([86_400.0, 0, 0, 0])))
    outcome = extracted(linework, survey)
    assert outcome.code == 3
    a, b = SUNDAY_S + 86_397.0, SUNDAY_S + 86_420.9
    assert f"trajectory from {a:.1f} to {b:.1f} s, points from {SUNDAY_S - 1.0:.1f} to" in outcome.line
    (survey / "t.csv").write_text(text_of(rows + np.array([0, 30_000.0, 0, 0])))
    outcome = extracted(linework, survey)
    assert outcome.code == 3
    assert "trajectory and points are 30.0 km apart: east 52" in outcome.line


def test_c10_a_trajectory_with_a_hole(linework, survey, expected):
    rows = trajectory_of(SUNDAY_S - 1.0)
    (survey / "t.csv").write_text(text_of(np.delete(rows, np.arange(100, 200), axis=0)))
    outcome = extracted(linework, survey)
    assert outcome.code == 0
    assert "% of the points are in a gap of the trajectory, from 400716801.9" in outcome.stderr


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda text: text[:-20], "1 of 480 lines left out, the first is line 481"),
        (lambda text: text.replace("\n", "\r\n"), ""),
        (lambda text: "\ufeff" + text, ""),
        (lambda text: text.replace(",", ";").replace(".", ","), ""),
        (lambda text: text[:5000] + "\0" * 40 + text[5000:], "1 of 480 lines left out"),
        (lambda text: text[:5000] + "9" * 1_000_000, "3: line "),
        (lambda text: text.replace("5400000", "nan"), "3: line "),
    ],
    ids=["cut", "crlf", "bom", "semicolons", "nul", "long", "nan"],
)
def test_c17_a_log_with_dirt(linework, survey, expected, change, words):
    text = text_of(trajectory_of(SUNDAY_S - 1.0))
    (survey / "t.csv").write_bytes(change(text).encode())
    outcome = extracted(linework, survey)
    if words.startswith("3: "):
        assert outcome.code == 3
        assert "t.csv: " + words[3:] in outcome.line
        return
    assert outcome.code == 0
    assert words in outcome.stderr
    assert words or "warning" not in outcome.stderr
    np.testing.assert_array_equal(lines_of(survey).xyz, expected.xyz)
