"""Read what an E57 file says of its scans: poses, fields and numbers of points, checked before a library opens it.

Separate from `headers`, which reads lines of text: an E57 file is in pages with checksums, and describes itself in XML.

References
----------
ASTM E2807-11, "Standard Specification for 3D Imaging Data Exchange": file header (section 7), pages (7.2), Data3D (8.4).
"""

from __future__ import annotations

import itertools
import math
import os
import re
import struct
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO
from xml.etree import ElementTree

from linework.errors import InputError, check_extra
from linework.files.clouds.table import DAMAGED_ADVICE
from linework.files.input import open_input

#: Bytes of a page, of which the last four are a checksum; no other size has been written.
_PAGE, _SUM = 1024, 4
_HEADER_BYTES = 48
#: Largest description: some kB per scan, so that thousands of scans fit. [bytes]
_MOST_XML_BYTES = 1 << 24
#: Most tags, and most attributes: some 130 of each per scan, in 4 kB. In memory each takes hundreds of bytes.
_MOST_MARKS = 1 << 19
#: Scans have numbers of 16 bits, as sources of laser files have.
_MOST_SCANS = 65_535
_MOST_POINTS = 1 << 40
#: How far the length of a rotation's quaternion may be from 1: numbers of 32 bits are within 1e-6.
_UNIT_WITHIN = 1e-3
CARTESIAN = ("cartesianX", "cartesianY", "cartesianZ")
SPHERICAL = ("sphericalRange", "sphericalAzimuth", "sphericalElevation")
_INTENSITY, _TIME = "intensity", "timeStamp"
_WKT_RECORD = 2112


@dataclass(frozen=True, slots=True)
class E57Scan:
    """A scan with points.

    Parameters
    ----------
    number
        From 1, among all scans of the file.
    fields
        Names of what each point has.
    place
        Names of its three coordinates, in the scanner's frame.
    single
        Which of these are 32-bit numbers.
    rotation, translation
        3 x 3, row by row, and 3 numbers [unit of the file]: from the scanner's frame to that of the file.
    start_s
        GPS time from which the time stamps count; None where it is not stated. [s]
    """

    number: int
    n_points: int
    fields: tuple[str, ...]
    place: tuple[str, str, str]
    single: tuple[bool, bool, bool]
    rotation: tuple[float, ...]
    translation: tuple[float, float, float]
    start_s: float | None


@dataclass(frozen=True, slots=True)
class E57Scans:
    """The scans of a file.

    Parameters
    ----------
    has_time
        Whether all scans have time stamps, which count from a start that each of several scans states.
    intensity_range
        Least and largest intensity of all scans, as the file states them; None where a scan has no limits.
    has_intensity
        Whether a scan has intensities.
    projection
        The CRS as a record of a laser file; empty without one.
    """

    scans: tuple[E57Scan, ...]
    has_time: bool
    has_intensity: bool
    intensity_range: tuple[float, float] | None
    projection: tuple[tuple[int, bytes], ...]
    warnings: tuple[str, ...]

    @property
    def n_points(self) -> int:
        """Number of points of all scans."""
        return sum(scan.n_points for scan in self.scans)


def read_e57_scans(path: Path) -> E57Scans:
    """Return the scans that have points.

    Raises
    ------
    InputError
        Not such a file, cut off, damaged, or a description that cannot be true.
    MissingPackageError
        The library that reads the points is not installed.
    """
    with open_input(path) as file:
        n_bytes = os.fstat(file.fileno()).st_size
        root = _description(path, file, n_bytes)
    check_extra("e57", where=path)
    listed = root.find("data3D")
    elements = [] if listed is None else list(listed)
    if len(elements) > _MOST_SCANS:
        raise InputError(f"{len(elements):,} scans, at most {_MOST_SCANS:,}", where=path, advice="split it")
    scans, ranges, warnings = [], [], []
    for number, element in enumerate(elements, start=1):
        prototype = _prototype(path, number, element)
        n_points = _n_points(path, number, element, prototype, n_bytes)
        if n_points == 0:
            continue
        scans.append(_scan(path, number, element, prototype, n_points))
        if _INTENSITY in prototype:
            ranges.append(_intensity_range(element))
    text = (root.findtext("coordinateMetadata") or "").strip()
    if text and "[" not in text:
        warnings.append(f"coordinateMetadata '{text[:60]}' is not WKT: not used")
        text = ""
    known = [one for one in ranges if one is not None]
    whole = (
        (min(a for a, _ in known), max(b for _, b in known)) if ranges and len(known) == len(ranges) else None
    )
    has_time = bool(scans) and all(_TIME in scan.fields for scan in scans)
    if not has_time and any(_TIME in scan.fields for scan in scans):
        warnings.append("some scans have no time stamps: those of the others are not used")
    if has_time and len(scans) > 1 and any(scan.start_s is None for scan in scans):
        warnings.append("some scans do not state their start (acquisitionStart): time stamps are not used")
        has_time = False
    projection = ((_WKT_RECORD, text.encode()),) if text else ()
    return E57Scans(tuple(scans), has_time, bool(ranges), whole, projection, tuple(warnings))


