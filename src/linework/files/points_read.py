"""Read back the layers of points that stand beside lines: the van's log in our own files."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from linework.arrays import AnyArray, FloatArray
from linework.files.point_layers import POINT_LAYERS, PointLayer
from linework.files.vector_input import pyogrio, readable


def read_point_layers(path: Path) -> tuple[PointLayer, ...]:
    """Return the layers `photolog` and `event` of a GeoPackage or GeoJSON that `read_lines` has read; others have none.

    Raises
    ------
    InputError
        Not readable.
    """
    suffix = path.suffix.lower()
    if suffix == ".gpkg":
        return _of_geopackage(path)
    return _of_geojson(path) if suffix in (".geojson", ".json") else ()


def _of_geopackage(path: Path) -> tuple[PointLayer, ...]:
    found = []
    with readable(path):
        for name, kind in pyogrio.list_layers(path):
            if name in POINT_LAYERS and str(kind) in ("Point", "Point Z"):
                meta, _, shapes, values = pyogrio.raw.read(path, layer=str(name))
                fields = dict(zip(map(str, meta["fields"]), values, strict=True))
                found.append(PointLayer(str(name), _places(shapely.from_wkb(shapes)), fields))
    return tuple(found)


def _of_geojson(path: Path) -> tuple[PointLayer, ...]:
    features = json.loads(path.read_text(encoding="utf-8-sig")).get("features", [])
    found = []
    for name in POINT_LAYERS:
        own = [f for f in features if _is_of(f, name)]
        if own:
            tables = [feature["properties"] for feature in own]
            fields = {
                key: _column([table.get(key) for table in tables]) for key in tables[0] if key != "kind"
            }
            places = np.array([shapely.from_geojson(json.dumps(feature["geometry"])) for feature in own])
            found.append(PointLayer(name, _places(places), fields))
    return tuple(found)


def _is_of(feature: Any, name: str) -> bool:
    if not isinstance(feature, dict):
        return False
    geometry, properties = feature.get("geometry"), feature.get("properties")
    is_point = isinstance(geometry, dict) and geometry.get("type") == "Point"
    return is_point and isinstance(properties, dict) and properties.get("kind") == name


def _places(shapes: AnyArray) -> FloatArray:
    """Return (n, 3) coordinates; a height that is missing is 0."""
    return np.asarray(np.nan_to_num(shapely.get_coordinates(shapes, include_z=True)), dtype=np.float64)


def _column(values: Sequence[Any]) -> AnyArray:
    """Return values as whole numbers, numbers or texts, whichever all of them are."""
    for kinds, dtype in (((int,), np.int64), ((int, float), np.float64)):
        if all(isinstance(v, kinds) and not isinstance(v, bool) for v in values):
            return np.array(values, dtype=dtype)
    texts = np.full(len(values), None, dtype=object)
    for i, value in enumerate(values):
        texts[i] = None if value is None else str(value)
    return texts
