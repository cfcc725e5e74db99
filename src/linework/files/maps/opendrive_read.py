"""Read lines from OpenDRIVE: borders of lanes with a road mark, and long objects.

Separate from `opendrive`, which writes: reading takes all geometries that the standard has, writing one.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree.ElementTree import Element

import numpy as np
import shapely

from linework.arrays import FloatArray
from linework.crs import LOCAL, metric_twin, parse_crs, stated_crs
from linework.errors import InputError
from linework.files.maps.opendrive_plan import RoadPlan, road_plan
from linework.files.maps.xml_text import children, read_xml, text_table
from linework.files.vectors.gdal import foreign_lines
from linework.model.lines import LineSet

#: Distance of the places at which borders are evaluated. [m]
_STEP_M = 1.0
#: So far before the next section the last places of a section are taken: the cross-section may change there. [m]
SECTION_END_M = 1e-4
#: Roads and coordinates beyond are damaged: the circumference of the Earth is 4e7 m. [m]
_MAX_M = 1e8
#: A road has its places in memory, one a metre. [m]
_MAX_ROAD_M = 1e6
#: Places nearer than a millimetre are one. [m]
_SAME_PLACE_M = 1e-3
_OWN = "linework:"
_KINDS = {"curb": "road_boundary", "edge": "road_boundary"}
_PATTERNS = {"solid": "solid", "broken": "dashed"}
#: Barriers by their subtype, in our words.
_BARRIERS = {"guardRail": "guardrail", "jerseyBarrier": "barrier"}


class _Cubic(NamedTuple):
    """Cubic pieces along the road: their starts, and a, b, c, d of each."""

    starts: FloatArray
    factors: FloatArray

    def at(self, s: FloatArray) -> FloatArray:
        """Return the value at distances (n,); 0 where there is no piece."""
        if not len(self.starts):
            return np.zeros(len(s))
        piece = np.searchsorted(self.starts, s + 1e-9, side="right") - 1
        d = s - self.starts[piece.clip(min=0)]
        a = self.factors[piece.clip(min=0)]
        values = a[:, 0] + d * (a[:, 1] + d * (a[:, 2] + d * a[:, 3]))
        return np.where(piece < 0, 0.0, values)


class _Road(NamedTuple):
    """What gives a road's places: plan, heights, cross-sections."""

    plan: RoadPlan
    elevation: _Cubic
    superelevation: _Cubic
    shape: dict[float, list[tuple[float, FloatArray]]]

    def places(self, s: FloatArray, t: FloatArray, dz: FloatArray) -> FloatArray:
        """Return (n, 3) places along, across and above the road."""
        xy, heading = self.plan.at(s)
        bank = self.superelevation.at(s)
        across = t * np.cos(bank) - dz * np.sin(bank)
        up = self.elevation.at(s) + t * np.sin(bank) + dz * np.cos(bank)
        return np.column_stack([xy[:, 0] - across * np.sin(heading), xy[:, 1] + across * np.cos(heading), up])

    def rise(self, s: FloatArray, t: FloatArray) -> FloatArray:
        """Return the height of the cross-section above the reference line, linear between where it is given."""
        at = np.array(sorted(self.shape))
        if not len(at):
            return np.zeros(len(s))
        after = np.searchsorted(at, s - 1e-9).clip(max=len(at) - 1)
        before = (after - 1).clip(min=0)
        share = np.where(
            after > before, (s - at[before]) / np.maximum(at[after] - at[before], 1e-12), 1.0
        ).clip(0.0, 1.0)
        low = np.array([_polynomial(self.shape[at[b]], x) for b, x in zip(before, t, strict=True)])
        high = np.array([_polynomial(self.shape[at[a]], x) for a, x in zip(after, t, strict=True)])
        return np.asarray(low * (1 - share) + high * share)


def _polynomial(pieces: Sequence[tuple[float, FloatArray]], t: float) -> float:
    """Return the value of pieces across the road at an offset; the outer ones continue."""
    start, a = pieces[0]
    for begin, factors in pieces:
        if begin <= t + 1e-9:
            start, a = begin, factors
    d = t - start
    return float(a[0] + d * (a[1] + d * (a[2] + d * a[3])))


