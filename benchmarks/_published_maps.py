"""Lines that the makers of a survey published with it, read where they lie: they never enter the repository."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import numpy as np
import shapely

from linework.arrays import FloatArray

#: Lines with their kinds.
Lines = list[tuple[str, FloatArray]]


def argoverse_lines(path: Path) -> Lines:
    """Return the painted lane boundaries and the edges of the drivable area of an Argoverse 2 map.

    Neighbouring lanes share a boundary, which the map holds once for each.
    """
    found: dict[tuple[tuple[float, ...], ...], str] = {}
    for feature in json.loads(path.read_text(encoding="utf-8"))["features"]:
        told = feature["properties"]
        kind = {"lane_boundary": "lane_marking", "drivable_area_edge": "road_boundary"}.get(told["kind"])
        if kind is None or (kind == "lane_marking" and told["mark"] == "NONE"):
            continue
        line = [tuple(map(float, place)) for place in feature["geometry"]["coordinates"]]
        found.setdefault(tuple(min(line, line[::-1])), kind)
    return [(kind, np.array(line)) for line, kind in found.items()]


def bgt_lines(path: Path) -> Lines:
    """Return the outlines of the carriageways of the Dutch base map (BGT), without heights.

    Edges that two carriageways share, where a road is cut into polygons, bound nothing and are left out.
    """
    edges: dict[frozenset[tuple[float, float]], list[tuple[float, float]]] = {}
    shared = set()
    with path.open(encoding="utf-8") as file:
        for row in csv.DictReader(file):
            if not row["bgt_type"].startswith("rijbaan"):
                continue
            ring = [(float(x), float(y)) for x, y in json.loads(row["polygon"])]
            for pair in pairwise(ring):
                key = frozenset(pair)
                if key in edges:
                    shared.add(key)
                elif len(key) == 2:
                    edges[key] = list(pair)
    whole = shapely.line_merge(
        shapely.multilinestrings([edge for key, edge in edges.items() if key not in shared])
    )
    rings = [shapely.get_coordinates(part) for part in shapely.get_parts(whole)]
    return [("road_boundary", np.column_stack([ring, np.full(len(ring), np.nan)])) for ring in rings]


PUBLISHED: dict[str, Callable[[Path], Lines]] = {"argoverse": argoverse_lines, "bgt": bgt_lines}
