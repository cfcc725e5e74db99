"""Cameras without a partner: a colour camera for the photolog, or one camera alone.

Separate from `series`, which makes pairs of two calibrated cameras: here images need times and nothing else.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from linework.errors import ConfigError, InputError
from linework.files.images.lists import read_image_list
from linework.model.images import SingleCamera
from linework.model.survey import Survey


def open_single_cameras(survey: Survey) -> tuple[SingleCamera, ...]:
    """Find the images of the cameras of a survey that are in no pair, with their times; none is opened.

    Raises
    ------
    ConfigError
        A key of [cameras] is missing or wrong; with the key.
    InputError
        A camera without images, or a list that cannot be read.
    """
    names = survey.single_cameras
    if not names:
        return ()
    from linework.files.survey.toml import check_cameras

    cameras, where = survey.settings["cameras"], survey.settings_file or survey.root
    check_cameras(cameras, where)
    only_inside = None if survey.allow_outside else survey.settings_file
    found = []
    for name in names:
        table, key = cameras[name], f"cameras.{name}"
        if "images" not in table:
            raise ConfigError(f"{key}.images is missing", where=where,
                              advice="name its images: a list of file,time_s or a pattern")  # fmt: skip
        images = read_image_list(table, survey.root, key, only_inside=only_inside)
        _check_some_exist(images.files, key, where)
        found.append(
            SingleCamera(
                name=name,
                files=images.files,
                time_s=images.time_s,
                position_m=np.array(table.get("position_m", (0.0, 0.0, 0.0)), dtype=np.float64),
                warnings=images.warnings,
            )
        )
    return tuple(found)


def _check_some_exist(files: tuple[Path, ...], key: str, where: object) -> None:
    """Refuse a camera without any image; the photolog names single ones that are missing."""
    if not any(file.is_file() for file in files):
        problem = f"none of its {len(files)} files exists, first {files[0]}" if files else "none has a time"
        raise InputError(f"{key} has no image: {problem}", where=where,
                         advice="check the folder and the names in the list")  # fmt: skip


def no_pairs_message(survey: Survey) -> tuple[str, ...]:
    """Return the line that says that the images make no pairs; none where they do, or where there are none."""
    if survey.has_pairs or not survey.single_cameras:
        return ()
    names = " and ".join(survey.single_cameras)
    return (f"{survey.name}: no stereo pairs (only {names} in [cameras]), so no lines from images: they are in the photolog",)  # fmt: skip
