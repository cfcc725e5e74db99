"""CRS of a LAS file, from its WKT or GeoTIFF keys and from what the caller gave."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass

import pyproj
from pyproj.exceptions import CRSError as ProjError

from linework import crs as crs_texts
from linework.errors import CrsError, argument

_WKT_RECORD, _KEYS_RECORD = 2112, 34735
_MODEL, _GEOGRAPHIC, _PROJECTED, _UNIT, _VERTICAL, _VERTICAL_UNIT = 1024, 2048, 3072, 3076, 4096, 4099
_UNDEFINED, _USER_DEFINED = 0, 32767
#: Metres per unit, by the EPSG code of the unit.
_UNIT_M = {9001: 1.0, 9002: 0.3048, 9003: 1200.0 / 3937.0}
#: GeoTIFF 1.0 named vertical CRSs by their datum; EPSG has these CRSs for them (NGVD29, NAVD88).
_OLD_VERTICAL = {5102: 5702, 5103: 5703}
_CRS = argument("crs")
_KEYS = "its GeoTIFF keys"
_ADVICE = f"give {argument('crs', 'EPSG:...')} or {argument('crs', 'local')}"


@dataclass(frozen=True, slots=True)
class ResolvedCrs:
    """The CRS in metres, the factors (plan, height) from the file's coordinates to it, and warnings."""

    crs: str
    factors: tuple[float, float]
    warnings: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class _Stated:
    """What a file states: a CRS ("": none, or not understood), and separate units, in metres per unit."""

    crs: str = ""
    vertical_factor: float | None = None
    problem: str = ""
    horizontal_factor: float | None = None


def resolve_crs(
    projection: Sequence[tuple[int, bytes]], given: str | None, *, by: str = _CRS, where: object = None
) -> ResolvedCrs:
    """Return the CRS of a file from its projection records and from what the user gave.

    Parameters
    ----------
    projection
        (record id, data) of the file's LASF_Projection records.
    given
        "EPSG:...", WKT or "local"; None where the user gave none.
    by
        What gave it, for messages: the parameter, or the survey.toml.

    Raises
    ------
    CrsError
        No CRS; in degrees; two that contradict each other.
    """
    wanted = None if given is None else crs_texts.parse_crs(given, where=by)
    stated = _stated(projection, where)
    if wanted is None and not stated.crs:
        raise CrsError(stated.problem or "the file does not state its CRS", where=where, advice=_ADVICE)
    warnings = [f"{stated.problem}: taken from the CRS that was given"] if stated.problem else []
    crs = _agreed(stated.crs, wanted, by, where)
    horizontal, vertical = _factors(crs, stated, where)
    if (horizontal, vertical) != (1.0, 1.0):
        warnings.append(
            f"feet converted to metres (x, y times {horizontal:.10g}, z times {vertical:.10g}): {crs_texts.describe_crs(crs)}"
        )
    return ResolvedCrs(crs_texts.metric_twin(crs), (horizontal, vertical), tuple(warnings))


def _agreed(stated: str, wanted: str | None, by: str, where: object) -> str:
    """Return the one CRS that the file and the user agree on; a missing vertical part is filled in."""
    if wanted is None or not stated:
        return wanted or stated
    if not crs_texts.same_plan(stated, wanted):
        raise _conflict("the file", stated, by, wanted, where)
    if not crs_texts.has_height(stated):
        return wanted
    if not crs_texts.has_height(wanted) or crs_texts.same_crs(stated, wanted):
        return stated
    raise _conflict("the file", stated, by, wanted, where)


def _factors(crs: str, stated: _Stated, where: object) -> tuple[float, float]:
    """Return the metres per unit in plan and in height; a local CRS takes the units that the file states."""
    horizontal, vertical = crs_texts.unit_factors(crs)
    unit = stated.horizontal_factor
    if unit is not None and abs(unit / horizontal - 1.0) > 1e-9:
        if crs != crs_texts.LOCAL:
            raise CrsError(
                f"its GeoTIFF keys state a unit of {unit:.9g} m, {argument('crs', crs_texts.describe_crs(crs))} has {horizontal:.9g} m",
                where=where,
                advice="give the CRS that the coordinates are in, or correct the header",
            )
        horizontal = vertical = unit
    if stated.vertical_factor is not None and not crs_texts.has_height(crs):
        vertical = stated.vertical_factor
    return horizontal, vertical


