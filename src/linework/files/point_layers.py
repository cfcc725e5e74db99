"""The van's log as layers of points: `photolog` and `event`, with the fields that every vector format writes."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from linework.arrays import AnyArray, FloatArray
from linework.model.van_log import LoggedPlaces, VanLog

PHOTOLOG, EVENT = "photolog", "event"
#: Layers that hold points: who reads lines passes over them.
POINT_LAYERS = (PHOTOLOG, EVENT)
#: Computed values: a tenth of a millimetre, a thousandth of a degree.
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
    """Return the layers of a log: those that the survey has, also where nothing could be placed."""
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
        layers.append(PointLayer(PHOTOLOG, photos.places.xyz, own | _fields(photos.places)))
    if log.events is not None:
        events = log.events
        own = {"key": _texts(events.key), "note": _texts(events.note)}
        layers.append(PointLayer(EVENT, events.places.xyz, own | _fields(events.places)))
    return tuple(layers)


def _fields(places: LoggedPlaces) -> dict[str, AnyArray]:
    fields = {name: np.round(getattr(places, name), digits) for name, digits in _DECIMALS.items()}
    return {"time_s": places.time_s} | fields


def _names(files: Sequence[Path], root: Path) -> AnyArray:
    """Return files as they are named from the survey's folder, so that a survey may move."""
    return _texts([path_from(file, root).as_posix() for file in files])


def path_from(file: Path, folder: Path) -> Path:
    """Return a path as seen from a folder; as it is where there is no way (another drive).

    >>> path_from(Path("/data/survey/left/1.png"), Path("/data/results")).as_posix()
    '../survey/left/1.png'
    """
    try:
        return Path(os.path.relpath(file, folder))
    except ValueError:
        return file.absolute()


def _texts(values: Sequence[str]) -> AnyArray:
    """Return texts as objects, "" as None, what no file can hold (lone surrogates of odd names) escaped."""
    texts = np.full(len(values), None, dtype=object)
    for i, value in enumerate(values):
        texts[i] = value.encode("utf-8", errors="backslashreplace").decode() or None
    return texts
