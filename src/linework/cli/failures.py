"""How a command failed: the one line that the user sees, and the exit code."""

from __future__ import annotations

import contextlib
import errno
import os
import sys
import tempfile
import traceback
from dataclasses import dataclass

import typer

from linework.cli.options import option_words
from linework.errors import FREE_SPACE, InputError, LineworkError, MachineError, UsageError, is_full_disk

#: The base of typer's errors about arguments (click's ClickException, which typer may bring along itself).
_ArgumentException: type[BaseException] = typer.BadParameter.__mro__[2]

#: Errors of the machine by errno, with the advice for each.
_MACHINE_ADVICE = {
    errno.ENOSPC: "free some space there, or write elsewhere",
    errno.EDQUOT: "free some of the quota, or write elsewhere",
    errno.EFBIG: "raise the file size limit (ulimit -f), or write elsewhere",
    errno.EACCES: "check the permissions, or use another folder",
    errno.EPERM: "check the permissions, or use another folder",
    errno.EROFS: "choose a writable folder",
    errno.EIO: "the disk reports a fault: check it, or use another one",
    errno.ENOMEM: "close other programs, or use a smaller survey",
    errno.EMFILE: "raise the limit on open files (ulimit -n)",
    errno.ENFILE: "raise the system limit on open files",
    errno.ENODEV: "check that the disk is mounted",
    errno.ESTALE: "check the network disk",
    errno.EAGAIN: "raise the limit on processes (ulimit -u)",
    errno.EBADF: "run it with open standard streams",
}
#: Where a disk is full, if an error of a library does not say it.
_FULL_SOMEWHERE = "the work folder or a temporary file"
#: Errors of a path: nothing there, or not what it should be.
_PATH_ERRORS = (errno.ENOENT, errno.ENOTDIR, errno.EISDIR, errno.ELOOP, errno.ENAMETOOLONG)


class Interrupted(BaseException):
    """The command was ended by a signal (SIGINT, SIGTERM); not an error.

    Parameters
    ----------
    message
        The line for the user.
    """

    def __init__(
        self,
        signal_number: int,
        message: str = "interrupted: nothing was written; run the same command again",
    ) -> None:
        super().__init__(signal_number)
        self.signal_number, self.message = signal_number, message


@dataclass(frozen=True, slots=True)
class CommandFailure:
    """How a command failed: the line for stderr ("" for none) and the exit code.

    Parameters
    ----------
    is_bug
        True for a bug in linework: its traceback is saved in a log.
    """

    line: str
    exit_code: int
    is_bug: bool = False


def failure_of(error: BaseException) -> CommandFailure:
    """Return the line and the exit code for an exception.

    >>> failure_of(InputError("empty file", where="a.laz", advice="copy it again"))
    CommandFailure(line='error: a.laz: empty file. Copy it again.', exit_code=3, is_bug=False)
    >>> failure_of(MemoryError()).exit_code
    5
    """
    ending = _interruption(error)
    if ending is not None:
        return CommandFailure(ending.message, 128 + ending.signal_number)
    if isinstance(error, BrokenPipeError):
        return CommandFailure("", 141)  # the reader closed the pipe: 128 + SIGPIPE, as a shell reports it
    if isinstance(error, LineworkError):
        return _from_own(error)
    if isinstance(error, _ArgumentException):
        return _from_own(_of_usage(error))
    if isinstance(error, MemoryError):
        text = str(error) or "out of memory"
        return _from_own(MachineError(text, where="memory", advice=_MACHINE_ADVICE[errno.ENOMEM]))
    if isinstance(error, OSError) and error.errno in _MACHINE_ADVICE:
        advice = _MACHINE_ADVICE[error.errno]
        return _from_own(MachineError(_reason(error), where=_path_of(error), advice=advice))
    if isinstance(error, OSError) and error.errno in _PATH_ERRORS:
        return _from_own(InputError(_reason(error), where=_path_of(error), advice="check the path"))
    if is_full_disk(error):
        return _from_own(MachineError(str(error).lower(), where=_FULL_SOMEWHERE, advice=FREE_SPACE))
    what = f"{type(error).__name__}: {error}" if str(error) else type(error).__name__
    bug = LineworkError(f"{what} (a bug in linework, not in your data)", where="linework")
    return CommandFailure(f"error: {bug}", 1, is_bug=True)


def _interruption(error: BaseException) -> Interrupted | None:
    """Return the interruption that an exception is, or in whose handling a library raised it; None: neither."""
    at: BaseException | None = error
    while at is not None:
        if isinstance(at, Interrupted | KeyboardInterrupt):
            return at if isinstance(at, Interrupted) else Interrupted(2)
        at = at.__cause__ or at.__context__
    return None


def _from_own(error: LineworkError) -> CommandFailure:
    return CommandFailure(f"error: {error.line(option_words)}", error.exit_code)


def _path_of(error: OSError) -> str:
    """Return the file of an error; errors of outputs name it, so one without a name is of another stream."""
    return str(error.filename) if error.filename else "standard output or a temporary file"


def _reason(error: OSError) -> str:
    return (error.strerror or type(error).__name__).lower()


def _of_usage(error: BaseException) -> UsageError:
    """Return an error of typer about the arguments as an error of linework."""
    context = getattr(error, "ctx", None)
    command = context.command_path if context is not None else "linework"
    message = error.format_message() if hasattr(error, "format_message") else str(error)
    problem = " ".join(message.split()).rstrip(".")
    return UsageError(problem, where=command, advice=f"see {command} --help")


def save_log(error: BaseException) -> str:
    """Write the traceback to a new temporary file and return its path; "" where none can be written."""
    with contextlib.suppress(OSError):
        handle, path = tempfile.mkstemp(prefix="linework-", suffix=".log")
        with os.fdopen(handle, "w", encoding="utf-8", errors="backslashreplace") as log:
            log.writelines(traceback.format_exception(error))
        return path
    return ""


def warn(text: str) -> None:
    """Print a warning as one line on stderr."""
    line = LineworkError(text.rstrip(".")).line(option_words)
    with contextlib.suppress(OSError, ValueError):
        print(f"warning: {line}", file=sys.stderr, flush=True)
