"""Run files: TOML with the settings of a run.

Separate from `linework.model.settings`, which checks the settings: only `files` opens files.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from linework.errors import UsageError, argument
from linework.files.documents import read_toml
from linework.model.settings import SettingsT, settings_from


def read_settings_file(cls: type[SettingsT], path: Path) -> SettingsT:
    """Return the settings in a run file; what it does not name keeps its default.

    Raises
    ------
    InputError
        Missing, or not a regular file.
    ConfigError
        Not TOML, an unknown key, another type, or a value out of its range; the message names the key.
    """
    return settings_from(cls, read_toml(path), where=path)


def settings_with(cls: type[SettingsT], path: Path | None, assignments: Sequence[str]) -> SettingsT:
    """Return the settings of a run file, if one is given, with single settings changed: "radon_2002.cell_m=0.1".

    Raises
    ------
    InputError, ConfigError
        As `read_settings_file`; for an assignment, too.
    UsageError
        An assignment is not NAME=VALUE.

    Examples
    --------
    >>> from linework.surface.config import RoadConfig
    >>> settings_with(RoadConfig, None, ["cell_m=1"]).cell_m
    1.0
    """
    values: dict[str, Any] = {} if path is None else dict(read_toml(path))
    settings = settings_from(cls, values, where=path)
    for assignment in assignments:
        name, is_one, text = assignment.partition("=")
        if not (name.strip() and is_one):
            raise UsageError(
                f"{assignment!r} is not a setting and its value",
                where=argument("set"),
                advice="write NAME=VALUE, such as radon_2002.cell_m=0.1",
            )
        values = _changed(values, name.strip().split("."), _value(text.strip()))
    # All together: some settings must agree
    return settings_from(cls, values, where=argument("set")) if assignments else settings


def _value(text: str) -> Any:
    """Return a value as TOML has it; what is not TOML is a number (.5), or a text."""
    try:
        return tomllib.loads(f"value = {text}")["value"]
    except tomllib.TOMLDecodeError:
        pass
    try:
        return float(text)
    except ValueError:
        return text


def _changed(values: Mapping[str, Any], names: Sequence[str], value: Any) -> dict[str, Any]:
    """Return nested tables with one value changed."""
    first, *rest = names
    if not rest:
        return {**values, first: value}
    inner = values.get(first, {})
    return {**values, first: _changed(inner if isinstance(inner, Mapping) else {}, rest, value)}
