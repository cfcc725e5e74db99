"""The workbench for half an hour: what it answers, how long that takes, and whether memory or descriptors grow."""

from __future__ import annotations

import random
import shutil
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import httpx
from tests.campaign.commands import make_scene
from tests.campaign.ledger import Step, Trial
from tests.workbench.follow_talk import talk_with

if TYPE_CHECKING:
    from tests.workbench.serve_process import Served

MINUTES = 30.0
#: Memory may be larger in the last quarter than in the second one by this share. The first is for caches to fill.
GROWTH = 0.05
#: Descriptors of connections that are just being opened or closed.
FEW_DESCRIPTORS = 8
#: Pause between two requests, so that other programs have a turn. [s]
PAUSE_S = 0.05
#: Between two looks at memory and descriptors. [s]
LOOK_S = 5.0
#: What is asked for, each as often as it stands here: `Asked` has a method for each.
REQUESTS = (
    "lines", "survey", "tile", "tile", "tile", "points", "queue", "draw", "undo", "redo", "bad", "section", "evidence",
    "snap", "straightened", "heights", "export", "follow",
)  # fmt: skip
#: Kinds that can be followed; from a line of another kind the server chooses by the place.
FOLLOWED = ("lane_marking", "road_boundary", "guardrail", "cable")


def trials(folder: Path, share: float) -> Iterator[tuple[str, Callable[[], Trial]]]:
    """Yield the one trial."""
    minutes = MINUTES * min(share, 1.0)
    yield f"{minutes:g} minutes", lambda: soaked(folder, 60.0 * minutes)


def soaked(folder: Path, seconds: float) -> Trial:
    """Ask and edit for so long."""
    from tests.workbench.serve_process import served_survey

    scene = make_scene(folder / "scene")
    survey = folder / "soak"
    shutil.rmtree(survey, ignore_errors=True)
    shutil.copytree(scene.folder / "drive", survey, ignore=shutil.ignore_patterns(".linework"))
    shutil.copy(scene.folder / "lines.gpkg", survey / "lines.gpkg")
    trial, looks = Trial(cases=0), []
    with served_survey(survey) as served:
        asked = Asked(served, random.Random(1), trial)
        end, next_look = time.monotonic() + seconds, 0.0
        while time.monotonic() < end:
            asked.one()
            if time.monotonic() >= next_look:
                next_look = time.monotonic() + min(LOOK_S, seconds / 40)
                looks.append(usage_of(served.process.pid))
            time.sleep(PAUSE_S)
    judge(trial, looks, asked)
    return trial


