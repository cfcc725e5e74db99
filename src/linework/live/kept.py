"""What is kept of a drive that is followed: the journal, the lines of finished stretches, the photolog so far.

Separate from `drive`, because a restart after a loss of power begins here, without any pair or log.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from linework.errors import OutputExistsError
from linework.files.live.journal import LiveJournal
from linework.files.output.locks import hold_lock
from linework.files.output.parts import read_part, write_part
from linework.files.output.publish import machine_errors
from linework.files.output.replace import make_durable
from linework.model.images import ImagePair, Poses
from linework.model.lines import LineSet
from linework.navigation.poses import attitude_deg_of, rotations_of
from linework.runs.opened.made import RUNS, claim, remove_made

_JOURNAL = "live.jsonl"
#: States of a pair in the journal.
LOOKED, SKIPPED, FAILED, NO_POSITION = "looked", "skipped", "failed", "no position"
#: Length of the drive that one output file holds: writing it takes a second, whatever was driven before. [m]
FILE_M = 10_000.0


@dataclass(slots=True)
class Placed:
    """A pair with a place, as the journal has it."""

    pair: ImagePair
    pose: Poses
    chainage_m: float
    state: str


@dataclass(slots=True)
class Kept:
    """What was done in a drive.

    Parameters
    ----------
    placed
        Pairs of the current output file.
    lines
        Finished stretches of the current output file.
    done
        Numbers of the pairs with which an earlier start had nothing left to do.
    unplaced
        Numbers of those that it had looked at, without their places.
    counts
        Number of pairs by state.
    skipped, failed
        The left images that were skipped, and those that cannot be read with the reason; of the whole drive.
    places
        East, north, up, heading [deg] and chainage of each press, by its identity.
    from_m
        Chainage of the start of the open stretch. [m]
    chainage_m
        Distance driven. [m]
    n_files
        Number of the current output file, from 1.
    """

    placed: list[Placed] = field(default_factory=list)
    lines: list[LineSet] = field(default_factory=list)
    done: set[int] = field(default_factory=set)
    unplaced: set[int] = field(default_factory=set)
    counts: dict[str, int] = field(
        default_factory=lambda: dict.fromkeys((LOOKED, SKIPPED, FAILED, NO_POSITION), 0)
    )
    skipped: list[str] = field(default_factory=list)
    failed: list[tuple[str, str]] = field(default_factory=list)
    places: dict[str, tuple[float, float, float, float, float]] = field(default_factory=dict)
    from_m: float = 0.0
    chainage_m: float = 0.0
    n_files: int = 1


#: Most names of skipped or failed pairs that are kept for the record; the journal has all of them.
_MOST_NAMES = 10_000


class KeptDrive:
    """The folder of a drive that is followed, in the work folder.

    Parameters
    ----------
    folder
        As `live_folder` gives it.
    root
        Folder of the survey: names in the journal are relative to it.
    """

    def __init__(self, folder: Path, root: Path) -> None:
        self._folder, self._root = folder, root
        self.journal = LiveJournal(folder / _JOURNAL)
        self.kept = Kept()
        stretches: list[tuple[str, str]] = []
        for record in self.journal.records():
            self._take(record, stretches)
        self.kept.unplaced -= self.kept.done
        for name, sha256 in stretches:
            lines = read_part(LineSet, folder / name, sha256)
            if lines is not None:
                self.kept.lines.append(lines)

    def _take(self, record: Mapping[str, Any], stretches: list[tuple[str, str]]) -> None:
        """Take in a record of an earlier start."""
        kept = self.kept
        if "pair" in record:
            self._count(record["state"], record["left"], record.get("problem", ""))
            (kept.unplaced if record["state"] == LOOKED else kept.done).add(record["pair"])
        if "at" in record:
            placed = self._placed_of(record)
            kept.placed.append(placed)
            kept.done.add(placed.pair.number)
            kept.chainage_m = max(kept.chainage_m, placed.chainage_m)
        if "stretch" in record:
            stretches.append((record["stretch"], record["sha256"]))
            kept.from_m = record["next_m"]
        if "press" in record:
            east, north, up, heading, chainage = record["place"]
            kept.places[record["press"]] = (east, north, up, heading, chainage)
        if "file" in record:
            kept.n_files = record["file"]
            kept.placed.clear()
            stretches.clear()

    def _count(self, state: str, left: str, problem: str) -> None:
        self.kept.counts[state] += 1
        if state == SKIPPED and len(self.kept.skipped) < _MOST_NAMES:
            self.kept.skipped.append(left)
        if state == FAILED and len(self.kept.failed) < _MOST_NAMES:
            self.kept.failed.append((left, problem))

    def pair_done(self, pair: ImagePair, state: str, problem: str = "") -> None:
        """Note what was done with a pair."""
        record = {"pair": pair.number, "state": state, "time_s": pair.time_s, "left": self._name(pair.left)}
        self.journal.note(record | ({"problem": problem} if problem else {}))
        self._count(state, self._name(pair.left), problem)

    def pair_placed(self, placed: Placed) -> None:
        """Note the place of a pair."""
        pose, pair = placed.pose, placed.pair
        self.kept.placed.append(placed)
        self.kept.chainage_m = max(self.kept.chainage_m, placed.chainage_m)
        self.journal.note(
            {
                "at": pair.number, "time_s": pair.time_s, "left": self._name(pair.left),
                "right": self._name(pair.right), "state": placed.state,
                "xyz": _listed(pose.xyz[0], 4), "attitude_deg": _listed(attitude_deg_of(pose.R_world_vehicle)[0], 5),
                "sigma_m": _listed(pose.sigma_xyz_m[0], 4), "sigma_rad": _listed(pose.sigma_attitude_rad[0], 7),
                "chainage_m": round(placed.chainage_m, 3),
            }
        )  # fmt: skip

    def press_placed(self, press: str, place: tuple[float, float, float, float, float]) -> None:
        """Note the place of a press."""
        self.kept.places[press] = place
        self.journal.note({"press": press, "place": [round(value, 4) for value in place]})

    def stretch_done(self, lines: LineSet, from_m: float, next_m: float) -> None:
        """Keep the lines of a finished stretch; the disk holds them when this returns.

        Raises
        ------
        MachineError
            The disk is full; the lines stay in memory all the same.
        """
        self.kept.lines.append(lines)
        self.kept.from_m = next_m
        name = f"stretch-{self.kept.n_files:04d}-{from_m:010.1f}.arrays"
        sha256 = write_part(lines, self._folder / name)
        make_durable(self._folder / name)
        self.journal.note({"stretch": name, "sha256": sha256, "next_m": next_m})

    def next_file(self) -> None:
        """Begin the next output file: what the current one holds is forgotten here."""
        kept = self.kept
        for old in self._folder.glob(f"stretch-{kept.n_files:04d}-*.arrays"):
            old.unlink(missing_ok=True)
        kept.n_files += 1
        self.journal.note({"file": kept.n_files})
        open_, kept.placed = [one for one in kept.placed if one.chainage_m >= kept.from_m], []
        kept.lines.clear()
        for placed in open_:
            self.pair_placed(placed)

    def _placed_of(self, record: Mapping[str, Any]) -> Placed:
        left, right = self._root / record["left"], self._root / record["right"]
        pair = ImagePair(record["at"], record["time_s"], left, right)
        attitude = np.array([record["attitude_deg"]], dtype=np.float64)
        pose = Poses(
            np.array([pair.time_s]), np.array([record["xyz"]]), rotations_of(attitude),
            _numbers(record["sigma_m"]), _numbers(record["sigma_rad"]),
        )  # fmt: skip
        return Placed(pair, pose, record["chainage_m"], record["state"])

    def _name(self, path: Path) -> str:
        text = os.path.relpath(path, self._root)
        return os.fsencode(text).decode("utf-8", errors="backslashreplace")


def _listed(values: Any, digits: int) -> list[float | None]:
    """Return numbers for JSON, which has no NaN."""
    return [round(value, digits) if np.isfinite(value) else None for value in values.tolist()]


def _numbers(values: Sequence[float | None]) -> Any:
    return np.array([[np.nan if value is None else value for value in values]], dtype=np.float64)


@contextmanager
def live_folder(work: Path, output: Path, *, afresh: bool = False) -> Iterator[Path]:
    """Hold the folder of a drive in the work folder; it stays, so that the drive can be continued.

    Parameters
    ----------
    output
        Of the lines: a drive is continued by following it into the same file.
    afresh
        Forget an earlier drive.

    Raises
    ------
    OutputExistsError
        Another process follows a drive into this file.
    """
    name = f"live-{hashlib.sha256(os.fsencode(output.absolute())).hexdigest()[:16]}"
    refusal = OutputExistsError("another linework live writes it", where=output, advice="wait for it to end")
    with hold_lock(work / f"{name}.lock", refusal), machine_errors(work / RUNS):
        claim(work, f"{RUNS}/{name}")
        if afresh:
            remove_made(work, f"{RUNS}/{name}")
            claim(work, f"{RUNS}/{name}")
        (work / RUNS / name).mkdir(parents=True, exist_ok=True)
        yield work / RUNS / name


def is_followed(work: Path, output: Path) -> bool:
    """Return whether a drive was followed into this file before."""
    name = f"live-{hashlib.sha256(os.fsencode(output.absolute())).hexdigest()[:16]}"
    return (work / RUNS / name / _JOURNAL).is_file()


def numbered(output: Path, number: int) -> Path:
    """Return the file of a part of a drive: that of the first part is the output itself.

    >>> numbered(Path("lines.gpkg"), 1).name, numbered(Path("lines.gpkg"), 2).name
    ('lines.gpkg', 'lines-2.gpkg')
    """
    return output if number == 1 else output.with_name(f"{output.stem}-{number}{output.suffix}")
