"""Every error linework raises: one root, a leaf per exit code or cause, each also a builtin.

An error names the file, says what is wrong with numbers, and says what to do:
``error: FILE: what is wrong. What to do.`` The command line prints exactly that line.
"""

from __future__ import annotations

from typing import ClassVar


class LineworkError(Exception):
    """Root of all errors raised on purpose.

    Parameters
    ----------
    problem
        What is wrong, with numbers; no full stop.
    where
        File (or option) it is about.
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
        """Return the one line a user sees: control characters escaped, no library dump.

        >>> str(InputError("empty file", where="a.laz", advice="copy it again"))
        'a.laz: empty file. Copy it again.'
        >>> str(UsageError("no such thing. Did you mean 'x'?", advice="linework config prints all"))
        "no such thing. Did you mean 'x'? linework config prints all."
        """
        text = f"{self.where}: " if self.where is not None else ""
        text += self.problem if self.problem.endswith("?") else f"{self.problem}."
        if self.advice:
            # The command is typed as it is written, also where a sentence begins
            is_command = self.advice.startswith("linework ")
            text += f" {self.advice if is_command else self.advice[0].upper() + self.advice[1:]}."
        return "".join(c if c.isprintable() else repr(c)[1:-1] for c in text)


class UsageError(LineworkError, ValueError):
    """The command or call does not make sense as given."""

    exit_code = 2


class ConfigError(LineworkError, ValueError):
    """A setting is unknown, of the wrong type, or out of its range."""

    exit_code = 2


class InputError(LineworkError, ValueError):
    """An input file cannot be used: cut off, damaged, empty, not what it claims to be."""

    exit_code = 3


class CrsError(LineworkError, ValueError):
    """A coordinate reference system is missing, in degrees, in conflict, or unknown."""

    exit_code = 3


class PartialError(LineworkError, RuntimeError):
    """The work finished, but some files or tiles failed; run.json lists them."""

    exit_code = 4


class MachineError(LineworkError, OSError):
    """The machine said no: disk full, read-only folder, no permission, out of memory."""

    exit_code = 5


class OutputExistsError(LineworkError, FileExistsError):
    """The output is there already and ``--overwrite`` was not given, or another run holds it."""

    exit_code = 6


class AbsentError(LineworkError, LookupError):
    """There is no such line, image, job ..., or it may not be seen: both are told by the same words."""

    exit_code = 2


class StaleError(LineworkError, RuntimeError):
    """What a change starts from has changed since: somebody else was first."""

    exit_code = 6
