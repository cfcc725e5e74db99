"""The straightened view in a real browser: the line unrolled, moved on by Space, and its nodes moved."""

from __future__ import annotations

import json

import numpy as np
import pytest
from tests.workbench.page.plan_page import PlanPage, middle_of, vertices
from tests.workbench.serve_process import opened_page, wait_until

CANVAS = ".straightened-view canvas"


@pytest.fixture
def plan(page, served):
    return PlanPage(page, served)


def _data(plan, name):
    return plan.page.locator(CANVAS).get_attribute(f"data-{name}") or ""


def _stretch(plan):
    return [float(value) for value in _data(plan, "stretch").split(",")]


def _unrolled(plan, kind, *, length="40"):
    """Show the straightened view of the longest line of a kind; return the line."""
    line = max(
        (each for each in plan.documents().values() if each["kind"] == kind),
        key=lambda each: each["length_m"],
    )
    plan.page.get_by_role("tab", name="Straightened", exact=True).click()
    plan.page.get_by_label("Length of the stretch", exact=True).select_option(length)
    plan.look_at(middle_of(line["xyz"]), nearer=2)
    plan.click(middle_of(line["xyz"]))
    wait_until(lambda: plan.selected == [line["id"]])
    wait_until(lambda: plan.page.get_attribute(".straightened-view", "data-axis") == line["id"])
    wait_until(lambda: int(_data(plan, "points") or 0) > 500)
    return line


def _vertices_of(lines, line):
    """Return the vertices that a line has in lines read once: an edit between two readings changes their order."""
    return vertices(lines, lines.id.tolist().index(line["id"]))


def _node(plan, strip):
    """Return the node nearest to the middle of the canvas."""
    nodes = json.loads(_data(plan, "nodes"))[strip]
    middle = plan.page.locator(CANVAS).bounding_box()["width"] / 2
    return min((node for node in nodes if node["vertex"]), key=lambda node: abs(node["px"][0] - middle))


def _drag(plan, node, by_px):
    box, mouse = plan.page.locator(CANVAS).bounding_box(), plan.page.mouse
    x, y = box["x"] + node["px"][0], box["y"] + node["px"][1]
    mouse.move(x, y)
    mouse.down()
    mouse.move(x, y + by_px / 2)
    mouse.move(x, y + by_px)
    mouse.up()


def _per_m(plan, strip):
    return next(scale["perM"] for scale in json.loads(_data(plan, "scales")) if scale["strip"] == strip)


def _across(before, vertex, place):
    """Return how far a place lies to the right of a line at one of its vertices [m]."""
    way = before[vertex + 1][:2] - before[vertex - 1][:2]
    step = place[:2] - before[vertex][:2]
    return (step[0] * way[1] - step[1] * way[0]) / np.hypot(*way)


def test_space_moves_20_m_on_and_the_other_views_with_it(plan):
    line = _unrolled(plan, "lane_marking", length="20")
    plan.page.locator(CANVAS).click(position={"x": 200, "y": 5})
    wait_until(lambda: plan.page.get_attribute(".straightened-view", "data-axis") == line["id"])
    plan.page.locator(".straightened-view").press("Home")
    assert _stretch(plan) == [-1.0, 19.0]
    before = plan.said("view")
    plan.press(" ")
    assert _stretch(plan) == [19.0, 39.0]
    wait_until(lambda: plan.said("view") != before)
    plan.press("Shift+ ")
    assert _stretch(plan) == [-1.0, 19.0]
    assert (
        "of " + f"{line['length_m']:.0f} m"
        in plan.page.locator(".straightened-view .pane-words").text_content()
    )
    # The images that look at the stretch; one shows its pair
    wait_until(lambda: int(plan.page.locator(".image-strip").get_attribute("data-images") or 0) >= 1)
    plan.page.locator(".image-strip button").first.click()


def test_a_node_moved_across_the_strip_moves_the_line(plan):
    line = _unrolled(plan, "lane_marking")
    before, revision = _vertices_of(plan.lines, line), plan.revision
    node = _node(plan, "plan")

    _drag(plan, node, 0.5 * _per_m(plan, "plan"))

    after = _vertices_of(plan.saved_since(revision), line)
    assert len(after) == len(before)
    moved = np.flatnonzero(np.hypot(*(after - before)[:, :2].T) > 0.001)
    assert moved.tolist() == [node["vertex"]]
    assert _across(before, node["vertex"], after[node["vertex"]]) == pytest.approx(0.5, abs=0.03)
    assert after[node["vertex"], 2] == pytest.approx(before[node["vertex"], 2], abs=0.1), (
        "on the road as before"
    )
    plan.press("Control+z")
    np.testing.assert_allclose(_vertices_of(plan.saved_since(revision + 1), line), before, atol=1e-3)


def test_a_node_of_the_strip_of_heights_sets_the_height_alone(plan):
    line = _unrolled(plan, "kerb_top")
    before, revision = _vertices_of(plan.lines, line), plan.revision
    assert "Kerb 0." in _data(plan, "height")
    node = _node(plan, "heights")

    _drag(plan, node, -0.1 * _per_m(plan, "heights"))

    lines = plan.saved_since(revision)
    i = lines.id.tolist().index(line["id"])
    after = vertices(lines, i)
    assert after[node["vertex"], 2] - before[node["vertex"], 2] == pytest.approx(0.1, abs=0.01)
    np.testing.assert_allclose(after[:, :2], before[:, :2], atol=1e-4)
    assert lines.review[i] == "edited"
    plan.press("Control+z")
    plan.saved_since(revision + 1)


def test_a_node_is_chosen_and_moved_by_keys_alone(plan):
    line = _unrolled(plan, "lane_marking")
    before, revision = _vertices_of(plan.lines, line), plan.revision
    view = plan.page.locator(".straightened-view")
    view.press("ArrowRight")
    view.press("ArrowRight")
    said = view.locator(".section-readout").text_content()
    vertex = int(said.split()[1]) - 1
    assert 0 < vertex < len(before) - 1, said
    for _ in range(20):
        view.press("Shift+ArrowDown")
    assert "+0.200 m to the right" in view.locator(".section-readout").text_content()
    view.press("Enter")

    after = _vertices_of(plan.saved_since(revision), line)
    assert _across(before, vertex, after[vertex]) == pytest.approx(0.2, abs=0.02)
    plan.press("Control+z")
    plan.saved_since(revision + 1)


def test_the_road_is_unrolled_without_a_selection(browser, served):
    with opened_page(browser, served) as page:
        plan = PlanPage(page, served)
        page.get_by_role("tab", name="Straightened", exact=True).click()
        page.get_by_label("Unroll", exact=True).select_option("road")
        wait_until(lambda: int(_data(plan, "points") or 0) > 500)
        assert page.get_attribute(".straightened-view", "data-axis") == "road"
        shown = set(json.loads(_data(plan, "lines")))
        kinds = {line["kind"] for line in plan.documents().values() if line["id"] in shown}
        assert "lane_marking" in kinds
