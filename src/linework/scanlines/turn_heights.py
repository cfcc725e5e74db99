"""Heights of the turns of a spinning lidar made to agree: a plane for each, by least squares over the ground they share.

A spinning lidar sees each place of the ground from many turns. Where its path comes from matching scans, or from a poor
inertial system, each turn is some centimetres too high and some tenths of a degree tilted, and a kerb of 12 cm that is
measured to 1 cm by every turn is gone in the sum of them.

Notes
-----
In a small cell of level ground all turns measure one height. Unknown are, for each turn, a height and two slopes; the
height of each cell is eliminated. Which of all heights is right cannot be found by comparing turns: the mean correction of
a cell is 0, with the standard deviation that recorded heights have at best.

References
----------
Triggs, B., McLauchlan, P. F., Hartley, R. I., Fitzgibbon, A. W. (2000): Bundle adjustment - a modern synthesis. Section 6.1,
elimination of one kind of unknown. doi:10.1007/3-540-44480-7_21
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from linework.arrays import AnyArray, FloatArray, IntArray, offsets_of
from linework.kernels.scanlines.turn_planes import (
    OF_CELLS,
    OF_LOOKS,
    OF_MEANS,
    Looks,
    sum_of_turns,
    turns_that_meet,
)
from linework.model.columns import Columns, column

#: Side of the cells in which turns are compared: smaller than gutters and ramps, with three points of a turn up to some
#: 15 m from a scanner of 64 beams. [m]
TURN_CELL_M = 0.4
#: A cell is compared where this many turns saw it: with fewer, what is left of their differences says little.
LEAST_TURNS = 5
#: Turns of a cell that are compared, evenly chosen from all: more say little more, and cost their square.
_MOST_IN_CELL = 24
#: What a turn saw spreads this far across (standard deviation), or it is no turn of a lidar but some lines of a profile
#: scanner, whose neighbours differ in a cell by the slope of the road and not in height. One that goes so fast that a tenth
#: of a second spreads as far is over a cell in less. [m]
_LEAST_SPREAD_M = 0.5
#: Slopes of a turn hold this many times as far as its cells spread: beyond, what it saw moves as if it were there.
_REACH = 3.0
#: Standard deviation of recorded heights to which the mean of all turns in a cell is held: phase GNSS at its best. [m]
_RECORDED_SIGMA_M = 0.03
#: From one turn to the next, height and slopes change by about so much; it only matters for turns that saw little: a van's
#: springs and attitude in a tenth of a second. [m], [rad]
_STEP_M, _STEP_RAD = 0.03, 0.003
#: Standard deviations of height and slope of a turn that nothing else holds: no one would record worse. [m], [rad]
_PRIOR_M, _PRIOR_RAD = 1.0, 0.02
#: Rounds of weighting: the weights no longer change after six or seven.
_N_ROUNDS = 8


@dataclass(frozen=True, slots=True)
class TurnCells(Columns):
    """n mean heights, each of the points of one turn in one cell.

    Parameters
    ----------
    turn
        (n,) number of the turn, ascending in time.
    cell
        (n,) number of the cell.
    xyz
        (n, 3) mean of the points. [m, local]
    """

    turn: IntArray = column(np.int64)
    cell: IntArray = column(np.int64)
    xyz: FloatArray = column(np.float64, 3)


@dataclass(frozen=True, slots=True, eq=False)
class TurnPlanes:
    """What each turn is too high, as a plane.

    Parameters
    ----------
    centre, reach_m
        (t, 2) middle of what each turn saw, and (t,) how far from there its slopes hold. [m, local]
    plane
        (t, 3) height there [m], and slopes to the east and to the north.
    apart_m, left_apart_m
        Differences of turns to the mean of all, as a standard deviation by their median: recorded, and without the
        planes. [m]
    common_sigma_m
        Standard deviation of what the turns of a place have in common, of which comparing them says nothing: how far their
        mean moves (root mean square), and how far the mean of so many turns is off, each as far as they are apart. [m]
    """

    centre: FloatArray
    reach_m: FloatArray
    plane: FloatArray
    apart_m: float
    left_apart_m: float
    common_sigma_m: float

    def at(self, turn: IntArray, xy: FloatArray) -> FloatArray:
        """Return how much too high turns (n,) are at places (n, 2) [m, local], (n,) [m]."""
        height, east, north = np.ascontiguousarray(self.plane.T)
        x, y = (xy[:, k] - np.ascontiguousarray(self.centre[:, k])[turn] for k in range(2))
        far = np.maximum(np.hypot(x, y) / np.maximum(self.reach_m, 1e-9)[turn], 1.0)
        return np.asarray(height[turn] + (x / far * east[turn] + y / far * north[turn]))


def turn_planes(cells: TurnCells) -> TurnPlanes | None:
    """Return what turns are too high; None where too few cells have points of several of them.

    Parameters
    ----------
    cells
        Of any order.
    """
    n_turns = int(cells.turn.max()) + 1 if len(cells) else 0
    _, number, n_seen = np.unique(cells.cell, return_inverse=True, return_counts=True)
    seen = (n_seen[number] >= LEAST_TURNS) & _is_chosen(number, cells.turn, n_seen)
    at = np.unique(number[seen], return_inverse=True)[1].astype(np.int64)
    turn, xyz = cells.turn[seen], cells.xyz[seen]
    if len(at) <= 3 * n_turns or n_turns < LEAST_TURNS:
        return None
    centre, spread = _centres(turn, xyz, n_turns)
    if np.median(spread[turn, 0]) < _LEAST_SPREAD_M:
        return None
    away = xyz[:, :2] - centre[turn]
    rows = np.tile(np.arange(len(turn)), 3)
    A = sparse.csr_matrix(
        (np.concatenate([np.ones(len(turn)), away[:, 0], away[:, 1]]),
         (rows, np.concatenate([3 * turn, 3 * turn + 1, 3 * turn + 2]))), shape=(len(turn), 3 * n_turns),
    )  # fmt: skip
    looks = Looks(np.argsort(at, kind="stable"), offsets_of(np.bincount(at)), turn, away)
    blocks = _Blocks.of(looks, n_turns)
    z = np.ascontiguousarray(xyz[:, 2])
    found, weight = np.zeros(3 * n_turns), np.ones(len(turn))
    apart = scale = _spread(_less_mean(z, at, weight))
    for _ in range(_N_ROUNDS):
        sums, right = sum_of_turns(looks, z, weight, blocks.number, len(blocks.prior))
        values = sums[:, OF_LOOKS] - sums[:, OF_CELLS]
        values = values + (scale / _RECORDED_SIGMA_M) ** 2 * sums[:, OF_MEANS]
        found = splu(blocks.matrix(values + scale**2 * blocks.prior)).solve(right.reshape(-1))
        residual = _less_mean(z - A @ found, at, weight)
        scale = max(_spread(residual), 1e-4)
        # Of a kerb, a car, and whatever else is no level ground: Cauchy
        weight = 1.0 / (1.0 + (residual / (2.0 * scale)) ** 2)
    mean = np.bincount(at, weight * (A @ found)) / np.bincount(at, weight)
    common = float(np.sqrt(np.mean(mean**2) + apart**2 / np.median(n_seen[n_seen >= LEAST_TURNS])))
    return TurnPlanes(centre, _REACH * spread[:, 1], found.reshape(-1, 3), apart, scale, common)


@dataclass(frozen=True, slots=True, eq=False)
class _Blocks:
    """Where the matrix of the normal equations has blocks of 3 x 3: for turns that see a cell, and for successive ones.

    Parameters
    ----------
    number
        (t, t) number of the block of two turns, 0 without any.
    column, starts
        (k,) second turn of each block, and (t + 1,) where those of each first turn begin.
    prior
        (k, 3, 3) what is known before.
    """

    number: IntArray
    column: IntArray
    starts: IntArray
    prior: FloatArray

    @classmethod
    def of(cls, looks: Looks, n_turns: int) -> _Blocks:
        """Return the blocks for what turns saw."""
        known = sparse.coo_matrix(_prior(n_turns))
        has = turns_that_meet(looks, n_turns)
        has[known.row // 3, known.col // 3] = True
        number = np.zeros((n_turns, n_turns), np.int64)
        number[has] = np.arange(np.count_nonzero(has))
        prior = np.zeros((np.count_nonzero(has), 3, 3))
        prior[number[known.row // 3, known.col // 3], known.row % 3, known.col % 3] = known.data
        return cls(number, np.nonzero(has)[1], offsets_of(np.count_nonzero(has, axis=1)), prior)

    def matrix(self, values: FloatArray) -> AnyArray:
        """Return the matrix (3 t, 3 t) of which these are the blocks, (k, 3, 3)."""
        size = 3 * len(self.number)
        whole = sparse.bsr_matrix((values, self.column, self.starts), shape=(size, size)).tocsc()
        whole.eliminate_zeros()
        matrix: AnyArray = whole
        return matrix


def _is_chosen(cell: IntArray, turn: IntArray, n_seen: IntArray) -> AnyArray:
    """Return which looks are compared: of a cell that more turns saw, evenly spaced ones in time."""
    order = np.lexsort((turn, cell))
    start = offsets_of(n_seen)
    rank: IntArray = np.empty(len(cell), np.int64)
    rank[order] = np.arange(len(cell)) - start[cell[order]]
    step = np.maximum(1, -(-n_seen // _MOST_IN_CELL))
    return np.asarray(rank % step[cell] == 0)


def _less_mean(z: FloatArray, at: IntArray, weight: FloatArray) -> FloatArray:
    return np.asarray(z - (np.bincount(at, weight * z) / np.bincount(at, weight))[at])


def _spread(residual: FloatArray) -> float:
    """Return the standard deviation by the median."""
    return 1.4826 * float(np.median(np.abs(residual)))


def _centres(turn: IntArray, xyz: FloatArray, n_turns: int) -> tuple[FloatArray, FloatArray]:
    """Return the mean place of each turn's cells, (t, 2), and their least and greatest standard deviation, (t, 2) [m].

    Of a turn without any, those of the turns beside it.
    """
    n = np.bincount(turn, minlength=n_turns)
    has = np.flatnonzero(n)
    sums = [np.bincount(turn, weights, n_turns)[has] / n[has] for weights in xyz[:, :2].T]
    centre = np.stack([np.interp(np.arange(n_turns), has, mean) for mean in sums], axis=1)
    x, y = (xyz[:, :2] - centre[turn]).T
    xx, yy, xy = (np.bincount(turn, weights, n_turns)[has] / n[has] for weights in (x * x, y * y, x * y))
    mean, half = 0.5 * (xx + yy), np.sqrt(0.25 * (xx - yy) ** 2 + xy**2)
    spread = [
        np.interp(np.arange(n_turns), has, np.sqrt(np.maximum(v, 0.0))) for v in (mean - half, mean + half)
    ]
    return centre, np.stack(spread, axis=1)


def _prior(n_turns: int) -> AnyArray:
    """Return the normal matrix of what is known before: bounded, and little changed from turn to turn."""
    steps = sparse.diags(
        [np.full(n_turns - 1, -1.0), np.ones(n_turns - 1)], [0, 1], shape=(n_turns - 1, n_turns)
    )
    size = np.array([_STEP_M, _STEP_RAD, _STEP_RAD]), np.array([_PRIOR_M, _PRIOR_RAD, _PRIOR_RAD])
    change = sparse.kron(steps.T @ steps, sparse.diags(size[0] ** -2.0))
    normal: AnyArray = change + sparse.kron(sparse.eye(n_turns), sparse.diags(size[1] ** -2.0))
    return normal
