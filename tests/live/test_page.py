"""The operator's page in a real browser: a touch screen of 1024 x 600 beside the driver."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import httpx
import pytest
from tests.scenes.live_drives import FIRST_S, Filling, write_live_source
from tests.workbench.serve_process import opened_browser, wait_until

from linework.files.live.events import EventsFile
from linework.live.drive import LiveDrive
from linework.workbench.operator.server import LiveServer

NAMES = ["manhole", "sign", "tree", "parked car", "lamp", "roadworks", "bus stop", "drain", "pole", "wall"]
SPAN = "cracks, fine"


@dataclass
class Followed:
    """A drive that is followed, and the link to its page."""

    drive: LiveDrive
    filling: Filling
    links: list[str]

    @property
    def url(self) -> str:
        return self.links[0].partition("/?")[0]

    @property
    def events(self) -> Path:
        return self.filling.folder / "events.csv"

    def saved(self) -> list[tuple[str, str]]:
        """Key and span of the presses on the disk."""
        return [(press.key, press.span) for press in EventsFile(self.events).presses]


@pytest.fixture(scope="module")
def source(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("page") / "source"
    folder.mkdir()
    write_live_source(folder)
    text = (folder / "survey.toml").read_text().split("\n[[live.keys]]")[0]
    keys = [f'\n[[live.keys]]\nname = "{name}"\n' for name in NAMES]
    keys.append(f'\n[[live.keys]]\nname = "{SPAN}"\nkind = "span"\n')
    (folder / "survey.toml").write_text(text + "".join(keys))
    return folder


@pytest.fixture
def followed(source: Path, tmp_path: Path) -> Iterator[Followed]:
    filling = Filling(source, tmp_path / "van").begin()
    drive = filling.drive(tmp_path / "lines.gpkg")
    filling.go(drive, FIRST_S + 2.0)
    links: list[str] = []
    faults: list[BaseException] = []
    with LiveServer(drive, 0, ready=links.append, renewed=links.append, save_log=faults.append):
        yield Followed(drive, filling, links)
    assert not faults


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with opened_browser(draws_3d=False) as browser:
        yield browser


@pytest.fixture
def page(browser: Any, followed: Followed) -> Iterator[Any]:
    inside = browser.new_context(viewport={"width": 1024, "height": 600}, has_touch=True)
    page = inside.new_page()
    faults: list[str] = []
    page.on("pageerror", lambda error: faults.append(str(error)))
    page.goto(followed.links[0])
    page.locator("#keys button").first.wait_for()
    yield page
    assert not faults
    inside.close()


def key(page: Any, name: str) -> Any:
    return page.locator(f'#keys button[data-key="{name}"]')


def test_all_keys_fit_a_small_screen_and_are_as_large_as_a_thumb(page):
    boxes = [key(page, name).bounding_box() for name in (*NAMES, SPAN)]
    # A thumb is 15 mm wide, a screen of 10 inches has 4.7 pixels a millimetre
    assert min(box["width"] for box in boxes) > 100
    assert min(box["height"] for box in boxes) > 90
    assert max(box["y"] + box["height"] for box in boxes) <= 600
    assert max(box["x"] + box["width"] for box in boxes) <= 1024
    assert page.evaluate("document.documentElement.scrollHeight") <= 600


def test_a_touch_is_a_press_with_its_time_and_can_be_undone(page, followed):
    key(page, "manhole").tap()
    page.locator("#presses button").first.wait_for()
    assert followed.saved() == [("manhole", "")]
    (press,) = EventsFile(followed.events).presses
    # The drive's clock stands still in this test: the press was some hundredths before now
    assert press.time_s == pytest.approx(followed.filling.time_s, abs=5.0)
    key(page, "tree").tap()
    wait_until(lambda: len(followed.saved()) == 2)
    page.locator(f'#presses button[data-press="{press.press}"]').tap()
    wait_until(lambda: followed.saved() == [("tree", "")])
    wait_until(lambda: page.locator("#presses button").count() == 1)


def test_a_span_shows_that_it_is_open_until_it_is_ended(page, followed):
    key(page, SPAN).tap()
    page.locator('#keys button.open[aria-pressed="true"]').wait_for()
    key(page, SPAN).tap()
    wait_until(lambda: page.locator("#keys button.open").count() == 0)
    assert followed.saved() == [(SPAN, "begin"), (SPAN, "end")]
    # The answer comes after the button: the list is made anew then, read in one go
    pressed = "[...document.querySelectorAll('#presses span')].map((one) => one.firstChild.textContent)"
    wait_until(lambda: page.evaluate(pressed) == [f"{SPAN}: end", f"{SPAN}: begin"])


def test_quick_touches_are_all_noted(page, followed):
    names = [name for _ in range(3) for name in NAMES]
    for name in names:
        key(page, name).tap(no_wait_after=True)
    wait_until(lambda: len(followed.saved()) == len(names))
    assert sorted(followed.saved()) == sorted((name, "") for name in names)


def test_a_press_is_sent_again_until_it_is_saved(page, followed):
    page.route("**/api/live/presses", lambda route: route.abort())
    key(page, "sign").tap()
    page.locator("#presses li.waiting").wait_for()
    time.sleep(0.5)
    assert not followed.events.exists()
    page.unroute("**/api/live/presses")
    page.locator("#presses button").first.wait_for()
    assert followed.saved() == [("sign", "")]
    assert page.locator("#presses li.waiting").count() == 0


def test_the_page_shows_how_it_goes_and_troubles(page, followed):
    n = followed.drive.status(followed.filling.now_s).counts["looked"]
    assert f"{n} pairs" in page.locator("#pairs").inner_text()
    followed.filling.stopped = {"gyro"}
    followed.filling.go(followed.drive, FIRST_S + 7.0)
    page.locator("#notices li.lasts", has_text="gyro.csv").wait_for()
    assert "gyro.csv: nothing new" in page.locator("#notices").inner_text()
    assert page.locator("header.bad").count() == 1


def test_nobody_without_the_link_gets_in(followed):
    with httpx.Client(base_url=followed.url) as client:
        assert client.get("/api/live").status_code == 401
        order = {"key": "manhole", "press": "press-0001", "ago_s": 0.0}
        assert client.post("/api/live/presses", json=order).status_code == 401
        assert client.get("/?token=wrong").status_code == 403
        assert client.get(followed.links[0]).status_code == 303
        assert client.get("/api/live").status_code == 200
        # A page of another site has the cookie, but not the origin
        foreign = client.post("/api/live/presses", json=order, headers={"Origin": "http://evil.example"})
        assert foreign.status_code == 403
        own = {"Origin": followed.url}
        assert (
            client.post("/api/live/presses", json=order | {"key": "no such"}, headers=own).status_code == 404
        )
        assert client.post("/api/live/presses", json=order | {"ago_s": -1}, headers=own).status_code == 422
        assert client.post("/api/live/undo", json={"press": "press-0009"}, headers=own).status_code == 404
        assert client.post("/api/live/presses", json=order, headers=own).status_code == 200
    assert followed.saved() == [("manhole", "")]
