"""The photolog: a page of the drive with thumbnails at a fixed spacing, and the operator's keys.

The page is self-contained; each thumbnail links to its image by a path relative to the page.
"""

from __future__ import annotations

import base64
import os
import urllib.parse
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from linework.arrays import FloatArray, IntArray
from linework.errors import InputError, extra_needed
from linework.files.images.screen import image_thumbnail
from linework.files.vectors.point_layers import relative_path
from linework.model.logs import Events, LoggedPlaces, Photos, VanLog

with extra_needed("reports"):
    from jinja2 import Environment, PackageLoader, StrictUndefined

#: Most thumbnails on a page: 3 MB at 6 kB each. On longer drives their spacing grows.
MAX_PICTURES = 500
#: Most operator keys on a page: about 1 MB of text.
_MAX_KEYS = 2000
#: Default distance between thumbnails. [m]
_EVERY_M = 10.0
#: Most vertices of the path in the plan, which is about as many pixels wide.
_MAX_VERTICES = 1000


@dataclass(frozen=True, slots=True)
class PhotologPage:
    """The page, with what was shown and what failed.

    Parameters
    ----------
    n_pictures
        Number of thumbnails.
    every_m
        Their spacing. [m]
    warnings
        One line each.
    failures
        One line per image that could not be read.
    """

    html: str
    n_pictures: int
    every_m: float
    warnings: tuple[str, ...] = ()
    failures: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class _Entry:
    """A thumbnail or a key on the page."""

    chainage_m: float
    title: str
    texts: tuple[str, ...]
    anchor: str = ""
    link: str = ""
    base64: str = ""
    is_key: bool = field(default=False)


def photolog_html(
    log: VanLog, page: Path, *, title: str, every_m: float = _EVERY_M, facts: Mapping[str, str] | None = None
) -> PhotologPage:
    """Return the photolog of a drive.

    Parameters
    ----------
    page
        Path where the page will be written: links to images are relative to it.
    every_m
        Distance between thumbnails along the drive. [m]
    facts
        Names and values for the head of the page.

    Notes
    -----
    A page holds at most 500 thumbnails of at most 160 pixels, and 2000 keys. Names and notes are escaped. Where
    several cameras took images, the video camera's are shown, else those of the pairs, else those of a single camera.
    """
    photos, events = _of_one_camera(log.photos or Photos()), log.events or Events()
    chosen, step_m = _chosen(photos.places.chainage_m, every_m)
    warnings, failures = [], []
    if step_m > every_m:
        warnings.append(
            f"one image every {step_m:.0f} m instead of {every_m:g} m: a page holds {MAX_PICTURES}"
        )
    if len(events) > _MAX_KEYS:
        warnings.append(f"{_MAX_KEYS} of {len(events)} keys are on the page; the layer `event` holds all")
    entries = []
    for i in chosen.tolist():
        try:
            picture = base64.b64encode(image_thumbnail(photos.left[i])).decode()
        except InputError as error:
            picture = ""
            failures.append(str(error))
        entries.append(_photo_entry(photos, i, picture, page.parent))
    entries += [_key_entry(events, i) for i in range(min(len(events), _MAX_KEYS))]
    entries.sort(key=lambda entry: (entry.chainage_m, entry.is_key))
    environment = Environment(
        loader=PackageLoader("linework", "evaluation"), autoescape=True, undefined=StrictUndefined
    )
    html = environment.get_template("photolog.html.j2").render(
        title=title,
        facts=[*(facts or {}).items(), *_facts(log, len(chosen), step_m).items()],
        plan=_plan(photos.places, events.places, chosen),
        entries=entries,
    )
    return PhotologPage(html, len(chosen), step_m, tuple(warnings), tuple(failures))


def _of_one_camera(photos: Photos) -> Photos:
    """Return the images of the camera that is shown: the video camera, the pairs, or a single camera."""
    shown = next((name for name in ("video", "", "left", "right") if name in photos.camera), None)
    if shown is None:
        return photos
    index = np.array([i for i, name in enumerate(photos.camera) if name == shown], dtype=np.int64)
    return Photos(
        places=photos.places.take(index), number=photos.number[index],
        left=tuple(photos.left[i] for i in index), right=tuple(photos.right[i] for i in index),
        camera=(shown,) * len(index),
    )  # fmt: skip


