"""Lines as a Lanelet2 map: OSM XML with a way per line, in degrees; on request with lanelets between them.

References
----------
Lanelet2, "Linestring tagging" (F. Poggenhans et al., 2018, doi:10.1109/ITSC.2018.8569929). Nodes have their height in the
tag `ele`, always: a reader takes 0 where there is none. A way with the tag `height` is the lower edge of what it stands
for; guardrails and barriers are upper edges here and have no such tag, kerbs are their foot and have it.
"""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree.ElementTree import Element

import numpy as np
import shapely

from linework.arrays import FloatArray, IntArray
from linework.crs import metric_twin, parse_crs
from linework.errors import CrsError, InputError, MachineError, argument
from linework.files.maps.degrees import Heights, from_degrees, in_degrees
from linework.files.maps.lanelet2_tags import kind_of_tags, tags_of_line
from linework.files.maps.lanelets import NEAREST_M, Lanelet, lanelet_map, set_apart
from linework.files.maps.xml_text import children, field_texts, read_xml, text_table, xml_quoted
from linework.files.vectors.gdal import foreign_lines
from linework.lines.doubles import merged_doubles
from linework.lines.units import in_metres
from linework.model.lines import LineSet

#: 1e-11 degrees are about a micrometre.
_DECIMALS = 11
#: Heights beyond are none of a road. [m]
_MAX_HEIGHT_M = 1e5
#: Ids are positive numbers of 62 bits made of kind and place: the same line has the same id in every run.
_ID_BITS = 62


def write_lanelet2(
    lines: LineSet,
    part: Path,
    kinds: Sequence[str] = (),  # noqa: ARG001
    *,
    heights: Heights = "crs",
    location: str = "",
) -> None:
    """Write a Lanelet2 map (called through `publish`): what Lanelet2 has a type for, and lanelets if it has a location.

    Lanelets can be driven in both directions: which one is allowed was not measured.

    Raises
    ------
    CrsError
        The lines are local, or PROJ knows no exact transformation to degrees.
    """
    chosen, tags, lanelets = _expressed(lines, location)
    kept = set_apart(chosen)
    degrees = in_degrees(kept.xyz, kept.crs, heights=heights, where=part) if len(kept) else np.zeros((0, 3))
    texts = [
        (f"{lat:.{_DECIMALS}f}", f"{lon:.{_DECIMALS}f}", f"{up:.4f}") for lat, lon, up in degrees.tolist()
    ]
    ids = _ids(texts)
    ways = _ids(_way_texts(kept, texts), taken=set(ids))
    with part.open("w", encoding="utf-8", newline="\n") as file:
        file.write(
            '<?xml version="1.0" encoding="UTF-8"?>\n<osm version="0.6" upload="false" generator="linework">\n'
        )
        file.write(
            f'<MetaInfo format_version="1" map_version="1" crs={xml_quoted(kept.crs)} heights={xml_quoted(heights)}/>\n'
        )
        # Lines that meet in a place share the node
        for node, (lat, lon, up) in sorted(dict(zip(ids, texts, strict=True)).items()):
            file.write(
                f'<node id="{node}" version="1" lat="{lat}" lon="{lon}"><tag k="ele" v="{up}"/></node>\n'
            )
        for i, way in enumerate(ways):
            refs = "".join(f'<nd ref="{node}"/>' for node in ids[kept.offsets[i] : kept.offsets[i + 1]])
            pairs = "".join(f"<tag k={xml_quoted(k)} v={xml_quoted(v)}/>" for k, v in tags[i].items())
            file.write(f'<way id="{way}" version="1">{refs}{pairs}</way>\n')
        texts_of = [(str(ways[one.left]), str(ways[one.right])) for one in lanelets]
        taken = {*ids, *ways}
        for one, ends, number in zip(lanelets, texts_of, _ids(texts_of, taken), strict=True):
            file.write(_relation(one, ends, number, location))
        file.write("</osm>\n")


def _relation(lanelet: Lanelet, ways: tuple[str, str], number: int, location: str) -> str:
    """Return a lanelet between two ways. What rules it has follows from its location; a speed limit was not measured."""
    tags = {
        "type": "lanelet", "subtype": "road", "location": location, "one_way": "no",
        "linework:width_m": f"{lanelet.width_m:.4f}",
    }  # fmt: skip
    members = "".join(
        f'<member type="way" ref="{way}" role="{role}"/>'
        for way, role in zip(ways, ("left", "right"), strict=True)
    )
    pairs = "".join(f"<tag k={xml_quoted(k)} v={xml_quoted(v)}/>" for k, v in tags.items())
    return f'<relation id="{number}" version="1">{members}{pairs}</relation>\n'


