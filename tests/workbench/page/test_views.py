"""The views beside the plan, in a real browser: section, 3-D, stereo, photolog, extraction."""

from __future__ import annotations

import json
import re
from typing import Any

import numpy as np
import pytest
from tests.workbench.serve_process import Served, opened_page, wait_until

from linework.files.vectors.read_write import read_lines

DRAWS_3D = True


@pytest.fixture
def views(page: Any, served: Served) -> tuple[Any, Served]:
    """Return the page, ready, and its server, which all tests here share: each looks at lines of its own."""
    page.wait_for_selector("body[data-state=ready]")
    return page, served


def _nodes(page: Any) -> list[dict[str, Any]]:
    return json.loads(page.locator(".section-view canvas").get_attribute("data-nodes") or "[]")


def _node(page: Any, kind: str) -> dict[str, Any]:
    """Return the node of the first line of a kind, when the section shows one."""
    wait_until(lambda: any(node["kind"] == kind for node in _nodes(page)))
    return next(node for node in _nodes(page) if node["kind"] == kind)


def _show(page: Any, *tabs: str) -> None:
    for tab in tabs:
        page.get_by_role("tab", name=tab, exact=True).click()


def _drag(
    page: Any, node: dict[str, Any], by: tuple[float, float], *, at: str = ".section-view canvas"
) -> None:
    box = page.locator(at).bounding_box()
    x, y = box["x"] + node["px"][0], box["y"] + node["px"][1]
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + by[0] / 2, y + by[1] / 2)
    page.mouse.move(x + by[0], y + by[1])
    page.mouse.up()


def _line(served: Served, name: str) -> dict[str, Any]:
    return next(line for line in served.get("/api/lines")["lines"] if line["id"] == name)


def test_dragging_a_node_of_the_section_sets_the_height_a_person_wants(views: tuple[Any, Served]) -> None:
    page, served = views
    foot = _node(page, "road_boundary")
    before = _line(served, foot["id"])
    scale = page.locator(".section-view canvas").bounding_box()["width"] / 12.0

    _drag(page, foot, (0.5 * scale, -0.25 * scale))

    wait_until(lambda: _line(served, foot["id"])["review"] == "edited")
    after = _line(served, foot["id"])
    (new,) = [vertex for vertex in after["xyz"] if vertex not in before["xyz"]]
    is_inserted = foot["vertex"] is None
    assert len(after["xyz"]) == len(before["xyz"]) + is_inserted
    # Half a metre across and a quarter of a metre up from where the line was
    old = np.array(before["xyz"])
    nearest = old[np.argsort(np.hypot(*(old[:, :2] - new[:2]).T))[:2]]
    assert new[2] == pytest.approx(nearest[:, 2].mean() + 0.25, abs=0.04)
    a, b = nearest[:, :2]
    across = abs((b - a)[0] * (new[1] - a[1]) - (b - a)[1] * (new[0] - a[0])) / np.hypot(*(b - a))
    assert across == pytest.approx(0.5, abs=0.12)
    saved = read_lines(served.lines)
    i = saved.id.tolist().index(foot["id"])
    assert np.abs(saved.xyz[saved.offsets[i] : saved.offsets[i + 1]] - new).sum(axis=1).min() < 1e-3


def test_a_drag_is_not_moved_by_a_section_that_is_laid_out_anew(views: tuple[Any, Served]) -> None:
    page, _ = views
    node = _node(page, "kerb_top")
    box = page.locator(".section-view canvas").bounding_box()
    x, y = box["x"] + node["px"][0], box["y"] + node["px"][1]
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + 5.0, y - 5.0)

    # As when a reading of the table below takes another row while points arrive
    page.evaluate(
        "document.querySelector('.section-picture').style = 'flex: none; height: 110px; margin-top: 9px'"
    )
    wait_until(lambda: page.locator(".section-view canvas").bounding_box()["height"] < box["height"] - 20.0)
    page.mouse.move(x + box["width"] / 12.0 * 0.5, y - box["width"] / 12.0 * 0.25)

    assert _moved(page) == pytest.approx([0.5, 0.25], abs=0.015)

    # Nor by the wheel, which only changes what a pixel is from there on
    page.mouse.wheel(0, 100)
    wait_until(lambda: page.locator(".section-view input[type=number]").first.input_value() == "7.2")
    page.mouse.move(x + box["width"] / 12.0 * 1.0, y - box["width"] / 12.0 * 0.25)
    assert _moved(page) == pytest.approx([0.5 + 1.2 * 0.5, 0.25], abs=0.02)
    page.locator(".section-view").press("Escape")
    page.mouse.up()


