"""survey.toml: read, and every key checked."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from linework.errors import ConfigError
from linework.files.input import regular_file_bytes

#: A survey.toml is a page; a megabyte is something else.
_MAX_BYTES = 1 << 20

_Check = Callable[[Any], str]


def _text(value: Any) -> str:
    return "" if isinstance(value, str) and value else "a text"


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _number(value: Any) -> str:
    return "" if _is_number(value) else "a finite number"


def _positive(value: Any) -> str:
    return "" if _is_number(value) and value > 0 else "a number above 0"


def _count(value: Any) -> str:
    whole = isinstance(value, int) and not isinstance(value, bool)
    return "" if whole and value > 0 else "a whole number above 0"


def _text_or_number(value: Any) -> str:
    return "" if not _text(value) or not _number(value) else "a text or a number"


def _texts(value: Any) -> str:
    good = isinstance(value, list) and value and not any(_text(v) for v in value)
    return "" if good else "a list of file names or patterns"


def _numbers(n: int) -> _Check:
    def check(value: Any) -> str:
        good = isinstance(value, list) and len(value) == n and all(_is_number(v) for v in value)
        return "" if good else f"a list of {n} finite numbers"

    return check


def _one_of(*allowed: str) -> _Check:
    return lambda value: "" if value in allowed else "one of " + ", ".join(allowed)


def _unit_quaternion(value: Any) -> str:
    wrong = _numbers(4)(value)
    if wrong:
        return wrong
    norm = math.sqrt(sum(v * v for v in value))
    # Rounded to a few digits is meant, anything else is a mistake (the manual says 1 %).
    return "" if abs(norm - 1.0) <= 0.01 else f"a unit quaternion (this one has length {norm:.3f})"


def _table(value: Any) -> str:
    return "" if isinstance(value, dict) else "a table"


_CAMERA = {
    "images": _text, "times": _text, "rate_hz": _positive, "model": _one_of("pinhole"),
    "width": _count, "height": _count, "fx": _positive, "fy": _positive, "cx": _number, "cy": _number, "distortion": _numbers(5),
    "position_m": _numbers(3), "rotation_wxyz": _unit_quaternion,
}  # fmt: skip
_KEYS: dict[str, Any] = {
    "name": _text,
    "crs": _text,
    "time": {"epoch": _one_of("gps_adjusted", "gps_week", "gps", "unix"), "week": _count},
    "heights": {"geoid": _text_or_number},
    "points": {"files": _texts},
    "trajectory": {
        "file": _text,
        "times": _text,
        "rate_hz": _positive,
        "lever_m": _numbers(3),
        "boresight_deg": _numbers(3),
    },
    "navigation": {"gnss": _text, "gyro": _text, "wheels": _text},
    "vehicle": {"tick_m": _positive, "track_m": _positive, "gnss_lever_m": _numbers(3)},
    "cameras": _table,
    "events": {"file": _text},
}


def read_survey_file(path: Path) -> dict[str, Any]:
    """Read a survey.toml; every key is known and of the right type, but for those of cameras (`check_cameras`).

    Raises
    ------
    InputError
        Not a regular file.
    ConfigError
        No TOML, an unknown key (the known ones are named), or a value of the wrong type.
    """
    n_bytes = regular_file_bytes(path)
    if n_bytes > _MAX_BYTES:
        raise ConfigError(f"{n_bytes:,} bytes, a survey.toml has at most {_MAX_BYTES:,}", where=path)
    try:
        document = tomllib.loads(path.read_text(encoding="utf-8-sig"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError, RecursionError) as error:
        raise ConfigError(f"is not TOML: {error}", where=path, advice="correct that place") from error
    _check(document, _KEYS, "", path)
    return document


def check_cameras(cameras: Mapping[str, Any], where: object) -> None:
    """Check the table [cameras], when its images are wanted: what is wrong there stops nothing else.

    Raises
    ------
    ConfigError
        An unknown key, or a value of the wrong type or out of its range.
    """
    _check(cameras, {"left": _CAMERA, "right": _CAMERA}, "cameras.", where)


def _check(values: Mapping[str, Any], known: Mapping[str, Any], prefix: str, path: object) -> None:
    for key, value in values.items():
        name = prefix + key
        if key not in known:
            raise ConfigError(f"unknown key {name}", where=path, advice=f"known here: {', '.join(known)}")
        expected = known[key]
        if isinstance(expected, dict):
            if not isinstance(value, dict):
                raise ConfigError(f"{name} is {value!r}, expected a table [{name}]", where=path,
                                  advice="see the manual")  # fmt: skip
            _check(value, expected, f"{name}.", path)
        elif wrong := expected(value):
            raise ConfigError(
                f"{name} is {value!r}, expected {wrong}", where=path, advice="correct the value"
            )
