"""From an opened survey to published lines: begun, resumed, or found to be finished already."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from linework.errors import InputError, OutputExistsError
from linework.files.run_record import hash_file
from linework.files.van_log import van_log
from linework.methods.protocol import Method
from linework.methods.stereo.method import StereoMethod
from linework.tiling.executors import Executor
from linework.tiling.extraction import Extraction
from linework.tiling.find import find_lines
from linework.tiling.outputs import publish_extraction
from linework.tiling.record import record_path
from linework.tiling.recordings import Recordings
from linework.tiling.reviews import with_kept_reviews
from linework.tiling.settings import RunSettings
from linework.tiling.steps import Steps
from linework.tiling.unfinished import describe_run, fingerprint_of, made_here, run_folder


@dataclass(frozen=True, slots=True, kw_only=True)
class Order:
    """What is to be made, and of what may be there already.

    Parameters
    ----------
    output
        File of the lines.
    methods, stereo
        What looks at the points, and what looks at the stereo pairs.
    parameters
        All that was asked for, as it goes into the record.
    overwrite
        Replace an output of another run.
    resume
        Go on with a run of the same order that was killed.
    forget_reviews
        Lose what people said of the lines that are there.
    """

    output: Path
    methods: Sequence[Method]
    settings: RunSettings
    parameters: Mapping[str, Any]
    stereo: StereoMethod | None = None
    overwrite: bool = False
    resume: bool = False
    forget_reviews: bool = False


def extract_to(
    order: Order, recordings: Recordings, work: Path, executor: Executor, steps: Steps
) -> tuple[dict[str, Any], Extraction | None]:
    """Make the lines of a survey; return the record, and what was found unless it had been finished before.

    Raises
    ------
    OutputExistsError
        An output of another run is there, and `overwrite` is not set.
    UsageError
        The run to resume was begun with other parameters.
    """
    described = describe_run({**order.parameters, "recorded": recordings.identity}, recordings.hashes)
    fingerprint = fingerprint_of(described)
    if order.resume and os.path.lexists(order.output):
        record = _finished(order.output, fingerprint)
        if record is not None:
            return record, None
        if not order.overwrite and not made_here(work, order.output):
            raise OutputExistsError(
                "output exists already, and the run to resume has not made it", where=order.output,
                advice="choose another name or give --overwrite",
            )  # fmt: skip
    with run_folder(work, order.output, described, resume=order.resume) as run:
        found = find_lines(
            recordings, order.methods, order.stereo, run,
            settings=order.settings, executor=executor, steps=steps,
        )  # fmt: skip
        found, reviews = with_log(found, recordings), None
        if not order.forget_reviews:
            found, reviews = with_kept_reviews(found, order.output)
        record = publish_extraction(
            found, order.output, {**order.parameters, "fingerprint": fingerprint},
            overwrite=order.overwrite or order.resume,
            note=lambda sha256: run.journal.note_output(order.output.name, sha256),
            steps=steps,
            reviews=reviews,
        )  # fmt: skip
    return record, found


def with_log(found: Extraction, recordings: Recordings) -> Extraction:
    """Return what was found with the van's log beside it; a log that cannot be used stops nothing else."""
    series = recordings.stereo.series if recordings.stereo else None
    try:
        logged = van_log(recordings.survey, series, recordings.trajectory)
    except InputError as error:
        named = recordings.survey.settings.get("events", {}).get("file", "")
        return replace(found, unusable=(*found.unusable, (named, str(error))))
    return replace(found, logged=logged, warnings=(*found.warnings, *logged.warnings))


def _finished(output: Path, fingerprint: str) -> dict[str, Any] | None:
    """Return the record of the output that is there, if it is what this run would make."""
    try:
        record: dict[str, Any] = json.loads(record_path(output).read_text(encoding="utf-8"))
        is_ours = record["parameters"]["fingerprint"] == fingerprint
        is_whole = record["output"]["sha256"] == hash_file(output)
    except (OSError, ValueError, KeyError, TypeError):
        return None
    return record if is_ours and is_whole else None
