"""What is left out of a survey, and what is odd about its path, is said: how much, why, and what changes it."""

from __future__ import annotations

import json
import shutil

import laspy
import numpy as np
import pytest
from tests.conftest import CRS, road_points

import linework
from linework.errors import LineworkWarning
from linework.files.las.write import write_las
from linework.library.simulate import simulate


def classified(path, classes, *, point_format=6):
    """Rewrite a laser file with some classes at its first points, as (class, number of points)."""
    las = laspy.convert(laspy.read(path), point_format_id=point_format)
    first = 0
    for number, n in classes:
        las.classification[first : first + n] = number
        first += n
    las.write(path)


@pytest.mark.parametrize("point_format", [1, 6])
def test_points_of_noise_classes_are_said_and_can_be_kept(linework, las_file, tmp_path, point_format):
    classified(las_file, [(7, 60)], point_format=point_format)
    n = laspy.read(las_file).header.point_count
    found = linework("info", las_file, "--json", "--quiet")
    document = json.loads(found.stdout)
    assert document["points"] == n - 60
    said = [line for line in document["warnings"] if "left out" in line]
    assert len(said) == 1
    assert f"60 of {n:,} points" in said[0]
    assert "60 noise class; keep_noise = true in the table [points]" in said[0]
    (tmp_path / "survey.toml").write_text(
        f'crs = "{CRS}"\n[points]\nfiles = ["{las_file.relative_to(tmp_path)}"]\nkeep_noise = true\n'
    )
    kept = linework("info", tmp_path, "--json", "--quiet")
    document = json.loads(kept.stdout)
    assert document["points"] == n
    assert not any("left out" in line for line in document["warnings"])
    assert "60 noise class" in linework("info", las_file, "--quiet").stderr


def test_withheld_points_stay_out(linework, las_file, tmp_path):
    las = laspy.convert(laspy.read(las_file), point_format_id=6)
    las.withheld[:50] = 1
    las.write(las_file)
    (tmp_path / "survey.toml").write_text(
        f'crs = "{CRS}"\n[points]\nfiles = ["{las_file.relative_to(tmp_path)}"]\nkeep_noise = true\n'
    )
    found = linework("info", tmp_path, "--quiet")
    assert "50 withheld; withheld points are taken back with the tool" in found.stderr


def test_python_is_told_too_and_a_few_points_are_not_worth_a_word(tmp_path):
    points = road_points(seed=1)
    n_few = int(len(points) * 0.0009)
    write_las(points, tmp_path / "a.laz", crs=CRS)
    classified(tmp_path / "a.laz", [(7, n_few)])
    assert len(linework.read_points(tmp_path / "a.laz")) == len(points) - n_few
    classified(tmp_path / "a.laz", [(7, 2 * n_few + 2)])
    with pytest.warns(LineworkWarning, match="left out: .* noise class"):
        linework.read_points(tmp_path / "a.laz")


def test_a_keep_noise_that_is_no_truth_value(linework, las_file, tmp_path):
    (tmp_path / "survey.toml").write_text('[points]\nfiles = ["a.laz"]\nkeep_noise = "yes"\n')
    found = linework("info", tmp_path)
    assert (found.code, "keep_noise" in found.line, "true or false" in found.line) == (2, True, True)


# The path


@pytest.fixture(scope="module")
def street(tmp_path_factory):
    folder = tmp_path_factory.mktemp("told") / "street"
    simulate(folder, road="bends", seed=4, length_m=60, points_per_m=800, images=False)
    return folder


def driven(street, folder, change):
    """Copy a survey with another path: `change` gets the rows (time, east, north, height, ...) and returns them."""
    shutil.copytree(street, folder, ignore=shutil.ignore_patterns(".linework"))
    head, *rows = (folder / "trajectory.csv").read_text().splitlines()
    values = change(np.array([[float(v) for v in row.split(",")] for row in rows]))
    lines = [head, *(",".join(repr(float(v)) for v in row) for row in values)]
    (folder / "trajectory.csv").write_text("\n".join(lines) + "\n")
    return folder


