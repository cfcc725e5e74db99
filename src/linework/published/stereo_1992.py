"""The automatic path of He and Novak (1992), whole and as published: straight bright lines of one pair.

G. He, K. Novak: Automatic analysis of highway features from digital stereo-images, ISPRS XXIX B3, 119-124. What
`linework.methods.stereo.method` finds goes beyond it: bends, worn and faint lines, sub-pixel places, sigmas.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import median_filter

from linework.arrays import AnyArray, BoolArray, FloatArray, IntArray
from linework.kernels.images.thinning import corners_of, follow_chains, thin_in_place
from linework.model.camera import RectifiedRig
from linework.model.images import RectifiedPair
from linework.model.sightings import Sightings

#: Standard deviation of a whole pixel's place. [pixels]
PIXEL_SIGMA_PX = 1.0 / np.sqrt(12.0)
#: The search window: cameras 1.4 to 2.5 m above the road see it here, up to so far ahead and to both sides. [m]
SEARCH_HEIGHT_M, SEARCH_AHEAD_M, SEARCH_ACROSS_M = 2.0, 40.0, 6.0


def straight_lines_of_pair(pair: RectifiedPair) -> Sightings:
    """Return the straight bright lines of a pair, a place per row, in the vehicle frame."""
    left = lines_in(pair.left, search_window(pair.rig))
    right = lines_in(pair.right, search_window(pair.rig))
    # Straight lines of both images are intersected into object space
    found = []
    for number, (i, j) in enumerate(matched(left, right).tolist()):
        top = max(left.top_row[i], right.top_row[j])
        bottom = min(left.bottom_row[i], right.bottom_row[j])
        row = np.arange(bottom, top - 1.0, -1.0)
        col = left.k[i] * row + left.b[i]
        disparity = col - (right.k[j] * row + right.b[j])
        row, col, disparity = row[disparity > 0.5], col[disparity > 0.5], disparity[disparity > 0.5]
        n = len(row)
        sigma = np.full(n, PIXEL_SIGMA_PX)
        found.append(
            Sightings(
                xyz=pair.rig.intersect(col, row, disparity), pair=np.full(n, pair.number), line=np.full(n, number),
                col=col, row=row, disparity=disparity, sigma_px=sigma, sigma_disparity_px=np.sqrt(2.0) * sigma,
            )
        )  # fmt: skip
    return Sightings.concatenate(found)


def search_window(rig: RectifiedRig) -> BoolArray:
    """Return (rows, cols) where level cameras at the usual height see the carriageway."""
    row, col = np.mgrid[: rig.height, : rig.width]
    ahead = SEARCH_HEIGHT_M * rig.focal_px / np.maximum(row - rig.cy, 1e-9)
    across = (col - rig.cx) * ahead / rig.focal_px
    return np.asarray((ahead < SEARCH_AHEAD_M) & (np.abs(across) < SEARCH_ACROSS_M))


def lines_in(image: AnyArray, window: BoolArray | None = None) -> StraightLines:
    """Return the straight bright lines of one image, in a search window."""
    # 3.1 Bright pixels of each scan line; side by side, their centre stands for them
    bright = bright_pixels(image, window)
    centres = centres_of_runs(bright)
    # 3.2 One pixel wide
    thin = thinned(bright)
    # 3.3 From pixels to lines
    chains = chain_code(thin)
    # 3.4 Analytical functions; lines parallel in space meet in one point; pieces of one line together
    return grouped(through_vanishing_point(analytical_functions(chains, centres)))


# Lanes as published: analytical functions, the vanishing-point gate, grouping, intersection (section 3.4)

#: A line is kept if its pixels are this near the straight line through them: pixels are whole, and a stripe's edge
#: is ragged. (root mean square) [pixels]
RESIDUAL_PX = 1.5
#: The middle of a stripe in one row is off by about this: its edges are ragged by a pixel. [pixels]
RAGGED_PX = 0.5
#: Lines belong together where they are no farther apart than this many standard deviations of where they lead,
GROUP_SIGMAS = 3.0
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
        return np.asarray(ALWAYS_PX + GROUP_SIGMAS * sigma * np.hypot(self.k, 1.0))

    @property
    def is_solid(self) -> BoolArray:
        """(m,) bool: seen in nearly every row from end to end; others are dashed."""
        rows = self.bottom_row - self.top_row + 1.0
        return np.asarray(self.n_rows >= 0.8 * rows)


def analytical_functions(chains: PixelChains, centres: FloatArray) -> StraightLines:
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


# Bright line markers, thinning and line following, as published (sections 3.1 to 3.3)

#: The published settings: window of the median [pixels], standard deviations above the mean of the scan line, and
#: the shortest line that is kept [pixels].
MEDIAN_PX, SIGMAS_OF_BACKGROUND, LEAST_PX = 5, 1.5, 10


@dataclass(frozen=True, slots=True)
class PixelChains:
    """Lines of pixels: line i is ``pixels[offsets[i]:offsets[i + 1]]``, (row, col), from its lowest end up.

    `is_corner` tells the pixels that a straight line between their neighbours does not pass: only these would have
    to be stored.
    """

    pixels: IntArray
    offsets: IntArray
    is_corner: BoolArray

    def __len__(self) -> int:
        return len(self.offsets) - 1

    def line(self, i: int) -> IntArray:
        """Return the (n, 2) pixels of line i."""
        return self.pixels[self.offsets[i] : self.offsets[i + 1]]


def bright_pixels(image: AnyArray, window: BoolArray | None = None) -> BoolArray:
    """Return where the median of five pixels is more than 1.5 standard deviations above its scan line's mean (3.1).

    Parameters
    ----------
    image
        (rows, cols) uint8.
    window
        (rows, cols) bool: where the road is expected; None: everywhere.

    Returns
    -------
    ndarray
        (rows, cols) bool.
    """
    grey = image.astype(np.float64)
    inside = np.ones(image.shape) if window is None else window.astype(np.float64)
    n = np.maximum(inside.sum(axis=1, keepdims=True), 1.0)
    mean = (grey * inside).sum(axis=1, keepdims=True) / n
    sigma = np.sqrt(((grey - mean) ** 2 * inside).sum(axis=1, keepdims=True) / n)
    median = median_filter(image, size=(1, MEDIAN_PX)).astype(np.float64)
    return np.asarray((median - mean > SIGMAS_OF_BACKGROUND * sigma) & (inside > 0.0))


def centres_of_runs(bright: BoolArray) -> FloatArray:
    """Return for every bright pixel the middle column of the run of bright pixels side by side it is in (3.1).

    >>> centres_of_runs(np.array([[0, 1, 1, 1, 0, 1]], dtype=bool)).tolist()
    [[nan, 2.0, 2.0, 2.0, nan, 5.0]]
    """
    padded = np.pad(bright.astype(np.int8), ((0, 0), (1, 1)))
    step = np.diff(padded, axis=1)
    first, beyond = np.nonzero(step == 1)[1], np.nonzero(step == -1)[1]
    centres = np.full(bright.shape, np.nan)
    # Runs and their pixels are both in the order of rows, then columns
    centres[bright] = np.repeat((first + beyond - 1) / 2.0, beyond - first)
    return centres


def thinned(white: BoolArray) -> BoolArray:
    """Return lines one pixel wide in the middle of white areas (3.2)."""
    image = np.pad(white.astype(np.uint8), 1)
    thin_in_place(image)
    return image[1:-1, 1:-1].astype(bool)


def chain_code(thin: BoolArray, least_px: int = LEAST_PX) -> PixelChains:
    """Return the lines of a thinned image, followed pixel by pixel; shorter ones are dropped (3.3)."""
    pixels, offsets = follow_chains(np.pad(thin.astype(np.uint8), 1), least_px)
    return PixelChains(pixels - 1, offsets, corners_of(pixels, offsets))
