"""Editing in the plan view: what is clicked, dragged and pressed is in the file of lines."""

from __future__ import annotations

import numpy as np
import pytest
from tests.workbench.page.plan_page import PlanPage, middle_of
from tests.workbench.serve_process import wait_until


@pytest.fixture
def plan(page, served):
    plan = PlanPage(page, served)
    yield plan
    # The next test finds the lines as this one did
    plan.undo_all()


@pytest.fixture
def boundary(plan):
    """Return a road boundary, selected, its middle vertex in the middle of the plan, seen from near."""
    return selected(plan, "road_boundary")


def selected(plan, kind):
    line = max(
        (line for line in plan.documents().values() if line["kind"] == kind and line["review"] != "rejected"),
        key=lambda line: line["length_m"],
    )
    plan.look_at(middle_of(line["xyz"]), nearer=5)
    # Kerbs have two lines so near to one another that either may be meant: the other one is not shown
    if kind == "road_boundary":
        plan.page.evaluate("document.querySelector('.legend').open = true")
        plan.page.uncheck("input[name=show-kerb_top]")
        plan.page.evaluate("document.querySelector('.legend').open = false")
    plan.click(middle_of(line["xyz"]))
    wait_until(lambda: plan.selected == [line["id"]])
    return line


def of(plan, line):
    return plan.documents()[line["id"]]


def test_a_vertex_is_dragged(plan, boundary):
    i = len(boundary["xyz"]) // 2
    east, north, _ = boundary["xyz"][i]
    before = plan.revision
    plan.drag((east, north), (east + 0.2, north - 0.3))
    plan.saved_since(before)
    moved = of(plan, boundary)
    assert np.hypot(moved["xyz"][i][0] - east - 0.2, moved["xyz"][i][1] - north + 0.3) < 0.02
    assert moved["xyz"][i][2] == pytest.approx(boundary["xyz"][i][2], abs=0.3), "the road has no such steps"
    assert moved["review"] == "edited"
    plan.press("Control+z")
    wait_until(lambda: of(plan, boundary)["xyz"] == boundary["xyz"])
    plan.press("Control+Shift+z")
    wait_until(lambda: of(plan, boundary)["xyz"] == moved["xyz"])


def test_a_vertex_is_inserted_and_removed(plan, boundary):
    n, i = len(boundary["xyz"]), len(boundary["xyz"]) // 2
    a, b = np.array(boundary["xyz"][i]), np.array(boundary["xyz"][i + 1])
    before = plan.revision
    plan.click(tuple((a + b)[:2] / 2))
    plan.saved_since(before)
    assert len(of(plan, boundary)["xyz"]) == n + 1
    plan.press("Delete")
    plan.saved_since(before + 1)
    assert len(of(plan, boundary)["xyz"]) == n


def test_an_active_vertex_is_of_its_line_only(plan, boundary):
    plan.click(middle_of(boundary["xyz"]))
    marking = next(line for line in plan.documents().values() if line["kind"] == "lane_marking")
    plan.look_at(middle_of(marking["xyz"]))
    plan.click(middle_of(marking["xyz"]))
    wait_until(lambda: plan.selected == [marking["id"]])
    before = plan.revision
    plan.press("Delete")
    lines = plan.saved_since(before)
    assert marking["id"] not in lines.id.tolist()
    assert of(plan, boundary)["xyz"] == boundary["xyz"]


def test_split_and_join(plan, boundary):
    before = plan.revision
    plan.click(middle_of(boundary["xyz"]))
    plan.press("t")
    lines = plan.saved_since(before)["road_boundary"]
    parts = [line for line in plan.documents().values() if line["kind"] == "road_boundary"]
    assert sum(line["length_m"] for line in parts) == pytest.approx(lines.length_m.sum(), abs=0.01)
    halves = sorted(parts, key=lambda line: abs(line["length_m"] - boundary["length_m"] / 2))[:2]
    plan.press("Escape")
    plan.look_at(middle_of(boundary["xyz"]))
    plan.click(middle_of(halves[0]["xyz"]))
    _shift_click(plan, middle_of(halves[1]["xyz"]))
    wait_until(lambda: sorted(plan.selected) == sorted(half["id"] for half in halves))
    plan.press("j")
    joined = plan.saved_since(before + 1)["road_boundary"]
    assert joined.length_m.max() == pytest.approx(boundary["length_m"], abs=0.2)


def _shift_click(plan, place):
    plan.page.keyboard.down("Shift")
    plan.click(place)
    plan.page.keyboard.up("Shift")


