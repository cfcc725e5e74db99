"""The workbench on a large survey: a real `linework serve`, a real browser, clicks on lines.

    python -m benchmarks.workbench [--survey FOLDER --work FOLDER] [--clicks 30] [--millions 50]

The survey is that of `benchmarks.large` (made if none is given). Times are those of the page: from the click to the
frame in which the first metres are drawn, and to the one with 100 m, or all there is. How long the machine takes to
sort two million numbers meanwhile says how busy it was.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from pathlib import Path

import numpy as np

from benchmarks.large import PIECE_M, make_survey, memory_of

#: Takes long: not among those that are run without being named.
ON_REQUEST = True
KINDS = ("lane_marking", "road_boundary")
FAR_M = 100.0
#: In the page: when a click came, and when each length of the growing line was drawn.
WATCH = """
() => {
  window.seen = { click: 0, drawn: [] };
  addEventListener("pointerup", (event) => { window.seen = { click: event.timeStamp, drawn: [] }; }, true);
  const card = document.querySelector(".growth-card");
  new MutationObserver(() => {
    const length = /([0-9][0-9,.]*) m/.exec(card.textContent);
    const said = [card.dataset.state, length ? Number(length[1].replaceAll(",", "")) : 0];
    requestAnimationFrame(() => requestAnimationFrame((now) => window.seen.drawn.push([now, ...said])));
  }).observe(card, { childList: true, subtree: true, characterData: true, attributes: true });
}
"""
#: Whether so much of it has been drawn, or all there is.
DRAWN = """
(least_m) => {
  const { drawn } = window.seen;
  return drawn.some(([, state, length]) => length >= least_m || ["stopped", "refused"].includes(state));
}
"""
TILES = """
() => performance.getEntriesByType("resource").filter((entry) => entry.name.includes("/api/tiles/"))
  .map((entry) => entry.duration)
"""
#: Time from the opening of the page to its first tile [ms]; Infinity: none has come.
FIRST_TILE = """
() => Math.min(...performance.getEntriesByType("resource").filter((entry) => entry.name.includes("/api/tiles/"))
  .map((entry) => entry.responseEnd).filter((end) => end > 0), Infinity)
