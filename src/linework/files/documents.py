"""Check documents that people or other programs write (survey.toml, run files, run.json) against pydantic models.

What is wrong is reported in one line: the file, the key, its value, what is expected, what to do.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from linework.errors import ConfigError, InputError
from linework.files.input import read_input_text

if TYPE_CHECKING:
    from pydantic import BaseModel

ModelT = TypeVar("ModelT", bound="BaseModel")
#: A TOML file written by hand is a page or two; a megabyte is something else.
_MAX_TOML_BYTES = 1 << 20


def read_toml(path: Path) -> dict[str, Any]:
    """Return the document in a TOML file.

    Raises
    ------
    InputError
        Missing, not a regular file, or too large.
    ConfigError
        Not TOML; with the line.
    """
    try:
        text = read_input_text(path, max_bytes=_MAX_TOML_BYTES, advice="check what this file is")
        return tomllib.loads(text)
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        raise ConfigError(f"is not TOML: {error}", where=path, advice="correct that place") from error
    except InputError as error:
        if isinstance(error.__cause__, UnicodeDecodeError):
            raise ConfigError(f"is not TOML: {error.problem}", where=path, advice=error.advice) from error
        raise


def check_document(
    model: type[ModelT], document: Mapping[str, Any], *, where: object, prefix: str = ""
) -> ModelT:
    """Return a document as its model.

    Parameters
    ----------
    model
        Its fields' descriptions say what is expected ("a number above 0").
    prefix
        Put before the keys in messages: "cameras.".

    Raises
    ------
    ConfigError
        An unknown key (the known ones are listed), or a value of another type or out of its range.
    """
    from pydantic import ValidationError

    try:
        return model.model_validate(document)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        raise _config_error(model, document, first, where, prefix) from error


def _config_error(
    model: type[BaseModel], document: Mapping[str, Any], first: Any, where: object, prefix: str
) -> ConfigError:
    """Return what the first error of a validation says, about the innermost key that the models know."""
    value: Any = document
    names: list[str] = []
    table: type[BaseModel] | None = model
    expected = "a table"
    for part in first["loc"]:
        if table is None or not isinstance(value, Mapping):
            break
        names.append(str(part))
        name = prefix + ".".join(names)
        if part not in table.model_fields:
            known = ", ".join(table.model_fields)
            return ConfigError(f"unknown key {name}", where=where, advice=f"known here: {known}")
        field, value = table.model_fields[part], value.get(part)
        table = _table_of(field.annotation)
        expected = field.description or f"a table [{name}]"
    name = prefix + ".".join(names)
    if "error" in first.get("ctx", {}):
        expected = str(first["ctx"]["error"])
    return ConfigError(f"{name} is {value!r}, expected {expected}", where=where, advice="correct the value")


def _table_of(annotation: Any) -> type[BaseModel] | None:
    """Return the model of a nested table, or None for values."""
    from typing import get_args

    from pydantic import BaseModel

    for kind in (annotation, *get_args(annotation)):
        if isinstance(kind, type) and issubclass(kind, BaseModel):
            return kind
    return None
