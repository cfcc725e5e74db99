"""New lines from old in the plan view: one beside the selected line where the mouse is, and the other rail of a median."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from tests.workbench.page.plan_page import PlanPage, middle_of
from tests.workbench.serve_process import opened_page, served_survey, wait_until

from linework.cli.app import main
from linework.files.vectors.read_write import read_lines
from linework.tracing.medians import partners_among


@pytest.fixture
def plan(page, served):
    return PlanPage(page, served)


@pytest.fixture
def marking(plan):
    """Return the longest lane marking, selected, its middle in the middle of the plan."""
    line = max(
        (line for line in plan.documents().values() if line["kind"] == "lane_marking"),
        key=lambda line: line["length_m"],
    )
    plan.look_at(middle_of(line["xyz"]), nearer=1)
    plan.click(middle_of(line["xyz"]))
    wait_until(lambda: plan.selected == [line["id"]])
    return line


def aside(line, vertex, metres):
    """Return the place so far to the left of a vertex."""
    before, here, after = (np.array(line["xyz"][vertex + k][:2]) for k in (-1, 0, 1))
    way = (after - before) / np.hypot(*(after - before))
    return tuple(here + metres * np.array([-way[1], way[0]]))


def hover(plan, place):
    """Move the mouse to a place: the plan hears of it on its way."""
    east, north = plan.pixel(place)
    plan.page.mouse.move(east + 40, north + 40)
    plan.page.mouse.move(east, north, steps=5)


def test_a_line_beside_one_is_as_long_and_selected(plan, marking):
    place, before = aside(marking, len(marking["xyz"]) // 2, 1.0), plan.revision
    hover(plan, place)
    plan.press("Shift+P")
    plan.saved_since(before)
    wait_until(lambda: plan.selected not in ([], [marking["id"]]))
    new = plan.documents()[plan.selected[0]]
    assert (new["kind"], new["review"]) == ("lane_marking", "drawn")
    assert new["length_m"] == pytest.approx(marking["length_m"], rel=0.1)
    assert min(np.hypot(e - place[0], n - place[1]) for e, n, _ in new["xyz"]) < 1.1


def test_a_line_beside_one_begins_and_ends_where_the_mouse_was(plan, marking):
    middle = len(marking["xyz"]) // 2
    ends, before = [aside(marking, middle + k, -1.0) for k in (-2, 2)], plan.revision
    for place, key in zip(ends, ("Shift+O", "Shift+P"), strict=True):
        hover(plan, place)
        plan.press(key)
    plan.saved_since(before)
    wait_until(lambda: plan.selected not in ([], [marking["id"]]))
    new = np.array(plan.documents()[plan.selected[0]]["xyz"])[:, :2]
    for place in ends:
        assert np.hypot(*(new[[0, -1]] - place).T).min() < 0.1


@pytest.fixture(scope="module")
def motorway(tmp_path_factory):
    """Return a server of a motorway of 60 m with two rails on its median, and no lines yet."""
    survey = tmp_path_factory.mktemp("motorway") / "drive"
    made = [
        "--seed",
        "3411",
        "--length-m",
        "60",
        "--road",
        "motorway",
        "--points-per-m",
        "2000",
        "--no-images",
    ]
    assert main(["simulate", "-o", str(survey), *made, "--quiet"]) == 0
    with served_survey(survey) as served:
        yield served


def test_one_key_adds_the_other_rail_of_a_median(browser, motorway):
    truth = read_lines(motorway.lines.parent / "truth.gpkg")["guardrail"]
    path = np.array(motorway.get("/api/survey")["path"])[:, :2]
    first = next(k for k in range(len(truth)) if len(partners_among(truth, truth[k].xyz, path)))
    second = partners_among(truth, truth[first].xyz, path)[0].xyz
    with opened_page(browser, motorway) as page:
        plan = PlanPage(page, motorway)
        plan.follow(middle_of(truth[first].xyz), "guardrail")
        plan.wait_for("state", "stopped")
        assert "Shift G adds the other rail" in plan.card
        before = plan.revision
        plan.press("Enter")
        own = plan.saved_since(before)["guardrail"]
        wait_until(lambda: plan.selected == own.id.tolist())
        plan.press("Shift+G")
        both = plan.saved_since(before + 1)["guardrail"]
        wait_until(lambda: set(plan.selected) == set(both.id.tolist()))
        wait_until(lambda: "m added" in plan.message)
        (new,) = (both[k] for k in range(len(both)) if both.id[k] != own.id[0])
        apart_m = shapely.distance(shapely.LineString(second[:, :2]), shapely.points(new.xyz[:, :2]))
        assert np.median(apart_m) < 0.05
        assert shapely.LineString(new.xyz[:, :2]).length > 40.0
        # One undo takes it away
        plan.press("Control+z")
        after = plan.saved_since(before + 2)["guardrail"]
        assert after.id.tolist() == own.id.tolist()
