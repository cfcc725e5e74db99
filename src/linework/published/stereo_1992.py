"""The automatic method of He and Novak (1992) as published: straight bright lines of one pair, intersected.

G. He, K. Novak: Automatic analysis of highway features from digital stereo-images, ISPRS XXIX B3, 119-124.
`linework.methods.stereo.method` goes beyond it: bends, worn and faint lines, sub-pixel positions, sigmas.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import median_filter

from linework.arrays import AnyArray, BoolArray, FloatArray, IntArray
from linework.kernels.images.thinning import corners_of, follow_chains, thin_in_place
from linework.model.camera import RectifiedRig
from linework.model.images import RectifiedPair
from linework.model.settings import Settings, setting
from linework.model.sightings import Sightings

#: Standard deviation of the position of a whole pixel. [pixels]
PIXEL_SIGMA_PX = 1.0 / np.sqrt(12.0)
#: Smallest disparity that is intersected. [pixels]
LEAST_INTERSECTED_PX = 0.5
#: Largest residual of the pixels of a straight line: pixels are whole, and the edges of a stripe are ragged. (root mean
#: square) [pixels]
RESIDUAL_PX = 1.5
#: Fewest rows that a line extends over: others run along the rows. [rows]
LEAST_ROWS_PX = 3.0
#: Standard deviation of the middle of a stripe in one row: its edges are ragged by a pixel. [pixels]
RAGGED_PX = 0.5
#: Largest distance between pieces of one line, in standard deviations of their extrapolation;
GROUP_SIGMAS = 3.0
#: and beside these, for the distortion left in any image. [pixels]
ALWAYS_PX = 2.0
#: Least share of its rows in which a solid line is found.
SOLID_SHARE = 0.8
#: Smallest difference in slope of lines that are intersected: nearly parallel lines meet anywhere. [pixels/row]
LEAST_CROSSING = 0.05
#: Largest relative difference of growth of disparity between lines on one plane.
SAME_GROWTH = 0.1


@dataclass(frozen=True, slots=True, kw_only=True)
class Stereo1992Config(Settings):
    """Settings of the method as published."""

    median_px: int = setting(5, unit="pixels", reason="published: window of the median", low=1, high=101)
    sigmas: float = setting(
        1.5,
        unit="",
        reason="published: standard deviations of a bright pixel above the mean of its row",
        low=0,
        high=20,
    )
    least_px: int = setting(10, unit="pixels", reason="published: shortest line", low=2, high=1000)
    camera_height_m: float = setting(
        2.0,
        unit="m",
        reason="search window, not published; a roof rack, it serves 1.4 to 2.5 m",
        low=0.2,
        high=20,
    )
    ahead_m: float = setting(40.0, unit="m", reason="search window, not published", low=1, high=500)
    across_m: float = setting(
        6.0, unit="m", reason="search window, not published; a lane to both sides", low=0.5, high=100
    )


#: The settings of the paper.
AS_PUBLISHED = Stereo1992Config()


def straight_lines_of_pair(pair: RectifiedPair, config: Stereo1992Config = AS_PUBLISHED) -> Sightings:
    """Return the straight bright lines of a pair, one sighting per row, in the vehicle frame.

    The score of a sighting is the share of the line's rows that it was found in: see `SOLID_SHARE`.
    """
    window = search_window(pair.rig, config)
    left, right = lines_in(pair.left, window, config), lines_in(pair.right, window, config)
    # Intersect the matching lines of both images in object space
    found = []
    for number, (i, j) in enumerate(matched(left, right).tolist()):
        top = max(left.top_row[i], right.top_row[j])
        bottom = min(left.bottom_row[i], right.bottom_row[j])
        row = np.arange(bottom, top - 1.0, -1.0)
        col = left.k[i] * row + left.b[i]
        disparity = col - (right.k[j] * row + right.b[j])
        ahead = disparity > LEAST_INTERSECTED_PX
        row, col, disparity = row[ahead], col[ahead], disparity[ahead]
        n = len(row)
        sigma = np.full(n, PIXEL_SIGMA_PX)
        found.append(
            Sightings(
                xyz=pair.rig.intersect(col, row, disparity), pair=np.full(n, pair.number), line=np.full(n, number),
                col=col, row=row, disparity=disparity, sigma_px=sigma, sigma_disparity_px=np.sqrt(2.0) * sigma,
                score=np.full(n, min(left.share[i], right.share[j])),
            )
        )  # fmt: skip
    return Sightings.concatenate(found)


def search_window(rig: RectifiedRig, config: Stereo1992Config = AS_PUBLISHED) -> BoolArray:
    """Return (rows, cols) bool: pixels in which level cameras at the usual height show the carriageway."""
    row, col = np.mgrid[: rig.height, : rig.width]
    ahead = config.camera_height_m * rig.focal_px / np.maximum(row - rig.cy, 1e-9)
    across = (col - rig.cx) * ahead / rig.focal_px
    return np.asarray((ahead < config.ahead_m) & (np.abs(across) < config.across_m))


def lines_in(
    image: AnyArray, window: BoolArray | None = None, config: Stereo1992Config = AS_PUBLISHED
) -> StraightLines:
    """Return the straight bright lines of one image (rows, cols) uint8, in a search window (rows, cols) bool."""
    # 3.1 Bright pixels of each row, and the centres of their runs
    bright = bright_pixels(image, window, config)
    centres = centres_of_runs(bright)
    # 3.2 Thinning to one pixel
    thin = thinned(bright)
    # 3.3 Following pixels to lines
    chains = chain_code(thin, config.least_px)
    # 3.4 Analytical functions, those through the vanishing point, and grouping of pieces of one line
    return grouped(through_vanishing_point(analytical_functions(chains, centres)))


@dataclass(frozen=True, slots=True)
class StraightLines:
    """Straight lines col = k row + b in one image, as columns.

    Parameters
    ----------
    k, b
        (m,) slope and column at row 0. [pixels/row, pixels]
    top_row, bottom_row
        (m,) first and last row. [pixels]
    n_rows
        (m,) number of rows that each was fitted to.
    middle_row, spread
        (m,) mean of these rows [pixels], and sum of squares about it [pixels^2].
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
        """Return the lines of an index or a mask."""
        return StraightLines(*(getattr(self, name)[index] for name in self.__dataclass_fields__))

    def reach_px(self, row: FloatArray | float) -> FloatArray:
        """Return (m,) or (..., m) the largest error of the lines extrapolated to a row. [pixels]"""  # noqa: D400
        sigma = RAGGED_PX * np.sqrt(1.0 / self.n_rows + (row - self.middle_row) ** 2 / self.spread)
        return np.asarray(ALWAYS_PX + GROUP_SIGMAS * sigma * np.hypot(self.k, 1.0))

    @property
    def share(self) -> FloatArray:
        """(m,) share of its rows in which each was found, 0 to 1."""
        return np.asarray(np.minimum(self.n_rows / (self.bottom_row - self.top_row + 1.0), 1.0))

    @property
    def is_solid(self) -> BoolArray:
        """(m,) bool: found in at least `SOLID_SHARE` of its rows; others are dashed."""
        return np.asarray(self.share >= SOLID_SHARE)


