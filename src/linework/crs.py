"""Coordinate reference systems: parse, compare, describe; feet to metres.

A CRS is a WKT2 text, or "local": metres, not georeferenced. Coordinates are always east, north, whatever
order the CRS's own axes have, as LAS and GIS files hold them.
"""

from __future__ import annotations

import functools
import math
import re
from numbers import Integral
from typing import Any

import pyproj
from pyproj.exceptions import CRSError as ProjError

from linework.errors import CrsError, argument

LOCAL = "local"
#: Longest CRS text that is parsed [characters]; a compound WKT2 has 3 to 6 kB.
_MAX_CHARS = 65536
_EPSG = re.compile(r"EPSG:(\d{1,6})(?:\+(?:EPSG:)?(\d{1,6}))?", re.IGNORECASE)
_WKT = re.compile(
    r"\s*(PROJCRS|PROJECTEDCRS|PROJCS|COMPOUNDCRS|COMPD_CS|BOUNDCRS|GEOGCRS|GEOGRAPHICCRS|GEODCRS|GEODETICCRS"
    r"|GEOGCS|GEOCCS|ENGCRS|ENGINEERINGCRS|LOCAL_CS)\s*\[",
    re.IGNORECASE,
)
_FEET_IN_NAME = re.compile(r" \((ft|ftUS|US survey foot|foot)\)")
#: How a CRS is given as a text.
_FORMS = "EPSG:n, EPSG:n+m, WKT or local"
_ADVICE = f"give {argument('crs', 'EPSG:...')} (projected, metres) or {argument('crs', 'local')}"
#: Where a file states the CRS, the parameter does not replace it.
_STATED_ADVICE = "correct the CRS that is stated there"


def crs_text(crs: object, *, where: object = argument("crs")) -> str:
    """Return a CRS as the text that `parse_crs` reads.

    Parameters
    ----------
    crs
        "EPSG:n", "EPSG:n+m", WKT or "local"; an EPSG code; or an object with `to_wkt`, such as a
        `pyproj.CRS`.

    Raises
    ------
    CrsError
        Something else.

    Examples
    --------
    >>> crs_text(25832)
    'EPSG:25832'
    >>> crs_text(2.5)
    Traceback (most recent call last):
    linework.errors.CrsError: crs: 2.5 is not a CRS: expected EPSG:n, EPSG:n+m, WKT or local, ...
    """
    if isinstance(crs, str) and crs.strip():
        return crs
    if isinstance(crs, Integral) and not isinstance(crs, bool):
        return f"EPSG:{int(crs)}"
    # Other packages have classes of their own, which state their WKT
    to_wkt = getattr(crs, "to_wkt", None)
    if not callable(to_wkt):
        raise CrsError(
            f"{crs!r:.60} is not a CRS: expected {_FORMS}, an EPSG code or a pyproj.CRS",
            where=where,
            advice=_ADVICE,
        )
    return str(to_wkt("WKT2_2019") if isinstance(crs, pyproj.CRS) else to_wkt())


def parse_crs(crs: object, *, where: object = None) -> str:
    """Return the WKT2 of a projected CRS named by EPSG code(s) or WKT, or "local".

    Only these forms are read: a CRS text is never opened as a path and never fetched as an address.

    Parameters
    ----------
    crs
        As `crs_text` takes it.
    where
        The file or parameter that messages name.

    Raises
    ------
    CrsError
        Not one of the forms, unknown code, in degrees, or with axes that do not point east and north.

    Examples
    --------
    >>> parse_crs("local")
    'local'
    >>> parse_crs(25832) == parse_crs(pyproj.CRS(25832)) == parse_crs("EPSG:25832")
    True
    >>> parse_crs("EPSG:25832+7837").split('"')[1]
    'ETRS89 / UTM zone 32N + DHHN2016 height'
    """
    loaded = _understood(crs, where, _advice_at(where))
    if loaded is None:
        return LOCAL
    check_usable(loaded, where=where)
    return LOCAL if loaded.is_engineering else canonical_wkt(loaded)


