"""Lanes as rows of a layer: a centreline each, with the lines that bound it and how wide it is.

Beside `linework.lines.lanes`, which finds them: here is which formats hold them, and under which names.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from linework.arrays import AnyArray
from linework.errors import UsageError, argument
from linework.lines.lanes import Lanes, find_lanes
from linework.lines.units import in_metres, in_units_of, unit_scale
from linework.model.lines import LineSet

#: Formats that hold lanes: as a layer of centrelines, as lanelets, and as lanes of roads.
_LAYERS, LANELETS, _ROADS = (".gpkg", ".geojson", ".json"), ".osm", ".xodr"
LANE_FORMATS = (*_LAYERS, LANELETS, _ROADS)
#: Values of the tag `location` of a lanelet.
LOCATIONS = ("urban", "nonurban", "private")
#: Decimals of widths and shares: a tenth of a millimetre.
_DECIMALS = 4


def check_lanes(path: Path, *, lanes: bool, location: str) -> None:
    """Refuse lanes for a format that has none, and lanelets without a location.

    Rules of the road follow from the location: Lanelet2 takes an untagged lanelet for an urban road with a speed limit.

    Raises
    ------
    UsageError
        The message names what to give or leave out.
    """
    suffix = path.suffix.lower()
    if lanes and suffix not in LANE_FORMATS:
        raise UsageError(
            f"'{suffix}' files hold no lanes", where=path,
            advice=f"leave {argument('lanes', True)} out, or write {', '.join(LANE_FORMATS)}",
        )  # fmt: skip
    if location and location not in LOCATIONS:
        raise UsageError(f"unknown location {location!r:.40}", where=argument("location"),
                         advice=f"use {', '.join(LOCATIONS)}")  # fmt: skip
    if location and not (lanes and suffix == LANELETS):
        raise UsageError(
            f"{argument('location', location)} is for lanes in {LANELETS} files", where=path,
            advice=f"leave {argument('location')} out, or give {argument('lanes', True)} too",
        )  # fmt: skip
    if lanes and suffix == LANELETS and not location:
        raise UsageError(
            "lanelets need a location, which decides the rules of the road", where=path,
            advice=f"give {argument('location')} {', '.join(LOCATIONS[:-1])} or {LOCATIONS[-1]}",
        )  # fmt: skip


def lane_options(lines: LineSet, path: Path, *, lanes: bool, location: str) -> dict[str, Any]:
    """Return what the writer of a format is given for lanes; nothing where none are asked for."""
    if not lanes:
        return {}
    suffix = path.suffix.lower()
    if suffix in _LAYERS:
        return {"lanes": _lanes_in_units(lines.take(lines.review != "rejected"))}
    return {"location": location} if suffix == LANELETS else {"lanes": True}


def _lanes_in_units(lines: LineSet) -> Lanes:
    """Return the lanes with places in the units of the lines' CRS; widths and lengths are in metres."""
    found = find_lanes(in_metres(lines))
    scale = unit_scale(lines.crs)
    return replace(
        found,
        centre=in_units_of(found.centre, lines.crs),
        left_xyz=found.left_xyz / scale,
        right_xyz=found.right_xyz / scale,
    )


def lane_fields(lanes: Lanes) -> dict[str, AnyArray]:
    """Return the columns (m,) of the layer of lanes, by name."""
    found = {
        "id": lanes.centre.id, "left_id": lanes.left_id, "right_id": lanes.right_id, "next_id": lanes.next_id,
        "width_m": lanes.width_m, "width_min_m": lanes.width_min_m, "width_max_m": lanes.width_max_m,
        "sigma_width_m": lanes.sigma_width_m, "length_m": in_metres(lanes.centre).length_m,
        "measured_share": lanes.measured_share, "confidence": lanes.centre.confidence,
    }  # fmt: skip
    return {
        name: np.round(values, _DECIMALS) if values.dtype.kind == "f" else _null_if_empty(values)
        for name, values in found.items()
    }


def _null_if_empty(values: AnyArray) -> AnyArray:
    texts = values.astype(object)
    texts[values == ""] = None
    return texts
