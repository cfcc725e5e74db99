"""Lines of a survey's stereo pairs: pairs in time windows, lines over all of them."""

from __future__ import annotations

import numpy as np

from linework.files.output.parts import read_sighting_part
from linework.methods.stereo.method import StereoMethod
from linework.model.lines import LineSet
from linework.model.sightings import Sightings
from linework.processes.executors import Executor
from linework.runs.extraction import PairAccount
from linework.runs.opened.pairs import OpenedStereo
from linework.runs.resume import RunFolder
from linework.runs.steps import RunSteps
from linework.runs.tasks import WindowReceipt, WindowTask, process_window, run_tasks, windows_of


def stereo_lines(
    opened: OpenedStereo, method: StereoMethod, run: RunFolder, executor: Executor, steps: RunSteps
) -> tuple[LineSet, PairAccount]:
    """Return the lines that the stereo pairs of a survey show, and the account of the pairs.

    Notes
    -----
    What a pair shows depends on that pair alone; windows are units of work only. Lines are joined once over all.
    """
    tasks = windows_of(opened.pairs, opened.series.rig, method, run.results)
    with steps.step("look at stereo pairs", unit="windows") as advance:
        done, failed = run_tasks(process_window, tasks, _receipt, run, executor, advance)
    with steps.step("join stereo lines"):
        seen = Sightings.concatenate(_whole(task, done[task.name]) for task in tasks if task.name in done)
        lines = method.join(seen, opened.poses, opened.rectifier.rig, opened.numbers)
        lines = _with_sources(lines.with_columns(crs=opened.survey.crs), opened)
    failures = [*opened.failures, *(failure for receipt in done.values() for failure in receipt.failures)]
    for outcome in failed:
        failures += [(str(pair.left), f"{pair.left.name}: {outcome.problem}") for pair in outcome.task.pairs]
    n_used = sum(receipt.n_pairs for receipt in done.values())
    traces = {outcome.task.name: outcome.trace for outcome in failed if outcome.trace}
    series = opened.series
    n_pairs = len(series.pairs) + len(series.unpaired) + len(series.left_out)
    account = PairAccount(n_pairs=n_pairs, n_used=n_used, failures=tuple(sorted(failures)), traces=traces)
    return lines, account


def _receipt(failures: list[list[str]], **columns: object) -> WindowReceipt:
    """Return a receipt from the journal, where tuples are lists."""
    return WindowReceipt(**columns, failures=tuple((left, problem) for left, problem in failures))  # type: ignore[arg-type]


def _whole(task: WindowTask, receipt: WindowReceipt) -> Sightings:
    part = read_sighting_part(task.result, receipt.sha256)
    if part is None:
        raise RuntimeError(f"{task.result}: what a window showed is not what was written")
    return part


def _with_sources(lines: LineSet, opened: OpenedStereo) -> LineSet:
    """Return the lines with the images that show them: the first and the last by time."""
    times = np.array([pair.time_s for pair in opened.pairs])
    sources = []
    for start, end in zip(lines.time_start_s.tolist(), lines.time_end_s.tolist(), strict=True):
        if not (np.isfinite(start) and np.isfinite(end)):
            sources.append(opened.survey.name)
            continue
        first, last = (opened.pairs[int(np.argmin(np.abs(times - t)))].left.name for t in (start, end))
        sources.append(first if first == last else f"{first} to {last}")
    return lines.with_columns(source=np.array(sources, dtype=np.str_)) if len(lines) else lines
