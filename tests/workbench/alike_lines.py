"""Dashes on a served drive that nobody has judged: eight along the road, the first two of them short."""

from __future__ import annotations

from typing import Any

from tests.workbench.serve_process import Served


def drawn_dashes(served: Served) -> list[dict[str, Any]]:
    """Return the documents of new dashes beside the van's path, unreviewed."""
    path = served.get("/api/survey")["path"]
    ids: list[str] = []
    for k in range(8):
        (east, north, _), (to_east, to_north, _) = (
            path[(k + 1) * len(path) // 10],
            path[(k + 1) * len(path) // 10 + 1],
        )
        step = ((to_east - east) ** 2 + (to_north - north) ** 2) ** 0.5
        way = (to_east - east) / step, (to_north - north) / step
        length, off = (1.0, 2.5) if k < 2 else (3.0 + 0.1 * k, 1.0 + 0.05 * k)
        start = east - off * way[1], north + off * way[0]
        xyz = [start, (start[0] + length * way[0], start[1] + length * way[1])]
        ids.append(
            _saved(served, {"action": "draw", "kind": "lane_marking_dash", "xyz": xyz})["lines"][0]["id"]
        )
    _saved(served, {"action": "restore", "ids": ids})
    there = {line["id"]: line for line in served.get("/api/lines")["lines"]}
    return [there[name] for name in ids]


def _saved(served: Served, edit: dict[str, Any]) -> Any:
    revision = served.get("/api/survey")["revision"]
    return served.post("/api/changes", {"revision": revision, "edit": edit})
