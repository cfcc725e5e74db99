"""The main job: lines in laser points, lines in stereo pairs, and where both saw a feature, that feature once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from linework.errors import InputError
from linework.lines.merged import merge_line_sets
from linework.methods.protocol import Method
from linework.methods.stereo.method import StereoMethod
from linework.model.lines import KINDS, LineSet
from linework.processes.executors import Executor, Serial
from linework.runs.extraction import Extraction, PairAccount, identify
from linework.runs.laser import extract_lines
from linework.runs.opened.recordings import Recordings
from linework.runs.resume import RunFolder
from linework.runs.settings import RunSettings
from linework.runs.steps import RunSteps
from linework.runs.stereo import stereo_lines


def find_lines(
    recordings: Recordings,
    methods: Sequence[Method],
    stereo: StereoMethod | None,
    run: RunFolder,
    *,
    settings: RunSettings | None = None,
    executor: Executor | None = None,
    steps: RunSteps | None = None,
) -> Extraction:
    """Return all lines that the methods find in what the van recorded.

    Parameters
    ----------
    methods
        Look at the points, where there are any.
    stereo
        Looks at the stereo pairs, where there are any; or None.

    Raises
    ------
    PartialError
        Not one tile could be worked.

    Notes
    -----
    Where points and pairs show the same feature, the line with the smaller sigma stays in the layer of its kind,
    and the stereo lines as they were measured are in the layer ``<kind>_stereo``.
    """
    settings, steps, executor = settings or RunSettings(), steps or RunSteps(), executor or Serial()
    found = None
    unusable = recordings.problems
    if recordings.points is not None and methods:
        found = extract_lines(
            recordings.points, methods, run,
            road=settings.road, tiling=settings.tiling, executor=executor, steps=steps,
        )  # fmt: skip
        found = replace(found, warnings=recordings.warnings, unusable=unusable)
    if recordings.stereo is None or stereo is None:
        assert found is not None
        return found
    lines, pairs = stereo_lines(recordings.stereo, stereo, run, executor, steps)
    if found is None:
        _refuse_unusable(pairs, recordings.survey.name)
        return Extraction(
            source=recordings.survey.name, lines=identify(lines), kinds=_in_order(stereo.kinds), read=None,
            tiles=(), failures=(), traces=pairs.traces, hashes=recordings.hashes,
            warnings=recordings.warnings, pairs=pairs, unusable=unusable,
        )  # fmt: skip
    with steps.step("merge lines"):
        as_measured = lines.with_columns(
            kind=np.array([f"{kind}_stereo" for kind in lines.kind.tolist()], dtype=np.str_)
        )
        both = identify(LineSet.concatenate([merge_line_sets(found.lines, lines), as_measured]))
    kinds = (
        *_in_order({*found.kinds, *stereo.kinds}),
        *(f"{kind}_stereo" for kind in _in_order(stereo.kinds)),
    )
    return replace(
        found,
        lines=both,
        kinds=kinds,
        traces={**found.traces, **pairs.traces},
        hashes=recordings.hashes,
        pairs=pairs,
    )


def _refuse_unusable(pairs: PairAccount, name: str) -> None:
    """End a run on images alone of which not one pair could be used; our own faults with their traceback."""
    if pairs.n_used:
        return
    if pairs.traces:
        fault = RuntimeError(pairs.failures[0][1])
        fault.add_note(next(iter(pairs.traces.values())))  # what the log shows
        raise fault
    raise InputError(
        f"none of {pairs.n_pairs} stereo pairs can be used, the first: {pairs.failures[0][1].rstrip('.')}",
        where=name, advice="mend that, and run again",
    )  # fmt: skip


def _in_order(kinds: set[str] | tuple[str, ...]) -> tuple[str, ...]:
    return tuple(kind for kind in KINDS if kind in kinds)
