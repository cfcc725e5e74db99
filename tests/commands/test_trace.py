"""`linework trace` as a user runs it, on one small simulated survey."""

from __future__ import annotations

import contextlib
import json
import sqlite3

import numpy as np
import pyogrio
import pytest
import shapely

from linework.files.las.write import write_las
from linework.files.line_file.file import LineFile
from linework.files.trajectories.read import write_trajectory
from linework.files.vectors.read_write import read_lines
from linework.lines.companions import nearest_vertex
from linework.model.changes import Change
from linework.model.points import Points
from linework.simulation.simulate import simulate_survey

KINDS = ("lane_marking", "road_boundary", "guardrail", "cable")


@pytest.fixture(scope="module")
def simulated():
    return simulate_survey("urban", 3, 70.0, points_per_m=3000)


@pytest.fixture(scope="module")
def survey(simulated, tmp_path_factory):
    """A survey folder; its points are spilled by the first call and serve all others."""
    folder = tmp_path_factory.mktemp("trace") / "survey"
    write_las(simulated.points, folder / "points.laz", crs=simulated.crs)
    write_trajectory(simulated.trajectory, folder / "trajectory.csv")
    (folder / "survey.toml").write_text(
        'name = "street"\n[points]\nfiles = ["*.laz"]\n[trajectory]\nfile = "trajectory.csv"\n'
    )
    return folder


@pytest.fixture(scope="module")
def dim(simulated, tmp_path_factory):
    """The same points without intensities."""
    file = tmp_path_factory.mktemp("dim") / "dim.laz"
    write_las(
        Points(simulated.points.xyz, intensity=None, time_s=simulated.points.time_s), file, crs=simulated.crs
    )
    return file


def truth_of(simulated, kind, number=0):
    lines = simulated.truth[kind]
    return lines[int(np.argsort(-lines.length_m)[number])].xyz


def place_on(simulated, kind, share=0.5, number=0):
    """A place on a truth line, as somebody gives it on the command line."""
    line = truth_of(simulated, kind, number)
    return as_text(line[int(share * (len(line) - 1))])


def as_text(place):
    return f"{place[0]:.3f},{place[1]:.3f}"


def off_m(line, truth):
    return np.array([nearest_vertex(truth[:, :2], xy)[1] for xy in line[:, :2]])


@pytest.mark.parametrize("kind", KINDS)
def test_the_line_at_a_place_is_followed(linework, simulated, survey, tmp_path, kind):
    output = tmp_path / "line.gpkg"
    found = linework(
        "trace", survey, "--at", place_on(simulated, kind), "--feature", kind, "-o", output, "--json"
    )
    assert found.code == 0, found.stderr
    said = json.loads(found.stdout)
    assert said["kind"] == kind
    assert said["distance_m"] <= 0.5
    assert len(said["stops"]) == 2
    lines = read_lines(output)[kind]
    assert len(lines) == 1
    assert said["length_m"] == pytest.approx(float(lines.length_m[0]), abs=0.01)
    truth = truth_of(simulated, kind)
    assert lines.length_m[0] >= 0.6 * np.hypot(*np.diff(truth[:, :2], axis=0).T).sum()
    if kind != "cable":  # the one beside it in plan may be meant
        assert np.quantile(off_m(lines[0].xyz, truth), 0.9) <= 0.10


def test_the_nearest_kind_is_taken_where_none_is_named(linework, simulated, survey, tmp_path):
    for kind in ("lane_marking", "road_boundary"):
        output = tmp_path / f"{kind}.geojson"
        found = linework("trace", survey, "--at", place_on(simulated, kind), "-o", output)
        assert found.code == 0, found.stderr
        assert found.stdout.startswith(f"{kind}: ")
        assert [line.split(":")[0].strip() for line in found.stdout.splitlines()[1:]] == ["start", "end"]


def test_toward_follows_one_way_and_append_continues(linework, simulated, survey, tmp_path):
    output, at = tmp_path / "line.gpkg", place_on(simulated, "lane_marking")
    truth = truth_of(simulated, "lane_marking")
    lengths = []
    for end in (truth[0], truth[-1]):
        more = ("--append",) if lengths else ()
        found = linework("trace", survey, "--at", at, "--toward", as_text(end), "-o", output, "--json", *more)
        assert found.code == 0, found.stderr
        said = json.loads(found.stdout)
        assert "it was picked there" in said["stops"]
        lengths.append(said["length_m"])
    lines = read_lines(output)["lane_marking"]
    assert len(lines) == 1
    assert lines.length_m[0] == pytest.approx(sum(lengths), abs=1.0)
    assert min(lengths) > 10.0


def test_append_adds_another_line(linework, simulated, survey, tmp_path):
    output = tmp_path / "lines.gpkg"
    for kind in ("lane_marking", "road_boundary"):
        at = place_on(simulated, kind)
        assert linework("trace", survey, "--at", at, "--append", "-o", output).code == 0
    layers = {name for name, _ in pyogrio.list_layers(output)}
    assert {"lane_marking", "road_boundary"} <= layers


