"""Result of the readers of trajectories: in time order, each time once."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from linework.arrays import FloatArray
from linework.errors import InputError
from linework.files.logs.clock import in_time_order
from linework.model.trajectory import Trajectory


@dataclass(frozen=True, slots=True)
class TrajectoryContent:
    """A trajectory as read, and warnings about the file.

    Parameters
    ----------
    warnings
        One line each.
    epoch
        Epoch of the times as the file states it: "gps", "gps_week", "unix", "utc_day"; "" where it does not.
    """

    trajectory: Trajectory
    warnings: tuple[str, ...] = ()
    epoch: str = ""


def ordered_content(
    path: Path,
    time_s: FloatArray,
    line_numbers: FloatArray,
    columns: dict[str, FloatArray | None],
    *,
    warnings: tuple[str, ...] = (),
    epoch: str = "",
    unit: str = "line",
) -> TrajectoryContent:
    """Return a trajectory in time order, each time once.

    Parameters
    ----------
    columns
        (n, 3) of `Trajectory` by name.
    unit
        What `line_numbers` count.

    Raises
    ------
    InputError
        Fewer than two positions.
    """
    kept, remarks = in_time_order(time_s, line_numbers, unit=unit)
    if len(kept) < 2:
        raise InputError(
            f"{len(kept)} position, a trajectory needs at least 2", where=path, advice="check the file"
        )
    ordered = {name: np.asarray(values)[kept] for name, values in columns.items() if values is not None}
    return TrajectoryContent(Trajectory(time_s[kept], **ordered), (*warnings, *remarks), epoch)
