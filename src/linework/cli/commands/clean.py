"""`linework clean`: delete the work folder of a survey.

Separate from the other commands, as every command has its own file.
"""

from __future__ import annotations

from linework.cli.options import SurveyArgument, WorkFolder
from linework.cli.said import say
from linework.errors import InputError, argument


def clean(
    surveys: SurveyArgument,
    work: WorkFolder = None,
) -> None:
    """Delete the tile store and unfinished runs of SURVEY.

    Both can be rebuilt. Only what linework made is deleted: inputs, outputs, links and files of others stay.
    """
    from linework.cli.failures import warn
    from linework.runs.opened.work_folder import clean_work_folder, existing_work_folders, survey_root

    missing = next(
        (path for path in (*surveys, *([] if work is None else [work])) if not path.exists()), None
    )
    if missing is not None:
        raise InputError("does not exist", where=missing, advice="check the path")
    if work is not None and not work.is_dir():
        raise InputError("is not a folder", where=work, advice=f"name a folder as {argument('work')}")
    folders = existing_work_folders(survey_root(surveys), work)
    for folder in folders:
        cleaned = clean_work_folder(folder)
        say(f"{folder}: {cleaned.n_bytes / 1e6:,.1f} MB freed")
        for path in cleaned.kept:
            warn(f"{path}: kept, linework did not make it")
    if not folders:
        say("nothing to delete")
