"""`linework trace`: one line from one picked position."""

from __future__ import annotations

import contextlib
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from linework.cli.failures import warn
from linework.cli.options import (
    AllowOutside,
    AllowRemote,
    AsJson,
    Crs,
    LinesOutput,
    Overwrite,
    Quiet,
    RunFile,
    SetValues,
    SurveyArgument,
    WorkFolder,
    read_settings,
)
from linework.cli.said import say, say_json

if TYPE_CHECKING:
    from linework.model.lines import LineSet
    from linework.runs.opened.recordings import Recordings
    from linework.tracing.in_images import TracedEdge
    from linework.tracing.trace import TracedLine


def trace_command(
    surveys: SurveyArgument,
    output: LinesOutput,
    at: Annotated[
        str,
        typer.Option(
            "--at", metavar="EAST,NORTH", help="Position within 0.5 m of the line, in laser points."
        ),
    ] = "",
    image: Annotated[
        Path | None,
        typer.Option(
            "--image", metavar="FILE", help="Instead of --at: an image of the survey, e.g. left/000123.png."
        ),
    ] = None,
    at_px: Annotated[
        str,
        typer.Option("--at-px", metavar="COL,ROW", help="Pixel of --image within 4 pixels of the line."),
    ] = "",
    toward: Annotated[
        str,
        typer.Option(
            "--toward",
            metavar="EAST,NORTH",
            help="Trace only towards this position; default: both directions.",
        ),
    ] = "",
    feature: Annotated[
        str,
        typer.Option(
            "--feature",
            metavar="KIND",
            help="Kind of line, e.g. road_boundary; default: that of the nearest line.",
        ),
    ] = "",
    method: Annotated[
        str, typer.Option("--method", help="auto, or obb-2023: as published, in laser points.")
    ] = "auto",
    search_length_m: Annotated[
        float | None,
        typer.Option("--search-length", metavar="M", help="obb-2023: distance from box to box [m]."),
    ] = None,
    search_width_m: Annotated[
        float | None,
        typer.Option("--search-width", metavar="M", help="obb-2023: width of the box that is moved on [m]."),
    ] = None,
    radius_m: Annotated[
        float | None, typer.Option("--radius", metavar="M", help="obb-2023: radius of the search area [m].")
    ] = None,
    intensity: Annotated[
        str,
        typer.Option(
            "--intensity", metavar="MIN,MAX", help="obb-2023: intensities of paint; default: as proposed."
        ),
    ] = "",
    explain: Annotated[
        bool,
        typer.Option(
            "--explain", help="Also print what the search area about --at shows: normals, floor, intensities."
        ),
    ] = False,
    append: Annotated[
        bool,
        typer.Option(
            "--append", help="Add to the lines in the output, joining lines that continue one another."
        ),
    ] = False,
    config: RunFile = None,
    set_values: SetValues = None,
    crs: Crs = None,
    allow_outside: AllowOutside = False,
    allow_remote: AllowRemote = False,
    work: WorkFolder = None,
    overwrite: Overwrite = False,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Trace one line of SURVEY from a position or an image pixel.

    Traces lane markings, road boundaries, guardrails and cables in laser points (--at), and lane markings and road
    edges in stereo images (--image with --at-px). A pick that is not on a line is refused with the reason and the
    nearest pick that works. The tile store is kept for later commands, as by extract.
    """
    published = (
        *((f"search_length_m={search_length_m}",) if search_length_m is not None else ()),
        *((f"search_width_m={search_width_m}",) if search_width_m is not None else ()),
        *((f"radius_m={radius_m}",) if radius_m is not None else ()),
        *(_intensity_range(intensity) if intensity else ()),
    )
    _check_pick(at, image, at_px, toward, config, explain=explain, method=method, published=published)
    if image is not None:
        _trace_image(
            surveys, image, at_px, output, feature=feature, crs=crs, allow_outside=allow_outside, allow_remote=allow_remote, work=work,
            append=append, overwrite=overwrite, as_json=as_json, quiet=quiet,
        )  # fmt: skip
        return
    from linework.files.output.locks import reserve_output
    from linework.library.progress import open_display

    place, target = _position("--at", at), _position("--toward", toward) if toward else None
    with contextlib.ExitStack() as held:
        held.enter_context(reserve_output(output, overwrite=overwrite or append, inputs=[config]))
        display = held.enter_context(open_display(quiet=quiet))
        from linework.files.survey.open import open_survey
        from linework.files.vectors.read_write import check_format
        from linework.library.trace import kinds_to_compile, search_area_at, traced_line
        from linework.runs.compile import compile_stage, compiled_for
        from linework.runs.opened.recordings import opened_recordings
        from linework.runs.opened.work_folder import work_folder
        from linework.runs.steps import RunSteps
        from linework.tracing.trace import check_pick_kind

        check_format(output)
        check_pick_kind(feature)
        settings = read_settings(config, [*(set_values or ()), *(f"obb_2023.{one}" for one in published)])
        steps = RunSteps(display)
        survey = open_survey(surveys, crs=crs, allow_outside=allow_outside, allow_remote=allow_remote)
        folder = work_folder(survey.root, work)
        if method == "auto":
            to_compile = kinds_to_compile(feature, in_image=False)
            compile_stage(compiled_for(survey, to_compile, images=False), steps)
        recordings = held.enter_context(opened_recordings(survey, folder, images=False, steps=steps))
        shown = search_area_at(recordings, place, settings) if explain else None
        if shown is not None:
            # On stderr with --json, before a pick may be refused: why is what one looks for
            say(*shown.as_text(), to_stderr=as_json)
        found = traced_line(
            recordings, place, kind=feature, toward=target, settings=settings, steps=steps, method=method
        )
        with steps.step("write line"):
            _write(found.lines, output, append=append and output.exists(), overwrite=overwrite or append)
    _print(found, output, as_json=as_json)
    _report_left_out(recordings, found, output)


def _intensity_range(text: str) -> tuple[str, str]:
    """Return the settings of a range of intensities.

    Raises
    ------
    UsageError
        The text is not two rising numbers.
    """
    from linework.errors import UsageError

    low, _, high = text.partition(",")
    try:
        is_range = 0.0 <= float(low) < float(high)
    except ValueError:
        is_range = False
    if not is_range:
        raise UsageError(
            f"{text!r} is not a range",
            where="--intensity",
            advice="give two rising numbers, for example 120,255",
        )
    return f"min_intensity={float(low)}", f"max_intensity={float(high)}"


def _check_pick(
    at: str, image: Path | None, at_px: str, toward: str, config: Path | None, *, explain: bool, method: str,
    published: tuple[str, ...],
) -> None:  # fmt: skip
    """Raise UsageError unless there is exactly one pick, by position or by pixel, and its options agree."""
    from linework.errors import UsageError
    from linework.tracing.as_published import check_trace_method

    check_trace_method(method)
    if published and method == "auto":
        raise UsageError(
            "search length, width, radius and intensities are settings of obb-2023", where="linework trace",
            advice="give --method obb-2023, or omit them",
        )  # fmt: skip

    in_image = image is not None or bool(at_px)
    if bool(at) == in_image:
        raise UsageError(
            "both a position and a pixel" if at else "no position and no pixel", where="linework trace",
            advice="give --at EAST,NORTH, or --image FILE with --at-px COL,ROW",
        )  # fmt: skip
    if in_image and (image is None or not at_px):
        missing = "--at-px COL,ROW" if image is not None else "--image FILE"
        raise UsageError(
            f"{missing} is missing", where="linework trace", advice="a pick in an image needs both"
        )
    for option, is_given in (
        ("--toward", bool(toward)), ("--config", config is not None), ("--explain", explain),
        ("--method", method != "auto"),
    ):  # fmt: skip
        if in_image and is_given:
            raise UsageError("only valid with --at", where=option, advice="omit it")


def _trace_image(
    surveys: list[Path], image: Path, at_px: str, output: Path, *, feature: str, crs: str | None, allow_outside: bool, allow_remote: bool,
    work: Path | None, append: bool, overwrite: bool, as_json: bool, quiet: bool,
) -> None:  # fmt: skip
    """Trace the edge at a pixel of an image and write it."""
    from linework.files.output.locks import reserve_output
    from linework.library.progress import open_display

    with contextlib.ExitStack() as held:
        held.enter_context(reserve_output(output, overwrite=overwrite or append, inputs=[image]))
        display = held.enter_context(open_display(quiet=quiet))
        from linework.files.survey.open import open_survey
        from linework.files.vectors.read_write import check_format
        from linework.library.trace import traced_edge
        from linework.runs.opened.recordings import opened_recordings
        from linework.runs.opened.work_folder import work_folder
        from linework.runs.steps import RunSteps
        from linework.tracing.in_images import pixel_of

        check_format(output)
        col, row = pixel_of(at_px).tolist()
        survey, steps = (
            open_survey(surveys, crs=crs, allow_outside=allow_outside, allow_remote=allow_remote),
            RunSteps(display),
        )
        folder = work_folder(survey.root, work)
        recordings = held.enter_context(opened_recordings(survey, folder, laser=False, steps=steps))
        found = traced_edge(recordings, image, (col, row), kind=feature, steps=steps)
        with steps.step("write line"):
            _write(found.lines, output, append=append and output.exists(), overwrite=overwrite or append)
    for warning in found.warnings:
        warn(warning)
    _print(found, output, as_json=as_json)
    _report_left_out(recordings, found, output)


def _report_left_out(recordings: Recordings, found: TracedLine | TracedEdge, output: Path) -> None:
    """Warn of what was odd; raise PartialError where files or recordings were left out."""
    from linework.errors import PartialError
    from linework.library.report import left_out_summary, report_of_recordings

    for warning in recordings.warnings:
        warn(warning)
    problem = left_out_summary(report_of_recordings(recordings, found.lines, [found.kind], {}))
    if problem:
        raise PartialError(problem, where=output, advice="the line is written")


def _position(option: str, text: str) -> tuple[float, float]:
    """Return east and north [m] of an option.

    Raises
    ------
    UsageError
        The text is not two finite numbers.
    """
    import math

    from linework.errors import UsageError

    try:
        east, north = (float(part) for part in text.split(","))
    except ValueError:
        east = north = math.nan
    if not (math.isfinite(east) and math.isfinite(north)):
        raise UsageError(
            f"{text!r} is not a position",
            where=option,
            advice="give two numbers, for example 500123.45,5400678.90",
        )
    return east, north


def _write(lines: LineSet, output: Path, *, append: bool, overwrite: bool) -> None:
    """Write a line, or add it to the lines of a file, joined where it continues one of them."""
    from linework.files.vectors.read_write import write_lines

    if append and output.suffix.lower() == ".gpkg":
        _add_to_line_file(lines, output)
        return
    lines = _joined_to_output(output, lines) if append else lines
    write_lines(lines, output, kinds=tuple(dict.fromkeys(lines.kind.tolist())), overwrite=overwrite)


def _joined_to_output(output: Path, lines: LineSet) -> LineSet:
    """Return the lines of a file and a new one, joined where it continues one of them."""
    from linework.editing.edits.continued import continue_lines
    from linework.errors import InputError
    from linework.files.vectors.read_write import read_usable_lines

    there, left_out = read_usable_lines(output)
    if left_out:
        # They would be gone from the file that is written in its place
        raise InputError(left_out, advice="correct them, or write to another file")
    return continue_lines(there, lines)


def _add_to_line_file(lines: LineSet, output: Path) -> None:
    """Add a line to a GeoPackage as one edit: its history, and what other programs put there, stay."""
    from linework.editing.edits.continued import continue_lines
    from linework.files.line_file.file import LineFile
    from linework.model.changes import Change
    from linework.model.lines import REJECTED_REVIEW, LineSet

    with LineFile.opened(output, crs=lines.crs, is_held=True) as drawing:
        there = drawing.lines
        shown = there.take(there.review != REJECTED_REVIEW)
        result = continue_lines(shown, lines)
        before = {line_id: shown.take([i]) for i, line_id in enumerate(shown.id.tolist())}
        same = [
            result.take([i]) == before.get(line_id, LineSet.empty(there.crs))
            for i, line_id in enumerate(result.id.tolist())
        ]
        kept = {line_id for line_id, is_same in zip(result.id.tolist(), same, strict=True) if is_same}
        replaced = [i for i, line_id in enumerate(shown.id.tolist()) if line_id not in kept]
        added = [i for i, is_same in enumerate(same) if not is_same]
        drawing.commit(Change("trace", shown.take(replaced), result.take(added)), who="")


def _print(found: TracedLine | TracedEdge, output: Path, *, as_json: bool) -> None:
    """Print kind and length of the traced line, and why it ends at either end."""
    line = found.lines.take(found.lines.kind == found.kind)
    length_m = float(line.length_m.sum())
    bridged_m = float(line.bridged_m.sum())
    if as_json:
        document = {
            "kind": found.kind, "length_m": length_m, "bridged_m": bridged_m,
            "stops": list(found.stops), "output": str(output),
            "confidence": float(line.confidence.mean()) if len(line) else 0.0,
        }  # fmt: skip
        for name in ("distance_m", "n_pairs"):
            if hasattr(found, name):
                document[name] = getattr(found, name)
        say_json(document)
        return
    say(f"{found.kind}: {length_m:,.1f} m, of which {bridged_m:,.1f} m bridged")
    for end, reason in zip(("start", "end"), found.stops, strict=True):
        say(f"  {end}: {reason}")