def test_reverse_and_smooth(plan, boundary):
    before = plan.revision
    plan.press("r")
    plan.saved_since(before)
    assert of(plan, boundary)["xyz"][0][:2] == boundary["xyz"][-1][:2]
    plan.press("Shift+S")
    plan.saved_since(before + 1)
    assert of(plan, boundary)["review"] == "edited"


def test_one_key_sets_one_attribute(plan, boundary):
    before = plan.revision
    plan.press("z")
    lines = plan.saved_since(before)
    assert lines.condition[lines.id == boundary["id"]].tolist() == ["worn"]
    pressed = plan.page.get_attribute("button[data-column=condition][data-value=worn]", "aria-pressed")
    assert pressed == "true"
    # The same key again takes it away
    plan.press("z")
    lines = plan.saved_since(before + 1)
    assert lines.condition[lines.id == boundary["id"]].tolist() == [""]


def test_a_box_selects_and_one_key_changes_all(plan):
    plan.look_at_all()
    box = plan.page.locator(".plan-view .map").bounding_box()
    mouse = plan.page.mouse
    plan.page.keyboard.down("Shift")
    mouse.move(box["x"] + 5, box["y"] + 60)
    mouse.down()
    mouse.move(box["x"] + box["width"] - 5, box["y"] + box["height"] - 5, steps=5)
    mouse.up()
    plan.page.keyboard.up("Shift")
    wait_until(lambda: len(plan.selected) > 5)
    ids = plan.selected
    before = plan.revision
    plan.press("o")
    lines = plan.saved_since(before)
    assert set(lines.condition[np.isin(lines.id, ids)]) == {"good"}
    assert plan.revision == before + 1, "one act, one edit"


def test_the_kind_is_changed(plan, boundary):
    before = plan.revision
    plan.press("7")
    lines = plan.saved_since(before)
    assert lines["barrier"].length_m.max() == pytest.approx(boundary["length_m"], abs=0.01)


def test_a_line_is_deleted(plan, boundary):
    before = plan.revision
    plan.press("Delete")
    lines = plan.saved_since(before)
    assert boundary["id"] not in lines.id.tolist()


def test_a_line_is_drawn(plan):
    line = next(line for line in plan.documents().values() if line["kind"] == "lane_marking")
    places = [tuple(vertex[:2]) for vertex in line["xyz"][:9:4]]
    plan.look_at(places[1])
    plan.press("d")
    plan.click(places[0])
    assert "kind" in plan.message
    plan.page.select_option("select[name=kind]", "lane_marking")
    for place in places:
        plan.click(place)
    before = plan.revision
    plan.press("Enter")
    drawn = plan.saved_since(before)["lane_marking"]
    newest = drawn.review == "drawn"
    assert newest.sum() == 1
    xyz = drawn.take(newest).xyz
    assert np.hypot(*(xyz[0, :2] - places[0])) < 0.2
    assert np.isfinite(xyz[:, 2]).all()


def test_a_double_click_finishes_a_line(plan):
    line = next(line for line in plan.documents().values() if line["kind"] == "lane_marking")
    places = [tuple(vertex[:2]) for vertex in line["xyz"][:9:4]]
    plan.look_at(places[1])
    plan.press("d")
    plan.page.select_option("select[name=kind]", "lane_marking")
    before = plan.revision
    for place in places[:-1]:
        plan.click(place)
    plan.click(places[-1], click_count=2)
    drawn = plan.saved_since(before)["lane_marking"]
    newest = drawn.take(drawn.review == "drawn")
    assert np.diff(newest.offsets).tolist() == [3], "the second click of the two adds no vertex"


def test_measuring_tells_distance_and_height(plan, boundary):
    before = plan.revision
    a, b = boundary["xyz"][2], boundary["xyz"][-3]
    plan.press("Escape")
    plan.look_at_all()
    plan.press("m")
    plan.click(tuple(a[:2]))
    plan.click(tuple(b[:2]))
    wait_until(lambda: "height difference" in plan.message and "unknown" not in plan.message)
    distance_m = float(plan.message.split()[1])
    assert distance_m == pytest.approx(np.hypot(b[0] - a[0], b[1] - a[1]), abs=0.5)
    assert plan.revision == before


def test_the_history_says_who_did_what(plan, boundary):
    before = plan.revision
    plan.press("o")
    plan.saved_since(before)
    plan.page.get_by_role("tab", name="History", exact=True).click()
    plan.page.wait_for_selector(".record")
    newest = plan.page.inner_text(".record >> nth=0")
    record = plan.served.get("/api/history")[0]
    assert str(record["number"]) in newest
    assert record["who"] in newest


def test_a_place_that_is_no_place(plan):
    plan.press("/")
    plan.page.fill("input[name=go-to]", "north of here")
    plan.press("Enter")
    wait_until(lambda: "not a pair of coordinates" in plan.message)
