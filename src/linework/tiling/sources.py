"""Where lines come from: the point files that lie about each."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from linework.files.survey_points import FileFacts
from linework.model.lines import LineSet

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
