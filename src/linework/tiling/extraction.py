"""What a run found, and the account of how it came about."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from linework.files.store_facts import StoreFacts
from linework.model.lines import LineSet
from linework.model.van_log import VanLog
from linework.tiling.plan import Tile


@dataclass(frozen=True, slots=True)
class TileReport:
    """What came of a tile: points it saw (core and buffer), lines found, or the problem."""

    name: str
    tile: Tile
    n_points: int = 0
    n_lines: int = 0
    problem: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class PairsSeen:
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
    pairs: PairsSeen | None = None
    logged: VanLog | None = None
    unusable: tuple[tuple[str, str], ...] = ()
