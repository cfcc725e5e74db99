"""`linework trace`: one line from one picked place."""

from __future__ import annotations

import contextlib
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from linework.model.lines import LineSet
    from linework.tracing.in_images import TracedEdge
    from linework.tracing.trace import TracedLine


def trace(
    surveys: Annotated[
        list[Path],
        typer.Argument(metavar="SURVEY...", help="Laser files, a folder of them, or a survey folder."),
    ],
    output: Annotated[Path, typer.Option("--output", "-o", help="Line to write: .gpkg, .geojson, .dxf ...")],
    at: Annotated[
        str, typer.Option("--at", metavar="EAST,NORTH", help="A place within 0.5 m of the line, in points.")
    ] = "",
    image: Annotated[
        Path | None,
        typer.Option("--image", help="An image of the survey instead, for example left/000123.png."),
    ] = None,
    at_px: Annotated[
        str,
        typer.Option("--at-px", metavar="COL,ROW", help="A pixel of that image within 4 pixels of the line."),
    ] = "",
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
    """Follow the line at one place of SURVEY, or at one pixel of its images, and write it.

    Lane markings, road boundaries, guardrails and cables in points (--at); lane markings and road edges in stereo
    images (--image with --at-px). A place or pixel that is on no line is refused, with the reason and the nearest
    one that works. What the survey's points show is kept for the next call, as by extract.
    """
    _check_ways(at, image, at_px, toward, config)
    if image is not None:
        _trace_image(
            surveys, image, at_px, output, feature=feature, crs=crs, work=work, append=append,
            overwrite=overwrite, as_json=as_json, quiet=quiet,
        )  # fmt: skip
        return
    from linework.cli.progress import open_display
    from linework.files.output.locks import reserve_output

    place, way = _place("--at", at), _place("--toward", toward) if toward else None
    with contextlib.ExitStack() as held:
        held.enter_context(reserve_output(output, overwrite=overwrite or append))
        display = held.enter_context(open_display(quiet=quiet))
        from linework.cli.extract import read_settings
        from linework.cli.progress import announce_compilation
        from linework.files.survey.open import open_survey
        from linework.files.vectors.read_write import check_format, write_lines
        from linework.processes.executors import Serial
        from linework.runs.opened.points import opened_survey, surface_of
        from linework.runs.opened.work_folder import work_folder
        from linework.runs.steps import RunSteps
        from linework.tracing.trace import Tracer, check_pick_kind

        check_format(output)
        check_pick_kind(feature)
        settings, steps = read_settings(config), RunSteps(display)
        survey = open_survey(surveys, crs=crs or None)
        announce_compilation((feature or "lane_marking",), quiet=quiet)
        opened = held.enter_context(opened_survey(survey, work_folder(survey.root, work), steps=steps))
        surface = surface_of(opened, settings.road, Serial(), steps)
        with steps.step("follow the line"):
            found = _drained(Tracer(opened, surface, settings), place, feature, way)
        with steps.step("write line"):
            lines = _with_those_there(output, found.lines) if append and output.exists() else found.lines
            kinds = tuple(dict.fromkeys(lines.kind.tolist()))
            write_lines(lines, output, kinds=kinds, overwrite=overwrite or append)
    _print(found, output, as_json=as_json)


def _check_ways(at: str, image: Path | None, at_px: str, toward: str, config: Path | None) -> None:
    """Refuse anything but one of both ways to pick."""
    from linework.errors import UsageError

    in_image = image is not None or bool(at_px)
    if bool(at) == in_image:
        raise UsageError(
            "both a place and a pixel" if at else "no place and no pixel", where="linework trace",
            advice="give --at EAST,NORTH, or --image FILE with --at-px COL,ROW",
        )  # fmt: skip
    if in_image and (image is None or not at_px):
        missing = "--at-px COL,ROW" if image is not None else "--image FILE"
        raise UsageError(f"{missing} is missing", where="linework trace", advice="a pixel needs both")
    for option, is_given in (("--toward", bool(toward)), ("--config", config is not None)):
        if in_image and is_given:
            raise UsageError("only with --at", where=option, advice="leave it out")


def _trace_image(
    surveys: list[Path], image: Path, at_px: str, output: Path, *, feature: str, crs: str, work: Path | None,
    append: bool, overwrite: bool, as_json: bool, quiet: bool,
) -> None:  # fmt: skip
    """Follow the edge at a pixel of an image and write it."""
    from linework.cli.progress import open_display
    from linework.files.output.locks import reserve_output

    with contextlib.ExitStack() as held:
        held.enter_context(reserve_output(output, overwrite=overwrite or append))
        display = held.enter_context(open_display(quiet=quiet))
        from linework.files.survey.open import open_survey
        from linework.files.vectors.read_write import check_format, write_lines
        from linework.runs.opened.recordings import opened_recordings
        from linework.runs.opened.work_folder import work_folder
        from linework.runs.steps import RunSteps
        from linework.tracing.in_images import ImageTracer, pixel_of

        check_format(output)
        col, row = pixel_of(at_px).tolist()
        survey, steps = open_survey(surveys, crs=crs or None), RunSteps(display)
        folder = work_folder(survey.root, work)
        recordings = held.enter_context(opened_recordings(survey, folder, laser=False, steps=steps))
        if recordings.stereo is None:
            raise RuntimeError("a survey opened for its images has none")
        with steps.step("follow the edge", unit="pairs") as advance:
            following = ImageTracer(recordings.stereo).trace(image, (col, row), kind=feature)
            n_pairs, n_done = len(recordings.stereo.pairs), 0
            while True:
                try:
                    next(following)
                    n_done += 1
                    advance(n_done, n_pairs)
                except StopIteration as end:
                    found = end.value
                    break
        with steps.step("write line"):
            lines = _with_those_there(output, found.lines) if append and output.exists() else found.lines
            kinds = tuple(dict.fromkeys(lines.kind.tolist()))
            write_lines(lines, output, kinds=kinds, overwrite=overwrite or append)
    for warning in (*recordings.warnings, *found.warnings):
        typer.echo(f"warning: {warning}", err=True)
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
    from linework.editing.edits.continued import continue_lines
    from linework.files.vectors.read_write import read_lines

    return continue_lines(read_lines(output), lines)


def _print(found: TracedLine | TracedEdge, output: Path, *, as_json: bool) -> None:
    """Say what was followed, and why it ends where it does."""
    line = found.lines.of_kind(found.kind)
    length_m = float(line.length_m.sum())
    bridged_m = float(line.bridged_m.sum())
    if as_json:
        import json

        document = {
            "kind": found.kind, "length_m": length_m, "bridged_m": bridged_m,
            "stops": list(found.stops), "output": str(output),
            "confidence": float(line.confidence.mean()) if len(line) else 0.0,
        }  # fmt: skip
        for name in ("distance_m", "n_pairs"):
            if hasattr(found, name):
                document[name] = getattr(found, name)
        typer.echo(json.dumps(document, indent=1, allow_nan=False))
        return
    typer.echo(f"{found.kind}: {length_m:,.1f} m, {bridged_m:,.1f} m of it bridged")
    for end, why in zip(("start", "end"), found.stops, strict=True):
        typer.echo(f"  {end}: {why}")
