"""`linework calibrate`: the calibration of the stereo cameras, adjusted by the survey itself."""

from __future__ import annotations

import contextlib
from pathlib import Path
from typing import Annotated

import typer

from linework.cli.failures import warn
from linework.cli.options import (
    AllowOutside,
    AllowRemote,
    AsJson,
    Crs,
    Overwrite,
    Quiet,
    TrajectoryFile,
    WorkFolder,
)
from linework.cli.said import say, say_json


def calibrate_command(
    surveys: Annotated[
        list[Path],
        typer.Argument(
            metavar="SURVEY", help="Survey folder with [cameras.left] and [cameras.right], or a KITTI drive."
        ),
    ],
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="FILE", help="Output calibration: .toml.")
    ],
    trajectory: TrajectoryFile = None,
    crs: Crs = None,
    allow_outside: AllowOutside = False,
    allow_remote: AllowRemote = False,
    work: WorkFolder = None,
    overwrite: Overwrite = False,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Adjust the calibration of the stereo cameras by corners followed over pairs, and by the trajectory.

    Prints every parameter before and after, with its standard deviation, and whether the survey supports a correction.
    Writes the tables [cameras.left] and [cameras.right] to put into survey.toml; the survey itself is not changed.
    """
    from linework.errors import UsageError
    from linework.files.output.locks import reserve_output
    from linework.library.progress import open_display

    if output.suffix.lower() != ".toml":
        raise UsageError(f"cannot write a calibration as '{output.suffix}'", where=output, advice="use .toml")
    for path in surveys:
        if output.absolute() in (path.absolute(), (path / "survey.toml").absolute()):
            raise UsageError("the calibration would replace the description of the survey", where=output,
                             advice="choose another name")  # fmt: skip
    inputs = (trajectory,) if trajectory else ()
    with contextlib.ExitStack() as held:
        held.enter_context(reserve_output(output, overwrite=overwrite, inputs=inputs))
        display = held.enter_context(open_display(quiet=quiet))
        from linework.files.survey.calibration import write_calibration
        from linework.files.survey.open import open_survey
        from linework.runs.cameras.calibrate import calibrate_survey
        from linework.runs.opened.work_folder import work_folder
        from linework.runs.steps import RunSteps

        survey = open_survey(surveys, crs=crs, allow_outside=allow_outside, allow_remote=allow_remote)
        if trajectory is not None:
            survey = survey.with_trajectory(trajectory)
        found = calibrate_survey(survey, work_folder(survey.root, work), RunSteps(display))
        is_described = survey.settings_file is not None and survey.settings_file.suffix == ".toml"
        use = (
            "Put it in place of these tables of survey.toml."
            if is_described
            else "The survey has no survey.toml to put it into: linework extract --calibrate uses it."
        )
        head = f"Calibration of {survey.name}, written by linework calibrate. {use}"
        write_calibration(found.cameras, output, remarks=[head, *found.lines()], overwrite=overwrite)
    for text in found.warnings:
        warn(text)
    if as_json:
        say_json({**found.document(), "output": str(output)})
        return
    for line in found.lines():
        say(line)
