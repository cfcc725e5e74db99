"""Drawing by hand snaps to the edge under the cursor; Alt holds it off, Shift E turns it off and on."""

from __future__ import annotations

from urllib.parse import parse_qs, urlsplit

import numpy as np
import pytest
from tests.workbench.hand_drawn import hands, off
from tests.workbench.page.plan_page import PlanPage
from tests.workbench.serve_process import wait_until

from linework.files.vectors.read_write import read_lines

KIND = "lane_marking"


@pytest.fixture
def plan(page, served):
    plan = PlanPage(page, served)
    yield plan
    plan.undo_all()


@pytest.fixture
def beside(served):
    """Return two places 8 cm beside one true marking which the server snaps to it, and the marking."""
    truth = read_lines(served.survey / "truth.gpkg")
    found = {}
    for place, xy, heading in hands(truth, KIND, np.random.default_rng(4)):
        query = f"/api/snap?kind={KIND}&east={place[0]}&north={place[1]}&reach_m=0.3"
        # The first vertex has no direction yet
        answers = [served.get(query + more)["found"] for more in ("", f"&heading_deg={heading}")]
        if all(one is not None and off(np.array(one["at"]), xy) < 0.02 for one in answers):
            line, places = found.setdefault(id(xy), (xy, []))
            places.append((float(place[0]), float(place[1])))
            if len(places) == 2:
                return places, line
    raise AssertionError("no marking is snapped to at two places")


def drawn(plan, places, modifiers=()):
    """Draw a line through places and return its saved vertices in plan."""
    plan.look_at(tuple(np.mean(places, axis=0)), nearer=1)
    plan.press("d")
    plan.page.select_option("select[name=kind]", KIND)
    before = plan.revision
    for key in modifiers:
        plan.page.keyboard.down(key)
    for place in places:
        plan.click(place)
    for key in modifiers:
        plan.page.keyboard.up(key)
    plan.press("Enter")
    lines = plan.saved_since(before)[KIND]
    (newest,) = [line for line in lines if line.review == "drawn"]
    return newest.xyz[:, :2]


def test_vertices_drawn_beside_paint_are_saved_on_it_and_the_edge_is_named(plan, beside):
    places, line = beside
    xy = drawn(plan, places)
    assert max(off(place, line) for place in xy) < 0.04, "by hand both are 8 cm off"
    plan.press("d")
    plan.page.select_option("select[name=kind]", KIND)
    plan.page.mouse.move(*plan.pixel(places[1]))
    plan.page.wait_for_selector("body[data-snap=stripe]", state="attached")
    # Off: what was marked is not marked any more, and places stay where they were clicked
    plan.press("Shift+E")
    plan.page.wait_for_selector("body[data-snap='']", state="attached")
    assert "does not snap" in plan.message
    plan.press("v", "Control+z")
    wait_until(lambda: not any(line.review == "drawn" for line in plan.lines[KIND]))
    freely = drawn(plan, places)
    assert [off(place, line) for place in freely] == pytest.approx([0.08, 0.08], abs=0.025)
    plan.press("Shift+E")


def test_alt_holds_it_off(plan, beside):
    places, line = beside
    xy = drawn(plan, places, modifiers=["Alt"])
    assert [off(place, line) for place in xy] == pytest.approx([0.08, 0.08], abs=0.025)


def test_what_is_clicked_while_edges_are_sought_is_of_the_next_line(plan, beside):
    """Enter takes the vertices that are there: the line is saved once, snapped, without the next one's."""
    places, line = beside
    held = []
    plan.look_at(tuple(np.mean(places, axis=0)), nearer=1)
    plan.press("d")
    plan.page.select_option("select[name=kind]", KIND)
    before = plan.revision
    plan.page.route("**/api/snap?*", lambda route: held.append(route))
    for place in places:
        plan.click(place)
    plan.press("Enter", "Enter")
    plan.page.keyboard.down("Alt")
    plan.click((places[0][0] + 2.0, places[0][1] + 2.0))
    plan.page.keyboard.up("Alt")

    def is_saved():
        # The last may be asked for only now
        while held:
            held.pop().continue_()
        return plan.revision > before

    wait_until(is_saved)
    plan.page.unroute("**/api/snap?*")
    drawn = [one for one in plan.saved_since(before)[KIND] if one.review == "drawn"]
    (xy,) = (one.xyz[:, :2] for one in drawn)
    assert len(xy) == 2
    assert max(off(place, line) for place in xy) < 0.04, "by hand both are 8 cm off"
    # The mark stays hidden once the line is taken away
    plan.press("Escape")
    assert plan.page.get_attribute("body", "data-snap") == ""


