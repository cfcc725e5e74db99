"""The main job: every method looks at the pieces of its source, and the lines of all sources are merged.

Separate from `extract`, which begins, resumes and publishes a run: this makes lines and writes no output.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NoReturn

import numpy as np

from linework.lines.merged import merge_line_sets
from linework.methods.kinds import kinds_in_order
from linework.methods.protocol import Method
from linework.model.ground import Ground
from linework.model.lines import POLE, LineSet
from linework.processes.executors import Executor, Serial
from linework.runs.extraction import Extraction, Failure, identify
from linework.runs.opened.recordings import Recordings
from linework.runs.own import GroundFinder, error_of_fault
from linework.runs.resume import RunFolder
from linework.runs.settings import RunSettings
from linework.runs.sources import Source, SourceAccount, open_sources
from linework.runs.steps import RunSteps
from linework.runs.tasks import RunTask, TasksDone, run_tasks


def find_lines(
    recordings: Recordings,
    methods: Sequence[Method],
    run: RunFolder,
    *,
    settings: RunSettings | None = None,
    ground: Ground | GroundFinder | None = None,
    executor: Executor | None = None,
    steps: RunSteps | None = None,
) -> Extraction:
    """Return all lines that the methods find in the recordings of a survey.

    Parameters
    ----------
    methods
        Each looks at one kind of recording; those whose recording the survey does not have are passed over.
    run
        Keeps the results of tasks; those that an earlier process has left there are used.
    ground
        Own ground, or a function that returns it; None: it is found (`linework.runs.opened.own_ground`).
    executor
        Does the tasks; the lines do not depend on it, nor on `settings.tiling`.
    steps
        Times and shows the steps.

    Raises
    ------
    PartialError, InputError
        Not one piece could be looked at. If some could not, `Extraction.failures` names them.

    Notes
    -----
    Where two recordings show the same feature, the line with the smaller sigma stays in the layer of its kind. The
    lines of the second recording as they were measured are in the layer ``<kind>_<method>``, such as
    ``lane_marking_stereo``.
    """
    settings, steps, executor = settings or RunSettings(), steps or RunSteps(), executor or Serial()
    sources = open_sources(recordings, methods, run, settings, executor, steps, ground)
    found, accounts = list[LineSet](), list[SourceAccount]()
    for source in sources:
        tasks = source.tasks(run.results)
        name, unit = source.looking
        with steps.step(name, unit=unit) as advance:
            done = run_tasks(tasks, run, executor, advance)
        accounts.append(source.account(done))
        with steps.step(source.joining):
            found.append(_joined(source, tasks, done).with_columns(crs=recordings.survey.crs))
    if all(account.is_empty for account in accounts):
        _refuse(sources[0], accounts[0])
    lines, kinds = _merged(sources, found, steps)
    if POLE in lines.kind:
        kinds = (*kinds, POLE)  # poles come with cables, unasked
    aside = next((account.aside for account in accounts if account.aside), None)
    unusable = (Failure("recording", what, problem) for what, problem in recordings.problems)
    return Extraction(
        source=recordings.survey.name,
        lines=lines,
        kinds=kinds,
        read=next((account.read for account in accounts if account.read), None),
        tiles=tuple(tile for account in accounts for tile in account.tiles),
        pairs=next((account.pairs for account in accounts if account.pairs), None),
        failures=(*(failure for account in accounts for failure in account.failures), *unusable),
        hashes=recordings.hashes,
        warnings=(*recordings.warnings, *filter(None, [aside.warning if aside else ""])),
        aside=aside,
    )


def _joined(source: Source, tasks: Sequence[RunTask], done: TasksDone) -> LineSet:
    """Return the lines of a source, method by method, each with the names of the files that show it."""
    lines = [
        method.join(done.evidence_of(method, tasks), source.context(method)) for method in source.methods
    ]
    return source.with_sources(LineSet.concatenate(lines))


def _merged(
    sources: Sequence[Source], found: Sequence[LineSet], steps: RunSteps
) -> tuple[LineSet, tuple[str, ...]]:
    """Return the lines of all sources in their order and with their names, and the kinds that were looked for."""
    lines, kinds = identify(found[0]), _kinds_of(sources[:1])
    for number, (source, other) in enumerate(zip(sources[1:], found[1:], strict=True), start=1):
        with steps.step("merge lines"):
            names = zip(other.kind.tolist(), other.method.tolist(), strict=True)
            layers = [f"{kind}_{method}" for kind, method in names]
            as_measured = other.with_columns(kind=np.array(layers, dtype=np.str_))
            lines = identify(LineSet.concatenate([merge_line_sets(lines, other), as_measured]))
        own = (f"{kind}_{method.name}" for method in source.methods for kind in kinds_in_order(method.kinds))
        kinds = (*_kinds_of(sources[: number + 1]), *own)
    return lines, kinds


def _kinds_of(sources: Sequence[Source]) -> tuple[str, ...]:
    """Return the kinds that the methods of some sources look for, in their fixed order."""
    return kinds_in_order(kind for source in sources for method in source.methods for kind in method.kinds)


def _refuse(source: Source, account: SourceAccount) -> NoReturn:
    """End a run that could look at nothing: by a fault of linework's own, with its traceback, or by the input's."""
    fault = next((failure for failure in account.failures if failure.trace), None)
    if fault is None:
        raise source.refusal(account)
    raise error_of_fault(fault)