def geoid(rows):
    rows[:, 3] += 43.0
    return rows


def feet(rows):
    rows[:, 3] /= 0.3048
    return rows


def one_pose(rows):
    rows[len(rows) // 2, 1] += 57.0
    return rows


def at_rest(rows):
    rows[:, 1:] = rows[0, 1:]
    rows[:, 0] = rows[0, 0] + 2.0 * (rows[:, 0] - rows[0, 0])
    return rows


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (geoid, "the van is 4[0-9].[0-9] m above the points along the way: .* ellipsoid"),
        (feet, "are the trajectory's heights in feet?"),
        (one_pose, "the pose at .* is 57.* m off the way"),
        (at_rest, "the van never moves: all .* poses of 15 s lie within 0.00 m"),
    ],
)
def test_an_odd_path_is_said_with_its_cause(street, tmp_path, change, said):
    folder = driven(street, tmp_path / "odd", change)
    with pytest.warns(LineworkWarning, match=said):
        linework.extract(folder, kinds="cable")


def test_a_sound_path_is_not_worth_a_word(street):
    assert linework.extract(street, kinds="cable").report.warnings == ()


# The end of a GPS week


def over_the_week(street, folder, *, points_begin_anew, path_begins_anew):
    week_s = 604_800.0

    def shifted(rows):
        rows[:, 0] += week_s - 4.0 - rows[0, 0]
        if path_begins_anew:
            rows[:, 0] %= week_s
        return rows

    start_s = np.loadtxt(street / "trajectory.csv", delimiter=",", skiprows=1)[0, 0]
    driven(street, folder, shifted)
    for path in (folder / "points").glob("*.laz"):
        las = laspy.read(path)
        time_s = las.gps_time + (week_s - 4.0 - start_s)
        las.gps_time = time_s % week_s if points_begin_anew else time_s
        las.header.global_encoding.gps_time_type = laspy.header.GpsTimeType.WEEK_TIME
        las.write(path)
    text = (folder / "survey.toml").read_text().replace('"gps_adjusted"', '"gps_week"')
    (folder / "survey.toml").write_text(text[: text.index("[navigation]")])
    return folder


@pytest.mark.parametrize("points_begin_anew", [False, True])
@pytest.mark.parametrize("path_begins_anew", [False, True])
def test_a_week_that_ends_within_the_drive(linework, street, tmp_path, points_begin_anew, path_begins_anew):
    folder = over_the_week(
        street, tmp_path / "week", points_begin_anew=points_begin_anew, path_begins_anew=path_begins_anew
    )
    found = linework(
        "extract", folder, "-o", tmp_path / "week.geojson", "--features", "road_boundary", "--quiet"
    )
    assert found.code == 0
    assert "outside the trajectory" not in found.stderr
    assert found.stderr.count("week ends") == points_begin_anew + path_begins_anew
    sound = linework(
        "extract", street, "-o", tmp_path / "a.geojson", "--features", "road_boundary", "--quiet"
    )
    assert sound.code == 0
    ours, theirs = (linework_lines(tmp_path / name) for name in ("week.geojson", "a.geojson"))
    np.testing.assert_array_equal(ours.xyz, theirs.xyz)


def test_a_week_that_ends_between_two_files(linework, street, tmp_path):
    folder = over_the_week(street, tmp_path / "week", points_begin_anew=True, path_begins_anew=False)
    (path,) = (folder / "points").glob("*.laz")
    las = laspy.read(path)
    is_after = las.gps_time < 1e5
    for name, chosen in (("a", ~is_after), ("b", is_after)):
        part = laspy.LasData(las.header)
        part.points = las.points[chosen]
        part.write(folder / "points" / f"{name}.laz")
    path.unlink()
    text = (folder / "survey.toml").read_text().replace(f"points/{path.name}", "points/*.laz")
    (folder / "survey.toml").write_text(text)
    found = linework("info", folder, "--quiet")
    assert "outside the trajectory" not in found.stderr
    assert found.stderr.count("b.laz: the GPS week ends within the survey") == 1


def linework_lines(path):
    return linework.read_lines(path)
