"""Lines as they are saved now, in any format, as a file for the browser; and the feature codes that the survey keeps.

Separate from the other routes of the review: these write files.
"""

from __future__ import annotations

import asyncio
import tempfile
import zipfile
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Literal
from urllib.parse import quote

import numpy as np
from fastapi import APIRouter, Response
from pydantic import Field

from linework.errors import InputError, UsageError
from linework.files.input import read_input_text
from linework.files.line_file.file import LineFile
from linework.files.output.publish import publish
from linework.files.vectors.cad_codes import codes_of_lines, read_cad_codes
from linework.files.vectors.gpkg import read_poles
from linework.files.vectors.lane_layer import check_lanes
from linework.files.vectors.point_layers import read_point_layers
from linework.files.vectors.read_write import not_expressed, points_left_out, write_lines
from linework.model.lines import REJECTED_REVIEW, LineSet
from linework.workbench.server.app_state import CurrentState
from linework.workbench.server.documents import Document

export_router = APIRouter(prefix="/api")
#: Header of the answer: what the format cannot hold, one warning a line, percent-encoded.
WARNINGS_HEADER = "linework-warnings"
#: Lines that can be named in one request; a whole survey is exported by its kinds.
_MOST_NAMED = 20_000
_LONGEST_TABLE = 1 << 19
#: Time of the members of a ZIP archive: the same lines give the same bytes (its format begins with 1980).
_TIME = (1980, 1, 1, 0, 0, 0)
_Name = Annotated[str, Field(max_length=80)]


class ExportOrder(Document):
    """The format (its suffix, without the dot) and the lines; rejected lines are never exported.

    Parameters
    ----------
    kinds
        Kinds to export; empty: all.
    ids
        Lines to export; None: all of the kinds.
    coded
        Whether a .dxf gets the layers and codes of the survey's table.
    lanes, location
        As for `linework.files.vectors.read_write.write_lines`.
    """

    format: Literal["gpkg", "geojson", "parquet", "dxf", "fgb", "kml", "landxml", "osm", "xodr"]
    kinds: Annotated[tuple[_Name, ...], Field(max_length=100)] = ()
    ids: Annotated[tuple[_Name, ...], Field(max_length=_MOST_NAMED)] | None = None
    coded: bool = False
    lanes: bool = False
    location: Literal["", "urban", "nonurban", "private"] = ""


class CodeTable(Document):
    """The survey's table of feature codes as CSV text; "" where it has none."""

    text: Annotated[str, Field(max_length=_LONGEST_TABLE)] = ""


def codes_path(lines: Path) -> Path:
    """Return where the table of feature codes of a line file is kept: beside it.

    >>> codes_path(Path("drive/lines.gpkg")).as_posix()
    'drive/lines.codes.csv'
    """
    return lines.with_suffix(".codes.csv")


@export_router.get("/codes")
async def get_codes(app_state: CurrentState) -> CodeTable:
    """Return the survey's table of feature codes."""
    return CodeTable(text=await asyncio.to_thread(_text_of, codes_path(app_state.line_file.path)))


def _text_of(path: Path) -> str:
    """Return the text of the table; "" where there is none."""
    if path.is_symlink():
        # The page gets nothing that lies elsewhere
        raise InputError("is a link", where=path, advice="put the table itself there")
    if not path.exists():
        return ""
    return read_input_text(path, max_bytes=_LONGEST_TABLE, advice="keep one row for each kind of line")


@export_router.put("/codes")
async def save_codes(table: CodeTable, app_state: CurrentState) -> CodeTable:
    """Save the survey's table of feature codes; a table with a fault is refused, and the old one stays."""
    await asyncio.to_thread(_save_codes, table.text, codes_path(app_state.line_file.path))
    return table