def _chosen(chainage_m: FloatArray, every_m: float) -> tuple[IntArray, float]:
    """Return the images shown, (k,) int64, the first of every step, and the step [m]; a stop is shown once."""
    if not len(chainage_m):
        return np.zeros(0, dtype=np.int64), every_m
    driven = chainage_m - chainage_m[0]
    step = every_m
    if np.floor(driven[-1] / step) + 1 > MAX_PICTURES:
        step = float(np.ceil(driven[-1] / (MAX_PICTURES - 1)))
    # The slack keeps images exactly one step apart in their own steps
    cell = np.floor(driven / step + 1e-6)
    return np.flatnonzero(np.diff(cell, prepend=-1.0) > 0.0).astype(np.int64), step


def _photo_entry(photos: Photos, i: int, picture: str, folder: Path) -> _Entry:
    number = int(photos.number[i])
    return _Entry(
        chainage_m=float(photos.places.chainage_m[i]),
        title=f"{number}",
        texts=_where(photos.places, i),
        anchor=f"p{number}",
        link=_link(photos.left[i], folder),
        base64=picture,
    )


def _key_entry(events: Events, i: int) -> _Entry:
    return _Entry(
        chainage_m=float(events.places.chainage_m[i]),
        title=events.key[i],
        texts=((events.note[i],) if events.note[i] else ()) + _where(events.places, i),
        is_key=True,
    )


def _where(places: LoggedPlaces, i: int) -> tuple[str, ...]:
    east, north, up = places.xyz[i].tolist()
    return (
        f"{places.chainage_m[i]:,.1f} m",
        f"{places.time_s[i]:.2f} s",
        f"heading {places.heading_deg[i] % 360.0:.0f}°",
        f"{east:.2f} {north:.2f} {up:.2f}",
    )


def _link(file: Path, folder: Path) -> str:
    """Return the link from a page in `folder` to an image; "./" keeps a colon in a name from being a scheme.

    >>> _link(Path("/drive/left/a b#1.png"), Path("/drive"))
    './left/a%20b%231.png'
    """
    return "./" + urllib.parse.quote(os.fsencode(relative_path(file, folder).as_posix()), safe="/")


def _facts(log: VanLog, n_pictures: int, step_m: float) -> dict[str, str]:
    facts = {}
    if log.photos is not None:
        counts = Counter(
            name and f"of cameras.{name}" for name in log.photos.camera or [""] * len(log.photos)
        )
        taken = [f"{n:,} {name or 'pairs'}" for name, n in sorted(counts.items())] or ["0 pairs"]
        facts["images"] = f"{', '.join(taken)}, {n_pictures} shown, every {step_m:g} m"
    if log.events is not None:
        facts["operator keys"] = f"{len(log.events):,}"
    return facts


def _plan(photos: LoggedPlaces, events: LoggedPlaces, chosen: IntArray) -> dict[str, Any] | None:
    """Return the plan of the drive in metres from its middle, north up; None where nothing has a position."""
    both = np.concatenate([photos.xyz[:, :2], events.xyz[:, :2]])
    if not len(both):
        return None
    low, high = both.min(axis=0), both.max(axis=0)
    # At least 20 m wide, with a tenth as margin
    size = np.maximum(high - low, 20.0) * 1.2
    middle = 0.5 * (low + high)

    def drawn(xyz: FloatArray) -> list[list[float]]:
        return ((xyz[:, :2] - middle) * [1.0, -1.0]).round(2).tolist()  # type: ignore[no-any-return]

    vertices = np.unique(np.linspace(0, max(len(photos) - 1, 0), _MAX_VERTICES).astype(int))
    # Scale bar: the longest of 1, 2, 5, 10 ... metres that is at most a third of the width
    power = 10.0 ** np.floor(np.log10(size[0] / 3.0))
    length = max(n * power for n in (1.0, 2.0, 5.0) if n * power <= size[0] / 3.0)
    dot = float(size.max()) / 160.0
    return {
        "box": [float(v) for v in (-size / 2).round(2)] + [float(v) for v in size.round(2)],
        "path": drawn(photos.xyz[vertices]) if len(photos) else [],
        "photos": drawn(photos.xyz[chosen]),
        "keys": drawn(events.xyz),
        "dot": round(dot, 2),
        "scale": float(length),
        "scale_at": [round(float(-size[0] / 2) + 4.0 * dot, 2), round(float(size[1] / 2) - 3.0 * dot, 2)],
    }
