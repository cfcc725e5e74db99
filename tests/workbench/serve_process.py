"""A real `linework serve` process for tests, with a session that is open, and a browser that looks at it."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import httpx
import pytest

CHROMIUM = Path("/usr/bin/chromium")
BROWSER_ARGUMENTS = (
    "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking",
    "--disable-component-update", "--disable-sync",
)  # fmt: skip
#: How long a loaded machine may take to open the small survey. [s]
START_S = 240.0
#: How long a loaded machine may take for anything that a page shows. [s]
LONGEST_WAIT_S = 180.0


@dataclass(frozen=True)
class Served:
    """A server that runs, and a session with it.

    Parameters
    ----------
    url
        ``http://127.0.0.1:PORT``.
    links
        Links that were printed; the first one has been used.
    cookie
        Name and value of the session.
    client
        With the session's cookie and the page's Origin.
    survey, lines
        Folder and file that are served.
    """

    url: str
    links: list[str]
    cookie: tuple[str, str]
    client: httpx.Client
    process: subprocess.Popen[str]
    survey: Path
    lines: Path
    stderr: list[str]

    @property
    def port(self) -> int:
        return int(self.url.rpartition(":")[2])

    @property
    def host(self) -> str:
        return f"127.0.0.1:{self.port}"

    @property
    def socket_url(self) -> str:
        return f"ws://{self.host}"

    @property
    def cookie_header(self) -> str:
        return "=".join(self.cookie)

    def get(self, path: str) -> Any:
        """Return a JSON answer, which must be a good one."""
        answer = self.client.get(path)
        assert answer.status_code == 200, answer.text
        return answer.json()

    def post(self, path: str, document: Any) -> Any:
        answer = self.client.post(path, json=document)
        assert answer.status_code == 200, answer.text
        return answer.json()

    def stop(self, number: int = signal.SIGINT) -> int:
        """End the server by a signal and return its exit code."""
        if self.process.poll() is None:
            self.process.send_signal(number)
        return self.process.wait(LONGEST_WAIT_S)


@contextlib.contextmanager
def served_survey(survey: Path, *arguments: object, lines: Path | None = None) -> Iterator[Served]:
    """Serve a folder with `linework serve ... --port 0 --no-browser` and log in."""
    named = () if lines is None else ("--lines", lines)
    command = [sys.executable, "-m", "linework", "serve", survey, *named, "--no-browser", *arguments]
    process = subprocess.Popen(
        [str(part) for part in command],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=os.environ | {"PYTHONUNBUFFERED": "1"},
    )  # fmt: skip
    said: list[str] = []
    reader = threading.Thread(target=_read, args=(process, said), daemon=True)
    reader.start()
    try:
        link = _first_line(process, said)
        url, _, _ = link.partition("/?")
        with httpx.Client(base_url=url, headers={"Origin": url}, timeout=LONGEST_WAIT_S) as client:
            assert client.get(link).status_code == 303
            ((name, value),) = client.cookies.items()
            lines = lines or survey / "lines.gpkg"
            yield Served(url, [link], (name, value), client, process, survey, lines, said)
    finally:
        if process.poll() is None:
            process.terminate()
            with contextlib.suppress(subprocess.TimeoutExpired):
                process.wait(60)
        process.kill()
        process.wait()
        reader.join()
        for stream in (process.stdout, process.stderr):
            stream.close()


def _read(process: subprocess.Popen[str], said: list[str]) -> None:
    said.extend(iter(process.stderr.readline, ""))


def _first_line(process: subprocess.Popen[str], said: list[str]) -> str:
    """Return what the server prints when it is ready."""
    timer = threading.Timer(START_S, process.kill)
    timer.start()
    line = process.stdout.readline().strip()
    timer.cancel()
    if not line:
        process.wait()
        pytest.fail(f"linework serve ended with {process.returncode}: {''.join(said)}")
    return line


@contextlib.contextmanager
def opened_browser(*, draws_3d: bool = True) -> Iterator[Any]:
    """Give a Chromium; skip where there is none, but fail where tests are to run.

    Without WebGL it draws pages in half the time: where there is no graphics card all else goes through it too.
    """
    from playwright.sync_api import sync_playwright

    if not CHROMIUM.exists():
        if os.environ.get("CI") == "true":
            pytest.fail(f"{CHROMIUM} is missing")
        pytest.skip(f"{CHROMIUM} IS MISSING: NO BROWSER TESTS")
    arguments = [*BROWSER_ARGUMENTS] if draws_3d else [*BROWSER_ARGUMENTS, "--disable-software-rasterizer"]
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=str(CHROMIUM), headless=True, args=arguments)
        yield browser
        browser.close()


@contextlib.contextmanager
def opened_page(browser: Any, served: Served, **context: Any) -> Iterator[Any]:
    """Give the workbench's page in a browser, logged in; whatever it complains of fails the test.

    Parameters
    ----------
    context
        For playwright: `viewport`, `color_scheme` ...
    """
    options = {"viewport": {"width": 1280, "height": 800}} | context
    inside = browser.new_context(**options)
    name, value = served.cookie
    inside.add_cookies([{"name": name, "value": value, "url": served.url, "sameSite": "Strict"}])
    page = inside.new_page()
    page.set_default_timeout(1000.0 * LONGEST_WAIT_S)
    page.faults = []
    page.on("pageerror", lambda error: page.faults.append(str(error)))
    try:
        page.goto(f"{served.url}/")
        yield page
        assert not page.faults, page.faults
    finally:
        inside.close()


def wait_until(is_so: Any, seconds: float = LONGEST_WAIT_S, step: float = 0.05) -> None:
    """Wait until a condition holds; the limit ends a hang, it is no measure of speed."""
    end = time.monotonic() + seconds
    while not is_so():
        assert time.monotonic() < end, f"not within {seconds} s"
        time.sleep(step)