def analytical_functions(chains: PixelChains, centres: FloatArray) -> StraightLines:
    """Return col = k row + b fitted to each chain of pixels, for those whose residuals are small.

    Parameters
    ----------
    centres
        (rows, cols) middle column of the run of each bright pixel (`centres_of_runs`).
    """
    found = []
    for i in range(len(chains)):
        pixels = chains.line(i)
        row, col = pixels[:, 0].astype(np.float64), centres[pixels[:, 0], pixels[:, 1]]
        if np.ptp(row) < LEAST_ROWS_PX:
            continue
        k, b = np.polyfit(row, col, 1)
        residual = (col - (k * row + b)) / np.hypot(k, 1.0)  # across the line, not along the row
        if float(np.sqrt(np.mean(residual**2))) <= RESIDUAL_PX:
            middle = row.mean()
            spread = np.sum((row - middle) ** 2)
            found.append((k, b, row.min(), row.max(), len(np.unique(row)), middle, spread))
    return StraightLines(*np.array(found, dtype=np.float64).reshape(-1, 7).T)


def vanishing_point(lines: StraightLines) -> tuple[float, float] | None:
    """Return the (row, col) through which most of the lines pass; None where no two lines cross.

    Notes
    -----
    Of all crossings of two lines, the one that lines of the most rows pass within their errors.
    """
    i, j = np.triu_indices(len(lines), 1)
    turn = lines.k[i] - lines.k[j]
    apart = np.abs(turn) > LEAST_CROSSING
    if not apart.any():
        return None
    row = -(lines.b[i] - lines.b[j])[apart] / turn[apart]
    col = lines.k[i][apart] * row + lines.b[i][apart]
    near = np.abs(lines.k * row[:, None] + lines.b - col[:, None]) <= lines.reach_px(row[:, None])
    votes = near @ lines.n_rows
    best = int(np.argmax(votes))
    return float(row[best]), float(col[best])