"""


def main(arguments: tuple[str, ...] = ()) -> None:
    """Serve the survey, click, and say the figures."""
    from tests.workbench import serve_process
    from tests.workbench.page.plan_page import PlanPage

    # The first time all points are decoded and the road is found
    serve_process.START_S = 3600.0
    options = parsed(arguments)
    with tempfile.TemporaryDirectory(prefix="linework-workbench-") as name:
        survey = options.survey or make_survey(Path(name) / "drive", options.millions * 1_000_000)
        work = options.work or Path(name) / "work"
        opened_s = -time.perf_counter()
        with (
            serve_process.served_survey(survey, "--work", work, lines=Path(name) / "lines.gpkg") as served,
            serve_process.opened_browser() as browser,
            serve_process.opened_page(browser, served) as page,
        ):
            opened_s += time.perf_counter()
            plan = PlanPage(page, served)
            print(f"opened {served.get('/api/survey')['n_points']:,} points in {opened_s:.1f} s", flush=True)
            page.evaluate(WATCH)
            rng = np.random.default_rng(6)
            results = [clicked(plan, *place) for place in places_on_lines(survey, options.clicks, rng)]
            report(results)
            tiles = panned(plan, 30)
            print(f"tiles while panning: {len(tiles)}, {_spread([t / 1000 for t in tiles])} (goal 0.15 s)")
            print(f"memory of server and workers: {memory_of(served.process.pid) / 1e9:.2f} GB (goal 1.5 GB)")
        opened_again(survey, work, Path(name) / "lines.gpkg")


def opened_again(survey: Path, work: Path, lines: Path) -> None:
    """Serve a survey that is decoded already, and say when its page has the first tile."""
    from tests.workbench import serve_process

    with serve_process.opened_browser() as browser:
        started_s = time.perf_counter()
        with serve_process.served_survey(survey, "--work", work, lines=lines) as served:
            listening_s = time.perf_counter() - started_s
            with serve_process.opened_page(browser, served) as page:
                page.wait_for_function(f"() => ({FIRST_TILE})() < Infinity")
                tile_s = page.evaluate(FIRST_TILE) / 1000
    print(
        f"opened again: listening after {listening_s:.1f} s, first tile {tile_s:.1f} s after the page (goal 2 s)"
    )


def parsed(arguments: tuple[str, ...]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.workbench")
    parser.add_argument("--survey", type=Path, help="folder that benchmarks.large made")
    parser.add_argument("--work", type=Path, help="its work folder")
    parser.add_argument("--clicks", type=int, default=30)
    parser.add_argument("--millions", type=int, default=50, help="points of the survey that is made")
    return parser.parse_args(list(arguments))


def places_on_lines(survey: Path, n: int, rng: np.random.Generator) -> list[tuple[tuple[float, float], str]]:
    """Return places on true lines of the drive's first piece, and their kinds."""
    from linework.simulation.simulate import simulate_survey

    # Few points: only the truth is wanted, which does not depend on them
    simulated = simulate_survey("bends", 700, PIECE_M, points_per_m=100)
    first = np.loadtxt(survey / "trajectory.csv", delimiter=",", skiprows=1, max_rows=1, usecols=(1, 2))
    shift = first - simulated.trajectory.xyz[0, :2]
    truth = simulated.truth
    found = []
    for kind in KINDS:
        lines = np.flatnonzero(truth.kind == kind)
        length = truth.length_m[lines]
        for i in rng.choice(lines, (n + 1) // 2, p=length / length.sum()):
            line = truth[int(i)].xyz
            at = line[rng.integers(len(line) // 10, len(line) - len(line) // 10), :2] + shift
            found.append(((float(at[0]), float(at[1])), kind))
    return [found[i] for i in rng.permutation(len(found))[:n]]


def clicked(plan, place: tuple[float, float], kind: str) -> dict[str, float]:
    """Click on a line, and stop it beyond 100 m; return the seconds to its first metres, and to 100 m or its end."""
    plan.follow(place, kind)
    plan.page.wait_for_function(DRAWN, arg=1.2 * FAR_M, timeout=120_000)
    plan.press("Space")
    plan.page.wait_for_function(DRAWN, arg=1e9, timeout=120_000)
    seen = plan.page.evaluate("() => window.seen")
    plan.press("Escape")
    drawn = [((now - seen["click"]) / 1000.0, length) for now, _, length in seen["drawn"] if length > 0.0]
    longest = max((length for _, length in drawn), default=0.0)
    far = [at for at, length in drawn if length >= min(FAR_M, 0.98 * longest)]
    result = {
        "first": drawn[0][0] if drawn else np.nan, "far": far[0] if far else np.nan,
        "length": longest, "busy": busy_s(),
    }  # fmt: skip
    print(f"  {kind:14} " + ", ".join(f"{name} {value:.2f}" for name, value in result.items()), flush=True)
    return result


def busy_s() -> float:
    """Return how long it takes to sort two million numbers. [s]"""
    values = np.random.default_rng(0).random(2_000_000)
    start = time.perf_counter()
    values.sort()
    return time.perf_counter() - start


def report(results: list[dict[str, float]]) -> None:
    good = [r for r in results if np.isfinite(r["first"])]
    long = [r for r in good if r["length"] >= FAR_M]
    print(f"clicks: {len(results)}, followed {len(good)}, 100 m and more {len(long)}")
    if good:
        print(f"  first metres drawn after {_spread([r['first'] for r in good])} (goal 0.3 s)")
    if long:
        print(f"  100 m drawn after {_spread([r['far'] for r in long])} (goal 1.0 s)")
    print(f"  sorting two million numbers meanwhile {_spread([r['busy'] for r in results])}")


def panned(plan, n: int) -> list[float]:
    """Drag the map about; return how long each tile took that was asked for. [ms]"""
    page = plan.page
    plan.press("v")
    page.evaluate("() => performance.clearResourceTimings()")
    page.evaluate("() => performance.setResourceTimingBufferSize(5000)")
    box = page.locator(".plan-view .map").bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    for i in range(n):
        page.mouse.move(x + 150, y)
        page.mouse.down()
        page.mouse.move(x - 150, y + (40 if i % 2 else -40), steps=6)
        page.mouse.up()
        page.wait_for_timeout(200)
    page.wait_for_timeout(1000)
    return page.evaluate(TILES)


def _spread(values: list[float]) -> str:
    if not values:
        return "nothing"
    return f"{np.median(values):.2f} s (90 %: {np.percentile(values, 90):.2f} s)"


if __name__ == "__main__":
    import sys

    main(tuple(sys.argv[1:]))
