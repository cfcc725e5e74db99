"""From one span of a wire to its conductor over all poles, and to the wires beside it: found, saved as one edit, undone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from benchmarks.wires import hung_anew
from scipy.spatial import cKDTree
from tests.workbench.follow_talk import talk_with

from linework.errors import UsageError
from linework.files.las.write import write_las
from linework.files.survey.open import open_survey
from linework.files.vectors.read_write import read_lines
from linework.lines.companions import HungWires
from linework.methods.cables.networks import conductors, with_networks
from linework.model.lines import LineSet
from linework.processes.executors import Serial
from linework.runs.opened.points import opened_survey, surface_of
from linework.runs.opened.work_folder import work_folder
from linework.runs.settings import RunSettings
from linework.runs.steps import RunSteps
from linework.simulation.simulate import survey_of
from linework.surface.road import RoadConfig
from linework.tracing.trace import Tracer
from linework.workbench.edits.hung_wires import wires_change


@pytest.fixture(scope="module")
def hung():
    """A line of poles beside a road of 250 m: cores of two tiles and more."""
    return survey_of(hung_anew(33, 250.0, 0.0))


@pytest.fixture(scope="module")
def tracer(hung, tmp_path_factory):
    folder = tmp_path_factory.mktemp("wires")
    write_las(hung.points, folder / "points.laz", crs=hung.crs)
    steps = RunSteps()
    with opened_survey(open_survey([folder]), work_folder(folder, None), steps=steps) as opened:
        yield Tracer(opened, surface_of(opened, RoadConfig(), Serial(), steps), RunSettings())


def in_line(truth):
    cables = truth.take(truth.kind == "cable")
    circuits, n = np.unique(cables.circuit, return_counts=True)
    return cables.take(cables.circuit == circuits[np.argmax(n)])


@pytest.mark.parametrize("number", [0, -1])
def test_a_wire_is_followed_from_pole_to_pole_with_those_beside_it(hung, tracer, number):
    line = in_line(hung.truth)
    found = tracer.wires_along(line[number].xyz)
    assert len(found.lines) == len(line), "each wire once, though several tiles find it"
    level = conductors(line)
    assert np.count_nonzero(found.is_own) == np.count_nonzero(level == level[number])
    assert len(set(found.lines.circuit.tolist())) == 1 and len(set(found.lines.span.tolist())) == len(
        set(line.span.tolist())
    )
    own = line.take(level == level[number])
    away, _ = cKDTree(own.xyz).query(found.lines.take(found.is_own).xyz)
    assert np.median(away) < 0.5, "the conductor itself, not one 0.45 m and more above or below it"
    assert np.isfinite(found.lines.clearance_m).all()


def test_where_no_wire_is_there_is_none(hung, tracer):
    assert tracer.wires_along(in_line(hung.truth)[0].xyz + np.array([0.0, 0.0, 3.0])) is None


def wires(heights=(8.0, 7.4), spans=3):
    """Wires of spans of 40 m, above one another."""
    x = np.linspace(0.0, 40.0, 41)
    sag = 0.0005 * (x - 20.0) ** 2
    lines = [np.column_stack([x + 40.0 * k, np.zeros(41), up + sag]) for k in range(spans) for up in heights]
    return with_networks(
        LineSet.from_lines(lines, kind=["cable"] * len(lines), method=["radon"] * len(lines))
    )


def found_in(lines):
    numbers = conductors(lines)
    return HungWires(lines, numbers == numbers[0])


def saved(lines, reviews):
    plain = [lines[k].xyz for k in range(len(lines))]
    n = len(plain)
    return replace(
        LineSet.from_lines(plain, kind=["cable"] * n, method=["drawn"] * n),
        review=np.array(reviews), id=np.array([f"w{k}" for k in range(n)]),
    )  # fmt: skip


def test_wires_are_added_named_and_left_out_as_a_person_wants():
    lines = wires()
    found = found_in(lines)
    assert found.is_own.tolist() == [True, False] * 3
    # The first is saved, the wire below it was rejected
    there = saved(lines.take([0, 1]), ["accepted", "rejected"])
    change = wires_change("wires", there, found, own_only=False)
    assert change.before.id.tolist() == ["w0"]
    assert change.after.review.tolist().count("drawn") == 4
    named = change.after.take(change.after.id == "w0")
    assert named.review.tolist() == ["accepted"] and named.span.tolist() == [str(lines.span[0])]
    assert np.array_equal(named.xyz, there[0].xyz)
    own = wires_change("wires", there, found, own_only=True)
    assert len(own.after) == 3 and set(own.after.xyz[:, 2].round(3)) <= set(
        lines.take(found.is_own).xyz[:, 2].round(3)
    )


def test_wires_that_are_all_there_are_said_to_be():
    lines = wires()
    with pytest.raises(UsageError, match="there already"):
        wires_change(
            "wires",
            lines.with_columns(id=np.array([f"w{k}" for k in range(6)])),
            found_in(lines),
            own_only=False,
        )


def test_from_a_click_to_all_wires_in_two_edits(served_alone, made_drive):
    served = served_alone
    truth = read_lines(made_drive / "truth.gpkg")
    cables = truth.take(truth.kind == "cable")
    wire = cables[0].xyz
    at = np.round(wire[len(wire) // 2, :2], 3).tolist()
    with talk_with(served) as talk:
        *_, stopped = talk.follow(type="pick", at=at, kind="cable")
    edit = {
        "action": "keep",
        "trace": stopped["trace"],
        "first": 0,
        "last": len(stopped["lines"][0]["xyz"]) - 1,
    }
    kept = served.post("/api/changes", {"revision": served.get("/api/survey")["revision"], "edit": edit})[
        "lines"
    ][0]
    before = read_lines(served.lines)
    for which, n in (("own", 2), ("all", 4)):
        order = {
            "revision": served.get("/api/survey")["revision"],
            "edit": {"action": "wires", "id": kept["id"], "which": which},
        }
        served.post("/api/changes", order)
        now = read_lines(served.lines)
        assert np.count_nonzero(now.kind == "cable") == n
    assert len(set(now.circuit[now.kind == "cable"].tolist())) == 1
    assert "" not in now.span[now.kind == "cable"].tolist()
    order["revision"] = served.get("/api/survey")["revision"]
    answer = served.client.post("/api/changes", json=order)
    assert answer.status_code in (400, 409, 422) and "there already" in answer.json()["problem"]
    other = next(line["id"] for line in served.get("/api/lines")["lines"] if line["kind"] == "road_boundary")
    answer = served.client.post("/api/changes", json={**order, "edit": {**order["edit"], "id": other}})
    assert answer.status_code == 400 and "Select a cable" in answer.json()["problem"]
    for _ in range(2):
        served.post("/api/undo", {})
    assert sorted(read_lines(served.lines).id.tolist()) == sorted(before.id.tolist())
