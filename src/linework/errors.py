"""The errors that linework raises: one root, one class per exit code or cause, each also a builtin exception.

A message names the file, the problem with its numbers, and the remedy:
``error: FILE: what is wrong. What to do.`` The command line prints exactly that line.
"""

from __future__ import annotations

import contextlib
import importlib
import importlib.util
from collections.abc import Iterator
from typing import Any, ClassVar


class LineworkError(Exception):
    """Base class of all errors that linework raises on purpose.

    Parameters
    ----------
    problem
        What is wrong, with numbers; no full stop.
    where
        The file or option concerned.
    advice
        What to do about it; no full stop.
    """

    exit_code: ClassVar[int] = 1

    def __init__(self, problem: str, *, where: object = None, advice: str = "") -> None:
        super().__init__(problem)
        self.problem = problem
        self.where = where
        self.advice = advice

    def __str__(self) -> str:
        """Return the line that a user sees, with control characters escaped.

        >>> str(InputError("empty file", where="a.laz", advice="copy it again"))
        'a.laz: empty file. Copy it again.'
        >>> str(UsageError("unknown setting y. Did you mean 'x'?", advice="linework config prints all"))
        "unknown setting y. Did you mean 'x'? linework config prints all."
        """
        text = f"{self.where}: " if self.where is not None else ""
        text += self.problem if self.problem.endswith("?") else f"{self.problem}."
        if self.advice.startswith("pip "):
            # To be copied to the end of the line
            text += f" {self.advice}"
        elif self.advice:
            # Commands are case-sensitive: no capital at the start of a sentence
            is_command = self.advice.startswith("linework ")
            text += f" {self.advice if is_command else self.advice[0].upper() + self.advice[1:]}."
        return "".join(c if c.isprintable() else repr(c)[1:-1] for c in text)


class UsageError(LineworkError, ValueError):
    """The arguments of a command or call are wrong or contradict one another."""

    exit_code = 2


class ConfigError(LineworkError, ValueError):
    """A setting is unknown, of the wrong type, or out of range."""

    exit_code = 2


class InputError(LineworkError, ValueError):
    """An input file cannot be used: truncated, damaged, empty, or of another format than it claims."""

    exit_code = 3


class CrsError(LineworkError, ValueError):
    """A coordinate reference system is missing, unknown, in degrees, or in conflict with another."""

    exit_code = 3


class MissingPackageError(LineworkError, ImportError):
    """An optional package that this call needs is not installed."""

    exit_code = 5


class PartialError(LineworkError, RuntimeError):
    """The run finished, but some files or tiles failed; run.json lists them."""

    exit_code = 4


class MachineError(LineworkError, OSError):
    """The machine cannot do it: disk full, read-only folder, no permission, out of memory."""

    exit_code = 5


class OutputExistsError(LineworkError, FileExistsError):
    """The output exists and ``--overwrite`` was not given, or another run holds its lock."""

    exit_code = 6


class AbsentError(LineworkError, LookupError):
    """No such line, image or job, or no access to it: the message is the same, so that it reveals nothing."""

    exit_code = 2


class StaleError(LineworkError, RuntimeError):
    """The state that a change is based on has changed since: another change came first."""

    exit_code = 6


def needed(package: str, extra: str, *, where: object = None) -> Any:
    """Return an optional package or one of its modules, imported.

    Parameters
    ----------
    package
        Name to import, such as "geopandas" or "matplotlib.pyplot".
    extra
        The extra of linework that installs it.
    where
        What needs it: a function or an option.

    Raises
    ------
    MissingPackageError
        It is not installed; the message holds the command that installs it.

    Examples
    --------
    >>> needed("json", "tables").dumps([1])
    '[1]'
    >>> needed("no_such_package.module", "tables", where="to_geopandas()")
    Traceback (most recent call last):
        ...
    linework.errors.MissingPackageError: to_geopandas(): needs the package no_such_package. pip install 'linework[tables]'
    """
    with extra_needed(extra, where=where):
        return importlib.import_module(package)


#: The extras of the installation: what each is for, as messages say it, and the modules that it is not there without.
EXTRAS = {
    "stereo": ("stereo images", ("cv2", "PIL")),
    "workbench": ("the workbench", ("fastapi", "pydantic", "starlette", "uvicorn", "websockets", "PIL")),
    "simulate": ("simulated surveys", ("embreex", "PIL")),
    "reports": ("reports, pictures and rasters", ("matplotlib", "jinja2", "rasterio", "PIL")),
    "cad": ("DXF files", ("ezdxf",)),
    "tables": ("data frames and Arrow tables", ("geopandas", "pandas", "pyarrow", "xarray")),
    "dask": ("work on a Dask cluster", ("distributed",)),
}
#: Packages whose name is another than that of their module.
_DISTRIBUTIONS = {"PIL": "pillow", "cv2": "opencv-python-headless"}


@contextlib.contextmanager
def extra_needed(extra: str, *, where: object = None) -> Iterator[None]:
    """Import packages of an extra in the context; if one is missing, say which command installs it.

    Parameters
    ----------
    extra
        The extra of linework that installs them.
    where
        What needs them; by default what the extra is for.

    Raises
    ------
    MissingPackageError
        One is not installed.

    Examples
    --------
    >>> with extra_needed("stereo"):
    ...     import no_such_package
    Traceback (most recent call last):
        ...
    linework.errors.MissingPackageError: stereo images: needs the package no_such_package. pip install 'linework[stereo]'
    """
    try:
        yield
    except ModuleNotFoundError as error:
        name = (error.name or str(error)).split(".")[0]
        if name == "linework":
            raise
        raise _missing(name, extra, where) from error


def check_extra(extra: str, *, where: object = None) -> None:
    """Raise, before any work, if a package of an extra is not installed; nothing is imported.

    Raises
    ------
    MissingPackageError
        One is not installed; the message holds the command that installs it.
    """
    for name in EXTRAS[extra][1]:
        with extra_needed(extra, where=where):
            if importlib.util.find_spec(name) is None:
                raise _missing(name, extra, where)


def _missing(name: str, extra: str, where: object) -> MissingPackageError:
    return MissingPackageError(
        f"needs the package {_DISTRIBUTIONS.get(name, name)}",
        where=where if where is not None else EXTRAS[extra][0],
        advice=f"pip install 'linework[{extra}]'",
    )
