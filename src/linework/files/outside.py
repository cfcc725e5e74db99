"""Names in a survey.toml stay inside its folder, unless the caller allows others: anybody may have written it."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from linework.errors import ConfigError, argument

#: Keys of a survey.toml that name files: in tables of the first level, and of the second.
_NAMING = {
    "heights": ("geoid",),
    "points": ("files",),
    "trajectory": ("file", "times"),
    "navigation": ("gnss", "gyro", "wheels"),
    "gnss": ("base",),
    "events": ("file",),
}
_NAMING_OF_CAMERA = ("images", "times")
#: No system opens a file by a longer name; messages would hold all of it. [characters]
_LONGEST_PATH = 4096
_WILDCARDS = frozenset("*?[")


def check_names_inside(settings: Mapping[str, Any], where: Path) -> None:
    """Refuse names of files, or patterns, that lead out of the folder of a survey.toml; nothing is opened.

    Parameters
    ----------
    settings
        Content of the survey.toml.
    where
        The survey.toml.

    Raises
    ------
    ConfigError
        An absolute path, ``..``, a link that ends outside, or a name that is too long for any file.
    """
    real = os.path.realpath(where.parent)
    for key, name in _named(settings):
        if len(name) > _LONGEST_PATH:
            raise ConfigError(
                f"{key} names a file with {len(name):,} characters, at most {_LONGEST_PATH:,}", where=where,
                advice="correct the name",
            )  # fmt: skip
        parts = Path(name).parts
        n_plain = next((i for i, part in enumerate(parts) if _WILDCARDS & set(part)), len(parts))
        # A link may have such a name too
        is_there = os.path.lexists(where.parent / name)
        literal = where.parent.joinpath(*(parts if is_there else parts[:n_plain]))
        if ".." in parts[n_plain:] or not _is_inside(os.path.realpath(literal), real):
            raise _outside(key, name, where)


def check_files_inside(paths: Iterable[Path], key: str, where: Path) -> None:
    """Refuse files, found by a pattern or a list, that lie outside the folder of a survey.toml.

    Parameters
    ----------
    key
        The key of the survey.toml that led to them.
    where
        The survey.toml.

    Raises
    ------
    ConfigError
        One is outside, or a link that ends there.
    """
    real = os.path.realpath(where.parent)
    known: dict[str, bool] = {}
    for path in paths:
        folder, name = os.path.split(path)
        if folder not in known:
            known[folder] = _is_inside(os.path.realpath(folder), real)
        is_plain = name not in ("", "..") and not Path(path).is_symlink()
        if not known[folder] or not (is_plain or _is_inside(os.path.realpath(path), real)):
            raise _outside(key, str(path), where)


def _named(settings: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """Yield each key that names a file, and the name or pattern."""
    for table, keys in _NAMING.items():
        for key in keys:
            value = settings.get(table, {}).get(key)
            yield from ((f"{table}.{key}", name) for name in _texts(value))
    for side, camera in settings.get("cameras", {}).items():
        # This table is checked only when images are wanted
        for key in _NAMING_OF_CAMERA if isinstance(camera, Mapping) else ():
            yield from ((f"cameras.{side}.{key}", name) for name in _texts(camera.get(key)))


def _texts(value: Any) -> list[str]:
    return [text for text in (value if isinstance(value, list) else [value]) if isinstance(text, str)]


def _is_inside(real: str, folder: str) -> bool:
    return Path(real).is_relative_to(folder)


def _outside(key: str, name: str, where: Path) -> ConfigError:
    return ConfigError(
        f"{key}: '{name:.120}' is outside the folder of this survey.toml", where=where,
        advice=f"copy it there, or give {argument('allow_outside', True)} if you trust who wrote this file",
    )  # fmt: skip
