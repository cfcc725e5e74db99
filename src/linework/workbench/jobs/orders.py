"""What the server asks of the process of a job, and what it gets.

Separate from `extract`, which runs in that process and imports all methods.
"""

from __future__ import annotations

from dataclasses import dataclass

from linework.model.lines import LineSet


@dataclass(frozen=True, slots=True, kw_only=True)
class JobRequest:
    """What a job has to find.

    Parameters
    ----------
    kinds, method
        See `linework.methods.kinds`.
    name
        Distinguishes its unfinished run from others: the same for the same line file.
    """

    kinds: tuple[str, ...]
    method: str
    name: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class JobResult:
    """Result of a job.

    Parameters
    ----------
    lines
        Lines of all requested kinds.
    counts
        Number of lines by requested kind, 0 included.
    message
        What was left out and why, on one line; "": nothing.
    """

    lines: LineSet
    counts: dict[str, int]
    message: str