def stated_crs(crs: object, given: str | None, *, where: object) -> str:
    """Return the CRS that a file states; where that is not understood, the one that the caller gave.

    Parameters
    ----------
    crs
        What the file states.
    given
        As `parse_crs` returned it, or "" for what is not understood; None: that is an error.

    Raises
    ------
    CrsError
        As for `parse_crs`; one that is not understood only where none was given, and then giving one helps.
    """
    try:
        _understood(crs, where, _ADVICE)
    except CrsError:
        if given is None:
            raise
        return given
    return parse_crs(crs, where=where)


def _advice_at(where: object) -> str:
    """Return what to do about a CRS: give another where the parameter is wrong, else correct it where it is stated."""
    return _ADVICE if where in (None, argument("crs")) else _STATED_ADVICE


def _understood(crs: object, where: object, advice: str) -> pyproj.CRS | None:
    """Return the CRS that a text denotes, usable or not; None for "local"."""
    text = crs_text(crs, where=where)
    stripped = text.strip()
    if stripped.lower() == LOCAL:
        return None
    shown = stripped if len(stripped) <= 60 else stripped[:57] + "..."
    if len(text) > _MAX_CHARS:
        raise CrsError(
            f"CRS text of {len(text)} characters, at most {_MAX_CHARS}", where=where, advice=advice
        )
    if not (_EPSG.fullmatch(stripped) or _WKT.match(stripped)):
        raise CrsError(f"'{shown}' is not a CRS: expected {_FORMS}", where=where, advice=advice)
    try:
        return _load(stripped)
    except ProjError as error:
        raise CrsError(f"CRS '{shown}' is not known to PROJ", where=where, advice=advice) from error


def check_usable(crs: pyproj.CRS, *, where: object = None) -> None:
    """Raise unless lengths can be measured in the CRS: projected (or engineering), axes east and north."""
    plan, advice = horizontal_part(crs), _advice_at(where)
    if plan.is_geographic or plan.is_geocentric:
        raise CrsError(
            f"CRS '{crs.name}' is geographic (degrees), lengths need metres" if plan.is_geographic
            else f"CRS '{crs.name}' is geocentric, expected a projected one",
            where=where, advice="transform to a projected CRS, or " + advice,
        )  # fmt: skip
    if plan.is_vertical:
        raise CrsError(f"CRS '{crs.name}' is for heights only", where=where, advice=advice)
    if plan.is_engineering and abs(plan.axis_info[0].unit_conversion_factor - 1.0) > 1e-9:
        raise CrsError(f"CRS '{crs.name}' is local, but not in metres", where=where, advice=advice)
    directions = [axis.direction for axis in plan.axis_info]
    if "west" in directions:
        raise CrsError(
            f"CRS '{crs.name}' has axes {' and '.join(directions)}, expected east and north",
            where=where,
            advice="transform to a CRS with axes east and north",
        )


def horizontal_part(crs: pyproj.CRS) -> pyproj.CRS:
    """Return the horizontal CRS of a compound or bound one."""
    if crs.is_compound:
        return horizontal_part(crs.sub_crs_list[0])
    if crs.is_bound and crs.source_crs is not None:
        return horizontal_part(crs.source_crs)
    return crs


def vertical_part(crs: pyproj.CRS) -> pyproj.CRS | None:
    """Return the vertical CRS of a compound one, or None."""
    if crs.is_compound:
        part = crs.sub_crs_list[1]
        return part.source_crs if part.is_bound else part
    return None


def canonical_wkt(crs: pyproj.CRS) -> str:
    """Return one WKT2 per CRS: EPSG's where every part has a code, so that equal CRSs have equal texts."""
    plan, height = horizontal_part(crs), vertical_part(crs)
    # Low confidence finds candidates; `_same_parts` decides
    codes = [part.to_epsg(min_confidence=20) for part in (plan, height) if part is not None]
    if all(codes):
        own = _load("EPSG:" + "+".join(str(code) for code in codes))
        if _same_parts(own, crs):
            crs = own
    return crs.to_wkt("WKT2_2019")


