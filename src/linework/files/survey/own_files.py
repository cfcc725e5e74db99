"""The files of a survey, which no output may replace.

Separate from `open`, which reads their headers and metadata: this only lists them.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from linework.files.output.inputs import InputFiles
from linework.files.remote.address import is_remote
from linework.model.survey import Survey

#: Exact lines of a simulated survey; its survey.toml does not name them, because no method may read them.
_TRUTH = ("truth.gpkg", "truth_images.gpkg")


def files_of_survey(survey: Survey) -> InputFiles:
    """Return what a survey consists of: its description and the files it names, and the truth beside it.

    Images are not listed one by one, for there may be a million of them.
    """
    root, settings = survey.root, survey.settings
    named = [root / name for name in _named(settings)]
    described = [survey.settings_file] if survey.settings_file else []
    # All calibration files of a KITTI folder
    described += sorted(described[0].parent.glob("calib*.txt")) if described else []
    own = [survey.trajectory_file] if survey.trajectory_file else []
    truth = [root / name for name in _TRUTH] if described else []
    images = list(_images(settings))
    here = [path for path in survey.point_files if not is_remote(path)]
    return InputFiles(
        name=root if described or len(here) != 1 else here[0],
        files=(*described, *here, *own, *named, *truth),
        root=root,
        patterns=tuple(name for name in images if not _is_list(name)),
        lists=tuple(root / name for name in images if _is_list(name)),
    )


def _named(settings: Mapping[str, Any]) -> Iterator[str]:
    """Yield the names of single files in the settings, besides lists of images."""
    for table, keys in (
        ("trajectory", ("file",)),
        ("navigation", ("gnss", "gyro", "wheels")),
        ("gnss", ("base",)),
        ("events", ("file",)),
    ):
        yield from (_text(settings.get(table), key) for key in keys if _text(settings.get(table), key))
    for camera in _cameras(settings):
        if _text(camera, "times"):
            yield _text(camera, "times")


def _images(settings: Mapping[str, Any]) -> Iterator[str]:
    yield from (_text(camera, "images") for camera in _cameras(settings) if _text(camera, "images"))


def _cameras(settings: Mapping[str, Any]) -> list[Any]:
    cameras = settings.get("cameras")
    return list(cameras.values()) if isinstance(cameras, Mapping) else []


def _text(table: Any, key: str) -> str:
    """Return a text of a table; "" for anything else, which is refused where it is read."""
    value = table.get(key) if isinstance(table, Mapping) else None
    return value if isinstance(value, str) else ""


def _is_list(name: str) -> bool:
    return name.lower().endswith((".csv", ".txt"))
