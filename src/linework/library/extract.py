"""The whole job in one call: files or arrays in, lines out."""

from __future__ import annotations

import contextlib
from collections.abc import Iterable, Sequence
from dataclasses import asdict, replace
from numbers import Integral
from pathlib import Path
from typing import Any

from linework.errors import UsageError, argument
from linework.library.opened import (
    GivenSettings,
    GivenSource,
    GivenTrajectory,
    opened_source,
    settings_given,
    temporary_work,
)
from linework.library.progress import Progress, display_of
from linework.library.report import OnProblem, check_on_problem, lose_nothing, report_of
from linework.methods.choose import selected_methods, with_candidates
from linework.methods.kinds import PUBLISHED_KINDS_OF, check_method, parse_kinds
from linework.methods.obb.method import Obb
from linework.methods.protocol import Method
from linework.methods.radon.method import Radon
from linework.methods.stereo.method import Stereo
from linework.model.ground import Ground
from linework.model.lines import LineSet
from linework.model.points import Points
from linework.model.survey import Survey
from linework.processes.identity import identity_of
from linework.processes.system import usable_cores
from linework.published.methods import Obb2023, Radon2002, Stereo1992, published_method
from linework.runs.compile import compiled_for
from linework.runs.drives.adjusted import find_lines_of_drives
from linework.runs.extract import with_log
from linework.runs.opened.cluster import cluster_executor
from linework.runs.opened.recordings import Recordings
from linework.runs.opened.store import executor_for
from linework.runs.own import GroundFinder, check_own_code, own_code_of
from linework.runs.resume import describe_run, fingerprint_of, run_folder
from linework.runs.settings import RunSettings
from linework.runs.steps import RunSteps

#: Most worker processes that can be asked for.
MOST_WORKERS = 256
#: Names of linework's methods, or methods with own functions and settings.
GivenMethods = str | Method | Sequence[str | Method] | None
#: Methods that have a table of their own in the settings of a run, by its name.
_SETTINGS: dict[str, type[Any]] = {
    "obb": Obb, "radon": Radon, "stereo": Stereo, "radon_2002": Radon2002, "obb_2023": Obb2023,
    "stereo_1992": Stereo1992,
}  # fmt: skip


