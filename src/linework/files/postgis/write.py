"""Publish lines to PostGIS: in one transaction, by id, keeping what people have reviewed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pyproj

import linework
from linework.crs import LOCAL, describe_crs, horizontal_part, same_crs
from linework.editing.queue.carried_over import carry_over_reviews
from linework.errors import CrsError, MachineError, UsageError
from linework.files.postgis.address import DatabaseAddress, opened_database
from linework.files.postgis.read import columns_there, published_lines
from linework.files.postgis.tables import (
    LINE_FIELDS,
    PAINT_FIELDS,
    ROW_FIELDS,
    VERTEX_FIELDS,
    field_types,
    line_of_ewkb,
    paint_statements,
    rows_of_lines,
    schema_statements,
    view_statements,
)
from linework.files.vectors.fields import check_writable
from linework.lines.along import PaintStretch
from linework.lines.names import with_ids
from linework.model.lines import KINDS, POLE, LineSet

#: Types of the rows as they are sent; geometries are bytes to the library.
_SENT = {"text": "text", "bigint": "int8", "double precision": "float8", "boolean": "bool",
         "double precision[]": "float8[]", "boolean[]": "bool[]"}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Published:
    """What a publication changed.

    Parameters
    ----------
    written
        Lines that are new or different.
    unchanged
        Lines that were there already.
    removed
        Lines of the survey that are no longer found.
    kept
        Reviewed lines in the database, which stay as they are.
    """

    written: int
    unchanged: int
    removed: int
    kept: int


def publish_lines(
    lines: LineSet,
    address: DatabaseAddress,
    survey: str,
    *,
    source: str = "",
    paint: Sequence[PaintStretch] | None = None,
) -> Published:
    """Replace the lines of a survey in the database.

    Lines of other surveys are not touched. Lines of this one that somebody has reviewed stay, and lines along them are
    not written again, unless the new lines have a review for the same id. Everything happens in one transaction; what
    was written is read back before it is committed.

    Parameters
    ----------
    paint
        What is left of the markings of `lines`, by stretches: it replaces what the survey has in the table of paint. None:
        what is there stays for lines that are the same.

    Raises
    ------
    UsageError
        Lines that cannot be written, or two with the same id.
    CrsError
        The survey is there in another CRS.
    MachineError
        No connection, no permission, a full disk, or other lines read back than were written.
    """
    check_writable(lines, address)
    lines = with_ids(lines, ())
    ids, counts = np.unique(lines.id, return_counts=True)
    if (counts > 1).any():
        raise UsageError(f"{int(counts.max())} lines have the id {ids[counts.argmax()]}", where=address,
                         advice="give every line an id of its own")  # fmt: skip
    srid = _srid(lines.crs)
    with opened_database(address) as connection:
        # Two publications of one survey wait for each other
        connection.execute(
            "SELECT pg_advisory_xact_lock(hashtext(%s), hashtext(%s))", (address.schema, survey)
        )
        if connection.execute("SELECT to_regclass(%s)", (f"{address.schema}.line",)).fetchone() == (None,):
            for statement in schema_statements(address.schema):
                connection.execute(statement)
        _add_new_columns(connection, address.schema)
        _enter_survey(connection, address, survey, lines.crs, srid)
        reviewed = published_lines(connection, address.schema, survey=survey, only_reviewed=True)
        there = lines.empty(lines.crs) if reviewed is None else reviewed
        own = lines.id[lines.review != ""]
        there = there.take(~np.isin(there.id, own))
        new = carry_over_reviews(lines, there).new if len(there) else lines
        counts_by_name = _merge(connection, address.schema, survey, new, srid, there.id.tolist())
        _check_stored(connection, address, survey, new)
        if paint is not None:
            _replace_paint(connection, address.schema, survey, lines.id.tolist(), paint)
        found = Published(kept=len(there), **counts_by_name)
        connection.execute(
            f"INSERT INTO {address.schema}.run (survey, source, version, written, unchanged, removed, kept) "
            "VALUES (%s, %s, %s, %s, %s, %s, %s)",
            (survey, source, linework.__version__, found.written, found.unchanged, found.removed, found.kept),
        )
    return found


def _add_new_columns(connection: Any, schema: str) -> None:
    """Add the columns of lines that an earlier version of linework did not have, and views of its kinds."""
    there = columns_there(connection, schema)
    missing = {name: kind for name, kind in field_types().items() if name not in there}
    query = "SELECT table_name FROM information_schema.views WHERE table_schema = %s"
    if missing or not {*KINDS, POLE} <= {row[0] for row in connection.execute(query, (schema,))}:
        # Another survey may be published into the schema at the same time
        connection.execute("SELECT pg_advisory_xact_lock(hashtext(%s), 0)", (schema,))
        for name, kind in missing.items():
            connection.execute(f"ALTER TABLE {schema}.line ADD COLUMN IF NOT EXISTS {name} {kind}")
        for statement in view_statements(schema):
            connection.execute(statement)


def _replace_paint(
    connection: Any, schema: str, survey: str, ids: list[str], paint: Sequence[PaintStretch]
) -> None:
    """Replace what is left of the paint of a survey; reviewed lines that stay keep theirs."""
    if connection.execute("SELECT to_regclass(%s)", (f"{schema}.paint",)).fetchone() == (None,):
        for statement in paint_statements(schema):
            connection.execute(statement)
    connection.execute(
        f"DELETE FROM {schema}.paint WHERE survey = %s AND id IN (SELECT id FROM incoming)", (survey,)
    )
    own = {row[0] for row in connection.execute("SELECT id FROM incoming")}
    names = ("survey", "id", "from_m", "to_m", *PAINT_FIELDS, "measured_share")
    with (
        connection.cursor() as cursor,
        cursor.copy(f"COPY {schema}.paint ({', '.join(names)}) FROM STDIN (FORMAT BINARY)") as copy,
    ):
        copy.set_types(["text", "text", *["float8"] * (len(names) - 2)])
        for one in paint:
            if ids[one.line] in own:
                values = [one.values[of][name.startswith("sigma_")] for name, of in PAINT_FIELDS.items()]
                copy.write_row([survey, ids[one.line], one.from_m, one.to_m, *values, one.measured_share])


def _srid(crs: str) -> int:
    """Return the EPSG code of the plan, 0 without one."""
    if crs == LOCAL:
        return 0
    return int(horizontal_part(pyproj.CRS.from_wkt(crs)).to_epsg() or 0)


def _enter_survey(connection: Any, address: DatabaseAddress, survey: str, crs: str, srid: int) -> None:
    row = connection.execute(
        f"SELECT crs_wkt, crs_name FROM {address.schema}.survey WHERE survey = %s", (survey,)
    ).fetchone()
    if row is None:
        connection.execute(
            f"INSERT INTO {address.schema}.survey (survey, srid, crs_name, crs_wkt) VALUES (%s, %s, %s, %s)",
            (survey, srid, describe_crs(crs), crs),
        )
    elif not same_crs(row[0], crs):
        raise CrsError(f"survey {survey} is there in {row[1]}, these lines are in {describe_crs(crs)}", where=address,
                       advice="publish it under another name")  # fmt: skip


def _merge(
    connection: Any, schema: str, survey: str, lines: LineSet, srid: int, kept: list[str]
) -> Mapping[str, int]:
    """Send lines to a temporary table, and change what differs from it."""
    types = field_types()
    plain = ", ".join(f"{name} {kind.replace('(LineStringZM)', '')}" for name, kind in types.items())
    connection.execute(f"CREATE TEMPORARY TABLE incoming ({plain}) ON COMMIT DROP")
    with connection.cursor() as cursor:
        with cursor.copy(f"COPY incoming ({', '.join(ROW_FIELDS)}) FROM STDIN (FORMAT BINARY)") as copy:
            copy.set_types([_SENT.get(kind, "bytea") for kind in types.values()])
            for row in rows_of_lines(lines, survey, srid):
                copy.write_row(row)
        cursor.execute("CREATE UNIQUE INDEX ON incoming (id)")
        cursor.execute("ANALYZE incoming")
        names = ", ".join(ROW_FIELDS)
        changed = [*LINE_FIELDS, "number", "length_m", *VERTEX_FIELDS]
        # Geometries are compared by their bytes: "=" compares boxes
        differs = " OR ".join(
            [f"old.{name} IS DISTINCT FROM excluded.{name}" for name in changed]
            + ["ST_AsEWKB(old.geom) IS DISTINCT FROM ST_AsEWKB(excluded.geom)"]
        )
        sets = ", ".join(f"{name} = excluded.{name}" for name in (*changed, "geom"))
        cursor.execute(
            f"INSERT INTO {schema}.line AS old ({names}) SELECT {names} FROM incoming "
            f"ON CONFLICT (survey, id) DO UPDATE SET {sets} WHERE {differs} RETURNING id"
        )
        changed_ids = [row[0] for row in cursor]
        written = len(changed_ids)
        # What was measured on another shape of a line does not hold for this one
        if cursor.execute("SELECT to_regclass(%s)", (f"{schema}.paint",)).fetchone() != (None,):
            cursor.execute(
                f"DELETE FROM {schema}.paint WHERE survey = %s AND id = ANY(%s)", (survey, changed_ids)
            )
        cursor.execute(
            f"DELETE FROM {schema}.line WHERE survey = %s AND NOT (id = ANY(%s)) "
            "AND NOT EXISTS (SELECT 1 FROM incoming WHERE incoming.id = line.id)",
            (survey, kept),
        )
        removed = cursor.rowcount
    return {"written": written, "unchanged": len(lines) - written, "removed": removed}


def _check_stored(connection: Any, address: DatabaseAddress, survey: str, lines: LineSet) -> None:
    """Read the lines back and compare every coordinate.

    Raises
    ------
    MachineError
        Not the lines that were written.
    """
    with connection.cursor(binary=True) as cursor:
        cursor.execute(
            f"SELECT ST_AsEWKB(line.geom) FROM {address.schema}.line JOIN incoming USING (survey, id) "
            "WHERE survey = %s ORDER BY incoming.number",
            (survey,),
        )
        stored = [line_of_ewkb(bytes(row[0])) for row in cursor]
    same = len(stored) == len(lines) and (not stored or np.array_equal(np.concatenate(stored), lines.xyz))
    if not same:
        raise MachineError(
            "lines do not read back the same", where=address, advice="check the server, and run it again"
        )
