"""What a run found, and the account of how it came about."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from linework.files.store.facts import StoreFacts
from linework.files.store.in_memory import FileFacts
from linework.lines.names import cell_id, cells_of_lines
from linework.model.lines import KINDS, LineSet
from linework.model.logs import VanLog
from linework.runs.tiles import Tile


@dataclass(frozen=True, slots=True)
class TileReport:
    """What came of a tile: points it saw (core and buffer), lines found, or the problem."""

    name: str
    tile: Tile
    n_points: int = 0
    n_lines: int = 0
    problem: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class PairAccount:
    """The account of a survey's stereo pairs.

    Parameters
    ----------
    n_pairs, n_used
        All pairs, images without their other one counted as such, and those that were looked at.
    failures
        (left image, problem) of the others, and of images in no pair.
    traces
        Tracebacks of windows that failed by a fault of linework's own.
    """

    n_pairs: int
    n_used: int
    failures: tuple[tuple[str, str], ...]
    traces: Mapping[str, str]


@dataclass(frozen=True, slots=True, kw_only=True)
class Extraction:
    """Lines of a survey and the account of how they came about.

    Parameters
    ----------
    source
        Name of the survey.
    lines
        In their fixed order, with their names.
    kinds
        What was looked for.
    read
        Points used and left out, file by file; None where no points were looked at.
    failures
        (tile, problem) of what could not be worked.
    traces
        Tracebacks of tiles that failed by a fault of linework's own.
    hashes
        SHA-256 of every input file.
    pairs
        Stereo pairs used and left out; None where none were looked at.
    logged
        Images and operator's keys by place, or None.
    unusable
        (what, problem) of recordings that cannot be used at all: images, logs.
    """

    source: str
    lines: LineSet
    kinds: tuple[str, ...]
    read: StoreFacts | None
    tiles: tuple[TileReport, ...]
    failures: tuple[tuple[str, str], ...]
    traces: Mapping[str, str]
    hashes: Mapping[Path, str]
    warnings: tuple[str, ...]
    pairs: PairAccount | None = None
    logged: VanLog | None = None
    unusable: tuple[tuple[str, str], ...] = ()


# Names and order of lines: from kind and place alone, so that a re-run gives the same


def identify(lines: LineSet) -> LineSet:
    """Return the lines in their fixed order, each with an `id` made of its kind and place.

    Notes
    -----
    The order is: kind (as in `KINDS`), then place from west to east, south to north, low to high, then the
    exact vertices, so that it does not depend on the order in which tiles or methods were done. Two lines
    of one kind at one place (the two wires of a pair, both beams of a rail) are told apart by a number.

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
    # Big-endian bytes of the vertices: any fixed order does where kind and place are the same
    exact = lines.line(i).astype(">f8").tobytes()
    kind = str(lines.kind[i])
    return (KINDS.index(kind) if kind in KINDS else len(KINDS)), places[i].tolist(), exact


# Where lines come from: the point files that lie about each

#: A field of a table is to be read at a glance: of more files the first are named, the others counted.
MAX_NAMES = 3


def with_sources(lines: LineSet, files: Sequence[FileFacts], survey: str) -> LineSet:
    """Return the lines, those without a `source` with the names of the files whose extents they reach into.

    Parameters
    ----------
    files
        What was read, in the survey's order.
    survey
        Name of the survey: the source of a line that lies in the extent of no file.
    """
    open_ = np.flatnonzero(lines.source == "")
    sources = lines.source.astype(object)
    for i in open_.tolist():
        west, south = lines.line(i)[:, :2].min(axis=0)
        east, north = lines.line(i)[:, :2].max(axis=0)
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
    """Return a path as text that any reader takes, bytes that are no UTF-8 escaped."""
    return os.fsencode(path).decode("utf-8", errors="backslashreplace")


def _listed(names: Sequence[str]) -> str:
    """Return the names, or the first of them and how many more there are.

    >>> _listed(["a.laz", "b.laz"]), _listed(["a", "b", "c", "d", "e"])
    ('a.laz, b.laz', 'a, b, c and 2 more')
    """
    more = len(names) - MAX_NAMES
    return ", ".join(names[:MAX_NAMES]) + (f" and {more} more" if more > 0 else "")
