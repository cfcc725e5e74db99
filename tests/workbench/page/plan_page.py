"""The plan view of the page as a person uses it: clicks at places of the world, keys, what it says of itself."""

from __future__ import annotations

from typing import Any

import numpy as np
from tests.workbench.serve_process import Served, wait_until

from linework.files.vectors.read_write import read_lines
from linework.model.lines import LineSet

Place = tuple[float, float]


class PlanPage:
    """A page that is open at a server, and the lines that the server has saved."""

    def __init__(self, page: Any, served: Served) -> None:
        self.page, self.served = page, served
        page.wait_for_selector("body[data-state=ready]", state="attached")

    # What it says of itself

    def said(self, name: str) -> str:
        return self.page.get_attribute(".plan-view", f"data-{name}") or ""

    @property
    def revision(self) -> int:
        return int(self.said("revision") or 0)

    def undo_all(self) -> None:
        """Leave the lines as they were before the first edit."""
        while self.revision and self.page.is_enabled("button[title^=Undo]"):
            before = self.revision
            self.press("Escape", "v", "Control+z")
            wait_until(lambda before=before: self.revision > before)

    @property
    def message(self) -> str:
        return str(self.page.inner_text(".status-bar .message"))

    @property
    def card(self) -> str:
        return str(self.page.inner_text(".growth-card"))

    @property
    def selected(self) -> list[str]:
        return (self.page.get_attribute(".attributes", "data-selected") or "").split()

    def wait_for(self, name: str, value: str) -> None:
        self.page.wait_for_selector(f".plan-view[data-{name}={value}]", state="attached")

    def saved_since(self, revision: int) -> LineSet:
        """Wait for an edit after a revision; return the lines in the file."""
        wait_until(lambda: self.revision > revision)
        return read_lines(self.served.lines)

    # What is in the file

    @property
    def lines(self) -> LineSet:
        return read_lines(self.served.lines)

    def documents(self) -> dict[str, Any]:
        """Return all lines as the server tells them, rejected ones too, by id."""
        return {line["id"]: line for line in self.served.get("/api/lines")["lines"]}

    # What a person does

    def pixel(self, place: Place) -> tuple[float, float]:
        east, north, resolution = (float(value) for value in self.said("view").split(","))
        box = self.page.locator(".plan-view .map").bounding_box()
        return (
            box["x"] + box["width"] / 2 + (place[0] - east) / resolution,
            box["y"] + box["height"] / 2 - (place[1] - north) / resolution,
        )

    def look_at(self, place: Place, nearer: int = 0) -> None:
        """Go to a place by the search field, then nearer by so many doublings."""
        before = self.said("view")
        self.page.keyboard.press("/")
        self.page.fill("input[name=go-to]", f"{place[0]}, {place[1]}")
        self.page.keyboard.press("Enter")
        wait_until(lambda: self.said("view") != before)
        for _ in range(nearer):
            before = self.said("view")
            self.press("+")
            wait_until(lambda before=before: self.said("view") != before)

    def look_at_all(self) -> None:
        """Zoom out to all lines; clicks before the view has changed would go astray."""
        before = self.said("view")
        self.press("0")
        wait_until(lambda: self.said("view") != before)

    def press(self, *keys: str) -> None:
        for key in keys:
            self.page.keyboard.press(key)

    def click(self, place: Place, **how: Any) -> None:
        self.page.mouse.click(*self.pixel(place), **how)

    def drag(self, start: Place, end: Place) -> None:
        mouse = self.page.mouse
        mouse.move(*self.pixel(start))
        mouse.down()
        mouse.move(*self.pixel(end), steps=4)
        mouse.up()

    def follow(self, place: Place, kind: str) -> None:
        """Choose the tool and the kind, and click."""
        self.look_at(place)
        self.press("f")
        self.page.select_option("select[name=kind]", kind)
        self.click(place)


def middle_of(line: Any) -> Place:
    """Return the vertex in the middle of a line: a row of a LineSet's vertices, or a document's xyz."""
    xyz = np.asarray(line)
    return float(xyz[len(xyz) // 2, 0]), float(xyz[len(xyz) // 2, 1])


def vertices(lines: LineSet, i: int) -> np.ndarray:
    return lines.xyz[lines.offsets[i] : lines.offsets[i + 1]]


def longest(lines: LineSet, kind: str) -> np.ndarray:
    """Return the vertices of the longest line of a kind."""
    found = lines[kind]
    return vertices(found, int(np.argmax(found.length_m)))
