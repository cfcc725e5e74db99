"""The road image as the background of the plan, chosen by a button, over which lines are edited as over any other."""

from __future__ import annotations

from tests.workbench.page.plan_page import PlanPage, middle_of
from tests.workbench.serve_process import LONGEST_WAIT_S, wait_until

#: What takes longer hangs: it is no measure of speed. [ms]
LONGEST_MS = 1e3 * LONGEST_WAIT_S


def test_the_road_image_is_chosen_and_a_line_accepted_over_it(page, served):
    plan = PlanPage(page, served)
    line = max(
        (one for one in plan.documents().values() if one["kind"] == "lane_marking"),
        key=lambda one: one["length_m"],
    )
    place = middle_of(line["xyz"])
    plan.look_at(place, nearer=3)
    button = page.get_by_role("button", name="Road image", exact=True)
    button.focus()
    with page.expect_response(lambda answer: "/api/tiles/road/" in answer.url, timeout=LONGEST_MS) as tile:
        page.keyboard.press("Enter")
    assert button.get_attribute("aria-pressed") == "true"
    assert tile.value.status in (200, 204)
    plan.click(place)
    wait_until(lambda: plan.selected == [line["id"]])
    plan.press("a")
    wait_until(lambda: plan.documents()[line["id"]]["review"] == "accepted")
