"""Rails from the points: follow every seed once, fit locally, tell the kinds apart, make lines."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.spatial import cKDTree

from linework.kernels import corridor as kernels
from linework.kernels import follow
from linework.methods.radon.circles import Bins, CircleConfig
from linework.methods.radon.profile import Profile, ProfileConfig, measure_profile
from linework.methods.radon.verdict import Verdict, classify
from linework.model.arrays import BoolArray, FloatArray
from linework.model.lines import LineSet
from linework.surface.road import RoadSurface, height_above_ground, height_above_road


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
    profile: Profile


def follow_all(
    starts: FloatArray, bins: Bins, band_m: tuple[float, float], least_m: float, config: CircleConfig
) -> list[FloatArray]:
    """Follow every start (see `find_starts`) once, both ways, the clearest first; return node tables (n, 7).

    A start on a line already followed is passed over, and a line that runs into one ends there. What is
    shorter than `least_m` is dropped. Columns: x, y, heading, top z, number of points, spread, measured.
    """
    least = max(round(least_m / config.spacing_m), 4)
    how = (config.spacing_m, config.radius_m, config.max_gap_m, config.spacing_m, *band_m, config.sheet_m)
    order = np.lexsort((starts[:, 1], starts[:, 0], -starts[:, 4]))
    nodes, free, offsets = follow.follow_all(
        bins.points,
        bins.layers,
        (bins.n_x, bins.n_y, bins.cell_m),
        starts[order],
        np.array(how),
        (config.spacing_m, 1.25 * config.radius_m),
        bins.work,
    )
    return [
        nodes[begin:end][run]
        for begin, end in pairwise(offsets.tolist())
        if end - begin >= least
        for run in _runs(free[begin:end], least)
    ]


def fit_rail(nodes: FloatArray, bins: Bins, circles: CircleConfig, config: ProfileConfig) -> FittedRail:
    """Fit the circles' centres locally, measure the profile, and fit the top edge from its highest points.

    Two rounds in plan: the first turns the stations square to the line, the second centres it on the
    sheet. References: Manandhar and Shibasaki (2002): the corrected centres "are fitted locally".
    """
    half = circles.fit_window_m
    chainage = _chainage(nodes[:, :2])
    weight = np.minimum(nodes[:, 4], 10.0) * nodes[:, 6] + 1e-3
    xy, heading, *_ = _fit_plan(chainage, nodes[:, :2], weight, half)
    top, *_ = kernels.fit_locally(chainage, np.ascontiguousarray(nodes[:, 3]), weight, half)
    profile = measure_profile(np.column_stack([xy, heading, top]), bins, circles, config)

    # Centre the line on the sheet's points
    known = profile.number > 0
    left = np.column_stack([-np.sin(heading), np.cos(heading)])
    weight = np.where(known, np.minimum(profile.number, 10.0), 0.0) + 1e-3
    at_edge = np.where(np.isnan(profile.edge_m), np.nan_to_num(profile.offset_m), profile.edge_m)
    edge_xy, *_ = _fit_plan(chainage, xy + at_edge[:, None] * left, weight, half)
    xy, _, rms, effective = _fit_plan(
        chainage, xy + np.nan_to_num(profile.offset_m)[:, None] * left, weight, half
    )

    # The top edge lies above the highest of n returns spread over the sheet, by its height / (n + 1)
    seen = known & ~np.isnan(profile.top_m)
    deficit = np.where(seen, profile.beam_m / (profile.number + 1.0), 0.0)
    z = np.where(seen, profile.top_m + deficit, top)
    scatter = np.hypot(deficit, 0.015)
    weight = np.where(seen, (0.015 / scatter) ** 2, 1e-4)
    top, _, rms_z, effective_z = kernels.fit_locally(chainage, z, weight, half)
    for _ in range(2):  # again without what bushes and gaps left
        kept = seen & (np.abs(z - top) < 2.5 * scatter)
        top, _, rms_z, effective_z = kernels.fit_locally(chainage, z, np.where(kept, weight, 1e-4), half)
    return FittedRail(
        xy=xy,
        edge_xy=edge_xy,
        top_m=top,
        # a centimetre of each: the face's shape between crest and valley, the spacing of returns at the edge
        sigma_xy_m=np.hypot(rms / np.sqrt(np.maximum(effective - 3, 1)), 0.010),
        sigma_z_m=np.hypot(rms_z / np.sqrt(np.maximum(effective_z - 3, 1)), 0.010),
        measured=known,
        wobble=np.where(seen, np.abs(z - top) / scatter, np.nan),
        profile=profile,
    )


def _chainage(xy: FloatArray) -> FloatArray:
    return np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(xy, axis=0).T))])


def _fit_plan(
    chainage: FloatArray, xy: FloatArray, weight: FloatArray, half: float
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Positions, headings, rms across the line and effective numbers of local fits of x(s) and y(s)."""
    x, dx, rms_x, effective = kernels.fit_locally(chainage, np.ascontiguousarray(xy[:, 0]), weight, half)
    y, dy, rms_y, _ = kernels.fit_locally(chainage, np.ascontiguousarray(xy[:, 1]), weight, half)
    return np.column_stack([x, y]), np.arctan2(dy, dx), np.hypot(rms_x, rms_y), effective


