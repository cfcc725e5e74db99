"""survey.toml: its keys, and what each of them must be."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field

from linework.files.documents import check_document, read_toml

#: Quaternions rounded to a few digits are within this of length 1; others are mistakes.
_QUATERNION_TOLERANCE = 0.01


def _unit(value: list[float]) -> list[float]:
    norm = math.sqrt(sum(v * v for v in value))
    if abs(norm - 1.0) > _QUATERNION_TOLERANCE:
        raise ValueError(f"a unit quaternion (this one has length {norm:.3f})")
    return value


_Text = Annotated[str, Field(min_length=1, description="a text")]
_Texts = Annotated[
    list[Annotated[str, Field(min_length=1)]],
    Field(min_length=1, description="a list of file names or patterns"),
]
_Number = Annotated[float, Field(description="a finite number")]
_Positive = Annotated[float, Field(gt=0, description="a number above 0")]
_Count = Annotated[int, Field(gt=0, description="a whole number above 0")]
_Numbers3 = Annotated[
    list[float], Field(min_length=3, max_length=3, description="a list of 3 finite numbers")
]
_Numbers5 = Annotated[
    list[float], Field(min_length=5, max_length=5, description="a list of 5 finite numbers")
]
_Quaternion = Annotated[
    list[float],
    Field(min_length=4, max_length=4, description="a list of 4 finite numbers"),
    AfterValidator(_unit),
]


class _Table(BaseModel):
    """A table of which every key is known."""

    model_config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False)


class _Time(_Table):
    epoch: Literal["gps_adjusted", "gps_week", "gps", "unix"] = Field(
        default="gps_adjusted", description="one of gps_adjusted, gps_week, gps, unix"
    )
    week: _Count = 1


class _Heights(_Table):
    geoid: str | float = Field(default=0.0, description="a text or a number")


class _Points(_Table):
    files: _Texts = []


class _Trajectory(_Table):
    file: _Text = ""
    times: _Text = ""
    rate_hz: _Positive = 1.0
    lever_m: _Numbers3 = []
    boresight_deg: _Numbers3 = []


class _Navigation(_Table):
    gnss: _Text = ""
    gyro: _Text = ""
    wheels: _Text = ""


class _Vehicle(_Table):
    tick_m: _Positive = 1.0
    track_m: _Positive = 1.0
    gnss_lever_m: _Numbers3 = []


class _Events(_Table):
    file: _Text = ""


class _Camera(_Table):
    images: _Text = ""
    times: _Text = ""
    rate_hz: _Positive = 1.0
    model: Literal["pinhole"] = Field(default="pinhole", description="one of pinhole")
    width: _Count = 1
    height: _Count = 1
    fx: _Positive = 1.0
    fy: _Positive = 1.0
    cx: _Number = 0.0
    cy: _Number = 0.0
    distortion: _Numbers5 = []
    position_m: _Numbers3 = []
    rotation_wxyz: _Quaternion = []


class _Cameras(_Table):
    left: _Camera | None = None
    right: _Camera | None = None


class _SurveyFile(_Table):
    name: _Text = ""
    crs: _Text = ""
    time: _Time | None = None
    heights: _Heights | None = None
    points: _Points | None = None
    trajectory: _Trajectory | None = None
    navigation: _Navigation | None = None
    vehicle: _Vehicle | None = None
    cameras: dict[str, Any] = Field(default={}, description="a table")
    events: _Events | None = None


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
    check_document(_SurveyFile, document, where=path)
    return document


def check_cameras(cameras: Mapping[str, Any], where: object) -> None:
    """Check the table [cameras]; called only when images are wanted, so that mistakes there stop nothing else.

    Raises
    ------
    ConfigError
        An unknown key, or a value of the wrong type or out of its range.
    """
    check_document(_Cameras, cameras, where=where, prefix="cameras.")
