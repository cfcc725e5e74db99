"""What the fields of points say of their scanner: device, beam, angle and time, where they say anything."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from linework.arrays import AnyArray, BoolArray, FloatArray, Int32Array
from linework.errors import UsageError
from linework.model.points import Points

#: Later times are damaged, and too coarse for turns of a mirror: steps of 15 us in float64. [s]
_LATEST_S = 1e11
#: Columns of the source (flight strip, drive) and of the head of a scanner.
SOURCE, HEAD = "point_source_id", "scanner_channel"
#: Field of LAS files without a meaning by the standard; names under which files have the laser of a spinning scanner.
USER_DATA = "user_data"
BEAM_COLUMNS = ("ring", "laser_id", "laser_number", "laser", "beam", "ring_id", "channel")
#: Fewest and most lasers of a spinning scanner; fields with other numbers of values are something else.
_BEAMS = (4, 512)
#: Most that points of one laser are apart, over the distance of successive points: 1 at random, 0.01 of a real lidar, 0.6 of
#: a simulated one that was thinned tenfold.
_RING_STEP = 0.8
#: Points of one time: several returns, and heads or lasers that fire together, at most 128 times 4. More is the time of a
#: whole scan, which orders nothing within it.
_MOST_AT_ONCE = 512


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ScanFields:
    """Fields of points that have to do with their scanner; None: absent, or the same for all points.

    Parameters
    ----------
    time_s
        (n,) float64 [s].
    orders
        Whether times order the points within a scan.
    source, head, beam
        (n,) int32: source id, channel of the scanner, and laser.
    beam_field
        The column that gave the lasers, "" for none.
    angle_deg
        (n,) float64 [deg]: scan angle.
    flag
        (n,) int32: direction of the scan.
    is_edge
        (n,) bool: last point of a line.
    """

    time_s: FloatArray | None
    orders: bool
    source: Int32Array | None
    head: Int32Array | None
    beam: Int32Array | None
    beam_field: str
    angle_deg: FloatArray | None
    flag: Int32Array | None
    is_edge: BoolArray | None

    @property
    def used(self) -> tuple[str, ...]:
        """The columns that tell devices and lasers apart."""
        found = (SOURCE, self.source), (HEAD, self.head), (self.beam_field, self.beam)
        return tuple(name for name, values in found if values is not None)


def fields_of(points: Points, used: tuple[str, ...] | None = None) -> ScanFields:
    """Return the scanner's fields of points: those that tell points apart.

    Parameters
    ----------
    points
        In any order.
    used
        The columns that tell devices and lasers apart in the whole survey, of which these points are a part: they are
        taken though they may be the same for all of the part. None: found from the points.
    """
    time = points.time_s
    if time is not None and (len(time) == 0 or not np.abs(time).max() < _LATEST_S):
        time = None
    if used is None and time is not None and time.min() == time.max():
        time = None
    if used is None:
        beam, name = _beams(points)
    else:
        name = next((name for name in used if name not in (SOURCE, HEAD)), "")
        beam = _column(points, name, used) if name else None
    angle, edge = _varying(points, "scan_angle"), _whole(points, "edge_of_flight_line")
    return ScanFields(
        time_s=time,
        orders=time is not None and (used is not None or _orders(time)),
        source=_column(points, SOURCE, used),
        head=_column(points, HEAD, used) if name != HEAD else None,
        beam=beam,
        beam_field=name,
        angle_deg=None if angle is None else angle.astype(np.float64),
        flag=_whole(points, "scan_direction_flag"),
        is_edge=None if edge is None else edge > 0,
    )


def laser_column(points: Points) -> str:
    """Return the name of the column that has the laser of each point of a spinning scanner, "" for none.

    It is one of `BEAM_COLUMNS`, or the user data of LAS files where that is what it holds.

    >>> laser, turn = np.arange(80) % 16, np.arange(80) // 16
    >>> turning = Points(np.stack([laser, 0.1 * turn, 0.0 * turn], axis=1), time_s=np.arange(80.0), user_data=laser)
    >>> laser_column(turning)
    'user_data'
    """
    return _beams(points)[1] if len(points) else ""


def _column(points: Points, name: str, used: tuple[str, ...] | None) -> Int32Array | None:
    """Return a column of whole numbers: one that is used in the whole survey, or else one that varies here."""
    if used is None:
        return _whole(points, name)
    if name not in used:
        return None
    if name not in points.columns:
        raise UsageError(
            f"points have no column {name!r}, which tells lasers and heads apart in the whole survey",
            where="points",
            advice="read it with the points (carry)",
        )
    return points.columns[name].astype(np.int32)


def _varying(points: Points, name: str) -> AnyArray | None:
    values = points.columns.get(name)
    if values is None or len(values) == 0 or not values.min() < values.max() or not np.isfinite(values).all():
        return None
    return values


def _whole(points: Points, name: str) -> Int32Array | None:
    values = _varying(points, name)
    # Of 16 bits in every file: other numbers are of something else
    if values is None or values.min() < 0 or values.max() >= 65536:
        return None
    return values.astype(np.int32)


def _orders(time_s: FloatArray) -> bool:
    """Return whether times order points: no time is shared by more points than fire at once."""
    ordered = time_s if np.all(time_s[1:] >= time_s[:-1]) else np.sort(time_s)
    n_times = 1 + np.count_nonzero(np.diff(ordered))
    return bool(len(time_s) / n_times <= _MOST_AT_ONCE)


def _beams(points: Points) -> tuple[Int32Array | None, str]:
    """Return the laser of each point and the column that has it.

    The user data of LAS files holds it too, by no standard: it is taken where it has as many values as lasers, and
    successive points of one value are nearer to each other than successive points, as those of a laser are.
    """
    for name in (*BEAM_COLUMNS, USER_DATA):
        values = _whole(points, name)
        if values is None:
            continue
        n_values = np.count_nonzero(np.bincount(values))
        if not _BEAMS[0] <= n_values <= _BEAMS[1]:
            continue
        if name == USER_DATA:
            if points.time_s is None or n_values < 8:
                continue
            order = np.argsort(points.time_s, kind="stable")
            if not _draws_rings(values[order], points.xyz[order]):
                continue
        return values, name
    return None, ""


def _draws_rings(value: Int32Array, xyz: FloatArray) -> bool:
    """Return whether points (n, 3) by time, of one value (n,) each, follow each other more closely than all do."""
    changes = value[1:] != value[:-1]
    if np.mean(changes) < 0.5:
        return False
    own = np.argsort(value, kind="stable")
    same = value[own][1:] == value[own][:-1]
    if not same.any():
        return False
    along = np.linalg.norm(np.diff(xyz[own], axis=0)[same], axis=1)
    across = np.linalg.norm(np.diff(xyz, axis=0)[changes], axis=1)
    # At random they are alike; of a lidar the next laser is degrees away, the next pulse of the same one a part of that
    return bool(np.median(along) < _RING_STEP * np.median(across))
