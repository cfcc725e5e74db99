"""The page without a mouse and for a screen reader: names, sizes of targets, parts reached by keys, and the help."""

from __future__ import annotations

import numpy as np
import pytest
from tests.workbench.page.plan_page import PlanPage, middle_of
from tests.workbench.serve_process import opened_page, wait_until

#: Name of an element as a screen reader says it, in short: its label, else its text.
NAMELESS = """() => {
  const shown = (e) => e.getClientRects().length > 0 && getComputedStyle(e).visibility !== "hidden";
  const nameOf = (e) => e.getAttribute("aria-label") || e.labels?.[0]?.textContent || e.title || e.textContent
    || e.getAttribute("placeholder") || e.closest("label")?.textContent || "";
  const all = [...document.querySelectorAll("button, input, select, a, summary, canvas, [tabindex='0'], [role=img], [role=tab]")];
  // The layers of the map are parts of the plan, which has a name
  return all.filter(shown).filter((e) => !e.matches(".map canvas")).filter((e) => nameOf(e).trim() === "").map((e) => e.outerHTML.slice(0, 120));
}"""
#: Targets of the mouse smaller than 24 by 24 pixels (WCAG 2.2, 2.5.8), by the label where there is one.
SMALL = """() => {
  const shown = (e) => e.getClientRects().length > 0 && getComputedStyle(e).visibility !== "hidden";
  const all = [...document.querySelectorAll("button, select, input, a, summary, [role=tab], tr[data-id], [role=row][data-id]")];
  return all.filter(shown).map((e) => e.closest("label") ?? e).filter((e) => {
    const box = e.getBoundingClientRect();
    return box.height < 23.5 || box.width < 23.5;
  }).map((e) => e.outerHTML.slice(0, 120));
}"""
TABS = (
    "Queue",
    "History",
    "Extract",
    "Export",
    "3-D",
    "Stereo",
    "Section",
    "Photolog",
    "Straightened",
    "Evidence",
    "Lines",
)


@pytest.fixture
def plan(page, served):
    return PlanPage(page, served)


@pytest.mark.parametrize("size", [(1280, 800), (1920, 1080)])
def test_everything_has_a_name_and_is_large_enough(browser, served, size):
    with opened_page(browser, served, viewport={"width": size[0], "height": size[1]}) as page:
        plan = PlanPage(page, served)
        wait_until(lambda: int(page.get_attribute(".queue-pane", "data-left") or 0) > 0)
        plan.press("n")
        wait_until(lambda: page.get_attribute(".evidence-pane", "data-key"))
        faults = {}
        for tab in TABS:
            page.get_by_role("tab", name=tab, exact=True).click()
            faults[tab] = page.evaluate(NAMELESS), page.evaluate(SMALL)
        assert faults == dict.fromkeys(TABS, ([], []))


def test_the_help_is_searched(plan):
    page = plan.page
    plan.press("?")
    page.wait_for_selector("dialog.help[open]")
    before = page.locator(".help dd").count()
    assert before > 40
    page.keyboard.type("bridge")
    titles = page.locator(".help dd").all_inner_texts()
    assert 2 <= len(titles) < before
    assert "Bridge the gap at the end" in titles
    assert "found" in page.inner_text(".help .found")
    page.keyboard.press("Control+a")
    page.keyboard.type("without a mouse")
    assert "F6" in page.inner_text(".help .topic p")
    page.keyboard.press("Control+a")
    page.keyboard.type("zzzz")
    assert page.inner_text(".help .found") == "Nothing found"
    page.keyboard.press("Escape")
    page.keyboard.press("Escape")
    wait_until(lambda: page.locator("dialog.help[open]").count() == 0)


def test_a_line_is_chosen_and_one_is_drawn_by_keys_alone(plan):
    page = plan.page
    marking = max(
        (line for line in plan.documents().values() if line["kind"] == "lane_marking"),
        key=lambda line: line["length_m"],
    )
    plan.look_at(middle_of(marking["xyz"]), nearer=1)
    # From part to part until the plan has the focus
    for _ in range(5):
        plan.press("F6")
        if "map" in (page.evaluate("document.activeElement.className") or ""):
            break
    assert "Plan view" in page.evaluate("document.activeElement.getAttribute('aria-label')")
    plan.press("Control+Enter")
    wait_until(lambda: plan.selected == [marking["id"]])
    # The arrow keys move the plan, by a sixtieth of which Shift moves it
    view = [float(value) for value in plan.said("view").split(",")]
    plan.press("ArrowRight")
    wait_until(lambda: float(plan.said("view").split(",")[0]) != view[0])
    assert float(plan.said("view").split(",")[0]) - view[0] == pytest.approx(60 * view[2], rel=0.02)
    # Two places drawn
    revision = plan.revision
    plan.press("d")
    page.select_option("select[name=kind]", "fence")
    for _ in range(5):
        plan.press("F6")
        if "map" in (page.evaluate("document.activeElement.className") or ""):
            break
    plan.press("Control+Enter")
    for _ in range(3):
        plan.press("ArrowUp")
    plan.press("Control+Enter", "Enter")
    lines = plan.saved_since(revision)
    drawn = lines["fence"]
    drawn = drawn.take(drawn.review == "drawn")
    assert len(drawn) == 1
    assert np.hypot(*(drawn.xyz[1] - drawn.xyz[0])[:2]) == pytest.approx(180 * view[2], rel=0.05)
    plan.press("Control+z")
    plan.saved_since(revision + 1)
