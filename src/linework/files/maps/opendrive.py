"""Lines as OpenDRIVE 1.8: a road per unbroken stretch of lanes, with its markings; rails and wires as objects.

References
----------
ASAM OpenDRIVE 1.8.0. Reference lines are parametric cubics by arc length; lanes have widths that are linear between
stations of 1 m; heights are the elevation, the superelevation (the crossfall of all bounds together) and the shape of the
cross-section above it. No links between roads, no junctions, no
direction of travel: none of that was measured.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pyproj

from linework.arrays import FloatArray, distance_along
from linework.crs import LOCAL, horizontal_part
from linework.errors import MachineError, UsageError
from linework.files.maps.opendrive_marks import Drawn, road_mark, user_data
from linework.files.maps.opendrive_read import SECTION_END_M, read_opendrive
from linework.files.maps.xml_text import field_texts, xml_quoted
from linework.lines.doubles import merged_doubles
from linework.lines.lane_sections import LaneRoad, LaneSection, lane_roads
from linework.lines.names import with_ids
from linework.lines.units import in_metres
from linework.model.lines import POLE, LineSet

#: Types of objects by kind. A wire has no type of its own.
_OBJECTS = {
    "guardrail": 'type="barrier" subtype="guardRail"', "barrier": 'type="barrier" subtype="jerseyBarrier"',
    "fence": 'type="barrier" subtype="fence"', "cable": 'type="obstacle"', POLE: 'type="pole"',
}  # fmt: skip
#: Farthest object from its road. [m]
_REACH_M = 30.0
#: What piecewise linear widths may differ from the stations: a bound lies at the sum of those of some ten lanes, and of
#: the offset and the elevation; and what is compared after writing. [m]
_LINEAR_M, _SAME_M = 5e-5, 1e-3
#: Distance of the places between which the superelevation is linear: crossfall turns over tens of metres. [m]
_BANK_M = 10.0
#: What its records may differ by: 0.03 mm at 30 m. [rad]
_BANK_EXACT = 1e-6


class _Object(NamedTuple):
    """A line beside a road: its number, its vertices, and the same along and across the reference line."""

    line: int
    xyz: FloatArray
    s_m: FloatArray
    t_m: FloatArray


def write_opendrive(
    lines: LineSet,
    part: Path,
    kinds: Sequence[str] = (),  # noqa: ARG001
    *,
    lanes: bool = False,
) -> None:
    """Write OpenDRIVE (called through `publish`): the spaces between the lines, and rails and wires beside them.

    The standard has metres: lines in feet are written in the same projection in metres.
    With `lanes`, spaces that are lanes (see `linework.lines.lane_sections.lane_roads`) are of the type driving.

    Raises
    ------
    UsageError
        No two lines are beside each other as the bounds of a lane are.
    """
    doubles = merged_doubles(with_ids(in_metres(lines), ()))
    lines = doubles.lines
    roads = lane_roads(lines)
    if not roads:
        raise UsageError(
            "OpenDRIVE needs a road: no marking has another line 2.2 to 6.0 m beside it", where=part,
            advice="write .osm or .gpkg",
        )  # fmt: skip
    offset = np.round(lines.xyz[:, :2].mean(axis=0), -3)
    drawn = Drawn(lines, field_texts(lines), doubles.stripes)
    objects = _objects(lines, roads)
    with part.open("w", encoding="utf-8", newline="\n") as file:
        file.write('<?xml version="1.0" encoding="UTF-8"?>\n<OpenDRIVE>\n')
        file.write(_header(lines, offset))
        for i, road in enumerate(roads):
            file.write(_road(road, i + 1, drawn, offset, objects.get(i, []), has_lanes=lanes))
        file.write("</OpenDRIVE>\n")


def _header(lines: LineSet, offset: FloatArray) -> str:
    west, south, east, north = lines.bounds
    known = [np.sqrt(np.nanmean(s**2)) for s in (lines.sigma_xy_m, lines.sigma_z_m) if np.isfinite(s).any()]
    quality = ""
    if len(known) == 2:
        xy, z = (f"{v:.4f}" for v in known)
        quality = f'<dataQuality><error xyAbsolute="{xy}" xyRelative="{xy}" zAbsolute="{z}" zRelative="{z}"/></dataQuality>'
    reference = ""
    if lines.crs != LOCAL:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # PROJ strings hold less than WKT, which follows
            reference = f"<geoReference><![CDATA[{horizontal_part(pyproj.CRS.from_wkt(lines.crs)).to_proj4()}]]></geoReference>"
    return (
        f'<header revMajor="1" revMinor="8" name="linework" version="1.00" north="{float(north - offset[1])!r}" '
        f'south="{float(south - offset[1])!r}" east="{float(east - offset[0])!r}" west="{float(west - offset[0])!r}" vendor="linework">'
        f'{reference}<offset x="{float(offset[0])!r}" y="{float(offset[1])!r}" z="0.0" hdg="0.0"/>{quality}'
        f'<userData code="linework:crs" value={xml_quoted(lines.crs)}/></header>\n'
    )


def _road(
    road: LaneRoad, number: int, drawn: Drawn, offset: FloatArray, objects: Sequence[_Object], *, has_lanes: bool,
) -> str:  # fmt: skip
    first, last = road.sections[0].first, road.sections[-1].last
    begin_m = float(road.station_m[first])
    length = float(road.station_m[last]) - begin_m
    station = road.station_m[first : last + 1] - begin_m
    bank = _bank(road, begin_m, length)
    centre, level = np.zeros(len(station)), np.zeros(len(station))
    # Sections may share a station; the values there are the same
    for section in reversed(road.sections):
        rows = slice(section.first - first, section.last - first + 1)
        across = _on_plane(section.offset_m, _above(section), np.interp(station[rows], *bank)[:, None])[0]
        centre[rows], level[rows] = across[:, section.centre], _levels(section)
    name = str(drawn.lines.id[road.sections[0].bounds[road.sections[0].centre]])
    texts = [
        f'<road name={xml_quoted(name)} length="{float(length)!r}" id="{number}" junction="-1">',
        _plan(road, begin_m, begin_m + length, offset),
        "<elevationProfile>" + _records("elevation", "s", station, level) + "</elevationProfile>",
        "<lateralProfile>"
        + _records("superelevation", "s", *bank, _BANK_EXACT)
        + _shapes(road, begin_m, bank)
        + "</lateralProfile>",
        "<lanes>" + _records("laneOffset", "s", station, centre),
    ]
    kept = []
    for section in road.sections:
        at = road.station_m[section.first : section.last + 1] - begin_m
        across = _on_plane(section.offset_m, _above(section), np.interp(at, *bank)[:, None])[0]
        is_lane = section.is_lane if has_lanes else (False,) * len(section.is_lane)
        kept.append(replace(section, offset_m=across, is_lane=is_lane))
    for i, section in enumerate(kept):
        neighbours = (kept[i - 1] if i else None, kept[i + 1] if i + 1 < len(kept) else None)
        texts.append(_lane_section(section, neighbours, road.station_m, begin_m, drawn))
    texts.append("</lanes>")
    if objects:
        texts.append(
            "<objects>" + "".join(_object(o, drawn, bank, station, level) for o in objects) + "</objects>"
        )
    return "\n".join([*texts, "</road>\n"])


def _levels(section: LaneSection) -> FloatArray:
    """Return the height [m] of the reference line at each station: that between the bounds."""
    return np.array([np.interp(0.0, t, z) for t, z in zip(section.offset_m, section.up_m, strict=True)])


def _above(section: LaneSection) -> FloatArray:
    """Return the heights (n, b) in metres of the bounds above the reference line."""
    return np.asarray(section.up_m - _levels(section)[:, None])


def _bank(road: LaneRoad, begin_m: float, length_m: float) -> tuple[FloatArray, FloatArray]:
    """Return places along a road (k,) in metres and its superelevation there in radians.

    It is that of the planes of least squares through the bounds.
    """
    found = []
    for section in road.sections:
        at = road.station_m[section.first : section.last + 1] - begin_m
        t, z = (v - v.mean(axis=1, keepdims=True) for v in (section.offset_m, section.up_m))
        found.append(np.column_stack([at, (t * z).sum(axis=1), (t * t).sum(axis=1)]))
    at, rise, spread = np.concatenate(found).T
    places = np.linspace(0.0, length_m, max(round(length_m / _BANK_M), 1) + 1)
    # Wide cross-sections say more than narrow ones
    sums = np.concatenate([np.zeros((1, 2)), np.cumsum(np.column_stack([rise, spread]), axis=0)])
    near = (
        sums[np.searchsorted(at, places + _BANK_M, side="right")]
        - sums[np.searchsorted(at, places - _BANK_M)]
    )
    return places, np.arctan2(near[:, 0], near[:, 1])


def _on_plane(t: FloatArray, z: FloatArray, bank: FloatArray | np.float64) -> tuple[FloatArray, FloatArray]:
    """Return places across a road in metres along its banked plane, and above it."""
    return t * np.cos(bank) + z * np.sin(bank), z * np.cos(bank) - t * np.sin(bank)


def _plan(road: LaneRoad, begin_m: float, end_m: float, offset: FloatArray) -> str:
    """Return the pieces of the reference line between two of its parameters."""
    inside = road.curve.starts_m[
        (road.curve.starts_m > begin_m + 0.01) & (road.curve.starts_m < end_m - 0.01)
    ]
    cuts = np.concatenate([[begin_m], inside, [end_m]])
    derivatives = [road.curve.polynomial, *(road.curve.polynomial.derivative(k) for k in (1, 2, 3))]
    found = []
    for a, b in pairwise(cuts.tolist()):
        # Derivatives at the start, a hair inside the piece: the third jumps between pieces
        place, way, bend, change = (
            d(min(a + 1e-9, b)) if k == 3 else d(a) for k, d in enumerate(derivatives)
        )
        heading = float(np.arctan2(way[1], way[0]))
        turn = np.array([[np.cos(heading), np.sin(heading)], [-np.sin(heading), np.cos(heading)]])
        u, v = zip(turn @ way, turn @ bend / 2, turn @ change / 6, strict=True)
        x, y = (place - offset).tolist()
        found.append(
            f'<geometry s="{float(a - begin_m)!r}" x="{float(x)!r}" y="{float(y)!r}" hdg="{float(heading)!r}" length="{float(b - a)!r}"><paramPoly3 aU="0.0" '
            f'bU="{float(u[0])!r}" cU="{float(u[1])!r}" dU="{float(u[2])!r}" aV="0.0" bV="0.0" cV="{float(v[1])!r}" '
            f'dV="{float(v[2])!r}" pRange="arcLength"/></geometry>'
        )
    return "<planView>" + "".join(found) + "</planView>"


def _records(tag: str, key: str, at: FloatArray, values: FloatArray, within: float = _LINEAR_M) -> str:
    """Return values that are linear between stations, in as few records as keep `within` them."""
    found = []
    i = 0
    while i < len(at):
        j = min(i + 1, len(at) - 1)
        while j + 1 < len(at) and _is_linear(at[i : j + 2], values[i : j + 2], within):
            j += 1
        slope = (values[j] - values[i]) / (at[j] - at[i]) if j > i else 0.0
        found.append(
            f'<{tag} {key}="{float(at[i])!r}" a="{float(values[i])!r}" b="{float(slope)!r}" c="0.0" d="0.0"/>'
        )
        if j >= len(at) - 1:
            break
        i = j
    return "".join(found)


def _is_linear(at: FloatArray, values: FloatArray, within: float) -> bool:
    between = values[0] + (values[-1] - values[0]) * (at - at[0]) / (at[-1] - at[0])
    return bool(np.abs(values - between).max() <= within)


def _shapes(road: LaneRoad, begin_m: float, bank: tuple[FloatArray, FloatArray]) -> str:
    """Return the cross-section at each station, above the banked plane, and just before each section ends."""
    found = []
    for section, after in zip(road.sections, (*road.sections[1:], None), strict=True):
        above = _above(section)
        rows = [(k, float(road.station_m[section.first + k]) - begin_m) for k in range(len(above))]
        if after is not None:
            if after.first == section.last:
                rows.pop()
            rows.append((len(above) - 1, float(road.station_m[after.first]) - begin_m - SECTION_END_M))
        for k, s in rows:
            t, z = _on_plane(section.offset_m[k], above[k], np.interp(s, *bank))
            for j in range(len(t) - 1):
                slope = float((z[j + 1] - z[j]) / (t[j + 1] - t[j]))
                found.append(
                    f'<shape s="{s!r}" t="{float(t[j])!r}" a="{float(z[j])!r}" b="{slope!r}" c="0.0" d="0.0"/>'
                )
    return "".join(found)


def _lane_section(
    section: LaneSection, neighbours: tuple[LaneSection | None, LaneSection | None], station_m: FloatArray, begin_m: float,
    drawn: Drawn,
) -> str:  # fmt: skip
    at = station_m[section.first : section.last + 1]
    texts = {True: "", False: ""}
    n = len(section.bounds)
    for j in range(n - 2, -1, -1):
        is_left = j >= section.centre
        number = _lane_number(section, j)
        outer = j + 1 if is_left else j
        width = section.offset_m[:, j + 1] - section.offset_m[:, j]
        links = "".join(
            f'<{name} id="{_lane_number(other, found)}"/>'
            for name, other in zip(("predecessor", "successor"), neighbours, strict=True)
            if other is not None and (found := _same_lane(section, j, other)) is not None
        )
        texts[is_left] += (
            f'<lane id="{number}" type="{"driving" if section.is_lane[j] else "none"}" level="false"><link>{links}</link>'
            f"{_records('width', 'sOffset', at - at[0], width)}{road_mark(drawn, section.bounds[outer], is_left=is_left)}</lane>"
        )
    left, right = (
        f"<{name}>{texts[side]}</{name}>" if texts[side] else ""
        for name, side in (("left", True), ("right", False))
    )
    centre = f'<center><lane id="0" type="none" level="false">{road_mark(drawn, section.bounds[section.centre])}</lane></center>'
    return f'<laneSection s="{float(float(at[0]) - begin_m)!r}">{left}{centre}{right}</laneSection>'


def _lane_number(section: LaneSection, j: int) -> int:
    """Return the number of the lane between bounds j and j + 1: positive to the left of the centre."""
    return j - section.centre + 1 if j >= section.centre else j - section.centre


def _same_lane(section: LaneSection, j: int, other: LaneSection) -> int | None:
    """Return which space of another section is between the same two lines, None without one."""
    pair = section.bounds[j : j + 2]
    found = [k for k in range(len(other.bounds) - 1) if other.bounds[k : k + 2] == pair]
    return found[0] if found and other.is_lane[found[0]] == section.is_lane[j] else None


def _objects(lines: LineSet, roads: Sequence[LaneRoad]) -> dict[int, list[_Object]]:
    """Return the objects of each road: lines whose vertices are beside it, at the road that has most of them."""
    found: dict[int, list[_Object]] = {}
    for i in np.flatnonzero(np.isin(lines.kind, list(_OBJECTS))).tolist():
        best: tuple[int, _Object] | None = None
        for number, road in enumerate(roads):
            first, last = road.sections[0].first, road.sections[-1].last
            low, high = float(road.station_m[first]), float(road.station_m[last])
            box = road.curve.places(road.station_m[first : last + 1])
            xyz = lines[i].xyz
            if (xyz[:, :2].min(axis=0) > box.max(axis=0) + _REACH_M).any() or (
                xyz[:, :2].max(axis=0) < box.min(axis=0) - _REACH_M
            ).any():
                continue
            s, t = road.curve.nearest(xyz[:, :2])
            beside = np.flatnonzero((s >= low) & (s <= high) & (np.abs(t) <= _REACH_M))
            # One stretch without a break
            if len(beside) < 2 or (np.diff(beside) > 1).any():
                continue
            if best is None or len(beside) > len(best[1].s_m):
                best = number, _Object(i, xyz[beside], s[beside] - low, t[beside])
        if best is not None:
            found.setdefault(best[0], []).append(best[1])
    return found


def _object(
    one: _Object, drawn: Drawn, bank: tuple[FloatArray, FloatArray], station: FloatArray, level: FloatArray
) -> str:  # fmt: skip
    lines = drawn.lines
    up = one.xyz[:, 2] - np.interp(one.s_m, station, level)
    across = one.t_m / np.cos(np.interp(one.s_m, *bank))
    vertices = "".join(
        f'<vertexRoad id="{k + 1}" s="{float(max(s, 0.0))!r}" t="{float(t)!r}" dz="{float(z)!r}"/>'
        for k, (s, t, z) in enumerate(zip(one.s_m.tolist(), across.tolist(), up.tolist(), strict=True))
    )
    return (
        f"<object id={xml_quoted(lines.id[one.line])} name={xml_quoted(lines.kind[one.line])} {_OBJECTS[str(lines.kind[one.line])]} "
        f's="{float(max(float(one.s_m[0]), 0.0))!r}" t="{float(across[0])!r}" zOffset="{float(up[0])!r}">'
        f'{user_data(drawn.fields[one.line])}<skeleton><polyline id="1">{vertices}</polyline></skeleton></object>'
    )


def _expected(lines: LineSet) -> dict[str, list[FloatArray]]:
    """Return the places that the file has of each line, by its id."""
    roads = lane_roads(lines)
    found: dict[str, list[FloatArray]] = {}
    for road in roads:
        ahead = road.curve.ahead(road.station_m)
        left = np.column_stack([-ahead[:, 1], ahead[:, 0]])
        xy = road.curve.places(road.station_m)
        for section in road.sections:
            rows = slice(section.first, section.last + 1)
            for b, line in enumerate(section.bounds):
                place = xy[rows] + section.offset_m[:, b : b + 1] * left[rows]
                found.setdefault(str(lines.id[line]), []).append(np.column_stack([place, section.up_m[:, b]]))
    for listed in _objects(lines, roads).values():
        for one in listed:
            found.setdefault(str(lines.id[one.line]), []).append(one.xyz)
    return found


def opendrive_losses(lines: LineSet) -> tuple[str, ...]:
    """Return what an OpenDRIVE file cannot hold of these lines."""
    doubles = merged_doubles(with_ids(in_metres(lines), ()))
    lines = doubles.lines
    there = _expected(lines)
    out = [str(lines.kind[i]) for i in range(len(lines)) if str(lines.id[i]) not in there]
    found = [f"{out.count(kind):,} lines of {kind or 'no kind'}" for kind in dict.fromkeys(out)]
    if doubles.stripes:
        found.append(
            f"the places of both stripes of {len(doubles.stripes):,} double lines, each of which is one road mark in their middle"
        )
    whole_m = float(lines.length_m[np.isin(lines.id, list(there)) & (lines.kind != POLE)].sum())
    there_m = sum(float(distance_along(piece)[-1]) for pieces in there.values() for piece in pieces)
    if whole_m - there_m >= 1.0:
        found.append(f"{whole_m - there_m:,.0f} m of other lines, which are beside no lane")
    return tuple(found)


def verify_opendrive(
    part: Path,
    lines: LineSet,
    path: Path,
    *,
    lanes: bool = False,  # noqa: ARG001
) -> None:
    """Read the file back and compare every bound at every station, to the millimetre.

    Raises
    ------
    MachineError
        Not the lines that were written.
    """
    lines = merged_doubles(with_ids(in_metres(lines), ())).lines
    back = read_opendrive(part, "kind", None, None, [])
    for name, pieces in _expected(lines).items():
        own = back.take(back.id == name)
        away = np.inf
        if len(own):
            for piece in pieces:
                away = _farthest(piece, own.xyz)
                if away > _SAME_M:
                    break
        if away > _SAME_M:
            raise MachineError(
                f"written file does not read back the same (line {name} by {away:.4f} m)", where=path,
                advice="check for free space",
            )  # fmt: skip


def _farthest(places: FloatArray, vertices: FloatArray) -> float:
    """Return the largest distance of places from the nearest vertex."""
    from scipy.spatial import cKDTree

    return float(cKDTree(vertices).query(places)[0].max())
