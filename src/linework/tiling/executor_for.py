"""What works the tiles of a survey on this machine."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from linework.model.survey import Survey
    from linework.tiling.executors import Executor
    from linework.tiling.settings import RunSettings


def usable_cores() -> int:
    """Return the cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@contextlib.contextmanager
def executor_for(survey: Survey, n_workers: int, settings: RunSettings) -> Iterator[Executor]:
    """Give what works the tiles: processes, started now, where there will be several tiles and workers."""
    from linework.tiling.executors import Serial
    from linework.tiling.processes import Processes
    from linework.tiling.stores import promised_points

    # Images are many small windows of work: they are worth workers as soon as there are any
    is_small = promised_points(survey) <= settings.tiling.max_points and not survey.settings.get("cameras")
    if n_workers == 1 or is_small:
        yield Serial()
        return
    with Processes(
        n_workers, modules=("linework.tiling.tile_task", "linework.tiling.window_task")
    ) as processes:
        yield processes
