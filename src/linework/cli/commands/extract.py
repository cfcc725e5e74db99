"""`linework extract`: lines from laser points and stereo images."""

from __future__ import annotations

import contextlib
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import typer

from linework.cli.failures import warn
from linework.cli.options import (
    AllowOutside,
    AllowRemote,
    AsJson,
    Crs,
    LinesOutput,
    Location,
    Overwrite,
    Quiet,
    RunFile,
    Scheduler,
    SetValues,
    SurveyArgument,
    TrajectoryFile,
    WithLanes,
    Workers,
    WorkFolder,
    read_settings,
)
from linework.cli.said import say, say_json
from linework.cli.startup import preload_modules


def extract_command(
    surveys: SurveyArgument,
    output: LinesOutput,
    features: Annotated[
        str,
        typer.Option(
            "--features",
            metavar="KIND,...",
            help="Kinds of line to extract, e.g. guardrail,cable; default: all.",
        ),
    ] = "",
    method: Annotated[
        str,
        typer.Option(
            "--method",
            help="auto, obb or radon (laser points), stereo (images); as published: obb-2023, radon-2002, stereo-1992.",
        ),
    ] = "auto",
    paint_column: Annotated[
        str,
        typer.Option(
            "--paint-column",
            metavar="NAME",
            help="Extra dimension with the probability of paint (0 to 1), instead of the intensity.",
        ),
    ] = "",
    carry: Annotated[
        str,
        typer.Option("--carry", metavar="NAME,...", help="Extra dimensions of the laser files to read."),
    ] = "",
    candidates: Annotated[
        bool,
        typer.Option(
            "--candidates",
            help="Also write the lines measured and not taken, with the reason, as layer candidate.",
        ),
    ] = False,
    lanes: WithLanes = False,
    location: Location = "",
    trajectory: TrajectoryFile = None,
    config: RunFile = None,
    set_values: SetValues = None,
    crs: Crs = None,
    allow_outside: AllowOutside = False,
    allow_remote: AllowRemote = False,
    workers: Workers = None,
    scheduler: Scheduler = None,
    work: WorkFolder = None,
    resume: Annotated[bool, typer.Option("--resume", help="Continue an interrupted run.")] = False,
    no_adjust: Annotated[
        bool,
        typer.Option("--no-adjust", help="Leave drives over one road, and turns of a lidar, as recorded."),
    ] = False,
    calibrate: Annotated[
        bool,
        typer.Option(
            "--calibrate",
            help="Adjust the cameras first, as `linework calibrate` does, and say what was corrected.",
        ),
    ] = False,
    report: Annotated[
        Path | None,
        typer.Option("--report", metavar="FILE", help="Also write a report with figures and tables: .html."),
    ] = None,
    overwrite: Overwrite = False,
    forget_reviews: Annotated[
        bool,
        typer.Option("--forget-reviews", help="Discard review decisions of replaced lines."),
    ] = False,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Extract the lines of SURVEY and write them to a file.

    run.json beside the output records the inputs, settings, counts and timings. Existing output is not touched
    without --overwrite. Finding nothing is not an error: the layers are then written empty. --resume continues
    an interrupted run. Lines that were accepted, edited, drawn or rejected in the workbench are kept when a .gpkg
    is replaced, unless --forget-reviews is given. Several drives over one road are made to agree at their lines first,
    unless --no-adjust is given. --calibrate adjusts the cameras first by corners followed over pairs, prints what was
    corrected, and records it in run.json. With --scheduler the workers of a Dask cluster process the tiles: the lines
    are the same.
    """
    from linework.files.output.locks import reserve_output
    from linework.library.progress import open_display

    _check_report(report, output)
    with contextlib.ExitStack() as held:
        inputs = (trajectory, config)
        for path in (output, report) if report else (output,):
            held.enter_context(reserve_output(path, overwrite=overwrite or resume, inputs=inputs))
        display = held.enter_context(open_display(quiet=quiet))
        from linework.files.survey.open import open_survey
        from linework.files.vectors.lane_layer import check_lanes
        from linework.files.vectors.read_write import check_format
        from linework.methods.kinds import (
            check_method,
            findable_kinds,
            kinds_of_method,
            parse_kinds,
            recordings_for,
        )
        from linework.processes.system import usable_cores
        from linework.runs.compile import compile_stage, compiled_for
        from linework.runs.opened.cluster import cluster_executor
        from linework.runs.opened.store import executor_for, promised_points
        from linework.runs.opened.work_folder import work_folder
        from linework.runs.steps import RunSteps

        check_format(output)
        check_lanes(output, lanes=lanes, location=location)
        kinds = parse_kinds(features) if features else kinds_of_method(method)
        check_method(method, kinds)
        settings = read_settings(config, set_values)
        survey = open_survey(surveys, crs=crs, allow_outside=allow_outside, allow_remote=allow_remote)
        if trajectory is not None:
            survey = survey.with_trajectory(trajectory)
        columns = [name.strip() for name in (*carry.split(","), paint_column) if name.strip()]
        survey = replace(survey, carry=tuple(dict.fromkeys([*survey.carry, *columns])))
        kinds = findable_kinds(kinds, has_points=bool(survey.point_files), asked=bool(features))
        folder, n_workers = work_folder(survey.root, work), workers or usable_cores()
        steps = RunSteps(display)
        images = recordings_for(method, kinds)["images"]
        names = compiled_for(survey, kinds, images=images)
        compile_stage(names, steps)
        n_points = promised_points(survey)
        executor = held.enter_context(
            executor_for(n_points, n_workers, settings, has_images=images and survey.has_pairs, names=names)
            if scheduler is None
            else cluster_executor(scheduler, workers, folder)
        )
        calibration = None
        if calibrate:
            from linework.runs.cameras.calibrate import calibrate_survey

            calibration = calibrate_survey(survey, folder, steps)
            survey = calibration.survey
        preloading = preload_modules(
            "linework.runs.extract", "linework.methods.choose", "linework.files.vectors.gpkg"
        )
        from linework.runs.opened.recordings import opened_recordings

        recordings = held.enter_context(
            opened_recordings(
                survey, folder, n_threads=n_workers, steps=steps, **recordings_for(method, kinds)
            )
        )
        preloading.join()
        from linework.runs.extract import extract_to, extraction_request

        request = extraction_request(
            output, recordings.survey, kinds, method, settings, crs=crs, paint=paint_column or None,
            overwrite=overwrite, resume=resume, adjust=not no_adjust, lanes=lanes, location=location,
            candidates=candidates, calibration=calibration.document() if calibration else None,
        )  # fmt: skip
        request = replace(request, forget_reviews=forget_reviews)
        record, found = extract_to(request, recordings, folder, executor, steps)
        if report is not None and found is not None:
            with steps.step("write report"):
                from linework.evaluation.report.page import extraction_report
                from linework.files.output.publish import write_page

                page = extraction_report(found.lines, recordings, record)
                write_page(page, report, overwrite=overwrite or resume)
    told = calibration.warnings if calibration else ()
    for warning in dict.fromkeys([*told, *record["warnings"]]):
        warn(warning)
    _print_result(record, as_json=as_json)
    if calibration is not None and not as_json:
        for line in calibration.lines():
            say(line)
    _report_missing(record, output)


def _check_report(report: Path | None, output: Path) -> None:
    """Raise, before any work, where the report could not be written at the end."""
    from linework.errors import UsageError, check_extra

    if report is None:
        return
    if report.suffix.lower() not in (".html", ".htm"):
        raise UsageError(f"cannot write reports as '{report.suffix}'", where=report, advice="use .html")
    if report.absolute() == output.absolute():
        raise UsageError("the report would replace the lines", where=report, advice="choose another name")
    check_extra("reports", where="--report")


def _print_result(record: dict[str, Any], *, as_json: bool) -> None:
    """Print the number and length of the lines of each kind."""
    if as_json:
        say_json(record)
        return
    counts = record["counts"]
    if "lanes" in counts:
        say(f"{'lane':14} {counts['lanes']:6,} lanes {counts['lane_length_m']:12,.1f} m")
    for kind, n_lines in counts["lines"].items():
        say(f"{kind:14} {n_lines:6,} lines {counts['length_m'][kind]:12,.1f} m")
    for adjusted in ("turns", "drives"):
        if adjusted in record:
            say(record[adjusted]["summary"])


def _report_missing(record: dict[str, Any], output: Path) -> None:
    """Warn where nothing was found; raise PartialError where files or tiles were left out."""
    from linework.errors import PartialError
    from linework.runs.record import missing_summary

    if not any(record["counts"]["lines"].values()):
        warn(f"{output}: nothing found; its layers are empty")
    problem = missing_summary(record)
    if problem:
        raise PartialError(problem, where=output, advice="see run.json")
