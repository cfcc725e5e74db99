"""Build a GeoPackage in memory, so that no write can fail unnoticed.

GDAL ignores some failed writes: with every 17th of the 430 writes of a small file failing once, 7 of 26 files
lacked triggers, the application id or the spatial reference, and GDAL reported success. SQLite in memory
cannot fail that way; its bytes are then written at once and read back with GDAL, which did not write them.

References
----------
OGC 12-128r15, GeoPackage Encoding Standard 1.2.1: tables C.1 to C.5, geometry blobs 2.1.3, R-tree F.3,
WKT for CRSs F.10.
"""

from __future__ import annotations

import contextlib
import sqlite3
import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import pyproj
import shapely
from pyproj.exceptions import CRSError as ProjError

from linework.arrays import AnyArray, FloatArray
from linework.crs import LOCAL, epsg_text

#: Stored in place of the time of writing, so that equal lines give equal bytes.
FIXED_DATE = "2000-01-01T00:00:00.000Z"
_APPLICATION_ID, _VERSION = 0x47504B47, 10200  # "GPKG", 1.2
#: srs_id of the standard's "undefined Cartesian", and of a CRS without a single EPSG code.
_CARTESIAN, _OWN = -1, 100_000
_SQL_TYPES = {"U": "TEXT", "O": "TEXT", "b": "BOOLEAN", "f": "DOUBLE", "i": "INTEGER"}
#: Little endian, envelope of x, y and z.
_BLOB_FLAGS = 0b00000101

_SCHEMA = """
CREATE TABLE gpkg_spatial_ref_sys (srs_name TEXT NOT NULL, srs_id INTEGER NOT NULL PRIMARY KEY,
  organization TEXT NOT NULL, organization_coordsys_id INTEGER NOT NULL, definition TEXT NOT NULL,
  description TEXT, definition_12_063 TEXT NOT NULL DEFAULT 'undefined');
CREATE TABLE gpkg_contents (table_name TEXT NOT NULL PRIMARY KEY, data_type TEXT NOT NULL,
  identifier TEXT UNIQUE, description TEXT DEFAULT '',
  last_change DATETIME NOT NULL DEFAULT (strftime('%Y-%m-%dT%H:%M:%fZ','now')),
  min_x DOUBLE, min_y DOUBLE, max_x DOUBLE, max_y DOUBLE, srs_id INTEGER,
  CONSTRAINT fk_gc_r_srs_id FOREIGN KEY (srs_id) REFERENCES gpkg_spatial_ref_sys(srs_id));
CREATE TABLE gpkg_geometry_columns (table_name TEXT NOT NULL, column_name TEXT NOT NULL,
  geometry_type_name TEXT NOT NULL, srs_id INTEGER NOT NULL, z TINYINT NOT NULL, m TINYINT NOT NULL,
  CONSTRAINT pk_geom_cols PRIMARY KEY (table_name, column_name), CONSTRAINT uk_gc_table_name UNIQUE (table_name),
  CONSTRAINT fk_gc_tn FOREIGN KEY (table_name) REFERENCES gpkg_contents(table_name),
  CONSTRAINT fk_gc_srs FOREIGN KEY (srs_id) REFERENCES gpkg_spatial_ref_sys (srs_id));
CREATE TABLE gpkg_extensions (table_name TEXT, column_name TEXT, extension_name TEXT NOT NULL,
  definition TEXT NOT NULL, scope TEXT NOT NULL,
  CONSTRAINT ge_tce UNIQUE (table_name, column_name, extension_name));
INSERT INTO gpkg_extensions VALUES ('gpkg_spatial_ref_sys', 'definition_12_063', 'gpkg_crs_wkt',
  'http://www.geopackage.org/spec120/#extension_crs_wkt', 'read-write');
"""
#: Keeps the index up to date when other programs edit the layer ({t}); they provide the ST_ functions.
_INDEX = (
    'CREATE VIRTUAL TABLE "rtree_{t}_geom" USING rtree(id, minx, maxx, miny, maxy)',
    """INSERT INTO gpkg_extensions VALUES ('{t}', 'geom', 'gpkg_rtree_index',
  'http://www.geopackage.org/spec120/#extension_rtree', 'write-only')""",
    """CREATE TRIGGER "rtree_{t}_geom_insert" AFTER INSERT ON "{t}"
  WHEN (NEW.geom NOT NULL AND NOT ST_IsEmpty(NEW.geom)) BEGIN {put} END""",
    """CREATE TRIGGER "rtree_{t}_geom_update1" AFTER UPDATE OF geom ON "{t}"
  WHEN OLD.fid = NEW.fid AND (NEW.geom NOTNULL AND NOT ST_IsEmpty(NEW.geom)) BEGIN {put} END""",
    """CREATE TRIGGER "rtree_{t}_geom_update2" AFTER UPDATE OF geom ON "{t}"
  WHEN OLD.fid = NEW.fid AND (NEW.geom ISNULL OR ST_IsEmpty(NEW.geom)) BEGIN
  DELETE FROM "rtree_{t}_geom" WHERE id = OLD.fid; END""",
    """CREATE TRIGGER "rtree_{t}_geom_update3" AFTER UPDATE ON "{t}"
  WHEN OLD.fid != NEW.fid AND (NEW.geom NOTNULL AND NOT ST_IsEmpty(NEW.geom)) BEGIN
  DELETE FROM "rtree_{t}_geom" WHERE id = OLD.fid; {put} END""",
    """CREATE TRIGGER "rtree_{t}_geom_update4" AFTER UPDATE ON "{t}"
  WHEN OLD.fid != NEW.fid AND (NEW.geom ISNULL OR ST_IsEmpty(NEW.geom)) BEGIN
  DELETE FROM "rtree_{t}_geom" WHERE id IN (OLD.fid, NEW.fid); END""",
    """CREATE TRIGGER "rtree_{t}_geom_delete" AFTER DELETE ON "{t}" WHEN OLD.geom NOT NULL BEGIN
  DELETE FROM "rtree_{t}_geom" WHERE id = OLD.fid; END""",
)
_PUT = (
    'INSERT OR REPLACE INTO "rtree_{t}_geom" VALUES (NEW.fid, ST_MinX(NEW.geom), ST_MaxX(NEW.geom),'
    " ST_MinY(NEW.geom), ST_MaxY(NEW.geom));"
)


