"""The review queue, worked by keys alone."""

from __future__ import annotations

import pytest
from tests.workbench.page.plan_page import PlanPage, middle_of
from tests.workbench.serve_process import opened_page, wait_until


@pytest.fixture
def plan(page, served):
    return PlanPage(page, served)


def _left(plan):
    return int(plan.page.get_attribute(".queue-pane", "data-left") or -1)


def _current(plan):
    return plan.page.get_attribute(".queue-pane", "data-current") or ""


def test_the_queue_is_worked_by_keys(plan, served):
    items = served.get("/api/queue")
    assert items, "the drive has something to look at"
    wait_until(lambda: _left(plan) == len(items))
    # Next looks at the first, back and next go round
    plan.press("n")
    wait_until(lambda: _current(plan) == items[0]["key"])
    assert set(plan.selected) == set(items[0]["ids"])
    for _ in items:
        plan.press("n")
    assert _current(plan) == items[0]["key"]
    plan.press("n", "p")
    assert _current(plan) == items[0]["key"]
    # Nothing to do here: it is gone, for everybody and for good
    before = plan.revision
    plan.press("q")
    wait_until(lambda: _left(plan) == len(items) - 1)
    assert items[0]["key"] not in {item["key"] for item in served.get("/api/queue")}
    plan.press("Control+z")
    wait_until(lambda: _left(plan) == len(items))
    assert plan.revision > before


def test_a_proposal_is_taken(browser, served):
    line = next(line for line in served.get("/api/lines")["lines"] if line["kind"] == "kerb_top")
    east, north, _ = line["xyz"][0]
    item = {
        "key": "k", "type": "line", "ids": [line["id"]], "kind": line["kind"], "at": [east, north],
        "box": [east - 5, north - 5, east + 5, north + 5], "length_m": 5.0, "confidence": 0.1,
        "reason": "unsure", "proposal": {"action": "reject", "ids": [line["id"]]},
    }  # fmt: skip
    with opened_page(browser, served) as page:
        page.route("**/api/queue", lambda route: route.fulfill(json=[item]))
        page.reload()
        plan = PlanPage(page, served)
        wait_until(lambda: _left(plan) == 1)
        plan.press("n")
        wait_until(lambda: _current(plan) == "k")
        plan.press("y")
        wait_until(lambda: plan.documents()[line["id"]]["review"] == "rejected")
        plan.press("Control+z")
        wait_until(lambda: plan.documents()[line["id"]]["review"] == "")


