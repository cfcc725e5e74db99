"""The workbench's table of lines with many of them, in a real browser: frames while scrolling, sorting, filtering.

    python -m benchmarks.line_table [--lines 20000]

The lines are short ones strewn over a small simulated survey. Frames are those of the browser (16.7 ms at 60 a
second); how long the machine takes to sort two million numbers says how busy it was.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from pathlib import Path

import numpy as np

from benchmarks.workbench import busy_s

#: Needs a browser: not among those that are run without being named.
ON_REQUEST = True
N_LINES, N_VERTICES = 20_000, 20
KINDS = ("lane_marking", "road_boundary", "guardrail", "cable")
#: Time from frame to frame while the table moves by 17 rows a frame. [ms]
FRAMES = """
async () => {
  const table = document.querySelector(".line-table .scroll");
  const found = [];
  let last = await new Promise(requestAnimationFrame);
  for (let i = 0; i < 300; i++) {
    table.scrollTop = 400 * i;
    const now = await new Promise(requestAnimationFrame);
    found.push(now - last);
    last = now;
  }
  return found;
}
"""
#: Time of the page's work for each step of the slider of confidence. [ms]
STEPS = """
() => {
  const slider = document.querySelector("input[name=least-confidence]");
  return Array.from({ length: 20 }, (_, i) => {
    slider.value = String(i / 25);
    const start = performance.now();
    slider.dispatchEvent(new Event("input"));
    return performance.now() - start;
  });
}
"""


def main(arguments: tuple[str, ...] = ()) -> None:
    """Serve the lines, work the table, and say the figures."""
    from tests.workbench.serve_process import opened_browser, opened_page, served_survey

    from linework.cli.app import main as linework
    from linework.files.vectors.read_write import write_lines

    parser = argparse.ArgumentParser(prog="python -m benchmarks.line_table")
    parser.add_argument("--lines", type=int, default=N_LINES)
    n_lines = parser.parse_args(list(arguments)).lines
    with tempfile.TemporaryDirectory(prefix="linework-table-") as name:
        survey, path = Path(name) / "drive", Path(name) / "lines.gpkg"
        order = [
            "simulate",
            "-o",
            str(survey),
            "--road",
            "urban",
            "--seed",
            "41",
            "--length-m",
            "48",
            "--no-images",
        ]
        if linework([*order, "--quiet"]) != 0:
            raise SystemExit("the survey could not be simulated")
        write_lines(strewn(survey, n_lines), path)
        with served_survey(survey, lines=path) as served, opened_browser() as browser:
            opened_s = -time.perf_counter()
            with opened_page(browser, served) as page:
                page.wait_for_selector("body[data-state=ready]", state="attached")
                print(f"page with {n_lines:,} lines ready after {opened_s + time.perf_counter():.1f} s")
                page.get_by_role("tab", name="Lines").click()
                page.wait_for_selector(f".line-table[data-listed='{n_lines}']", state="attached")
                print(f"frames while scrolling {_spread(page.evaluate(FRAMES))} (goal 16.7 ms)")
                start = time.perf_counter()
                page.locator(".line-table [data-column=length] button").click()
                page.wait_for_selector(".line-table [data-column=length][aria-sort=ascending]")
                print(f"sorted after {1000 * (time.perf_counter() - start):.0f} ms, the click included")
                print(f"steps of the filter by confidence {_spread(page.evaluate(STEPS))}")
                print(f"sorting two million numbers meanwhile {busy_s():.2f} s")


def strewn(survey: Path, n: int):
    """Return n short lines of four kinds at random places of a survey."""
    from linework.files.vectors.read_write import read_lines
    from linework.model.lines import LineSet

    truth = read_lines(survey / "truth.gpkg")
    rng = np.random.default_rng(7)
    west, south = truth.xyz[:, :2].min(axis=0)
    east, north = truth.xyz[:, :2].max(axis=0)
    start = np.column_stack([rng.uniform(west, east, n), rng.uniform(south, north, n)])
    heading = rng.uniform(0.0, 2.0 * np.pi, n)
    along = np.linspace(0.0, 1.0, N_VERTICES) * rng.uniform(2.0, 15.0, n)[:, None]
    xyz = np.stack(
        [
            start[:, :1] + along * np.cos(heading)[:, None], start[:, 1:] + along * np.sin(heading)[:, None],
            np.full((n, N_VERTICES), truth.xyz[0, 2]),
        ],
        axis=-1,
    )  # fmt: skip
    return LineSet.from_lines(
        list(xyz), crs=truth.crs, kind=rng.choice(KINDS, n).tolist(),
        id=[f"line {k}" for k in range(n)], confidence=rng.uniform(0.3, 1.0, n).round(2),
        sigma_xy_m=rng.uniform(0.002, 0.05, n * N_VERTICES),
    )  # fmt: skip


def _spread(values_ms: list[float]) -> str:
    return f"{np.median(values_ms):.1f} ms (95 %: {np.percentile(values_ms, 95):.1f} ms)"


if __name__ == "__main__":
    import sys

    main(tuple(sys.argv[1:]))
