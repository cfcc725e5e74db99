"""The report of an extraction for callers in Python, its warnings, and what was left out.

Separate from `extract`, because every public function warns in the same way.
"""

from __future__ import annotations

import sys
import warnings
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Literal, get_args

import linework
from linework.errors import LineworkWarning, PartialError, UsageError, argument, printable
from linework.model.lines import LineSet
from linework.model.lineset.report import InputReport, LeftOut, Report
from linework.runs.extraction import Extraction, Failure, path_text
from linework.runs.opened.recordings import Recordings
from linework.runs.record import versions

_PACKAGE = Path(linework.__file__).parent
#: What happens when something had to be left out: an error that holds the lines, or a warning.
OnProblem = Literal["raise", "warn"]


def check_on_problem(on_problem: str) -> None:
    """Refuse another value than those of `OnProblem`.

    Raises
    ------
    UsageError
        With the values that can be given.
    """
    if on_problem not in get_args(OnProblem):
        raise UsageError(f"{on_problem!r}", where=argument("on_problem"), advice='give "raise" or "warn"')


def warn_of(texts: Iterable[str]) -> None:
    """Warn the caller of linework of each text, once each."""
    for text in dict.fromkeys(texts):
        warnings.warn(printable(text), LineworkWarning, stacklevel=_level_of_caller())


def _level_of_caller() -> int:
    """Return how many frames above this function's caller the first one outside linework is: it is shown."""
    frame, level = sys._getframe(1), 1
    while frame.f_back is not None and Path(frame.f_code.co_filename).is_relative_to(_PACKAGE):
        frame, level = frame.f_back, level + 1
    return level


def report_of(found: Extraction, timings_s: Mapping[str, float]) -> Report:
    """Return the report of an extraction."""
    read, pairs, lines = found.read, found.pairs, found.lines
    inputs = [
        InputReport(path_text(facts.path), facts.n_points, dict(facts.n_rejected))
        for facts in (read.files if read else ())
    ]
    if pairs is not None:
        n_out = pairs.n_pairs - pairs.n_used
        inputs.append(InputReport("stereo pairs", pairs.n_used, {"not usable": n_out} if n_out else {}))
    left_out = [
        LeftOut("file", path_text(path), problem) for path, problem in (read.failures if read else ())
    ]
    left_out += [LeftOut(failure.what, failure.name, failure.problem) for failure in found.failures]
    return Report(
        source=found.source,
        kinds=found.kinds,
        n_lines={kind: int((lines.kind == kind).sum()) for kind in found.kinds},
        length_m={kind: float(lines.length_m[lines.kind == kind].sum()) for kind in found.kinds},
        inputs=tuple(inputs),
        left_out=tuple(left_out),
        warnings=tuple(found.warnings),
        adjusted=found.adjusted,
        timings_s=dict(timings_s),
        versions=versions(),
    )


def report_of_recordings(
    recordings: Recordings, lines: LineSet, kinds: Iterable[str], timings_s: Mapping[str, float]
) -> Report:
    """Return the report on lines that were followed in the recordings of a survey."""
    found = Extraction(
        source=recordings.survey.name,
        lines=lines,
        kinds=tuple(dict.fromkeys([*kinds, *lines.kind.tolist()])),
        read=recordings.points.facts if recordings.points else None,
        tiles=(),
        failures=tuple(Failure("recording", name, problem) for name, problem in recordings.problems),
        hashes=recordings.hashes,
        warnings=recordings.warnings,
    )
    return report_of(found, timings_s)


def left_out_summary(report: Report) -> str:
    """Return a line on what was left out and why, "" if nothing was."""
    if not report.left_out:
        return ""
    first, n = report.left_out[0], len(report.left_out)
    problem = first.problem if first.name in first.problem else f"{first.name}: {first.problem}"
    kind = (
        f"{first.what}s" if n > 1 and all(one.what == first.what for one in report.left_out) else first.what
    )
    if n > 1 and kind == first.what:
        kind = "files, tiles, images or recordings"
    return f"{n} {kind} left out{', the first' if n > 1 else ''}: {problem.rstrip('.')}"


def lose_nothing(lines: LineSet, report: Report, on_problem: OnProblem) -> LineSet:
    """Return the lines with their report; warn of its warnings, and of what was left out or raise it.

    Raises
    ------
    PartialError
        Something was left out, and `on_problem` is "raise"; it has the lines as ``error.lines``.
    """
    lines = replace(lines, report=report)
    warn_of(report.warnings)
    problem = left_out_summary(report)
    if problem and on_problem == "warn":
        warn_of([problem])
    if not problem or on_problem == "warn":
        return lines
    error = PartialError(
        problem, where=report.source, advice=f"{argument('on_problem', 'warn')} returns the other lines"
    )
    error.lines = lines
    raise error
