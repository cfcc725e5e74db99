"""`linework convert`: lines from one vector format to another."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def convert(
    lines: Annotated[Path, typer.Argument(metavar="LINES", help="Lines to read.")],
    output: Annotated[Path, typer.Argument(metavar="OUT", help="File to write; its suffix says the format.")],
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace OUT.")] = False,
    crs: Annotated[
        str, typer.Option("--crs", help="EPSG:... or local: the CRS where LINES does not say.")
    ] = "",
) -> None:
    """Convert LINES to another vector format; the points of the van's log go with them where it holds points."""
    from linework.cli.failures import warn
    from linework.errors import UsageError
    from linework.files.output.locks import reserve_output
    from linework.files.vectors.point_layers import read_point_layers
    from linework.files.vectors.read_write import check_format, points_left_out, read_lines, write_lines

    check_format(output)
    if output.exists() and lines.exists() and output.samefile(lines):
        raise UsageError("would replace the file it reads", where=output, advice="choose another name")
    with reserve_output(output, overwrite=overwrite):
        found = read_lines(lines, crs=crs or None)
        points = read_point_layers(lines)
        write_lines(found, output, kinds=sorted(set(found.kind)), points=points, overwrite=overwrite)
    for warning in points_left_out(output, points):
        warn(warning)
    typer.echo(f"{len(found):,} lines in {output}")
