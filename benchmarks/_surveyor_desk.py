"""A surveyor's desk: the workbench's page, driven as a person drives it, with a picture and a note of every step."""

from __future__ import annotations

import html
import time
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from tests.workbench.page.plan_page import PlanPage, middle_of
from tests.workbench.serve_process import opened_page, wait_until

#: The page asks for nothing for so long: what it shows is all there is. [ms]
QUIET_MS = 400
LARGE = {"viewport": {"width": 1920, "height": 1080}, "color_scheme": "dark"}
#: States of a line that does not grow.
STOPPED = ("stopped", "refused")


@dataclass
class Step:
    """What was done, why, what the page said, and how long it took with the page's answer [s]."""

    picture: str
    did: str
    why: str
    said: str
    took_s: float


@dataclass
class Desk:
    """One page at a server, a folder for its pictures, and the steps so far."""

    browser: object
    served: object
    folder: Path
    page: object = None
    plan: PlanPage = None
    steps: list = field(default_factory=list)
    actions: int = 0
    waiting: set = field(default_factory=set)

    @contextmanager
    def open(self, **context):
        with opened_page(self.browser, self.served, **context) as page:
            page.on("request", self._asked)
            page.on("requestfinished", self._answered)
            page.on("requestfailed", self._answered)
            before = self.page, self.plan
            self.page, self.plan = page, PlanPage(page, self.served)
            yield self
            self.page, self.plan = before

    def _asked(self, request):
        self.waiting.add(request)

    def _answered(self, request):
        self.waiting.discard(request)

    def quiet(self):
        """Wait until the page has all that it asked for."""
        wait_until(self._is_quiet)

    def _is_quiet(self):
        seen = set(self.waiting)
        self.page.wait_for_timeout(QUIET_MS)
        return not seen and not self.waiting

    # What is done

    @contextmanager
    def step(self, did, why="", actions=0):
        """Do something, wait until it is shown, and take a picture of it."""
        start = time.perf_counter()
        yield
        self.quiet()
        took_s = time.perf_counter() - start - QUIET_MS / 1000.0
        self.actions += actions
        name = f"{len(self.steps) + 1:02}.png"
        self.page.screenshot(path=str(self.folder / name))
        said = self.plan.message
        if self.page.locator(".growth-card").is_visible():
            said = f"{self.plan.card.splitlines()[0]} {said}".strip()
        self.steps.append(Step(name, did, why, said, took_s))
        print(f"  {name} {took_s:5.1f} s  {did}{f': {why}' if why else ''}  [{said}]", flush=True)

    def show(self, *tabs):
        for tab in tabs:
            self.page.get_by_role("tab", name=tab, exact=True).click()

    # The queue

    def items(self):
        return self.served.get("/api/queue")

    def changed(self, *keys):
        """Press keys that save an edit, and wait for it."""
        before = self.plan.revision
        self.plan.press(*keys)
        wait_until(lambda: self.plan.revision > before)

    def changed_in(self, view, key):
        before = self.plan.revision
        view.press(key)
        wait_until(lambda: self.plan.revision > before)

    # Lines

    def lines(self):
        return self.plan.documents()

    def line_near(self, kind, place, within_m=3.0):
        """Id of the line of a kind with a vertex nearest to a place, rejected ones left out; "" where none is near."""
        away = {
            name: float(np.hypot(*(np.array(line["xyz"])[:, :2] - place).T).min())
            for name, line in self.lines().items() if line["kind"] == kind and line["review"] != "rejected"
        }  # fmt: skip
        best = min(away, key=away.get, default="")
        return best if best and away[best] <= within_m else ""

    def select(self, *names):
        """Click on lines, the second and further ones with Shift held, in the middle of each."""
        for k, name in enumerate(names):
            self.show_line(name)
            if k:
                self.page.keyboard.down("Shift")
            self.plan.click(middle_of(self.lines()[name]["xyz"]))
            self.page.keyboard.up("Shift")
        with suppress(AssertionError):
            wait_until(lambda: set(self.plan.selected) == set(names), seconds=10.0)
        return set(self.plan.selected) == set(names)

    def show_line(self, name):
        self.plan.look_at(middle_of(self.lines()[name]["xyz"]), nearer=1)

    # Following

    def grown(self):
        """Wait until the line has stopped or was refused; return which."""
        wait_until(lambda: self.page.wait_for_timeout(20) or self.plan.said("state") in STOPPED)
        return self.plan.said("state")


def lengths_of(lines):
    """Number and metres in plan by kind."""
    found = {}
    for kind in sorted(set(lines.kind.tolist())):
        of_kind = lines[kind]
        found[kind] = (len(of_kind), float(np.sum(of_kind.length_m)))
    return found


def record_of(title, tables, steps, by_hand):
    """The record of a session as one page of HTML beside its pictures."""
    parts = [f"<!doctype html><meta charset='utf-8'><title>{html.escape(title)}</title>",
             "<style>body{font:15px sans-serif;max-width:1300px;margin:2em auto}img{max-width:100%;border:1px solid #999}"
             "table{border-collapse:collapse}td,th{border:1px solid #ccc;padding:2px 8px;text-align:left}</style>",
             f"<h1>{html.escape(title)}</h1>"]  # fmt: skip
    for caption, head, rows in tables:
        cells = "".join(
            "<tr>" + "".join(f"<td>{html.escape(str(c))}</td>" for c in row) + "</tr>" for row in rows
        )
        heads = "".join(f"<th>{html.escape(h)}</th>" for h in head)
        parts.append(f"<h2>{html.escape(caption)}</h2><table><tr>{heads}</tr>{cells}</table>")
    parts.append(
        "<h2>Left to do by hand</h2><ul>" + "".join(f"<li>{html.escape(t)}</li>" for t in by_hand) + "</ul>"
    )
    for n, step in enumerate(steps, 1):
        parts.append(f"<h3>{n}. {html.escape(step.did)}</h3><p>{html.escape(step.why)}</p>"
                     f"<p><em>{html.escape(step.said)}</em> ({step.took_s:.1f} s)</p><img src='{step.picture}' loading='lazy'>")  # fmt: skip
    return "\n".join(parts) + "\n"
