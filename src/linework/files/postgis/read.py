"""Read published lines from PostGIS."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from linework.arrays import offsets_of
from linework.crs import parse_crs
from linework.errors import InputError, UsageError
from linework.files.postgis.address import database_address, opened_database
from linework.files.postgis.tables import LINE_FIELDS, VERTEX_FIELDS, line_of_ewkb
from linework.model.columns import column_types
from linework.model.lines import VERTEX_COLUMNS, LineSet
from linework.model.lineset.geometries import column_values


def read_database(path: str | Path, kind_field: str, kinds: Mapping[str, str] | None) -> LineSet:
    """Return the lines at an address; lines that people rejected are left out.

    Raises
    ------
    UsageError
        The database has several surveys, and the address names none.
    InputError
        There are no lines of linework.
    MachineError
        No connection.
    """
    address = database_address(path)
    with opened_database(address) as connection:
        names = [
            row[0]
            for row in connection.execute(f"SELECT survey FROM {address.schema}.survey ORDER BY survey")
        ]
        if address.survey and address.survey not in names:
            raise InputError(
                f"no survey {address.survey}", where=address, advice=f"there are {', '.join(names)[:80]}"
            )
        if not address.survey and len(names) != 1:
            listed = f"{len(names)} surveys: {', '.join(names)[:80]}" if names else "no survey"
            raise UsageError(listed, where=address, advice="name one with ?survey=NAME")
        found = published_lines(
            connection, address.schema, survey=address.survey or names[0], layer=address.layer
        )
    if found is None:
        raise InputError(
            f"no lines of the kind {address.layer}", where=address, advice="leave layer out to read all"
        )
    found = found.take(found.review != "rejected")
    if kinds is None and kind_field == "kind":
        return found
    values = getattr(found, kind_field).tolist() if kind_field in LINE_FIELDS else found.kind.tolist()
    wanted = [i for i, value in enumerate(values) if kinds is None or value in kinds]
    named = [str(values[i]) if kinds is None else kinds[values[i]] for i in wanted]
    return found.take(np.array(wanted, dtype=np.int64)).with_columns(kind=np.array(named, dtype=np.str_))


def columns_there(connection: Any, schema: str) -> set[str]:
    """Return the columns that the table of lines has."""
    rows = connection.execute(
        "SELECT column_name FROM information_schema.columns WHERE table_schema = %s AND table_name = 'line'",
        (schema,),
    ).fetchall()
    return {name for (name,) in rows}


def published_lines(
    connection: Any, schema: str, *, survey: str, layer: str = "", only_reviewed: bool = False
) -> LineSet | None:
    """Return the lines of a survey in their order, None where there are none of the kind `layer`.

    Parameters
    ----------
    only_reviewed
        Only those with a review decision.
    """
    crs = connection.execute(f"SELECT crs_wkt FROM {schema}.survey WHERE survey = %s", (survey,)).fetchone()[
        0
    ]
    # Tables of an earlier version lack the columns that have come since
    there = columns_there(connection, schema)
    names = ", ".join(name if name in there else f"NULL AS {name}" for name in (*LINE_FIELDS, *VERTEX_FIELDS))
    where = (
        "survey = %s"
        + (" AND kind = %s" if layer else "")
        + (" AND review IS NOT NULL" if only_reviewed else "")
    )
    with connection.cursor(binary=True) as cursor:
        cursor.execute(
            f"SELECT {names}, ST_AsEWKB(geom) FROM {schema}.line WHERE {where} ORDER BY number, id",
            (survey, layer) if layer else (survey,),
        )
        rows = cursor.fetchall()
    if not rows:
        return None if layer else LineSet.empty(parse_crs(crs))
    columns = list(zip(*rows, strict=True))
    given: dict[str, Any] = {name: column_values(name, columns[i]) for i, name in enumerate(LINE_FIELDS)}
    for i, name in enumerate(VERTEX_COLUMNS, start=len(LINE_FIELDS)):
        dtype = column_types(LineSet)[name].dtype
        given[name] = np.concatenate([np.array(values, dtype=dtype) for values in columns[i]])
    shapes = [line_of_ewkb(bytes(stored)) for stored in columns[-1]]
    return LineSet(
        xyz=np.concatenate(shapes),
        offsets=offsets_of([len(shape) for shape in shapes]),
        crs=parse_crs(crs),
        **given,
    )
