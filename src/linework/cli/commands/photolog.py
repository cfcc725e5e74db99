"""`linework photolog`: a page of thumbnails and operator keys along the drive."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from linework.cli.failures import warn
from linework.cli.options import AllowOutside, AllowRemote, Crs, Overwrite, Quiet, TrajectoryFile, WorkFolder
from linework.cli.said import say


def photolog(
    survey_folder: Annotated[
        Path, typer.Argument(metavar="SURVEY", help="Survey folder with images, or a KITTI drive.")
    ],
    output: Annotated[Path, typer.Option("--output", "-o", metavar="FILE", help="Output page: .html.")],
    every_m: Annotated[
        float, typer.Option("--every-m", min=0.1, max=10_000.0, help="Distance between images [m].")
    ] = 10.0,
    trajectory: TrajectoryFile = None,
    crs: Crs = None,
    allow_outside: AllowOutside = False,
    allow_remote: AllowRemote = False,
    work: WorkFolder = None,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
) -> None:
    """Write a photolog: a page of thumbnails along the drive.

    It shows position and chainage of each image, and the operator's keys. The page is a single file; each thumbnail
    links to its image by a relative path. A page holds at most 500 thumbnails: on long drives their spacing is larger
    than --every-m.
    """
    from linework.errors import InputError, PartialError, UsageError, check_extra

    check_extra("reports", where="photolog")
    from linework.crs import describe_crs
    from linework.evaluation.report.photolog import photolog_html
    from linework.files.images.series import open_stereo
    from linework.files.images.single import open_single_cameras
    from linework.files.logs.photolog import van_log
    from linework.files.output.locks import reserve_output
    from linework.files.output.publish import write_page
    from linework.files.survey.open import open_survey
    from linework.files.trajectories.of_survey import read_van_path, single_on_clock_of
    from linework.library.progress import open_display
    from linework.runs.opened.recordings import located_survey
    from linework.runs.opened.work_folder import work_folder
    from linework.runs.steps import RunSteps

    if output.suffix.lower() not in (".html", ".htm"):
        raise UsageError(f"cannot write '{output.suffix}' files", where=output, advice="use .html")
    with (
        reserve_output(output, overwrite=overwrite, inputs=[trajectory]),
        open_display(quiet=quiet) as display,
    ):
        survey = open_survey([survey_folder], crs=crs, allow_outside=allow_outside, allow_remote=allow_remote)
        if trajectory is not None:
            survey = survey.with_trajectory(trajectory)
        series, single = open_stereo(survey), open_single_cameras(survey)
        if series is None and not single and not survey.settings.get("events"):
            raise InputError("the survey has neither images nor operator keys", where=survey.name,
                             advice="see linework info")  # fmt: skip
        steps = RunSteps(display)
        survey, notes = located_survey(survey, work_folder(survey.root, work), steps)
        path = read_van_path(survey, series)
        if path.trajectory is None:
            raise InputError("no trajectory, so the positions of the images are unknown", where=survey.name,
                             advice="give --trajectory, or name one in survey.toml ([trajectory] file)")  # fmt: skip
        with steps.step("write page"):
            single = single_on_clock_of(single, path.trajectory, survey)
            log = van_log(survey, path.series, path.trajectory, single)
            facts = {"survey": survey.name, "CRS": describe_crs(survey.crs)}
            page = photolog_html(
                log, output, title=f"Photolog of {survey.name}", every_m=every_m, facts=facts
            )
            write_page(page.html, output, overwrite=overwrite)
    of_images = [
        *(path.series.warnings if path.series else ()),
        *(t for camera in single for t in camera.warnings),
    ]
    for warning in (*survey.warnings, *notes, *path.warnings, *of_images, *log.warnings, *page.warnings):
        warn(warning)
    say(f"{output}: {page.n_pictures} images, {len(log.events or ())} keys")
    if page.failures:
        raise PartialError(
            f"{len(page.failures)} of {page.n_pictures} images cannot be read: {page.failures[0].rstrip('.')}",
            where=output,
        )