@pytest.fixture
def top(plan, served):
    """Show a section across a kerb's top that the server snaps to; return its node, pixels of it and of a metre."""
    truth = read_lines(served.survey / "truth.gpkg")["kerb_top"]
    tops = [np.array(line["xyz"])[:, :2] for line in plan.documents().values() if line["kind"] == "kerb_top"]
    for place, xy, heading in hands(truth, "kerb_top", np.random.default_rng(4)):
        query = f"kind=kerb_top&east={place[0]}&north={place[1]}&reach_m=0.3&heading_deg={heading}"
        snapped = served.get(f"/api/snap?{query}")["found"]
        is_near = any(off(place, line) < 0.15 for line in tops)
        if snapped is not None and is_near and off(np.array(snapped["at"]), xy) < 0.02:
            break
    page = plan.page
    plan.look_at((float(place[0]), float(place[1])))
    plan.click((float(place[0]), float(place[1])))
    page.locator(".section-view").scroll_into_view_if_needed()
    page.wait_for_function("""() => JSON.parse(document.querySelector('.section-view canvas').dataset.nodes || '[]')
        .some((node) => node.kind === 'kerb_top')""")
    nodes = page.evaluate("JSON.parse(document.querySelector('.section-view canvas').dataset.nodes)")
    box = page.locator(".section-view canvas").bounding_box()
    middle = box["width"] / 2
    node = min((n for n in nodes if n["kind"] == "kerb_top"), key=lambda n: abs(n["px"][0] - middle))
    return node, np.array([box["x"] + node["px"][0], box["y"] + node["px"][1]]), box["width"] / 12.0


def moved_vertices(plan, name, before):
    """Return the vertices of a line that were not there before."""
    return [vertex for vertex in plan.documents()[name]["xyz"] if vertex not in before["xyz"]]


def test_in_the_section_a_dragged_node_snaps_to_its_edge_with_shift(plan, served, top):
    """The top of a kerb is dragged 10 cm aside and 10 cm up, and ends where the true top is all the same."""
    page, (node, at, scale) = plan.page, top
    truth = read_lines(served.survey / "truth.gpkg")["kerb_top"]
    before, revision = plan.documents()[node["id"]], plan.revision
    page.mouse.move(*at)
    page.mouse.down()
    page.keyboard.down("Shift")
    page.mouse.move(at[0] + 0.1 * scale, at[1] - 0.1 * scale, steps=3)
    page.wait_for_selector(".section-view canvas[data-snap='top of the kerb']", state="attached")
    page.mouse.up()
    page.keyboard.up("Shift")
    plan.saved_since(revision)
    moved = moved_vertices(plan, node["id"], before)
    assert (
        moved and min(off(np.array(vertex[:2]), line.xyz[:, :2]) for vertex in moved for line in truth) < 0.03
    )


def test_a_drag_in_the_section_asks_for_one_edge_at_a_time_and_takes_the_last(plan, top):
    """While the first answer is on its way nothing more is asked; where the node is let go is asked for at once."""
    page, (node, at, scale) = plan.page, top
    before, revision = plan.documents()[node["id"]], plan.revision
    held = []
    page.route("**/api/snap?*", lambda route: held.append(route))
    page.mouse.move(*at)
    page.mouse.down()
    page.keyboard.down("Shift")
    page.mouse.move(at[0] + 0.05 * scale, at[1])
    wait_until(lambda: page.evaluate("1") and len(held) == 1)
    for k in range(6):
        page.mouse.move(at[0] + (0.06 + 0.01 * k) * scale, at[1])
    assert page.evaluate("1") and len(held) == 1
    page.mouse.up()
    page.keyboard.up("Shift")
    wait_until(lambda: page.evaluate("1") and len(held) == 2)
    height = before["xyz"][0][2]
    # The late answer of where the node was earlier changes nothing
    for route, up in ((held[1], height + 0.5), (held[0], height + 0.7)):
        query = parse_qs(urlsplit(route.request.url).query)
        place = [float(query[name][0]) for name in ("east", "north")]
        route.fulfill(json={"found": {"at": place, "up": up, "sigma": None, "edge": "top"}})
    page.unroute("**/api/snap?*")
    plan.saved_since(revision)
    (moved,) = moved_vertices(plan, node["id"], before)
    assert moved[2] == pytest.approx(height + 0.5, abs=0.002)
    assert plan.revision == revision + 1
