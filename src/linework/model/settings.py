"""Settings: frozen dataclasses beside their steps, each field with unit, default, range and reason."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from typing import Any, TypeVar

from linework.errors import ConfigError

SettingsT = TypeVar("SettingsT")
_ADVICE = "linework config prints every setting with its unit"


def setting(default: Any, *, unit: str, reason: str, low: float = -math.inf, high: float = math.inf) -> Any:
    """Return a dataclass field with its unit, its reason and the range it must lie in."""
    return dataclasses.field(
        default=default, metadata={"unit": unit, "reason": reason, "low": low, "high": high}
    )


def group(cls: type[SettingsT]) -> Any:
    """Return a dataclass field that holds a group of settings with its own defaults."""
    return dataclasses.field(default_factory=cls)


def settings_from(
    cls: type[SettingsT], values: Mapping[str, Any], *, where: object = None, prefix: str = ""
) -> SettingsT:
    """Build the settings `cls` from a parsed TOML table; what is not given keeps its default.

    Raises
    ------
    ConfigError
        Unknown key, wrong type, or a value out of its range; the message names the key and the range.
    """
    known = {f.name: f for f in dataclasses.fields(cls)}  # type: ignore[arg-type]
    arguments: dict[str, Any] = {}
    for key, value in values.items():
        if key not in known:
            raise ConfigError(
                f"unknown setting {prefix}{key}",
                where=where,
                advice=f"known here: {', '.join(sorted(known))}",
            )
        f = known[key]
        if dataclasses.is_dataclass(f.default_factory):
            if not isinstance(value, Mapping):
                raise ConfigError(
                    f"{prefix}{key} is {value!r}, expected a table", where=where, advice=_ADVICE
                )
            arguments[key] = settings_from(f.default_factory, value, where=where, prefix=f"{prefix}{key}.")
        else:
            arguments[key] = _checked_value(f, value, where, prefix)
    return cls(**arguments)


def _checked_value(f: dataclasses.Field[Any], value: Any, where: object, prefix: str) -> Any:
    kind = type(f.default)
    number = isinstance(value, int | float) and not isinstance(value, bool)
    if kind is float and number:
        value = float(value)
    if type(value) is not kind:
        raise ConfigError(
            f"{prefix}{f.name} is {value!r}, expected a {kind.__name__}", where=where, advice=_ADVICE
        )
    low, high = f.metadata["low"], f.metadata["high"]
    if number and not low <= value <= high:
        raise ConfigError(
            f"{prefix}{f.name} is {value!r}, allowed is {low:g} to {high:g}", where=where, advice=_ADVICE
        )
    return value


def settings_toml(settings: Any, prefix: str = "") -> str:
    """Return settings as TOML text, every field with its unit and reason as a comment."""
    own, nested = [], []
    for f in dataclasses.fields(settings):
        value = getattr(settings, f.name)
        if dataclasses.is_dataclass(value):
            nested.append(f"\n[{prefix}{f.name}]\n" + settings_toml(value, f"{prefix}{f.name}."))
        else:
            text = (
                str(value).lower()
                if isinstance(value, bool)
                else f'"{value}"'
                if isinstance(value, str)
                else repr(value)
            )
            own.append(f"{f.name} = {text}  # [{f.metadata['unit']}] {f.metadata['reason']}\n")
    return "".join(own + nested)