def through_vanishing_point(lines: StraightLines) -> StraightLines:
    """Return the lines that pass through the vanishing point within their errors; all where there is none."""
    point = vanishing_point(lines)
    if point is None:
        return lines
    return lines.take(np.abs(lines.k * point[0] + lines.b - point[1]) <= lines.reach_px(point[0]))


def grouped(lines: StraightLines) -> StraightLines:
    """Return the lines with pieces of nearly the same k and b merged, such as the dashes of a line.

    Two pieces belong to one line if each extrapolates to the middle of the other.
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
    """Return whether two pieces belong to one line."""
    rows = lines.middle_row[[j, i]]
    apart = np.abs((lines.k[i] - lines.k[j]) * rows + lines.b[i] - lines.b[j])
    return bool(apart[0] <= lines.reach_px(rows[0])[i] and apart[1] <= lines.reach_px(rows[1])[j])


def _merged(lines: StraightLines, own: list[int]) -> tuple[float, ...]:
    """Return the line through the pixels of several pieces, from their sums: columns of `StraightLines`."""
    n, middle = lines.n_rows[own], lines.middle_row[own]
    col = lines.k[own] * middle + lines.b[own]
    row_all, col_all = np.average(middle, weights=n), np.average(col, weights=n)
    spread = float(np.sum(lines.spread[own] + n * (middle - row_all) ** 2))
    k = float(np.sum(lines.k[own] * lines.spread[own] + n * (middle - row_all) * (col - col_all))) / spread
    top, bottom = lines.top_row[own].min(), lines.bottom_row[own].max()
    return k, float(col_all - k * row_all), top, bottom, n.sum(), float(row_all), spread


def matched(left: StraightLines, right: StraightLines) -> IntArray:
    """Return (p, 2) int64: indices of lines in the left and the right image that are one line in space.

    Notes
    -----
    The disparity of a line on the road, ``(kL - kR) row + bL - bR``, grows linearly from 0 at the horizon: all lines on
    one plane have the same growth, base over the height of the cameras. The growth that most lines agree on is that of
    the road.
    """
    growth = left.k[:, None] - right.k[None, :]
    with np.errstate(divide="ignore", invalid="ignore"):
        horizon = -(left.b[:, None] - right.b[None, :]) / growth
    top = np.maximum(left.top_row[:, None], right.top_row[None, :])
    possible = (growth > 0.0) & (horizon < top)
    if not possible.any():
        return np.zeros((0, 2), dtype=np.int64)
    candidates = growth[possible]
    agree = np.abs(growth[None] / candidates[:, None, None] - 1.0) < SAME_GROWTH
    weight = np.minimum(left.n_rows[:, None], right.n_rows[None, :])
    votes = np.sum(np.where(agree & possible, weight, 0).max(axis=2), axis=1)
    road = candidates[int(np.argmax(votes))]
    off = np.where(possible, np.abs(growth / road - 1.0), np.inf)
    pairs = []
    while np.isfinite(off).any() and off.min() < SAME_GROWTH:
        i, j = (int(v) for v in np.unravel_index(int(np.argmin(off)), off.shape))
        pairs.append((i, j))
        off[i, :] = off[:, j] = np.inf
    return np.array(sorted(pairs), dtype=np.int64).reshape(-1, 2)


@dataclass(frozen=True, slots=True)
class PixelChains:
    """Chains of pixels, each from its lowest end up: chain i is ``pixels[offsets[i]:offsets[i + 1]]``.

    Parameters
    ----------
    pixels
        (n, 2) int64 row and column. [pixels]
    offsets
        (m + 1,) int64.
    is_corner
        (n,) bool: the pixel is not on a straight line between its neighbours; only these need to be stored.
    """

    pixels: IntArray
    offsets: IntArray
    is_corner: BoolArray

    def __len__(self) -> int:
        return len(self.offsets) - 1

    def line(self, i: int) -> IntArray:
        """Return (k, 2) the pixels of chain i."""
        return self.pixels[self.offsets[i] : self.offsets[i + 1]]


def bright_pixels(
    image: AnyArray, window: BoolArray | None = None, config: Stereo1992Config = AS_PUBLISHED
) -> BoolArray:
    """Return (rows, cols) bool: the median of five pixels is 1.5 standard deviations above the mean of its row (3.1).

    Parameters
    ----------
    image
        (rows, cols) uint8.
    window
        (rows, cols) bool: where the road is expected; None for the whole image.
    """
    median, mean, sigma, inside = _median_and_background(image, window, config)
    return np.asarray((median - mean > config.sigmas * sigma) & inside)


def _median_and_background(
    image: AnyArray, window: BoolArray | None, config: Stereo1992Config
) -> tuple[FloatArray, FloatArray, FloatArray, BoolArray]:
    """Return the median of the pixels (rows, cols), and mean and standard deviation of each row (rows, 1) in a window."""
    grey = image.astype(np.float64)
    inside = np.ones(image.shape) if window is None else window.astype(np.float64)
    n = np.maximum(inside.sum(axis=1, keepdims=True), 1.0)
    mean = (grey * inside).sum(axis=1, keepdims=True) / n
    sigma = np.sqrt(((grey - mean) ** 2 * inside).sum(axis=1, keepdims=True) / n)
    median = median_filter(image, size=(1, config.median_px)).astype(np.float64)
    return median, mean, sigma, inside > 0.0


def centres_of_runs(bright: BoolArray) -> FloatArray:
    """Return (rows, cols) the middle column of the run of bright pixels that a pixel is in, NaN for others (3.1).

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
    """Return (rows, cols) bool: lines one pixel wide in the middle of white areas (3.2)."""
    image = np.pad(white.astype(np.uint8), 1)
    thin_in_place(image)
    return image[1:-1, 1:-1].astype(bool)


