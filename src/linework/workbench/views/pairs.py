"""Requests to the pictures worker about stereo pairs: the list, images for the screen, lines projected into them.

Separate from `routes`, because it runs in the worker and needs the opened survey.
"""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

import numpy as np

from linework.files.images.screen import screen_image, screen_thumbnail
from linework.files.logs.photolog import van_log
from linework.imaging.projected import PROJECTED_DEPTH_M, ProjectedLines, projected
from linework.model.camera import Camera
from linework.model.images import ImagePair
from linework.model.lines import LineSet
from linework.model.logs import LoggedPlaces
from linework.model.survey import Survey
from linework.runs.opened.pairs import OpenedStereo
from linework.workbench.server.pictures import CameraSide, no_such_pair_error
from linework.workbench.worker.session import SurveySession

#: Camera of a pair.
#: Thumbnails kept in memory: 4 kB each.
_MOST_KEPT = 4096
#: Half width of the widest lenses' view, as a multiple of the depth: 60 degrees from the axis.
_WIDEST = 2.0


def list_pairs(session: SurveySession) -> list[dict[str, Any]]:
    """Return a document per usable pair, in time order; why others are not usable is in the survey's warnings."""
    stereo = session.recordings.stereo
    if stereo is None:
        return []
    log = van_log(_without_keys(session.survey), stereo.series, stereo.trajectory)
    assert log.photos is not None
    usable = set(stereo.numbers.tolist())
    return [
        document | {"number": number, "left": left.name, "right": right.name if right else ""}
        for document, number, left, right in zip(
            _places(log.photos.places), log.photos.number.tolist(), log.photos.left, log.photos.right, strict=True
        )
        if number in usable
    ]  # fmt: skip


def list_keys(session: SurveySession) -> list[dict[str, Any]]:
    """Return a document per key that the operator pressed, in time order.

    Raises
    ------
    InputError
        The file of keys cannot be used.
    """
    recordings = session.recordings
    events = van_log(recordings.survey, None, recordings.trajectory).events
    if events is None:
        return []
    return [
        document | {"key": key, "note": note}
        for document, key, note in zip(_places(events.places), events.key, events.note, strict=True)
    ]


def image_jpeg(session: SurveySession, number: int, side: CameraSide) -> bytes:
    """Return an image as it was taken, as JPEG.

    Raises
    ------
    AbsentError
        There is no such pair.
    InputError
        It cannot be read.
    """
    return screen_image(getattr(_pair(session, number), side), _camera(session, side), session.survey.root)


def thumbnail_jpeg(session: SurveySession, number: int) -> bytes:
    """Return a thumbnail of the left image of a pair, as JPEG (see `image_jpeg`)."""
    kept = session.keep("thumbnails", dict[int, bytes])
    pair = _pair(session, number)
    if number not in kept:
        if len(kept) >= _MOST_KEPT:
            kept.pop(next(iter(kept)))
        kept[number] = screen_thumbnail(pair.left, _camera(session, "left"), session.survey.root)
    return kept[number]


def lines_in_pair(session: SurveySession, number: int, lines: LineSet) -> bytes:
    """Return lines projected into both images of a pair, as JSON (`PairLines` of the page).

    Encoded here and not in the server, which some ten thousand numbers would hold up.

    Raises
    ------
    AbsentError
        There is no such pair.
    """
    stereo = _stereo(session, number)
    i = int(np.flatnonzero(stereo.numbers == number)[0])
    rig = stereo.series.rig
    return json.dumps(
        {
            "number": number,
            "width": rig.left.width,
            "height": rig.left.height,
            "left": _documents(lines, projected(lines, rig.left, stereo.poses, i)),
            "right": _documents(lines, projected(lines, rig.right, stereo.poses, i)),
        },
        separators=(",", ":"),
    ).encode()


def lines_near_camera(lines: LineSet, at: tuple[float, ...]) -> LineSet:
    """Return the lines that a camera at a place (east, north, up) [m, world] may see, whatever its direction."""
    if not len(lines.xyz):
        return lines
    # Lines without vertices would get the bounds of the next one
    starts = lines.offsets[:-1][np.diff(lines.offsets) > 0]
    reach = _WIDEST * PROJECTED_DEPTH_M[1]
    low = np.minimum.reduceat(lines.xyz[:, :2], starts, axis=0) <= np.array(at[:2]) + reach
    high = np.maximum.reduceat(lines.xyz[:, :2], starts, axis=0) >= np.array(at[:2]) - reach
    return lines.take(np.flatnonzero(np.diff(lines.offsets) > 0)[(low & high).all(axis=1)])


def _documents(lines: LineSet, pieces: ProjectedLines) -> list[dict[str, Any]]:
    """Return a document per visible line."""
    pixels = pieces.pixels.round(1).tolist()
    documents: list[dict[str, Any]] = []
    before = -1
    for k, (line, is_bridged) in enumerate(zip(pieces.line.tolist(), pieces.bridged.tolist(), strict=True)):
        if line != before:
            documents.append(
                {"id": str(lines.id[line]), "kind": str(lines.kind[line]), "runs": [], "bridged": []}
            )
            before = line
        documents[-1]["runs"].append(pixels[pieces.offsets[k] : pieces.offsets[k + 1]])
        documents[-1]["bridged"].append(is_bridged)
    return documents


def _places(places: LoggedPlaces) -> list[dict[str, Any]]:
    return [
        {
            "time_s": time_s,
            "chainage_m": round(chainage_m, 3),
            "at": [round(value, 3) for value in xyz],
            "heading_deg": round(heading_deg, 3),
        }
        for time_s, chainage_m, xyz, heading_deg in zip(
            places.time_s.tolist(), places.chainage_m.tolist(), places.xyz.tolist(), places.heading_deg.tolist(),
            strict=True,
        )
    ]  # fmt: skip


def _stereo(session: SurveySession, number: int) -> OpenedStereo:
    """Return the opened pairs, after checking that one has that number."""
    stereo = session.recordings.stereo
    if stereo is None or number not in stereo.numbers:
        raise no_such_pair_error(number)
    return stereo


def _pair(session: SurveySession, number: int) -> ImagePair:
    return next(pair for pair in _stereo(session, number).pairs if pair.number == number)


def _camera(session: SurveySession, side: CameraSide) -> Camera:
    stereo = session.recordings.stereo
    assert stereo is not None
    camera: Camera = getattr(stereo.series.rig, side)
    return camera


def _without_keys(survey: Survey) -> Survey:
    """Return the survey without the operator's keys: a damaged file of them must not affect images."""
    return replace(survey, settings={k: v for k, v in survey.settings.items() if k != "events"})
