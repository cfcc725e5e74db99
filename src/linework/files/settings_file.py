"""Run files: TOML with the settings of a run, checked against the settings' types and ranges."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from linework.files.documents import (
    Expectation,
    Table,
    check_document,
    expect,
    is_number,
    is_whole,
    read_toml,
)
from linework.model.settings import SettingsT

#: What a setting is called in messages, by its type, and what tells it. A number without a point is a number, too.
_TYPES: dict[type, tuple[str, Callable[[Any], bool]]] = {
    float: ("a number", is_number),
    int: ("a whole number", is_whole),
    bool: ("true or false", lambda value: isinstance(value, bool)),
    str: ("a text", lambda value: isinstance(value, str)),
}


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


def settings_from(cls: type[SettingsT], values: Mapping[str, Any], *, where: object = None) -> SettingsT:
    """Return the settings `cls` with these values; what is not given keeps its default.

    Raises
    ------
    ConfigError
        An unknown key, another type, or a value out of its range; the message names the key and the range.
    """
    check_document(_table_of(cls), values, where=where)
    return _built(cls, values)


def _built(cls: type[SettingsT], values: Mapping[str, Any]) -> SettingsT:
    """Return settings of checked values."""
    given: dict[str, Any] = {}
    for f in dataclasses.fields(cls):
        if f.name in values:
            value = values[f.name]
            group: Any = f.default_factory
            is_group = dataclasses.is_dataclass(group)
            given[f.name] = _built(group, value) if is_group else type(f.default)(value)
    return cls(**given)


def _table_of(cls: Any) -> Table:
    """Return what the values of a settings dataclass must be."""
    return {
        f.name: _table_of(f.default_factory) if dataclasses.is_dataclass(f.default_factory) else _expected(f)
        for f in dataclasses.fields(cls)
    }


def _expected(f: dataclasses.Field[Any]) -> Expectation:
    """Return what a setting must be: its type, and its range if it has one."""
    what, is_right = _TYPES[type(f.default)]
    low, high = f.metadata["low"], f.metadata["high"]
    if not isinstance(f.default, int | float) or isinstance(f.default, bool):
        return expect(what, is_right)
    if math.isfinite(low) or math.isfinite(high):
        what += f" from {low:g} to {high:g}"
    return expect(what, lambda value: is_right(value) and low <= value <= high)  # false for NaN
