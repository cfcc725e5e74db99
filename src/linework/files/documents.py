"""Check documents that people write (survey.toml, run files) against tables of what each key must be.

What is wrong is reported in one line: the file, the key, its value, what is expected, what to do.
"""

from __future__ import annotations

import json
import math
import re
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
#: Most digits in a row: as long as the longest name of a file, and less than a number of floating point can have (308).
_MOST_DIGITS = 255
#: Deepest tables, lists and keys with dots: the settings have three levels. Python's own limit is some hundred.
_MOST_LEVELS = 32
#: Texts and comments of TOML; one that does not end is taken to the end of its line, or of the file.
_TOML_TEXT = re.compile(
    r'''"""(?:\\.|[^\\])*?(?:"""|\Z)|\'{3}.*?(?:\'{3}|\Z)|"(?:\\.|[^"\\\n])*(?:"|$)|\'[^\'\n]*(?:\'|$)|\#[^\n]*''',
    re.DOTALL | re.MULTILINE,
)
_DOTTED = re.compile(rf"(?:[\w-]+[ \t]*\.[ \t]*){{{_MOST_LEVELS}}}")
_DIGITS = re.compile(rf"[0-9A-Fa-f_]{{{_MOST_DIGITS + 1}}}")
#: One half of a character beyond the first 65,536; without its other half no file or terminal takes it.
_SURROGATE = re.compile(r"\\u[dD][89a-fA-F]")
#: Whole numbers of JSON beyond 64 bits (sign and 19 digits) become floating-point numbers.
_LARGEST, _LONGEST_WHOLE = (1 << 63) - 1, 20


def read_toml(path: Path) -> dict[str, Any]:
    """Return the document in a TOML file.

    Raises
    ------
    InputError
        Missing, not a regular file, or too large.
    ConfigError
        Not TOML, with the line; or numbers and nesting beyond what is reasonable.
    """
    try:
        text = read_input_text(path, max_bytes=_MAX_TOML_BYTES, advice="check what this file is")
    except InputError as error:
        if isinstance(error.__cause__, UnicodeDecodeError):
            raise ConfigError(f"is not TOML: {error.problem}", where=path, advice=error.advice) from error
        raise
    _check_bounds(text, path)
    try:
        return tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        raise ConfigError(f"is not TOML: {error}", where=path, advice="correct that place") from error


def _check_bounds(text: str, path: Path) -> None:
    """Refuse what would cost a parser its stack or its time, with the line."""
    bare = _TOML_TEXT.sub(_same_lines, text)
    for number, line in enumerate(bare.split("\n"), start=1):
        if _DIGITS.search(line):
            raise ConfigError(
                f"a number of more than {_MOST_DIGITS} digits in line {number}",
                where=path,
                advice="correct it",
            )
        if _DOTTED.search(line):
            raise _too_deep(number, path)
    level, number = 0, 1
    for mark in re.finditer(r"[\[{}\]\n]", bare):
        number += mark[0] == "\n"
        level += (mark[0] in "[{") - (mark[0] in "]}")
        if level > _MOST_LEVELS:
            raise _too_deep(number, path)


def _too_deep(number: int, path: Path) -> ConfigError:
    return ConfigError(
        f"nested more than {_MOST_LEVELS} levels deep in line {number}", where=path, advice="correct it"
    )


def _same_lines(found: re.Match[str]) -> str:
    """Return what stands for a text or a comment: nothing but its line ends."""
    return "_" + "\n" * found[0].count("\n")


def read_json(text: str, where: object) -> Any:
    """Return the value in a JSON text that may come from anywhere.

    Raises
    ------
    InputError
        Not JSON, or nested too deeply.
    """
    try:
        value = json.loads(text, parse_int=_number)
        if _SURROGATE.search(text):
            json.dumps(value, ensure_ascii=False).encode()
    except (ValueError, RecursionError) as error:
        what = "nested too deeply" if isinstance(error, RecursionError) else str(error)[:120]
        if isinstance(error, UnicodeEncodeError):
            what = "half of a character (a lone surrogate) in a text"
        raise InputError(f"is not JSON: {what}", where=where, advice="copy the file again") from error
    return value


def _number(text: str) -> int | float:
    is_small = len(text) <= _LONGEST_WHOLE and -_LARGEST <= int(text) <= _LARGEST
    return int(text) if is_small else float(text)


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
                f"{name} is {value!r:.80}, expected {expected}", where=where, advice="correct the value"
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
