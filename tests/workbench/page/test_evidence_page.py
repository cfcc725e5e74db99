"""The evidence beside the queue: never that of another item, images about the item's lines, keys that do something."""

from __future__ import annotations

import contextlib

import pytest
from tests.workbench.page.plan_page import PlanPage, middle_of
from tests.workbench.serve_process import opened_page, wait_until

IMAGE_WIDTH = 732


def item_of(line, **more):
    """Return an item of the queue about a line."""
    east, north = middle_of(line["xyz"])
    return {
        "key": f"line {line['id']}", "type": "line", "ids": [line["id"]], "kind": line["kind"], "at": [east, north],
        "box": [east - 5, north - 5, east + 5, north + 5], "length_m": 5.0, "confidence": 0.5,
        "reason": f"about {line['kind']}", "proposal": None,
    } | more  # fmt: skip


@pytest.fixture
def lines(served):
    return served.get("/api/lines")["lines"]


@pytest.fixture
def first_of(lines):
    return lambda kind: next(line for line in lines if line["kind"] == kind)


@contextlib.contextmanager
def queue_of(browser, served, items):
    """A page whose queue has these items, and its evidence pane."""
    with opened_page(browser, served) as page:
        page.route("**/api/queue", lambda route: route.fulfill(json=items))
        page.reload()
        plan = PlanPage(page, served)
        wait_until(lambda: page.get_attribute(".queue-pane", "data-left") == str(len(items)))
        yield plan, page.locator(".evidence-pane")


def test_what_is_shown_of_an_item_is_never_that_of_the_one_before(browser, served, first_of):
    """Its title, reason and keys stand there at once: a key decides on the item that is looked at."""
    items = [item_of(first_of("road_boundary")), item_of(first_of("lane_marking"))]
    with queue_of(browser, served, items) as (plan, pane):
        plan.press("n")
        wait_until(lambda: pane.get_attribute("data-key") == items[0]["key"])
        held = []
        plan.page.route("**/api/evidence**", lambda route: held.append(route))
        plan.press("n")
        wait_until(lambda: plan.page.wait_for_timeout(20) or held)
        text = pane.inner_text()
        assert "about lane_marking" in text and "A: accept it" in text
        assert "about road_boundary" not in text and "Step" not in text
        assert pane.locator("svg, canvas").count() == 0
        # What is held may be asked about the item before; the question about this one comes after it
        plan.page.unroute("**/api/evidence**")
        for route in held:
            route.continue_()
        wait_until(lambda: pane.get_attribute("data-key") == items[1]["key"])
        assert "Contrast" in pane.inner_text()


def test_the_next_item_does_not_wait_for_the_images_of_the_one_before(browser, served, first_of):
    items = [item_of(first_of("road_boundary")), item_of(first_of("lane_marking"))]
    with queue_of(browser, served, items) as (plan, pane):
        held = []
        plan.page.route("**/api/pairs/*/lines", lambda route: held.append(route))
        plan.press("n")
        wait_until(lambda: plan.page.wait_for_timeout(20) or held)
        plan.press("n")
        wait_until(lambda: pane.get_attribute("data-key") == items[1]["key"])
        for route in held:
            route.abort()


def test_until_the_queue_is_there_the_page_says_so(browser, served, first_of):
    items, held = [item_of(first_of("lane_marking"))], []
    answer = held.append
    with opened_page(browser, served) as page:
        page.route("**/api/queue", lambda route: answer(route))
        page.reload()
        plan = PlanPage(page, served)
        wait_until(lambda: "Looking through" in page.inner_text(".queue-pane .progress"))
        plan.press("n")
        wait_until(lambda: "Looking through" in plan.message)

        def answer(route):  # the page may ask again, and drops the answer to the question before
            route.fulfill(json=items)

        for route in held:
            answer(route)
        wait_until(lambda: page.get_attribute(".queue-pane", "data-left") == "1")
        assert "1 to review" in page.inner_text(".queue-pane .progress")


def test_when_all_is_settled_nothing_is_shown(browser, served, first_of):
    items = [item_of(first_of("lane_marking"))]
    with queue_of(browser, served, items) as (plan, pane):
        plan.press("n")
        wait_until(lambda: pane.get_attribute("data-key") == items[0]["key"])
        # Not before: the page may still ask for the queue as it was
        plan.page.on(
            "request", lambda request: items.clear() if request.url.endswith("/api/changes") else None
        )
        plan.press("q")
        wait_until(lambda: pane.get_attribute("data-key") is None)
        assert "about lane_marking" not in pane.inner_text()
        plan.press("Control+z")


def test_images_show_the_part_about_the_line(browser, served, lines):
    items = [item_of(min(lines, key=lambda line: line["length_m"]))]
    with queue_of(browser, served, items) as (plan, pane):
        plan.press("n")
        wait_until(lambda: pane.locator(".evidence-images canvas").count() >= 2)
        parts = [each.get_attribute("data-part") for each in pane.locator(".evidence-images canvas").all()]
        widths = [float(part.split()[2]) for part in parts]
        assert min(widths) < 0.9 * IMAGE_WIDTH
        assert min(widths) >= IMAGE_WIDTH // 3


def test_only_images_that_are_shown_are_asked_for(browser, served, first_of):
    with queue_of(browser, served, [item_of(first_of("lane_marking"))]) as (plan, pane):
        asked = []
        plan.page.on("request", lambda request: asked.append(request.url))
        plan.press("n")
        wait_until(lambda: pane.locator(".evidence-images canvas").count() >= 2)
        assert sum(url.endswith("/left") for url in asked) == pane.locator(".evidence-images canvas").count()
        assert not [url for url in asked if url.endswith("/right")]


def test_of_an_item_of_several_lines_it_says_which_is_shown(browser, served, lines):
    ids = [line["id"] for line in lines[:3]]
    items = [item_of(lines[0], key="rest 1", type="rest", ids=ids)]
    with queue_of(browser, served, items) as (plan, pane):
        plan.press("n")
        wait_until(lambda: pane.get_attribute("data-key") == items[0]["key"])
        assert "the first of 3 lines" in pane.inner_text()


def test_a_gap_of_one_line_is_not_joined(browser, served, lines):
    one, other, *_ = (line for line in lines if line["kind"] == "lane_marking")
    items = [
        item_of(one, key="gap 1", type="gap"),
        item_of(one, key="gap 2", type="gap", ids=[one["id"], other["id"]]),
    ]
    with queue_of(browser, served, items) as (plan, pane):
        for item, is_joined in zip(items, (False, True), strict=True):
            plan.press("n")
            wait_until(lambda item=item: pane.get_attribute("data-key") == item["key"])
            assert ("J: join" in pane.inner_text()) is is_joined


@pytest.mark.parametrize(
    ("kind", "roles", "forms"),
    [("lane_marking", ["edge", "lane", "centre"], []), ("kerb_top", [], ["kerb", "edge", "barrier"])],
)
def test_only_what_a_kind_can_have_is_offered(page, served, first_of, kind, roles, forms):
    plan, line = PlanPage(page, served), first_of(kind)
    plan.look_at(middle_of(line["xyz"]), nearer=2)
    plan.click(middle_of(line["xyz"]))
    wait_until(lambda: plan.selected == [line["id"]])

    def offered(column):
        buttons = page.locator(f".attributes button[data-column={column}]:visible")
        return [button.get_attribute("data-value") for button in buttons.all()]

    assert (offered("role"), offered("form")) == (roles, forms)
    assert offered("condition") == ["good", "worn", "damaged", "missing"]
