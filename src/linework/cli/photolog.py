"""`linework photolog`: a page of what the cameras saw and which keys were pressed, along the drive."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from linework.cli.failures import warn


def photolog(
    survey_folder: Annotated[
        Path, typer.Argument(metavar="SURVEY", help="A survey folder with images, or a KITTI drive.")
    ],
    output: Annotated[Path, typer.Option("--output", "-o", help="Page to write: .html")],
    every_m: Annotated[
        float, typer.Option("--every-m", min=0.1, max=10_000.0, help="A picture every so many metres.")
    ] = 10.0,
    trajectory: Annotated[
        Path | None,
        typer.Option("--trajectory", help="Where the van was (CSV), its origin, not an antenna's."),
    ] = None,
    crs: Annotated[
        str, typer.Option("--crs", help="EPSG:... or local: the CRS where the files do not say.")
    ] = "",
    work: Annotated[
        Path | None,
        typer.Option(
            "--work", help="Folder for what is made on the way; .linework beside the survey if not given."
        ),
    ] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace the output.")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", help="No progress on stderr.")] = False,
) -> None:
    """Make a page of the drive: small pictures with their places and chainages, and the operator's keys.

    The page is one file; each picture is a link to its image, named from where the page lies. At most 500
    pictures are on it: on a long drive they stand farther apart than asked for.
    """
    from linework.cli.extract import with_trajectory
    from linework.cli.progress import open_display
    from linework.errors import InputError, PartialError, UsageError
    from linework.evaluation.report.photolog import photolog_html
    from linework.files.geodesy.crs import describe_crs
    from linework.files.images.series import open_stereo
    from linework.files.logs.photolog import van_log
    from linework.files.output.publish import check_output, write_page
    from linework.files.survey.open import open_survey
    from linework.files.trajectories.of_survey import read_van_path
    from linework.runs.opened.recordings import located_survey
    from linework.runs.opened.work_folder import work_folder
    from linework.runs.steps import RunSteps

    if output.suffix.lower() not in (".html", ".htm"):
        raise UsageError(f"cannot write '{output.suffix}' files", where=output, advice="use .html")
    check_output(output, overwrite=overwrite)
    survey = with_trajectory(open_survey([survey_folder], crs=crs or None), trajectory)
    series = open_stereo(survey)
    if series is None and not survey.settings.get("events"):
        raise InputError("neither images nor keys in this survey", where=survey.name,
                         advice="see what there is with linework info")  # fmt: skip
    with open_display(quiet=quiet) as display:
        steps = RunSteps(display)
        survey, told = located_survey(survey, work_folder(survey.root, work), steps)
        path = read_van_path(survey, series)
        if path.trajectory is None:
            raise InputError("no trajectory: nobody knows where its images were taken", where=survey.name,
                             advice="name one ([trajectory] file)")  # fmt: skip
        with steps.step("make page"):
            log = van_log(survey, path.series, path.trajectory)
            facts = {"survey": survey.name, "CRS": describe_crs(survey.crs)}
            page = photolog_html(
                log, output, title=f"photolog of {survey.name}", every_m=every_m, facts=facts
            )
            write_page(page.html, output, overwrite=overwrite)
    of_images = path.series.warnings if path.series else ()
    for warning in (*survey.warnings, *told, *path.warnings, *of_images, *log.warnings, *page.warnings):
        warn(warning)
    typer.echo(f"{output}: {page.n_pictures} pictures, {len(log.events or ())} keys")
    if page.failures:
        raise PartialError(
            f"{len(page.failures)} of {page.n_pictures} images cannot be shown: {page.failures[0].rstrip('.')}",
            where=output,
        )
