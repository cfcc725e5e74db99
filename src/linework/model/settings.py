"""Settings: frozen dataclasses beside their steps, each field with unit, default, range and reason."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from numbers import Integral, Real
from typing import Any, TypeVar

from linework.errors import ConfigError, did_you_mean

SettingsT = TypeVar("SettingsT", bound="Settings")
#: What a value must be, by the type of the default.
_EXPECTED = {float: "a number", int: "a whole number", bool: "true or false", str: "a text"}


class Settings:
    """Base class of the settings of a step; values that cannot be are refused when they are made.

    Examples
    --------
    >>> from linework.surface.config import RoadConfig
    >>> RoadConfig(cell_m=-1)
    Traceback (most recent call last):
    linework.errors.ConfigError: RoadConfig: cell_m is -1, expected a number from 0.05 to 5 [m]. Correct the value.
    """

    __slots__ = ()

    def __post_init__(self) -> None:
        """Check every value, and take numbers of other libraries as numbers of Python."""
        for field in dataclasses.fields(self):  # type: ignore[arg-type]
            value = getattr(self, field.name)
            checked = _checked(field, value, name=field.name, where=type(self).__name__)
            if checked is not value:
                object.__setattr__(self, field.name, checked)


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
    """Return the settings `cls` with these values; what is not given keeps its default.

    Parameters
    ----------
    values
        As in a run file: values by name, and a mapping for each group of settings.
    where
        The file or parameter that messages name.
    prefix
        Put before the names in messages: "radon.".

    Raises
    ------
    ConfigError
        An unknown setting, another type, or a value out of its range; the message names the setting and the range.

    Examples
    --------
    >>> from linework.surface.config import RoadConfig
    >>> settings_from(RoadConfig, {"cell_m": 1}).cell_m
    1.0
    >>> settings_from(RoadConfig, {"cel_m": 1}, where="run.toml")
    Traceback (most recent call last):
    linework.errors.ConfigError: run.toml: unknown key cel_m. Did you mean cell_m? Known here: cell_m, support_m, ...
    """
    fields = {field.name: field for field in dataclasses.fields(cls)}  # type: ignore[arg-type]
    checked: dict[str, Any] = {}
    for key, value in values.items():
        if key not in fields:
            problem = f"unknown key {prefix}{key}" + did_you_mean([str(key)], fields)
            raise ConfigError(problem, where=where, advice=f"known here: {', '.join(fields)}")
        factory: Any = fields[key].default_factory
        if isinstance(factory, type) and isinstance(value, Mapping):
            checked[key] = settings_from(factory, value, where=where, prefix=f"{prefix}{key}.")
        else:
            checked[key] = _checked(fields[key], value, name=prefix + key, where=where)
    return cls(**checked)


def _checked(field: dataclasses.Field[Any], value: Any, *, name: str, where: object) -> Any:
    """Return a value of a setting in the type of its default.

    Raises
    ------
    ConfigError
        Another type, not finite, or out of the range.
    """
    if dataclasses.is_dataclass(field.default_factory):
        group_type: Any = field.default_factory
        if isinstance(value, group_type):
            return value
        expected = f"a table [{name}] ({group_type.__name__})"
        raise ConfigError(
            f"{name} is {value!r:.80}, expected {expected}", where=where, advice="correct the value"
        )
    kind, low, high = type(field.default), field.metadata["low"], field.metadata["high"]
    if kind is float and isinstance(value, Real) and not isinstance(value, bool):
        if math.isfinite(value) and low <= value <= high:
            return float(value)
    elif kind is int and isinstance(value, Integral) and not isinstance(value, bool):
        if low <= value <= high:
            return int(value)
    elif kind in (bool, str) and isinstance(value, kind):
        return value
    expected = _EXPECTED[kind]
    if math.isfinite(low) or math.isfinite(high):
        unit = field.metadata["unit"]
        expected += f" from {low:g} to {high:g}" + (f" [{unit}]" if unit else "")
    shown = str(value) if isinstance(value, Real) else f"{value!r:.80}"
    raise ConfigError(f"{name} is {shown}, expected {expected}", where=where, advice="correct the value")


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
