"""Steps of the methods: their names, their results, and that they lead to the lines of the call."""

import matplotlib as mpl
import numpy as np
import pytest
from tests.laws.test_obb_splitting import assert_same

from linework.methods.obb.method import Obb
from linework.methods.protocol import extract_tile, tile_of
from linework.methods.radon.method import Radon
from linework.model.boxes import BoxSet
from linework.model.lines import LineSet
from linework.model.points import Points
from linework.simulation.simulate import simulate_survey

RADON = [
    "ground", "points", "height above the road", "density image", "maximum height image", "binary image",
    "Radon image", "peaks", "seed lines", "segments", "corrected centres", "local fits", "guardrails and barriers",
    "height above the ground", "cables", "lines",
]  # fmt: skip
OBB = [
    "ground", "points", "marking boxes", "boundary boxes", "kerbs", "edges", "barriers", "changes of the ground",
    "sides of the road", "paint", "consistent lines", "lines",
]  # fmt: skip


@pytest.fixture(scope="module")
def surveys():
    return {name: simulate_survey(name, 612, 60.0, points_per_m=1500.0) for name in ("bends", "urban")}


@pytest.fixture(scope="module")
def steps(surveys):
    return {
        "bends": list(Radon().steps(surveys["bends"].points, surveys["bends"].trajectory)),
        "urban": list(Obb().steps(surveys["urban"].points, surveys["urban"].trajectory)),
    }


@pytest.mark.parametrize(("name", "method", "names"), [("bends", Radon(), RADON), ("urban", Obb(), OBB)])
def test_steps_have_their_names_and_lead_to_the_same_lines(surveys, steps, name, method, names):
    assert [step for step, _ in steps[name]] == names
    lines = extract_tile(method, tile_of(surveys[name].points, surveys[name].trajectory))
    assert len(lines) > 2
    assert_same(steps[name][-1][1], lines)


def test_results_are_plain_or_can_be_plotted(steps):
    mpl.use("Agg")
    pyplot = pytest.importorskip("matplotlib.pyplot")
    for name, result in (*steps["bends"], *steps["urban"]):
        if isinstance(result, np.ndarray):
            assert result.ndim == 1
        elif isinstance(result, list):
            assert all(part.shape[1] == 3 for part in result)
        elif not isinstance(result, Points):
            ax = result.plot()
            assert ax.get_xlabel() in ("east [m]", "theta [deg]"), name
            assert ax.collections or ax.images, name
            pyplot.close("all")


def test_results_lie_where_the_survey_is(surveys, steps):
    for name in steps:
        low, high = surveys[name].points.xyz.min(axis=0) - 1.0, surveys[name].points.xyz.max(axis=0) + 1.0
        for step, result in steps[name]:
            places = {BoxSet: "centre", LineSet: "xyz"}.get(type(result))
            found = [getattr(result, places)] if places else result if isinstance(result, list) else []
            assert all(((xyz >= low) & (xyz <= high)).all() for xyz in found), step


def test_an_empty_survey_has_no_steps_but_no_lines():
    for method in (Radon(), Obb()):
        ((name, lines),) = method.steps(Points(np.zeros((0, 3))))
        assert (name, len(lines)) == ("lines", 0)