def _expressed(
    lines: LineSet, location: str = ""
) -> tuple[LineSet, list[dict[str, str]], tuple[Lanelet, ...]]:
    """Return the lines that Lanelet2 has a type for, their tags, and lanelets between them if these have a location."""
    lines = merged_doubles(in_metres(lines)).lines
    lanelets: tuple[Lanelet, ...] = ()
    if location:
        lines, lanelets, _ = lanelet_map(lines)
    fields = field_texts(lines)
    listed = [tags_of_line(lines[i], fields[i], number=i) for i in range(len(lines))]
    chosen = [i for i, tags in enumerate(listed) if tags]
    place = {i: k for k, i in enumerate(chosen)}
    lanelets = tuple(one._replace(left=place[one.left], right=place[one.right]) for one in lanelets)
    return lines.take(np.array(chosen, dtype=np.int64)), [listed[i] for i in chosen], lanelets


def lanelet2_losses(lines: LineSet, location: str = "") -> tuple[str, ...]:
    """Return what a Lanelet2 map cannot hold of these lines, and of the lanes between them if these have a location."""
    doubles = merged_doubles(in_metres(lines))
    lines, fields = doubles.lines, field_texts(doubles.lines)
    out = [str(lines.kind[i]) for i in range(len(lines)) if not tags_of_line(lines[i], fields[i], number=i)]
    found = [f"{out.count(kind):,} lines of {kind or 'no kind'}" for kind in dict.fromkeys(out)]
    n_thinned = len(_expressed(lines)[0].xyz) - len(set_apart(_expressed(lines)[0]).xyz)
    if doubles.stripes:
        found.append(
            f"the places of both stripes of {len(doubles.stripes):,} double lines, each of which is one line in their middle"
        )
    if n_thinned:
        found.append(f"{n_thinned:,} vertices nearer than {NEAREST_M * 100:.0f} cm to the one before")
    left_out = lanelet_map(lines).left_out if location else ()
    if left_out:
        east, north = left_out[0]
        found.append(
            f"{len(left_out):,} stretches of lanes whose lines bound another road there (the first at {east:.1f} {north:.1f})"
        )
    return tuple(found)


def _way_texts(lines: LineSet, texts: Sequence[tuple[str, ...]]) -> list[tuple[str, ...]]:
    """Return a text per line that no other has: its id and its ends, and a number where even those are the same."""
    seen: Counter[tuple[str, ...]] = Counter()
    found = []
    for i, name in enumerate(lines.id.tolist()):
        text = (str(name), *texts[lines.offsets[i]], *texts[lines.offsets[i + 1] - 1])
        seen[text] += 1
        found.append((*text, str(seen[text])))
    return found


def _ids(texts: Sequence[tuple[str, ...]], taken: set[int] | None = None) -> list[int]:
    """Return a positive number per text: equal texts have equal numbers, others never."""
    own: dict[tuple[str, ...], int] = {}
    used = taken if taken is not None else set()
    for text in texts:
        if text in own:
            continue
        number, turn = 0, 0
        while number == 0 or number in used:
            key = f"{turn}|{'|'.join(text)}".encode()
            number = int.from_bytes(hashlib.blake2b(key, digest_size=8).digest(), "big") >> (64 - _ID_BITS)
            turn += 1
        own[text] = number
        used.add(number)
    return [own[text] for text in texts]


#: Numbers of lines are shorter.
_LINE_DIGITS = 19
#: What texts of 11 decimals, and heights of 4, may differ from the coordinates. [m]
_ROUNDING_M = 1e-3


def verify_lanelet2(
    part: Path,
    lines: LineSet,
    path: Path,
    *,
    heights: Heights = "crs",  # noqa: ARG001
    location: str = "",
) -> None:
    """Read the file back and compare every coordinate, to the millimetre.

    Raises
    ------
    MachineError
        Not the lines that were written.
    """
    chosen, _, lanelets = _expressed(lines, location)
    expected = set_apart(chosen)
    back = read_lanelet2(part, "kind", None, None, [])
    n_lanelets = len(children(read_xml(part, "osm"), "relation"))
    same = (len(back), len(back.xyz), n_lanelets) == (len(expected), len(expected.xyz), len(lanelets))
    if not same or not np.allclose(back.xyz, expected.xyz, rtol=0.0, atol=_ROUNDING_M):
        raise MachineError(
            "written file does not read back the same", where=path, advice="check for free space"
        )


class _Map(NamedTuple):
    """What is in a file: numbers of the nodes, their places in degrees, and the ways with their tags."""

    places: FloatArray
    ways: list[tuple[str, IntArray, dict[str, str]]]
    crs: str | None
    heights: Heights


