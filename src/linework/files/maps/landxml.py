"""Lines as LandXML 1.2: plan features for all of them, breaklines for the edges of the carriageway.

References
----------
LandXML 1.2 schema. Positions are texts in the order northing, easting, elevation, all in one unit.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree.ElementTree import Element

import numpy as np
import pyproj
import shapely

import linework
from linework.arrays import FloatArray
from linework.crs import LOCAL, describe_crs, epsg_text, metric_twin, same_crs, stated_crs, unit_factors
from linework.errors import InputError, MachineError
from linework.files.maps.arcs import arc_vertices, clothoid_vertices
from linework.files.maps.xml_text import (
    children,
    descendants,
    field_texts,
    plain_tag,
    read_xml,
    text_table,
    xml_quoted,
)
from linework.files.vectors.fields import layer_names, ordered_layers
from linework.files.vectors.gdal import foreign_lines
from linework.files.vectors.pole_points import is_point
from linework.model.lines import POLE, LineSet

_NAMESPACE = "http://www.landxml.org/schema/LandXML-1.2"
#: The schema requires a date; always the same one, so that the same lines give the same bytes.
_DATE = 'date="2000-01-01" time="00:00:00"'
#: Where the surface of the road breaks: a terrain model has an edge along them.
BREAKLINES = ("road_boundary", "kerb_top")
#: Metres per unit of LandXML's `linearUnit`.
_UNITS_M = {
    "meter": 1.0, "millimeter": 0.001, "centimeter": 0.01, "kilometer": 1000.0, "foot": 0.3048,
    "USSurveyFoot": 1200 / 3937, "inch": 0.0254, "mile": 1609.344,
}  # fmt: skip
#: Longer curves are damaged.
_MAX_M = 1e8
#: Units that differ by less are one: both feet do by 2e-6, 2 mm in 1000 m of height.
_SAME_UNIT = 1e-5
_EXACT_UNIT = 1e-9
#: What coordinates may differ by that were converted to another unit and back, of their value.
_CONVERTED = 1e-12
#: A clothoid ends where the file says to within this, as coordinates and lengths are often rounded to the millimetre or
#: the centimetre [m]: else its parameters are not understood.
_CLOTHOID_END_M = 0.02
_OURS = "linework"


def write_landxml(lines: LineSet, part: Path, kinds: Sequence[str] = ()) -> None:
    """Write LandXML (called through `publish`): a group of plan features per kind.

    All coordinates are in the unit of the plan, heights too; where that is no unit of LandXML, all are in metres, and so is
    the CRS.
    """
    lines = _in_one_unit(lines)
    layers, fields = layer_names(lines), field_texts(lines)
    with part.open("w", encoding="utf-8", newline="\n") as file:
        file.write(
            f'<?xml version="1.0" encoding="UTF-8"?>\n<LandXML xmlns="{_NAMESPACE}" version="1.2" {_DATE} '
            'readOnly="false" language="English">\n'
            f"{_units_element(lines.crs)}"
            f"{_crs_element(lines.crs)}"
            f'<Application name="{_OURS}" version={xml_quoted(linework.__version__)}/>\n'
        )
        for layer in ordered_layers([*layers.tolist(), *kinds]):
            file.write(f"<PlanFeatures name={xml_quoted(layer)}>\n")
            for i in np.flatnonzero(layers == layer):
                file.write(
                    _plan_feature(str(lines.id[i]) or f"line {i + 1}", lines[int(i)].xyz, fields[i], int(i))
                )
            file.write("</PlanFeatures>\n")
        breaking = np.flatnonzero(np.isin(layers, BREAKLINES))
        if len(breaking):
            file.write('<Surfaces><Surface name="carriageway"><SourceData><Breaklines>\n')
            for i in breaking:
                file.write(
                    f'<Breakline brkType="standard" name={xml_quoted(lines.id[i] or f"line {i + 1}")} '
                    f"desc={xml_quoted(layers[i])}><PntList3D>{_points_text(lines[int(i)].xyz)}</PntList3D></Breakline>\n"
                )
            file.write("</Breaklines></SourceData></Surface></Surfaces>\n")
        poles = np.flatnonzero(is_point(lines))
        if len(poles):
            file.write(f"<CgPoints name={xml_quoted(POLE)}>\n")
            for i in poles:
                name = xml_quoted(lines.id[i] or f"line {i + 1}")
                file.write(
                    f"<CgPoint name={name} code={xml_quoted(POLE)}>{_points_text(lines[int(i)].xyz[:1])}</CgPoint>\n"
                )
            file.write("</CgPoints>\n")
        file.write("</LandXML>\n")


def _in_one_unit(lines: LineSet) -> LineSet:
    """Return lines with all coordinates in the unit that the file states."""
    own_m, up_m = unit_factors(lines.crs)
    unit_m = _UNITS_M[_unit_name(lines.crs)]
    plan, up = _ratio(own_m, unit_m), _ratio(up_m, unit_m)
    if plan == up == 1.0:
        return lines
    crs = lines.crs if plan == 1.0 else metric_twin(lines.crs)
    return replace(lines, crs=crs, xyz=lines.xyz * (plan, plan, up))


def _unit_name(crs: str) -> str:
    """Return the `linearUnit` of the plan; metre where LandXML has no name for it."""
    own_m = unit_factors(crs)[0]
    feet = (name for name in ("USSurveyFoot", "foot") if abs(own_m / _UNITS_M[name] - 1.0) < _EXACT_UNIT)
    return next(feet, "meter")


def _units_element(crs: str) -> str:
    name = _unit_name(crs)
    angles = 'angularUnit="decimal degrees" directionUnit="decimal degrees"'
    if name != "meter":
        return (
            f'<Units><Imperial areaUnit="squareFoot" linearUnit="{name}" volumeUnit="cubicFeet" '
            f'temperatureUnit="fahrenheit" pressureUnit="inchHG" {angles}/></Units>\n'
        )
    return (
        '<Units><Metric areaUnit="squareMeter" linearUnit="meter" volumeUnit="cubicMeter" '
        f'temperatureUnit="celsius" pressureUnit="milliBars" {angles}/></Units>\n'
    )


def _crs_element(crs: str) -> str:
    if crs == LOCAL:
        return '<CoordinateSystem name="local" desc="metres, not georeferenced"/>\n'
    # The schema has one code, for the plan; the whole CRS is its WKT
    code = epsg_text(crs).removeprefix("EPSG:").split("+")[0]
    wkt = pyproj.CRS.from_wkt(crs).to_wkt("WKT2_2019")
    named = f" epsgCode={xml_quoted(code)}" if code else ""
    return f"<CoordinateSystem name={xml_quoted(describe_crs(crs))}{named} ogcWktCode={xml_quoted(wkt)}/>\n"


def _plan_feature(name: str, xyz: FloatArray, fields: Mapping[str, str], number: int) -> str:
    """Return a line; the number keeps the order of the set."""
    properties = "".join(
        f"<Property label={xml_quoted(label)} value={xml_quoted(value)}/>"
        for label, value in {"line": str(number), **fields}.items()
    )
    return (
        f"<PlanFeature name={xml_quoted(name)}><CoordGeom><IrregularLine><Start>{_points_text(xyz[:1])}</Start>"
        f"<End>{_points_text(xyz[-1:])}</End><PntList3D>{_points_text(xyz)}</PntList3D></IrregularLine></CoordGeom>"
        f'<Feature code="{_OURS}">{properties}</Feature></PlanFeature>\n'
    )


def _points_text(xyz: FloatArray) -> str:
    return " ".join(f"{north!r} {east!r} {up!r}" for east, north, up in xyz.tolist())


def verify_landxml(part: Path, lines: LineSet, path: Path) -> None:
    """Read the file back and compare every coordinate, exactly unless its unit was changed.

    Raises
    ------
    MachineError
        Not the lines that were written.
    """
    back = read_landxml(part, "kind", None, None, [])
    written, found = _in_one_unit(lines), _in_one_unit(back)
    within = 0.0 if written is lines else _CONVERTED
    if (
        not same_crs(found.crs, written.crs)
        or not np.array_equal(found.offsets, written.offsets)
        or not np.allclose(found.xyz, written.xyz, rtol=within, atol=0.0)
    ):
        raise MachineError(
            "written file does not read back the same", where=path, advice="check for free space"
        )


class _Feature(NamedTuple):
    """A line of the file: its name for messages, its vertices and its texts."""

    name: str
    xyz: FloatArray
    texts: dict[str, str]


def read_landxml(
    path: Path, kind_field: str, kinds: Mapping[str, str] | None, crs: str | None, left_out: list[str]
) -> LineSet:
    """Read the plan features of a LandXML file, and the breaklines and alignments of a file of others.

    The kind of a line is the property `kind_field`; else the name of its group of plan features, "breakline" or
    "alignment". Lines, arcs and clothoids are read; what has another transition is added to `left_out`. Coordinates and
    CRS stay in feet where both are; else they are in metres. Heights are in the unit that the CRS has for them.

    Raises
    ------
    InputError
        Not LandXML, or in unknown units.
    CrsError
        Coordinates in degrees, or an unknown CRS.
    """
    root = read_xml(path, "LandXML")
    unit_m = _unit_m(root, path)
    is_own = any(e.get("name") == _OURS for e in children(root, "Application"))
    points = _named_points(root)
    read = [
        *_plan_features(root, points, left_out, unit_m, is_own=is_own),
        *([] if is_own else _breaklines(root, left_out)),
        *([] if is_own else _alignments(root, points, left_out, unit_m)),
    ]
    if is_own:
        read.sort(key=lambda feature: _order(feature.texts))
    own_crs, factors = _in_units(_crs_of(root, crs, path), unit_m)
    shapes = np.array([*(shapely.linestrings(f.xyz * factors) for f in read), None], dtype=object)[:-1]
    table: dict[str, Any] = text_table(f.texts for f in read)
    kind = [f.texts.get(kind_field, f.texts["group"]) for f in read]
    return foreign_lines(shapes, kind, table, kinds, own_crs, path, left_out, [f.name for f in read])


def _order(texts: Mapping[str, str]) -> int:
    text = texts.get("line", "")
    return int(text) if text.isdecimal() and len(text) < 12 else 0


def _unit_m(root: Element, path: Path) -> float:
    """Return the metres per unit; a file without units is in metres."""
    for units in children(root, "Units"):
        for system in children(units, "Metric", "Imperial"):
            name = system.get("linearUnit", "meter")
            if name not in _UNITS_M:
                raise InputError(
                    f"lengths in '{name[:20]}', which is not a unit of LandXML",
                    where=path,
                    advice="correct linearUnit",
                )
            return _UNITS_M[name]
    return 1.0


def _crs_of(root: Element, given: str | None, path: Path) -> str:
    for element in children(root, "CoordinateSystem"):
        stated = element.get("ogcWktCode") or ""
        code = (element.get("epsgCode") or "").removeprefix("EPSG:").strip()
        if stated:
            return stated_crs(stated, given, where=path)
        if code:
            return stated_crs(f"EPSG:{code}", given, where=path)
    return given or LOCAL


def _in_units(crs: str, unit_m: float) -> tuple[str, tuple[float, float, float]]:
    """Return the CRS of the lines, and what east, north and height of the file are multiplied by.

    A CRS whose plan is in the unit of the file keeps it: feet and US survey feet, which programs mix up, differ by 2
    millionths. A file has one unit for plan and heights, a CRS may have two.
    """
    own_m, up_m = unit_factors(crs)
    if own_m != 1.0 and _ratio(unit_m, own_m) != 1.0:
        crs, own_m, up_m = metric_twin(crs), 1.0, 1.0
    plan = _ratio(unit_m, own_m)
    return crs, (plan, plan, _ratio(unit_m, up_m))


def _ratio(unit_m: float, other_m: float) -> float:
    """Return how many of another unit one is; 1 where they are one."""
    return 1.0 if abs(unit_m / other_m - 1.0) < _SAME_UNIT else unit_m / other_m


def _named_points(root: Element) -> dict[str, FloatArray]:
    """Return the points that others refer to (`pntRef`), by name."""
    found = {}
    for point in descendants(root, "CgPoint"):
        name, place = point.get("name"), _positions(point.text, (2, 3))
        if name and place is not None and len(place) == 1:
            found[name] = place
    return found


def _positions(text: str | None, sizes: Sequence[int]) -> FloatArray | None:
    """Return (n, 3) east, north, up of a text; heights NaN in two dimensions; None where it is not numbers."""
    try:
        numbers = np.array((text or "").split(), dtype=np.float64)
    except ValueError:
        return None
    size = sizes[0] if len(sizes) == 1 else len(numbers)
    if size not in (2, 3) or not len(numbers) or len(numbers) % size:
        return None
    rows = numbers.reshape(-1, size)
    up = rows[:, 2] if size == 3 else np.full(len(rows), np.nan)
    return np.column_stack([rows[:, 1], rows[:, 0], up])


def _plan_features(
    root: Element, points: Mapping[str, FloatArray], left_out: list[str], unit_m: float, *, is_own: bool
) -> list[_Feature]:
    found = []
    for group in descendants(root, "PlanFeatures"):
        for feature in children(group, "PlanFeature"):
            name = f"plan feature {(feature.get('name') or '')[:40]}"
            texts = {"group": group.get("name") or "plan_feature"}
            if not is_own:
                texts["id"] = feature.get("name") or ""
            for entry in descendants(feature, "Property"):
                texts[entry.get("label") or ""] = entry.get("value") or ""
            geometry = [piece for outer in children(feature, "CoordGeom") for piece in outer]
            xyz = _chained(geometry, points, unit_m)
            if isinstance(xyz, str):
                left_out.append(f"{name}: {xyz}")
            elif len(xyz) > 1:
                found.append(_Feature(name, xyz, texts))
    return found


def _chained(pieces: Sequence[Element], points: Mapping[str, FloatArray], unit_m: float) -> FloatArray | str:
    """Return the vertices of the pieces of a line one after the other, or what cannot be read."""
    vertices = np.zeros((0, 3))
    for piece in pieces:
        name = plain_tag(piece)
        if name not in ("Line", "IrregularLine", "Curve", "Spiral"):
            if name == "Chain":
                return f"a {name} is not read"
            continue
        listed = [
            _positions(inner.text, (3,) if plain_tag(inner) == "PntList3D" else (2,))
            for inner in children(piece, "PntList3D", "PntList2D")
        ]
        ends = {
            plain_tag(e): points.get(e.get("pntRef", "")) if e.get("pntRef") else _positions(e.text, (2, 3))
            for e in children(piece, "Start", "Center", "PI", "End")
        }
        own = listed[0] if listed else _joined(name, piece, ends, unit_m)
        if isinstance(own, str):
            return own
        if own is None:
            return f"its {name} has no places that can be read"
        # A piece begins where the one before it ends
        is_repeat = len(vertices) and np.array_equal(vertices[-1, :2], own[0, :2])
        vertices = np.concatenate([vertices, own[1:] if is_repeat else own])
    return vertices


def _joined(
    name: str, piece: Element, ends: Mapping[str, FloatArray | None], unit_m: float
) -> FloatArray | str | None:
    """Return the vertices of a piece, what cannot be read, or None where places are missing."""
    start, end = ends.get("Start"), ends.get("End")
    other = ends.get({"Curve": "Center", "Spiral": "PI"}.get(name, "Start"))
    if start is None or end is None or other is None:
        return None
    if name == "Curve":
        return arc_vertices(start[0], end[0], other[0], is_left=piece.get("rot") == "ccw")
    if name == "Spiral":
        return _clothoid(piece, start[0], end[0], other[0], unit_m)
    return np.concatenate([start, end])


def _clothoid(
    piece: Element, start: FloatArray, end: FloatArray, corner: FloatArray, unit_m: float
) -> FloatArray | str:
    """Return the vertices of a clothoid between its ends, whose tangents meet at a corner; heights are even."""
    kind = piece.get("spiType") or "clothoid"
    if kind != "clothoid":
        return f"a Spiral of the type {kind[:20]} is not read"
    try:
        length = float(piece.get("length", "nan"))
        radii = [float(piece.get(key, "nan")) for key in ("radiusStart", "radiusEnd")]
    except ValueError:
        return "its Spiral has a length or radii that are no numbers"
    if not 0.0 < length < _MAX_M or any(not abs(radius) > 0.0 for radius in radii):
        return "its Spiral has a length or radii that are no numbers"
    sign = 1.0 if piece.get("rot") == "ccw" else -1.0
    bends = (sign / radii[0], sign / radii[1])
    plan = clothoid_vertices(start, corner[:2] - start[:2], length, bends)
    miss = end[:2] - plan[-1]
    if not np.hypot(*miss) * unit_m <= _CLOTHOID_END_M:
        return f"its Spiral ends {np.hypot(*miss) * unit_m:.2f} m from where it should"
    share = np.linspace(0.0, 1.0, len(plan))[:, None]
    found = np.column_stack([plan + share * miss, (start[2] + share * (end[2] - start[2]))[:, 0]])
    found[0], found[-1] = start, end
    return found


def _alignments(
    root: Element, points: Mapping[str, FloatArray], left_out: list[str], unit_m: float
) -> list[_Feature]:
    """Return the alignments of designs in plan, with heights where the ends of their pieces have some."""
    found = []
    for i, alignment in enumerate(descendants(root, "Alignment")):
        name = f"alignment {(alignment.get('name') or str(i + 1))[:40]}"
        geometry = [piece for outer in children(alignment, "CoordGeom") for piece in outer]
        xyz = _chained(geometry, points, unit_m)
        if isinstance(xyz, str):
            left_out.append(f"{name}: {xyz}")
        elif len(xyz) > 1:
            found.append(_Feature(name, xyz, {"group": "alignment", "id": alignment.get("name") or ""}))
    return found


def _breaklines(root: Element, left_out: list[str]) -> list[_Feature]:
    found = []
    for i, line in enumerate(descendants(root, "Breakline")):
        name = f"breakline {line.get('name') or i + 1}"
        listed = children(line, "PntList3D")
        xyz = _positions(listed[0].text, (3,)) if listed else None
        if xyz is None or len(xyz) < 2:
            left_out.append(f"{name}: no list of places in three dimensions")
            continue
        found.append(_Feature(name, xyz, {"group": "breakline", "id": line.get("name") or ""}))
    return found
