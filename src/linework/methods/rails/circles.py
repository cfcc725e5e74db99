"""Points near the seed segments, in bins, and the starts among them: beams in end view."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from linework.arrays import Float32Array, FloatArray, IntArray
from linework.kernels.cells import bins as binning
from linework.kernels.cells.bins import BIN_COLUMNS, LayeredBins
from linework.kernels.radon import corridor as kernels
from linework.methods.radon.seeds import SeedSegments
from linework.methods.rails import fitted
from linework.model.grid import Image
from linework.model.settings import Settings, setting

#: Turns against a seed line that a start is sought over, and their step: a seed is good to a step of 3 degrees. [deg]
MOST_TURN_DEG, TURN_STEP_DEG = 3.0, 0.5
#: Points within this distance of the image's set cells are binned: half of the widest profile. [m]
NEAR_M = 1.0
#: Range of heights above the road of binned points: from the foot of a bank behind a rail to above a rail. [m]
RAIL_BAND_M = (-0.6, 2.2)
#: A box of a few metres covers at most this many bins.
_MOST_BINS = 64


@dataclass(frozen=True, slots=True, kw_only=True)
class CircleConfig(Settings):
    """Settings of the circles."""

    spacing_m: float = setting(
        0.5,
        unit="m",
        reason="two circles per metre: two scan lines each at the widest spacing",
        low=0.05,
        high=10,
    )
    radius_m: float = setting(
        0.08,
        unit="m",
        reason="a beam is 8 cm deep: its half depth and two sigma of 2 cm noise",
        low=0.01,
        high=2,
    )
    max_gap_m: float = setting(
        2.0,
        unit="m",
        reason="a post's spacing without a return; longer is a gap in the rail",
        low=0,
        high=100,
    )
    fit_window_m: float = setting(
        3.0,
        unit="m",
        reason="half window of the local fit: eight posts' bending, 18 m bends",
        low=0.5,
        high=50,
    )
    min_height_m: float = setting(
        0.06,
        unit="m",
        reason="above the ground: three sigma of 2 cm noise; a buried end dips so far",
        low=0,
        high=1,
    )
    min_top_m: float = setting(
        0.42,
        unit="m",
        reason="of a beam to start from, above the ground: 0.31 m, and a gap below it",
        low=0,
        high=5,
    )
    max_top_m: float = setting(
        1.3, unit="m", reason="of a beam to start from, above the ground: bridge rails", low=0, high=5
    )
    max_sheet_m: float = setting(
        1.75,
        unit="m",
        reason="of a fence to start from, above the ground: a scanner on a roof sees over it",
        low=0,
        high=5,
    )
    sheet_m: float = setting(
        0.36, unit="m", reason="height of a W-beam (31 cm) and the noise of its top", low=0.05, high=2
    )


@dataclass(frozen=True, slots=True)
class Bins:
    """Points near candidate features, binned for quick access.

    Parameters
    ----------
    points
        (n, 4) x and y from `origin`, z above it, height above the road; by bin, within a bin by layer. [m]
    starts
        (n_x * n_y + 1,) int64: where the points of each bin begin; row-major from the south-west.
    layers
        Index of the layers; see `linework.kernels.cells.bins.sort_into_layers`.
    n_x, n_y, cell_m
        Number of bins to the east and to the north, and their side [m].
    origin
        (3,) south-west corner and zero of heights. [m, world]
    n_most
        Number of points in the fullest bin.
    """

    points: FloatArray
    starts: IntArray
    layers: LayeredBins
    n_x: int
    n_y: int
    cell_m: float
    origin: FloatArray
    n_most: int = 1

    @property
    def work(self) -> FloatArray:
        """A buffer (m, 4) that holds all points of a box of a few metres."""
        return np.empty((_MOST_BINS * self.n_most, BIN_COLUMNS))


def bin_near(xyz: FloatArray, height_m: Float32Array, binary: Image, cell_m: float = 0.5) -> Bins:
    """Bin the points near the set cells of an image: all that a profile covers.

    Parameters
    ----------
    xyz, height_m
        (n, 3) points [m, world] and (n,) float32 heights above the road [m].
    binary
        Image of the cells with points in the height band.
    cell_m
        Side of a bin. [m]
    """
    grid = binary.grid
    reach = max(round(NEAR_M / grid.cell_width_m), 1)
    frame = grid.east_m, grid.north_m, grid.cell_width_m
    index, low, high = binning.choose_near(xyz, height_m, frame, binary.values, reach, RAIL_BAND_M)
    if len(index) == 0:
        low = high = np.zeros(3)
    origin = np.floor(low / cell_m) * cell_m
    n_x, n_y = (int(v / cell_m) + 1 for v in (high - origin)[:2])
    points, starts = binning.sort_into_bins(xyz, height_m, index, origin, cell_m, n_x, n_y)
    layers = binning.sort_into_layers(points, starts)
    n_most = int(np.max(np.diff(starts), initial=1))
    return Bins(points, starts, layers, n_x, n_y, cell_m, origin, n_most)


def find_starts(segments: SeedSegments, bins: Bins, config: CircleConfig) -> FloatArray:
    """Return the starts to follow from, (n, 5): x, y [m, from the origin], heading [rad], top z [m], score.

    A seed line is good to a cell of the image. Around it the Radon transform is taken once more, of the
    points themselves and over small turns, for strips that look like a beam in end view: points over a
    beam's height, none above, none below; or of a sheet, with none above and points down to twice that height. Most
    seeds in hedges, walls and cars are dropped here.
    """
    turns = np.radians(np.arange(-MOST_TURN_DEG, MOST_TURN_DEG + 0.01, TURN_STEP_DEG))
    shape = kernels.BeamShape(
        strip=float(config.radius_m),
        beam=config.sheet_m - fitted.START_BLUR_M,
        clear=fitted.START_CLEAR_M,
        least=fitted.START_POINTS,
        clarity=fitted.START_CLARITY,
        lowest=float(config.min_top_m),
        highest=float(config.max_top_m),
        sheet=2.0 * (config.sheet_m - fitted.START_BLUR_M),
        highest_sheet=float(config.max_sheet_m),
    )
    ends = np.concatenate([segments.start_xy - bins.origin[:2], segments.end_xy - bins.origin[:2]], axis=1)
    args = (bins.points, bins.starts, bins.n_x, bins.n_y, bins.cell_m)
    return np.asarray(kernels.find_beam_starts(*args, ends, turns, shape, bins.work))


def places_of(starts: FloatArray, bins: Bins) -> FloatArray:
    """Return where the tops of starts (n, 5) are, (n, 3). [m, world]."""
    return np.asarray(starts[:, [kernels.NODE_X, kernels.NODE_Y, kernels.NODE_TOP]] + bins.origin)