def _description(path: Path, file: BinaryIO, n_bytes: int) -> ElementTree.Element:
    """Return the XML of a file."""
    head = file.read(_HEADER_BYTES)
    if head[:8] != b"ASTM-E57":
        raise InputError("not an E57 file (it does not begin with ASTM-E57)", where=path,
                         advice="check what this file is")  # fmt: skip
    if len(head) < _HEADER_BYTES:
        raise InputError(f"cut off inside the header: {len(head)} of {_HEADER_BYTES} bytes", where=path,
                         advice=DAMAGED_ADVICE)  # fmt: skip
    major, _, length, start, xml_bytes, page = struct.unpack("<IIQQQQ", head[8:])
    if major != 1:
        raise InputError(f"E57 version {major:,}, expected 1", where=path, advice="write it as E57 1.0")
    if page != _PAGE:
        raise InputError(f"pages of {page:,} bytes, expected {_PAGE:,}", where=path, advice=DAMAGED_ADVICE)
    if length != n_bytes:
        raise InputError(
            f"header promises {length:,} bytes but the file has {n_bytes:,} (cut off or damaged)", where=path,
            advice=DAMAGED_ADVICE,
        )  # fmt: skip
    if xml_bytes > _MOST_XML_BYTES or not _HEADER_BYTES <= start < n_bytes or start % _PAGE >= _PAGE - _SUM:
        raise InputError(
            f"its description should be {xml_bytes:,} bytes from byte {start:,}, in a file of {n_bytes:,}", where=path,
            advice=DAMAGED_ADVICE,
        )  # fmt: skip
    text = _bytes_of_pages(file, start, xml_bytes)
    if len(text) < xml_bytes:
        raise InputError("cut off inside its description", where=path, advice=DAMAGED_ADVICE)
    return _parsed(path, text)


def _parsed(path: Path, text: bytes) -> ElementTree.Element:
    """Return the root of a description. Names of other namespaces than the root's keep theirs, as {namespace}name."""
    if max(text.count(b"<"), text.count(b"=")) > _MOST_MARKS:
        raise InputError(f"its description has more than {_MOST_MARKS:,} tags or attributes", where=path,
                         advice="split it")  # fmt: skip
    declared = re.match(rb"[^>]*encoding\s*=\s*[\"']([^\"']*)", text)
    # The standard has neither; entities grow without bound, or name files elsewhere. Other encodings would hide them
    if b"<!" in text.replace(b"<![CDATA[", b"").replace(b"<!--", b"") or (
        declared is not None and declared[1].lower() != b"utf-8"
    ):
        raise InputError("its description declares a document type, entities or another encoding than UTF-8",
                         where=path, advice="write it again by another program")  # fmt: skip
    try:
        root = ElementTree.fromstring(text.decode())
    except (ElementTree.ParseError, ValueError, LookupError, RecursionError) as error:
        raise InputError(f"its description is not XML ({str(error)[:60]})", where=path,
                         advice=DAMAGED_ADVICE) from error  # fmt: skip
    own = root.tag.rpartition("}")[0]
    for element in root.iter():
        space, _, name = str(element.tag).rpartition("}")
        if space == own:
            element.tag = name
    return root


def _bytes_of_pages(file: BinaryIO, start: int, n_bytes: int) -> bytes:
    """Return bytes from a place on, without the checksums of pages."""
    found = bytearray()
    while len(found) < n_bytes:
        file.seek(start)
        n = _PAGE - _SUM - start % _PAGE
        piece = file.read(n)
        found += piece
        if len(piece) < n:
            break
        start += n + _SUM
    return bytes(found[:n_bytes])


def _prototype(path: Path, number: int, element: ElementTree.Element) -> dict[str, ElementTree.Element]:
    """Return the fields of the points by their names; those of extensions, in other namespaces, are left out."""
    points = element.find("points")
    prototype = None if points is None else points.find("prototype")
    if prototype is None:
        raise InputError(f"scan {number} has no points element", where=path, advice=DAMAGED_ADVICE)
    fields: dict[str, ElementTree.Element] = {}
    for field in prototype:
        name = str(field.tag)
        if name in fields:
            raise InputError(
                f"scan {number}: two fields named {name[:40]}", where=path, advice=DAMAGED_ADVICE
            )
        if "}" not in name:
            fields[name] = field
    return fields


