"""Classify a followed sheet of points by its vertical profile: guardrail, concrete barrier, or neither."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from linework.arrays import AnyArray, FloatArray, IntArray
from linework.methods.rails import fitted
from linework.methods.rails.profile import (
    BIN_M,
    TOP_BIN,
    ProfileConfig,
    VerticalProfile,
    moving_mean,
    moving_sum,
)

#: Deviations beyond this count as this: one stray point must not decide a window. [sigma]
MOST_SIGMAS = 4.0
#: Least standard deviation of a station's mean offset: the shape of the corrugation. [m]
LEAST_OFFSET_SIGMA_M = 0.005
#: Fewest points of an occupied station.
OCCUPIED_POINTS = 2
#: Exponent at which the logistic function is cut off: 1e-13, so that it cannot overflow.
_MOST_EXPONENT = 30
#: A second row begins this deep under the top edge, below a W-beam and its noise [m]; and ends this high above the
#: ground, above grass [m].
SECOND_DEPTH_M, SECOND_GROUND_M = 0.36, 0.20


@dataclass(frozen=True, slots=True)
class NodeScores:
    """Scores of the nodes of lines, (n,) each from 0 to 1; 0.5 is at the limit.

    Parameters
    ----------
    guardrail, barrier
        That the sheet is one.
    goes_on
        That it is still the same sheet: a rail that is certain in one place continues over bushes and down to its
        buried end, where its height and its clear gap say nothing.
    steady
        That it lies on one line and has one top edge, as far as its points can show, whatever it is.
    open_
        (n,) bool: the ground behind is visible below it.
    """

    guardrail: FloatArray
    barrier: FloatArray
    goes_on: FloatArray
    steady: FloatArray
    open_: AnyArray

    def split(self, offsets: IntArray) -> list[NodeScores]:
        """Return the scores of each line: line i has the nodes from offsets[i] to offsets[i + 1]."""
        columns = self.guardrail, self.barrier, self.goes_on, self.steady, self.open_
        return [NodeScores(*(column[a:b] for column in columns)) for a, b in pairwise(offsets.tolist())]


def classify(
    profile: VerticalProfile,
    wobble: FloatArray,
    height_m: FloatArray,
    above_ground_m: FloatArray,
    paired: AnyArray,
    config: ProfileConfig,
) -> NodeScores:
    """Return the scores of every node for a guardrail, a barrier, and the continuation of the sheet.

    Parameters
    ----------
    profile
        Of all lines.
    wobble
        (n,) distance of each station's top from the fitted edge; NaN where unknown. [sigma]
    height_m, above_ground_m
        (n,) height of the top edge above the road, and above the ground below it. [m]
    paired
        (n,) bool: a guardrail runs close beside it. Only the upper edge of the second beam on a post is visible,
        over the first: its height and depth say nothing then, nor does what stands before it.
    config
        Limits of the tests.
    """
    window, ends = profile.window, profile.offsets
    known = ~np.isnan(wobble)
    square = np.where(known, np.minimum(np.nan_to_num(wobble), MOST_SIGMAS) ** 2, 0.0)
    unrest = np.sqrt(moving_sum(square, window, ends) / np.maximum(moving_sum(known, window, ends), 1.0))
    occupied = moving_mean(profile.number >= OCCUPIED_POINTS, window, ends)
    allowed = np.hypot(profile.spread_m / np.sqrt(np.maximum(profile.number, 1.0)), LEAST_OFFSET_SIGMA_M)
    swerve = np.where(
        profile.number > 0, np.minimum(np.abs(np.nan_to_num(profile.offset_m)) / allowed, MOST_SIGMAS), 0.0
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
    # Each test as a margin: 1 well within the limit, 0.5 at it, 0 well beyond
    steady = _least(
        _below(unrest, fitted.CONTINUES_WOBBLE * config.max_wobble, fitted.WOBBLE_WIDTH),
        _below(wander, fitted.CONTINUES_WANDER * config.max_wander, fitted.WOBBLE_WIDTH),
        _below(-occupied, -fitted.CONTINUES_OCCUPIED, fitted.OCCUPIED_WIDTH),
    )
    goes_on = _least(
        steady,
        _below(profile.spread_m, fitted.CONTINUES_SPREAD * config.max_spread_m, fitted.SPREAD_WIDTH_M),
        _below(height_m, config.max_top_m, fitted.TOP_EDGE_WIDTH_M),
    )
    is_smooth = _below(rough, config.max_rough, fitted.ROUGH_WIDTH)
    is_free_above = _below(profile.above, config.max_above, fitted.ABOVE_WIDTH)
    beam = _least(
        goes_on,
        is_smooth,
        _below(profile.beam_m, config.max_beam_m, fitted.BEAM_WIDTH_M),
        is_free_above,
        _below(profile.below, config.max_below, fitted.BELOW_WIDTH),
        _below(profile.apron, config.max_apron, fitted.APRON_WIDTH),
        _below(_row_under(profile.rows, above_ground_m), config.max_second, fitted.SECOND_WIDTH),
        _below(-height_m, -config.min_top_m, fitted.TOP_EDGE_WIDTH_M),
    )
    # A tube is neither deep nor high; a beam is at least one of both: a W-beam deep, a flat plate high
    deep = np.maximum(
        _below(-profile.spread_m, -config.min_spread_m, fitted.DEEP_WIDTH_M),
        _below(-profile.beam_m, -config.min_plate_m, fitted.LOW_BEAM_WIDTH_M),
    )
    lone = _below(_row_over(profile.rows), config.max_second, fitted.SECOND_WIDTH)
    # The posts behind a beam fill less
    whole = _below(-occupied, -fitted.WHOLE_OCCUPIED, fitted.OCCUPIED_WIDTH)
    is_free_in_front = _below(profile.front, config.max_front, fitted.FRONT_WIDTH)
    alone = _least(
        beam,
        deep,
        lone,
        _below(-profile.beam_m, -config.min_beam_m, fitted.LOW_BEAM_WIDTH_M),
        is_free_in_front,
        np.where(paired, whole, 1.0),
    )
    lip = np.minimum(lone, _below(profile.beam_m, config.min_beam_m, fitted.LOW_BEAM_WIDTH_M))
    beside = _least(beam, np.maximum(deep, lip), whole, paired.astype(np.float64))
    barrier = _least(
        goes_on,
        is_smooth,
        is_free_above,
        # Its lower face stands out before the upper one; the face of a hedge or a wall continues below
        _below(profile.below, fitted.BARRIER_BELOW * config.max_below, fitted.BELOW_WIDTH),
        is_free_in_front,
        _below(-profile.apron, -fitted.BARRIER_APRON * config.max_apron, fitted.APRON_WIDTH),
        _below(profile.open_, config.min_open, fitted.OPEN_WIDTH),
        _below(-height_m, -fitted.BARRIER_TOP * config.min_top_m, fitted.TOP_EDGE_WIDTH_M),
    )
    return NodeScores(
        guardrail=np.maximum(alone, beside),
        barrier=barrier,
        goes_on=goes_on,
        steady=steady,
        open_=profile.open_ >= config.min_open,
    )


def _least(*margins: FloatArray) -> FloatArray:
    """Return the least of several margins (n,) at each node."""
    return np.asarray(np.min(np.stack(margins), axis=0))


def _row_over(rows: FloatArray) -> FloatArray:
    """Return the density (n,) of the densest 10 cm from 0.10 m above the top edge upwards."""
    return np.asarray(np.max(0.5 * (rows[:, 1 : TOP_BIN - 1] + rows[:, : TOP_BIN - 2]), axis=1))


def _row_under(rows: FloatArray, above_ground_m: FloatArray) -> FloatArray:
    """Return the density (n,) of the densest 10 cm from 0.36 m below the top edge to 0.20 m above the ground."""
    depth = (np.arange(rows.shape[1]) - TOP_BIN + 1) * BIN_M  # lower edge of each bin
    under = (depth > SECOND_DEPTH_M + BIN_M) & (depth <= above_ground_m[:, None] - SECOND_GROUND_M)
    pairs = 0.5 * (rows[:, 1:] + rows[:, :-1])
    return np.asarray(np.max(np.where(under[:, 1:] & under[:, :-1], pairs, 0.0), axis=1))


def _below(value: FloatArray, limit: float | FloatArray, width: float) -> FloatArray:
    """Return the margin (n,) of values below a limit: the logistic function of (limit - value) / width."""
    exponent = np.clip((value - limit) / width, -_MOST_EXPONENT, _MOST_EXPONENT)
    return np.asarray(1.0 / (1.0 + np.exp(exponent)))
