"""Average precision of whole lines by Chamfer distance, as in benchmarks of HD maps.

Separate from the length-based measures, as it judges whole lines: it measures the joining.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from linework.arrays import BoolArray, FloatArray, IntArray
from linework.evaluation.chains import Chains
from linework.evaluation.match import distance_to

#: Thresholds on the Chamfer distance [m], finer than the 0.5, 1.0 and 1.5 m of HDMapNet: a survey is denser.
CHAMFER_M = (0.2, 0.5, 1.0)
#: Spacing of the samples whose distances are averaged [m]; each distance is to the line itself, not to samples.
_SAMPLE_M = 0.5


def average_precision(
    extracted: Chains, reference: Chains, limits_m: Sequence[float] = CHAMFER_M
) -> dict[float, float | None]:
    """Return the average precision per threshold; None where there is no reference line.

    Parameters
    ----------
    extracted, reference
        Lines of one kind, about one origin.
    limits_m
        An extracted line is right if its Chamfer distance to a reference line that no more confident line has
        taken is below this.

    Notes
    -----
    Lines are taken by falling confidence (then by falling length, then in order), and each takes the nearest
    reference line left. AP is the area under precision over recall, with precision made monotonic from the
    right. Whole lines are compared, so a line found in two halves counts as not found: this measures the
    joining, the length-based measures the geometry.

    References
    ----------
    Q. Li et al., HDMapNet, ICRA 2022, doi:10.1109/ICRA46639.2022.9812383: Chamfer distance as the criterion.
    """
    distances_m = _chamfer_distances(extracted, reference, max(limits_m))
    order = np.asarray(np.lexsort((-extracted.length_m, -extracted.lines.confidence)), dtype=np.int64)
    result: dict[float, float | None] = {}
    for limit_m in limits_m:
        is_hit = _take_in_order(distances_m, order, limit_m)
        result[float(limit_m)] = _area(is_hit, len(reference))
    return result


def _chamfer_distances(extracted: Chains, reference: Chains, far_m: float) -> FloatArray:
    """Return (m_e, m_r) Chamfer distances [m], the mean of both mean distances; inf where certainly above `far_m`."""
    distances_m = np.full((len(extracted), len(reference)), np.inf)
    parts_e, parts_r = ([_one(c, i) for i in range(len(c))] for c in (extracted, reference))
    samples_e, samples_r = ([_samples(p) for p in parts] for parts in (parts_e, parts_r))
    boxes_e, boxes_r = (_boxes(samples, extracted.n_dims) for samples in (samples_e, samples_r))
    for i in range(len(extracted)):
        apart = np.maximum(boxes_e[i, 0] - boxes_r[:, 1], boxes_r[:, 0] - boxes_e[i, 1])
        # No mean is below the gap between the boxes; a line extends half a sample beyond its outermost samples
        for j in np.flatnonzero(apart.max(axis=1) < far_m + _SAMPLE_M):
            bound_m = _mean_to_box(samples_r[j], boxes_e[i]) + _mean_to_box(samples_e[i], boxes_r[j])
            if bound_m / 2 < far_m + _SAMPLE_M:
                there = distance_to(samples_e[i], parts_r[j], _SAMPLE_M).mean()
                back = distance_to(samples_r[j], parts_e[i], _SAMPLE_M).mean()
                distances_m[i, j] = (there + back) / 2
    return distances_m


def _one(chains: Chains, i: int) -> Chains:
    lines = chains.lines.take([i])
    first, last = chains.lines.offsets[i], chains.lines.offsets[i + 1]
    # The vertices of the chain are already relative to the common origin
    return Chains(
        lines,
        chains.xyz[first:last],
        chains.axis_m[first:last],
        chains.start_m[i : i + 1],
        chains.length_m[i : i + 1],
        chains.n_dims,
    )


def _samples(chains: Chains) -> FloatArray:
    line, chainage_m, _ = chains.divided(_SAMPLE_M)
    return chains.at(line, chainage_m) if len(line) else np.zeros((0, 3))


def _boxes(samples: Sequence[FloatArray], n_dims: int) -> FloatArray:
    """Return (m, 2, n_dims) the lowest and highest coordinates [m, local]; NaN for a line without length."""
    boxes = np.full((len(samples), 2, n_dims), np.nan)
    for i, positions in enumerate(samples):
        if len(positions):
            boxes[i] = positions[:, :n_dims].min(axis=0), positions[:, :n_dims].max(axis=0)
    return boxes


def _mean_to_box(positions: FloatArray, box: FloatArray) -> float:
    """Return the mean distance of positions (k, 3) to a box [m], a lower bound of that to the line inside it."""
    inside = positions[:, : box.shape[1]]
    out = np.maximum(np.maximum(box[0] - inside, inside - box[1]), 0.0)
    return float(np.sqrt(np.einsum("ij,ij->i", out, out)).mean())


def _take_in_order(distances_m: FloatArray, order: IntArray, limit_m: float) -> BoolArray:
    """Return (m_e,) bool in the order of `order`: the line took a reference line."""
    is_free = np.ones(distances_m.shape[1], dtype=bool)
    is_hit = np.zeros(len(order), dtype=bool)
    for rank, i in enumerate(order):
        left_m = np.where(is_free, distances_m[i], np.inf)
        if len(left_m) and left_m.min() < limit_m:
            is_free[int(left_m.argmin())] = False
            is_hit[rank] = True
    return is_hit


def _area(is_hit: BoolArray, n_reference: int) -> float | None:
    if n_reference == 0:
        return None
    n_hits = np.cumsum(is_hit)
    precision = n_hits / np.arange(1, len(is_hit) + 1)
    falling = np.maximum.accumulate(precision[::-1])[::-1]
    # Recall rises by 1 / n at every hit: the area is the mean precision at the hits, with 0 for lines missed
    return float(falling[is_hit].sum() / n_reference)
