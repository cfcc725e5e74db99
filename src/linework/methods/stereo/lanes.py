"""Lanes as published: analytical functions, the vanishing-point gate, grouping, intersection (section 3.4)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from linework.arrays import BoolArray, FloatArray, IntArray
from linework.methods.stereo.bright_lines import Chains

#: A line is kept if its pixels are this near the straight line through them: pixels are whole, and a stripe's edge
#: is ragged. (root mean square) [pixels]
RESIDUAL_PX = 1.5
#: The middle of a stripe in one row is off by about this: its edges are ragged by a pixel. [pixels]
RAGGED_PX = 0.5
#: Lines belong together where they are no farther apart than this many standard deviations of where they lead,
SIGMAS = 3.0
#: and always within this: no lens is without some distortion. [pixels]
ALWAYS_PX = 2.0


@dataclass(frozen=True, slots=True)
class StraightLines:
    """m lines col = k row + b in one image.

    Parameters
    ----------
    k, b
        (m,) float64.
    top_row, bottom_row
        (m,) float64: rows they reach over.
    n_rows
        (m,) float64: rows each was fitted to.
    middle_row, spread
        (m,) float64: mean of their rows, and sum of squares about it.
    """

    k: FloatArray
    b: FloatArray
    top_row: FloatArray
    bottom_row: FloatArray
    n_rows: FloatArray
    middle_row: FloatArray
    spread: FloatArray

    def __len__(self) -> int:
        return len(self.k)

    def take(self, index: IntArray | BoolArray) -> StraightLines:
        """Return the chosen lines."""
        return StraightLines(*(getattr(self, name)[index] for name in self.__dataclass_fields__))

    def reach_px(self, row: FloatArray | float) -> FloatArray:
        """(m,) or (..., m) float64 [pixels]: how far off a line may lead at a row."""
        sigma = RAGGED_PX * np.sqrt(1.0 / self.n_rows + (row - self.middle_row) ** 2 / self.spread)
        return np.asarray(ALWAYS_PX + SIGMAS * sigma * np.hypot(self.k, 1.0))

    @property
    def is_solid(self) -> BoolArray:
        """(m,) bool: seen in nearly every row from end to end; others are dashed."""
        rows = self.bottom_row - self.top_row + 1.0
        return np.asarray(self.n_rows >= 0.8 * rows)


def analytical_functions(chains: Chains, centres: FloatArray) -> StraightLines:
    """Fit col = k row + b to each line, and keep those whose residuals are small.

    Parameters
    ----------
    centres
        (rows, cols): the column that stands for each pixel (see `centres_of_runs`).
    """
    found = []
    for i in range(len(chains)):
        pixels = chains.line(i)
        row, col = pixels[:, 0].astype(np.float64), centres[pixels[:, 0], pixels[:, 1]]
        if np.ptp(row) < 3.0:
            continue  # along a scan line: no line that runs from top to bottom
        k, b = np.polyfit(row, col, 1)
        residual = (col - (k * row + b)) / np.hypot(k, 1.0)  # across the line, which may lie flat
        if float(np.sqrt(np.mean(residual**2))) <= RESIDUAL_PX:
            middle = row.mean()
            spread = np.sum((row - middle) ** 2)
            found.append((k, b, row.min(), row.max(), len(np.unique(row)), middle, spread))
    return StraightLines(*np.array(found, dtype=np.float64).reshape(-1, 7).T)


def vanishing_point(lines: StraightLines) -> tuple[float, float] | None:
    """Return the (row, col) that most of the lines' length passes near, or None for fewer than two lines.

    Notes
    -----
    Of all crossings of two lines the one is taken that lines of the most rows may lead to.
    """
    i, j = np.triu_indices(len(lines), 1)
    turn = lines.k[i] - lines.k[j]
    apart = np.abs(turn) > 0.05  # nearly parallel lines cross anywhere
    if not apart.any():
        return None
    row = -(lines.b[i] - lines.b[j])[apart] / turn[apart]
    col = lines.k[i][apart] * row + lines.b[i][apart]
    near = np.abs(lines.k * row[:, None] + lines.b - col[:, None]) <= lines.reach_px(row[:, None])
    votes = near @ lines.n_rows
    best = int(np.argmax(votes))
    return float(row[best]), float(col[best])


def through_vanishing_point(lines: StraightLines) -> StraightLines:
    """Return the lines that pass near the vanishing point; all where there is none."""
    point = vanishing_point(lines)
    if point is None:
        return lines
    return lines.take(np.abs(lines.k * point[0] + lines.b - point[1]) <= lines.reach_px(point[0]))


def grouped(lines: StraightLines) -> StraightLines:
    """Return lines whose pieces have nearly the same k and b as one (the dashes of a dashed line).

    Two pieces are one line if each leads to the middle of the other.
    """
    left, groups = np.argsort(-lines.n_rows, kind="stable").tolist(), []
    while left:
        own = [left.pop(0)]
        for i in list(left):
            if _is_one(lines, own[0], i):
                own.append(i)
                left.remove(i)
        groups.append(own)
    merged = [_merged(lines, own) for own in groups]
    return StraightLines(*np.array(merged, dtype=np.float64).reshape(-1, 7).T)


def _is_one(lines: StraightLines, i: int, j: int) -> bool:
    rows = lines.middle_row[[j, i]]
    apart = np.abs((lines.k[i] - lines.k[j]) * rows + lines.b[i] - lines.b[j])
    return bool(apart[0] <= lines.reach_px(rows[0])[i] and apart[1] <= lines.reach_px(rows[1])[j])


def _merged(lines: StraightLines, own: list[int]) -> tuple[float, ...]:
    """Return the one line through the pixels of several, from their sums."""
    n, middle = lines.n_rows[own], lines.middle_row[own]
    col = lines.k[own] * middle + lines.b[own]
    row_all, col_all = np.average(middle, weights=n), np.average(col, weights=n)
    spread = float(np.sum(lines.spread[own] + n * (middle - row_all) ** 2))
    k = float(np.sum(lines.k[own] * lines.spread[own] + n * (middle - row_all) * (col - col_all))) / spread
    top, bottom = lines.top_row[own].min(), lines.bottom_row[own].max()
    return k, float(col_all - k * row_all), top, bottom, n.sum(), float(row_all), spread


def matched(left: StraightLines, right: StraightLines) -> IntArray:
    """Return (p, 2) indices of lines in the left and the right image that are one line in space.

    Notes
    -----
    The disparity of a line on the road, ``(kL - kR) row + bL - bR``, grows evenly from 0 at the horizon:
    all lines on one plane have the same growth, base over the cameras' height. The growth that the most lines
    agree on within a tenth is the road's.
    """
    growth = left.k[:, None] - right.k[None, :]
    with np.errstate(divide="ignore", invalid="ignore"):
        horizon = -(left.b[:, None] - right.b[None, :]) / growth
    top = np.maximum(left.top_row[:, None], right.top_row[None, :])
    possible = (growth > 0.0) & (horizon < top)
    if not possible.any():
        return np.zeros((0, 2), dtype=np.int64)
    candidates = growth[possible]
    agree = np.abs(growth[None] / candidates[:, None, None] - 1.0) < 0.1
    weight = np.minimum(left.n_rows[:, None], right.n_rows[None, :])
    votes = np.sum(np.where(agree & possible, weight, 0).max(axis=2), axis=1)
    road = candidates[int(np.argmax(votes))]
    off = np.where(possible, np.abs(growth / road - 1.0), np.inf)
    pairs = []
    while np.isfinite(off).any() and off.min() < 0.1:
        i, j = (int(v) for v in np.unravel_index(int(np.argmin(off)), off.shape))
        pairs.append((i, j))
        off[i, :] = off[:, j] = np.inf
    return np.array(sorted(pairs), dtype=np.int64).reshape(-1, 2)
