"""The photolog page: pictures every so many metres, links from where the page lies, nothing let in."""

from __future__ import annotations

import base64
import io
import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from tests.scenes.image_folders import picture

from linework.errors import InputError
from linework.evaluation.report.photolog import MAX_PICTURES, photolog_html
from linework.files.images.screen import THUMBNAIL_PX, image_thumbnail
from linework.model.logs import Events, LoggedPlaces, Photos, VanLog


def _places(chainage_m: np.ndarray) -> LoggedPlaces:
    n = len(chainage_m)
    xyz = np.stack([500_000.0 + chainage_m, np.full(n, 5e6), np.full(n, 7.0)], axis=1)
    return LoggedPlaces(
        time_s=chainage_m / 10.0, xyz=xyz, heading_deg=np.full(n, 90.0), chainage_m=chainage_m
    )


def _log(root: Path, chainage_m: np.ndarray, names: list[str] | None = None) -> VanLog:
    n = len(chainage_m)
    files = tuple(root / name for name in (names or ["left/0.png"] * n))
    (root / "left").mkdir(exist_ok=True)
    picture(1).save(root / "left/0.png")
    photos = Photos(places=_places(chainage_m), number=np.arange(n), left=files, right=files)
    return VanLog(photos=photos, events=None, root=root, crs="local")


class _Links(HTMLParser):
    def __init__(self, html: str) -> None:
        super().__init__()
        self.links: list[str] = []
        self.tags: list[str] = []
        self.feed(html)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self.links += [value for name, value in attrs if tag == "a" and name == "href" and value]


def test_a_picture_every_so_many_metres(tmp_path: Path) -> None:
    log = _log(tmp_path, np.arange(0.0, 100.0, 1.0))
    page = photolog_html(log, tmp_path / "log.html", title="drive", every_m=10.0)
    assert page.n_pictures == 10 and page.html.count("<li id=") == 10
    assert '<li id="p10">' in page.html and "100 pairs, 10 shown, every 10 m" in page.html
    assert page.warnings == () and page.failures == ()


def test_a_van_at_rest_is_shown_once(tmp_path: Path) -> None:
    page = photolog_html(_log(tmp_path, np.zeros(50)), tmp_path / "log.html", title="rest")
    assert page.n_pictures == 1


def test_a_long_drive_is_bounded_and_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("linework.evaluation.report.photolog.image_thumbnail", lambda _: b"x")
    log = _log(tmp_path, np.linspace(0.0, 50_000.0, 20_000))
    page = photolog_html(log, tmp_path / "log.html", title="long", every_m=10.0)
    assert page.n_pictures <= MAX_PICTURES
    assert page.warnings == (f"one image every 101 m instead of 10 m: a page holds {MAX_PICTURES}",)


def test_links_start_where_the_page_lies(tmp_path: Path) -> None:
    names = ["left/0.png", "left/a b#1.png", 'left/"><script>.png', "ja:va/0.png"]
    log = _log(tmp_path / "", np.arange(4.0) * 10.0, names)
    for folder, before in ((tmp_path, "./"), (tmp_path / "out", "./../")):
        page = photolog_html(log, folder / "log.html", title="<b>drive</b>")
        found = _Links(page.html)
        assert found.links == [
            f"{before}left/0.png", f"{before}left/a%20b%231.png", f"{before}left/%22%3E%3Cscript%3E.png",
            f"{before}ja%3Ava/0.png",
        ]  # fmt: skip
        assert "script" not in found.tags and "b" in found.tags and "<b>drive" not in page.html


def test_notes_are_escaped_and_stand_by_their_chainage(tmp_path: Path) -> None:
    log = _log(tmp_path, np.arange(3.0) * 10.0)
    events = Events(places=_places(np.array([15.0])), key=("<m>",), note=("<img src=x onerror=alert(1)>",))
    page = photolog_html(replace(log, events=events), tmp_path / "log.html", title="drive")
    assert _Links(page.html).tags.count("img") == 3
    assert "&lt;m&gt;" in page.html and "&lt;img src=x" in page.html
    assert page.html.index('id="p1"') < page.html.index("&lt;m&gt;") < page.html.index('id="p2"')


def test_an_image_that_cannot_be_read_leaves_a_gap(tmp_path: Path) -> None:
    log = _log(tmp_path, np.arange(2.0) * 10.0, ["left/0.png", "left/1.png"])
    page = photolog_html(log, tmp_path / "log.html", title="drive")
    assert page.html.count("cannot be read") == 1
    assert len(page.failures) == 1 and "1.png: cannot be opened" in page.failures[0]


def test_a_log_without_places_is_a_page(tmp_path: Path) -> None:
    page = photolog_html(_log(tmp_path, np.zeros(0)), tmp_path / "log.html", title="empty")
    assert page.n_pictures == 0 and "<svg" not in page.html


def test_the_plan_is_drawn_with_north_up(tmp_path: Path) -> None:
    log = _log(tmp_path, np.arange(11.0) * 10.0)
    page = photolog_html(log, tmp_path / "log.html", title="drive")
    places = re.findall(r'<circle cx="([-.\d]+)" cy="([-.\d]+)"', page.html)
    assert [float(x) for x, _ in places] == [-50.0 + 10.0 * i for i in range(11)]
    # 100 m of way and a tenth around: a third of that is 40 m
    assert ">20 m</text>" in page.html


@pytest.mark.parametrize("mode", ["L", "RGB", "RGBA", "I;16", "P", "1"])
def test_thumbnails_are_small_jpegs(tmp_path: Path, mode: str) -> None:
    grey = picture(1, (1240, 376))
    image = (
        Image.fromarray(np.asarray(grey).astype(np.uint16) * 257) if mode == "I;16" else grey.convert(mode)
    )
    image.save(tmp_path / "a.png")
    small = Image.open(io.BytesIO(image_thumbnail(tmp_path / "a.png")))
    assert (small.format, small.size) == ("JPEG", (THUMBNAIL_PX, 49)) or small.size == (THUMBNAIL_PX, 48)
    assert abs(float(np.asarray(small.convert("L")).mean()) - 120.0) < 12.0


def test_a_thumbnail_of_half_an_image_is_refused(tmp_path: Path) -> None:
    picture(1, (320, 200)).save(tmp_path / "a.jpg")
    data = (tmp_path / "a.jpg").read_bytes()
    (tmp_path / "a.jpg").write_bytes(data[: len(data) // 2])
    with pytest.raises(InputError, match="damaged image"):
        image_thumbnail(tmp_path / "a.jpg")


def test_the_same_log_gives_the_same_page(tmp_path: Path) -> None:
    log = _log(tmp_path, np.arange(0.0, 100.0, 5.0))
    pages = [photolog_html(log, tmp_path / "log.html", title="drive").html for _ in range(2)]
    assert pages[0] == pages[1]
    found = re.search(r"base64,([^\"]+)", pages[0])
    assert found is not None
    assert Image.open(io.BytesIO(base64.b64decode(found[1]))).size[0] <= THUMBNAIL_PX
