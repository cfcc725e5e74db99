"""The errors that linework raises: one root, one class per exit code or cause, each also a builtin exception.

A message names the file, the problem with its numbers, and the remedy:
``error: FILE: what is wrong. What to do.`` The command line prints exactly that line.

A message that concerns what the caller gave names the parameter with `argument`. It is the same error for all
callers: Python reads ``overwrite=True``, the command line prints the option (`linework.cli.options.option_words`).
"""

from __future__ import annotations

import contextlib
import difflib
import errno
import importlib
import importlib.util
import json
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any, ClassVar

#: How a caller names a parameter, with a value that it could be given (None: without one).
Speech = Callable[[str, str | int | bool | None], str]
#: What stands around a parameter in a message: characters of private use, which no file name or value has.
_BEGIN, _END = "\ue000", "\ue001"
_ARGUMENT = re.compile(f"{_BEGIN}([a-z_]+)=([^{_BEGIN}{_END}]*){_END}")
#: Longest message beside the name of the file, four lines of a terminal; its advice is never cut. [characters]
MOST_CHARACTERS = 280
#: A document may name a file as long as itself; Linux takes no path longer than this. [characters]
_MOST_OF_A_PATH = 4096
#: The password in an address or in the description of a connection: paths drop one of the slashes. Addresses of Dask
#: (tcp, tls, ws, wss, ucx) hold none.
_PASSWORD = re.compile(
    r"(?i)((?:\b(?!(?:https?|tcp|tls|wss?|ucx):)[a-z][a-z0-9+.-]{0,20}:/{1,2}[^/@\s:]{0,100}:)"
    # A port of the web is none
    r"|(?:\bhttps?:/{1,2}[^/@\s:]{0,100}:(?!\d{1,5}(?:[/\s]|:\s|$)))|(?:\b(?:password|passwd|pwd)\s*=\s*))[^@\s,;&'\"]+"
)

_ONE_SLASH = re.compile(r"(?i)^(https?|s3):/(?!/)")


def argument(name: str, value: str | int | bool | None = None) -> str:
    """Return a parameter as a part of a message, to be put in words for each caller.

    Parameters
    ----------
    name
        The parameter's name in Python.
    value
        A value that it could be given; None: the message names the parameter alone.

    Examples
    --------
    >>> error = UsageError("output exists", where="a.gpkg", advice=f"give {argument('overwrite', True)}")
    >>> str(error)
    'a.gpkg: output exists. Give overwrite=True.'
    """
    return f"{_BEGIN}{name}={'' if value is None else json.dumps(value)}{_END}"


def python_words(name: str, value: str | int | bool | None) -> str:
    """Return a parameter as it is written in a call.

    >>> python_words("crs", "local"), python_words("work", None)
    ('crs="local"', 'work=')
    """
    shown = "" if value is None else str(value) if isinstance(value, int) else json.dumps(value)
    return f"{name}={shown}"


def in_words(text: str, speech: Speech = python_words) -> str:
    """Return a text with its parameters as a caller names them."""
    return _ARGUMENT.sub(lambda found: speech(found[1], json.loads(found[2]) if found[2] else None), text)


def printable(text: str, *, keep: str = "") -> str:
    r"""Return a text as a terminal may get it: what is not printable is written as its escape sequence.

    Names in files and of files may hold sequences that clear a terminal, rename its window or type a command.

    Parameters
    ----------
    keep
        Characters that stay all the same, such as the ends of the lines of a text of ours.

    >>> printable("a\x1b[2Jb\n"), printable("a\tb\n", keep="\n")
    ('a\\x1b[2Jb\\n', 'a\\tb\n')
    """
    return "".join(c if c.isprintable() or c in keep else repr(c)[1:-1] for c in text)


def did_you_mean(unknown: Iterable[str], known: Iterable[str]) -> str:
    """Return the end of a message about unknown names: what is nearest to them, "" if nothing is near.

    >>> did_you_mean(["bend"], ["straight", "bends"])
    '. Did you mean bends?'
    """
    known = tuple(known)
    lower = {name.lower(): name for name in known}
    near = [lower[n] for name in unknown for n in difflib.get_close_matches(name.lower(), lower, 1)]
    return f". Did you mean {' and '.join(dict.fromkeys(near))}?" if near else ""


def _shortened(text: str, most: int) -> str:
    """Return a text, cut at a number of characters; those that are escaped count as what is printed.

    >>> _shortened("unknown key", 20), _shortened("known are " + "a, " * 50, 20)
    ('unknown key', 'known are a, a ...')
    """
    shown = 0
    for i, character in enumerate(text):
        shown += 1 if character.isprintable() else len(repr(character)) - 2
        if shown > most:
            return f"{text[: max(i - 4, 0)].rstrip(' ,;')} ..."
    return text