def unit_factors(wkt: str) -> tuple[float, float]:
    """Return the metres per unit in plan and in height.

    A CRS without heights takes them to be in the unit of the plan.

    >>> [round(f, 9) for f in unit_factors(parse_crs("EPSG:2263+6360"))]
    [0.30480061, 0.30480061]
    """
    if wkt == LOCAL:
        return 1.0, 1.0
    crs = _load(wkt)
    plan, height = horizontal_part(crs), vertical_part(crs)
    horizontal = float(plan.axis_info[0].unit_conversion_factor)
    if height is not None:
        return horizontal, float(height.axis_info[0].unit_conversion_factor)
    if len(plan.axis_info) > 2:
        return horizontal, float(plan.axis_info[2].unit_conversion_factor)
    return horizontal, horizontal


@functools.lru_cache(maxsize=64)  # PROJ takes 0.3 s to search its database for the twin
def metric_twin(wkt: str) -> str:
    """Return the same CRS with all lengths in metres: same projection, same datum.

    Coordinates times `unit_factors` of the old one are coordinates of the new one.

    >>> epsg_text(metric_twin(parse_crs("EPSG:2225+6360")))
    'EPSG:26941+5703'
    """
    if unit_factors(wkt) == (1.0, 1.0):
        return wkt
    document = _load(wkt).to_json_dict()
    parts = [_unbound(part) for part in _unbound(document).get("components", [document])]
    for part in parts:
        _make_metric(part)
    metric = [pyproj.CRS.from_json_dict(part) for part in parts]
    return canonical_wkt(compound(*metric) if len(metric) == 2 else metric[0])


def _unbound(part: dict[str, Any]) -> dict[str, Any]:
    """Return a CRS (PROJJSON) without the transformation to WGS 84 that old texts include."""
    return _unbound(part["source_crs"]) if part["type"] == "BoundCRS" else part


def same_crs(a: str, b: str) -> bool:
    """Return whether two texts denote the same CRS; a missing vertical part differs from any."""
    if a == b:
        return True
    if LOCAL in (a, b) or not a or not b:
        return False
    return _same_parts(_load(a), _load(b))


def same_plan(a: str, b: str) -> bool:
    """Return whether two CRS texts have the same horizontal part."""
    if a == b:
        return True
    if LOCAL in (a, b) or not a or not b:
        return False
    return _same_horizontal(_load(a), _load(b))


def has_height(wkt: str) -> bool:
    """Return whether the CRS has a vertical part."""
    return wkt != LOCAL and vertical_part(_load(wkt)) is not None


def with_height_of(wkt: str, other: str) -> str:
    """Return the horizontal CRS of `wkt` compounded with the vertical CRS of `other`, as canonical WKT2."""
    plan, height = horizontal_part(_load(wkt)), vertical_part(_load(other))
    if height is None:
        return wkt
    return canonical_wkt(compound(plan, height))


def compound(plan: pyproj.CRS, height: pyproj.CRS) -> pyproj.CRS:
    """Return the compound of a horizontal and a vertical CRS."""
    return pyproj.crs.CompoundCRS(name=f"{plan.name} + {height.name}", components=[plan, height])


def vertical_in_unit(crs: pyproj.CRS, unit_m: float) -> pyproj.CRS:
    """Return a vertical CRS with its axis in a unit of `unit_m` metres (a foot of some kind)."""
    document = crs.to_json_dict()
    name = "foot" if unit_m == 0.3048 else "US survey foot"
    document["coordinate_system"]["axis"][0]["unit"] = {
        "type": "LinearUnit", "name": name, "conversion_factor": unit_m,
    }  # fmt: skip
    document.pop("id", None)
    document["name"] += f" ({name})"
    return pyproj.CRS.from_json_dict(document)


