"""Vertical profile of a followed sheet of points, and the settings of its classification.

A peak in the height band may be a guardrail, but also a row of parked cars, a hedge, a wall or a fence
(the paper leaves them to "further analysis"). A beam guardrail, and nothing else, is a thin sheet 0.2 to
0.4 m high, with a straight top edge, nothing above it, and a clear gap below it where the rays pass on.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from itertools import pairwise
from typing import Any

import numpy as np

from linework.arrays import AnyArray, FloatArray, IntArray, offsets_of
from linework.kernels.radon import sections as kernels
from linework.kernels.tracking.times import moving_sums
from linework.methods.rails import fitted
from linework.methods.rails.circles import Bins, CircleConfig
from linework.model.settings import Settings, setting

#: Height of a bin of the profile. [m]
BIN_M = kernels.DEPTH_BIN_M
#: First bin below the top edge.
TOP_BIN = round(kernels.DEPTH_ABOVE_M / BIN_M)
#: Range of bins, from the first below the top edge, over which the density of the sheet is taken: its upper 20 cm.
_SHEET_BINS = (0, 4)
#: Range of bins that is to be empty above the sheet: 10 to 25 cm above its top.
_ABOVE_BINS = (-5, -2)
#: Range of bins below the sheet, of which the clearest two neighbours count: 30 to 70 cm below the top.
_BELOW_BINS = (6, 14)
#: Height of the apron that the kernel counts points in: 0.36 to 0.62 m below the top. [m]
_APRON_HEIGHT_M = 0.26
#: Half width of the sheet about a line, in radii of a circle; and of its surroundings. [1, m]
SHEET_RADII, SIDE_REACH_M = 1.25, 1.0
#: Stations over which points below the sheet are pooled: 1.25 m to either side.
_OPEN_STATIONS = 5
#: A half of the sheet with points beside it in more than this share of stations may be filled from behind.
_BEHIND_SHARE = 0.5


@dataclass(frozen=True, slots=True, kw_only=True)
class ProfileConfig(Settings):
    """Limits that tell a guardrail from everything else. Ratios are densities of points against the beam's own."""

    window_m: float = setting(
        6.0,
        unit="m",
        reason="three posts at the closest spacing: enough points, still local",
        low=0.5,
        high=50,
    )
    min_spread_m: float = setting(
        0.018,
        unit="m",
        reason="a beam 8 cm deep spreads 2.3 cm without noise; a handrail's tube 1.5 cm",
        low=0,
        high=1,
    )
    min_plate_m: float = setting(
        0.22,
        unit="m",
        reason="height of a beam too flat for its spread to show; boards are up to 0.2 m",
        low=0,
        high=5,
    )
    max_spread_m: float = setting(
        0.040,
        unit="m",
        reason="the beam with 2 cm noise: 3.5 cm; a filled strip of 20 cm: 5.8 cm",
        low=0.005,
        high=1,
    )
    max_above: float = setting(
        0.30, unit="ratio", reason="above a rail there is nothing, or the thin edge of a bush", low=0, high=10
    )
    max_below: float = setting(
        0.35, unit="ratio", reason="below a beam stand posts (10 cm every 2 m) and grass", low=0, high=10
    )
    min_beam_m: float = setting(
        0.12, unit="m", reason="a W-beam is 0.31 m; half of it may be hidden", low=0, high=5
    )
    max_beam_m: float = setting(
        0.45,
        unit="m",
        reason="a W-beam is 0.31 m, and two bins of blur; a car's door 0.5 m and more",
        low=0,
        high=5,
    )
    min_top_m: float = setting(
        0.35, unit="m", reason="the lowest rails in use, less 0.15 m of verge", low=0, high=5
    )
    max_top_m: float = setting(1.30, unit="m", reason="bridge rails, and 0.15 m of verge", low=0, high=5)
    max_wobble: float = setting(
        1.6,
        unit="sigma",
        reason="top edges of rails are straight; bonnets, bushes and hedges are not",
        low=0,
        high=99,
    )
    max_front: float = setting(
        0.5,
        unit="share",
        reason="on its road side a rail stands free, where a hedge has twigs on both",
        low=0,
        high=1,
    )
    min_open: float = setting(
        0.6,
        unit="share",
        reason="below a beam the ground behind is seen; behind a car or wall it is not",
        low=0,
        high=1,
    )
    max_apron: float = setting(
        0.35,
        unit="ratio",
        reason="before a rail's foot is nothing; a concrete barrier slopes out there",
        low=0,
        high=9,
    )
    max_second: float = setting(
        0.50,
        unit="ratio",
        reason="no second row of points stands over or under a beam: fences have boards there",
        low=0,
        high=9,
    )
    max_wander: float = setting(
        1.45,
        unit="sigma",
        reason="across its line a beam lies still to what its points' number allows",
        low=0,
        high=99,
    )
    max_rough: float = setting(
        0.8,
        unit="ratio",
        reason="spread, wobble and wander against their limits, together: foliage is near all",
        low=0,
        high=9,
    )
    min_core: float = setting(
        0.5,
        unit="share",
        reason="of a rail at least half must be surely one; the rest may run on",
        low=0,
        high=1,
    )
    min_length_m: float = setting(6.0, unit="m", reason="a car is 4 to 5 m long, one rail section 4 m", low=0)
    min_closed_length_m: float = setting(
        20.0, unit="m", reason="of a rail with no ground behind it, as on a bridge; a bus is 18 m long", low=0
    )
    max_run_on_m: float = setting(
        12.0, unit="m", reason="the usual buried end; a bush over a rail is shorter", low=0, high=1000
    )
    pair_m: float = setting(
        3.0,
        unit="m",
        reason="the two rails of a median: on one post 0.2 m apart, on two rows up to 3 m",
        low=0,
        high=20,
    )


