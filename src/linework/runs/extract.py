"""From an opened survey to published lines: a new run, a resumed run, or one that is finished already."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from linework.errors import OutputExistsError, UsageError, argument
from linework.files.documents import read_json
from linework.files.output.record import hash_file
from linework.methods.choose import choose_methods, with_candidates
from linework.methods.kinds import PUBLISHED_KINDS_OF
from linework.methods.protocol import Method
from linework.model.ground import Ground
from linework.model.survey import Survey
from linework.processes.executors import Executor
from linework.processes.identity import identity_of
from linework.published.methods import published_method
from linework.runs.drives.adjusted import find_lines_of_drives
from linework.runs.extraction import Extraction, Failure
from linework.runs.opened.recordings import Recordings
from linework.runs.outputs import publish_extraction, refuse_to_lose, with_kept_reviews
from linework.runs.own import GroundFinder, check_own_code, own_code_of
from linework.runs.record import record_path
from linework.runs.resume import describe_run, fingerprint_of, is_result_of_run, run_folder
from linework.runs.settings import RunSettings
from linework.runs.steps import RunSteps


@dataclass(frozen=True, slots=True, kw_only=True)
class ExtractionRequest:
    """A request to extract lines.

    Parameters
    ----------
    output
        File of the lines.
    methods
        Look at the points, or at the stereo pairs.
    parameters
        All that was asked for, as it is written to run.json.
    ground
        Own ground, or a function that returns it; None: it is found.
    overwrite
        Replace an output of another run.
    resume
        Continue a run of the same request that was killed.
    forget_reviews
        Discard the review decisions of the lines that are replaced.
    lanes, location
        Also write the lanes, as for `linework.files.vectors.read_write.write_lines`.
    adjust
        Make several drives over one road agree first.
    calibration
        How the cameras were calibrated before: it is written to run.json as one of the parameters, and runs that are
        resumed are not compared by it, because its last bits differ between machines. What it corrected is in the
        parameters' `cameras`.
    """

    output: Path
    methods: Sequence[Method]
    settings: RunSettings
    parameters: Mapping[str, Any]
    ground: Ground | GroundFinder | None = None
    overwrite: bool = False
    resume: bool = False
    forget_reviews: bool = False
    lanes: bool = False
    location: str = ""
    adjust: bool = True
    calibration: Mapping[str, Any] | None = None


def extract_to(
    order: ExtractionRequest, recordings: Recordings, work: Path, executor: Executor, steps: RunSteps
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
        if not order.overwrite and not is_result_of_run(work, order.output):
            raise OutputExistsError(
                "output exists already, and the run to resume has not made it", where=order.output,
                advice=f"choose another name or give {argument('overwrite', True)}",
            )  # fmt: skip
    if not order.forget_reviews:
        refuse_to_lose(order.output)
    calibration = {"calibration": order.calibration} if order.calibration else {}
    with run_folder(work, order.output, described, resume=order.resume) as run:
        found = find_lines_of_drives(
            recordings, order.methods, run, settings=order.settings, ground=order.ground,
            executor=executor, steps=steps, adjust=order.adjust,
        )  # fmt: skip
        found, reviews = with_log(found, recordings), None
        if not order.forget_reviews:
            found, reviews = with_kept_reviews(found, order.output)
        record = publish_extraction(
            found, order.output, {**order.parameters, **calibration, "fingerprint": fingerprint},
            overwrite=order.overwrite or order.resume,
            note=lambda sha256: run.journal.note_output(order.output.name, sha256),
            steps=steps,
            reviews=reviews,
            lanes=order.lanes,
            location=order.location,
        )  # fmt: skip
    return record, found


def with_log(found: Extraction, recordings: Recordings) -> Extraction:
    """Return an extraction with the van's log; a log that cannot be used is one of its failures."""
    log = recordings.van_log()
    if log.value is None:
        return replace(found, failures=(*found.failures, Failure("recording", log.name, str(log.error))))
    return replace(found, logged=log.value, warnings=(*found.warnings, *log.value.warnings))


def _finished(output: Path, fingerprint: str) -> dict[str, Any] | None:
    """Return the record of the output that is there, if it is what this run would make."""
    try:
        record: dict[str, Any] = read_json(record_path(output).read_text(encoding="utf-8"), output)
        is_ours = record["parameters"]["fingerprint"] == fingerprint
        is_whole = record["output"]["sha256"] == hash_file(output)
    except (OSError, ValueError, KeyError, TypeError):
        return None
    return record if is_ours and is_whole else None


# What a person asks of a survey, as an order to extract its lines


def extraction_request(
    output: Path,
    survey: Survey,
    kinds: tuple[str, ...],
    method: str,
    settings: RunSettings,
    *,
    crs: str | None = None,
    paint: str | None = None,
    methods: Sequence[Method] | None = None,
    ground: Ground | GroundFinder | None = None,
    overwrite: bool = False,
    resume: bool = False,
    lanes: bool = False,
    location: str = "",
    adjust: bool = True,
    candidates: bool = False,
    calibration: Mapping[str, Any] | None = None,
) -> ExtractionRequest:
    """Return the order to look for `kinds` by a method ("auto": what suits each kind).

    Parameters
    ----------
    survey
        As its recordings have it: its trajectory may have been located.
    crs
        As it was given, for the record.
    paint
        Column of the points with the probability of paint, instead of the intensity.
    methods
        Methods instead of those that `method` names, see `linework.methods.choose.selected_methods`.
    ground
        Own ground, or a function that returns it; None: it is found.
    lanes, location
        Also write the lanes.
    adjust
        Make several drives over one road agree first.
    candidates
        Also write the lines that were measured and not taken, in the layer `candidate`.
    calibration
        How the cameras were calibrated before, for the record.

    Raises
    ------
    UsageError
        Methods, kinds and `paint` do not agree, or own code cannot be sent to worker processes.
    """
    given = methods
    if methods is None and method in PUBLISHED_KINDS_OF:
        if paint:
            raise UsageError(
                f"{method} finds paint by its intensity", where=argument("paint"), advice="omit it"
            )
        methods = (
            published_method(
                method, kinds, radon=settings.radon_2002, obb=settings.obb_2023, stereo=settings.stereo_1992
            ),
        )
    elif methods is None:
        methods = choose_methods(
            method, kinds, radon=settings.radon, obb=settings.obb, stereo=settings.stereo, paint=paint
        )
    if candidates:
        methods = with_candidates(methods)
    check_own_code(methods, ground)
    own = own_code_of(methods, ground)
    return ExtractionRequest(
        output=output,
        methods=methods,
        settings=settings,
        ground=ground,
        parameters={
            "features": list(kinds),
            "method": method,
            "crs": crs,
            "trajectory": str(survey.trajectory_file) if survey.trajectory_file else None,
            "lever_m": list(survey.trajectory_lever_m),
            "cameras": survey.settings.get("cameras"),
            "settings": asdict(settings),
            **({"paint": paint} if paint else {}),
            **({"methods": [identity_of(chosen) for chosen in given]} if given is not None else {}),
            **({"own": own} if own else {}),
            **({"lanes": lanes, "location": location} if lanes else {}),
            **({} if adjust else {"adjust": False}),
            **({"candidates": True} if candidates else {}),
        },
        calibration=calibration,
        overwrite=overwrite,
        resume=resume,
        adjust=adjust,
        lanes=lanes,
        location=location,
    )