def read_opendrive(
    path: Path, kind_field: str, kinds: Mapping[str, str] | None, crs: str | None, left_out: list[str]
) -> LineSet:
    """Read the borders of lanes that have a road mark, and the long objects: skeletons, rails that are repeated.

    The kind is ours where the file has it; else that of the road mark, and of objects their type. Roads that cannot be
    evaluated are added to `left_out`. Lines are in metres, in the twin of a CRS in feet.

    Raises
    ------
    InputError
        Not OpenDRIVE.
    CrsError
        An unknown CRS.
    """
    root = read_xml(path, "OpenDRIVE")
    shift, own_crs = np.zeros(3), crs or LOCAL
    for header in children(root, "header"):
        own_crs = _crs_of(header, crs, path)
        for offset in children(header, "offset"):
            try:
                shift = np.array([_number(offset, name) for name in ("x", "y", "z")])
            except ValueError as error:
                raise InputError(f"an offset that is not numbers ({str(error)[:60]})", where=path,
                                 advice="correct the file") from error  # fmt: skip
    shapes: list[Any] = []
    rows: list[dict[str, str]] = []
    for road in children(root, "road"):
        name = f"road {(road.get('id') or '')[:20]}"
        try:
            with np.errstate(over="ignore", invalid="ignore"):
                found = _lines_of_road(road)
            for row, xyz in found:
                places = xyz + shift
                # Also where they are not numbers
                if not (np.abs(places) <= _MAX_M).all():
                    left_out.append(f"{name}: places that are no numbers, or beyond {_MAX_M:.0e} m")
                elif len(places) < 2 or not np.ptp(places, axis=0).any():
                    left_out.append(f"{name}: a line without length")
                else:
                    shapes.append(shapely.linestrings(places))
                    rows.append({"road": name, **row})
        except (ValueError, KeyError, IndexError) as error:
            left_out.append(f"{name}: {str(error)[:80]}")
    # The standard has metres, whatever the unit of the CRS
    own_crs = metric_twin(own_crs)
    array = np.array([*shapes, None], dtype=object)[:-1]
    kind = [row.get(kind_field, row["kind"]) for row in rows]
    names = [row["road"] for row in rows]
    return foreign_lines(array, kind, text_table(rows), kinds, own_crs, path, left_out, names)


def _crs_of(header: Element, given: str | None, path: Path) -> str:
    own = _user_data(header).get("crs")
    if own is not None:
        return parse_crs(own, where=path)
    for reference in children(header, "geoReference"):
        text = (reference.text or "").strip()
        if text and "[" in text:
            return stated_crs(text, given, where=path)
        if text.startswith("+proj"):
            import pyproj

            try:
                return stated_crs(pyproj.CRS.from_proj4(text), given, where=path)
            except pyproj.exceptions.CRSError as error:
                raise InputError(f"geoReference is not known to PROJ: {text[:60]}", where=path,
                                 advice="correct the file") from error  # fmt: skip
    return given or LOCAL


def _number(element: Element, name: str, default: float = 0.0) -> float:
    text = element.get(name)
    value = default if text is None else float(text)
    if not np.isfinite(value):
        raise ValueError(f"{name} is not finite")
    return value


def _cubic(elements: Sequence[Element], key: str, shift: float = 0.0) -> _Cubic:
    rows = sorted((_number(e, key) + shift, [_number(e, name) for name in "abcd"]) for e in elements)
    return _Cubic(
        np.array([row[0] for row in rows], dtype=np.float64),
        np.array([row[1] for row in rows], dtype=np.float64).reshape(-1, 4),
    )


