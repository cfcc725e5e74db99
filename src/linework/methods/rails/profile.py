"""The vertical profile of a followed sheet of points, and what it says the thing is.

A peak in the height band may be a guardrail, but also a row of parked cars, a hedge, a wall or a fence
(the paper leaves them to "further analysis"). A beam guardrail, and nothing else, is a thin sheet 0.2 to
0.4 m high, with a straight top edge, nothing above it, and a clear gap below it where the rays pass on.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from itertools import pairwise
from typing import Any

import numpy as np

from linework.arrays import AnyArray, FloatArray, IntArray
from linework.kernels.radon import corridor as kernels
from linework.kernels.tracking.times import moving_sums
from linework.methods.rails.circles import Bins, CircleConfig
from linework.model.settings import setting

BIN_M = kernels.DEPTH_BIN_M
TOP_BIN = round(kernels.DEPTH_ABOVE_M / BIN_M)  # first bin below the top edge


@dataclass(frozen=True, slots=True, kw_only=True)
class ProfileConfig:
    """What tells a guardrail from all else. Ratios are densities of points against the beam's own."""

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
    """Measurements along lines, each (n,) float64 over a moving window.

    Parameters
    ----------
    offset_m
        Mean offset of the station's sheet from the node; NaN where the station is empty.
    top_m
        Highest supported height of the station [m above the bins' origin]; NaN where none.
    number
        Points of the station's sheet.
    spread_m, above, below, beam_m
        Thickness of the sheet; densities above it and in the clearest 10 cm below it, against the
        sheet's own; its height.
    front, open_
        Shares of stations with points at the sheet's heights on its emptier side; and with points
        below the sheet within 1.25 m along on the side where there are fewer.
    apron
        Density between ground and sheet within 0.40 m before it on the road side, against the sheet's.
    edge_m
        Mean offset of the points just below the top edge; NaN where none.
    rows
        (n, DEPTH_BINS): densities per 5 cm below the top edge against the sheet's, of the clearer half.
    all_rows
        The same of both halves.
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
        """Return the profiles of one or more lines, measured with one window, as one."""
        columns: dict[str, Any] = {
            name: np.concatenate([getattr(p, name) for p in profiles]) for name in _COLUMNS
        }
        return replace(profiles[0], offsets=offsets_of([len(p.number) for p in profiles]), **columns)


_COLUMNS = tuple(f.name for f in fields(VerticalProfile) if f.name not in ("offsets", "window"))


def offsets_of(lengths: list[int]) -> IntArray:
    """Return where lines of these lengths begin, one after the other, and where the last one ends."""
    return np.concatenate([np.zeros(1, dtype=np.int64), np.cumsum(lengths, dtype=np.int64)])


def measure_profile(
    nodes: FloatArray, offsets: IntArray, bins: Bins, circles: CircleConfig, config: ProfileConfig
) -> VerticalProfile:
    """Measure the profile at nodes (n, 4) of lines: x, y, heading, top z; for `offsets` see `VerticalProfile`."""
    sheet, depth, sides, edge = kernels.profile_along(
        bins.points,
        bins.starts,
        bins.n_x,
        bins.n_y,
        bins.cell_m,
        np.ascontiguousarray(nodes[:, :4]),
        circles.spacing_m / 2,
        1.25 * circles.radius_m,
        1.0,
        bins.work,
    )
    window = 2 * round(0.5 * config.window_m / circles.spacing_m) + 1  # the same both ways
    number = sheet[:, 0]
    halves = moving_sum(depth, window, offsets)
    density = np.mean(halves[:, :, TOP_BIN : TOP_BIN + 4], axis=2)
    ratio = halves / np.maximum(density, 1e-9)[:, :, None]
    above = np.mean(ratio[:, :, TOP_BIN - 5 : TOP_BIN - 2], axis=2)
    clear = 0.5 * (ratio[:, :, TOP_BIN + 6 : TOP_BIN + 13] + ratio[:, :, TOP_BIN + 7 : TOP_BIN + 14])
    below = np.min(clear, axis=2)
    # A hedge behind a rail fills the half of the sheet that is turned to it: the clearer half counts
    enough = density >= 0.2 * np.sum(density, axis=1, keepdims=True)
    unclear = np.where(enough, above / config.max_above + below / config.max_below, np.inf)
    # Of two alike the denser one: left and right are one line's, gone through either way
    half = np.lexsort((-density, unclear), axis=1)[:, 0]
    at = np.arange(len(half)), half
    square = moving_sum(number * sheet[:, 2] ** 2, window, offsets)
    square = square / np.maximum(moving_sum(number, window, offsets), 1e-9)
    # The road side shows more ground; what stands before the sheet's foot there is a barrier's slope
    ground, apron = moving_sum(sides[:, 2], window, offsets), moving_sum(sides[:, 3], window, offsets)
    road = (ground == np.max(ground, axis=1, keepdims=True)).astype(np.float64)
    apron = np.sum(apron * road, axis=1) / np.sum(road, axis=1) * (BIN_M / 0.26)
    apron = apron / np.maximum(np.sum(density, axis=1), 1e-9)
    empty = number == 0
    # Its height over both halves, unless something behind it fills the other half far down
    beside = moving_mean(sides[:, 0] > 0, window, offsets)
    behind = np.max(beside, axis=1)
    both = np.sum(halves, axis=1) / np.maximum(np.sum(density, axis=1), 1e-9)[:, None]
    beam = _beam_height(both)
    return VerticalProfile(
        offset_m=np.where(empty, np.nan, sheet[:, 1]),
        top_m=sheet[:, 3],
        number=number,
        spread_m=np.sqrt(square),
        above=above[at],
        below=below[at],
        beam_m=np.where((beam <= config.max_beam_m) | (behind <= 0.5), beam, _beam_height(ratio[at])),
        front=np.min(beside, axis=1),
        open_=np.min(moving_mean(moving_sum(sides[:, 1], 5, offsets) > 0.5, window, offsets), axis=1),
        apron=apron,
        edge_m=edge,
        rows=ratio[at],
        all_rows=both,
        offsets=offsets,
        window=window,
    )


def moving_sum(values: AnyArray, window: int, offsets: IntArray) -> FloatArray:
    """Return the sums over `window` stations about each, an odd number; beyond a line's ends there is nothing.

    >>> moving_sum(np.array([1, 0, 2, 0, 4, 9]), 3, np.array([0, 5, 6])).tolist()
    [1.0, 3.0, 2.0, 6.0, 4.0, 9.0]
    """
    flat = np.ascontiguousarray(values, dtype=np.float64).reshape(len(values), -1)
    return np.asarray(moving_sums(flat, offsets, window // 2).reshape(values.shape))


def moving_mean(values: AnyArray, window: int, offsets: IntArray) -> FloatArray:
    """Return the means over the stations that there are, of `window` about each."""
    total = moving_sum(np.ones(len(values)), window, offsets)
    return np.asarray((moving_sum(values, window, offsets).T / total).T)


def _beam_height(ratio: FloatArray) -> FloatArray:
    """Depth at which the density first stays below 0.4 of the beam's for 15 cm.

    15 cm: one half of a W-beam's sheet holds its two humps, the other the valley between them.
    """
    filled = ratio[:, TOP_BIN:] >= 0.4
    gap = ~(filled[:, :-2] | filled[:, 1:-1] | filled[:, 2:])
    first = np.where(gap.any(axis=1), np.argmax(gap, axis=1), gap.shape[1])
    return np.asarray(first * BIN_M)
