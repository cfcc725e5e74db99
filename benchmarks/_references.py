"""References for real surveys: lines measured by hand on rasters of the data, which lie beside the repository.

A reference is a TOML file of ``tests/references``: which file of the data it is for, the lines as coordinates, how
and how well they were measured, the area in which every line of its kinds was looked for, and kinds of which there is
nothing in that area. What the makers of a survey published with it is read from there (`_published_maps`).
"""

from __future__ import annotations

import os
import tomllib
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from benchmarks._published_maps import PUBLISHED
from linework.arrays import FloatArray
from linework.model.lines import LineSet

ROOT = Path(__file__).parents[1]
FOLDER = ROOT / "tests" / "references"
#: Names the folder of the real surveys where it does not lie beside the repository.
VARIABLE = "LINEWORK_REAL_DATA"
#: Cuts at borders of areas leave crumbs of lines, and no line this short says anything. [m]
SHORTEST_M = 0.05


@dataclass(frozen=True)
class Reference:
    """What is true in one file of real data.

    Parameters
    ----------
    file
        The data, from the folder of all real data.
    kinds
        Kinds of which every line within the area is here.
    absent
        Kinds of which nothing is within the area: every line found is false.
    tolerance_m
        Tolerance at which lines are judged: not below the accuracy of the reference. [m]
    area, unjudged
        Polygons: where lines were looked for, and where within it nobody could tell what is right.
    """

    name: str
    file: str
    crs: str
    kinds: tuple[str, ...]
    absent: tuple[str, ...]
    accuracy_m: float
    tolerance_m: float
    measured: str
    lines: LineSet
    area: shapely.Geometry
    unjudged: shapely.Geometry = field(default_factory=shapely.Polygon)

    @property
    def judged(self) -> shapely.Geometry:
        """The part of the area in which lines are right or wrong."""
        return self.area.difference(self.unjudged)

    @property
    def hectares(self) -> float:
        return float(self.judged.area / 10_000.0)


def data_folder(given: str | Path | None = None) -> Path:
    """Return the folder of real data: as given, as the environment says, or beside the repository."""
    return Path(given or os.environ.get(VARIABLE) or ROOT.parent / "shared" / "data")


def read_references(data: Path, folder: Path = FOLDER) -> list[Reference]:
    """Return all references, in the order of their names; those with published lines need the data."""
    return [read_reference(path, data) for path in sorted(folder.glob("*.toml"))]


def read_reference(path: Path, data: Path) -> Reference:
    """Return one reference.

    Published lines are left out where the data is missing: `is_there` says so.
    """
    told: dict[str, Any] = tomllib.loads(path.read_text(encoding="utf-8"))
    area, unjudged = (
        polygon_of(told["area"]),
        shapely.union_all(list(map(polygon_of, told.get("unjudged", [])))),
    )
    own = [(line["kind"], np.array(line["xyz"], dtype=np.float64)) for line in told.get("lines", [])]
    published = told.get("published")
    if published and (data / published["file"]).exists():
        own += PUBLISHED[published["form"]](data / published["file"])
    lines = LineSet.from_lines([xyz for _, xyz in own], kind=[kind for kind, _ in own], crs=told["crs"])
    return Reference(
        name=path.stem,
        file=told["file"],
        crs=told["crs"],
        kinds=tuple(told["kinds"]),
        absent=tuple(told["absent"]),
        accuracy_m=float(told["accuracy_m"]),
        tolerance_m=float(told["tolerance_m"]),
        measured=told["measured"],
        lines=within(lines, area.difference(unjudged)),
        area=area,
        unjudged=unjudged,
    )


def polygon_of(corners: list[list[float]]) -> shapely.Geometry:
    return shapely.Polygon(np.array(corners))


def within(lines: LineSet, area: shapely.Geometry) -> LineSet:
    """Return the parts of lines that lie in an area, each with its kind."""
    kinds: list[str] = []
    parts: list[FloatArray] = []
    shapely.prepare(area)
    for i, kind in enumerate(lines.kind.tolist()):
        xyz = lines.xyz[lines.offsets[i] : lines.offsets[i + 1]]
        if len(xyz) < 2:
            continue
        # What GEOS makes of a missing height is not defined
        held = np.where(np.isnan(xyz), 0.0, xyz)
        cut = shapely.intersection(shapely.LineString(held), area)
        for part in shapely.get_parts(shapely.line_merge(cut) if cut.geom_type == "MultiLineString" else cut):
            if part.geom_type == "LineString" and part.length >= SHORTEST_M:
                parts.append(shapely.get_coordinates(part, include_z=True))
                kinds.append(kind)
    return LineSet.from_lines(parts, kind=kinds, crs=lines.crs)
