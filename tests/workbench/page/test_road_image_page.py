"""The road image as the background of the plan, chosen by a button, over which lines are edited as over any other."""

from __future__ import annotations

from tests.workbench.page.plan_page import PlanPage, middle_of
from tests.workbench.serve_process import wait_until


def test_the_road_image_is_chosen_and_a_line_accepted_over_it(page, served):
    plan = PlanPage(page, served)
    drawn = []
    page.on("response", lambda answer: drawn.append(answer) if "/api/tiles/road/" in answer.url else None)
    line = max(
        (one for one in plan.documents().values() if one["kind"] == "lane_marking"),
        key=lambda one: one["length_m"],
    )
    place = middle_of(line["xyz"])
    plan.look_at(place, nearer=3)
    button = page.get_by_role("button", name="Road image", exact=True)
    button.focus()
    page.keyboard.press("Enter")
    assert button.get_attribute("aria-pressed") == "true"
    wait_until(lambda: any(answer.status == 200 for answer in drawn))
    assert {answer.status for answer in drawn} <= {200, 204}
    plan.click(place)
    wait_until(lambda: plan.selected == [line["id"]])
    plan.press("a")
    wait_until(lambda: plan.documents()[line["id"]]["review"] == "accepted")
