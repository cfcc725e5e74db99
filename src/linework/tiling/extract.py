"""The whole job in one call."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from linework.files.survey import open_survey
from linework.methods.choose import ALL_KINDS, RunSettings, choose_methods
from linework.model.lines import LineSet
from linework.tiling.run import extract_lines


def extract(
    inputs: Path | str | Sequence[Path | str],
    *,
    kinds: tuple[str, ...] = ALL_KINDS,
    crs: str | None = None,
    settings: RunSettings | None = None,
) -> LineSet:
    """Return the lines of a survey: LAS / LAZ files, a folder of them, or a folder with a survey.toml.

    Parameters
    ----------
    kinds
        Kinds of line to look for.
    crs
        "EPSG:n", "EPSG:n+m" or "local", where the files do not say.

    Raises
    ------
    LineworkError
        One line: which file, what is wrong, what to do.

    >>> import linework
    >>> linework.extract("no-such-file.laz")
    Traceback (most recent call last):
    linework.errors.InputError: no-such-file.laz: cannot be opened: No such file or directory. Check the name.
    """
    listed = [inputs] if isinstance(inputs, str | Path) else list(inputs)
    survey = open_survey([Path(item) for item in listed], crs=crs)
    return extract_lines(survey, choose_methods("auto", kinds, settings or RunSettings())).lines
