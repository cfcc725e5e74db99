"""What is done with one time window of stereo pairs: read each, look for lines in it, keep what was seen."""

from __future__ import annotations

import time
from dataclasses import asdict, dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

from linework.errors import InputError
from linework.files.parts import write_sighting_part
from linework.imaging.rectify import Rectifier, rectifier_of
from linework.methods.stereo.method import StereoMethod
from linework.model.camera import StereoRig
from linework.model.images import ImagePair, StereoSeries
from linework.model.sightings import Sightings
from linework.tiling.opened_stereo import rectified_pair

#: Pairs of a window: some ten seconds of driving; a killed run loses no more than these.
WINDOW_PAIRS = 64


@dataclass(frozen=True, slots=True)
class WindowTask:
    """Successive pairs to be looked at; `results` is the folder for what is seen."""

    pairs: tuple[ImagePair, ...]
    rig: StereoRig
    method: StereoMethod
    results: Path

    @property
    def name(self) -> str:
        """The method and the window's place in the series, the same in every run."""
        return f"{self.method.name}-{self.pairs[0].number // WINDOW_PAIRS:06d}"

    @property
    def result(self) -> Path:
        """Where what is seen goes."""
        return self.results / f"{self.name}.npz"


@dataclass(frozen=True, slots=True)
class WindowReceipt:
    """What came of a window: pairs looked at, places seen, the hash of its file, and what could not be read.

    `failures` are (left image, problem).
    """

    name: str
    n_pairs: int
    n_sightings: int
    seconds: float
    sha256: str
    failures: tuple[tuple[str, str], ...] = ()

    def as_document(self) -> dict[str, Any]:
        """Return it for the journal."""
        return asdict(self)


def windows_of(
    pairs: tuple[ImagePair, ...], rig: StereoRig, method: StereoMethod, results: Path
) -> list[WindowTask]:
    """Return the tasks for all pairs: windows lie on one lattice of numbers, whatever pairs are left out."""
    by_window: dict[int, list[ImagePair]] = {}
    for pair in pairs:
        by_window.setdefault(pair.number // WINDOW_PAIRS, []).append(pair)
    return [WindowTask(tuple(held), rig, method, results) for _, held in sorted(by_window.items())]


def work_window(task: WindowTask) -> WindowReceipt:
    """Look at the pairs of a window; a pair that cannot be read is noted, and stops no other."""
    start = time.perf_counter()
    series, rectifier = StereoSeries(task.rig, task.pairs), _rectifier(_Same(task.rig))
    seen, failures = [], []
    for pair in task.pairs:
        try:
            seen.append(task.method.see(rectified_pair(pair, series, rectifier)))
        except InputError as error:
            failures.append((str(pair.left), str(error)))
    found = Sightings.concatenate(seen)
    sha256 = write_sighting_part(found, task.result)
    seconds = time.perf_counter() - start
    return WindowReceipt(task.name, len(seen), len(found), seconds, sha256, tuple(failures))


class _Same:
    """A rig as a key: two of the same numbers are one."""

    def __init__(self, rig: StereoRig) -> None:
        self.rig = rig
        self._key = repr(rig)

    def __hash__(self) -> int:
        return hash(self._key)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Same) and other._key == self._key


# A process looks at many windows of one run: the maps of its cameras are made once
@lru_cache(maxsize=1)
def _rectifier(same: _Same) -> Rectifier:
    return rectifier_of(same.rig)
