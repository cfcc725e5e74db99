"""Photos and events of a drive as layers of points, `photolog` and `event`, written beside lines and read back."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from linework.arrays import AnyArray, FloatArray
from linework.files.documents import read_json
from linework.files.vectors.gdal_input import pyogrio, reading_with_gdal
from linework.model.logs import LoggedPlaces, VanLog

PHOTOLOG, EVENT = "photolog", "event"
#: Layers of points, which readers of lines skip.
POINT_LAYERS = (PHOTOLOG, EVENT)
#: Decimals of computed values: millimetres, thousandths of a degree.
_DECIMALS = {"chainage_m": 3, "heading_deg": 3}


@dataclass(frozen=True, slots=True)
class PointLayer:
    """n points with their fields.

    Parameters
    ----------
    xyz
        (n, 3) float64 [m, world].
    fields
        (n,) each, by name.
    """

    name: str
    xyz: FloatArray
    fields: Mapping[str, AnyArray]


def point_layers(log: VanLog | Sequence[PointLayer] | None) -> tuple[PointLayer, ...]:
    """Return the layers of a log; also empty ones, where the survey has photos or events that could not be placed."""
    if log is None or not isinstance(log, VanLog):
        return tuple(log or ())
    layers = []
    if log.photos is not None:
        photos = log.photos
        own: dict[str, AnyArray] = {
            "pair": np.asarray(photos.number, dtype=np.int64),
            "left": _names(photos.left, log.root),
            "right": _names(photos.right, log.root),
        }
        if any(photos.camera):
            # Cameras without a partner: their images have a column of their own, their number is in `pair`
            is_single = np.array([bool(camera) for camera in photos.camera])
            own["image"] = own["left"].copy()
            own["image"][~is_single], own["left"][is_single] = None, None
            own["camera"] = _texts([camera or "pair" for camera in photos.camera])
        layers.append(PointLayer(PHOTOLOG, photos.places.xyz, own | _fields(photos.places)))
    if log.events is not None:
        events = log.events
        own = {"key": _texts(events.key), "note": _texts(events.note)}
        if any(events.span):
            own["span"] = _texts(events.span)
        layers.append(PointLayer(EVENT, events.places.xyz, own | _fields(events.places)))
    return tuple(layers)


def _fields(places: LoggedPlaces) -> dict[str, AnyArray]:
    fields = {name: np.round(getattr(places, name), digits) for name, digits in _DECIMALS.items()}
    return {"time_s": places.time_s} | fields


def _names(files: Sequence[Path | None], root: Path) -> AnyArray:
    """Return file names relative to the survey's folder, so that a survey can be moved; None for none."""
    return _texts(["" if file is None else relative_path(file, root).as_posix() for file in files])


def relative_path(file: Path, folder: Path) -> Path:
    """Return a path relative to a folder; absolute where it is on another drive.

    >>> relative_path(Path("/data/survey/left/1.png"), Path("/data/results")).as_posix()
    '../survey/left/1.png'
    """
    try:
        return Path(os.path.relpath(file, folder))
    except ValueError:
        return file.absolute()


def _texts(values: Sequence[str]) -> AnyArray:
    """Return texts as objects, "" as None, lone surrogates (in undecodable file names) escaped."""
    texts = np.full(len(values), None, dtype=object)
    for i, value in enumerate(values):
        texts[i] = value.encode("utf-8", errors="backslashreplace").decode() or None
    return texts


def read_point_layers(path: Path) -> tuple[PointLayer, ...]:
    """Return the layers `photolog` and `event` of a GeoPackage or GeoJSON; none for other formats.

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
    with reading_with_gdal(path) as source:
        for name, kind in pyogrio.list_layers(source):
            if name in POINT_LAYERS and str(kind) in ("Point", "Point Z"):
                meta, _, shapes, values = pyogrio.raw.read(source, layer=str(name))
                fields = dict(zip(map(str, meta["fields"]), values, strict=True))
                found.append(PointLayer(str(name), _places(shapely.from_wkb(shapes)), fields))
    return tuple(found)


def _of_geojson(path: Path) -> tuple[PointLayer, ...]:
    features = read_json(path.read_text(encoding="utf-8-sig"), path).get("features", [])
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