def _runs(chosen: BoolArray, least: int) -> list[slice]:
    """Return the runs of True of at least `least` in a row."""
    edges = np.flatnonzero(np.diff(np.r_[False, chosen, False].astype(np.int8)))
    return [slice(a, b) for a, b in zip(edges[::2], edges[1::2], strict=True) if b - a >= least]


def rail_lines(rails: list[FittedRail], bins: Bins, surface: RoadSurface, config: ProfileConfig) -> LineSet:
    """Return the stretches that are guardrails or barriers, surely enough and long enough, as lines."""
    xyz = [np.column_stack([rail.xy, rail.top_m]) + bins.origin for rail in rails]
    height = [height_above_road(surface, v).astype(np.float64) for v in xyz]
    ground = [height_above_ground(surface, v).astype(np.float64) for v in xyz]
    alone = [np.zeros(len(v), dtype=bool) for v in xyz]
    verdicts = [
        classify(r.profile, r.wobble, h, g, p, config)
        for r, h, g, p in zip(rails, height, ground, alone, strict=True)
    ]
    chainages = [_chainage(rail.xy) for rail in rails]
    runs = [_guardrail_runs(v, s, config) for v, s in zip(verdicts, chainages, strict=True)]
    # A second look at what runs close beside a guardrail
    found = [v[run] for v, own in zip(xyz, runs, strict=True) for run, _ in own]
    pairs = _close_beside(xyz, found, config)
    chosen: list[tuple[str, int, slice, float]] = []
    bridged: list[BoolArray] = []
    for i, rail in enumerate(rails):
        verdict = classify(rail.profile, rail.wobble, height[i], ground[i], pairs[i], config)
        bridged.append(~rail.measured | (verdict.goes_on < 0.5))
        chosen += [("guardrail", i, *run) for run in _guardrail_runs(verdict, chainages[i], config)]
        chosen += [("barrier", i, *run) for run in _barrier_runs(verdict, chainages[i], config)]
    if not chosen:
        return LineSet.empty()
    pairs = _close_beside(xyz, [xyz[i][run] for kind, i, run, _ in chosen if kind == "guardrail"], config)
    edges = [np.column_stack([rail.edge_xy, rail.top_m]) + bins.origin for rail in rails]
    return LineSet.from_lines(
        [(xyz if kind == "guardrail" else edges)[i][run] for kind, i, run, _ in chosen],
        kind=[kind for kind, *_ in chosen],
        method=["radon"] * len(chosen),
        confidence=[score for *_, score in chosen],
        height_m=[float(np.median(height[i][run])) for _, i, run, _ in chosen],
        double=[bool(np.mean(pairs[i][run]) > 0.5) for _, i, run, _ in chosen],
        sigma_xy_m=np.concatenate([rails[i].sigma_xy_m[run] for _, i, run, _ in chosen]),
        sigma_z_m=np.concatenate([rails[i].sigma_z_m[run] for _, i, run, _ in chosen]),
        bridged=np.concatenate([bridged[i][run] for _, i, run, _ in chosen]),
    )