def describe_crs(wkt: str) -> str:
    """Return a short name for messages.

    >>> describe_crs(parse_crs("EPSG:28992"))
    'Amersfoort / RD New (EPSG:28992)'
    """
    if wkt in (LOCAL, ""):
        return wkt or "none"
    crs = _load(wkt)
    code = epsg_text(wkt)
    return f"{crs.name} ({code})" if code else str(crs.name)


def epsg_text(wkt: str) -> str:
    """Return "EPSG:n" or "EPSG:n+m" where the CRS carries codes, else ""."""
    if wkt in (LOCAL, ""):
        return ""
    crs = _load(wkt)
    plan, height = horizontal_part(crs), vertical_part(crs)
    codes = [part.to_epsg(min_confidence=100) for part in (plan, height) if part is not None]
    return "EPSG:" + "+".join(str(code) for code in codes) if all(codes) else ""


@functools.lru_cache(maxsize=64)
def _load(text: str) -> pyproj.CRS:
    return pyproj.CRS.from_user_input(text)


def _same_horizontal(a: pyproj.CRS, b: pyproj.CRS) -> bool:
    """Return whether two horizontal CRSs give equal coordinates, up to the digits of their texts."""
    plan_a, plan_b = horizontal_part(a), horizontal_part(b)
    if plan_a.equals(plan_b, ignore_axis_order=True):
        return True
    if not (plan_a.is_projected and plan_b.is_projected):
        return False
    names_a, numbers_a = _definition(plan_a)
    names_b, numbers_b = _definition(plan_b)
    # 12 digits are what the shortest common form of WKT keeps.
    return names_a == names_b and all(
        math.isclose(x, y, rel_tol=1e-11, abs_tol=1e-11) for x, y in zip(numbers_a, numbers_b, strict=True)
    )


def _definition(plan: pyproj.CRS) -> tuple[list[str], list[float]]:
    """Return the names and the numbers [SI] that define a projected CRS."""
    operation, ellipsoid = plan.coordinate_operation, plan.ellipsoid
    assert operation is not None
    assert ellipsoid is not None
    parameters = sorted((p.name.lower(), float(p.value) * p.unit_conversion_factor) for p in operation.params)
    datum = plan.datum.name if plan.datum is not None else ""
    names = [operation.method_name, *(name for name, _ in parameters)]
    names.append("".join(c for c in datum.lower() if c.isalnum()))
    numbers = [value for _, value in parameters]
    numbers += [
        ellipsoid.semi_major_metre,
        ellipsoid.semi_minor_metre,
        plan.axis_info[0].unit_conversion_factor,
    ]
    return names, numbers


def _same_parts(a: pyproj.CRS, b: pyproj.CRS) -> bool:
    height_a, height_b = vertical_part(a), vertical_part(b)
    if (height_a is None) != (height_b is None) or not _same_horizontal(a, b):
        return False
    if height_a is None or height_b is None or height_a.equals(height_b):
        return True
    code = height_a.to_epsg(min_confidence=90)
    return code is not None and code == height_b.to_epsg(min_confidence=90)


def _make_metric(part: dict[str, Any]) -> None:
    """Turn one projected or vertical CRS (PROJJSON) into metres, in place."""
    system = part["coordinate_system"]
    metre = {"unit": "metre"}
    changed = False
    for axis in system["axis"]:
        changed |= axis["unit"] != "metre"
        axis.update(metre)
    if not changed:
        return
    part.pop("id", None)
    part["name"] = _FEET_IN_NAME.sub("", part["name"]) + " (in metres)"
    if "conversion" not in part:  # vertical CRSs in metres have no suffix in EPSG
        part["name"] = part["name"].removesuffix(" (in metres)")
    for parameter in part.get("conversion", {}).get("parameters", []):
        unit = parameter.get("unit")
        if isinstance(unit, dict) and unit.get("type") == "LinearUnit":
            parameter["value"] = parameter["value"] * unit["conversion_factor"]
            parameter["unit"] = "metre"
    part.get("conversion", {}).pop("id", None)