def extract(
    src: GivenSource,
    *,
    kinds: str | Sequence[str] | None = None,
    crs: Any = None,
    trajectory: GivenTrajectory = None,
    methods: GivenMethods = None,
    ground: Ground | GroundFinder | None = None,
    carry: str | Sequence[str] = (),
    allow_outside: bool = False,
    allow_remote: bool = False,
    settings: GivenSettings = None,
    workers: int | None = None,
    scheduler: Any = None,
    work: str | Path | None = None,
    resume: bool = False,
    adjust: bool = True,
    candidates: bool = False,
    progress: Progress = None,
    on_problem: OnProblem = "raise",
) -> LineSet:
    """Return the lines of a survey.

    Parameters
    ----------
    src
        A LAS or LAZ file, a folder of them, a pattern such as ``"points/*.laz"``, several of these, a survey folder
        with a survey.toml, a KITTI drive, an opened `Survey`, or `Points` in memory.
    kinds
        Kind or kinds of line to look for; None: all.
    crs
        CRS where the files do not state it: "EPSG:25832+7837", 25832, a `pyproj.CRS`, WKT, or "local" for
        coordinates in metres that are not georeferenced.
    trajectory
        File, or `Trajectory`, of the vehicle's origin; None: that of the survey, if it has one.
    methods
        Names of methods ("obb", "radon", "stereo") or methods with functions or settings of your own; None: all that
        find the kinds.
    ground
        A `Ground`, or a function that takes (points, trajectory) and returns one; None: `find_ground`.
    carry
        Extra dimensions of the LAS files that methods use, by name.
    allow_outside
        Whether a survey.toml may name files outside its folder: absolute paths, ``..``, links that end elsewhere.
    allow_remote
        Whether a survey.toml may name points at addresses (https://, s3://); one that is given here is called anyway.
    settings
        Settings, a run file, or its tables as a mapping.
    workers
        Number of processes; the lines do not depend on it. None: as many as there are cores.
    scheduler
        A Dask cluster whose workers process the tiles: the address of its scheduler (``"tcp://HOST:PORT"``), a
        `distributed.Client`, or "local" for one on this machine. None: processes of this machine. `work` must then be a
        folder that all machines of the cluster share.
    work
        Folder where the decoded points and unfinished runs stay for the next call, until ``linework clean`` removes
        them; None: they are kept among the temporary files, for this call only.
    resume
        Go on with a call with the same arguments that was killed; needs `work`.
    adjust
        Make several drives over one road agree at their lines, and turns of a spinning lidar on the ground, before lines
        are extracted from all points. False: leave them as they were recorded.
    candidates
        Also return the lines that obb measured and did not take, of the kind "candidate", with the kind that each would
        be (`candidate_kind`) and the `reason`. The other lines are the same with and without.
    progress
        True: show progress on stderr. A function is called with (stage, done, total).
    on_problem
        What to do when files, tiles or images had to be left out: "raise" an error that holds the lines as
        ``error.lines``, or "warn" and return them.

    Returns
    -------
    LineSet
        In their fixed order, each with its name. ``lines.report`` tells what was read, what was left out and why.

    Raises
    ------
    LineworkError
        One line: which file or argument, what is wrong, what to do.

    Warns
    -----
    LineworkWarning
        Each warning of ``lines.report.warnings``.

    Examples
    --------
    >>> import linework
    >>> linework.extract("no-such-file.laz")
    Traceback (most recent call last):
    linework.errors.InputError: no-such-file.laz: cannot be opened: No such file or directory. Check the name.
    """
    check_on_problem(on_problem)
    n_workers = _number_of_workers(workers)
    if resume and work is None:
        raise UsageError(
            "needs the folder of the run", where=argument("resume"), advice=f"give {argument('work')} too"
        )
    chosen = settings_given(settings)
    asked = methods_asked(methods, kinds, chosen)
    if candidates:
        asked = with_candidates(asked)
    check_own_code(asked, ground)
    looked_at = {method.recording for method in asked}
    # Points in memory and opened surveys bring their columns; of files, those are read that methods need
    brings = isinstance(src, Points | Survey)
    needed = [] if brings else [name for method in asked for name in method.carry]
    carried = tuple(dict.fromkeys([*([carry] if isinstance(carry, str) else carry), *needed]))
    with contextlib.ExitStack() as held:
        steps = RunSteps(held.enter_context(display_of(progress)))
        folder = held.enter_context(temporary_work(work))
        cluster = None
        if scheduler is not None:
            cluster = held.enter_context(cluster_executor(scheduler, workers, folder))
        recordings = held.enter_context(
            opened_source(
                src, folder, crs=crs, trajectory=trajectory, carry=carried, allow_outside=allow_outside, allow_remote=allow_remote,
                laser="points" in looked_at, images="pairs" in looked_at,
                kinds=[kind for method in asked for kind in method.kinds], steps=steps,
            )
        )  # fmt: skip
        _check_recorded(recordings, asked, kinds)
        has_pairs = recordings.stereo is not None
        own = own_code_of(asked, ground)
        described = describe_run(
            {
                "methods": [identity_of(method) for method in asked],
                "settings": asdict(chosen),
                "own": own,
                "recorded": recordings.identity,
                **({} if adjust else {"adjust": False}),
            },
            recordings.hashes,
        )
        # Named by all that is asked for: another call with the same work folder neither finds it nor waits for it
        output = folder / f"lines-{fingerprint_of(described)[:16]}"
        run = held.enter_context(run_folder(folder, output, described, resume=resume))
        executor = cluster or held.enter_context(
            executor_for(
                _n_points(recordings),
                n_workers,
                chosen,
                has_images=has_pairs,
                has_own_code=bool(own),
                names=compiled_for(
                    recordings.survey,
                    [kind for method in asked for kind in method.kinds],
                    images=has_pairs,
                    in_memory=recordings.points is not None,
                ),
            )
        )
        found = find_lines_of_drives(
            recordings,
            asked,
            run,
            settings=chosen,
            ground=ground,
            executor=executor,
            steps=steps,
            adjust=adjust,
        )
        found = with_log(found, recordings)
        warnings = (*found.warnings, *_without_intensity(recordings, asked))
    report = report_of(replace(found, warnings=warnings), steps.timings_s)
    return lose_nothing(found.lines, report, on_problem)


