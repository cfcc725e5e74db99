"""Check documents that people write (survey.toml, run files) against tables of what each key must be.

What is wrong is reported in one line: the file, the key, its value, what is expected, what to do.
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, TypeAlias

from linework.errors import ConfigError, InputError
from linework.files.input import read_input_text

#: Says what is expected instead of a value ("a number above 0"); "" if the value is right.
Expectation: TypeAlias = Callable[[Any], str]
#: The keys of a table, and what their values must be: a value, or a table.
Table: TypeAlias = "Mapping[str, Expectation | Table]"

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


def check_document(table: Table, document: Mapping[str, Any], *, where: object, prefix: str = "") -> None:
    """Check a document against what its keys must be; no key is required.

    Parameters
    ----------
    prefix
        Put before the keys in messages: "cameras.".

    Raises
    ------
    ConfigError
        An unknown key (the known ones are listed), or a value of another type or out of its range.

    Examples
    --------
    >>> table = {"width": expect("a number above 0", lambda value: is_finite(value) and value > 0)}
    >>> check_document(table, {"width": 2}, where="a.toml")
    >>> check_document(table, {"width": True}, where="a.toml")
    Traceback (most recent call last):
        ...
    linework.errors.ConfigError: a.toml: width is True, expected a number above 0. Correct the value.
    """
    for key, expectation in table.items():
        if key not in document:
            continue
        name, value = prefix + key, document[key]
        if isinstance(expectation, Mapping):
            if isinstance(value, Mapping):
                check_document(expectation, value, where=where, prefix=f"{name}.")
                continue
            expected = f"a table [{name}]"
        else:
            expected = expectation(value)
        if expected:
            raise ConfigError(
                f"{name} is {value!r}, expected {expected}", where=where, advice="correct the value"
            )
    for key in document:
        if key not in table:
            known = ", ".join(table)
            raise ConfigError(f"unknown key {prefix}{key}", where=where, advice=f"known here: {known}")


# What a value must be


def expect(what: str, is_right: Callable[[Any], bool]) -> Expectation:
    """Return the expectation of a value for which `is_right` holds, called `what` in messages."""
    return lambda value: "" if is_right(value) else what


def is_text(value: Any) -> bool:
    """Return whether a value is a text that is not empty."""
    return isinstance(value, str) and value != ""


def is_number(value: Any) -> bool:
    """Return whether a value is a number; true and false are not."""
    return isinstance(value, int | float) and not isinstance(value, bool)


def is_finite(value: Any) -> bool:
    """Return whether a value is a number, neither infinite nor NaN."""
    return is_number(value) and math.isfinite(value)


def is_whole(value: Any) -> bool:
    """Return whether a value is a whole number; 2.0 is not."""
    return isinstance(value, int) and not isinstance(value, bool)


def is_list_of(value: Any, is_right: Callable[[Any], bool], n: int | None = None) -> bool:
    """Return whether a value is a list, of `n` or of at least one, each of which is right."""
    is_long_enough = isinstance(value, list) and (len(value) == n if n is not None else len(value) > 0)
    return is_long_enough and all(is_right(item) for item in value)
