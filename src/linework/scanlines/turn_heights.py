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

from linework.arrays import AnyArray, FloatArray, IntArray
from linework.model.columns import Columns, column

#: Side of the cells in which turns are compared: smaller than gutters and ramps, with three points of a turn up to some
#: 15 m from a scanner of 64 beams. [m]
TURN_CELL_M = 0.4
#: A cell is compared where this many turns saw it: with fewer, what is left of their differences says little.
LEAST_TURNS = 5
#: Standard deviation of recorded heights against which the mean of all turns is held: phase GNSS at its best. [m]
RECORDED_SIGMA_M = 0.03
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
    centre
        (t, 2) middle of what each turn saw; NaN for turns without a cell. [m, local]
    plane
        (t, 3) height there [m], and slopes to the east and to the north.
    apart_m, left_apart_m
        Differences of turns to the mean of all, as a standard deviation by their median: recorded, and without the
        planes. [m]
    moved_m
        Root mean square of what the mean of all turns moves at a cell: of that nothing is known. [m]
    """

    centre: FloatArray
    plane: FloatArray
    apart_m: float
    left_apart_m: float
    moved_m: float

    def at(self, turn: IntArray, xy: FloatArray) -> FloatArray:
        """Return how much too high turns (n,) are at places (n, 2) [m, local], (n,) [m]."""
        away = xy - self.centre[turn]
        return np.asarray(self.plane[turn, 0] + np.einsum("ij,ij->i", away, self.plane[turn, 1:]))


def turn_planes(cells: TurnCells) -> TurnPlanes | None:
    """Return what turns are too high; None where too few cells have points of several of them.

    Parameters
    ----------
    cells
        Of any order.
    """
    n_turns = int(cells.turn.max()) + 1 if len(cells) else 0
    _, number, n_seen = np.unique(cells.cell, return_inverse=True, return_counts=True)
    seen = n_seen[number] >= LEAST_TURNS
    at = np.unique(number[seen], return_inverse=True)[1].astype(np.int64)
    turn, xyz = cells.turn[seen], cells.xyz[seen]
    if len(at) <= 3 * n_turns or n_turns < LEAST_TURNS:
        return None
    centre = _centres(turn, xyz, n_turns)
    away = xyz[:, :2] - centre[turn]
    rows = np.tile(np.arange(len(turn)), 3)
    A = sparse.csr_matrix(
        (np.concatenate([np.ones(len(turn)), away[:, 0], away[:, 1]]),
         (rows, np.concatenate([3 * turn, 3 * turn + 1, 3 * turn + 2]))), shape=(len(turn), 3 * n_turns),
    )  # fmt: skip
    in_cell = sparse.csr_matrix((np.ones(len(turn)), (np.arange(len(turn)), at)))
    z = xyz[:, 2]
    found, weight = np.zeros(3 * n_turns), np.ones(len(turn))
    apart = scale = _spread(_less_mean(z, at, weight))
    for _ in range(_N_ROUNDS):
        total = in_cell.T @ weight
        weighted = sparse.diags(weight)
        to_cells = A.T @ weighted @ in_cell
        mean_of = to_cells @ sparse.diags(1.0 / total)
        normal = A.T @ weighted @ A - mean_of @ to_cells.T
        normal = normal + (scale / RECORDED_SIGMA_M) ** 2 * (mean_of @ mean_of.T)
        normal = normal + scale**2 * _prior(n_turns)
        found = splu(normal.tocsc()).solve(A.T @ (weight * z) - mean_of @ (in_cell.T @ (weight * z)))
        residual = _less_mean(z - A @ found, at, weight)
        scale = max(_spread(residual), 1e-4)
        # Of a kerb, a car, and whatever else is no level ground: Cauchy
        weight = 1.0 / (1.0 + (residual / (2.0 * scale)) ** 2)
    mean = np.bincount(at, weight * (A @ found)) / np.bincount(at, weight)
    moved = float(np.sqrt(np.mean(mean**2)))
    return TurnPlanes(centre, found.reshape(-1, 3), apart, scale, moved)


def _less_mean(z: FloatArray, at: IntArray, weight: FloatArray) -> FloatArray:
    return np.asarray(z - (np.bincount(at, weight * z) / np.bincount(at, weight))[at])


def _spread(residual: FloatArray) -> float:
    """Return the standard deviation by the median."""
    return 1.4826 * float(np.median(np.abs(residual)))


def _centres(turn: IntArray, xyz: FloatArray, n_turns: int) -> FloatArray:
    """Return the mean place of each turn's cells, (t, 2); of a turn without any that of the turns beside it."""
    n = np.bincount(turn, minlength=n_turns)
    has = np.flatnonzero(n)
    means = [np.bincount(turn, xyz[:, i], n_turns)[has] / n[has] for i in (0, 1)]
    return np.stack([np.interp(np.arange(n_turns), has, mean) for mean in means], axis=1)


def _prior(n_turns: int) -> AnyArray:
    """Return the normal matrix of what is known before: bounded, and little changed from turn to turn."""
    steps = sparse.diags(
        [np.full(n_turns - 1, -1.0), np.ones(n_turns - 1)], [0, 1], shape=(n_turns - 1, n_turns)
    )
    size = np.array([_STEP_M, _STEP_RAD, _STEP_RAD]), np.array([_PRIOR_M, _PRIOR_RAD, _PRIOR_RAD])
    change = sparse.kron(steps.T @ steps, sparse.diags(size[0] ** -2.0))
    normal: AnyArray = change + sparse.kron(sparse.eye(n_turns), sparse.diags(size[1] ** -2.0))
    return normal