def _moved(page: Any) -> list[float]:
    """Return how far the section says that what is dragged has moved, across and up [m]."""
    said = re.search(
        r"moved \+([\d.]+) m across, \+([\d.]+) m up", page.locator(".section-view").inner_text()
    )
    assert said is not None
    return [float(said[1]), float(said[2])]


def test_a_section_is_stepped_along_the_selected_line_and_read(views: tuple[Any, Served]) -> None:
    page, served = views
    top = _node(page, "kerb_top")
    page.locator(f".section-table tr[data-id='{top['id']}']").click()
    words = page.locator(".section-view .pane-words")
    page.locator(".section-view").press("ArrowRight")  # to a vertex, so that the section is on the line
    page.wait_for_function("() => JSON.parse(document.querySelector('.section-view canvas').dataset.nodes)"
                           ".some((node) => node.kind === 'kerb_top' && node.vertex !== null)")  # fmt: skip
    first = np.array(re.findall(r"-?\d+\.\d+", words.text_content()), float)

    page.locator(".section-view").press("PageUp")

    wait_until(lambda: words.text_content() and np.hypot(*(_place(words) - first)) > 4.0)
    assert np.hypot(*(_place(words) - first)) == pytest.approx(5.0, abs=0.1)
    line = _line(served, top["id"])
    assert np.hypot(*(np.array(line["xyz"])[:, :2] - _place(words)).T).min() < 0.6
    # A kerb's height is what its top is above its foot
    wait_until(lambda: "kerb" in page.locator(".section-table").text_content())
    height_m = float(re.search(r"kerb (-?[\d.]+) m", page.locator(".section-table").text_content())[1])
    assert height_m == pytest.approx(line["height_m"], abs=0.06)


def _place(words: Any) -> np.ndarray:
    return np.array(re.findall(r"-?\d+\.\d+", words.text_content()), float)