def _guardrail_runs(
    verdict: Verdict, chainage: FloatArray, config: ProfileConfig
) -> list[tuple[slice, float]]:
    """Return runs of nodes that are guardrail, with the mean score of each.

    A run starts where it is sure, and goes on from there for `max_run_on_m` at most where it is not.
    """
    sure = verdict.guardrail
    core = np.flatnonzero(sure >= 0.5)
    if not len(core):
        return []
    at = np.arange(len(sure))
    ahead = core[np.clip(np.searchsorted(core, at), 0, len(core) - 1)]
    behind = core[np.clip(np.searchsorted(core, at, side="right") - 1, 0, len(core) - 1)]
    away = np.minimum(np.abs(chainage[ahead] - chainage), np.abs(chainage[behind] - chainage))
    out: list[slice] = []
    for run in _runs((sure >= 0.5) | ((verdict.goes_on >= 0.5) & (away <= config.max_run_on_m)), 2):
        core_share = float(np.mean(sure[run] >= 0.5))
        length = core_share * (chainage[run][-1] - chainage[run][0])
        is_open = np.mean(verdict.open_[run]) >= 0.5
        enough = config.min_length_m if is_open else config.min_closed_length_m
        if core_share >= config.min_core and length >= enough:
            out.append(run)
    whole = _joined(out, chainage, config.max_run_on_m)
    return [(run, float(np.mean(np.maximum(sure[run], 0.5)))) for run in whole]


def _joined(runs: list[slice], chainage: FloatArray, gap_m: float) -> list[slice]:
    """Join runs with less than `gap_m` between them: the circles have followed one thing from one to the other."""
    whole: list[slice] = []
    for run in runs:
        if whole and chainage[run.start] - chainage[whole[-1].stop - 1] <= gap_m:
            whole[-1] = slice(whole[-1].start, run.stop)
        else:
            whole.append(run)
    return whole


def _barrier_runs(verdict: Verdict, chainage: FloatArray, config: ProfileConfig) -> list[tuple[slice, float]]:
    """Return runs of nodes that are barrier and not guardrail, with the mean score of each."""
    sure = np.where(verdict.guardrail < 0.5, verdict.barrier, 0.0)
    return [
        (run, float(np.mean(sure[run])))
        for run in _runs(sure >= 0.5, 2)
        if chainage[run][-1] - chainage[run][0] >= config.min_closed_length_m
    ]


def _close_beside(xyz: list[FloatArray], found: list[FloatArray], config: ProfileConfig) -> list[BoolArray]:
    """Which nodes have a node of a found line abreast, within `pair_m` in plan, and level with them."""
    if not found:
        return [np.zeros(len(v), dtype=bool) for v in xyz]
    nodes = np.concatenate(found)
    tree = cKDTree(nodes[:, :2])
    out = []
    for v in xyz:
        near = tree.query_ball_point(v[:, :2], config.pair_m)
        step = np.gradient(v[:, :2], axis=0)
        ahead = step / np.maximum(np.hypot(step[:, :1], step[:, 1:]), 1e-9)
        pairs = [_has_pair(p, a, nodes[i]) for p, a, i in zip(v, ahead, near, strict=True)]
        out.append(np.array(pairs, dtype=bool))
    return out


def _has_pair(point: FloatArray, ahead: FloatArray, nodes: FloatArray) -> bool:
    """Whether one of the nodes lies abreast of a point of a line; the line's own lie before and behind it."""
    d = nodes - point
    along, across = d[:, :2] @ ahead, np.abs(d[:, 1] * ahead[0] - d[:, 0] * ahead[1])
    # Abreast: to half the spacing of the nodes. Level: to 10 cm, and a crossfall of 6 % in between
    is_level = np.abs(d[:, 2]) < 0.10 + 0.06 * across
    return bool(np.any((np.abs(along) < 0.3) & (across > 0.12) & is_level))
