"""`linework extract`: the main job, from laser points and stereo images to lines."""

from __future__ import annotations

import contextlib
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from linework.cli.failures import warn
from linework.cli.progress import announce_compilation, preload_modules
from linework.runs.opened.store import executor_for as executor_for
from linework.runs.opened.store import usable_cores as usable_cores

if TYPE_CHECKING:
    from linework.model.survey import Survey
    from linework.runs.settings import RunSettings


def extract_command(
    surveys: Annotated[
        list[Path],
        typer.Argument(
            metavar="SURVEY...", help="Laser files, a folder of them, a survey folder, or a KITTI drive."
        ),
    ],
    output: Annotated[Path, typer.Option("--output", "-o", help="Lines to write: .gpkg, .geojson, .dxf ...")],
    features: Annotated[
        str,
        typer.Option("--features", help="Kinds to look for, for example guardrail,cable; all if not given."),
    ] = "",
    method: Annotated[
        str, typer.Option("--method", help="auto, obb, radon (laser points) or stereo (images).")
    ] = "auto",
    trajectory: Annotated[
        Path | None,
        typer.Option("--trajectory", help="Where the van was (CSV), its origin, not an antenna's."),
    ] = None,
    config: Annotated[
        Path | None, typer.Option("--config", help="Run file (TOML) with settings; see `linework config`.")
    ] = None,
    crs: Annotated[
        str, typer.Option("--crs", help="EPSG:... or local: the CRS where the files do not say.")
    ] = "",
    workers: Annotated[
        int | None,
        typer.Option("--workers", min=1, max=256, help="Processes to use; all cores if not given."),
    ] = None,
    work: Annotated[
        Path | None,
        typer.Option(
            "--work", help="Folder for points and unfinished runs; .linework beside the survey if not given."
        ),
    ] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Go on with a run that was killed.")] = False,
    report: Annotated[
        Path | None, typer.Option("--report", help="Page (.html) with pictures and tables of the lines.")
    ] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace the output.")] = False,
    forget_reviews: Annotated[
        bool,
        typer.Option("--forget-reviews", help="Lose what people said of the lines that are replaced."),
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print the record of the run as JSON.")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", help="No progress on stderr.")] = False,
) -> None:
    """Find the lines in SURVEY and write them.

    run.json beside them says what was read, with which settings, and how long it took. An output that exists is not touched without --overwrite. Nothing found is no error: the layers are there
    and empty. A run that was killed goes on where it was with --resume. Lines that a person accepted, edited, drew
    or rejected stay as they are when a .gpkg is replaced, unless --forget-reviews is given.
    """
    from linework.cli.progress import open_display
    from linework.files.output.locks import reserve_output

    _check_report(report, output, overwrite=overwrite or resume)
    with contextlib.ExitStack() as held:
        held.enter_context(reserve_output(output, overwrite=overwrite or resume))
        display = held.enter_context(open_display(quiet=quiet))
        from linework.files.survey.open import open_survey
        from linework.files.vectors.read_write import check_format
        from linework.methods.kinds import (
            check_method,
            findable_kinds,
            kinds_of_method,
            parse_kinds,
            recordings_for,
        )
        from linework.runs.opened.work_folder import work_folder
        from linework.runs.steps import RunSteps

        check_format(output)
        kinds = parse_kinds(features) if features else kinds_of_method(method)
        check_method(method, kinds)
        settings = read_settings(config)
        survey = with_trajectory(open_survey(surveys, crs=crs or None), trajectory)
        kinds = findable_kinds(kinds, has_points=bool(survey.point_files), asked=bool(features))
        folder, n_workers, steps = (
            work_folder(survey.root, work),
            workers or usable_cores(),
            RunSteps(display),
        )
        executor = held.enter_context(executor_for(survey, n_workers, settings))
        ahead = preload_modules(
            "linework.runs.extract", "linework.methods.choose", "linework.files.vectors.gpkg"
        )
        from linework.runs.opened.recordings import opened_recordings

        recordings = held.enter_context(
            opened_recordings(
                survey, folder, n_threads=n_workers, steps=steps, **recordings_for(method, kinds)
            )
        )
        ahead.join()
        from linework.runs.extract import extract_to, extraction_request

        announce_compilation(kinds, quiet=quiet)
        order = extraction_request(
            output, recordings.survey, kinds, method, settings, crs=crs, overwrite=overwrite, resume=resume
        )
        order = replace(order, forget_reviews=forget_reviews)
        record, found = extract_to(order, recordings, folder, executor, steps)
        if report is not None and found is not None:
            with steps.step("write report"):
                from linework.evaluation.report.page import extraction_report
                from linework.files.output.publish import write_page

                page = extraction_report(found.lines, recordings, record)
                write_page(page, report, overwrite=overwrite or resume)
    for warning in record["warnings"]:
        warn(warning)
    _print_result(record, as_json=as_json)
    _tell_what_is_missing(record, output)


def read_settings(path: Path | None) -> RunSettings:
    """Return the settings of a run file; what it does not name keeps its default."""
    from linework.files.settings_file import read_settings_file
    from linework.runs.settings import RunSettings

    return RunSettings() if path is None else read_settings_file(RunSettings, path)


def with_trajectory(survey: Survey, path: Path | None) -> Survey:
    """Return the survey with this trajectory in the place of its own, whose lever arm goes with it."""
    from dataclasses import replace

    if path is None:
        return survey
    none = (0.0, 0.0, 0.0)
    return replace(survey, trajectory_file=path, trajectory_lever_m=none, trajectory_boresight_deg=none)


def _check_report(report: Path | None, output: Path, *, overwrite: bool) -> None:
    """Refuse, before any work, a report that could not be written at the end."""
    from linework.errors import UsageError
    from linework.files.output.publish import check_output

    if report is None:
        return
    if report.suffix.lower() not in (".html", ".htm"):
        raise UsageError("reports are .html files", where=report, advice="name it something.html")
    if report.absolute() == output.absolute():
        raise UsageError("report and lines are one file", where=report, advice="name two files")
    check_output(report, overwrite=overwrite)


def _print_result(record: dict[str, Any], *, as_json: bool) -> None:
    """Print what was found, by kind."""
    if as_json:
        import json

        typer.echo(json.dumps(record, indent=1, allow_nan=False))
        return
    counts = record["counts"]
    for kind, n_lines in counts["lines"].items():
        typer.echo(f"{kind:14} {n_lines:6,} lines {counts['length_m'][kind]:12,.1f} m")


def _tell_what_is_missing(record: dict[str, Any], output: Path) -> None:
    """Warn where nothing was found; end as unfinished where files or tiles were left out."""
    from linework.errors import PartialError
    from linework.runs.record import missing_summary

    if not any(record["counts"]["lines"].values()):
        warn(f"{output}: nothing found: its layers are there and empty")
    problem = missing_summary(record)
    if problem:
        raise PartialError(problem, where=output, advice="see run.json")