def _conflict(first: str, a: str, second: str, b: str, where: object) -> CrsError:
    remedy = f"leave {_CRS} out" if second == _CRS else f"correct {second}"
    return CrsError(
        f"two different CRSs: {first} says {crs_texts.describe_crs(a)}, {second} says {crs_texts.describe_crs(b)}",
        where=where,
        advice="correct the header" if second == _KEYS else f"{remedy}, or correct the file's header",
    )


def _stated(projection: Sequence[tuple[int, bytes]], where: object) -> _Stated:
    """Return what the file states, by WKT first."""
    keys = next((data for record, data in projection if record == _KEYS_RECORD), None)
    by_keys = _from_keys(keys, where) if keys is not None else _Stated()
    wkt = next((data for record, data in projection if record == _WKT_RECORD), b"")
    text = wkt.split(b"\0")[0].decode("utf-8", errors="replace").strip()
    if not text:
        return by_keys
    stated = crs_texts.stated_crs(text, "", where=where)
    if not stated:
        return by_keys if by_keys.crs else _Stated(problem="the file's WKT is not understood")
    by_wkt = _Stated(stated)
    if by_keys.crs and not crs_texts.same_plan(by_wkt.crs, by_keys.crs):
        raise _conflict("its WKT", by_wkt.crs, _KEYS, by_keys.crs, where)
    if not crs_texts.has_height(by_wkt.crs) and crs_texts.has_height(by_keys.crs or crs_texts.LOCAL):
        return _Stated(crs_texts.with_height_of(by_wkt.crs, by_keys.crs))
    return by_wkt


def _from_keys(data: bytes, where: object) -> _Stated:
    """Return what GeoTIFF keys state; only EPSG codes are understood."""
    keys = _short_keys(data)
    projected = keys.get(_PROJECTED, _UNDEFINED)
    if projected == _UNDEFINED:
        geographic = keys.get(_GEOGRAPHIC, _UNDEFINED)
        if geographic == _UNDEFINED or keys.get(_MODEL) == 1:
            return _Stated()
        raise CrsError(
            f"CRS EPSG:{geographic} is geographic (degrees), lengths need metres", where=where,
            advice="transform to a projected CRS",
        )  # fmt: skip
    unit, height_unit = _UNIT_M.get(keys.get(_UNIT, 0)), _UNIT_M.get(keys.get(_VERTICAL_UNIT, 0))
    if projected == _USER_DEFINED:
        problem = "the file's GeoTIFF keys define a projection of their own, without EPSG code"
        return _Stated("", height_unit, problem, unit)
    try:
        plan = pyproj.CRS.from_epsg(projected)
    except ProjError:
        problem = f"the file's GeoTIFF keys name EPSG:{projected}, which PROJ does not know"
        return _Stated("", height_unit, problem, unit)
    crs_texts.check_usable(plan, where=where)
    own_unit = plan.axis_info[0].unit_conversion_factor
    if unit is not None and abs(unit / own_unit - 1.0) > 1e-9:
        raise CrsError(
            f"the GeoTIFF keys state EPSG:{projected} (1 unit = {own_unit:.9g} m) and a unit of {unit:.9g} m",
            where=where,
            advice="correct the header",
        )
    height = _vertical(keys.get(_VERTICAL, _UNDEFINED), height_unit)
    crs = plan if height is None else crs_texts.compound(plan, height)
    return _Stated(crs_texts.canonical_wkt(crs), height_unit)


def _vertical(code: int, unit_m: float | None) -> pyproj.CRS | None:
    """Return the vertical CRS of a key's value, in the stated unit, or None where it is not one."""
    if code in (_UNDEFINED, _USER_DEFINED):
        return None
    try:
        crs = pyproj.CRS.from_epsg(_OLD_VERTICAL.get(code, code))
    except ProjError:
        return None
    if not crs.is_vertical:
        return None
    if unit_m is not None and abs(unit_m / crs.axis_info[0].unit_conversion_factor - 1.0) > 1e-9:
        return crs_texts.vertical_in_unit(crs, unit_m)
    return crs


def _short_keys(data: bytes) -> dict[int, int]:
    """Return the keys of a GeoKeyDirectory whose values are in place (location 0)."""
    if len(data) < 8:
        return {}
    n_keys = min(struct.unpack_from("<H", data, 6)[0], (len(data) - 8) // 8)
    entries = (struct.unpack_from("<4H", data, 8 + 8 * i) for i in range(n_keys))
    return {key: value for key, location, _, value in entries if location == 0}
