"""A template is made by clicks in the section, followed with a line, and found beside a saved one."""

from __future__ import annotations

import json

import numpy as np
import pytest
import shapely
from tests.workbench.page.plan_page import PlanPage, longest, middle_of
from tests.workbench.serve_process import wait_until

from linework.files.vectors.read_write import read_lines


@pytest.fixture(scope="module")
def truth(made_drive):
    return read_lines(made_drive / "truth.gpkg")


@pytest.fixture
def plan(page, served):
    return PlanPage(page, served)


def in_order(lines):
    return lines.take(np.argsort(lines.id))


def section_of(plan, line):
    """Select a line and show the section across it; return the canvas and where its nodes are drawn."""
    at = middle_of(line.xyz)
    plan.look_at(at, nearer=1)
    plan.press("v")
    plan.click(at)
    wait_until(lambda: line.id in plan.selected)
    plan.page.get_by_role("tab", name="Section").click()
    canvas = plan.page.locator(".section-view canvas")

    def nodes():
        return [
            node for node in json.loads(canvas.get_attribute("data-nodes") or "[]") if node["id"] == line.id
        ]

    wait_until(lambda: len(nodes()) > 0)
    return canvas, nodes


def pixels_per_metre(plan):
    return plan.page.locator(".section-view canvas").bounding_box()["width"] / 12.0


def make_template(plan, kerb, step):
    """Make a template of the top of a kerb and a line a metre beside it, by clicks in the section."""
    canvas, nodes = section_of(plan, kerb)
    plan.page.get_by_role("button", name="Make a template of this cross-section").click()
    plan.page.get_by_label("Name of the template").fill("kerb and verge")
    x, y = nodes()[0]["px"]
    scale = pixels_per_metre(plan)
    canvas.click(position={"x": x + 2, "y": y - scale * step})
    canvas.click(position={"x": x + scale, "y": y - scale * step})
    page = plan.page
    page.get_by_label("Name of node 1").fill("top")
    page.get_by_label("Edge of node 1").select_option("top")
    page.get_by_label("Kind of line of node 1").select_option("kerb_top")
    page.get_by_label("Name of node 2").fill("verge")
    page.get_by_label("Edge of node 2").select_option("fixed")
    page.get_by_label("Kind of line of node 2").select_option("edge_other")
    page.get_by_label("Role of node 2").fill("verge")
    page.get_by_role("button", name="Save", exact=True).click()
    wait_until(lambda: "is saved" in plan.message)


def kerb_of(plan):
    lines = plan.lines["road_boundary"]
    return lines[int(np.argmax(lines.length_m))]


def test_a_template_made_in_the_section_is_followed_with_a_line(plan, truth):
    kerb = kerb_of(plan)
    make_template(plan, kerb, 0.1)
    text = plan.served.lines.with_suffix(".templates.csv").read_text(encoding="utf-8")
    assert [row.split(",")[:3] for row in text.splitlines()[1:]] == [
        ["kerb and verge", "top", "top"], ["kerb and verge", "verge", "fixed"],
    ]  # fmt: skip
    before, revision = plan.lines, plan.revision
    plan.follow(middle_of(longest(truth, "road_boundary")), "road_boundary")
    assert plan.page.input_value("select[name=template]") == "kerb and verge"
    plan.wait_for("state", "stopped")
    assert "Template: 2 lines" in plan.card
    plan.press("Enter")
    saved = plan.saved_since(revision)
    made = saved.take(saved.method == "template")
    assert "edge_other" in made.kind
    beside = made["edge_other"][0]
    true = shapely.LineString(longest(truth, "road_boundary")[:, :2])
    off_m = shapely.distance(true, shapely.points(beside.xyz[:, :2]))
    assert np.median(off_m) == pytest.approx(1.0, abs=0.15)
    # All lines were one act, which is one act to undo
    plan.press("Control+z")
    assert in_order(plan.saved_since(revision + 1)) == in_order(before)


def test_a_template_is_found_beside_the_selected_line(plan):
    kerb = kerb_of(plan)
    if not plan.served.get("/api/templates")["templates"]:
        make_template(plan, kerb, 0.1)
    section_of(plan, kerb)
    before, revision = plan.lines, plan.revision
    plan.page.locator(".plan-view .map").focus()
    plan.press("Shift+T")
    made = plan.saved_since(revision)
    assert (made.method == "template").sum() >= 1
    assert kerb.id in made.id
    plan.press("Control+z")
    assert in_order(plan.saved_since(revision + 1)) == in_order(before)


def test_a_template_without_a_selected_line_says_what_to_do(plan):
    plan.press("Escape")
    plan.page.get_by_role("tab", name="Section").click()
    plan.page.get_by_role("button", name="Make a template of this cross-section").click()
    wait_until(lambda: "Select the line" in plan.message)
    assert plan.page.locator(".template-maker").is_hidden()


def test_nodes_are_measured_from_where_the_moved_section_crosses_the_line(plan):
    kerb = kerb_of(plan)
    canvas, nodes = section_of(plan, kerb)
    plan.page.get_by_role("button", name="Make a template of this cross-section").click()
    maker = plan.page.locator(".template-maker")
    before = nodes()[0]["px"]
    # Without a selected line, the section goes through the place itself
    plan.page.locator(".plan-view .map").focus()
    plan.press("Escape")
    wait_until(lambda: not plan.selected)
    east, north = middle_of(kerb.xyz)
    plan.look_at((east + 1.5, north + 1.5))
    wait_until(lambda: len(nodes()) == 1 and abs(nodes()[0]["px"][0] - before[0]) > 10)
    x, y = nodes()[0]["px"]
    canvas.click(position={"x": x + 0.5 * pixels_per_metre(plan), "y": y})
    assert float(plan.page.get_by_label("Distance across of node 1").input_value()) == pytest.approx(0.5, abs=0.05)  # fmt: skip
    assert maker.is_visible()
    plan.page.locator(".plan-view .map").focus()
    plan.look_at((east + 40.0, north + 40.0))
    wait_until(maker.is_hidden)
    assert "does not cross its line" in plan.message
