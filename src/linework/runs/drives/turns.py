"""Turns of a spinning lidar whose heights disagree: found in the tile store, and levelled before anything is looked for.

Separate from `adjusted`, which makes whole drives agree at their lines: turns agree on the ground, before there are lines.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, replace

import numpy as np

from linework.arrays import AnyArray, FloatArray, IntArray, ranks_of
from linework.files.store.layout import STORE_BLOCK_M
from linework.files.store.read import PointStore
from linework.model.grid import Bounds
from linework.model.lines import LineSet
from linework.model.points import Points
from linework.runs.drives.account import TurnsAccount
from linework.runs.drives.stores import changed_points, small_areas
from linework.runs.opened.recordings import Recordings
from linework.runs.resume import RunFolder
from linework.runs.steps import Advance, RunSteps
from linework.scanlines.passing import is_passing
from linework.scanlines.sampled import pieces_to_sample
from linework.scanlines.turn_heights import LEAST_TURNS, TURN_CELL_M, TurnCells, TurnPlanes, turn_planes

#: Points of one time are those of one turn where times are this far apart: scanners turn 1 to 50 times a second. Stations
#: of a terrestrial scanner, each with one time, are minutes apart: they are no turns. [s]
_TURN_TIMES_S, _LONGEST_TURN_S = 0.02, 1.0
#: Else a turn is what was seen within: lidars turn 5 to 20 times a second. [s]
_TURN_S = 0.1
#: More turns than this are taken together: their number bounds the memory of the adjustment, not that of points.
#: Of a scanner at rest, all turns see the same cells, and the equations are dense.
_MOST_TURNS = 1500
#: Turns farther apart than this are not taken together: the scanner was off, or elsewhere. [s]
_PAUSE_S = 2.0
#: Means of a turn in a cell that are compared: cells are left out where there would be more.
_MOST_CELLS = 1_000_000
#: Side of the patches whose lowest tenth is taken for ground, in cells; higher above it than any kerb is no ground. [m]
_PATCH_CELLS, _ABOVE_GROUND_M = 4, 0.25
#: Fewest points of a turn in a cell.
_LEAST_POINTS = 3


@dataclass(frozen=True, slots=True, eq=False)
class TurnLevels:
    """What each turn of a survey is too high.

    Parameters
    ----------
    number
        (t,) ascending: times divided by `length_s`, rounded down, of each turn.
    origin
        (2,) of the places in `planes`. [m, world]
    """

    length_s: float
    number: IntArray
    origin: FloatArray
    planes: TurnPlanes

    def too_high_m(self, time_s: FloatArray, xyz: FloatArray) -> FloatArray:
        """Return by how much points (n, 3) [m, world] of times (n,) are too high, (n,) [m]."""
        # Points are many, turns are few
        of_points, number = ranks_of(np.floor(time_s / self.length_s).astype(np.int64))
        turn = _nearest(self.number, of_points)[number]
        return self.planes.at(turn, xyz[:, :2] - self.origin)

    def levelled(self, points: Points) -> Points:
        """Return points at the heights at which turns agree, without those of what passed meanwhile.

        Parameters
        ----------
        points
            All of an area whose edges are whole multiples of `TURN_CELL_M`.
        """
        assert points.time_s is not None
        xyz = points.xyz.copy()
        xyz[:, 2] -= self.too_high_m(points.time_s, xyz)
        cell = _joint(_places(xyz, self.origin))
        stays = ~is_passing(xyz[:, 2], cell, np.floor(points.time_s / self.length_s).astype(np.int64))
        level = Points(
            xyz, intensity=points.intensity, time_s=points.time_s, crs=points.crs, columns=points.columns
        )
        return level.take(stays)


def level_turns(
    recordings: Recordings, run: RunFolder, steps: RunSteps
) -> tuple[Recordings, TurnsAccount | None]:
    """Return recordings whose turns of a spinning lidar agree in height, and how; as they are where they do already.

    Raises
    ------
    MachineError
        The store cannot be read, or its copy cannot be written.

    Notes
    -----
    Turns are levelled where they disagree by more than the noise with which they measure: all together then hide what each
    of them shows. Path and images stay, for beams that are off in elevation tilt turns as a wrong path does. What passed
    while the scanner looked is left out. The levelled points lie in a tile store of this run.
    """
    opened = recordings.points
    if opened is None or not opened.points.has_time:
        return recordings, None
    with steps.step("compare turns", unit="points") as advance:
        levels = turn_levels(opened.points, advance)
    if levels is None:
        return recordings, None
    planes = levels.planes
    what = f"turns {hashlib.sha256(planes.plane.tobytes()).hexdigest()}"
    points = changed_points(opened, run.path / "levelled", levels.levelled, what, steps, "level turns")
    assert points is not None
    points = replace(points, facts=replace(opened.facts, bounds=points.facts.bounds))
    n_passing = opened.points.n_points - points.points.n_points
    account = TurnsAccount(
        len(levels.number), planes.apart_m, planes.left_apart_m, planes.common_sigma_m, n_passing
    )
    return replace(recordings, points=points), account


def with_turns_sigma(lines: LineSet, account: TurnsAccount) -> LineSet:
    """Return lines with sigmas in height that hold what turns cannot tell: how high all of them together are."""
    return (
        lines.with_columns(sigma_z_m=np.hypot(lines.sigma_z_m, account.common_sigma_m))
        if len(lines)
        else lines
    )


def turn_levels(store: PointStore, advance: Advance) -> TurnLevels | None:
    """Return what the turns of a survey are too high; None where they agree, or no two of them measure one place.

    Parameters
    ----------
    store
        With times.
    advance
        Is told how many points were looked at.
    """
    blocks, counts = store.block_counts
    pieces = [_of(store, piece) for piece in pieces_to_sample(blocks, counts)] if len(blocks) else []
    pieces = [points for points in pieces if len(points)]
    length_s = _turn_length_s(pieces)
    if not length_s:
        return None
    origin = blocks[0] * STORE_BLOCK_M
    found = [_cells_of(points, origin, length_s, 1.0) for points in pieces]
    n_sampled, cells = sum(map(len, pieces)), sum(len(of) for of in found)
    if not any(
        len(of) and np.median(np.unique(of.cell, return_counts=True)[1]) >= LEAST_TURNS for of in found
    ):
        return None
    # Turns that agree in pieces of a survey agree: most surveys need no more than those
    if not any(_disagree(turn_planes(_numbered(of, length_s)[1])) for of in found):
        return None
    share = min(1.0, _MOST_CELLS / (cells / n_sampled * store.n_points))
    parts, done = [], 0
    for area in small_areas(store):
        points = _of(store, area)
        parts.append(_cells_of(points, origin, length_s, share))
        done += len(points)
        advance(done, store.n_points)
    number, numbered, each = _numbered(TurnCells.concatenate(parts), length_s)
    planes = turn_planes(numbered)
    if planes is None or not _disagree(planes):
        return None
    planes = replace(
        planes, centre=planes.centre[each], reach_m=planes.reach_m[each], plane=planes.plane[each]
    )
    return TurnLevels(length_s, number, np.asarray(origin, dtype=np.float64), planes)


def _disagree(planes: TurnPlanes | None) -> bool:
    """Return whether turns are farther apart than the noise that is left when they are levelled."""
    return planes is not None and planes.apart_m**2 - planes.left_apart_m**2 > planes.left_apart_m**2


def _numbered(cells: TurnCells, length_s: float) -> tuple[IntArray, TurnCells, IntArray]:
    """Return the numbers of turns in order, cells with groups of turns counted from 0, and the group of each turn.

    A group has one turn, or successive ones where there are too many.
    """
    number, turn = np.unique(cells.turn, return_inverse=True)
    together = -(-len(number) // _MOST_TURNS)
    pauses = np.r_[True, np.diff(number) * length_s > _PAUSE_S] if len(number) else np.zeros(0, bool)
    run = np.cumsum(pauses) - 1
    within = np.arange(len(number)) - np.flatnonzero(pauses)[run]
    begins = within % together == 0
    group = np.cumsum(begins) - 1
    return number, replace(cells, turn=group[turn].astype(np.int64)), group


def _of(store: PointStore, bounds: Bounds) -> Points:
    return store.points(bounds, with_intensity=False, with_columns=False)


def _turn_length_s(pieces: list[Points]) -> float:
    """Return the length of what is taken for a turn; 0 where times are those of no turns.

    Half of the spacing of times that are as far apart as turns, so that no two of them are one, or 0.1 s.
    """
    times = np.unique(np.concatenate([np.zeros(0), *(p.time_s for p in pieces if p.time_s is not None)]))
    if len(times) < LEAST_TURNS:
        return 0.0
    spacing = np.diff(times)
    if np.median(spacing) < _TURN_TIMES_S:
        return _TURN_S
    # Of some turns, pieces show nothing
    shortest = float(np.quantile(spacing, 0.1))
    return 0.5 * max(shortest, _TURN_TIMES_S) if shortest <= _LONGEST_TURN_S else 0.0


def _cells_of(points: Points, origin: FloatArray, length_s: float, share: float) -> TurnCells:
    """Return the mean heights of the turns in the cells of an area, in a share of its patches."""
    time = points.time_s
    assert time is not None
    place = _places(points.xyz, origin)
    patch = _joint(place // _PATCH_CELLS)
    kept = np.flatnonzero(_is_drawn(patch, share))
    kept = kept[_is_low(points.xyz[kept, 2], patch[kept])]
    xyz = points.xyz[kept] - [*origin, 0.0]
    cell, turn = _joint(place[kept]), np.floor(time[kept] / length_s).astype(np.int64)
    order = np.lexsort((turn, cell))
    xyz, cell, turn = xyz[order], cell[order], turn[order]
    start = (
        np.flatnonzero(np.r_[True, (np.diff(cell) != 0) | (np.diff(turn) != 0)])
        if len(cell)
        else np.zeros(0, int)
    )
    n = np.diff(np.r_[start, len(cell)])
    enough = n >= _LEAST_POINTS
    means = np.add.reduceat(xyz, start, axis=0)[enough] / n[enough, None] if len(cell) else np.zeros((0, 3))
    return TurnCells(turn[start][enough], cell[start][enough], means)


def _is_low(z: FloatArray, patch: IntArray) -> AnyArray:
    """Return which heights are no more than a kerb above the lowest tenth of their patch."""
    order = np.argsort(patch)
    start = np.flatnonzero(np.r_[True, np.diff(patch[order]) != 0]) if len(z) else np.zeros(0, int)
    n = np.diff(np.r_[start, len(z)])
    of_patches = np.split(z[order], start[1:]) if len(z) else []
    # Only one height of a patch is asked for: its order is not
    lowest = np.array([np.partition(of, len(of) // 10)[len(of) // 10] for of in of_patches])
    low: FloatArray = np.empty(len(z))
    low[order] = np.repeat(lowest, n)
    return np.asarray(np.abs(z - low) <= _ABOVE_GROUND_M)


def _places(xyz: FloatArray, origin: FloatArray) -> IntArray:
    """Return the numbers east and north of the cells of points, (n, 2)."""
    return np.floor((xyz[:, :2] - origin) / TURN_CELL_M).astype(np.int64)


def _joint(place: IntArray) -> IntArray:
    """Return one number for each pair of numbers (n, 2)."""
    return np.asarray(place[:, 0] * (1 << 32) + place[:, 1], dtype=np.int64)


def _is_drawn(number: IntArray, share: float) -> AnyArray:
    """Return which numbers belong to a share of all: the same ones in any area and order (Fibonacci hashing)."""
    mixed = number.astype(np.uint64) * np.uint64(0x9E3779B97F4A7C15)
    return np.asarray((mixed >> np.uint64(32)).astype(np.float64) < share * 2.0**32)


def _nearest(numbers: IntArray, wanted: IntArray) -> IntArray:
    """Return where in ascending numbers the nearest to each wanted one stands."""
    after = np.clip(np.searchsorted(numbers, wanted), 1, len(numbers) - 1)
    return after - (wanted - numbers[after - 1] < numbers[after] - wanted)
