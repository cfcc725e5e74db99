"""Tables of published lines, and lines as their rows."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from typing import Any

import numpy as np

from linework.arrays import FloatArray, distance_along
from linework.lines.units import in_metres
from linework.model.columns import column_types
from linework.model.lines import KINDS, LINE_COLUMNS, POLE, VERTEX_COLUMNS, LineSet

_SQL_TYPES = {np.str_: "text", np.float64: "double precision", np.bool_: "boolean"}
#: Types of PostGIS's EWKB: LineString with Z, M and SRID, little endian.
_EWKB_LINE = 2 | 0x80000000 | 0x40000000 | 0x20000000
#: Columns of lines in the order of the table.
LINE_FIELDS = tuple(LINE_COLUMNS)
VERTEX_FIELDS = tuple(f"vertex_{name}" for name in VERTEX_COLUMNS)
ROW_FIELDS = ("survey", "number", *LINE_FIELDS, "length_m", *VERTEX_FIELDS, "geom")


def field_types() -> dict[str, str]:
    """Return the SQL type of each column of the table of lines."""
    types = column_types(LineSet)
    found = {"survey": "text", "number": "bigint"}
    found |= {name: _SQL_TYPES[types[name].dtype] for name in LINE_FIELDS}
    found["length_m"] = "double precision"
    for field, name in zip(VERTEX_FIELDS, VERTEX_COLUMNS, strict=True):
        found[field] = _SQL_TYPES[types[name].dtype] + "[]"
    return found | {"geom": "geometry(LineStringZM)"}


#: Columns of a stretch of a marking: mean, standard deviation; NULL where it was hidden.
PAINT_FIELDS = {
    "remaining_paint": "remaining_paint", "sigma_remaining_paint": "remaining_paint", "contrast": "contrast",
    "sigma_contrast": "contrast", "painted_width_m": "width", "sigma_painted_width_m": "width",
}  # fmt: skip


def paint_statements(schema: str) -> list[str]:
    """Return the statements that make what is left of the paint: a table of stretches, and a view with their places."""
    columns = ", ".join(f"{name} double precision" for name in PAINT_FIELDS)
    return [
        f"CREATE TABLE {schema}.paint (survey text NOT NULL, id text NOT NULL, from_m double precision NOT NULL, "
        f"to_m double precision NOT NULL, {columns}, measured_share double precision NOT NULL, "
        f"PRIMARY KEY (survey, id, from_m), FOREIGN KEY (survey, id) REFERENCES {schema}.line ON DELETE CASCADE)",
        f"CREATE VIEW {schema}.lane_marking_paint AS SELECT paint.*, line.pattern, line.role, "
        "ST_LocateBetween(line.geom, paint.from_m, paint.to_m) AS geom "
        f"FROM {schema}.paint JOIN {schema}.line USING (survey, id) WHERE line.review IS DISTINCT FROM 'rejected'",
    ]


def view_statements(schema: str) -> list[str]:
    """Return the statements that make or renew the view of each kind, and of the poles."""
    kinds = [
        f"CREATE OR REPLACE VIEW {schema}.{kind} AS SELECT * FROM {schema}.line WHERE kind = '{kind}' "
        "AND review IS DISTINCT FROM 'rejected'"
        for kind in KINDS
    ]
    # In a set of lines a pole is upright from its foot to its top; here it is where it stands
    pole = (
        f"CREATE OR REPLACE VIEW {schema}.{POLE} AS SELECT survey, id, form, network, height_m, confidence, source, "
        f"review, ST_StartPoint(geom) AS geom FROM {schema}.line WHERE kind = '{POLE}' "
        "AND review IS DISTINCT FROM 'rejected'"
    )
    return [*kinds, pole]


def schema_statements(schema: str) -> list[str]:
    """Return the statements that make the schema: tables, indices, and a view per kind."""
    columns = ", ".join(
        f"{name} {kind}{' NOT NULL' if name in ('survey', 'number', 'id', 'kind', 'geom') else ''}"
        for name, kind in field_types().items()
    )
    return [
        f"CREATE SCHEMA IF NOT EXISTS {schema}",
        # Most compound CRSs are not in spatial_ref_sys: geometries have the SRID of the plan, the WKT is whole
        f"CREATE TABLE {schema}.survey (survey text PRIMARY KEY, srid integer NOT NULL, crs_name text NOT NULL, "
        "crs_wkt text NOT NULL)",
        f"CREATE TABLE {schema}.run (run bigint GENERATED ALWAYS AS IDENTITY PRIMARY KEY, survey text NOT NULL "
        f"REFERENCES {schema}.survey, published timestamptz NOT NULL DEFAULT now(), source text, version text, "
        "written integer, unchanged integer, removed integer, kept integer)",
        f"CREATE TABLE {schema}.line ({columns}, PRIMARY KEY (survey, id), "
        f"FOREIGN KEY (survey) REFERENCES {schema}.survey)",
        f"CREATE INDEX line_geom ON {schema}.line USING gist (geom)",
        f"CREATE INDEX line_kind ON {schema}.line (kind)",
        *paint_statements(schema),
        *view_statements(schema),
    ]


def rows_of_lines(lines: LineSet, survey: str, srid: int) -> Iterator[list[Any]]:
    """Yield a row per line; the measure M of a vertex is its distance from the line's start in plan [m].

    Coordinates stay in the units of their CRS.
    """
    metres = in_metres(lines)
    columns = [getattr(lines, name).tolist() for name in LINE_FIELDS]
    lengths = metres.length_m.tolist()
    for i in range(len(lines)):
        first, last = int(lines.offsets[i]), int(lines.offsets[i + 1])
        own = [column[i] for column in columns]
        vertices = [getattr(lines, name)[first:last].tolist() for name in VERTEX_COLUMNS]
        yield [
            survey,
            i,
            *map(_or_null, own),
            lengths[i],
            *vertices,
            ewkb_of_line(lines.xyz[first:last], srid, distance_along(metres.xyz[first:last])),
        ]


def _or_null(value: Any) -> Any:
    """Return a value of a column, None for what is not known."""
    return None if value == "" or value != value else value


def ewkb_of_line(xyz: FloatArray, srid: int, measures: FloatArray) -> bytes:
    """Return a line as PostGIS's EWKB with measures (n,).

    >>> len(ewkb_of_line(np.zeros((2, 3)), 25832, np.zeros(2)))
    77
    """
    head = struct.pack("<BIII", 1, _EWKB_LINE, srid, len(xyz))
    return head + np.column_stack([xyz, measures]).astype("<f8").tobytes()


def line_of_ewkb(stored: bytes) -> FloatArray:
    """Return the (n, 3) vertices of a line in EWKB: with or without a SRID, with Z and M."""
    order = "<" if stored[0] else ">"
    kind = struct.unpack(order + "I", stored[1:5])[0]
    at = 9 if kind & 0x20000000 else 5
    n = struct.unpack(order + "I", stored[at : at + 4])[0]
    return np.frombuffer(stored, order + "f8", n * 4, at + 4).reshape(n, 4)[:, :3].astype(np.float64)
