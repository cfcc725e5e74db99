"""`linework trace`: one line from one picked place."""

from __future__ import annotations

import contextlib
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from linework.model.lines import LineSet
    from linework.tiling.traces import TracedLine


def trace(
    surveys: Annotated[
        list[Path],
        typer.Argument(metavar="SURVEY...", help="Laser files, a folder of them, or a survey folder."),
    ],
    at: Annotated[str, typer.Option("--at", metavar="EAST,NORTH", help="A place within 0.5 m of the line.")],
    output: Annotated[Path, typer.Option("--output", "-o", help="Line to write: .gpkg, .geojson, .dxf ...")],
    toward: Annotated[
        str,
        typer.Option(
            "--toward", metavar="EAST,NORTH", help="Follow it only that way; both ways if not given."
        ),
    ] = "",
    feature: Annotated[
        str,
        typer.Option("--feature", help="Kind of line, for example road_boundary; the nearest if not given."),
    ] = "",
    append: Annotated[
        bool,
        typer.Option(
            "--append", help="Add to the lines in the output; a line picked further on is continued."
        ),
    ] = False,
    config: Annotated[
        Path | None, typer.Option("--config", help="Run file (TOML) with settings; see `linework config`.")
    ] = None,
    crs: Annotated[
        str, typer.Option("--crs", help="EPSG:... or local: the CRS where the files do not say.")
    ] = "",
    work: Annotated[
        Path | None,
        typer.Option("--work", help="Folder for points; .linework beside the survey if not given."),
    ] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace the output.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print what was followed as JSON.")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", help="No progress on stderr.")] = False,
) -> None:
    """Follow the line at one place of SURVEY, and write it.

    Lane markings, road boundaries, guardrails and cables. A place that is on no line is refused, with the reason
    and the nearest place that works. What the survey's points show is kept for the next call, as by extract.
    """
    from linework.cli.progress import open_display
    from linework.files.reserve import reserved_output

    place, way = _place("--at", at), _place("--toward", toward) if toward else None
    with contextlib.ExitStack() as held:
        held.enter_context(reserved_output(output, overwrite=overwrite or append))
        display = held.enter_context(open_display(quiet=quiet))
        from linework.cli.extract import read_settings
        from linework.cli.first_run import tell_of_compiling
        from linework.files.survey import open_survey
        from linework.files.vectors import check_format, write_lines
        from linework.tiling.executors import Serial
        from linework.tiling.opened import opened_survey, surface_of
        from linework.tiling.steps import Steps
        from linework.tiling.traces import Tracer, check_kind
        from linework.tiling.work_folder import work_folder

        check_format(output)
        check_kind(feature)
        settings, steps = read_settings(config), Steps(display)
        survey = open_survey(surveys, crs=crs or None)
        tell_of_compiling((feature or "lane_marking",), quiet=quiet)
        opened = held.enter_context(opened_survey(survey, work_folder(survey.root, work), steps=steps))
        surface = surface_of(opened, settings.road, Serial(), steps)
        with steps.step("follow the line"):
            found = _drained(Tracer(opened, surface, settings), place, feature, way)
        with steps.step("write line"):
            lines = _with_those_there(output, found.lines) if append and output.exists() else found.lines
            kinds = tuple(dict.fromkeys(lines.kind.tolist()))
            write_lines(lines, output, kinds=kinds, overwrite=overwrite or append)
    _print(found, output, as_json=as_json)


def _place(option: str, text: str) -> tuple[float, float]:
    """Return the place that an option names."""
    import math

    from linework.errors import UsageError

    try:
        east, north = (float(part) for part in text.split(","))
    except ValueError:
        east = north = math.nan
    if not (math.isfinite(east) and math.isfinite(north)):
        raise UsageError(
            f"{text!r} is no place", where=option, advice="give two numbers, for example 500123.45,5400678.90"
        )
    return east, north


def _drained(
    tracer: Any, place: tuple[float, float], kind: str, way: tuple[float, float] | None
) -> TracedLine:
    """Run all steps of a trace and return the line."""
    steps = tracer.trace(place, kind=kind, toward=way)
    while True:
        try:
            next(steps)
        except StopIteration as end:
            found: TracedLine = end.value
            return found


def _with_those_there(output: Path, lines: LineSet) -> LineSet:
    """Return the lines of a file and a new one, joined where one continues the other."""
    from linework.files.vectors import read_lines
    from linework.lines.continued import continued

    return continued(read_lines(output), lines)


def _print(found: TracedLine, output: Path, *, as_json: bool) -> None:
    """Say what was followed, and why it ends where it does."""
    line = found.lines.of_kind(found.kind)
    length_m = float(line.length_m.sum())
    bridged_m = float(line.bridged_m.sum())
    if as_json:
        import json

        document = {
            "kind": found.kind, "length_m": length_m, "bridged_m": bridged_m,
            "distance_m": found.distance_m, "stops": list(found.stops), "output": str(output),
            "confidence": float(line.confidence.mean()) if len(line) else 0.0,
        }  # fmt: skip
        typer.echo(json.dumps(document, indent=1, allow_nan=False))
        return
    typer.echo(f"{found.kind}: {length_m:,.1f} m, {bridged_m:,.1f} m of it bridged")
    for end, why in zip(("start", "end"), found.stops, strict=True):
        typer.echo(f"  {end}: {why}")
