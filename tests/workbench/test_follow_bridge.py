"""A followed line goes on beyond a gap that is longer than the tracker crosses by itself, or is said to end there."""

from __future__ import annotations

import numpy as np
import pytest

from linework.editing.edits.continued import PICKED_TWICE
from linework.errors import RefusedPickError
from linework.files.las.write import write_las
from linework.files.survey.open import open_survey
from linework.files.trajectories.read import write_trajectory
from linework.lines.companions import nearest_vertex
from linework.processes.executors import Serial
from linework.runs.opened.points import opened_survey, surface_of
from linework.runs.opened.work_folder import work_folder
from linework.runs.settings import RunSettings
from linework.runs.steps import RunSteps
from linework.simulation.simulate import simulate_survey
from linework.surface.road import RoadConfig
from linework.tracing.trace import Tracer

LENGTH_M, GAP_M = 130.0, 44.0


def drained(steps):
    """All lines that are told, and what it ends with."""
    told = []
    while True:
        try:
            told.append(next(steps))
        except StopIteration as end:
            return told, end.value


@pytest.fixture(scope="module")
def simulated():
    return simulate_survey("straight", 984, LENGTH_M, points_per_m=2500)


@pytest.fixture(scope="module")
def tracer(simulated, tmp_path_factory):
    """A road with a hole in its data, across the whole of it."""
    folder = tmp_path_factory.mktemp("bridge") / "survey"
    path = simulated.trajectory.xyz
    # There and back again
    way = path[np.argmax(np.hypot(*(path[:, :2] - path[0, :2]).T)), :2] - path[0, :2]
    along = (simulated.points.xyz[:, :2] - path[0, :2]) @ way / np.hypot(*way)
    middle = 0.5 * np.hypot(*way)
    points = simulated.points.take(np.flatnonzero(np.abs(along - middle) > 0.5 * GAP_M))
    write_las(points, folder / "points.laz", crs=simulated.crs)
    write_trajectory(simulated.trajectory, folder / "trajectory.csv")
    (folder / "survey.toml").write_text(
        'name = "hole"\n[points]\nfiles = ["*.laz"]\n[trajectory]\nfile = "trajectory.csv"\n'
    )
    steps = RunSteps()
    with opened_survey(open_survey([folder]), work_folder(folder, None), steps=steps) as opened:
        yield Tracer(opened, surface_of(opened, RoadConfig(), Serial(), steps), RunSettings())


def solid_line(simulated):
    truth = simulated.truth
    solid = np.flatnonzero((truth.kind == "lane_marking") & (truth.pattern == "solid"))
    return truth[int(solid[np.argmax(truth.length_m[solid])])].xyz


def test_a_line_goes_on_beyond_a_gap(simulated, tracer):
    line = solid_line(simulated)
    at = line[len(line) // 8, :2]
    _, found = drained(tracer.trace((at[0], at[1]), kind="lane_marking"))
    assert found.lines.length_m[0] < 0.5 * LENGTH_M
    tips = found.lines[0].xyz[[0, -1], :2]
    end = int(np.argmin(np.hypot(*(tips - line[len(line) // 2, :2]).T)))
    grown, whole = drained(tracer.bridge(found.lines, end, found.stops))
    one = whole.lines.take([0])
    assert grown and whole.kind == "lane_marking"
    assert one.length_m[0] > 0.9 * LENGTH_M
    assert one.bridged_m[0] == pytest.approx(GAP_M, abs=4.0)
    off = [nearest_vertex(line[:, :2], xy)[1] for xy in one.xyz[:, :2]]
    assert max(off) < 0.1
    # The other end is as it was, and vertices run as before
    assert whole.stops[1 - end] == found.stops[1 - end]
    same = nearest_vertex(one.xyz[:, :2], tips[1 - end])
    assert same[0] in ((0, 1) if end == 1 else (len(one.xyz) - 3, len(one.xyz) - 2)) and same[1] < 0.05


def test_where_nothing_goes_on_it_is_refused(simulated, tracer):
    line = solid_line(simulated)
    at = line[len(line) // 8, :2]
    _, found = drained(tracer.trace((at[0], at[1]), kind="lane_marking"))
    tips = found.lines[0].xyz[[0, -1], :2]
    end = int(np.argmax(np.hypot(*(tips - line[len(line) // 2, :2]).T)))
    with pytest.raises(RefusedPickError, match=f"within {PICKED_TWICE.longest_m:.0f} m"):
        drained(tracer.bridge(found.lines, end, found.stops))


def test_an_interrupted_line_goes_on_where_it_was_left(simulated, tracer):
    line = solid_line(simulated)
    at = line[len(line) // 8, :2]
    _, whole = drained(tracer.trace((at[0], at[1]), kind="lane_marking"))
    steps = tracer.trace((at[0], at[1]), kind="lane_marking")
    next(steps)
    with pytest.raises(StopIteration) as stop:
        while True:
            steps.send(True)
    part = stop.value.value
    assert part.lines.length_m[0] < whole.lines.length_m[0] - 5.0
    end = int(np.argmin(np.hypot(*(part.lines[0].xyz[[0, -1], :2] - line[len(line) // 2, :2]).T)))
    assert part.stops[end] == "it was interrupted there"
    _, more = drained(tracer.bridge(part.lines, end, part.stops))
    assert more.lines.length_m[0] > part.lines.length_m[0] + 5.0
    assert more.lines.bridged_m[0] < 2.0