def _lines_of_road(element: Element) -> list[tuple[dict[str, str], FloatArray]]:
    """Return the lines of a road with their fields; borders of the same line in neighbouring sections are joined."""
    lateral = [e for outer in children(element, "lateralProfile") for e in outer]
    shape: dict[float, list[tuple[float, FloatArray]]] = {}
    for e in lateral:
        if e.tag.endswith("shape"):
            pieces = shape.setdefault(_number(e, "s"), [])
            pieces.append((_number(e, "t"), np.array([_number(e, name) for name in "abcd"])))
            pieces.sort(key=lambda piece: piece[0])
    road = _Road(
        road_plan([e for plan in children(element, "planView") for e in children(plan, "geometry")]),
        _cubic([e for outer in children(element, "elevationProfile") for e in children(outer, "elevation")], "s"),
        _cubic([e for e in lateral if e.tag.endswith("superelevation")], "s"), shape,
    )  # fmt: skip
    length_m = _number(element, "length")
    if not 0.0 < length_m <= _MAX_ROAD_M:
        raise ValueError(f"a length of {length_m:g} m")
    if not children(element, "lanes"):
        raise ValueError("no lanes")
    lanes = children(element, "lanes")[0]
    offset = _cubic(children(lanes, "laneOffset"), "s")
    sections = children(lanes, "laneSection")
    starts = [_number(s, "s") for s in sections] + [length_m]
    if np.min(np.diff(starts), initial=0.0) < -_SAME_PLACE_M or starts[0] < -_SAME_PLACE_M:
        raise ValueError("sections of lanes that do not follow each other within its length")
    found: list[tuple[dict[str, str], FloatArray]] = []
    #: The last line of each border so far, by its name or number.
    open_lines: dict[str, int] = {}
    for section, begin, end in zip(sections, starts[:-1], starts[1:], strict=True):
        still: dict[str, int] = {}
        last = end if section is sections[-1] else end - SECTION_END_M
        for row, number, xyz in _borders(section, road, offset, begin, last):
            name = row.get("id", "") or f"lane {number}"
            before = still.get(name, open_lines.get(name))
            if before is not None and (row.get("id") or _goes_on(found[before], row, xyz)):
                found[before] = (found[before][0], np.concatenate([found[before][1], xyz]))
                still[name] = before
            else:
                still[name] = len(found)
                found.append((row, xyz))
        open_lines = still
    for outer in children(element, "objects"):
        for one in children(outer, "object"):
            found += _skeletons(one, road) or _repeats(one, road, length_m)
    return found


def _goes_on(line: tuple[dict[str, str], FloatArray], row: Mapping[str, str], xyz: FloatArray) -> bool:
    """Return whether a piece of a border continues a line: it looks the same and begins where that ends."""
    return line[0] == row and float(np.abs(line[1][-1] - xyz[0]).max()) < _SAME_PLACE_M


class _Mark(NamedTuple):
    """What is painted on a border, from one distance along the road to another [m]."""

    row: dict[str, str]
    begin: float
    end: float


def _borders(
    section: Element, road: _Road, offset: _Cubic, begin: float, end: float
) -> list[tuple[dict[str, str], int, FloatArray]]:
    """Return the fields, the lane and the places of each stretch of a border with one road mark."""
    lanes = {int(lane.get("id", "0")): lane for side in section for lane in children(side, "lane")}
    marks = {number: _marks(lane, begin, end, is_left=number > 0) for number, lane in lanes.items()}
    starts = {begin, end, *offset.starts[(offset.starts > begin) & (offset.starts < end)].tolist()}
    starts |= {float(s) for s in road.shape if begin < s < end}
    starts |= {mark.begin for listed in marks.values() for mark in listed}
    at = np.array(sorted(starts | set(np.arange(begin, end, _STEP_M).tolist())))
    at = at[np.concatenate([[True], np.diff(at) > _SAME_PLACE_M])]
    border = {0: offset.at(at)}
    for sign in (1, -1):
        for number in range(sign, sign * (len(lanes) + 1), sign):
            if number not in lanes:
                break
            border[number] = _outer_border(lanes[number], number, border[number - sign], at, begin)
    found = []
    for number in sorted(border):
        t = border[number]
        # The lane may lie above the road, as footways do
        above = (
            _cubic_of(children(lanes[number], "height"), "outer", begin).at(at) if number in lanes else 0 * t
        )
        for mark in marks.get(number, ()):
            here = (at >= mark.begin - _SAME_PLACE_M) & (at <= mark.end + _SAME_PLACE_M)
            if here.sum() > 1:
                s = at[here]
                rise = road.rise(s, t[here]) + above[here]
                found.append((mark.row, number, road.places(s, t[here], rise)))
    return found


def _outer_border(
    lane: Element, number: int, inner: FloatArray, at: FloatArray, section_m: float
) -> FloatArray:
    """Return the offset of the outer border of a lane from the reference line: by its width, else as it is given."""
    widths, borders = children(lane, "width"), children(lane, "border")
    if widths:
        return np.asarray(inner + np.sign(number) * _cubic(widths, "sOffset", section_m).at(at))
    if borders:
        return _cubic(borders, "sOffset", section_m).at(at)
    raise ValueError(f"lane {number} has no width")


