"""No way from the page to the file system, nor out of this machine (J07 to J10)."""

from __future__ import annotations

import json
import os
import shutil
import socket
import threading
import time
from pathlib import Path

import pytest
from PIL import Image
from tests.workbench.safety.raw_http import exchange, path_parameters, request, routes
from tests.workbench.serve_process import Served, served_survey

from linework.files.vectors.read_write import read_lines
from linework.workbench.server.guard import page_files

SECRET = "a-canary-that-must-not-be-read"


def payloads(served: Served, secret: Path) -> list[str]:
    """Return ways to name a file elsewhere, as they stand in a URL."""
    inside = served.survey.name
    name, folder = secret.name, secret.parent.name
    climbs = [
        up * n for up in ("../", "..%2f", "%2e%2e/", "%2e%2e%2f", "..\\", "..%5c", "....//") for n in (1, 3)
    ]
    return [
        *[climb + f"{folder}/{name}" for climb in climbs],
        *[climb.replace("/", "%252f") + name for climb in climbs[:4]],
        *[climb + "etc/passwd" for climb in climbs],
        f"{secret}", f"/{secret}", f"%2f{str(secret)[1:].replace('/', '%2f')}", f"file://{secret}",
        "/etc/passwd", "%2fetc%2fpasswd", "//etc/passwd", "\\etc\\passwd", "~/.bashrc", "~root/.bashrc",
        f"../{inside}2/{name}", f"..%2f{inside}2%2f{name}", f"%2e%2e%2f{inside}%2f..%2f{name}",
        "x%00.png", "%00", "x%0a", "x%0d%0aSet-Cookie:%20a=b", ".", "..", "%2e", "%2e%2e", "...", "*", "?",
        "%c0%ae%c0%ae%c0%af", "%u002e%u002e", "..%c0%af", "..;/", ".git/config", "lines.gpkg", ".linework",
        "C:%5cwindows%5cwin.ini", "x" * 10_000, "%f0%9f%92%a9", "%ff%fe", "CON", "-", "0x0", "1e3", "-1",
        "9" * 400, "%2Fproc%2Fself%2Fenviron", "/proc/self/environ", "/dev/zero",
        "/vsicurl/http%3a%2f%2f127.0.0.1%2fx", "http:%2f%2f127.0.0.1%2fx",
    ]  # fmt: skip


def test_names_in_paths_lead_nowhere(served):
    """J07: every way to write a path, in every parameter, with a good session, unchanged by any library."""
    secret = served.survey.parent / "secret.txt"
    secret.write_text(SECRET)
    twin = served.survey.with_name(f"{served.survey.name}2")
    twin.mkdir(exist_ok=True)
    shutil.copy(secret, twin)
    own = (f"Host: {served.host}", f"Cookie: {served.cookie_header}", f"Origin: {served.url}")
    tried = payloads(served, secret)
    assert len(tried) >= 60
    parameters = path_parameters(served)
    assert len(parameters) >= 8
    for method, path, name in [
        *parameters,
        ("GET", "/{}", ""),
        ("GET", "/assets/{}", ""),
        ("GET", "/api/{}", ""),
    ]:
        for payload in tried:
            answer = exchange(served.port, request(method, path.format(payload), *own))
            assert answer is not None, (path, payload[:50])
            is_page = path == "/{}" and payload in (".", "..", "?")
            assert answer.status in ((200, 404) if is_page else (204, 400, 404, 405, 422)), (
                path,
                name,
                payload[:50],
            )
            assert SECRET not in answer.body
            assert "root:" not in answer.body
            assert "set-cookie" not in answer.headers
            assert str(served.survey) not in answer.body


def test_the_page_is_served_from_an_index(tmp_path):
    """J08: what is no file of the page at the start is never served, nor is what a link in it leads to."""
    page, outside = tmp_path / "page", tmp_path / "outside"
    (page / "assets").mkdir(parents=True)
    outside.mkdir()
    (outside / "secret.js").write_text(SECRET)
    (page / "index.html").write_text("<!doctype html>")
    (page / "assets" / "a.js").write_text("1")
    (page / "assets" / "link.js").symlink_to(outside / "secret.js")
    (page / "folder").symlink_to(outside)
    (page / ".hidden").write_text("x")
    files = page_files(page)
    assert set(files) == {"/", "/index.html", "/assets/a.js"}
    assert files["/assets/a.js"].content_type == "text/javascript; charset=utf-8"
    (page / "assets" / "later.js").write_text("2")
    assert "/assets/later.js" not in files


def test_images_are_not_read_through_links(served_alone):
    """J08: an image that becomes a link out of the survey is refused, however often it is changed meanwhile."""
    served: Served = served_alone
    image = sorted((served.survey / "left").glob("*.png"))[0]
    pair = served.get("/api/pairs")[0]
    number = pair["number"]
    assert pair["left"] == image.name
    assert served.client.get(f"/api/pairs/{number}/left").status_code == 200
    with Image.open(image) as picture:
        size = picture.size
    outside, real = served.survey.parent / "outside.png", image.with_suffix(".kept")
    Image.new("L", size, 77).save(outside)
    image.rename(real)
    image.symlink_to(outside)
    refused = served.client.get(f"/api/pairs/{number}/left")
    assert refused.status_code in (404, 422)
    image.unlink()
    missing = served.client.get(f"/api/pairs/{number}/left")
    # J10: whether it is there and not allowed, or not there, is told by the same words
    assert (missing.status_code, missing.json()) == (refused.status_code, refused.json())
    stop = threading.Event()
    swapping = threading.Thread(target=swap, args=(image, real, outside, stop))
    swapping.start()
    try:
        shades = set()
        for _ in range(60):
            answer = served.client.get(f"/api/pairs/{number}/left")
            assert answer.status_code in (200, 404, 422)
            if answer.status_code == 200:
                shades.add(is_flat(answer.content))
        assert True not in shades
    finally:
        stop.set()
        swapping.join()