def _n_points(
    path: Path, number: int, element: ElementTree.Element, prototype: Mapping[str, ElementTree.Element], n_bytes: int
) -> int:  # fmt: skip
    points = element.find("points")
    text = "" if points is None else points.get("recordCount", "")
    if not (text.isascii() and text.isdecimal() and len(text) <= 13 and int(text) < _MOST_POINTS):
        raise InputError(f"scan {number}: the number of points is '{text[:20]}', expected a whole number", where=path,
                         advice=DAMAGED_ADVICE)  # fmt: skip
    n_points = int(text)
    bits = max(sum(_bits(field) for field in prototype.values()), 1)
    if n_points * bits > 8 * n_bytes:
        raise InputError(
            f"scan {number} promises {n_points:,} points but the file holds at most {8 * n_bytes // bits:,} (cut off or"
            " damaged)", where=path, advice=DAMAGED_ADVICE,
        )  # fmt: skip
    return n_points


def _bits(field: ElementTree.Element) -> int:
    """Return the fewest bits that a value takes."""
    kind = field.get("type", "")
    if kind == "Float":
        return 32 if field.get("precision") == "single" else 64
    try:
        span = int(field.get("maximum", 2**63 - 1)) - int(field.get("minimum", -(2**63)))
    except ValueError:
        span = 0
    return max(span, 0).bit_length() if kind in ("Integer", "ScaledInteger") else 0


def _scan(
    path: Path, number: int, element: ElementTree.Element, prototype: Mapping[str, ElementTree.Element], n_points: int
) -> E57Scan:  # fmt: skip
    place = next((names for names in (CARTESIAN, SPHERICAL) if all(n in prototype for n in names)), None)
    if place is None:
        raise InputError(
            f"scan {number}: points without coordinates (fields: {', '.join(prototype)[:80] or 'none'})", where=path,
            advice="write cartesianX, cartesianY and cartesianZ for each point",
        )  # fmt: skip
    a, b, c = (
        prototype[n].get("type") == "Float" and prototype[n].get("precision") == "single" for n in place
    )
    rotation = _pose(path, number, element, "pose/rotation", "wxyz", (1.0, 0.0, 0.0, 0.0))
    x, y, z = _pose(path, number, element, "pose/translation", "xyz", (0.0, 0.0, 0.0))
    start = element.find("acquisitionStart/dateTimeValue")
    start_s = math.nan if start is None else _value(start)
    return E57Scan(
        number, n_points, tuple(prototype), place, (a, b, c), _matrix(path, number, rotation), (x, y, z),
        start_s if math.isfinite(start_s) else None,
    )  # fmt: skip


def _pose(
    path: Path, number: int, element: ElementTree.Element, place: str, names: str, default: tuple[float, ...]
) -> tuple[float, ...]:  # fmt: skip
    if element.find(place) is None:
        return default
    parts = [element.find(f"{place}/{name}") for name in names]
    values = tuple(math.nan if part is None else _value(part) for part in parts)
    if not all(math.isfinite(value) for value in values):
        raise InputError(
            f"scan {number}: {place} is not {len(names)} numbers", where=path, advice=DAMAGED_ADVICE
        )
    return values


def _matrix(path: Path, number: int, quaternion: tuple[float, ...]) -> tuple[float, ...]:
    """Return the rotation matrix, row by row, of a quaternion w, x, y, z."""
    length = math.hypot(*quaternion)
    if abs(length - 1.0) > _UNIT_WITHIN:
        raise InputError(f"scan {number}: a quaternion of length {length:g} is not a rotation", where=path,
                         advice=DAMAGED_ADVICE)  # fmt: skip
    w, x, y, z = (value / length for value in quaternion)
    return (
        1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y),
        2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x),
        2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y),
    )  # fmt: skip


def _intensity_range(element: ElementTree.Element) -> tuple[float, float] | None:
    """Return the limits of a scan's intensities; what its numbers could hold (minimum, maximum) is wider than those."""
    limits = [element.find(f"intensityLimits/intensity{end}") for end in ("Minimum", "Maximum")]
    stated = [math.nan if limit is None else _value(limit) for limit in limits]
    low, high = stated
    return (low, high) if math.isfinite(low) and math.isfinite(high) and low < high else None


def _value(element: ElementTree.Element) -> float:
    """Return the number of an element; NaN where it is none. An empty element is 0."""
    try:
        number = float((element.text or "").strip() or "0")
        if element.get("type") == "ScaledInteger":
            number = number * float(element.get("scale", "1")) + float(element.get("offset", "0"))
    except ValueError:
        return math.nan
    return number


def e57_columns(scans: E57Scans) -> Mapping[str, str]:
    """Return the further columns of the points, and the field that each is from; "" for the scan's number.

    Only what every scan has is a column.
    """
    fields = [set(scan.fields) for scan in scans.scans]
    have = set(itertools.chain.from_iterable(fields[:1])).intersection(*fields)
    named = {"return_number": "returnIndex", "number_of_returns": "returnCount"}
    return {"point_source_id": ""} | {name: field for name, field in named.items() if field in have}