def _cubic_of(elements: Sequence[Element], name: str, shift: float) -> _Cubic:
    """Return an attribute that holds until the next element, as pieces along the road."""
    rows = sorted((_number(e, "sOffset") + shift, _number(e, name)) for e in elements)
    return _Cubic(
        np.array([s for s, _ in rows], dtype=np.float64),
        np.array([[value, 0.0, 0.0, 0.0] for _, value in rows]).reshape(-1, 4),
    )


def _marks(lane: Element, begin: float, end: float, *, is_left: bool) -> list[_Mark]:
    """Return the road marks of a lane's outer border, each as far as the next; those that look the same as one."""
    listed = sorted(
        ((_number(mark, "sOffset"), mark) for mark in children(lane, "roadMark")), key=lambda pair: pair[0]
    )
    starts = [min(begin + max(s, 0.0), end) for s, _ in listed]
    found: list[_Mark] = []
    for (_, mark), (first, last) in zip(listed, pairwise([*starts, end]), strict=True):
        row = _row_of_mark(mark, is_left=is_left)
        if row is None or last - first <= _SAME_PLACE_M:
            continue
        if found and found[-1].row == row and found[-1].end == first:
            found[-1] = found[-1]._replace(end=last)
        else:
            found.append(_Mark(row, first, last))
    return found


def _row_of_mark(mark: Element, *, is_left: bool) -> dict[str, str] | None:
    """Return the fields of the outer border of a lane, None without a line.

    Double lines are named from the inside of the road to its outside, in its middle from left to right.
    """
    kind = mark.get("type", "none")
    own = _user_data(mark)
    if kind == "none" and not own:
        return None
    row = {"kind": _KINDS.get(kind, "lane_marking")}
    if kind in _KINDS:
        row["form"] = "kerb" if kind == "curb" else "edge"
    else:
        words = [_PATTERNS.get(word, "") for word in kind.split()]
        row["pattern"] = "_".join(words[::-1] if is_left else words) if all(words) else ""
        row["double"] = "true" if len(words) > 1 else ""
    if mark.get("width"):
        row["width_m"] = str(mark.get("width"))
    return row | own


def _user_data(element: Element) -> dict[str, str]:
    pairs = {e.get("code", ""): e.get("value", "") for e in children(element, "userData")}
    return {code.removeprefix(_OWN): value for code, value in pairs.items() if code.startswith(_OWN)}


def _skeletons(one: Element, road: _Road) -> list[tuple[dict[str, str], FloatArray]]:
    row = _row_of_object(one)
    found = []
    for skeleton in children(one, "skeleton"):
        for line in children(skeleton, "polyline"):
            places = np.array(
                [[_number(v, name) for name in ("s", "t", "dz")] for v in children(line, "vertexRoad")]
            ).reshape(-1, 3)
            if len(places) > 1:
                s, t, dz = places.T
                found.append((row, _upright_places(road, s, t, dz)))
    return found


def _row_of_object(one: Element) -> dict[str, str]:
    kind = one.get("subtype") or one.get("type") or "object"
    return {"kind": _BARRIERS.get(kind, kind), "id": one.get("id", "")} | _user_data(one)


def _upright_places(road: _Road, s: FloatArray, t: FloatArray, up: FloatArray) -> FloatArray:
    """Return (n, 3) places whose heights are parallel to z, above the reference line."""
    xyz = road.places(s, t, np.zeros(len(s)))
    xyz[:, 2] = road.elevation.at(s) + up
    return xyz


def _repeats(one: Element, road: _Road, length_m: float) -> list[tuple[dict[str, str], FloatArray]]:
    """Return the upper edges of an object that is repeated without a distance: a rail, a wall, a fence."""
    found = []
    for repeat in children(one, "repeat"):
        begin, length = _number(repeat, "s"), _number(repeat, "length")
        end = min(begin + length, length_m)
        if _number(repeat, "distance") != 0.0 or not 0.0 <= begin < end:
            continue
        s = np.append(np.arange(begin, end - _SAME_PLACE_M, _STEP_M), end)
        share = (s - begin) / length

        def along(name: str, other: str, repeat: Element = repeat, share: FloatArray = share) -> FloatArray:
            first, last = (_number(repeat, f"{name}{side}", _number(one, other)) for side in ("Start", "End"))
            return np.asarray(first + share * (last - first))

        up = along("zOffset", "zOffset") + along("height", "height")
        found.append((_row_of_object(one), _upright_places(road, s, along("t", "t"), up)))
    return found