def chain_code(thin: BoolArray, least_px: int = AS_PUBLISHED.least_px) -> PixelChains:
    """Return the lines of a thinned image (rows, cols) bool, followed pixel by pixel; short ones are dropped (3.3)."""
    pixels, offsets = follow_chains(np.pad(thin.astype(np.uint8), 1), least_px)
    return PixelChains(pixels - 1, offsets, corners_of(pixels, offsets))


#: Steps of the eight codes of a chain, in rows and columns: 0 is to the right, then anticlockwise (H. Freeman, 1961).
CODES = ((0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1), (1, 0), (1, 1))


def codes_of(chain: IntArray) -> str:
    """Return the chain code of a line of pixels (k, 2): no coordinates but a step from each pixel to the next.

    >>> codes_of(np.array([[5, 3], [4, 3], [3, 4], [3, 5]]))
    '210'
    """
    return "".join(str(CODES.index((int(row), int(col)))) for row, col in np.diff(chain, axis=0))


def images_of_steps(image: AnyArray, window: BoolArray | None = None) -> dict[str, AnyArray]:
    """Return the image of each step on an image (rows, cols) uint8, by name, uint8: 0 black, 255 white.

    ``grey``; ``median_minus_mean`` (the median of five pixels over the mean of its row in the window, 128 where they are equal);
    ``binary``; ``thinned``; and ``chains``: the lines that are long enough.
    """
    median, mean, _, _ = _median_and_background(image, window, AS_PUBLISHED)
    white = bright_pixels(image, window)
    thin = thinned(white)
    followed = np.zeros(image.shape, dtype=np.bool_)
    pixels = chain_code(thin).pixels
    followed[pixels[:, 0], pixels[:, 1]] = True
    grey = np.clip(np.round(128.0 + median - mean), 0, 255)
    shown = {"grey": image, "median_minus_mean": grey, "binary": white, "thinned": thin, "chains": followed}
    return {name: (255 * v if v.dtype == np.bool_ else v).astype(np.uint8) for name, v in shown.items()}
