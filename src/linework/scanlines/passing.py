"""What passed while a spinning lidar looked: points over ground that most turns saw free.

A car that drives through a survey of turns leaves a trail: a wall of points along its lane, with edges that look like those
of a pavement. Each place of it was free before the car and after it; what stands there is seen by turn after turn.

Separate from `turn_heights`, which needs cells of ground alone: this looks at all points, once heights agree.
"""

from __future__ import annotations

import numpy as np

from linework.arrays import BoolArray, FloatArray, IntArray, ranks_of

#: Heights over the ground of the part of a trail that is left out: above any kerb, and below what hangs over a road. What
#: is higher looks like no edge, rail or fence. [m]
_LOWEST_M, _HIGHEST_M = 0.2, 2.0
#: A place was free for this many turns at least, and for half of those that saw it.
_LEAST_FREE, _LEAST_FREE_SHARE = 8, 0.5
#: Ground is the lowest point of a turn in a cell that this share of turns is below: a few look under the ground by an echo.
_GROUND_SHARE = 0.2
#: Turns that see something there follow each other: no more than one of three of them comes after a turn that does not.
#: Of rails and branches between the beams of a lidar, turns see now one and now none.
_LEAST_IN_A_ROW = 3


def is_passing(height_m: FloatArray, cell: IntArray, turn: IntArray) -> BoolArray:
    """Return which points belong to things that passed, (n,) bool.

    Parameters
    ----------
    height_m
        (n,) heights at which turns agree. [m]
    cell
        (n,) int64: number of the cell of each point, half a metre or less wide.
    turn
        (n,) int64: number of the turn, ascending in time.

    Notes
    -----
    A cell of which two turns or more saw something between 0.2 and 2 m over the ground, and at least 8 turns and half of all
    that saw it nothing, while those that saw something follow each other in time. Parked cars, rails, fences and poles are
    there for all turns.

    Examples
    --------
    A car stands in the cell in turns 20 to 24 of 40.

    >>> turn = np.arange(40)
    >>> height = np.where((turn >= 20) & (turn < 25), 0.9, 0.0)
    >>> np.flatnonzero(is_passing(height, np.zeros(40, int), turn)).tolist()
    [20, 21, 22, 23, 24]
    """
    if not len(cell):
        return np.zeros(0, dtype=bool)
    cells, cell = ranks_of(cell)
    turns, turn = ranks_of(turn)
    looks, look = ranks_of(cell * len(turns) + turn)
    at = looks // len(turns)
    ground = _ground(np.asarray(_lowest(height_m, look, len(looks))), at)
    over = height_m - ground[cell]
    is_high = (over > _LOWEST_M) & (over < _HIGHEST_M)
    sees = np.bincount(look, is_high, len(looks)) > 0
    starts = sees & ~np.r_[False, sees[:-1] & (at[1:] == at[:-1])]
    n, n_sees, n_starts = (np.bincount(at, which, len(cells)) for which in (np.ones(len(at)), sees, starts))
    passed = (
        (n - n_sees >= np.maximum(_LEAST_FREE, _LEAST_FREE_SHARE * n))
        & (n_sees >= 2)
        & (n_starts <= np.maximum(1.0, n_sees / _LEAST_IN_A_ROW))
    )
    return np.asarray(is_high & passed[cell])


def _lowest(height_m: FloatArray, look: IntArray, n_looks: int) -> FloatArray:
    """Return the lowest height of each look, the points of a turn in a cell."""
    lowest = np.full(n_looks, np.inf)
    np.minimum.at(lowest, look, height_m)
    return lowest


def _ground(lowest_m: FloatArray, at: IntArray) -> FloatArray:
    """Return the height of the ground in each cell from the lowest of its looks, which are in the order of cells."""
    order = np.lexsort((lowest_m, at))
    start = np.flatnonzero(np.r_[True, np.diff(at) != 0])
    n = np.diff(np.r_[start, len(at)])
    return np.asarray(lowest_m[order][start + (_GROUND_SHARE * n).astype(np.int64)])
