"""The output of a drive that is followed: lines, photolog and events so far, each time whole.

Separate from `drive`, because what is written depends only on what was kept.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from linework.arrays import FloatArray
from linework.files.live.events import Press
from linework.files.output.record import json_bytes
from linework.files.vectors.read_write import write_lines
from linework.live.kept import Kept, Placed, numbered
from linework.live.status import live_summary
from linework.methods.stereo.method import STEREO_KINDS
from linework.model.images import Poses
from linework.model.lines import LineSet
from linework.model.logs import Events, LoggedPlaces, Photos, VanLog
from linework.model.survey import Survey
from linework.navigation.poses import attitude_deg_of
from linework.runs.extraction import identify


def record_beside(output: Path) -> Path:
    """Return where the record of a drive that is followed belongs.

    >>> record_beside(Path("lines.gpkg")).name
    'lines.gpkg.live.json'
    """
    return output.with_name(f"{output.name}.live.json")


def write_drive(
    kept: Kept,
    open_lines: LineSet | None,
    presses: Sequence[Press],
    survey: Survey,
    output: Path,
    *,
    camera_m: FloatArray,
) -> None:
    """Write the current output file of a drive, and the record beside it: whole, or not at all.

    Parameters
    ----------
    open_lines
        Of the stretch that is being driven; None: that stretch is left to the next file.
    camera_m
        (3,) projection centre of the left camera. [m, vehicle]

    Raises
    ------
    MachineError
        The disk is full: the files are as before.
    """
    path = numbered(output, kept.n_files)
    parts = [lines for lines in (*kept.lines, open_lines) if lines is not None and len(lines)]
    placed = [one for one in kept.placed if open_lines is not None or one.chainage_m < kept.from_m]
    lines = LineSet.concatenate(parts) if parts else LineSet.empty()
    lines = identify(lines.with_columns(crs=survey.crs, source=np.full(len(lines), survey.name)))
    log = VanLog(
        photos=_photos(placed, camera_m), events=_events(kept, presses), root=survey.root, crs=survey.crs
    )  # fmt: skip
    record = {"command": "live", "survey": survey.name, **live_summary(kept, len(presses))}
    write_lines(
        lines, path, kinds=STEREO_KINDS, points=log, overwrite=True,
        beside={record_beside(path): lambda _: json_bytes(record)},
    )  # fmt: skip


def _photos(pairs: Sequence[Placed], camera_m: FloatArray) -> Photos:
    """Return the pairs of the current file by time, each at the projection centre of its left camera."""
    if not pairs:
        return Photos()
    order = sorted(pairs, key=lambda placed: placed.pair.time_s)
    poses = Poses.concatenate([placed.pose for placed in order])
    places = LoggedPlaces(
        time_s=poses.time_s,
        xyz=poses.xyz + poses.R_world_vehicle @ camera_m,
        heading_deg=attitude_deg_of(poses.R_world_vehicle)[:, 2],
        chainage_m=np.array([placed.chainage_m for placed in order]),
    )
    return Photos(
        places=places,
        number=np.array([placed.pair.number for placed in order], dtype=np.int64),
        left=tuple(placed.pair.left for placed in order),
        right=tuple(placed.pair.right for placed in order),
        camera=("",) * len(order),
    )


def _events(kept: Kept, presses: Sequence[Press]) -> Events:
    """Return the presses of the drive that have a place, by time."""
    placed = sorted((p for p in presses if p.press in kept.places), key=lambda press: press.time_s)
    if not placed:
        return Events()
    rows = np.array([kept.places[press.press] for press in placed], dtype=np.float64)
    places = LoggedPlaces(
        time_s=np.array([press.time_s for press in placed]), xyz=rows[:, :3], heading_deg=rows[:, 3],
        chainage_m=rows[:, 4],
    )  # fmt: skip
    return Events(
        places=places, key=tuple(p.key for p in placed), note=tuple(p.note for p in placed),
        span=tuple(p.span for p in placed),
    )  # fmt: skip
