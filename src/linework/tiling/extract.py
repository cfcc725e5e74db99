"""The whole job in one call."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path

from linework.errors import PartialError
from linework.files.survey import open_survey
from linework.methods.choose import ALL_KINDS, choose_methods, stereo_method
from linework.model.lines import LineSet
from linework.tiling.find import find_lines
from linework.tiling.recordings import opened_recordings
from linework.tiling.settings import RunSettings
from linework.tiling.unfinished import run_folder
from linework.tiling.work_folder import work_folder


def extract(
    inputs: Path | str | Sequence[Path | str],
    *,
    kinds: tuple[str, ...] = ALL_KINDS,
    crs: str | None = None,
    settings: RunSettings | None = None,
    work: Path | None = None,
) -> LineSet:
    """Return the lines of a survey: LAS / LAZ files, a folder of them, a survey folder, or a KITTI drive.

    Parameters
    ----------
    kinds
        Kinds of line to look for.
    crs
        "EPSG:n", "EPSG:n+m" or "local", where the files do not say.
    work
        Folder where the decoded points stay for the next call; None: they are kept among the temporary
        files, for this call only.

    Raises
    ------
    LineworkError
        One line: which file, what is wrong, what to do. A tile or an image that could not be worked is an
        error here.

    >>> import linework
    >>> linework.extract("no-such-file.laz")
    Traceback (most recent call last):
    linework.errors.InputError: no-such-file.laz: cannot be opened: No such file or directory. Check the name.
    """
    listed = [inputs] if isinstance(inputs, str | Path) else list(inputs)
    survey = open_survey([Path(item) for item in listed], crs=crs)
    settings = settings or RunSettings()
    methods = choose_methods("auto", kinds, radon=settings.radon, obb=settings.obb)
    stereo = stereo_method("auto", kinds, settings.stereo)
    with tempfile.TemporaryDirectory(prefix="linework-") as temporary:
        folder = work_folder(survey.root, work or Path(temporary))
        with (
            opened_recordings(survey, folder, images=stereo is not None) as recordings,
            run_folder(folder, Path(temporary) / "lines", {}) as run,
        ):
            found = find_lines(recordings, methods, stereo, run, settings=settings)
    failures = [*found.failures, *(found.pairs.failures if found.pairs else ()), *found.unusable]
    if failures:
        what, problem = failures[0]
        raise PartialError(
            f"{len(failures)} tiles, images or logs failed, the first {what}: {problem}", where=survey.name
        )
    return found.lines
