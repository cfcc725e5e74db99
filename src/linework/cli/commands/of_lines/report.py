"""`linework report`: what can be measured between lines, by chainage.

Separate from the other commands, as every command has its own file.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from linework.cli.options import AllowOutside, AllowRemote, Crs, Overwrite, Quiet, WorkFolder
from linework.cli.said import say


def report_command(
    lines: Annotated[Path, typer.Argument(metavar="LINES", help="Extracted lines.")],
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="FILE", help="Output file: .html, .xlsx, .csv or .gpkg.")
    ],
    route: Annotated[
        Path | None,
        typer.Option("--route", metavar="FILE", help="Lines to which chainages refer, each with its id."),
    ] = None,
    trajectory: Annotated[
        Path | None,
        typer.Option("--trajectory", metavar="FILE", help="Driven path to which chainages refer."),
    ] = None,
    every: Annotated[float, typer.Option("--every", help="Length of an interval [m].")] = 10.0,
    standard: Annotated[
        str, typer.Option("--standard", help="Limits to compare with: us, uk or de; default: none.")
    ] = "",
    survey: Annotated[
        list[Path] | None,
        typer.Option(
            "--survey",
            metavar="SURVEY",
            help="Points of the lines: what is left of the paint. Can be repeated.",
        ),
    ] = None,
    overwrite: Overwrite = False,
    crs: Crs = None,
    allow_outside: AllowOutside = False,
    allow_remote: AllowRemote = False,
    work: WorkFolder = None,
    quiet: Quiet = False,
) -> None:
    """Report heights, widths and gaps of LINES by intervals of a route.

    Chainages refer to --route or --trajectory, else to the longest of the lines. Every value has its standard deviation
    and the share that was measured; what was hidden is unknown. With --survey also how much of the paint is left, its
    contrast to the road and its width.
    """
    import dataclasses

    from linework.cli.commands.of_lines.survey_points import LinesAndPoints
    from linework.cli.failures import warn
    from linework.errors import UsageError, argument, check_extra
    from linework.evaluation.chainage.routes import own_routes, route_of_path, routes_of_file
    from linework.evaluation.chainage.rows import ChainageRow, chainage_report
    from linework.evaluation.chainage.stretches import stretch_of_row
    from linework.files.maps.row_tables import values_of, write_rows
    from linework.files.output.locks import reserve_output
    from linework.files.output.publish import write_page
    from linework.files.vectors.read_write import read_usable_lines
    from linework.lines.units import in_metres

    suffix = output.suffix.lower()
    if suffix not in (".html", ".xlsx", ".csv", ".gpkg"):
        raise UsageError(
            f"cannot write '{suffix}' reports", where=output, advice="use .html, .xlsx, .csv or .gpkg"
        )
    if suffix in (".html", ".xlsx"):
        check_extra("reports", where=output)
    if route is not None and trajectory is not None:
        raise UsageError(
            "two axes to refer to", where=argument("route"), advice=f"leave {argument('trajectory')} out"
        )
    with reserve_output(output, overwrite=overwrite, inputs=[lines, route, trajectory]):
        found, left_out = read_usable_lines(lines, crs=crs)
        if left_out:
            warn(left_out)
        found = in_metres(found)
        if route is not None:
            axes, named = routes_of_file(in_metres(read_usable_lines(route, crs=found.crs)[0])), str(route)
        elif trajectory is not None:
            from linework.library.read import read_trajectory

            path = read_trajectory(trajectory, crs=found.crs)
            axes, named = route_of_path(path.xyz), str(trajectory)
        else:
            axes = own_routes(found)
            named = "the lines themselves: " + ", ".join(axis.name for axis in axes)
        paint, dashes = None, None
        if survey:
            paint, dashes = LinesAndPoints(
                lines=found, paths=survey, options=("survey",), crs=crs, allow_outside=allow_outside,
                allow_remote=allow_remote, work=work, quiet=quiet,
            ).paint_and_dashes()  # fmt: skip
        result = chainage_report(found, axes, every_m=every, standard=standard, paint=paint, dashes=dashes)
        if suffix == ".html":
            from linework.crs import describe_crs
            from linework.evaluation.chainage.page import chainage_page

            facts = {
                "lines": f"{lines} ({len(found):,})", "chainage along": named, "interval": f"{every:g} m",
                "limits": standard or "none", "CRS": describe_crs(found.crs),
            }  # fmt: skip
            write_page(
                chainage_page(result, found, facts, title=f"Report of {lines.name}"),
                output,
                overwrite=overwrite,
            )
        else:
            names = [field.name for field in dataclasses.fields(ChainageRow)]
            pieces = [stretch_of_row(result, row) for row in result.rows]
            rows = [values_of(row) for row in result.rows]
            write_rows(
                names, rows, pieces, found.crs, output, layer="chainage", by="topic", overwrite=overwrite
            )
    say(f"{len(result.rows):,} rows in {output}; chainage along {named}")
