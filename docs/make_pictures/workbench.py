"""Make the pictures of docs/workbench.md from a simulated survey: ``python docs/make_pictures/workbench.py``.

Needs Chromium (/usr/bin/chromium, or another by CHROMIUM=...) and playwright.
"""

from __future__ import annotations

import io
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from PIL import Image

from linework.cli.app import main

PICTURES = Path(__file__).parents[1] / "pictures"
CHROMIUM = os.environ.get("CHROMIUM", "/usr/bin/chromium")
#: Without a graphics card: WebGL by the processor.
BROWSER = ("--no-sandbox", "--disable-gpu", "--no-first-run", "--disable-background-networking")
DRIVE = (
    "--seed",
    "986",
    "--length-m",
    "70",
    "--road",
    "urban",
    "--image-every-m",
    "4",
    "--points-per-m",
    "9000",
)
SIZE = {"width": 1280, "height": 800}
WAIT_MS = 120_000


def run() -> int:
    """Write docs/pictures/workbench*.png."""
    from playwright.sync_api import sync_playwright

    with tempfile.TemporaryDirectory() as folder, sync_playwright() as playwright:
        survey = Path(folder) / "street"
        check(main(["simulate", "-o", str(survey), *DRIVE, "--quiet"]))
        check(main(["extract", str(survey), "-o", str(survey / "lines.gpkg"), "--method", "obb", "--quiet"]))
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=list(BROWSER))
        with served(survey) as link:
            page = browser.new_page(viewport=SIZE, color_scheme="light")
            page.goto(link)
            overview(page)
            follow(page)
            stereo(page)
        browser.close()
    return 0


def check(exit_code: int) -> None:
    """Stop where a command failed."""
    if exit_code:
        sys.exit(exit_code)


@contextmanager
def served(survey: Path) -> Iterator[str]:
    """Serve a survey; give the link."""
    command = [sys.executable, "-m", "linework", "serve", str(survey), "--no-browser", "--json", "--quiet"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        try:
            yield json.loads(process.stdout.readline())["url"]
        finally:
            process.terminate()


def overview(page: Any) -> None:
    """Show plan, 3-D view and section of a kerb."""
    page.wait_for_selector("body[data-state=ready]", timeout=WAIT_MS)
    page.wait_for_selector(".three-view[data-points]:not([data-points='0'])", timeout=WAIT_MS)
    row = page.locator(".section-table tr", has_text="Kerb top").last
    row.click(timeout=WAIT_MS)
    page.get_by_label("Vertical scale").select_option("2")
    page.locator(".section-view").press("ArrowRight")
    page.get_by_role("button", name="Look along the drive").click()
    save(page, "workbench.png")


def follow(page: Any) -> None:
    """Delete a kerb and follow it anew from a click."""
    east, north = page.evaluate(KERB)
    page.keyboard.press("f")
    field = page.get_by_placeholder("Go to EAST, NORTH")
    field.fill(f"{east}, {north}")
    field.press("Enter")
    page.wait_for_timeout(1000)
    box = page.locator("#plan").bounding_box()
    page.mouse.click(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    page.wait_for_selector(".growth-card:not([data-state=growing])", timeout=WAIT_MS)
    if page.locator(".growth-card").get_attribute("data-state") == "refused":
        page.keyboard.press("g")
    page.wait_for_selector(".growth-card[data-state=stopped]", timeout=WAIT_MS)
    save(page, "workbench_follow.png")
    page.keyboard.press("Escape")


def stereo(page: Any) -> None:
    """Follow a marking in both images."""
    page.get_by_role("tab", name="Stereo").click()
    page.get_by_role("tab", name="Photolog").click()
    page.get_by_role("button", name="Enlarge upper views").click()
    page.wait_for_selector(".stereo-view[data-strokes]:not([data-strokes='0'])", timeout=WAIT_MS)
    canvas = page.locator(".stereo-view canvas[data-side=left]")
    place = page.evaluate(MARKING, int(page.locator(".stereo-view").get_attribute("data-pair")))
    box = canvas.bounding_box()
    scale = min(box["width"] / place["width"], box["height"] / place["height"])
    page.mouse.click(
        box["x"] + box["width"] / 2 + (place["at"][0] - place["width"] / 2) * scale,
        box["y"] + box["height"] / 2 + (place["at"][1] - place["height"] / 2) * scale,
    )
    page.wait_for_selector(".growth-card[data-state=stopped]", timeout=WAIT_MS)
    save(page, "workbench_stereo.png")


#: Deletes the longest road boundary with the kerb tops, and gives the place in its middle.
KERB = """async () => {
  const { lines, revision } = await (await fetch("/api/lines")).json();
  const kerb = lines.filter((line) => line.kind === "road_boundary").sort((a, b) => b.length_m - a.length_m)[0];
  const ids = lines.filter((line) => line === kerb || line.kind === "kerb_top").map((line) => line.id);
  const body = JSON.stringify({ revision, edit: { action: "delete", ids } });
  await fetch("/api/changes", { method: "POST", headers: { "Content-Type": "application/json" }, body });
  return kerb.xyz[kerb.xyz.length >> 1].slice(0, 2);
}"""
#: A pixel of a marking low in the left image, on the side where no wires cast shadows.
MARKING = """async (pair) => {
  const { width, height, left } = await (await fetch(`/api/pairs/${pair}/lines`)).json();
  const low = ([x, y]) => Math.abs(y - 0.75 * height) + (x < 50 || x > width / 2 ? height : 0);
  const pixels = left.filter((line) => line.kind === "lane_marking").flatMap((line) => line.runs.flat());
  return { at: pixels.sort((a, b) => low(a) - low(b))[0], width, height };
}"""


def save(page: Any, name: str) -> None:
    """Save what is seen, when nothing moves any more, in 192 colours."""
    page.wait_for_load_state("networkidle")
    page.wait_for_timeout(1500)
    picture = Image.open(io.BytesIO(page.screenshot())).convert("RGB")
    # Refined by k-means: the few pixels of lines keep their colours
    picture.quantize(192, kmeans=2, dither=Image.Dither.NONE).save(PICTURES / name, optimize=True)


if __name__ == "__main__":
    sys.exit(run())
