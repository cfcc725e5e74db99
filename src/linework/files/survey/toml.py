"""survey.toml: its keys, and what each of them must be."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from linework.files.documents import (
    Table,
    check_document,
    expect,
    is_finite,
    is_list_of,
    is_text,
    is_whole,
    read_toml,
)

#: Quaternions rounded to a few digits are within this of length 1; others are mistakes.
_QUATERNION_TOLERANCE = 0.01

_TEXT = expect("a text", is_text)
_TEXTS = expect("a list of file names or patterns", lambda value: is_list_of(value, is_text))
_NUMBER = expect("a finite number", is_finite)
_POSITIVE = expect("a number above 0", lambda value: is_finite(value) and value > 0)
_COUNT = expect("a whole number above 0", lambda value: is_whole(value) and value > 0)
_NUMBERS_3 = expect("a list of 3 finite numbers", lambda value: is_list_of(value, is_finite, 3))
_NUMBERS_5 = expect("a list of 5 finite numbers", lambda value: is_list_of(value, is_finite, 5))
_PLACE = expect(
    "latitude (-90 to 90), longitude (-360 to 360) and height",
    lambda value: is_list_of(value, is_finite, 3) and abs(value[0]) <= 90.0 and abs(value[1]) <= 360.0,
)
_TABLE = expect("a table", lambda value: isinstance(value, dict))


def _one_of(*names: str) -> Any:
    return expect(f"one of {', '.join(names)}", lambda value: isinstance(value, str) and value in names)


def _quaternion(value: Any) -> str:
    if not is_list_of(value, is_finite, 4):
        return "a list of 4 finite numbers"
    length = math.sqrt(sum(v * v for v in value))
    is_unit = abs(length - 1.0) <= _QUATERNION_TOLERANCE
    return "" if is_unit else f"a unit quaternion (this one has length {length:.3f})"


#: Most keys, and longest name of one: four rows of six on a screen of 1024 x 600, each as large as a thumb.
_MOST_KEYS, _LONGEST_KEY = 24, 40


def _keys(value: Any) -> str:
    """Say what [[live.keys]] must be: "" if it is."""
    if not isinstance(value, list) or not all(isinstance(table, dict) for table in value):
        return "tables [[live.keys]]"
    if len(value) > _MOST_KEYS:
        return f"at most {_MOST_KEYS} keys"
    for table in value:
        if set(table) - {"name", "kind"}:
            return f"only name and kind in [[live.keys]], not {sorted(set(table) - {'name', 'kind'})[0]:.40}"
        name = table.get("name")
        if not isinstance(name, str) or not 0 < len(name.strip()) <= _LONGEST_KEY or not name.isprintable():
            return f"a name of 1 to {_LONGEST_KEY} characters for each key"
        if table.get("kind", "point") not in ("point", "span"):
            return 'kind = "point" or "span" for each key'
    names = [table["name"] for table in value]
    return "" if len(set(names)) == len(names) else "a name of its own for each key"


_CAMERA: Table = {
    "images": _TEXT,
    "times": _TEXT,
    "rate_hz": _POSITIVE,
    "time_offset_s": _NUMBER,
    "model": _one_of("pinhole"),
    "width": _COUNT,
    "height": _COUNT,
    "fx": _POSITIVE,
    "fy": _POSITIVE,
    "cx": _NUMBER,
    "cy": _NUMBER,
    "distortion": _NUMBERS_5,
    "position_m": _NUMBERS_3,
    "rotation_wxyz": _quaternion,
}
_SURVEY: Table = {
    "name": _TEXT,
    "crs": _TEXT,
    "time": {"epoch": _one_of("gps_adjusted", "gps_week", "gps", "unix"), "week": _COUNT},
    "heights": {
        "geoid": expect("a text or a number", lambda value: isinstance(value, str) or is_finite(value))
    },
    "points": {"files": _TEXTS, "keep_noise": expect("true or false", lambda value: isinstance(value, bool))},
    "trajectory": {
        "file": _TEXT,
        "times": _TEXT,
        "rate_hz": _POSITIVE,
        "lever_m": _NUMBERS_3,
        "boresight_deg": _NUMBERS_3,
    },
    "navigation": {"gnss": _TEXT, "gyro": _TEXT, "wheels": _TEXT},
    "gnss": {"base": _TEXT, "base_m": _NUMBERS_3, "base_deg": _PLACE},
    "vehicle": {
        "tick_m": _POSITIVE,
        "track_m": _POSITIVE,
        "axle": _one_of("rear", "front"),
        "wheelbase_m": _POSITIVE,
        "gnss_lever_m": _NUMBERS_3,
    },
    "cameras": _TABLE,
    "events": {"file": _TEXT},
    "live": {"keys": _keys},
}


def read_survey_file(path: Path) -> dict[str, Any]:
    """Return the content of a survey.toml; all keys are checked except those of cameras (`check_cameras`).

    Raises
    ------
    InputError
        Missing, not a regular file, or larger than a megabyte.
    ConfigError
        Not TOML, an unknown key (the known ones are listed), or a value of the wrong type.
    """
    document = read_toml(path)
    check_document(_SURVEY, document, where=path)
    return document


def check_cameras(cameras: Mapping[str, Any], where: object) -> None:
    """Check the table [cameras]; called only when images are wanted, so that mistakes there stop nothing else.

    Raises
    ------
    ConfigError
        An unknown key, or a value of the wrong type or out of its range.
    """
    known: Table = {"left": _CAMERA, "right": _CAMERA, "video": _CAMERA}
    check_document(known, cameras, where=where, prefix="cameras.")
