"""Local fits of followed chains: plan, vertical profile, top edge."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise, starmap

import numpy as np

from linework.arrays import BoolArray, FloatArray, IntArray, distance_along, offsets_of
from linework.kernels.radon import sections as kernels
from linework.methods.rails import fitted
from linework.methods.rails.circles import Bins, CircleConfig
from linework.methods.rails.profile import ProfileConfig, VerticalProfile, measure_profile

#: Weight of a node without points, against one per point: keeps the fit defined over gaps.
_EMPTY_WEIGHT = 1e-3
#: The same for tops, whose weights are at most 1.
_EMPTY_TOP_WEIGHT = 1e-4
#: Systematic error of a fit: the face's shape between crest and valley, the spacing of returns at the edge. [m]
_FLOOR_SIGMA_M = 0.010
#: Unknowns of a local fit, a quadratic.
_UNKNOWNS = 3
#: Fits of the top edge without the outliers of the fit before.
_TOP_ROUNDS = 2
#: Columns of a chain: x, y, top z [m], number of points, measured (1) or predicted (0).
_TOP, _POINTS, _MEASURED = 2, 3, 4


@dataclass(frozen=True, slots=True)
class FittedRail:
    """A followed sheet after its local fits: nodes at a fixed spacing, in local coordinates of the bins.

    Parameters
    ----------
    xy, edge_xy
        (n, 2) middle of the sheet, the line of a beam; and top edge, the line of a barrier. [m]
    top_m
        (n,) z of the top edge. [m]
    sigma_xy_m, sigma_z_m
        (n,) standard deviations across and in height. [m]
    measured
        (n,) bool: the station has points.
    wobble
        (n,) distance of the station's top from the fitted edge; NaN where unknown. [sigma]
    profile
        The vertical profile.
    """

    xy: FloatArray
    edge_xy: FloatArray
    top_m: FloatArray
    sigma_xy_m: FloatArray
    sigma_z_m: FloatArray
    measured: BoolArray
    wobble: FloatArray
    profile: VerticalProfile


def fit_rail(chain: FloatArray, bins: Bins, circles: CircleConfig, config: ProfileConfig) -> FittedRail:
    """Fit one chain; see `fit_rails`."""
    return fit_rails([chain], bins, circles, config)[0]


def fit_rails(
    chains: list[FloatArray],
    bins: Bins,
    circles: CircleConfig,
    config: ProfileConfig,
    edge: kernels.EdgeShape = kernels.W_BEAM_EDGE,
) -> list[FittedRail]:
    """Fit chains locally in plan, measure their profiles, and fit the top edge to the highest points.

    Two rounds in plan: the first turns the stations square to the line, the second centres it on the sheet.

    Parameters
    ----------
    chains
        (n, 5) each, as `chains_from_starts` returns them.
    bins
        The points.
    edge
        What is below the top edge.

    References
    ----------
    Manandhar and Shibasaki (2002), "Line Detection by Radon Transformation": the corrected centres "are fitted
    locally".
    """
    if not chains:
        return []
    # Chains are many and short: all are fitted at once, each on its own
    chain, offsets = np.concatenate(chains), offsets_of([len(c) for c in chains])
    lines = _Lines(np.concatenate([distance_along(c) for c in chains]), offsets, circles.fit_window_m)
    weight = np.minimum(chain[:, _POINTS], fitted.MOST_WEIGHT_POINTS) * chain[:, _MEASURED] + _EMPTY_WEIGHT
    xy, heading, *_ = lines.fit_plan(chain[:, :2], weight)
    top, *_ = lines.fit(chain[:, _TOP], weight)
    profile = measure_profile(np.column_stack([xy, heading, top]), offsets, bins, circles, config, edge)

    # Centre the line on the sheet's points
    known = profile.number > 0
    left = np.column_stack([-np.sin(heading), np.cos(heading)])
    weight = np.where(known, np.minimum(profile.number, fitted.MOST_WEIGHT_POINTS), 0.0) + _EMPTY_WEIGHT
    at_edge = np.where(np.isnan(profile.edge_m), np.nan_to_num(profile.offset_m), profile.edge_m)
    edge_xy, *_ = lines.fit_plan(xy + at_edge[:, None] * left, weight)
    xy, _, rms, effective = lines.fit_plan(xy + np.nan_to_num(profile.offset_m)[:, None] * left, weight)

    # The top edge lies above the highest of n points spread over the sheet, as deep as they were counted, by its height
    # / (n + 1)
    seen = known & ~np.isnan(profile.top_m)
    depth = np.minimum(profile.beam_m, kernels.SHEET_BELOW_M)
    deficit = np.where(seen, depth / (profile.number + 1.0), 0.0)
    z = np.where(seen, profile.top_m + deficit, top)
    scatter = np.hypot(deficit, fitted.TOP_NOISE_M)
    weight = np.where(seen, (fitted.TOP_NOISE_M / scatter) ** 2, _EMPTY_TOP_WEIGHT)
    top, _, rms_z, effective_z = lines.fit(z, weight)
    for _ in range(_TOP_ROUNDS):
        kept = seen & (np.abs(z - top) < fitted.TOP_OUTLIER * scatter)
        top, _, rms_z, effective_z = lines.fit(z, np.where(kept, weight, _EMPTY_TOP_WEIGHT))
    sigma_xy = np.hypot(rms / np.sqrt(np.maximum(effective - _UNKNOWNS, 1)), _FLOOR_SIGMA_M)
    sigma_z = np.hypot(rms_z / np.sqrt(np.maximum(effective_z - _UNKNOWNS, 1)), _FLOOR_SIGMA_M)
    wobble = np.where(seen, np.abs(z - top) / scatter, np.nan)
    return [
        FittedRail(xy[k], edge_xy[k], top[k], sigma_xy[k], sigma_z[k], known[k], wobble[k], own)
        for k, own in zip(starmap(slice, pairwise(offsets.tolist())), profile.split(), strict=True)
    ]


@dataclass(frozen=True, slots=True)
class _Lines:
    """Nodes of lines for local fits.

    Parameters
    ----------
    chainage, offsets
        (n,) distance along its line of each node [m], and (m + 1,) int64: where the nodes of each line begin.
    half_m
        Half of the window of the fits. [m]
    """

    chainage: FloatArray
    offsets: IntArray
    half_m: float

    def fit(
        self, values: FloatArray, weight: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Return values, slopes, rms and effective numbers (n,) of local fits of v(s)."""
        v = np.ascontiguousarray(values)
        fitted: tuple[FloatArray, FloatArray, FloatArray, FloatArray] = kernels.fit_lines_locally(
            self.chainage, v, weight, self.half_m, self.offsets
        )
        return fitted

    def fit_plan(
        self, xy: FloatArray, weight: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Return positions (n, 2), headings, rms across and effective numbers (n,) of local fits of x(s) and y(s)."""
        x, dx, rms_x, effective = self.fit(xy[:, 0], weight)
        y, dy, rms_y, _ = self.fit(xy[:, 1], weight)
        return np.column_stack([x, y]), np.arctan2(dy, dx), np.hypot(rms_x, rms_y), effective
