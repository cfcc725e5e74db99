"""Changes that other programs made to a line file, found by comparing its layers with the lines last saved."""

from __future__ import annotations

import sqlite3
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from linework.arrays import AnyArray, BoolArray, FloatArray
from linework.errors import InputError
from linework.files.line_file.tables import LineRow, columns_of, line_layers, quoted, wkb_of
from linework.files.vectors.fields import REJECTED_LAYER, lines_from_geometries
from linework.files.vectors.gpkg import VERTEX_TABLE
from linework.model.columns import column_types
from linework.model.lines import LINE_COLUMNS, VERTEX_COLUMNS, LineSet


@dataclass(frozen=True, slots=True)
class OutsideChanges:
    """Changes made by other programs.

    Parameters
    ----------
    gone
        Ids of lines that were changed or removed.
    came
        Changed lines as they are now, and new ones; those without `id` need one.
    features
        Layer and feature of the new ones, as the other program placed them.
    """

    gone: tuple[str, ...]
    came: LineSet
    features: tuple[tuple[str, int], ...]

    def __bool__(self) -> bool:
        return bool(self.gone or len(self.came))


def find_outside_changes(
    db: sqlite3.Connection, own: LineSet, rows: Sequence[LineRow], path: Path
) -> OutsideChanges:
    """Compare the file with the lines `own`, which were in `rows` when they were saved.

    A vertex at the same place as one of the old line keeps its sigmas and flags; for others they are unknown. Changed
    lines without a review become "edited", new ones "drawn".
    """
    found = read_layer_lines(db, own.crs, path)
    place = {(row.layer, row.fid): i for i, row in enumerate(rows)}
    was = np.array([place.get(feature, -1) for feature in found.features], dtype=np.int64)
    known = np.flatnonzero(was >= 0)
    differs = differing_lines(found.lines.take(known), own.take(was[known]))
    differs |= ~_vertices_there(db, own, rows)[was[known]]
    changed, new = known[differs], np.flatnonzero(was < 0)
    missing = np.setdiff1d(np.arange(len(own)), was[known])
    kept = set(own.take(was[known[~differs]]).id.tolist())
    lines = [_changed(found, j, own.take([was[j]])) for j in changed.tolist()]
    lines.append(_drawn(found.lines.take(new)))
    came = _with_own_ids(LineSet.concatenate(lines), own.id[was[changed]], kept)
    gone = own.id[np.concatenate([was[changed], missing]).astype(np.int64)]
    return OutsideChanges(tuple(gone.tolist()), came, tuple(found.features[j] for j in new.tolist()))


def _vertices_there(db: sqlite3.Connection, own: LineSet, rows: Sequence[LineRow]) -> BoolArray:
    """Return which lines have all their vertices in the table of vertices."""
    counts: Mapping[int, int] = dict(db.execute(f"SELECT line, count(*) FROM {VERTEX_TABLE} GROUP BY line"))
    n = np.array([counts.get(row.line, 0) for row in rows], dtype=np.int64)
    return np.asarray(n == np.diff(own.offsets), dtype=np.bool_)


def _changed(found: LayerLines, j: int, before: LineSet) -> LineSet:
    """Return a changed line; vertices that stayed keep their sigmas and flags."""
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
    """Return new lines as drawn by a person: confidence 1 where none is given."""
    review = np.where(lines.review == "", "drawn", lines.review)
    return lines.with_columns(review=review, confidence=np.nan_to_num(lines.confidence, nan=1.0))


def _with_own_ids(lines: LineSet, before: AnyArray, taken: set[str]) -> LineSet:
    """Return the lines with unique ids: copied and split features share one; a line keeps its own or gets none."""
    ids, used = lines.id.tolist(), set(taken)
    for i, name in enumerate(ids):
        own = str(before[i]) if i < len(before) else ""
        ids[i] = next((text for text in (name, own) if text and text not in used), "")
        used.add(ids[i])
    return lines.with_columns(id=np.array(ids, dtype=np.str_))


@dataclass(frozen=True, slots=True)
class LayerLines:
    """Lines in the layers of a file, and their features.

    Parameters
    ----------
    lines
        m lines, without vertex columns (see `with_vertex_rows`).
    features
        Layer and number of the feature of each; of a feature with several parts, all but the first have number 0.
    """

    lines: LineSet
    features: tuple[tuple[str, int], ...]