def swap(image: Path, inside: Path, outside: Path, stop: threading.Event) -> None:
    other = image.with_suffix(".other")
    while not stop.is_set():
        for target in (outside, inside):
            other.symlink_to(target)
            os.replace(other, image)  # noqa: PTH105
            time.sleep(0.003)


def is_flat(content: bytes) -> bool:
    import io

    with Image.open(io.BytesIO(content)) as picture:
        low, high = picture.convert("L").getextrema()
    return high - low < 3


def test_absent_and_not_allowed_are_told_alike(served):
    """J10: nothing is learnt of what lies outside by asking for it."""
    there = served.survey.parent / "there.txt"
    there.write_text("x")
    for method, path, _ in path_parameters(served):
        answers = []
        for name in (there.name, "not-there.txt"):
            raw = request(
                method, path.format(f"..%2f{name}"), f"Host: {served.host}", f"Cookie: {served.cookie_header}",
                f"Origin: {served.url}",
            )  # fmt: skip
            answer = exchange(served.port, raw)
            answers.append((answer.status, answer.body.replace(name, "NAME")))
        assert answers[0] == answers[1], path


def test_problems_name_no_path_of_this_machine(served):
    """J10, J17: what is wrong, and not where linework or the survey lies."""
    said = [json.dumps(served.get("/api/survey"))]
    for method, path in routes(served):
        said.append(served.client.request(method, path, json={} if method != "GET" else None).text)
    for text in said:
        assert str(served.survey.parent) not in text
        assert "site-packages" not in text
        assert "Traceback" not in text


@pytest.fixture
def trap():
    """Return the port of a server that nobody may ask, and the list of those who did."""
    hits: list[bytes] = []
    with socket.create_server(("127.0.0.1", 0)) as listener:
        listener.settimeout(0.2)
        stop = threading.Event()

        def listen() -> None:
            while not stop.is_set():
                try:
                    connection, _ = listener.accept()
                except TimeoutError:
                    continue
                with connection:
                    hits.append(connection.recv(1000))

        thread = threading.Thread(target=listen)
        thread.start()
        yield listener.getsockname()[1], hits
        stop.set()
        thread.join()


def remote_names(port: int) -> list[str]:
    there = f"http://127.0.0.1:{port}/x"
    return [
        there, f"/vsicurl/{there}", f"/vsicurl_streaming/{there}", f"WFS:{there}", f"OAPIF:{there}",
        f"<OGRVRTDataSource><OGRVRTLayer name='x'><SrcDataSource>{there}</SrcDataSource></OGRVRTLayer>"
        "</OGRVRTDataSource>", f"//127.0.0.1:{port}/x", f"\\\\127.0.0.1@{port}\\x", f"PG:host=127.0.0.1 port={port}",
    ]  # fmt: skip


def test_nothing_is_fetched(served, trap):
    """J09: no name that the page gives is opened, here or elsewhere."""
    port, hits = trap
    line = served.get("/api/lines")["lines"][0]["id"]
    for name in remote_names(port):
        quoted = name.replace("/", "%2f").replace("<", "%3c").replace(">", "%3e").replace(" ", "%20")
        quoted = quoted.replace("'", "%27").replace("\\", "%5c")
        own = (f"Host: {served.host}", f"Cookie: {served.cookie_header}", f"Origin: {served.url}")
        for method, path, _ in path_parameters(served):
            exchange(served.port, request(method, path.format(quoted), *own))
        for edit in (
            {"action": "kind", "ids": [line], "kind": name},
            {"action": "delete", "ids": [name]},
            {"action": "set", "ids": [line], "column": "source", "value": name},
            {"action": "set", "ids": [line], "column": "note", "value": name},
            {"action": "draw", "kind": name, "xyz": [[0, 0], [1, 1]]},
            {"action": "keep", "trace": name, "first": 0, "last": 1},
        ):
            order = {"revision": served.get("/api/survey")["revision"], "edit": edit}
            answer = served.client.post("/api/changes", json=order)
            assert answer.status_code < 500
        assert served.client.post("/api/heights", json={"kind": name, "places": [[0, 0]]}).status_code < 500
        assert served.client.post("/api/jobs", json={"features": [name], "method": name}).status_code == 422
    time.sleep(0.5)
    assert hits == []


@pytest.mark.parametrize("place", ["survey", "--lines", "--crs"])
def test_names_on_the_command_line_are_files(linework, las_file, trap, place):
    """J09: a survey, lines, or a CRS that is an address is refused, not asked."""
    port, hits = trap
    for name in remote_names(port)[:2]:
        arguments = [name] if place == "survey" else [las_file, place, name]
        said = linework("serve", *arguments, "--no-browser", "--quiet")
        assert said.code in (2, 3, 5), arguments
        assert said.line
    assert hits == []


def test_lines_that_are_a_link(drive_lines, tmp_path):
    """J08: who serves names the file; where it is a link, what it leads to is what is edited, and stays a file."""
    elsewhere = tmp_path / "elsewhere.gpkg"
    drive_lines.rename(elsewhere)
    drive_lines.symlink_to(elsewhere)
    with served_survey(drive_lines.parent) as served:
        line = served.get("/api/lines")["lines"][0]["id"]
        served.post("/api/changes", {"revision": 0, "edit": {"action": "accept", "ids": [line]}})
        assert served.stop() == 130
    assert drive_lines.is_symlink()
    lines = read_lines(elsewhere)
    assert lines.review[lines.id == line].tolist() == ["accepted"]
