"""`linework classify`: copies of the laser files in which each point has its class."""

from __future__ import annotations

import contextlib
from pathlib import Path
from typing import Annotated, Any

import typer

from linework.cli.failures import warn
from linework.cli.options import (
    AllowOutside,
    AllowRemote,
    AsJson,
    Crs,
    Overwrite,
    Quiet,
    RunFile,
    SurveyArgument,
    TrajectoryFile,
    Workers,
    WorkFolder,
    read_settings,
)
from linework.cli.said import say, say_json


def classify_command(
    surveys: SurveyArgument,
    lines: Annotated[
        Path, typer.Option("--lines", metavar="LINES", help="Lines of the survey, as extract writes them.")
    ],
    output: Annotated[Path, typer.Option("--output", "-o", metavar="DIR", help="Output folder.")],
    trajectory: TrajectoryFile = None,
    config: RunFile = None,
    crs: Crs = None,
    allow_outside: AllowOutside = False,
    allow_remote: AllowRemote = False,
    work: WorkFolder = None,
    workers: Workers = None,
    overwrite: Overwrite = False,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Copy the laser files of SURVEY with a class for each point.

    Points are road, footway, verge, marking, kerb, rail, barrier, wire, pole, vegetation or other, by the surface and
    LINES. Classes have the numbers of LAS 1.4, and from 64 on those of a table in each file; the extra dimension
    line_number is the number of the line, which classes.json lists. All else in the files stays as it is.
    """
    from linework.errors import PartialError
    from linework.files.output.locks import reserve_folder
    from linework.library.progress import open_display

    with contextlib.ExitStack() as held:
        held.enter_context(reserve_folder(output, overwrite=overwrite, inputs=[lines, trajectory, config]))
        display = held.enter_context(open_display(quiet=quiet))
        from linework.files.survey.open import open_survey
        from linework.files.vectors.read_write import read_usable_lines
        from linework.library.classify import RECORD, classified_problem, classify_recordings
        from linework.processes.system import usable_cores
        from linework.runs.classify import usable_lines
        from linework.runs.compile import compile_stage, compiled_for
        from linework.runs.opened.recordings import opened_recordings
        from linework.runs.opened.work_folder import work_folder
        from linework.runs.steps import RunSteps

        settings, steps = read_settings(config), RunSteps(display)
        survey = open_survey(surveys, crs=crs, allow_outside=allow_outside, allow_remote=allow_remote)
        if trajectory is not None:
            survey = survey.with_trajectory(trajectory)
        given, left_out = read_usable_lines(lines, crs=survey.crs)
        given = usable_lines(given, lines)
        folder = work_folder(survey.root, work)
        compile_stage((*compiled_for(survey, (), images=False), "classes"), steps)
        recordings = held.enter_context(
            opened_recordings(survey, folder, images=False, n_threads=usable_cores(), steps=steps)
        )
        record = classify_recordings(
            recordings,
            given,
            output,
            folder,
            settings=settings,
            workers=workers,
            overwrite=overwrite,
            steps=steps,
        )
        warnings = [*recordings.warnings, *([left_out] if left_out else []), *record["warnings"]]
    for warning in warnings:
        warn(warning)
    if as_json:
        say_json(record)
    else:
        say(*_summary(record, output))
    problem = classified_problem(record)
    if problem:
        raise PartialError(problem, where=output, advice=f"see {RECORD}")


def _summary(record: dict[str, Any], output: Path) -> list[str]:
    """Return the points by class, one line each, and where the copies are."""
    total = sum(found["points"] for found in record["classes"]) or 1
    rows = [
        f"{found['name']:10} {found['number']:3}  {found['points']:>13,} points  {100 * found['points'] / total:5.1f} %"
        for found in record["classes"]
        if found["points"]
    ]
    return [*rows, f"{len(record['files'])} files in {output}"]