@dataclass(frozen=True, slots=True)
class LayerTable:
    """A layer of LineString Z or Point Z (`shapes` given) or a table without geometry; rows are numbered from 1.

    Parameters
    ----------
    name
        A plain identifier.
    columns
        Columns by name; NaN and None become NULL.
    shapes
        (n,) shapely LineString Z or Point Z, or None.
    key
        Name of the column with the row's number.
    sql_types
        SQL types of columns whose values do not determine them.
    geometry
        Geometry type of the shapes, as the standard names it.
    """

    name: str
    columns: Mapping[str, AnyArray]
    shapes: AnyArray | None = None
    key: str = "fid"
    sql_types: Mapping[str, str] = field(default_factory=dict)
    geometry: str = "LINESTRING"


def geopackage_bytes(tables: Sequence[LayerTable], crs: str) -> bytes:
    """Return the bytes of a GeoPackage with these tables in the CRS (WKT2 or "local").

    Raises
    ------
    sqlite3.Error
        SQLite was built without R-trees.
    """
    with contextlib.closing(sqlite3.connect(":memory:")) as db:
        db.execute(f"PRAGMA application_id = {_APPLICATION_ID}")
        db.execute(f"PRAGMA user_version = {_VERSION}")
        db.executescript(_SCHEMA)
        srs_id = _add_crs(db, crs)
        for table in tables:
            add_table(db, table, srs_id)
        db.commit()
        return db.serialize()