def read_lanelet2(
    path: Path, kind_field: str, kinds: Mapping[str, str] | None, crs: str | None, left_out: list[str]
) -> LineSet:
    """Read the ways of a Lanelet2 map; the kind of a line is its type in our words, or the tag `kind_field`.

    Ways whose nodes are missing are added to `left_out`.

    Raises
    ------
    InputError
        Not OSM XML.
    CrsError
        The file does not say the CRS of its lines, and none is given.
    """
    found = _read_map(path, left_out)
    own_crs = found.crs or crs
    if own_crs is None:
        if len(found.places) == 0:
            return LineSet.empty()
        raise CrsError(
            f"positions in degrees, lengths need metres; the middle is in {_utm_zone(found.places)}", where=path,
            advice=f"give {argument('crs', 'EPSG:...')} (projected, metres)",
        )  # fmt: skip
    # Heights of a map are in metres
    own_crs = metric_twin(own_crs)
    xyz = (
        from_degrees(found.places, own_crs, heights=found.heights, where=path)
        if len(found.places)
        else found.places
    )
    if len(xyz) and not np.isfinite(xyz[:, :2]).all():
        raise InputError(
            "nodes far outside the area of the CRS", where=path, advice=f"check {argument('crs')}"
        )
    ways = found.ways if found.crs is None else sorted(found.ways, key=lambda way: _number_of_line(way[2]))
    shapes = np.array([*(shapely.linestrings(xyz[nodes]) for _, nodes, _ in ways), None], dtype=object)[:-1]
    rows = [kind_of_tags(tags) for _, _, tags in ways]
    table: dict[str, Any] = text_table(rows)
    kind = [row["kind"] if kind_field == "kind" else row.get(kind_field, row["kind"]) for row in rows]
    return foreign_lines(shapes, kind, table, kinds, own_crs, path, left_out, [name for name, _, _ in ways])


def _read_map(path: Path, left_out: list[str]) -> _Map:
    root = read_xml(path, "osm")
    stated, heights = None, "crs"
    for info in children(root, "MetaInfo"):
        stated, heights = info.get("crs"), info.get("heights", "crs")
    index: dict[str, int] = {}
    unknown: set[str] = set()
    rows: list[tuple[float, float, float]] = []
    for node in _kept(root, "node"):
        place = _place(node)
        if place is not None:
            index[node.get("id", "")] = len(rows)
            rows.append(place)
        else:
            unknown.add(node.get("id", ""))
    ways = []
    for way in _kept(root, "way"):
        name = f"way {(way.get('id') or '')[:20]}"
        refs = [ref.get("ref", "") for ref in children(way, "nd")]
        missing = [ref for ref in refs if ref not in index]
        if missing:
            is_there = missing[0] in unknown
            problem = "has no place (lat, lon, ele)" if is_there else "is not in the file"
            left_out.append(f"{name}: node {missing[0][:20]} {problem}")
        elif len({rows[index[ref]] for ref in refs}) < 2:
            left_out.append(f"{name}: less than two places")
        else:
            ways.append((name, np.array([index[ref] for ref in refs]), _tags(way)))
    crs = None if stated is None else parse_crs(stated, where=path)
    return _Map(
        np.array(rows, dtype=np.float64).reshape(-1, 3),
        ways,
        crs,
        "ellipsoid" if heights == "ellipsoid" else "crs",
    )


def _number_of_line(tags: Mapping[str, str]) -> int:
    text = tags.get("line", "")
    return int(text) if text.isdecimal() and len(text) < _LINE_DIGITS else 0


def _place(node: Element) -> tuple[float, float, float] | None:
    """Return latitude, longitude, height; None where they are no numbers. A node without a height is at 0."""
    try:
        place = (float(node.get("lat", "")), float(node.get("lon", "")), _height(_tags(node).get("ele", "0")))
    except ValueError:
        return None
    is_there = abs(place[0]) <= 90.0 and abs(place[1]) <= 360.0 and abs(place[2]) <= _MAX_HEIGHT_M
    return place if is_there else None


def _height(text: str) -> float:
    """Return a height in metres, which may have its unit as OpenStreetMap writes it."""
    number = text.strip()
    return float(number[:-1] if number.endswith("m") else number)


def _kept(root: Element, name: str) -> list[Element]:
    """Return the elements that are not deleted: editors keep these in a file until it is uploaded."""
    return [e for e in children(root, name) if e.get("action") != "delete" and e.get("visible") != "false"]


def _tags(element: Element) -> dict[str, str]:
    return {tag.get("k", ""): tag.get("v", "") for tag in children(element, "tag")}


def _utm_zone(places: FloatArray) -> str:
    """Return the code of the UTM zone of the middle of some places."""
    lat, lon = np.median(places[:, 0]), np.median(places[:, 1])
    return f"EPSG:{(32600 if lat >= 0 else 32700) + int((lon + 180) // 6) % 60 + 1}"
