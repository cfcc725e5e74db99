"""Photo log of a survey: its images and the operator's keys, placed on the trajectory."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from linework.arrays import BoolArray, FloatArray
from linework.files.logs.keys import events_file, read_events
from linework.model.images import SingleCamera, StereoSeries
from linework.model.logs import Events, LoggedPlaces, Photos, VanLog
from linework.model.survey import Survey
from linework.model.trajectory import Trajectory
from linework.navigation.chainage import is_placed, places_at


def van_log(
    survey: Survey,
    series: StereoSeries | None,
    trajectory: Trajectory | None,
    single: Sequence[SingleCamera] = (),
) -> VanLog:
    """Place the images and the keys of a survey.

    Parameters
    ----------
    series
        Its stereo pairs (`open_stereo`), or None.
    trajectory
        Trajectory of the vehicle's origin; without it nothing can be placed.
    single
        Its cameras without a partner (`open_single_cameras`).

    Returns
    -------
    VanLog
        Images and keys outside the trajectory's time, or in a gap of it, are left out and counted.

    Raises
    ------
    InputError
        The file of events cannot be used.
    """
    pressed = events_file(survey)
    events, warnings = None, []
    taken: list[Photos] = []
    if series is not None:
        time_s = np.array([pair.time_s for pair in series.pairs], dtype=np.float64)
        chosen, remarks = _placed(trajectory, time_s, "images")
        warnings += remarks
        pairs = [series.pairs[i] for i in np.flatnonzero(chosen)]
        taken.append(Photos())
        if trajectory is not None and pairs:
            taken[-1] = Photos(
                places=places_at(trajectory, time_s[chosen], series.rig.left.position_m),
                number=np.array([pair.number for pair in pairs], dtype=np.int64),
                left=tuple(pair.left for pair in pairs),
                right=tuple(pair.right for pair in pairs),
                camera=("",) * len(pairs),
            )
    for camera in single:
        chosen, remarks = _placed(trajectory, camera.time_s, f"images of cameras.{camera.name}")
        warnings += remarks
        kept = np.flatnonzero(chosen).tolist()
        taken.append(Photos())
        if trajectory is not None and kept:
            taken[-1] = Photos(
                places=places_at(trajectory, camera.time_s[chosen], camera.position_m),
                number=np.array(kept, dtype=np.int64),
                left=tuple(camera.files[i] for i in kept),
                right=(None,) * len(kept),
                camera=(camera.name,) * len(kept),
            )
    if pressed is not None:
        rows = read_events(pressed)
        chosen, remarks = _placed(trajectory, rows.time_s, "events")
        warnings += [*rows.warnings, *remarks]
        events = Events()
        if trajectory is not None and chosen.any():
            kept = np.flatnonzero(chosen).tolist()
            events = Events(
                places=places_at(trajectory, rows.time_s[chosen]),
                key=tuple(rows.key[i] for i in kept),
                note=tuple(rows.note[i] for i in kept),
                span=tuple(rows.span[i] for i in kept),
            )
    photos = _in_time_order(taken) if taken else None
    return VanLog(photos=photos, events=events, root=survey.root, crs=survey.crs, warnings=tuple(warnings))


def _in_time_order(taken: Sequence[Photos]) -> Photos:
    """Return the images of several cameras as one log; of equal times in the order of the cameras."""
    if len(taken) == 1:
        return taken[0]
    places = LoggedPlaces.concatenate([photos.places for photos in taken])
    order = np.argsort(places.time_s, kind="stable")

    def joined(name: str) -> tuple[Any, ...]:
        values = [value for photos in taken for value in getattr(photos, name)]
        return tuple(values[i] for i in order.tolist())

    return Photos(
        places=places.take(order),
        number=np.concatenate([photos.number for photos in taken])[order],
        left=joined("left"),
        right=joined("right"),
        camera=joined("camera"),
    )


def _placed(trajectory: Trajectory | None, time_s: FloatArray, what: str) -> tuple[BoolArray, list[str]]:
    """Return (n,) bool: which moments can be placed, and warnings about the others."""
    if trajectory is None or len(trajectory) == 0:
        remarks = [f"{len(time_s)} {what} cannot be placed: there is no trajectory"] if len(time_s) else []
        return np.zeros(len(time_s), dtype=bool), remarks
    chosen = is_placed(trajectory, time_s)
    if chosen.all():
        return chosen, []
    first, last = trajectory.time_s[[0, -1]]
    return chosen, [
        f"{np.count_nonzero(~chosen)} of {len(time_s)} {what} cannot be placed, the first at "
        f"{time_s[~chosen][0]:.3f} s (the trajectory runs from {first:.3f} to {last:.3f} s, or has a gap there)"
    ]