def methods_asked(
    methods: GivenMethods, kinds: str | Sequence[str] | None, settings: RunSettings
) -> tuple[Method, ...]:
    """Return the methods that look for kinds of line.

    Raises
    ------
    UsageError
        An unknown method or kind, or a kind that none of the methods finds.
    """
    given = [methods] if isinstance(methods, str | Method) else methods
    if given is None:
        given = ["obb", "radon", "stereo"]
    if not isinstance(given, Iterable):
        raise UsageError(
            f"{given!r:.60} is not a method",
            where=argument("methods"),
            advice="give names, or objects such as Radon()",
        )
    given = list(given)
    own = [method for method in given if not isinstance(method, str)]
    for method in given:
        if isinstance(method, str):
            check_method(method, ())
    of_own = [kind for method in own if isinstance(method, Method) for kind in method.kinds]
    wanted = None if kinds is None else parse_kinds(kinds, own=of_own)
    ours: dict[str, Method] = {
        "obb": Obb(settings.obb),
        "radon": Radon(settings.radon),
        "stereo": Stereo(settings.stereo),
    }
    published = {
        name: published_method(
            name, kinds_of, radon=settings.radon_2002, obb=settings.obb_2023, stereo=settings.stereo_1992
        )
        for name, kinds_of in PUBLISHED_KINDS_OF.items()
    }
    named: list[Method] = []
    for method in given:
        if isinstance(method, str):
            named += ours.values() if method == "auto" else [(ours | published)[method]]
        else:
            named.append(_with_settings(method, settings))
    return selected_methods(named, wanted)


def _with_settings(method: Method, settings: RunSettings) -> Method:
    """Return a method with the settings of the run, unless it has settings of its own.

    Raises
    ------
    UsageError
        It has settings of its own, and the run has others for it.
    """
    given: Any = next(
        (getattr(settings, name) for name, own in _SETTINGS.items() if isinstance(method, own)), None
    )
    if given is None:
        return method
    config = method.config  # type: ignore[attr-defined]
    if not isinstance(config, type(given)):
        raise UsageError(
            f"settings of {method.name} are {config!r:.60}", where=argument("methods"),
            advice=f"write config={type(given).__name__}(...)",
        )  # fmt: skip
    if given in (config, type(given)()):
        return method
    if config != type(given)():
        raise UsageError(
            f"{method.name} is given with settings of its own", where=argument("settings"),
            advice="leave one of the two out",
        )  # fmt: skip
    return replace(method, config=given)  # type: ignore[type-var]


def _number_of_workers(workers: int | None) -> int:
    """Return the number of worker processes.

    Raises
    ------
    UsageError
        Not a whole number from 1 to `MOST_WORKERS`.
    """
    if workers is None:
        return usable_cores()
    if isinstance(workers, bool) or not isinstance(workers, Integral) or not 1 <= workers <= MOST_WORKERS:
        raise UsageError(
            f"{workers!r} is not a whole number from 1 to {MOST_WORKERS}", where=argument("workers")
        )
    return int(workers)


def _check_recorded(
    recordings: Recordings, methods: Sequence[Method], kinds: str | Sequence[str] | None
) -> None:
    """Refuse kinds that were named and that nothing in the survey can show, and methods that can look at nothing."""
    there = {"points": recordings.points is not None, "pairs": recordings.stereo is not None}
    if not any(there[method.recording] for method in methods):
        what = "laser points" if recordings.points is None else "stereo pairs"
        raise UsageError(
            f"look at {what} only, and there are none", where=argument("methods"), advice="leave it out"
        )
    shown = {kind for method in methods if there[method.recording] for kind in method.kinds}
    missing = [] if kinds is None else [
        kind for method in methods for kind in method.kinds if kind not in shown
    ]  # fmt: skip
    if missing:
        what = "laser points" if recordings.points is None else "stereo pairs"
        raise UsageError(
            f"{', '.join(dict.fromkeys(missing))}: only {what} show them, and the survey has none",
            where=argument("kinds"),
            advice=f"ask for {', '.join(sorted(shown))}" if shown else "",
        )


def _without_intensity(recordings: Recordings, methods: Sequence[Method]) -> tuple[str, ...]:
    """Return a warning if paint is looked for in points in memory that came without intensity; files say so anyway."""
    points = recordings.points
    seekers = [method for method in methods if isinstance(method, Obb) and method.seeks_paint]
    is_dark = points is not None and not points.facts.has_intensity and not points.facts.warnings
    if not is_dark or not seekers or all(method.paint is not None for method in seekers):
        return ()
    return ("the points have no intensity: markings cannot be found. Give it to Points.",)


def _n_points(recordings: Recordings) -> int:
    return recordings.points.facts.n_points if recordings.points is not None else 0