def test_append_keeps_history_and_what_others_put_into_the_file(linework, simulated, survey, tmp_path):
    output = tmp_path / "lines.gpkg"
    kinds = ("lane_marking", "road_boundary")
    assert linework("trace", survey, "--at", place_on(simulated, kinds[0]), "-o", output).code == 0
    with LineFile.opened(output, crs=read_lines(output).crs) as drawing:
        line = drawing.lines.take([0])
        drawing.commit(Change("reject", line, line.with_columns(review=["rejected"])), who="Ada")
    with contextlib.closing(sqlite3.connect(output)) as db, db:
        db.execute("CREATE TABLE notes (text TEXT)")
        db.execute("INSERT INTO notes VALUES ('mine')")
    assert (
        linework("trace", survey, "--at", place_on(simulated, kinds[1]), "--append", "-o", output).code == 0
    )
    with contextlib.closing(sqlite3.connect(output)) as db:
        assert db.execute("SELECT text FROM notes").fetchall() == [("mine",)]
    with LineFile.opened(output, crs=read_lines(output).crs) as drawing:
        assert [edit.change.action for edit in drawing.history()][:2] == ["trace", "reject"]
        assert drawing.lines.review.tolist().count("rejected") == 1
        assert kinds[1] in drawing.lines.kind.tolist()


def test_append_does_not_rewrite_a_file_of_another_program(linework, simulated, survey, tmp_path):
    output = tmp_path / "roads.gpkg"
    shape = shapely.to_wkb([shapely.LineString([[0, 0, 0], [9, 0, 0]])])
    pyogrio.raw.write(output, shape, [], [], geometry_type="LineString Z", crs=simulated.crs, layer="mine")
    before = output.read_bytes()
    at = place_on(simulated, "lane_marking")
    found = linework("trace", survey, "--at", at, "--append", "-o", output)
    assert found.code == 3
    assert output.read_bytes() == before


def middle_of_lane(simulated):
    """The place between a marking and the kerb that is farthest from all lines."""
    truth, road = simulated.truth, truth_of(simulated, "road_boundary")[:, :2]
    lane = truth_of(simulated, "lane_marking")[:, :2]
    over = [road[np.argmin(np.hypot(*(road - xy).T))] for xy in lane]
    places = (lane + np.array(over)) / 2
    clear = [min(nearest_vertex(truth[i].xyz[:, :2], xy)[1] for i in range(len(truth))) for xy in places]
    assert max(clear) > 1.0
    return places[int(np.argmax(clear))]


def test_a_place_on_no_line_is_refused_with_reason_and_proposal(linework, simulated, survey, tmp_path):
    at = as_text(middle_of_lane(simulated))
    found = linework("trace", survey, "--at", at, "-o", tmp_path / "line.gpkg")
    assert found.code == 3
    assert "all road, no boundary in the search area" in found.line
    assert "pick " in found.line
    # What is proposed works
    proposed = found.line.rsplit("pick ", 1)[1].rstrip(".")
    assert list(tmp_path.iterdir()) == []
    found = linework("trace", survey, "--at", proposed, "-o", tmp_path / "line.gpkg")
    assert found.code == 0, found.stderr


def test_a_place_outside_of_the_data_is_refused(linework, simulated, survey, tmp_path):
    west, south, *_ = simulated.points.bounds
    found = linework("trace", survey, "--at", f"{west - 500},{south - 500}", "-o", tmp_path / "line.gpkg")
    assert found.code == 3
    assert "off the edge of the data" in found.line
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("options", "code", "says"),
    [
        (("--at", "nonsense"), 2, "'nonsense' is not a position"),
        (("--at", "1,2,3"), 2, "is not a position"),
        (("--at", "nan,1"), 2, "is not a position"),
        (("--at", "1,2", "--toward", "north"), 2, "--toward: 'north' is not a position"),
        (("--at", "1,2", "--feature", "hedge"), 2, "hedge cannot be picked"),
    ],
)
def test_wrong_options_are_refused_in_one_line(linework, survey, tmp_path, options, code, says):
    found = linework("trace", survey, *options, "-o", tmp_path / "line.gpkg")
    assert found.code == code
    assert says in found.line
    assert list(tmp_path.iterdir()) == []


def test_an_output_that_is_there_is_kept(linework, simulated, survey, tmp_path):
    output = tmp_path / "line.gpkg"
    output.write_text("mine")
    found = linework("trace", survey, "--at", place_on(simulated, "lane_marking"), "-o", output)
    assert found.code != 0
    assert "line.gpkg" in found.line
    assert output.read_text() == "mine"


def test_an_output_of_no_format_is_refused_and_a_missing_folder_is_made(
    linework, simulated, survey, tmp_path
):
    at = place_on(simulated, "lane_marking")
    found = linework("trace", survey, "--at", at, "-o", tmp_path / "line.png")
    assert found.code == 2
    assert "line.png" in found.line
    assert list(tmp_path.iterdir()) == []
    output = tmp_path / "new" / "line.gpkg"
    assert linework("trace", survey, "--at", at, "-o", output).code == 0
    assert output.exists()


def test_without_intensity_a_kerb_is_followed_and_paint_is_not(linework, simulated, dim, tmp_path):
    at = place_on(simulated, "road_boundary")
    assert linework("trace", dim, "--at", at, "-o", tmp_path / "kerb.gpkg").code == 0
    at = place_on(simulated, "lane_marking")
    found = linework("trace", dim, "--at", at, "--feature", "lane_marking", "-o", tmp_path / "paint.gpkg")
    assert found.code == 3
    assert "no marking in the search area" in found.line
    assert not (tmp_path / "paint.gpkg").exists()
