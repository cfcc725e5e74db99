"""What others did to a drawing's file: found by comparing its layers with the lines as they were saved last."""

from __future__ import annotations

import sqlite3
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from linework.arrays import AnyArray, BoolArray
from linework.files.drawing_found import Found, different, found_lines
from linework.files.drawing_rows import Row
from linework.files.vectors_gpkg import VERTEX_TABLE
from linework.model.lines import VERTEX_COLUMNS, LineSet


@dataclass(frozen=True, slots=True)
class Elsewhere:
    """What was done.

    Parameters
    ----------
    gone
        Ids of lines that were changed or removed.
    came
        Lines as they are after it, and new ones; those without `id` need one.
    features
        Layer and feature of new ones, which stand where they were put.
    """

    gone: tuple[str, ...]
    came: LineSet
    features: tuple[tuple[str, int], ...]

    def __bool__(self) -> bool:
        return bool(self.gone or len(self.came))


def changed_elsewhere(db: sqlite3.Connection, own: LineSet, rows: Sequence[Row], path: Path) -> Elsewhere:
    """Compare the file with the lines `own`, which stood in `rows` when they were saved.

    A vertex that stands where one of the line stood keeps its sigmas and flags; others do not know theirs. Lines that
    nobody has reviewed are "edited", new ones "drawn".
    """
    found = found_lines(db, own.crs, path)
    place = {(row.layer, row.fid): i for i, row in enumerate(rows)}
    was = np.array([place.get(feature, -1) for feature in found.features], dtype=np.int64)
    known = np.flatnonzero(was >= 0)
    differs = different(found.lines.take(known), own.take(was[known]))
    differs |= ~_vertices_there(db, own, rows)[was[known]]
    changed, new = known[differs], np.flatnonzero(was < 0)
    missing = np.setdiff1d(np.arange(len(own)), was[known])
    kept = set(own.take(was[known[~differs]]).id.tolist())
    lines = [_changed(found, j, own.take([was[j]])) for j in changed.tolist()]
    lines.append(_drawn(found.lines.take(new)))
    came = _with_own_ids(LineSet.concatenate(lines), own.id[was[changed]], kept)
    gone = own.id[np.concatenate([was[changed], missing]).astype(np.int64)]
    return Elsewhere(tuple(gone.tolist()), came, tuple(found.features[j] for j in new.tolist()))


def _vertices_there(db: sqlite3.Connection, own: LineSet, rows: Sequence[Row]) -> BoolArray:
    """Return whether the table of vertices holds as many of each line as it has."""
    counts: Mapping[int, int] = dict(db.execute(f"SELECT line, count(*) FROM {VERTEX_TABLE} GROUP BY line"))
    n = np.array([counts.get(row.line, 0) for row in rows], dtype=np.int64)
    return np.asarray(n == np.diff(own.offsets), dtype=np.bool_)


def _changed(found: Found, j: int, before: LineSet) -> LineSet:
    """Return a line that was changed, with what is known per vertex where a vertex stayed."""
    line = found.lines.take([j])
    if line.review[0] == "":
        line = line.with_columns(review=["edited"])
    place = {tuple(xyz): k for k, xyz in enumerate(before.xyz.tolist())}
    was = np.array([place.get(tuple(xyz), -1) for xyz in line.xyz.tolist()], dtype=np.int64)
    columns = {}
    for name in VERTEX_COLUMNS:
        values = getattr(line, name).copy()
        values[was >= 0] = getattr(before, name)[was[was >= 0]]
        columns[name] = values
    return line.with_columns(**columns)


def _drawn(lines: LineSet) -> LineSet:
    """Return new lines; where nobody says how sure they are, a person was."""
    review = np.where(lines.review == "", "drawn", lines.review)
    return lines.with_columns(review=review, confidence=np.nan_to_num(lines.confidence, nan=1.0))


def _with_own_ids(lines: LineSet, before: AnyArray, taken: set[str]) -> LineSet:
    """Return the lines; whose id another line has (copied and split features keep theirs) gets its own back, or none."""
    ids, used = lines.id.tolist(), set(taken)
    for i, name in enumerate(ids):
        own = str(before[i]) if i < len(before) else ""
        ids[i] = next((text for text in (name, own) if text and text not in used), "")
        used.add(ids[i])
    return lines.with_columns(id=np.array(ids, dtype=np.str_))