@dataclass(frozen=True, slots=True)
class VerticalProfile:
    """Measurements along lines, (n,) each over a moving window.

    Parameters
    ----------
    offset_m
        Mean offset of the station's sheet from the node; NaN where the station is empty. [m]
    top_m
        Top edge of the station; NaN where none. [m, above the origin of the bins]
    number
        Points of the station's sheet.
    spread_m, above, below, beam_m
        Thickness of the sheet [m]; densities above it and in the clearest 10 cm below it, against its own; its
        height [m].
    front, open_
        Shares of stations with points at the sheet's heights on its emptier side; and with points
        below the sheet within 1.25 m along on the side where there are fewer.
    apron
        Density between ground and sheet within 0.40 m before it on the road side, against the sheet's.
    edge_m
        Mean offset of the points just below the top edge; NaN where none. [m]
    rows
        (n, DEPTH_BINS) densities per 5 cm below the top edge against the sheet's, of the clearer half.
    all_rows
        The same for both halves.
    offsets
        (n_lines + 1,) int64: line i has the stations from offsets[i] to offsets[i + 1].
    window
        Number of stations in the moving window.
    """

    offset_m: FloatArray
    top_m: FloatArray
    number: FloatArray
    spread_m: FloatArray
    above: FloatArray
    below: FloatArray
    beam_m: FloatArray
    front: FloatArray
    open_: FloatArray
    apron: FloatArray
    edge_m: FloatArray
    rows: FloatArray
    all_rows: FloatArray
    offsets: IntArray
    window: int

    def split(self) -> list[VerticalProfile]:
        """Return the profile of each line."""
        return [
            replace(
                self, offsets=np.array([0, b - a]), **{name: getattr(self, name)[a:b] for name in _COLUMNS}
            )
            for a, b in pairwise(self.offsets.tolist())
        ]

    @classmethod
    def joined(cls, profiles: list[VerticalProfile]) -> VerticalProfile:
        """Return the profiles of one or more lines, measured with the same window, as one."""
        columns: dict[str, Any] = {
            name: np.concatenate([getattr(p, name) for p in profiles]) for name in _COLUMNS
        }
        return replace(profiles[0], offsets=offsets_of([len(p.number) for p in profiles]), **columns)


_COLUMNS = tuple(f.name for f in fields(VerticalProfile) if f.name not in ("offsets", "window"))


