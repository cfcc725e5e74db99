"""Settings: frozen dataclasses beside their steps, each field with unit, default, range and reason."""

from __future__ import annotations

import dataclasses
import math
from typing import Any, TypeVar

SettingsT = TypeVar("SettingsT")


def setting(default: Any, *, unit: str, reason: str, low: float = -math.inf, high: float = math.inf) -> Any:
    """Return a dataclass field with its unit, its reason and the range it must lie in."""
    return dataclasses.field(
        default=default, metadata={"unit": unit, "reason": reason, "low": low, "high": high}
    )


def group(cls: type[SettingsT]) -> Any:
    """Return a dataclass field that holds a group of settings with its own defaults."""
    return dataclasses.field(default_factory=cls)


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
