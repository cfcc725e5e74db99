"""The result of a run: lines, and the account of what was looked at and what was left out."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from linework.files.remote.address import address_text, is_remote
from linework.files.store.facts import StoreFacts
from linework.files.store.in_memory import FileFacts
from linework.lines.names import cell_id, cells_of_lines
from linework.model.lines import KINDS, LineSet
from linework.model.logs import VanLog
from linework.runs.drives.account import DrivesAccount, TurnsAccount
from linework.runs.tiles import Tile
from linework.surface.aside import RoadAside


@dataclass(frozen=True, slots=True)
class TileReport:
    """A tile of a method: points loaded (core and buffer), lines or boxes found, or why it failed."""

    name: str
    tile: Tile
    n_points: int = 0
    n_lines: int = 0
    problem: str = ""


class Failure(NamedTuple):
    """Something that was left out of a run.

    Parameters
    ----------
    what
        "tile", "image" or "recording": its key in run.json.
    name
        Of the tile; path of the (left) image; name of the recording.
    problem
        One line.
    trace
        Traceback, if the cause is a fault of linework's own.
    """

    what: str
    name: str
    problem: str
    trace: str = ""


@dataclass(frozen=True, slots=True)
class PairAccount:
    """Number of stereo pairs, images without a partner counted as pairs, and of those that were looked at."""

    n_pairs: int
    n_used: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Extraction:
    """Lines of a survey and the account of how they were found.

    Parameters
    ----------
    source
        Name of the survey.
    lines
        In their fixed order, with their names.
    kinds
        Kinds that were looked for.
    read
        Points used and left out, file by file; None where no points were looked at.
    tiles
        All tiles of all methods.
    failures
        Tiles, images and recordings that were left out.
    hashes
        SHA-256 of every input file.
    pairs
        Stereo pairs used and left out; None where none were looked at.
    logged
        Images and operator's keys by place, or None.
    aside
        How much is road, and how much smooth ground beside it is not; None where neither was of interest.
    drives
        How several drives were made to agree; None: they were not, or there is one.
    turns
        How the turns of a spinning lidar were levelled; None: they were not.
    """

    source: str
    lines: LineSet
    kinds: tuple[str, ...]
    read: StoreFacts | None
    tiles: tuple[TileReport, ...]
    failures: tuple[Failure, ...]
    hashes: Mapping[Path, str]
    warnings: tuple[str, ...]
    pairs: PairAccount | None = None
    logged: VanLog | None = None
    aside: RoadAside | None = None
    drives: DrivesAccount | None = None
    turns: TurnsAccount | None = None

    @property
    def adjusted(self) -> str:
        """What was corrected of the points before lines were looked for; "": nothing."""
        accounts = [account for account in (self.turns, self.drives) if account]
        return "; ".join(account.summary for account in accounts)


# Names and order of lines: from kind and place alone, so that another run gives the same


def identify(lines: LineSet) -> LineSet:
    """Return the lines in their fixed order, each with an `id` made of its kind and place.

    Notes
    -----
    The order is: kind (as in `KINDS`), then place from west to east, south to north, low to high, then the
    exact vertices, so that it does not depend on the order in which tiles or methods ended. Two lines
    of one kind at one place (the two wires of a pair, both beams of a rail) are numbered.

    Examples
    --------
    >>> a, b = np.zeros((2, 3)), np.full((2, 3), 5.0)
    >>> one = identify(LineSet.from_lines([a, b], kind=["cable", "guardrail"]))
    >>> two = identify(LineSet.from_lines([b, a], kind=["guardrail", "cable"]))
    >>> one.kind.tolist(), one.id.tolist() == two.id.tolist()
    (['guardrail', 'cable'], True)
    """
    places = cells_of_lines(lines)
    keys = [_key(lines, places, i) for i in range(len(lines))]
    order = sorted(range(len(lines)), key=keys.__getitem__)
    seen: Counter[tuple[str, ...]] = Counter()
    ids = []
    for i in order:
        place = (str(lines.kind[i]), *map(str, places[i]))
        seen[place] += 1
        ids.append(cell_id(place[0], places[i], seen[place]))
    return lines.take(np.array(order, dtype=np.int64)).with_columns(id=np.array(ids, dtype=np.str_))


def _key(lines: LineSet, places: np.ndarray, i: int) -> tuple[int, list[int], bytes]:
    # Big-endian bytes of the vertices: any fixed order will do where kind and place are equal
    exact = lines[i].xyz.astype(">f8").tobytes()
    kind = str(lines.kind[i])
    return (KINDS.index(kind) if kind in KINDS else len(KINDS)), places[i].tolist(), exact


# Sources of lines: the point files around each line

#: Files named in the `source` field of a line; further ones are counted: a reader takes it in at a glance. [files]
MAX_NAMES = 3


def with_sources(lines: LineSet, files: Sequence[FileFacts], survey: str) -> LineSet:
    """Return the lines; those without a `source` get the names of the files whose extents they overlap.

    Parameters
    ----------
    files
        Files that were read, in the order of the survey.
    survey
        Name of the survey: the source of a line outside the extents of all files.
    """
    open_ = np.flatnonzero(lines.source == "")
    sources = lines.source.astype(object)
    for i in open_.tolist():
        west, south = lines[i].xyz[:, :2].min(axis=0)
        east, north = lines[i].xyz[:, :2].max(axis=0)
        names = [
            path_text(Path(facts.path.name))
            for facts in files
            if west <= facts.bounds.east
            and east >= facts.bounds.west
            and south <= facts.bounds.north
            and north >= facts.bounds.south
        ]
        sources[i] = _listed(names) or survey
    return lines.with_columns(source=sources.astype(np.str_)) if len(open_) else lines


def path_text(path: Path) -> str:
    """Return a path as UTF-8 text, an address with both its slashes; other bytes are escaped."""
    return os.fsencode(address_text(path)).decode("utf-8", errors="backslashreplace")


def input_record(path: Path, digest: str) -> dict[str, str | int]:
    """Return an input as run.json lists it: with its SHA-256, or the state of a remote file."""
    if is_remote(path):
        return {"file": path_text(path), "state": digest}
    return {"file": path_text(path), "bytes": path.stat().st_size, "sha256": digest}


def _listed(names: Sequence[str]) -> str:
    """Return the names, or the first of them and the number of further ones.

    >>> _listed(["a.laz", "b.laz"]), _listed(["a", "b", "c", "d", "e"])
    ('a.laz, b.laz', 'a, b, c and 2 more')
    """
    more = len(names) - MAX_NAMES
    return ", ".join(names[:MAX_NAMES]) + (f" and {more} more" if more > 0 else "")
