"""New lines from old in the plan view: one beside the selected line, by a key or two where the mouse is."""

from __future__ import annotations

import numpy as np
import pytest
from tests.workbench.page.plan_page import PlanPage, middle_of
from tests.workbench.serve_process import wait_until


@pytest.fixture
def plan(page, served):
    return PlanPage(page, served)


@pytest.fixture
def marking(plan):
    """Return the longest lane marking, selected, its middle in the middle of the plan."""
    line = max(
        (line for line in plan.documents().values() if line["kind"] == "lane_marking"),
        key=lambda line: line["length_m"],
    )
    plan.look_at(middle_of(line["xyz"]), nearer=1)
    plan.click(middle_of(line["xyz"]))
    wait_until(lambda: plan.selected == [line["id"]])
    return line


def aside(line, vertex, metres):
    """Return the place so far to the left of a vertex."""
    before, here, after = (np.array(line["xyz"][vertex + k][:2]) for k in (-1, 0, 1))
    way = (after - before) / np.hypot(*(after - before))
    return tuple(here + metres * np.array([-way[1], way[0]]))


def hover(plan, place):
    """Move the mouse to a place: the plan hears of it on its way."""
    east, north = plan.pixel(place)
    plan.page.mouse.move(east + 40, north + 40)
    plan.page.mouse.move(east, north, steps=5)


def test_a_line_beside_one_is_as_long_and_selected(plan, marking):
    place, before = aside(marking, len(marking["xyz"]) // 2, 1.0), plan.revision
    hover(plan, place)
    plan.press("Shift+P")
    plan.saved_since(before)
    wait_until(lambda: plan.selected not in ([], [marking["id"]]))
    new = plan.documents()[plan.selected[0]]
    assert (new["kind"], new["review"]) == ("lane_marking", "drawn")
    assert new["length_m"] == pytest.approx(marking["length_m"], rel=0.1)
    assert min(np.hypot(e - place[0], n - place[1]) for e, n, _ in new["xyz"]) < 1.1


def test_a_line_beside_one_begins_and_ends_where_the_mouse_was(plan, marking):
    middle = len(marking["xyz"]) // 2
    ends, before = [aside(marking, middle + k, -1.0) for k in (-2, 2)], plan.revision
    for place, key in zip(ends, ("Shift+O", "Shift+P"), strict=True):
        hover(plan, place)
        plan.press(key)
    plan.saved_since(before)
    wait_until(lambda: plan.selected not in ([], [marking["id"]]))
    new = np.array(plan.documents()[plan.selected[0]]["xyz"])[:, :2]
    for place in ends:
        assert np.hypot(*(new[[0, -1]] - place).T).min() < 0.1