def _add_crs(db: sqlite3.Connection, crs: str) -> int:
    """Add the three required CRSs and our own; return its srs_id."""
    wgs84 = pyproj.CRS.from_epsg(4326)
    rows = [
        ("Undefined Cartesian SRS", -1, "NONE", -1, "undefined", "undefined Cartesian", "undefined"),
        ("Undefined geographic SRS", 0, "NONE", 0, "undefined", "undefined geographic", "undefined"),
        ("WGS 84 geodetic", 4326, "EPSG", 4326, wgs84.to_wkt("WKT1_GDAL"), "degrees", wgs84.to_wkt("WKT2_2015")),
    ]  # fmt: skip
    srs_id = _CARTESIAN
    if crs != LOCAL:
        code = epsg_text(crs).removeprefix("EPSG:")
        organisation, srs_id = ("EPSG", int(code)) if code.isdecimal() else ("NONE", _OWN)
        loaded = pyproj.CRS.from_wkt(crs)
        try:
            old_form = loaded.to_wkt("WKT1_GDAL")
        except ProjError:
            old_form = "undefined"
        rows.append((loaded.name, srs_id, organisation, srs_id, old_form, "", crs))
    db.executemany("INSERT INTO gpkg_spatial_ref_sys VALUES (?, ?, ?, ?, ?, ?, ?)", rows)
    return srs_id


def add_table(db: sqlite3.Connection, table: LayerTable, srs_id: int) -> None:
    """Add a table with its rows, its entries in the lists of the standard and its index; commits nothing."""
    kinds = {name: table.sql_types.get(name, _SQL_TYPES[c.dtype.kind]) for name, c in table.columns.items()}
    names = [f'"{name}" {kind}' for name, kind in kinds.items()]
    values: list[Sequence[object]] = [sql_values(column) for column in table.columns.values()]
    bounds = np.zeros((0, 6))
    if table.shapes is not None:
        names.insert(0, f"geom {table.geometry}")
        bounds = shape_bounds(table.shapes)
        values.insert(0, geometry_blobs(table.shapes, srs_id))
    db.execute(f'CREATE TABLE "{table.name}" ("{table.key}" INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL, {", ".join(names)})')  # fmt: skip
    places = ", ".join("?" * len(values))
    rows = zip(*values, strict=True)
    db.executemany(f'INSERT INTO "{table.name}" VALUES (NULL, {places})', rows)
    extent = [*bounds[:, [0, 2]].min(axis=0), *bounds[:, [1, 3]].max(axis=0)] if len(bounds) else [None] * 4
    has_shapes = table.shapes is not None
    db.execute(
        "INSERT INTO gpkg_contents VALUES (?, ?, ?, '', ?, ?, ?, ?, ?, ?)",
        (table.name, "features" if has_shapes else "attributes", table.name, FIXED_DATE, *extent,
         srs_id if has_shapes else None),
    )  # fmt: skip
    if has_shapes:
        _add_index(db, table, bounds, srs_id)


def _add_index(db: sqlite3.Connection, table: LayerTable, bounds: FloatArray, srs_id: int) -> None:
    name = table.name
    db.execute(
        "INSERT INTO gpkg_geometry_columns VALUES (?, 'geom', ?, ?, 1, 0)", (name, table.geometry, srs_id)
    )
    for statement in _INDEX:
        db.execute(statement.format(t=name, put=_PUT.format(t=name)))
    numbered = ((i, *row) for i, row in enumerate(bounds[:, :4].tolist(), start=1))
    db.executemany(f'INSERT INTO "rtree_{name}_geom" VALUES (?, ?, ?, ?, ?)', numbered)


def shape_bounds(shapes: AnyArray) -> FloatArray:
    """Return the extents (n, 6) [m]: min x, max x, min y, max y, min z, max z."""
    xyz, owner = shapely.get_coordinates(shapes, include_z=True, return_index=True)
    if len(shapes) == 0:
        return np.zeros((0, 6))
    first = np.flatnonzero(np.diff(owner, prepend=-1))
    low, high = np.minimum.reduceat(xyz, first, axis=0), np.maximum.reduceat(xyz, first, axis=0)
    return np.stack([low, high], axis=2).reshape(-1, 6)


def geometry_blobs(shapes: AnyArray, srs_id: int) -> list[bytes]:
    """Return geometries as GeoPackage blobs: a header with the extent, then WKB."""
    head = struct.Struct("<2sBBi6d")
    return [
        head.pack(b"GP", 0, _BLOB_FLAGS, srs_id, *row) + wkb
        for row, wkb in zip(shape_bounds(shapes).tolist(), shapely.to_wkb(shapes, flavor="iso"), strict=True)
    ]


def sql_values(column: AnyArray) -> list[object]:
    """Return a column as values that SQLite takes, NaN as None."""
    values: list[object] = column.tolist()
    return [None if v != v else v for v in values] if column.dtype.kind == "f" else values