class LineworkError(Exception):
    """Base class of all errors that linework raises on purpose.

    Parameters
    ----------
    problem
        What is wrong, with numbers; no full stop.
    where
        The file concerned, or the parameter as `argument` gives it.
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
        return self.line()

    def line(self, speech: Speech = python_words) -> str:
        """Return the line that a user sees, its parameters as this caller names them, passwords left out.

        >>> UsageError("not a file", where="pg://me:secret@host/db").line()
        'pg://me:***@host/db: not a file.'
        >>> UsageError("not a CRS", where=argument("crs")).line(lambda name, value: f"option {name}")
        'option crs: not a CRS.'
        """
        # In front of a colon a parameter stands alone: `crs: `, not `crs=: `
        where = _shortened(in_words(str(self.where), speech).removesuffix("="), _MOST_OF_A_PATH)
        # Paths drop one of the slashes
        where = _ONE_SLASH.sub(r"\1://", where)
        text = f"{where}: " if self.where is not None else ""
        problem = _shortened(in_words(self.problem, speech), MOST_CHARACTERS - len(self.advice))
        text += problem if problem.endswith("?") else f"{problem}."
        if self.advice.startswith("pip "):
            # To be copied to the end of the line
            text += f" {self.advice}"
        elif self.advice:
            # Commands and parameters are case-sensitive: no capital at the start of a sentence
            is_literal = self.advice.startswith(("linework ", _BEGIN))
            text += f" {self.advice if is_literal else self.advice[0].upper() + self.advice[1:]}."
        return _PASSWORD.sub(r"\1***", printable(in_words(text, speech)))


class UsageError(LineworkError, ValueError):
    """The arguments of a command or call are wrong or contradict one another."""

    exit_code = 2


class ConfigError(LineworkError, ValueError):
    """A setting is unknown, of the wrong type, or out of range."""

    exit_code = 2


class InputError(LineworkError, ValueError):
    """An input file cannot be used: truncated, damaged, empty, or of another format than it claims."""

    exit_code = 3


class RefusedPickError(InputError):
    """No line at a place, or at a pixel.

    Parameters
    ----------
    reason
        Reason, without the place.
    at
        The place, as text.
    where
        Survey or image.
    works
        Nearest place (east, north) [m, world] or pixel (col, row) that works; None: there is none near.
    """

    def __init__(
        self,
        reason: str,
        at: str,
        *,
        where: object,
        advice: str,
        works: tuple[float, float] | None = None,
    ) -> None:
        super().__init__(f"{reason} {at}", where=where, advice=advice)
        self.reason, self.works = reason, works


class CrsError(LineworkError, ValueError):
    """A coordinate reference system is missing, unknown, in degrees, or in conflict with another."""

    exit_code = 3


class UnknownKindError(LineworkError, KeyError):
    """A kind of line that linework does not know and that none of the lines has.

    Parameters
    ----------
    kind
        The name that was given.
    known
        Kinds that could have been meant.
    present
        Kinds of the lines.
    """

    exit_code = 2

    def __init__(self, kind: str, known: Iterable[str], present: Sequence[str]) -> None:
        self._given = kind, tuple(known), tuple(present)
        problem = f"unknown kind '{kind}'{did_you_mean([kind], self._given[1])}"
        super().__init__(problem, advice=f"these lines hold {', '.join(present) or 'no kinds'}")

    def __reduce__(self) -> tuple[object, ...]:
        return type(self), self._given


class MissingPackageError(LineworkError, ImportError):
    """An optional package that this call needs is not installed."""

    exit_code = 5


class PartialError(LineworkError, RuntimeError):
    """The run finished, but some files or tiles failed; run.json lists them.

    `lines` are those that were found all the same, where a function that returns lines raises it.
    """

    exit_code = 4
    lines: Any = None


class MachineError(LineworkError, OSError):
    """The machine cannot do it: disk full, read-only folder, no permission, out of memory."""

    exit_code = 5


class OutputExistsError(LineworkError, FileExistsError):
    """The output exists and was not to be overwritten, or another run holds its lock."""

    exit_code = 6


class OwnCodeError(LineworkError, RuntimeError):
    """A function that the user passed in failed: the message has its exception and the line, a note its traceback."""

    exit_code = 1


class AbsentError(LineworkError, LookupError):
    """No such line, image or job, or no access to it: the message is the same, so that it reveals nothing."""

    exit_code = 2


class StaleError(LineworkError, RuntimeError):
    """The state that a change is based on has changed since: another change came first."""

    exit_code = 6


#: What to do about a full disk.
FREE_SPACE = "free some space, or write to another disk"
#: How the system and the libraries say that a disk or a quota is full; not all of them leave an errno.
_FULL = ("no space left", "disk is full", "quota exceeded", "disk full")


def is_full_disk(error: BaseException) -> bool:
    """Return whether an error, or what it came from, is that of a full disk or a quota that is used up.

    >>> is_full_disk(OSError(28, "No space left on device")), is_full_disk(OSError(5, "Input/output error"))
    (True, False)
    """
    texts = [str(error).lower(), str(error.__cause__ or "").lower()]
    by_number = isinstance(error, OSError) and error.errno in (errno.ENOSPC, errno.EDQUOT)
    return by_number or any(words in text for words in _FULL for text in texts)


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
    "workbench": (
        "the workbench",
        ("fastapi", "pydantic", "starlette", "uvicorn", "h11", "websockets", "PIL"),
    ),
    "simulate": ("simulated surveys", ("embreex", "PIL")),
    "reports": ("reports, pictures and rasters", ("matplotlib", "jinja2", "rasterio", "PIL", "xlsxwriter")),
    "cad": ("DXF files", ("ezdxf",)),
    "postgis": ("PostGIS databases", ("psycopg",)),
    "e57": ("E57 files", ("pye57",)),
    "remote": ("points at an address", ("obstore",)),
    "dask": ("runs on a cluster", ("distributed",)),
    "parquet": ("GeoParquet files", ("pyarrow",)),
    "tables": ("data frames and Arrow tables", ("geopandas", "pandas", "arro3", "xarray")),
}
#: Packages whose name is another than that of their module.
_DISTRIBUTIONS = {
    "PIL": "pillow",
    "cv2": "opencv-python-headless",
    "arro3": "arro3-core",
    "psycopg": "psycopg[binary]",
}


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


class LineworkWarning(UserWarning):
    """A result that can be used, but not without a look: what was odd in the input, what was left out."""
