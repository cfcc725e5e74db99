"""Run files: TOML with the settings of a run, checked against the settings' types and ranges."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from linework.files.documents import check_document, read_toml
from linework.model.settings import SettingsT

if TYPE_CHECKING:
    from pydantic import BaseModel


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
    checked = check_document(_model_of(cls), values, where=where)
    return _built(cls, checked.model_dump(exclude_unset=True))


def _built(cls: type[SettingsT], values: Mapping[str, Any]) -> SettingsT:
    groups: dict[str, Any] = {f.name: f.default_factory for f in dataclasses.fields(cls)}  # type: ignore[arg-type]
    return cls(**{
        name: _built(groups[name], value) if isinstance(value, dict) else value
        for name, value in values.items()
    })  # fmt: skip


def _model_of(cls: Any) -> type[BaseModel]:
    """Return the model of a settings dataclass: strict types, the settings' ranges, no other keys."""
    from pydantic import ConfigDict, create_model

    fields: dict[str, Any] = {}
    for f in dataclasses.fields(cls):
        if dataclasses.is_dataclass(f.default_factory):
            fields[f.name] = (_model_of(f.default_factory) | None, None)
        else:
            fields[f.name] = (_type_of(f), f.default)
    model: type[BaseModel] = create_model(cls.__name__, __config__=ConfigDict(extra="forbid"), **fields)
    return model


def _type_of(f: dataclasses.Field[Any]) -> Any:
    from pydantic import Field

    kind, low, high = type(f.default), f.metadata["low"], f.metadata["high"]
    bounds: dict[str, Any] = {}
    if kind is float:
        bounds = {"ge": low, "le": high}
    elif kind is int:
        bounds = {"ge": math.ceil(low)} if math.isfinite(low) else {}
        bounds |= {"le": math.floor(high)} if math.isfinite(high) else {}
    what = {float: "a number", int: "a whole number", bool: "true or false", str: "a text"}.get(
        kind, "another"
    )
    if math.isfinite(low) or math.isfinite(high):
        what += f" from {low:g} to {high:g}"
    return Annotated[kind, Field(strict=True, description=what, **bounds)]
