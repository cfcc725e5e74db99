"""What the run and its decoding process tell each other: a line of JSON per message.

To the process: a task. From it, once, ``{"ready": true}``, and before its first points are written
``{"loading": true}``: the kernels may have to be compiled. While a file is decoded, ``{"read": points so far}``;
at its end one of ``{"done": ...}``, ``{"refused": an error of the file or the machine}``, ``{"died": why it
cannot go on}`` and ``{"fault": traceback of a fault of ours}``.
"""

from __future__ import annotations

import base64
import json
import os
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Self

import numpy as np

from linework.arrays import AnyArray, FloatArray
from linework.errors import InputError, LineworkError, MachineError
from linework.files.las.batches import BATCH_POINTS
from linework.files.las.tally import TimeCounts, TimeKind
from linework.files.store.layout import RunTable

_ERRORS: dict[str, type[LineworkError]] = {e.__name__: e for e in (InputError, MachineError)}


@dataclass(frozen=True, slots=True, kw_only=True)
class DecodeTask:
    """One file to be decoded.

    Parameters
    ----------
    path, target
        Laser file, and the file of the tile store to make of it.
    factors
        Metres per unit of the file, in plan and in height.
    sample_step
        Of the points used, every so many-th is a sample.
    repeat_bits
        How thinly points are sampled to find those that are there twice, see `linework.files.las.repeats`.
    is_sequential
        Decode on one thread, chunk after chunk.
    """

    path: Path
    target: Path
    factors: tuple[float, float] = (1.0, 1.0)
    sample_step: int = 1
    repeat_bits: int = 0
    batch_points: int = BATCH_POINTS
    is_sequential: bool = False

    def to_line(self) -> bytes:
        """Return it as a line of JSON."""
        return message_line(asdict(self) | {"path": os.fspath(self.path), "target": os.fspath(self.target)})

    @classmethod
    def from_line(cls, line: bytes) -> Self:
        """Read what `to_line` returned."""
        document = json.loads(line)
        horizontal, vertical = document.pop("factors")
        path, target = Path(document.pop("path")), Path(document.pop("target"))
        return cls(path=path, target=target, factors=(horizontal, vertical), **document)


@dataclass(frozen=True, slots=True, kw_only=True)
class Decoded:
    """What came of a file that was decoded.

    Parameters
    ----------
    n_points, n_rejected
        Points written, and points left out by reason.
    low, high
        (3,) float64 [m]: extent of the points written.
    height_counts
        Points by bucket of height.
    times
        Points written by time; empty where the file has no time.
    in_time_order
        Whether the times never run backwards.
    sample
        (k, 3) float64 [m]: some of the points; None where they cannot be degrees.
    repeats
        (k,) uint64: the sample that tells points that are there twice.
    runs
        Where the points lie in the file written.
    warnings
        What is odd about the points.
    """

    n_points: int
    n_rejected: Mapping[str, int]
    low: tuple[float, float, float]
    high: tuple[float, float, float]
    height_counts: Mapping[int, int]
    gps_time_kind: TimeKind
    has_intensity: bool
    times: TimeCounts
    in_time_order: bool
    sample: FloatArray | None
    repeats: AnyArray
    runs: RunTable
    warnings: tuple[str, ...]

    def to_document(self) -> dict[str, Any]:
        """Return it as JSON."""
        fields = {name: getattr(self, name) for name in self.__dataclass_fields__}
        sample = None if self.sample is None else _text(self.sample.tobytes())
        repeats = _text(self.repeats.tobytes())
        own = {"times": self.times.to_document(), "runs": _text(self.runs.to_bytes()), "sample": sample}
        return fields | own | {"repeats": repeats}

    @classmethod
    def from_document(cls, document: Mapping[str, Any]) -> Self:
        """Read what `to_document` returned."""
        sample = document["sample"]
        own = {
            "low": tuple(document["low"]),
            "high": tuple(document["high"]),
            "height_counts": {int(bucket): n for bucket, n in document["height_counts"].items()},
            "times": TimeCounts.from_document(document["times"]),
            "sample": None if sample is None else np.frombuffer(_data(sample)).reshape(-1, 3),
            "repeats": np.frombuffer(_data(document["repeats"]), np.uint64),
            "runs": RunTable.from_bytes(_data(document["runs"])),
            "warnings": tuple(document["warnings"]),
        }
        return cls(**(dict(document) | own))


def message_line(message: Mapping[str, Any]) -> bytes:
    """Return a message as it goes over the pipe; file names that are no text survive it."""
    return json.dumps(message).encode("ascii") + b"\n"


def error_message(error: LineworkError) -> dict[str, Any]:
    """Return an error as a message."""
    kind = next(name for name, leaf in _ERRORS.items() if isinstance(error, leaf))
    where = None if error.where is None else str(error.where)
    return {"kind": kind, "problem": error.problem, "where": where, "advice": error.advice}


def error_from_message(document: Mapping[str, Any]) -> LineworkError:
    """Return the error a message tells of."""
    fields = dict(document)
    return _ERRORS[fields.pop("kind")](fields.pop("problem"), **fields)


def _text(data: bytes) -> str:
    return base64.b64encode(data).decode("ascii")


def _data(text: str) -> bytes:
    return base64.b64decode(text)
