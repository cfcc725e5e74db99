"""Boxes found block by block are those of the whole, whatever was asked for before."""

import numpy as np
import pytest

from linework.files.las.write import write_las
from linework.files.survey.open import open_survey
from linework.methods.obb.method import Obb
from linework.model.boxes import BOX_COLUMNS
from linework.model.tile import local_origin
from linework.processes.executors import Serial
from linework.runs.opened.points import opened_survey, surface_of
from linework.runs.opened.work_folder import work_folder
from linework.runs.steps import RunSteps
from linework.simulation.simulate import simulate_survey
from linework.surface.road import RoadConfig
from linework.tracing.boxes import Corridor, SurveyBoxes

KINDS = ("lane_marking", "road_boundary")


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    folder = tmp_path_factory.mktemp("boxes") / "survey"
    simulated = simulate_survey("urban", 983, 40.0, points_per_m=2000)
    write_las(simulated.points, folder / "points.laz", crs=simulated.crs)
    with opened_survey(open_survey([folder]), work_folder(folder, None), steps=RunSteps()) as opened:
        surface = surface_of(opened, RoadConfig(), Serial(), RunSteps())
        bounds = opened.points.bounds
        origin = local_origin(bounds.west, bounds.south, surface.z0_m)
        line = simulated.truth[int(np.argmax(simulated.truth.length_m))].xyz[:, :2]

        def fresh():
            method = Obb()
            return SurveyBoxes(opened.points, surface, {kind: method.only(kind) for kind in KINDS}, origin)

        yield fresh, line


def in_order(boxes):
    return boxes.take(np.lexsort((*boxes.centre.T, boxes.form)))


def same(a, b):
    a, b = in_order(a), in_order(b)
    return all(getattr(a, name).tobytes() == getattr(b, name).tobytes() for name in BOX_COLUMNS)


def test_pieces_of_a_corridor_are_the_corridor(made):
    fresh, line = made
    whole, parts, again = Corridor(fresh()), Corridor(fresh()), Corridor(fresh())
    assert whole.load(line, 4.0)
    for first in range(0, len(line), 7):
        parts.load(line[first : first + 7], 4.0)
    for kind in KINDS:
        again.load(line, 1.5, kind)
        again.load(line, 4.0, kind)
    assert len(whole.boxes) > 50
    assert same(whole.boxes, parts.boxes) and same(whole.boxes, again.boxes)
    assert not whole.load(line, 4.0)


def test_a_corridor_knows_nothing_of_others(made):
    fresh, line = made
    survey = fresh()
    Corridor(survey).load(line, 12.0)
    late, alone = Corridor(survey), Corridor(fresh())
    for corridor in (late, alone):
        assert corridor.load(line[:3], 4.0, "lane_marking")
    assert same(late.boxes, alone.boxes)
