"""Sheets that go on above the edge that was followed: concrete barriers, measured again from their top."""

from __future__ import annotations

import numpy as np

from linework.arrays import FloatArray
from linework.methods.radon.chains import runs
from linework.methods.radon.circles import Bins, CircleConfig
from linework.methods.radon.profile import BIN_M, TOP_BIN, ProfileConfig
from linework.methods.radon.rails import FittedRail, chainage_of, fit_rails
from linework.methods.radon.stretches import within
from linework.methods.radon.verdict import Verdict

#: A sheet goes on where it has this share of its density: the limit below which a beam ends.
FILLED = 0.4
#: What is a guardrail as surely as this is no barrier: the foot of one never is.
CLEAR = 0.9
#: The circles look 3 cm above the edge: a sheet that goes on for two bins more has its edge elsewhere.
LEAST_RAISE_M = 2 * BIN_M
#: Rounds of fits from the new edge: the first moves it by a few centimetres, the second comes to rest.
ROUNDS = 2


def raise_of(rail: FittedRail) -> FloatArray:
    """Return how far above the followed edge the sheet goes on without a gap, (n,) float64 [m]."""
    filled = rail.profile.all_rows[:, TOP_BIN - 1 :: -1] >= FILLED
    return np.where(filled.all(axis=1), 0.0, np.argmin(filled, axis=1) * BIN_M)


def raised_rails(
    rails: list[FittedRail],
    verdicts: list[Verdict],
    bins: Bins,
    circles: CircleConfig,
    config: ProfileConfig,
) -> list[FittedRail]:
    """Return what may be barriers, fitted again from where the sheet really ends above.

    The face of a barrier is as high as a beam over its foot, too, and starts are found there. No more of a
    chain is taken than the shortest barrier away from where it may be one.
    """
    chains = []
    for rail, verdict in zip(rails, verdicts, strict=True):
        higher = raise_of(rail)
        may_be = (verdict.barrier >= 0.5) | ((higher >= LEAST_RAISE_M) & (verdict.goes_on >= 0.5))
        near = within(may_be & (verdict.guardrail < CLEAR), chainage_of(rail.xy), config.min_closed_length_m)
        chain = _chain_of(rail, rail.top_m + higher)
        chains += [chain[run] for run in runs(near, round(config.min_closed_length_m / circles.spacing_m))]
    fitted = fit_rails(chains, bins, circles, config)
    for _ in range(ROUNDS - 1):
        fitted = fit_rails([_chain_of(rail, rail.top_m) for rail in fitted], bins, circles, config)
    return fitted


def _chain_of(rail: FittedRail, top_m: FloatArray) -> FloatArray:
    return np.column_stack([rail.xy, top_m, rail.profile.number, rail.measured])
