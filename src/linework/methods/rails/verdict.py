"""What a followed sheet of points is, by its vertical profile: guardrail, concrete barrier, or neither."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from linework.arrays import AnyArray, FloatArray, IntArray
from linework.methods.rails.profile import (
    BIN_M,
    TOP_BIN,
    ProfileConfig,
    VerticalProfile,
    moving_mean,
    moving_sum,
)


@dataclass(frozen=True, slots=True)
class NodeScores:
    """What a line is, node by node: each (n,) from 0 to 1.

    Parameters
    ----------
    guardrail, barrier
        How sure.
    goes_on
        How sure that it is the same sheet still: a rail that is sure in one place goes on over bushes and
        down to its buried end, where its height and its clear gap tell nothing.
    open_
        (n,) bool: the ground behind is seen below it.
    """

    guardrail: FloatArray
    barrier: FloatArray
    goes_on: FloatArray
    open_: AnyArray

    def split(self, offsets: IntArray) -> list[NodeScores]:
        """Return the verdict on each line: on line i from offsets[i] to offsets[i + 1]."""
        columns = self.guardrail, self.barrier, self.goes_on, self.open_
        return [NodeScores(*(column[a:b] for column in columns)) for a, b in pairwise(offsets.tolist())]


def classify(
    profile: VerticalProfile,
    wobble: FloatArray,
    height_m: FloatArray,
    above_ground_m: FloatArray,
    paired: AnyArray,
    config: ProfileConfig,
) -> NodeScores:
    """Return how sure it is at every node that this is a guardrail or a barrier, and that it goes on.

    Parameters
    ----------
    wobble
        (n,) float64: how far each station's top is from the fitted edge, in sigmas; NaN where unknown.
    height_m, above_ground_m
        (n,) float64: height of the top edge above the road, and above the ground below it.
    paired
        (n,) bool: a guardrail runs close beside it. Of the second beam on a post only the upper edge is
        seen, over the first: its height and depth say nothing then, nor does what stands before it.

    """
    window, ends = profile.window, profile.offsets
    known = ~np.isnan(wobble)
    square = np.where(known, np.minimum(np.nan_to_num(wobble), 4.0) ** 2, 0.0)
    unrest = np.sqrt(moving_sum(square, window, ends) / np.maximum(moving_sum(known, window, ends), 1.0))
    occupied = moving_mean(profile.number >= 2, window, ends)
    allowed = np.hypot(profile.spread_m / np.sqrt(np.maximum(profile.number, 1.0)), 0.005)
    swerve = np.where(
        profile.number > 0, np.minimum(np.abs(np.nan_to_num(profile.offset_m)) / allowed, 4.0), 0.0
    )
    wander = np.sqrt(moving_mean(swerve**2, window, ends))
    rough = np.sqrt(
        (
            (profile.spread_m / config.max_spread_m) ** 2
            + (unrest / config.max_wobble) ** 2
            + (wander / config.max_wander) ** 2
        )
        / 3
    )
    # Each test as a margin: 1 well inside the limit, 0.5 at it, 0 well outside
    goes_on = _least(
        _below(profile.spread_m, 1.15 * config.max_spread_m, 0.003),
        _below(unrest, 1.6 * config.max_wobble, 0.15),
        _below(wander, 1.6 * config.max_wander, 0.15),
        _below(-occupied, -0.4, 0.08),
        _below(height_m, config.max_top_m, 0.03),
    )
    beam = _least(
        goes_on,
        _below(rough, config.max_rough, 0.03),
        _below(profile.beam_m, config.max_beam_m, 0.03),
        _below(profile.above, config.max_above, 0.06),
        _below(profile.below, config.max_below, 0.08),
        _below(profile.apron, config.max_apron, 0.05),
        _below(_row_under(profile.rows, above_ground_m), config.max_second, 0.06),
        _below(-height_m, -config.min_top_m, 0.03),
    )
    # A tube is neither deep nor high; a beam is one of both, as a corrugated or a flat plate
    deep = np.maximum(
        _below(-profile.spread_m, -config.min_spread_m, 0.002),
        _below(-profile.beam_m, -config.min_plate_m, 0.02),
    )
    lone = _below(_row_over(profile.rows), config.max_second, 0.06)
    whole = _below(-occupied, -0.6, 0.08)  # the posts behind a beam fill less
    alone = _least(
        beam,
        deep,
        lone,
        _below(-profile.beam_m, -config.min_beam_m, 0.02),
        _below(profile.front, config.max_front, 0.08),
        np.where(paired, whole, 1.0),
    )
    lip = np.minimum(lone, _below(profile.beam_m, config.min_beam_m, 0.02))
    beside = _least(beam, np.maximum(deep, lip), whole, paired.astype(np.float64))
    barrier = _least(
        goes_on,
        _below(rough, config.max_rough, 0.03),
        _below(profile.above, config.max_above, 0.06),
        # Its lower face stands out before the upper one; the face of a hedge or a wall goes on below
        _below(profile.below, 1.5 * config.max_below, 0.08),
        _below(profile.front, config.max_front, 0.08),
        _below(-profile.apron, -1.5 * config.max_apron, 0.05),
        _below(profile.open_, config.min_open, 0.1),
        _below(-height_m, -1.5 * config.min_top_m, 0.03),
    )
    return NodeScores(
        guardrail=np.maximum(alone, beside),
        barrier=barrier,
        goes_on=goes_on,
        open_=profile.open_ >= config.min_open,
    )


def _least(*margins: FloatArray) -> FloatArray:
    return np.asarray(np.min(np.stack(margins), axis=0))


def _row_over(rows: FloatArray) -> FloatArray:
    """Densest 10 cm from 0.10 m over the top edge up."""
    return np.asarray(np.max(0.5 * (rows[:, 1 : TOP_BIN - 1] + rows[:, : TOP_BIN - 2]), axis=1))


def _row_under(rows: FloatArray, above_ground_m: FloatArray) -> FloatArray:
    """Densest 10 cm from 0.36 m under the top edge down to 0.20 m above the ground."""
    depth = (np.arange(rows.shape[1]) - TOP_BIN + 1) * BIN_M  # lower edge of each bin
    under = (depth > 0.36 + BIN_M) & (depth <= above_ground_m[:, None] - 0.20)
    pairs = 0.5 * (rows[:, 1:] + rows[:, :-1])
    return np.asarray(np.max(np.where(under[:, 1:] & under[:, :-1], pairs, 0.0), axis=1))


def _below(value: FloatArray, limit: float | FloatArray, width: float) -> FloatArray:
    return np.asarray(1.0 / (1.0 + np.exp(np.clip((value - limit) / width, -30, 30))))
