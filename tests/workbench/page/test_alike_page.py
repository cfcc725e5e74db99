"""The same fault elsewhere: listed after an edit, looked at, and mended together as one edit, by keys alone."""

from __future__ import annotations

import pytest
from tests.workbench.alike_lines import drawn_dashes
from tests.workbench.page.plan_page import PlanPage, middle_of
from tests.workbench.serve_process import opened_page, wait_until


@pytest.fixture
def dashes(served):
    return drawn_dashes(served)


def listed(lines, number, mend):
    """What a server says that found some lines alike; nothing is taken in before a look."""
    items = [
        {"id": line["id"], "at": middle_of(line["xyz"]), "box": [line["xyz"][0][0] - 5, line["xyz"][0][1] - 5, line["xyz"][0][0] + 5, line["xyz"][0][1] + 5],
         "length_m": line["length_m"], "reason": "like it in length", "is_very": k == 0}
        for k, line in enumerate(lines)
    ]  # fmt: skip
    return {"edit": number, "kind": lines[0]["kind"], "mend": mend, "n_looked": 20, "items": items}


def said(plan, name):
    return plan.page.get_attribute(".alike-pane", f"data-{name}")


def reviews(plan, lines):
    documents = plan.documents()
    return [documents[line["id"]]["review"] for line in lines]


def test_the_same_fault_is_mended_elsewhere_as_one_edit(browser, served, dashes):
    taught, *others = dashes[:4]
    with opened_page(browser, served) as page:
        asked = []

        def answer(route):
            asked.append(int(route.request.url.rpartition("=")[2]))
            route.fulfill(json=listed(others, asked[-1], {"action": "reject"}))

        page.route("**/api/alike?edit=*", answer)
        plan = PlanPage(page, served)
        plan.look_at(middle_of(taught["xyz"]))
        plan.click(middle_of(taught["xyz"]))
        wait_until(lambda: plan.selected == [taught["id"]])
        plan.press("x")
        wait_until(lambda: said(plan, "left") == "3")
        assert asked == [plan.revision]
        assert "3 other lines like this: Shift N" in plan.message
        # One key looks at each in turn, one takes it in or leaves it out
        plan.press("Shift+N")
        wait_until(lambda: plan.selected == [others[0]["id"]])
        assert said(plan, "taken") == "0"
        plan.press("Shift+A")
        wait_until(lambda: said(plan, "taken") == "1")
        plan.press("Shift+A", "Shift+N")
        wait_until(lambda: plan.selected == [others[1]["id"]])
        assert said(plan, "taken") == "0"
        plan.press("Shift+A", "Shift+N", "Shift+A")
        wait_until(lambda: said(plan, "taken") == "2")
        assert reviews(plan, others) == ["", "", ""], "nothing is done before it is asked for"
        before = plan.revision
        plan.press("Shift+M")
        wait_until(lambda: reviews(plan, others) == ["", "rejected", "rejected"])
        # The file may be read before the page has heard of the edit
        wait_until(lambda: plan.revision > before)
        assert plan.revision == before + 1
        wait_until(lambda: said(plan, "left") == "1")
        assert asked == [before], "mending teaches nothing anew"
        # One undo takes all of it back, and they are listed again
        plan.press("Control+z")
        wait_until(lambda: reviews(plan, [taught, *others]) == ["rejected", "", "", ""])
        wait_until(lambda: said(plan, "left") == "3")
        # Another takes back what taught it, and nothing is listed any more
        plan.press("Control+z")
        wait_until(lambda: said(plan, "left") == "0")
        assert "Nothing taught yet" in page.inner_text(".alike-pane .progress")


def test_a_changed_attribute_is_set_elsewhere_and_other_edits_teach_nothing(browser, served, dashes):
    taught, other = dashes[4:6]
    with opened_page(browser, served) as page:
        page.route(
            "**/api/alike?edit=*",
            lambda route: route.fulfill(
                json=listed([other], 1, {"action": "kind", "kind": "road_marking_other"})
            ),
        )
        plan = PlanPage(page, served)
        plan.look_at(middle_of(taught["xyz"]))
        plan.click(middle_of(taught["xyz"]))
        wait_until(lambda: plan.selected == [taught["id"]])
        plan.press("a")
        wait_until(lambda: reviews(plan, [taught]) == ["accepted"])
        assert said(plan, "left") == "0"
        plan.press("3")
        wait_until(lambda: plan.documents()[taught["id"]]["kind"] == "road_marking_other")
        wait_until(lambda: said(plan, "left") == "1")
        page.get_by_role("tab", name="Alike", exact=True).click()
        assert "To change to Other marking" in page.inner_text(".alike-pane .progress")
        plan.press("Shift+N", "Shift+A", "Shift+M")
        wait_until(lambda: plan.documents()[other["id"]]["kind"] == "road_marking_other")
        assert plan.documents()[other["id"]]["review"] == "edited"
        for _ in range(3):
            before = plan.revision
            plan.press("Control+z")
            wait_until(lambda before=before: plan.revision > before)
