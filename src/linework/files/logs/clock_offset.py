"""Detect a known offset between the clocks of points and trajectory, from their distance at equal times."""

from __future__ import annotations

import numpy as np

from linework.arrays import FloatArray
from linework.files.logs.clock import known_offsets
from linework.files.store.layout import STORE_BLOCK_M
from linework.files.store.read import PointStore
from linework.model.grid import Bounds
from linework.model.trajectory import Trajectory

#: Smallest offset that can be detected [s]: within a leap second the van moves less than scanners reach.
_LEAST_OFFSET_S = 5.0
#: Number of blocks sampled over the survey, and points per block.
_N_BLOCKS, _ENOUGH_POINTS = 8, 1000
#: Ratio and gain [m] of the median distance that rule out chance.
_NEARER = 0.5
_LEAST_GAIN_M = 20.0


def named_clock_offset(trajectory: Trajectory, store: PointStore, epoch: str) -> str:
    """Return the known clock offset that brings points and van together, as text; "" where none is needed.

    Parameters
    ----------
    epoch
        Epoch of the points' times, "" where unknown.

    Notes
    -----
    The median distance in plan between points and the van at their times is compared with that for each known
    offset: with UTC on one clock and GPS time on the other, they are hundreds of metres apart.
    """
    xy, time_s = _some_points(store)
    if not len(time_s):
        return ""
    offsets = [(0.0, ""), *((o, name) for o, name in known_offsets(float(time_s[0]), epoch)
                            if abs(o) >= _LEAST_OFFSET_S)]  # fmt: skip
    distances = [_median_distance(trajectory, xy, time_s + offset) for offset, _ in offsets]
    best = int(np.argmin(distances))
    gained = np.isfinite(distances[0]) and distances[0] - distances[best] > _LEAST_GAIN_M
    if not gained or distances[best] > _NEARER * distances[0]:
        return ""
    offset, name = offsets[best]
    return (
        f"points lie {distances[0]:.0f} m from the van at their times, with {-offset:+.0f} s on the trajectory's"
        f" times {distances[best]:.0f} m: {name}?"
    )


def _some_points(store: PointStore) -> tuple[FloatArray, FloatArray]:
    """Return (n, 2) positions in plan and (n,) times of sampled points; small blocks, because blocks are read whole."""
    blocks, counts = store.block_counts
    enough = np.flatnonzero(counts >= min(_ENOUGH_POINTS, int(np.median(counts))))
    n_small = max(_N_BLOCKS, len(enough) // 4)
    small = np.sort(enough[np.argsort(counts[enough], kind="stable")[:n_small]])
    chosen = small[np.linspace(0, len(small) - 1, min(_N_BLOCKS, len(small))).astype(int)]
    found_xy, found_s = [np.zeros((0, 2))], [np.zeros(0)]
    for east, north in (blocks[chosen] * STORE_BLOCK_M).tolist():
        bounds = Bounds(east, north, east + STORE_BLOCK_M, north + STORE_BLOCK_M)
        points = store.points(bounds, with_intensity=False, with_columns=False)
        if points.time_s is not None:
            step = 1 + len(points) // _ENOUGH_POINTS
            found_xy.append(points.xyz[::step, :2])
            found_s.append(points.time_s[::step])
    return np.concatenate(found_xy), np.concatenate(found_s)


def _median_distance(trajectory: Trajectory, xy: FloatArray, time_s: FloatArray) -> float:
    """Return the median distance [m] between points and the van at their times; infinite without common time."""
    known = trajectory.time_s
    inside = (time_s >= known[0]) & (time_s <= known[-1])
    if np.count_nonzero(inside) < len(time_s) / 2:
        return np.inf
    east, north = (np.interp(time_s[inside], known, column) for column in trajectory.xyz[:, :2].T)
    return float(np.median(np.hypot(xy[inside, 0] - east, xy[inside, 1] - north)))