def measure_profile(
    nodes: FloatArray,
    offsets: IntArray,
    bins: Bins,
    circles: CircleConfig,
    config: ProfileConfig,
    edge: kernels.EdgeShape = kernels.W_BEAM_EDGE,
) -> VerticalProfile:
    """Measure the profile at the nodes of lines.

    Parameters
    ----------
    nodes
        (n, 4) x, y [m], heading [rad] and top z [m].
    offsets
        (n_lines + 1,) int64: where the nodes of each line begin.
    edge
        What is below the top edge.
    """
    sheet, depth, sides, edge_m = kernels.profile_along(
        bins.points,
        bins.starts,
        bins.n_x,
        bins.n_y,
        bins.cell_m,
        np.ascontiguousarray(nodes[:, :4]),
        circles.spacing_m / 2,
        SHEET_RADII * circles.radius_m,
        SIDE_REACH_M,
        edge,
        bins.work,
    )
    window = 2 * round(0.5 * config.window_m / circles.spacing_m) + 1  # odd: the same in both directions
    number = sheet[:, kernels.SHEET_POINTS]
    halves = moving_sum(depth, window, offsets)
    density = np.mean(halves[:, :, TOP_BIN + _SHEET_BINS[0] : TOP_BIN + _SHEET_BINS[1]], axis=2)
    ratio = halves / np.maximum(density, 1e-9)[:, :, None]
    above = np.mean(ratio[:, :, TOP_BIN + _ABOVE_BINS[0] : TOP_BIN + _ABOVE_BINS[1]], axis=2)
    low, high = TOP_BIN + _BELOW_BINS[0], TOP_BIN + _BELOW_BINS[1]
    clear = 0.5 * (ratio[:, :, low : high - 1] + ratio[:, :, low + 1 : high])
    below = np.min(clear, axis=2)
    # A hedge behind a rail fills the half of the sheet on its side: the clearer half counts
    enough = density >= fitted.LEAST_HALF * np.sum(density, axis=1, keepdims=True)
    unclear = np.where(enough, above / config.max_above + below / config.max_below, np.inf)
    # Of two equal ones the denser: left and right depend on the direction of the line
    half = np.lexsort((-density, unclear), axis=1)[:, 0]
    at = np.arange(len(half)), half
    square = moving_sum(number * sheet[:, kernels.SHEET_SPREAD] ** 2, window, offsets)
    square = square / np.maximum(moving_sum(number, window, offsets), 1e-9)
    # The road side shows more ground; points before the foot of the sheet there are the slope of a barrier
    ground = moving_sum(sides[:, kernels.SIDE_GROUND], window, offsets)
    apron = moving_sum(sides[:, kernels.SIDE_APRON], window, offsets)
    road = (ground == np.max(ground, axis=1, keepdims=True)).astype(np.float64)
    apron = np.sum(apron * road, axis=1) / np.sum(road, axis=1) * (BIN_M / _APRON_HEIGHT_M)
    apron = apron / np.maximum(np.sum(density, axis=1), 1e-9)
    empty = number == 0
    # Height of the sheet over both halves, unless something behind fills the other half far down
    beside = moving_mean(sides[:, kernels.SIDE_AT_SHEET] > 0, window, offsets)
    behind = np.max(beside, axis=1)
    both = np.sum(halves, axis=1) / np.maximum(np.sum(density, axis=1), 1e-9)[:, None]
    beam = _beam_height(both)
    return VerticalProfile(
        offset_m=np.where(empty, np.nan, sheet[:, kernels.SHEET_OFFSET]),
        top_m=sheet[:, kernels.SHEET_TOP],
        number=number,
        spread_m=np.sqrt(square),
        above=above[at],
        below=below[at],
        beam_m=np.where(
            (beam <= config.max_beam_m) | (behind <= _BEHIND_SHARE), beam, _beam_height(ratio[at])
        ),
        front=np.min(beside, axis=1),
        open_=np.min(
            moving_mean(
                moving_sum(sides[:, kernels.SIDE_BELOW], _OPEN_STATIONS, offsets) > 0.5, window, offsets
            ),
            axis=1,
        ),
        apron=apron,
        edge_m=edge_m,
        rows=ratio[at],
        all_rows=both,
        offsets=offsets,
        window=window,
    )


def moving_sum(values: AnyArray, window: int, offsets: IntArray) -> FloatArray:
    """Return moving sums over `window` stations (an odd number) along each line, of the shape of `values` (n, ...).

    Nothing is added beyond the ends of a line; `offsets` (n_lines + 1,) int64 is where its stations begin.

    >>> moving_sum(np.array([1, 0, 2, 0, 4, 9]), 3, np.array([0, 5, 6])).tolist()
    [1.0, 3.0, 2.0, 6.0, 4.0, 9.0]
    """
    flat = np.ascontiguousarray(values, dtype=np.float64).reshape(len(values), -1)
    return np.asarray(moving_sums(flat, offsets, window // 2).reshape(values.shape))


def moving_mean(values: AnyArray, window: int, offsets: IntArray) -> FloatArray:
    """Return moving means over `window` stations along each line, of those that exist; see `moving_sum`."""
    total = moving_sum(np.ones(len(values)), window, offsets)
    return np.asarray((moving_sum(values, window, offsets).T / total).T)


def _beam_height(ratio: FloatArray) -> FloatArray:
    """Return the depth (n,) at which the density first stays below 0.4 of the beam's for 15 cm. [m].

    15 cm, because one half of the sheet of a W-beam holds its two crests, the other the valley between them.
    """
    filled = ratio[:, TOP_BIN:] >= fitted.SHEET_FILLED
    gap = ~(filled[:, :-2] | filled[:, 1:-1] | filled[:, 2:])
    first = np.where(gap.any(axis=1), np.argmax(gap, axis=1), gap.shape[1])
    return np.asarray(first * BIN_M)
