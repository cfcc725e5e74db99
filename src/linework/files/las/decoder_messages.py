"""Messages between a run and its decoding process, as JSON.

JSON and not pickles: what a damaged file may have broken is not to be trusted, and JSON can be wrong but never code.

To the process goes a `DecodeTask`. From it comes once ``{"ready": true}``, and before its first points are written
``{"loading": true}``: the kernels may have to be compiled. While a file is decoded, ``{"read": points so far}``;
at its end one of ``{"done": Decoded}``, ``{"refused": an error of the file or the machine}``, ``{"died": why it
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

#: Errors that a decoding process may report, by name.
_ERRORS: dict[str, type[LineworkError]] = {e.__name__: e for e in (InputError, MachineError)}


@dataclass(frozen=True, slots=True, kw_only=True)
class DecodeTask:
    """Task to decode one file.

    Parameters
    ----------
    path, target
        Laser file, and the file of the tile store to write.
    factors
        Metres per unit of the file, in plan and in height.
    carry
        Names of the further columns to write, in their order.
    sample_step
        Every `sample_step`-th of the points used is part of the sample.
    repeat_bits
        How sparsely points are sampled to find duplicates, see `linework.files.las.repeats`.
    batch_points
        Points decoded at a time.
    is_sequential
        Decode on one thread, chunk after chunk.
    keeps_noise
        Use points of noise classes.
    continues_week
        Continue seconds of the week that begin anew at 0 past the end of the week before.
    finds_laser
        Write nothing: say which of `carry` has the laser of a spinning scanner, by the first batch.
    """

    path: Path
    target: Path
    factors: tuple[float, float] = (1.0, 1.0)
    carry: tuple[str, ...] = ()
    sample_step: int = 1
    repeat_bits: int = 0
    batch_points: int = BATCH_POINTS
    is_sequential: bool = False
    keeps_noise: bool = False
    continues_week: bool = False
    finds_laser: bool = False

    def to_message(self) -> bytes:
        """Return it as a message."""
        return json_message(asdict(self) | {"path": os.fspath(self.path), "target": os.fspath(self.target)})

    @classmethod
    def from_message(cls, message: bytes) -> Self:
        """Return the task of a message made by `to_message`."""
        document = json.loads(message)
        horizontal, vertical = document.pop("factors")
        path, target, carry = Path(document.pop("path")), Path(document.pop("target")), document.pop("carry")
        return cls(path=path, target=target, factors=(horizontal, vertical), carry=tuple(carry), **document)


@dataclass(frozen=True, slots=True, kw_only=True)
class Decoded:
    """Result of decoding a file.

    Parameters
    ----------
    n_points, n_rejected
        Number of points written, and of points left out, by reason.
    low, high
        East, north, up: extent of the points written. [m]
    height_counts
        Number of points by height bucket.
    gps_time_kind, has_intensity
        What the file records beside coordinates.
    times
        Number of points written by time; empty where the file has no time.
    in_time_order
        Whether the times never run backwards.
    sample
        (k, 3) float64: some of the points [m]; None where they cannot be degrees.
    repeats
        (k,) uint64: sample of hashes by which duplicates in other files are found.
    runs
        Where the points lie in the file written.
    warnings
        One line each about the points.
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
        """Return it as a JSON object."""
        fields = {name: getattr(self, name) for name in self.__dataclass_fields__}
        sample = None if self.sample is None else _text(self.sample.tobytes())
        repeats = _text(self.repeats.tobytes())
        own = {"times": self.times.to_document(), "runs": _text(self.runs.to_bytes()), "sample": sample}
        return fields | own | {"repeats": repeats}

    @classmethod
    def from_document(cls, document: Mapping[str, Any]) -> Self:
        """Return the result of an object made by `to_document`.

        Raises
        ------
        AttributeError, KeyError, TypeError, ValueError
            It was not made by `to_document`.
        """
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


def json_message(message: Mapping[str, Any]) -> bytes:
    """Return an object as JSON; file names that are not valid text survive it (surrogates, escaped)."""
    return json.dumps(message).encode("ascii")


def error_message(error: LineworkError) -> dict[str, Any]:
    """Return an error as a JSON object, for `error_from_message` to read."""
    kind = next(name for name, leaf in _ERRORS.items() if isinstance(error, leaf))
    where = None if error.where is None else str(error.where)
    return {"kind": kind, "problem": error.problem, "where": where, "advice": error.advice}


def error_from_message(document: Mapping[str, Any]) -> LineworkError:
    """Return the error that `error_message` made an object of."""
    fields = dict(document)
    return _ERRORS[fields.pop("kind")](fields.pop("problem"), **fields)


def _text(data: bytes) -> str:
    return base64.b64encode(data).decode("ascii")


def _data(text: str) -> bytes:
    return base64.b64decode(text)