class Asked:
    """Requests to a server, drawn at random, and how long their answers took."""

    def __init__(self, served: Served, chance: random.Random, trial: Trial) -> None:
        self.served, self.chance, self.trial = served, chance, trial
        self.client = served.client
        self.ms: list[float] = []
        self.survey = self.client.get("/api/survey").json()
        self.drawn = 0

    def one(self) -> None:
        """Ask for one thing."""
        what = self.chance.choice(REQUESTS)
        start = time.perf_counter()
        answer = getattr(self, f"_{what}")()
        self.ms.append(1e3 * (time.perf_counter() - start))
        self.trial.cases += 1
        self.trial.came[f"{answer.status_code}"] += 1
        if answer.status_code >= 500:
            self.trial.blame("exit 1", f"{what}: {answer.status_code}: {answer.text[:200]}")
        if what not in ("undo", "redo", "bad", "tile") and answer.status_code != 200:
            self.trial.blame("other faults", f"{what}: {answer.status_code}: {answer.text[:200]}")

    def _lines(self) -> httpx.Response:
        return self.client.get("/api/lines")

    def _survey(self) -> httpx.Response:
        return self.client.get("/api/survey")

    def _queue(self) -> httpx.Response:
        return self.client.get("/api/queue")

    def _place(self) -> tuple[float, float]:
        west, south, east, north = self.survey["bounds"][:4] if "bounds" in self.survey else (0, 0, 0, 0)
        return self.chance.uniform(west, east), self.chance.uniform(south, north)

    def _tile(self) -> httpx.Response:
        tiles = self.survey["tiles"]
        z = self.chance.randrange(len(tiles["resolutions"]))
        size = tiles["resolutions"][z] * tiles["tile_px"]
        east, north = self._place()
        col, row = int((east - tiles["origin"][0]) // size), int((tiles["origin"][1] - north) // size)
        image = self.chance.choice(("density", "height", "above_road", "intensity"))
        return self.client.get(f"/api/tiles/{image}/{z}/{col}/{row}")

    def _points(self) -> httpx.Response:
        e, n = self._place()
        return self.client.get(
            f"/api/points?west={e - 5}&south={n - 5}&east={e + 5}&north={n + 5}&most=60000"
        )

    def _draw(self) -> httpx.Response:
        east, north = self._place()
        self.drawn += 1
        order = {
            "action": "draw", "kind": "guardrail",
            "xyz": [[east, north, 100.0], [east + 0.5, north + 1.0, 100.0 + 1e-3 * self.drawn]],
        }  # fmt: skip
        return self.client.post("/api/changes", json={"revision": 0, "edit": order})

    def _line(self) -> tuple[dict[str, Any], tuple[float, float]]:
        """Return a line, and a place on it."""
        line = self.chance.choice(self.client.get("/api/lines").json()["lines"])
        east, north, _ = self.chance.choice(line["xyz"])
        return line, (east, north)

    def _section(self) -> httpx.Response:
        _, (east, north) = self._line()
        query = {"east": east, "north": north, "heading_deg": self.chance.uniform(0, 360), "half_width_m": 6}
        return self.client.get("/api/section", params=query | {"thickness_m": 0.3})

    def _evidence(self) -> httpx.Response:
        line, (east, north) = self._line()
        return self.client.get(
            "/api/evidence", params={"kind": line["kind"], "east": east, "north": north, "line": line["id"]}
        )

    def _snap(self) -> httpx.Response:
        line, (east, north) = self._line()
        return self.client.get(
            "/api/snap", params={"kind": line["kind"], "east": east, "north": north, "reach_m": 0.3}
        )

    def _straightened(self) -> httpx.Response:
        start = self.chance.uniform(0, 20)
        query = {"line": "", "from_m": start, "to_m": start + 20, "half_width_m": 5}
        return self.client.get("/api/straightened", params=query)

    def _heights(self) -> httpx.Response:
        line, place = self._line()
        return self.client.post("/api/heights", json={"kind": line["kind"], "places": [place]})

    def _export(self) -> httpx.Response:
        form = self.chance.choice(("gpkg", "geojson", "dxf", "kml", "landxml"))
        return self.client.post("/api/export", json={"format": form, "ids": [self._line()[0]["id"]]})

    def _follow(self) -> httpx.Response:
        """Follow a line from a click, and keep it."""
        line, place = self._line()
        kind = line["kind"] if line["kind"] in FOLLOWED else ""
        with talk_with(self.served) as talk:
            last = talk.follow(type="pick", at=place, kind=kind)[-1]
        if last["type"] == "refused":
            return httpx.Response(200)
        self.drawn += 1
        edit = {
            "action": "keep",
            "trace": last["trace"],
            "first": 0,
            "last": len(last["lines"][0]["xyz"]) - 1,
        }
        revision = self.client.get("/api/survey").json()["revision"]
        return self.client.post("/api/changes", json={"revision": revision, "edit": edit})

    def _undo(self) -> httpx.Response:
        return self.client.post("/api/undo", json={})

    def _redo(self) -> httpx.Response:
        return self.client.post("/api/redo", json={})

    def _bad(self) -> httpx.Response:
        paths = (
            "/api/tiles/density/99/0/0",
            "/api/nothing",
            "/api/lines?since=x",
            "/api/pairs/7/left",
            "/%2e%2e/etc/passwd",
        )
        return self.client.get(self.chance.choice(paths))


def usage_of(pid: int) -> tuple[float, int]:
    """Return memory [MB] and open descriptors of a process and all that it started."""
    pids, waiting = [], [pid]
    while waiting:
        one = waiting.pop()
        pids.append(one)
        for task in Path(f"/proc/{one}/task").glob("*/children"):
            try:
                waiting += map(int, task.read_text().split())
            except OSError:
                continue
    memory, descriptors = 0.0, 0
    for one in pids:
        try:
            status = Path(f"/proc/{one}/status").read_text().splitlines()
            memory += sum(int(line.split()[1]) / 1024 for line in status if line.startswith("VmRSS"))
            descriptors += sum(1 for _ in Path(f"/proc/{one}/fd").iterdir())
        except OSError:
            continue
    return memory, descriptors


def judge(trial: Trial, looks: list[tuple[float, int]], asked: Asked) -> None:
    """Compare the last quarter with the second one."""
    quarter = max(len(looks) // 4, 1)
    before, after = looks[quarter : 2 * quarter] or looks, looks[-quarter:]
    memory = [max(mb for mb, _ in part) for part in (before, after)]
    descriptors = [max(n for _, n in part) for part in (before, after)]
    ms = sorted(asked.ms)
    trial.figures |= {
        "MB in the second quarter": round(memory[0]), "MB in the last quarter": round(memory[1]),
        "descriptors in the second quarter": descriptors[0], "descriptors in the last quarter": descriptors[1],
        "p50 ms": round(ms[len(ms) // 2], 1), "p99 ms": round(ms[int(0.99 * (len(ms) - 1))], 1), "lines drawn": asked.drawn,
    }  # fmt: skip
    # A line that is drawn is kept, with its history: some kilobytes each
    allowed = memory[0] * (1.0 + GROWTH) + 0.02 * asked.drawn
    if len(looks) >= 20 and memory[1] > allowed:
        trial.blame("other faults", f"memory grew from {memory[0]:.0f} to {memory[1]:.0f} MB")
    if descriptors[1] > descriptors[0] + FEW_DESCRIPTORS:
        trial.blame("other faults", f"descriptors grew from {descriptors[0]} to {descriptors[1]}")


STEP = Step("soak", "the workbench for 30 minutes", trials)
