"""What the plan view shows: the image under the lines, and the kinds of lines that are switched off."""

from __future__ import annotations

import pytest
from tests.workbench.page.plan_page import PlanPage, middle_of
from tests.workbench.serve_process import wait_until


@pytest.fixture
def plan(page, served):
    return PlanPage(page, served)


def test_another_image_is_asked_for_and_none_at_all(plan):
    asked = []
    plan.page.on("request", lambda request: asked.append(request.url))
    row = plan.page.locator(".image-switch")
    for name in ("height", "density"):
        with plan.page.expect_response(lambda answer, name=name: f"/api/tiles/{name}/" in answer.url):
            row.locator(f"button[data-image={name}]").click()
        pressed = row.locator("button[aria-pressed=true]").get_attribute("data-image")
        assert pressed == name
    row.get_by_text("No image", exact=True).click()
    plan.page.wait_for_load_state("networkidle")
    asked.clear()
    plan.look_at(middle_of(plan.served.get("/api/survey")["path"]), nearer=2)
    plan.page.wait_for_load_state("networkidle")
    assert [url for url in asked if "/api/tiles/" in url] == []


def test_a_kind_that_is_switched_off_cannot_be_clicked(plan):
    lines = [line for line in plan.documents().values() if line["kind"] == "lane_marking"]
    line = max(lines, key=lambda line: line["length_m"])
    counted = plan.page.locator(".legend .row", has=plan.page.locator("input[name=show-lane_marking]"))
    assert counted.locator(".count").text_content() == str(len(lines))
    plan.look_at(middle_of(line["xyz"]), nearer=3)
    plan.page.evaluate("document.querySelector('.legend').open = true")
    for kind in ("lane_marking", "lane_marking_dash"):
        plan.page.uncheck(f"input[name=show-{kind}]")
    plan.page.evaluate("document.querySelector('.legend').open = false")
    plan.click(middle_of(line["xyz"]))
    plan.press("Escape")
    assert line["id"] not in plan.selected
    plan.page.evaluate("document.querySelector('.legend').open = true")
    plan.page.check("input[name=show-lane_marking]")
    plan.page.evaluate("document.querySelector('.legend').open = false")
    plan.click(middle_of(line["xyz"]))
    wait_until(lambda: plan.selected == [line["id"]])


def test_points_are_coloured_by_their_class_and_again_when_lines_change(plan):
    classes = plan.page.locator(".image-classes")
    assert not classes.is_visible()
    with plan.page.expect_response(lambda answer: "/api/tiles/class/" in answer.url and answer.status == 200):
        plan.page.locator("button[data-image=class]").click()
        plan.look_at(middle_of(plan.served.get("/api/survey")["path"]), nearer=2)
    assert classes.locator("> span").all_text_contents()[:6] == [
        "Other", "Verge", "Vegetation", "Footway", "Road", "Kerb"
    ]  # fmt: skip
    line = max(
        (one for one in plan.documents().values() if one["kind"] == "lane_marking"),
        key=lambda one: one["length_m"],
    )
    plan.look_at(middle_of(line["xyz"]), nearer=3)
    plan.click(middle_of(line["xyz"]))
    wait_until(lambda: plan.selected == [line["id"]])
    with plan.page.expect_response(lambda answer: "/api/tiles/class/" in answer.url):
        plan.press("Delete")
    plan.page.locator("button[data-image=height]").click()
    assert not classes.is_visible()
