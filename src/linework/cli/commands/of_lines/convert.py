"""`linework convert`: lines from one vector format to another.

Separate from the other commands, as every command has its own file.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from linework.cli.options import Crs, Location, Overwrite, WithLanes
from linework.cli.said import say


def convert(
    lines: Annotated[Path, typer.Argument(metavar="LINES", help="Input file.")],
    output: Annotated[
        Path, typer.Argument(metavar="OUT", help="Output file; its suffix selects the format.")
    ],
    overwrite: Overwrite = False,
    crs: Crs = None,
    heights: Annotated[
        str,
        typer.Option("--heights", help="Heights in a Lanelet2 map (.osm): crs (as they are) or ellipsoid."),
    ] = "crs",
    codes: Annotated[
        Path | None,
        typer.Option(
            "--codes",
            metavar="FILE",
            help="Feature codes of a .dxf: CSV with kind, pattern, role, form, layer, code.",
        ),
    ] = None,
    lanes: WithLanes = False,
    location: Location = "",
    merge_doubles: Annotated[
        bool,
        typer.Option(
            "--merge-doubles", help="Write each double line as one line (.osm and .xodr always do)."
        ),
    ] = False,
    background: Annotated[
        list[Path] | None,
        typer.Option(
            "--background",
            metavar="FILE",
            help="Image or points below the lines of a .qgz: .tif, .las, .laz.",
        ),
    ] = None,
) -> None:
    """Convert LINES to another vector format.

    The points of the vehicle's log (images and operator keys) are copied where the format holds points. What the format
    cannot hold is reported. --lanes adds the lanes that follow from the lines alone. A .qgz is a QGIS project with the layers of a .gpkg, which it refers to.
    """
    from linework.cli.failures import warn
    from linework.errors import PartialError, UsageError, argument
    from linework.files.output.locks import reserve_output
    from linework.files.vectors.cad_codes import codes_of_lines, read_cad_codes
    from linework.files.vectors.fields import lines_with_heights
    from linework.files.vectors.lane_layer import check_lanes
    from linework.files.vectors.point_layers import read_point_layers
    from linework.files.vectors.read_write import (
        check_format,
        not_expressed,
        points_left_out,
        read_lines,
        read_usable_lines,
        write_lines,
    )
    from linework.lines.doubles import merged_doubles
    from linework.lines.units import in_metres, in_units_of

    check_lanes(output, lanes=lanes, location=location)
    if output.suffix.lower() == ".qgz":
        if merge_doubles:
            raise UsageError(
                f"a project refers to {lines}, which has the stripes", where=argument("merge_doubles", True),
                advice="merge into a .gpkg first",
            )  # fmt: skip
        from linework.files.maps.qgis_project import write_qgis_project

        below = background or []
        with reserve_output(output, overwrite=overwrite, inputs=[lines, *below]):
            n_layers = write_qgis_project(lines, output, below, overwrite=overwrite)
        say(f"{n_layers} layers of {lines} in {output}")
        return
    if background:
        raise UsageError(
            f"{output} holds lines only", where=argument("background"), advice="give a .qgz as the output"
        )
    check_format(output)
    if heights not in ("crs", "ellipsoid"):
        raise UsageError(
            f"unknown heights '{heights}'", where=argument("heights"), advice="use crs or ellipsoid"
        )
    with reserve_output(output, overwrite=overwrite, inputs=[lines, codes]):
        table = read_cad_codes(codes) if codes is not None else ()
        found, left_out = read_usable_lines(lines, crs=crs)
        found, flat = lines_with_heights(found)
        left_out = "; ".join(filter(None, (left_out, f"{lines}: {flat}" if flat else "")))
        if merge_doubles:
            found = in_units_of(merged_doubles(in_metres(found)).lines, found.crs)
        points = read_point_layers(lines)
        write_lines(
            found, output, kinds=sorted(set(found.kind)), points=points, overwrite=overwrite, heights=heights,
            codes=table, lanes=lanes, location=location,
        )  # fmt: skip
    uncoded = sorted({kind for kind, code in zip(found.kind.tolist(), codes_of_lines(found, table), strict=True)
                      if table and code is None})  # fmt: skip
    if uncoded:
        warn(f"{codes}: no row for {', '.join(uncoded)}: on layers named for the kinds")
    for warning in (*points_left_out(output, points), *not_expressed(found, output, location)):
        warn(warning)
    # Maps of lanes hold a part of the lines
    n_lines = len(read_lines(output)) if output.suffix.lower() in (".osm", ".xodr") else len(found)
    say(f"{n_lines:,} lines in {output}")
    if left_out:
        raise PartialError(left_out, advice="the other lines are converted")
