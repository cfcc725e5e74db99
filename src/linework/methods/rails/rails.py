"""Rails from the points: the local fits of followed chains."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise, starmap

import numpy as np

from linework.arrays import BoolArray, FloatArray, IntArray
from linework.kernels.radon import corridor as kernels
from linework.methods.rails.circles import Bins, CircleConfig
from linework.methods.rails.profile import ProfileConfig, VerticalProfile, measure_profile, offsets_of


@dataclass(frozen=True, slots=True)
class FittedRail:
    """A followed sheet after its local fits: nodes at a fixed spacing, local coordinates of the bins.

    `xy` is the middle of the sheet, what a beam's line is; `edge_xy` the top edge, what a barrier's is.
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
    chains: list[FloatArray], bins: Bins, circles: CircleConfig, config: ProfileConfig
) -> list[FittedRail]:
    """Fit the circles' centres (see `follow_all`) locally, measure the profile, and fit the top edge from its highest points.

    Two rounds in plan: the first turns the stations square to the line, the second centres it on the
    sheet. References: Manandhar and Shibasaki (2002): the corrected centres "are fitted locally".
    """
    if not chains:
        return []
    # Chains are many and short: all are worked at once, each for itself
    chain, offsets = np.concatenate(chains), offsets_of([len(c) for c in chains])
    lines = _Lines(np.concatenate([node_chainage(c[:, :2]) for c in chains]), offsets, circles.fit_window_m)
    weight = np.minimum(chain[:, 3], 10.0) * chain[:, 4] + 1e-3
    xy, heading, *_ = lines.fit_plan(chain[:, :2], weight)
    top, *_ = lines.fit(chain[:, 2], weight)
    profile = measure_profile(np.column_stack([xy, heading, top]), offsets, bins, circles, config)

    # Centre the line on the sheet's points
    known = profile.number > 0
    left = np.column_stack([-np.sin(heading), np.cos(heading)])
    weight = np.where(known, np.minimum(profile.number, 10.0), 0.0) + 1e-3
    at_edge = np.where(np.isnan(profile.edge_m), np.nan_to_num(profile.offset_m), profile.edge_m)
    edge_xy, *_ = lines.fit_plan(xy + at_edge[:, None] * left, weight)
    xy, _, rms, effective = lines.fit_plan(xy + np.nan_to_num(profile.offset_m)[:, None] * left, weight)

    # The top edge lies above the highest of n returns spread over the sheet, by its height / (n + 1)
    seen = known & ~np.isnan(profile.top_m)
    deficit = np.where(seen, profile.beam_m / (profile.number + 1.0), 0.0)
    z = np.where(seen, profile.top_m + deficit, top)
    scatter = np.hypot(deficit, 0.015)
    weight = np.where(seen, (0.015 / scatter) ** 2, 1e-4)
    top, _, rms_z, effective_z = lines.fit(z, weight)
    for _ in range(2):  # again without what bushes and gaps left
        kept = seen & (np.abs(z - top) < 2.5 * scatter)
        top, _, rms_z, effective_z = lines.fit(z, np.where(kept, weight, 1e-4))
    # a centimetre of each: the face's shape between crest and valley, the spacing of returns at the edge
    sigma_xy = np.hypot(rms / np.sqrt(np.maximum(effective - 3, 1)), 0.010)
    sigma_z = np.hypot(rms_z / np.sqrt(np.maximum(effective_z - 3, 1)), 0.010)
    wobble = np.where(seen, np.abs(z - top) / scatter, np.nan)
    return [
        FittedRail(xy[k], edge_xy[k], top[k], sigma_xy[k], sigma_z[k], known[k], wobble[k], own)
        for k, own in zip(starmap(slice, pairwise(offsets.tolist())), profile.split(), strict=True)
    ]


@dataclass(frozen=True, slots=True)
class _Lines:
    """Nodes of lines: arc length of each, where each line's begin, and half of the window of local fits."""

    chainage: FloatArray
    offsets: IntArray
    half_m: float

    def fit(
        self, values: FloatArray, weight: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Values, slopes, rms and effective numbers of local fits of v(s)."""
        v = np.ascontiguousarray(values)
        fitted: tuple[FloatArray, FloatArray, FloatArray, FloatArray] = kernels.fit_lines_locally(
            self.chainage, v, weight, self.half_m, self.offsets
        )
        return fitted

    def fit_plan(
        self, xy: FloatArray, weight: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Positions, headings, rms across the line and effective numbers of local fits of x(s) and y(s)."""
        x, dx, rms_x, effective = self.fit(xy[:, 0], weight)
        y, dy, rms_y, _ = self.fit(xy[:, 1], weight)
        return np.column_stack([x, y]), np.arctan2(dy, dx), np.hypot(rms_x, rms_y), effective


def node_chainage(xy: FloatArray) -> FloatArray:
    """Return the arc length at each node, in plan [m]."""
    return np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(xy, axis=0).T))])
