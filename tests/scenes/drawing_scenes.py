"""Lines for tests of drawings, and what every file of a drawing must be."""

import sqlite3
from contextlib import closing
from pathlib import Path

import numpy as np

from linework.lines.names import with_ids
from linework.model.lines import LINE_COLUMNS, POLE, VERTEX_COLUMNS, LineSet


def some_lines(n: int = 6) -> LineSet:
    rng = np.random.default_rng(3)
    lines = [np.cumsum(rng.uniform(0.1, 1, (4 + i, 3)), axis=0) + rng.uniform(0, 1e6, 3) for i in range(n)]
    m = sum(map(len, lines))
    kinds = (["lane_marking", "road_boundary", "guardrail", "cable"] * n)[:n]
    columns = {"sigma_xy_m": rng.uniform(0, 1, m), "sigma_z_m": rng.uniform(0, 1, m)}
    found = LineSet.from_lines(lines, kind=kinds, bridged=rng.random(m) < 0.3, **columns)
    return with_ids(found.with_columns(confidence=rng.random(n), width_m=[0.15] + [np.nan] * (n - 1)), ())


def same(a: LineSet, b: LineSet) -> bool:
    """Whether two sets hold the same lines, in any order."""
    a, b = (s.take(np.argsort(s.id)) for s in (a, b))
    names = ("xyz", "offsets", *VERTEX_COLUMNS, *LINE_COLUMNS)
    return all(
        np.array_equal(getattr(a, n), getattr(b, n), equal_nan=getattr(a, n).dtype.kind == "f") for n in names
    )


def shifted(lines: LineSet, by_m: float = 0.5) -> LineSet:
    return lines.with_columns(xyz=lines.xyz + by_m, review=["edited"] * len(lines))


def none() -> LineSet:
    return LineSet.empty()


def whole(path: Path) -> None:
    """Fail unless the file is a sound GeoPackage whose index and vertices are those of its lines."""
    with closing(sqlite3.connect(path)) as db:
        assert db.execute("PRAGMA integrity_check").fetchone() == ("ok",)
        n = 0
        for (layer,) in db.execute("SELECT table_name FROM gpkg_geometry_columns").fetchall():
            fids = db.execute(f'SELECT fid FROM "{layer}" ORDER BY fid').fetchall()
            assert fids == db.execute(f'SELECT id FROM "rtree_{layer}_geom" ORDER BY id').fetchall()
            assert db.execute(
                "SELECT count(*) FROM layer_styles WHERE f_table_name = ?", (layer,)
            ).fetchone() == (1,)
            n += 0 if layer == POLE else len(fids)  # poles are points, without vertices
        assert db.execute("SELECT count(DISTINCT line) FROM vertex").fetchone() == (n,)
    assert not [p for p in path.parent.iterdir() if p.name != path.name]
