"""Lines of a survey's laser points: its surface, its tiles, the lines of all of them joined, named and ordered."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import NoReturn, TypeVar

from linework.errors import PartialError
from linework.files.output.parts import read_box_part, read_line_part, write_path_part
from linework.files.store.layout import STORE_BLOCK_M
from linework.files.store.read import PointStore
from linework.methods.protocol import BoxMethod, Method
from linework.model.boxes import BoxSet
from linework.model.lines import KINDS, LineSet
from linework.model.tile import local_origin
from linework.model.trajectory import Trajectory
from linework.processes.executors import Executor, Outcome, Serial
from linework.runs.extraction import Extraction, TileReport, identify, with_sources
from linework.runs.opened.points import OpenedSurvey, surface_of
from linework.runs.opened.sight import SurveySight
from linework.runs.opened.surface import SurveySurface
from linework.runs.resume import RunFolder
from linework.runs.seams import join_seams
from linework.runs.steps import RunSteps
from linework.runs.tasks import RunContext, TileReceipt, TileTask, process_tile, run_tasks
from linework.runs.tiles import Tile, TilingConfig, plan_tiles
from linework.surface.road import RoadConfig

ResultT = TypeVar("ResultT")


def extract_lines(
    opened: OpenedSurvey,
    methods: Sequence[Method],
    run: RunFolder,
    *,
    road: RoadConfig | None = None,
    tiling: TilingConfig | None = None,
    executor: Executor | None = None,
    steps: RunSteps | None = None,
) -> Extraction:
    """Return all lines that the methods find in a survey.

    Parameters
    ----------
    run
        Where tiles that are done are kept; what an earlier process has done there is taken over.
    road
        Settings of the surface that all methods share.
    tiling
        Settings of the plan; the lines do not depend on them.
    executor
        Works the tiles; the lines do not depend on it.
    steps
        Times and shows the steps.

    Raises
    ------
    PartialError
        Not one tile could be worked. If some could not, `tiles` tells.
    """
    steps, executor = steps or RunSteps(), executor or Serial()
    survey = opened.survey
    surface = surface_of(opened, road or RoadConfig(), executor, steps)
    tasks = _tasks(opened, methods, run, surface, tiling or TilingConfig())
    with steps.step("find lines", unit="tiles") as advance:
        done, failed = run_tasks(process_tile, tasks, TileReceipt, run, executor, advance)
    if not done:
        _raise_failure(failed[0], len(tasks), survey.name)
    problems = {outcome.task.name: outcome.problem for outcome in failed}
    with steps.step("join lines"):
        sight = SurveySight(surface)
        lines = LineSet.concatenate(
            [_lines_of(tasks, method, done, sight, opened.trajectory) for method in methods]
        )
        lines = identify(with_sources(lines, opened.facts.files, survey.name))
    return Extraction(
        source=survey.name,
        lines=lines,
        kinds=tuple(kind for kind in KINDS if any(kind in method.kinds for method in methods)),
        read=opened.facts,
        tiles=tuple(_report(task, done, problems) for task in tasks),
        failures=(*surface.failures, *sorted(problems.items())),
        traces={outcome.task.name: outcome.trace for outcome in failed if outcome.trace},
        hashes=opened.hashes,
        warnings=opened.warnings,
    )


def _plan(store: PointStore, method: Method, config: TilingConfig) -> tuple[Tile, ...]:
    """Return the tiles of a method."""
    blocks, _ = store.block_counts
    return plan_tiles(
        store.bounds, blocks, STORE_BLOCK_M, store.count_in, method.buffer_m, config,
        only_high=method.least_height_m > float("-inf"),
    )  # fmt: skip


def _tasks(
    opened: OpenedSurvey,
    methods: Sequence[Method],
    run: RunFolder,
    surface: SurveySurface,
    tiling: TilingConfig,
) -> list[TileTask]:
    """Return the tiles of all methods, those with the largest tiles first: what is left to the end is short."""
    path = None
    if opened.trajectory is not None:
        path = run.path / "trajectory.arrays"
        write_path_part(opened.trajectory, path)
    bounds = opened.points.bounds
    job = RunContext(
        opened.points.folder, surface.tiles.folder, path, run.results, opened.survey.crs,
        opened.survey.name, local_origin(bounds.west, bounds.south, surface.z0_m),
    )  # fmt: skip
    plans = [(method, _plan(opened.points, method, tiling)) for method in methods]
    plans.sort(key=lambda plan: len(plan[1]))
    return [
        TileTask(tile, method, job, is_whole=len(tiles) == 1) for method, tiles in plans for tile in tiles
    ]


def _raise_failure(first: Outcome[TileTask, TileReceipt], n_tasks: int, name: str) -> NoReturn:
    """End a run of which no tile could be worked; with the traceback, where that is our own fault."""
    if first.trace:
        fault = RuntimeError(first.problem)
        fault.add_note(first.trace)  # what the log shows
        raise fault
    raise PartialError(
        f"none of {n_tasks} tiles could be worked: {first.problem.rstrip('.')}", where=name,
        advice="mend that, and run again",
    )  # fmt: skip


def _lines_of(
    tasks: Sequence[TileTask],
    method: Method,
    done: Mapping[str, TileReceipt],
    sight: SurveySight,
    trajectory: Trajectory | None,
) -> LineSet:
    """Return the lines of a method: tracked through the boxes of all tiles, or found in tiles and joined again."""
    own = [task for task in tasks if task.method is method]
    worked = [task for task in own if task.name in done]
    job = own[0].job
    if isinstance(method, BoxMethod):
        boxes = BoxSet.concatenate(_whole(task, read_box_part, done) for task in worked)
        path = None if trajectory is None else trajectory.xyz
        return method.track(boxes, job.origin, sight, path).with_columns(crs=job.crs)
    parts = [_whole(task, read_line_part, done) for task in worked]
    lines = LineSet.concatenate(parts) if parts else LineSet.empty(job.crs)
    return join_seams(lines, [task.tile.core for task in own]) if len(own) > 1 else lines


def _whole(
    task: TileTask, read: Callable[[Path, str], ResultT | None], done: Mapping[str, TileReceipt]
) -> ResultT:
    """Return what a tile found."""
    part = read(task.result, done[task.name].sha256)
    if part is None:
        raise RuntimeError(f"{task.result}: what a tile found is not what was written")
    return part


def _report(task: TileTask, done: Mapping[str, TileReceipt], problems: Mapping[str, str]) -> TileReport:
    receipt = done.get(task.name)
    if receipt is None:
        return TileReport(task.name, task.tile, problem=problems[task.name])
    return TileReport(task.name, task.tile, receipt.n_points, receipt.n_lines)