def test_what_is_sure_is_accepted_by_one_key_and_the_plan_stays(browser, served):
    lines = [line for line in served.get("/api/lines")["lines"] if line["kind"] == "road_boundary"]
    ids = [line["id"] for line in lines]
    east, north, _ = lines[0]["xyz"][0]
    item = {
        "key": "sure", "type": "sure", "ids": ids, "kind": "road_boundary", "at": [east, north],
        "box": [east - 5, north - 5, east + 5, north + 5], "length_m": 0.0, "confidence": 0.98,
        "reason": "some lines", "proposal": {"action": "accept", "ids": ids},
    }  # fmt: skip
    queue = [item]
    with opened_page(browser, served) as page:
        page.route("**/api/queue", lambda route: route.fulfill(json=queue))
        page.reload()
        plan = PlanPage(page, served)
        wait_until(lambda: _left(plan) == 1)
        assert page.locator(".item .what").inner_text() == "Nothing to check"
        assert page.locator(".item .length").inner_text() == ""
        plan.press("n")
        wait_until(lambda: _current(plan) == "sure")
        # Not before: the page may still ask for the queue as it was
        page.on("request", lambda request: queue.clear() if request.url.endswith("/api/changes") else None)
        plan.press("y")
        wait_until(lambda: all(plan.documents()[name]["review"] == "accepted" for name in ids))
        # The page goes to the next item once it has the answer
        page.wait_for_selector(".queue-pane[data-left='0']", state="attached")
        # An undo within view does not move the plan
        place = lines[0]["xyz"][len(lines[0]["xyz"]) // 2]
        plan.look_at((place[0], place[1]))
        view = page.get_attribute(".plan-view", "data-view")
        plan.press("Control+z")
        wait_until(lambda: all(plan.documents()[name]["review"] == "" for name in ids))
        assert page.get_attribute(".plan-view", "data-view") == view


def test_an_item_comes_with_its_evidence_and_one_key_decides(browser, served):
    lines = served.get("/api/lines")["lines"]
    kerb, marking = (
        next(line for line in lines if line["kind"] == kind) for kind in ("road_boundary", "lane_marking")
    )
    items = []
    for line in (kerb, marking):
        east, north, _ = line["xyz"][len(line["xyz"]) // 2]
        items.append({
            "key": f"line {line['id']}", "type": "line", "ids": [line["id"]], "kind": line["kind"], "at": [east, north],
            "box": [east - 5, north - 5, east + 5, north + 5], "length_m": 5.0, "confidence": 0.5,
            "reason": "50 % sure", "proposal": None,
        })  # fmt: skip
    with opened_page(browser, served) as page:
        page.route("**/api/queue", lambda route: route.fulfill(json=items))
        page.reload()
        plan = PlanPage(page, served)
        wait_until(lambda: _left(plan) == 2)
        plan.press("n")
        pane = page.locator(".evidence-pane")
        wait_until(lambda: pane.get_attribute("data-key") == items[0]["key"])
        text = pane.inner_text()
        assert "Step" in text
        assert "50 % sure" in text
        assert "X: reject it" in text
        charts = [chart.get_attribute("aria-label") for chart in pane.locator("svg").all()]
        assert charts[0].startswith("Height from the line")
        assert "What the fit leaves" in charts
        wait_until(lambda: pane.locator(".evidence-images canvas").count() >= 2)
        # One key decides, and the evidence of the next item follows
        plan.press("x")
        wait_until(lambda: plan.documents()[kerb["id"]]["review"] == "rejected")
        wait_until(lambda: pane.get_attribute("data-key") == items[1]["key"])
        assert "Contrast" in pane.inner_text()
        # A tab that was chosen stays
        page.get_by_role("tab", name="Section", exact=True).click()
        plan.press("n")
        assert page.get_by_role("tab", name="Section", exact=True).get_attribute("aria-selected") == "true"
        plan.press("Control+z")
        wait_until(lambda: plan.documents()[kerb["id"]]["review"] == "")


def test_an_undo_of_a_line_that_only_crosses_the_view_does_not_move_the_plan(plan, served):
    markings = (line for line in plan.documents().values() if line["kind"] == "lane_marking")
    xyz = max(markings, key=lambda line: line["length_m"])["xyz"]
    ends = [xyz[0][:2], xyz[-1][:2]]
    place = (0.5 * (ends[0][0] + ends[1][0]), 0.5 * (ends[0][1] + ends[1][1]))
    draw = {"action": "draw", "kind": "lane_marking", "xyz": ends}
    (drawn,) = served.post("/api/changes", {"revision": plan.revision, "edit": draw})["lines"]
    delete = {"action": "delete", "ids": [drawn["id"]]}
    served.post("/api/changes", {"revision": served.get("/api/survey")["revision"], "edit": delete})
    plan.look_at(place, nearer=3)
    east, north, resolution = (float(value) for value in plan.said("view").split(","))
    plan.press("Control+z")
    wait_until(lambda: plan.selected == [drawn["id"]])
    plan.press("+")
    wait_until(lambda: float(plan.said("view").split(",")[2]) == pytest.approx(resolution / 2, rel=0.01))
    assert plan.said("view").split(",")[:2] == [str(east), str(north)]


def test_lines_are_accepted_and_rejected(plan):
    first, second, *_ = (line for line in plan.documents().values() if line["kind"] == "lane_marking")
    before = plan.revision
    for line, key, review in ((first, "a", "accepted"), (second, "x", "rejected")):
        place = line["xyz"][len(line["xyz"]) // 2]
        plan.look_at((place[0], place[1]))
        plan.click((place[0], place[1]))
        wait_until(lambda line=line: plan.selected == [line["id"]])
        plan.press(key)
        wait_until(lambda line=line, review=review: plan.documents()[line["id"]]["review"] == review)
    lines = plan.saved_since(before + 1)
    assert lines.review[lines.id == first["id"]].tolist() == ["accepted"]
    assert second["id"] not in lines.id.tolist(), "readers do not see what is rejected"
    plan.press("Shift+X")
    wait_until(lambda: plan.documents()[second["id"]]["review"] != "rejected")
    assert second["id"] in plan.lines.id.tolist()


def test_the_report_by_chainage_is_of_the_lines_as_they_are(plan):
    rejected = next(line for line in plan.documents().values() if line["kind"] == "lane_marking")
    place = rejected["xyz"][len(rejected["xyz"]) // 2]
    plan.look_at((place[0], place[1]))
    plan.click((place[0], place[1]))
    wait_until(lambda: plan.selected == [rejected["id"]])
    plan.press("x")
    wait_until(lambda: plan.documents()[rejected["id"]]["review"] == "rejected")
    plan.page.get_by_role("tab", name="Extract", exact=True).click()
    plan.page.get_by_label("Interval", exact=True).select_option("20")
    plan.page.get_by_label("Limits", exact=True).select_option("uk")
    with plan.page.context.expect_page() as opened:
        plan.page.locator("a.chainage").click()
    report = opened.value
    report.wait_for_load_state()
    text = report.locator("body").inner_text()
    assert "interval\n20 m" in text and "upstand" in text
    assert rejected["id"] not in text
    assert report.locator("img").count() >= 2
    report.close()
    plan.press("Shift+X")
    wait_until(lambda: plan.documents()[rejected["id"]]["review"] != "rejected")


def test_a_stretch_of_road_is_looked_over(browser, served):
    line = next(line for line in served.get("/api/lines")["lines"] if line["kind"] == "lane_marking")
    (item,) = (item for item in served.get("/api/queue") if item["type"] == "stretch")
    assert (item["ids"], item["kind"], item["proposal"]) == ([], "", None)
    with opened_page(browser, served) as page:
        plan = PlanPage(page, served)
        wait_until(lambda: _left(plan) > 0)
        page.locator(f".queue [data-key='{item['key']}']").click()
        pane = page.locator(".evidence-pane")
        wait_until(lambda: pane.get_attribute("data-key") == item["key"])
        text = pane.inner_text()
        assert "Look over the road" in text and "nobody has checked" in text
        assert "Q: looked over" in text
        wait_until(lambda: pane.locator(".evidence-images canvas").count() >= 2)
        # What is seen to be wrong is rejected, and one stays at the stretch
        plan.click(middle_of(line["xyz"]))
        wait_until(lambda: plan.selected == [line["id"]])
        plan.press("x")
        wait_until(lambda: plan.documents()[line["id"]]["review"] == "rejected")
        wait_until(lambda: _current(plan) == item["key"])
        # What is missing is followed from a click
        plan.press("Shift+F")
        wait_until(lambda: "Click beside the line that is missing" in plan.message)
        plan.press("Escape", "q")
        wait_until(lambda: item["key"] not in {one["key"] for one in served.get("/api/queue")})
        wait_until(lambda: _current(plan) != item["key"])
        for _ in range(2):
            revision = plan.revision
            plan.press("Control+z")
            wait_until(lambda revision=revision: plan.revision > revision)
        assert plan.documents()[line["id"]]["review"] == ""