def test_the_3d_view_shows_points_and_lines_and_a_click_selects(views: tuple[Any, Served]) -> None:
    page, _ = views
    three = page.locator(".three-view")
    wait_until(lambda: int(three.get_attribute("data-points") or 0) > 1000)
    assert int(three.get_attribute("data-points")) <= 150_000
    assert int(three.get_attribute("data-lines")) > 3
    marking = _node(page, "lane_marking")
    row = page.locator(f".section-table tr[data-id='{marking['id']}']")
    row.click()
    page.get_by_role("button", name="Look at the selected line", exact=True).click()
    page.get_by_role("button", name="Look straight down", exact=True).click()
    other = page.locator(".section-table tr[data-id]:not(.chosen)").first
    other.click()
    assert "chosen" not in row.get_attribute("class")
    # The line that was looked at is in the middle
    box = page.locator(".three-view canvas").bounding_box()
    page.mouse.click(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    wait_until(lambda: "chosen" in row.get_attribute("class"))


def test_of_very_many_lines_the_3d_view_draws_the_nearest_and_says_so(browser: Any, served: Served) -> None:
    document = served.get("/api/lines")
    marking = next(line for line in document["lines"] if line["kind"] == "lane_marking")
    # 1,000 lines of 99 segments, the first 400 of which are as many as are drawn
    for k in range(1000):
        steps = [place / 100.0 for place in range(100)]
        xyz = [[marking["xyz"][0][0] + step, marking["xyz"][0][1] + 0.1 * k, 0.0] for step in steps]
        vague = {"sigma_xy_m": [None] * 100, "sigma_z_m": [None] * 100, "bridged": []}
        document["lines"].append(marking | vague | {"id": f"more {k}", "xyz": xyz})
    with opened_page(browser, served) as page:
        page.route("**/api/lines?since=0", lambda route: route.fulfill(json=document))
        page.reload()
        three = page.locator(".three-view")
        wait_until(lambda: int(three.get_attribute("data-lines") or 0) > 300)
        n_drawn = int(three.get_attribute("data-lines"))
        assert n_drawn < 420
        wait_until(lambda: f"the nearest {n_drawn} of 1," in three.locator(".pane-words").inner_text())


def test_hidden_views_load_nothing(views: tuple[Any, Served]) -> None:
    page, _ = views
    asked: list[str] = []
    page.on("request", lambda request: asked.append(request.url))
    wait_until(lambda: int(page.locator(".three-view").get_attribute("data-points") or 0) > 1000)
    assert not any("/api/pairs/" in url for url in asked)
    _show(page, "Stereo")
    wait_until(lambda: int(page.locator(".stereo-view").get_attribute("data-strokes") or 0) > 2)
    points = [url for url in asked if "/api/points" in url]
    page.locator(".stereo-view").press("ArrowRight")
    wait_until(lambda: page.locator(".stereo-view").get_attribute("data-pair") == "1")
    assert [url for url in asked if "/api/points" in url] == points


def test_stereo_shows_the_lines_in_both_images_and_goes_along_the_drive(views: tuple[Any, Served]) -> None:
    page, served = views
    _show(page, "Stereo")
    stereo = page.locator(".stereo-view")
    pairs = served.get("/api/pairs")
    wait_until(lambda: int(stereo.get_attribute("data-strokes") or 0) > 2)
    first = int(stereo.get_attribute("data-pair"))
    stereo.press("ArrowRight")
    wait_until(lambda: int(stereo.get_attribute("data-pair")) == first + 1)
    for side in ("left", "right"):
        shown = page.locator(f".stereo-view canvas[data-side={side}]")
        wait_until(lambda shown=shown, side=side: shown.get_attribute("data-shown") == f"{first + 1}/{side}")
    page.locator(".stereo-view").get_by_label("Pairs per second", exact=True).select_option("10")
    stereo.press("Shift+P")
    wait_until(lambda: int(stereo.get_attribute("data-pair")) == pairs[-1]["number"])


def test_the_photolog_shows_what_was_seen_at_a_place(views: tuple[Any, Served]) -> None:
    page, served = views
    _show(page, "Stereo", "Photolog")
    pairs = served.get("/api/pairs")
    rows = page.locator(".photolog-row")
    wait_until(lambda: rows.count() >= 3)
    assert f"{pairs[2]['chainage_m']:.1f} m" in rows.nth(2).text_content()
    rows.nth(2).click()
    wait_until(lambda: page.locator(".stereo-view").get_attribute("data-pair") == str(pairs[2]["number"]))
    assert rows.nth(2).get_attribute("aria-selected") == "true"
    page.wait_for_function("() => document.querySelector('.photolog-row img').naturalWidth > 0")


def test_extraction_from_the_page_keeps_what_a_person_said(views: tuple[Any, Served]) -> None:
    page, served = views
    lines = served.get("/api/lines")
    kerbs = [line["id"] for line in lines["lines"] if line["kind"] == "road_boundary"]
    edit = {"action": "reject", "ids": kerbs[:1]}
    served.post("/api/changes", {"revision": lines["revision"], "edit": edit})
    _show(page, "Extract")
    for box in page.locator(".job-pane input[type=checkbox]").all():
        box.set_checked(box.get_attribute("value") in ("road_boundary", "kerb_top"))

    page.locator(".job-pane .start").click()

    card = page.locator(".job").first
    card.wait_for()
    wait_until(lambda: card.get_attribute("data-state") == "done")
    assert "Road boundary" in card.locator(".job-counts").text_content()
    link = card.locator("a.report")
    assert link.get_attribute("rel") == "noopener" and link.get_attribute("target") == "_blank"
    assert "<html" in served.client.get(link.get_attribute("href")).text
    after = {line["id"]: line["review"] for line in served.get("/api/lines")["lines"]}
    assert after[kerbs[0]] == "rejected"


def test_an_extraction_can_be_cancelled(views: tuple[Any, Served]) -> None:
    page, served = views
    before = served.get("/api/lines")["lines"]
    _show(page, "Extract")
    page.locator(".job-pane .start").click()
    page.get_by_role("button", name="Cancel this extraction; the lines stay unchanged", exact=True).click()
    wait_until(lambda: page.locator(".job").first.get_attribute("data-state") == "cancelled")
    assert served.get("/api/lines")["lines"] == before
    assert page.locator(".job-pane .start").is_enabled()


def test_an_edge_picked_in_an_image_is_followed_and_kept(views: tuple[Any, Served]) -> None:
    page, served = views
    _show(page, "Stereo")
    stereo = page.locator(".stereo-view")
    wait_until(lambda: int(stereo.get_attribute("data-strokes") or 0) > 2)
    number = int(stereo.get_attribute("data-pair"))
    name, at, size = _paint_in(served, number)
    was = np.array(_line(served, name)["xyz"])
    revision = served.get("/api/lines")["revision"]
    served.post("/api/changes", {"revision": revision, "edit": {"action": "delete", "ids": [name]}})
    page.keyboard.press("f")
    box = page.locator(".stereo-view canvas[data-side=left]").bounding_box()
    scale = min(box["width"] / size[0], box["height"] / size[1])

    page.mouse.click(
        box["x"] + box["width"] / 2 + (at[0] + 0.5 - size[0] / 2) * scale,
        box["y"] + box["height"] / 2 + (at[1] + 0.5 - size[1] / 2) * scale,
    )

    wait_until(lambda: int(stereo.get_attribute("data-seen") or 0) > 4)
    page.wait_for_selector(".growth-card[data-state=stopped]")
    page.keyboard.press("Enter")
    wait_until(lambda: any(edit["action"] == "keep" for edit in served.get("/api/history")))
    ((kept, *_),) = [edit["ids"] for edit in served.get("/api/history") if edit["action"] == "keep"]
    saved = read_lines(served.lines)
    i = saved.id.tolist().index(kept)
    assert (saved.kind[i], saved.method[i], saved.review[i]) == ("lane_marking", "stereo", "drawn")
    # It lies where the points had shown the paint
    xyz = saved.xyz[saved.offsets[i] : saved.offsets[i + 1]]
    assert saved.length_m[i] > 5.0
    far = [np.hypot(*(xyz[:, :2] - place[:2]).T).min() for place in was]
    assert np.median(far) < 0.5


def _paint_in(served: Served, number: int) -> tuple[str, tuple[float, float], tuple[int, int]]:
    """Return a marking, a pixel of the left image on it, low in the image, and the size of images."""
    shown = served.get(f"/api/pairs/{number}/lines")
    width, height = shown["width"], shown["height"]
    pixels = [
        (abs(y - 0.75 * height), line["id"], (x, y))
        for line in shown["left"] if line["kind"] == "lane_marking"
        for run in line["runs"] for x, y in run if 30 < x < width - 30
    ]  # fmt: skip
    _, name, at = min(pixels)
    return name, at, (width, height)


def test_where_nothing_can_be_followed_the_image_says_why(views: tuple[Any, Served]) -> None:
    page, served = views
    before = served.get("/api/lines")["revision"]
    _show(page, "Stereo")
    stereo = page.locator(".stereo-view")
    wait_until(lambda: int(stereo.get_attribute("data-strokes") or 0) > 2)
    page.keyboard.press("f")
    canvas = page.locator(".stereo-view canvas[data-side=right]")
    box = canvas.bounding_box()
    page.mouse.click(box["x"] + box["width"] / 2, box["y"] + 0.1 * box["height"])  # the sky
    wait_until(lambda: len(page.locator(".stereo-answer").text_content()) > 10)
    page.keyboard.press("Escape")
    wait_until(lambda: page.locator(".stereo-answer").text_content() == "")
    assert served.get("/api/lines")["revision"] == before