def read_layer_lines(db: sqlite3.Connection, crs: str, path: Path) -> LayerLines:
    """Return the lines of all layers; features without geometry or length are left out.

    Raises
    ------
    InputError
        A geometry cannot be read, or has a coordinate that is not a number.
    """
    sets, features = [LineSet.empty(crs)], []
    for layer in line_layers(db):
        names = [name for name in columns_of(db, layer) if name in LINE_COLUMNS]
        fields = ", ".join(f'"{name}"' for name in names)
        rows = db.execute(f"SELECT fid, geom, {fields} FROM {quoted(layer)} ORDER BY fid").fetchall()
        if not rows:
            continue
        fids, blobs, *values = zip(*rows, strict=True)
        lines, feature = lines_from_geometries(
            _shapes(blobs, path), dict(zip(names, values, strict=True)), crs, path
        )
        kept = np.flatnonzero(_has_length(lines))
        lines, feature = _of_layer(lines.take(kept), layer), feature[kept]
        is_first = np.diff(feature, prepend=-1) != 0
        sets.append(lines)
        features += [
            (layer, int(fids[k]) if first else 0) for k, first in zip(feature, is_first, strict=True)
        ]
    return LayerLines(_with_heights(LineSet.concatenate(sets)), tuple(features))


def _shapes(blobs: tuple[Any, ...], path: Path) -> AnyArray:
    try:
        return np.asarray(shapely.from_wkb([None if blob is None else wkb_of(blob) for blob in blobs]))
    except (ValueError, TypeError, shapely.errors.GEOSException) as error:
        raise InputError("a geometry cannot be read", where=path, advice="restore a copy") from error


def _of_layer(lines: LineSet, layer: str) -> LineSet:
    """Return the lines with kind or review filled in from their layer."""
    if layer == REJECTED_LAYER:
        return lines.with_columns(review=np.where(lines.review == "", "rejected", lines.review))
    return lines.with_columns(kind=np.where(lines.kind == "", layer, lines.kind))


def _has_length(lines: LineSet) -> BoolArray:
    moves = np.r_[False, np.any(np.diff(lines.xyz[:, :2], axis=0) != 0.0, axis=1)]
    moves[lines.offsets[:-1][np.diff(lines.offsets) > 0]] = False
    return np.bincount(lines.line_of_vertex[moves], minlength=len(lines)) > 0


def _with_heights(lines: LineSet) -> LineSet:
    """Return the lines; vertices drawn without a height take that of the nearest vertex with one."""
    missing = ~np.isfinite(lines.xyz[:, 2])
    if not missing.any():
        return lines
    xyz = lines.xyz.copy()
    known = xyz[~missing]
    for k in np.flatnonzero(missing):
        distance = np.hypot(*(known[:, :2] - xyz[k, :2]).T)
        xyz[k, 2] = known[np.argmin(distance), 2] if len(known) else 0.0
    return lines.with_columns(xyz=xyz)


def with_vertex_rows(db: sqlite3.Connection, found: LayerLines) -> tuple[LineSet, Mapping[int, LineRow]]:
    """Return the lines with their vertex columns, and the rows of the lines whose vertices are all in the table."""
    names = [name for name in VERTEX_COLUMNS if name in columns_of(db, VERTEX_TABLE)]
    fields = ", ".join(names)
    rows = db.execute(f"SELECT layer, line_fid, line, {fields} FROM {VERTEX_TABLE} ORDER BY rowid").fetchall()
    if not rows:
        return found.lines, {}
    layers, fids, numbers, *values = zip(*rows, strict=True)
    first = np.flatnonzero(np.diff(np.array(numbers, dtype=np.int64), prepend=-1))
    ends = np.r_[first[1:], len(rows)]
    runs = {(layers[a], fids[a]): (int(a), int(b)) for a, b in zip(first, ends, strict=True)}
    lines, fitting = found.lines, {}
    columns = {name: getattr(lines, name).copy() for name in names}
    own = {name: _column(name, value) for name, value in zip(names, values, strict=True)}
    for i, feature in enumerate(found.features):
        a, b = runs.get(feature, (0, 0))
        start, end = int(lines.offsets[i]), int(lines.offsets[i + 1])
        if b - a == end - start:
            fitting[i] = LineRow(*feature, int(numbers[a]))
            for name, column in columns.items():
                column[start:end] = own[name][a:b]
    return lines.with_columns(**columns), fitting


def _column(name: str, values: tuple[Any, ...]) -> FloatArray | BoolArray:
    dtype = column_types(LineSet)[name].dtype
    return np.array([v == 1 for v in values]) if dtype is np.bool_ else np.array(values, dtype=np.float64)


def differing_lines(a: LineSet, b: LineSet) -> BoolArray:
    """Return (m,) bool: which lines of two sets of m lines differ in geometry or in a line column."""
    counts = np.diff(a.offsets)
    differs = counts != np.diff(b.offsets)
    for name in LINE_COLUMNS:
        one, other = getattr(a, name), getattr(b, name)
        same = one == other
        differs |= ~(same | ((one != one) & (other != other)) if one.dtype.kind == "f" else same)
    same_count = np.flatnonzero(counts == np.diff(b.offsets))
    one, other = a.take(same_count), b.take(same_count)
    moved = np.any(one.xyz != other.xyz, axis=1)
    differs[same_count] |= np.bincount(one.line_of_vertex[moved], minlength=len(same_count)) > 0
    return np.asarray(differs, dtype=np.bool_)