def _save_codes(text: str, path: Path) -> None:
    def write(part: Path) -> None:
        part.write_text(text, encoding="utf-8", newline="")

    with tempfile.TemporaryDirectory() as folder:
        tried = Path(folder) / path.name
        write(tried)
        _check_codes(tried)
    publish(path, write, _check_codes, overwrite=True)


def _check_codes(path: Path) -> None:
    read_cad_codes(path)


@export_router.post("/export", response_class=Response)
async def export_lines(order: ExportOrder, app_state: CurrentState) -> Response:
    """Return the lines as a file: a ZIP archive where a format has a second file (the .prj of a .dxf)."""
    name, content, warnings = await asyncio.to_thread(exported, app_state.line_file, order)
    return Response(
        content, media_type="application/octet-stream",
        headers={
            "Content-Disposition": f"attachment; filename*=UTF-8''{quote(name)}",
            WARNINGS_HEADER: quote("\n".join(warnings)),
        },
    )  # fmt: skip


def exported(line_file: LineFile, order: ExportOrder) -> tuple[str, bytes, list[str]]:
    """Return the name and the bytes of an export, and what the format cannot hold of the lines.

    Raises
    ------
    InputError
        There is nothing to export, the table of feature codes has a fault, the format has no lanes, or lanelets are
        wanted without a location.
    """
    lines = _chosen(line_file.lines, order)
    if not len(lines):
        raise InputError("no lines to export", advice="choose other kinds, or show more lines in the table")
    table_path = codes_path(line_file.path)
    is_coded = order.coded and order.format == "dxf" and bool(_text_of(table_path))
    codes = read_cad_codes(table_path) if is_coded else ()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"{line_file.path.stem}.{order.format}"
        points = read_point_layers(line_file.path)
        if order.ids is None and "cable" in lines.kind:
            # Poles are not edited: those of the file, of the networks that are exported
            poles = read_poles(line_file.path)
            own = np.isin(poles.network, lines.network[lines.kind == "cable"])
            lines = LineSet.concatenate([lines, poles.take(own).with_columns(crs=lines.crs)])
        try:
            check_lanes(path, lanes=order.lanes, location=order.location)
        except UsageError as error:
            # The error names options of the command line, which the page does not have
            raise InputError(error.problem, advice="choose another format, or leave the lanes out") from error
        write_lines(
            lines, path, kinds=sorted(set(lines.kind.tolist())), points=points, codes=codes, lanes=order.lanes,
            location=order.location,
        )  # fmt: skip
        warnings = [*points_left_out(path, points), *not_expressed(lines, path, order.location)]
        uncoded = {kind for kind, code in zip(lines.kind.tolist(), codes_of_lines(lines, codes), strict=True)
                   if codes and code is None}  # fmt: skip
        if order.coded and order.format == "dxf" and not codes:
            warnings.append("the survey has no feature codes: layers are named for the kinds")
        if uncoded:
            warnings.append(
                f"no feature code for {', '.join(sorted(uncoded))}: on layers named for the kinds"
            )
        name, content = _packed(sorted(Path(folder).iterdir()))
    # The page needs no folder of this machine
    return name, content, [text.replace(f"{folder}/", "") for text in warnings]


def _chosen(lines: LineSet, order: ExportOrder) -> LineSet:
    chosen = lines.review != REJECTED_REVIEW
    if order.kinds:
        chosen &= np.isin(lines.kind, order.kinds)
    if order.ids is not None:
        chosen &= np.isin(lines.id, order.ids)
    return lines.take(chosen)


def _packed(files: Sequence[Path]) -> tuple[str, bytes]:
    """Return the name and the bytes of a file, or of several as a ZIP archive named for the first."""
    if len(files) == 1:
        return files[0].name, files[0].read_bytes()
    with tempfile.TemporaryFile() as packed:
        with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
            for file in files:
                archive.writestr(zipfile.ZipInfo(file.name, _TIME), file.read_bytes(), zipfile.ZIP_DEFLATED)
        packed.seek(0)
        return f"{files[0].name}.zip", packed.read()
