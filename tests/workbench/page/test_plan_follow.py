"""Click and follow in the plan view: the line grows, stops, is kept, cut back, left, continued."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest
import shapely
from tests.workbench.page.plan_page import PlanPage, longest, middle_of
from tests.workbench.serve_process import served_survey, wait_until

from linework.files.vectors.read_write import read_lines


@pytest.fixture(scope="module")
def served(made_drive, made_lines, tmp_path_factory):
    """Return a server of the drive, with no lines yet."""
    work = tmp_path_factory.mktemp("follow")
    with served_survey(made_drive, "--work", work / "work", lines=work / "lines.gpkg") as served:
        yield served


@pytest.fixture(scope="module")
def kerb(made_lines):
    """Return the vertices of a kerb that can be followed."""
    return longest(read_lines(made_lines), "road_boundary")


@pytest.fixture
def plan(page, served):
    return PlanPage(page, served)


def test_a_click_is_followed_and_kept(plan, kerb):
    plan.follow(middle_of(kerb), "road_boundary")
    plan.wait_for("state", "stopped")
    assert "At the end:" in plan.card
    before = plan.revision
    plan.press("Enter")
    saved = plan.saved_since(before)
    assert saved.kind.tolist().count("road_boundary") == 1
    followed = shapely.LineString(longest(saved, "road_boundary")[:, :2])
    known = shapely.LineString(kerb[:, :2])
    assert followed.intersection(known.buffer(0.1)).length > 0.8 * known.length
    # What was one act is one act to undo
    plan.press("Control+z")
    assert len(plan.saved_since(before + 1)) == 0


def test_nodes_that_are_taken_off_are_not_kept(plan, kerb):
    plan.follow(middle_of(kerb), "road_boundary")
    plan.wait_for("state", "stopped")
    whole_m = _length(plan.card)
    plan.press(*["Backspace"] * 6, *["Shift+Backspace"] * 3)
    left_m = _length(plan.card)
    assert left_m < whole_m - 2.0
    before = plan.revision
    plan.press("Enter")
    saved = plan.saved_since(before)["road_boundary"]
    assert saved.length_m[0] == pytest.approx(left_m, abs=0.1)
    plan.press("Control+z")
    plan.saved_since(before + 1)


def test_escape_keeps_nothing(plan, kerb):
    before = plan.revision
    plan.follow(middle_of(kerb), "road_boundary")
    plan.wait_for("state", "stopped")
    plan.press("Escape")
    plan.wait_for("state", "ready")
    assert plan.revision == before
    assert len(plan.lines) == 0


def test_a_bad_place_is_refused_with_a_reason(plan, kerb, served):
    west, south, _, _ = served.get("/api/survey")["bounds"]
    before = plan.revision
    plan.follow((west - 15.0, south - 15.0), "road_boundary")
    plan.wait_for("state", "refused")
    reason, *_ = plan.card.splitlines()
    assert len(reason) > 10
    plan.press("Escape")
    plan.wait_for("state", "ready")
    assert plan.revision == before


def test_a_refusal_shows_what_the_search_area_holds(plan, kerb, served):
    east, north = middle_of(served.get("/api/survey")["path"])[:2]
    area = served.get(f"/api/search-area?east={east}&north={north}")
    assert area["points"] > 50
    assert area["floor"] > 0.5 * area["points"]
    assert sum(area["intensity"]["counts"]) == area["points"]
    plan.follow((east, north), "road_boundary")
    plan.wait_for("state", "refused")
    panel = plan.page.locator(".search-area")
    panel.wait_for()
    assert f"{area['points']} points" in panel.text_content()
    assert panel.locator(".histogram span").count() == 32
    far = served.client.get(f"/api/search-area?east={east + 5e4}&north={north}")
    assert far.json()["points"] == 0


def test_a_kept_line_is_continued_farther_on(plan, kerb):
    plan.follow(middle_of(kerb), "road_boundary")
    plan.wait_for("state", "stopped")
    plan.press(*["Backspace"] * 24)
    before = plan.revision
    plan.press("Enter")
    part = longest(plan.saved_since(before), "road_boundary")
    apart_m = shapely.distance(shapely.LineString(part[:, :2]), shapely.points(kerb[:, :2]))
    there = kerb[np.argmin(np.abs(apart_m - 5.0))]
    wait_until(lambda: len(plan.selected) == 1)
    plan.look_at((there[0], there[1]))
    plan.page.mouse.move(*plan.pixel((there[0], there[1])))
    plan.press("c")
    assert "Click farther along" in plan.card
    plan.click((there[0], there[1]))
    plan.wait_for("state", "stopped")
    plan.press("Enter")
    whole = plan.saved_since(before + 1)["road_boundary"]
    assert len(whole) == 1, "it goes on as the same line"
    assert whole.length_m[0] > shapely.LineString(part).length + 5.0
    plan.press("Control+z")
    plan.saved_since(before + 2)
    plan.press("Control+z")
    plan.saved_since(before + 3)


class Talk:
    """A follower of the test's own instead of the server's: what was ordered, and what is told."""

    def __init__(self, page) -> None:
        self.orders: list[dict] = []
        self._socket = None
        page.route_web_socket("**/api/follow", self._open)

    def _open(self, socket) -> None:
        self._socket = socket
        socket.on_message(lambda text: self.orders.append(json.loads(text)))

    def tell(self, **news) -> None:
        self._socket.send(json.dumps(news))

    def wait_for(self, n: int, page) -> dict:
        """Return the n-th order."""
        wait_until(lambda: page.wait_for_timeout(20) or len(self.orders) >= n)
        return self.orders[n - 1]


def _grown(xyz) -> dict:
    n = len(xyz)
    nothing = dict.fromkeys(
        ("width_m", "height_m", "clearance_m", "disagreement_mean_m", "disagreement_rms_m")
    )
    words = dict.fromkeys(("role", "pattern", "form", "method", "source", "review", "condition", "note"), "")
    return {
        "id": "", "kind": "road_boundary", "double": False, "confidence": 1.0, **nothing, **words,
        "time_start_s": None, "time_end_s": None, "xyz": np.asarray(xyz).tolist(),
        "sigma_xy_m": [0.01] * n, "sigma_z_m": [0.01] * n, "bridged": [], "length_m": 1.0, "bridged_m": 0.0,
    }  # fmt: skip


def test_space_interrupts_and_b_bridges(page, served, kerb):
    talk = Talk(page)
    plan = PlanPage(page, served)
    plan.follow(middle_of(kerb), "road_boundary")
    assert talk.wait_for(1, page)["type"] == "pick"
    talk.tell(type="grown", trace="t1", lines=[_grown(kerb[:10])])
    plan.wait_for("state", "growing")
    plan.press("Space")
    assert talk.wait_for(2, page) == {"type": "interrupt"}
    choices = [[], ["bridge"]]
    talk.tell(type="stopped", trace="t1", lines=[_grown(kerb[:10])], stops=["interrupted", "too few points"],
              choices=choices, distance_m=9.0, interrupted=True)  # fmt: skip
    plan.wait_for("state", "stopped")
    assert "too few points" in plan.card
    plan.press("b")
    assert talk.wait_for(3, page) == {"type": "bridge", "trace": "t1", "end": "end"}
    plan.press("Escape")


def test_a_line_that_grows_is_kept_as_it_has_stopped(page, served, kerb):
    talk = Talk(page)
    plan = PlanPage(page, served)
    plan.follow(middle_of(kerb), "road_boundary")
    talk.wait_for(1, page)
    talk.tell(type="grown", trace="t1", lines=[_grown(kerb[:10])])
    plan.wait_for("state", "growing")
    kept = []
    page.on("request", lambda request: kept.append(request) if request.url.endswith("/api/changes") else None)
    plan.press("Enter")
    assert talk.wait_for(2, page) == {"type": "interrupt"}
    assert kept == [], "the server has not yet said what there is"
    talk.tell(type="stopped", trace="t1", lines=[_grown(kerb[:12])], stops=["", ""], choices=[[], []],
              distance_m=0.0, interrupted=True)  # fmt: skip
    wait_until(lambda: page.wait_for_timeout(20) or len(kept) == 1)
    edit = kept[0].post_data_json["edit"]
    assert (edit["action"], edit["trace"], edit["first"], edit["last"]) == ("keep", "t1", 0, 11)
    assert len(kept[0].headers["idempotency-key"]) == 36


def test_a_line_that_the_server_follows_is_interrupted_bridged_and_kept(plan, kerb):
    before = plan.revision
    plan.follow(middle_of(kerb), "road_boundary")
    plan.press("Space")
    plan.page.wait_for_selector(
        ".plan-view[data-state=stopped], .plan-view[data-state=refused]", state="attached"
    )
    if plan.said("state") == "refused":  # it had not yet begun
        assert "before it had begun" in plan.card
        return
    if plan.page.get_by_text("Bridge at the end").count():
        plan.press("b")
        plan.wait_for("state", "stopped")
    plan.press("Enter")
    assert len(plan.saved_since(before)["road_boundary"]) == 1
    plan.press("Control+z")
    plan.saved_since(before + 1)


def test_g_goes_to_the_pixel_that_works(page, served):
    talk = Talk(page)
    plan = PlanPage(page, served)
    page.get_by_role("tab", name="Stereo", exact=True).click()
    wait_until(lambda: page.get_attribute(".stereo-view", "data-pair"))
    page.wait_for_load_state("networkidle")
    plan.press("f")
    box = page.locator(".stereo-view canvas[data-side=left]").bounding_box()
    page.mouse.click(box["x"] + 0.5 * box["width"], box["y"] + 0.6 * box["height"])
    assert talk.wait_for(1, page)["type"] == "pick_image"
    talk.tell(type="refused", reason="no edge here", advice="", works=None, works_px=[100.0, 120.0])
    plan.wait_for("state", "refused")
    plan.press("g")
    assert talk.wait_for(2, page)["at_px"] == [100.0, 120.0]
    plan.press("Escape")


def test_a_refusal_offers_another_place(page, served, kerb):
    talk = Talk(page)
    plan = PlanPage(page, served)
    place = middle_of(kerb)
    plan.follow(place, "road_boundary")
    works = [place[0] + 0.4, place[1] + 0.4]
    talk.wait_for(1, page)
    talk.tell(type="refused", reason="no kerb here", advice="click nearer to it", works=works, works_px=None)
    plan.wait_for("state", "refused")
    assert "no kerb here" in plan.card
    page.get_by_text("Follow there instead").click()
    assert talk.wait_for(2, page)["at"] == works
    plan.press("Escape")


def test_a_saved_line_goes_on_from_its_end(page, served, kerb):
    saved = served.post("/api/changes", {
        "revision": served.get("/api/survey")["revision"],
        "edit": {"action": "draw", "kind": "road_boundary", "xyz": kerb[:12].tolist()},
    })  # fmt: skip
    (drawn,) = saved["lines"]
    talk = Talk(page)
    plan = PlanPage(page, served)
    wait_until(lambda: plan.revision >= saved["revision"])
    plan.look_at(middle_of(kerb[:12]))
    plan.click(middle_of(kerb[:12]))
    wait_until(lambda: plan.selected == [drawn["id"]])
    page.mouse.move(*plan.pixel((kerb[14, 0], kerb[14, 1])))
    plan.press("c")
    plan.click((kerb[20, 0], kerb[20, 1]))
    order = talk.wait_for(1, page)
    assert order["continues"] == {"id": drawn["id"], "end": "end"}
    assert np.hypot(*(np.array(order["at"]) - kerb[20, :2])) < 0.2
    plan.press("Escape")


def _length(card: str) -> float:
    found = re.search(r"([\d.]+) m", card)
    assert found, card
    return float(found[1])
