"""Every way a command can end badly, as one line for the user and one exit code."""

from __future__ import annotations

import contextlib
import errno
import os
import sys
import tempfile
import traceback
from dataclasses import dataclass

import typer

from linework.errors import InputError, LineworkError, MachineError, UsageError

_UsageException: type[BaseException] = typer.BadParameter.__mro__[1]
_ShownException: type[BaseException] = typer.BadParameter.__mro__[2]

# What the machine refuses, and what helps; everything else an OSError says is about a path that is not there.
_MACHINE_SAYS = {
    errno.ENOSPC: "free some space there, or write elsewhere",
    errno.EDQUOT: "free some of the quota, or write elsewhere",
    errno.EFBIG: "raise the limit of the file size, or write elsewhere",
    errno.EACCES: "ask for permission, or use another folder",
    errno.EPERM: "ask for permission, or use another folder",
    errno.EROFS: "choose a folder that can be written",
    errno.EIO: "the disk reports a fault: check it, or use another",
    errno.ENOMEM: "close other programs, or take a smaller survey",
    errno.EMFILE: "raise the limit of open files (ulimit -n)",
    errno.ENFILE: "raise the limit of open files",
    errno.ENODEV: "check that the disk is mounted",
    errno.ESTALE: "check the network disk",
    errno.EAGAIN: "raise the limit of processes (ulimit -u)",
    errno.EBADF: "open the standard streams",
}
_PATH_SAYS = (errno.ENOENT, errno.ENOTDIR, errno.EISDIR, errno.ELOOP, errno.ENAMETOOLONG)


class Interrupted(BaseException):
    """The user or the system asked the run to end (SIGINT, SIGTERM); not an error.

    Parameters
    ----------
    said
        How it ended.
    """

    def __init__(
        self, signal_number: int, said: str = "interrupted: nothing was written; run the same command again"
    ) -> None:
        super().__init__(signal_number)
        self.signal_number, self.said = signal_number, said


@dataclass(frozen=True, slots=True)
class CommandFailure:
    """How a command ended: the line for stderr ("" for none) and the exit code.

    Parameters
    ----------
    is_bug
        True where the fault is ours: the traceback belongs in a log.
    """

    line: str
    exit_code: int
    is_bug: bool = False


def failure_of(error: BaseException) -> CommandFailure:
    """Return the line and the exit code an exception ends in.

    >>> failure_of(InputError("empty file", where="a.laz", advice="copy it again"))
    Failure(line='error: a.laz: empty file. Copy it again.', exit_code=3, is_bug=False)
    >>> failure_of(MemoryError()).exit_code
    5
    """
    if isinstance(error, Interrupted | KeyboardInterrupt):
        ending = error if isinstance(error, Interrupted) else Interrupted(2)
        return CommandFailure(ending.said, 128 + ending.signal_number)
    if isinstance(error, BrokenPipeError):
        return CommandFailure("", 141)  # the reader of our output left: the shell's own code for that
    if isinstance(error, LineworkError):
        return _from_own(error)
    if isinstance(error, _ShownException):
        return _from_own(_of_usage(error))
    if isinstance(error, MemoryError):
        text = str(error) or "out of memory"
        return _from_own(MachineError(text, where="memory", advice=_MACHINE_SAYS[errno.ENOMEM]))
    if isinstance(error, OSError) and error.errno in _MACHINE_SAYS:
        advice = _MACHINE_SAYS[error.errno]
        return _from_own(MachineError(_said(error), where=_place(error), advice=advice))
    if isinstance(error, OSError) and error.errno in _PATH_SAYS:
        return _from_own(InputError(_said(error), where=_place(error), advice="check the path"))
    what = f"{type(error).__name__}: {error}" if str(error) else type(error).__name__
    bug = LineworkError(f"{what} (a fault of linework, not of your data)", where="linework")
    return CommandFailure(f"error: {bug}", 1, is_bug=True)


def _from_own(error: LineworkError) -> CommandFailure:
    return CommandFailure(f"error: {error}", error.exit_code)


def _place(error: OSError) -> str:
    """Return where it happened: outputs name themselves, so that what has no name is a stream of ours."""
    return str(error.filename) if error.filename else "standard output or a temporary file"


def _said(error: OSError) -> str:
    return (error.strerror or type(error).__name__).lower()


def _of_usage(error: BaseException) -> UsageError:
    """Return what typer found wrong with the arguments, in our words' order."""
    context = getattr(error, "ctx", None)
    command = context.command_path if context is not None else "linework"
    message = error.format_message() if hasattr(error, "format_message") else str(error)
    problem = " ".join(message.split()).rstrip(".")
    return UsageError(problem, where=command, advice=f"see {command} --help")


def save_log(error: BaseException) -> str:
    """Write the traceback to a file of its own and return its path, "" where no file can be made."""
    with contextlib.suppress(OSError):
        handle, path = tempfile.mkstemp(prefix="linework-", suffix=".log")
        with os.fdopen(handle, "w", encoding="utf-8", errors="backslashreplace") as log:
            log.writelines(traceback.format_exception(error))
        return path
    return ""


def warn(text: str) -> None:
    """Print a warning as one line on stderr."""
    line = str(LineworkError(text.rstrip(".")))
    with contextlib.suppress(OSError, ValueError):
        print(f"warning: {line}", file=sys.stderr, flush=True)
