"""Lines of what was followed and fitted: the stretches that are guardrails, and those that are barriers."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from scipy.spatial import cKDTree

from linework.arrays import AnyArray, BoolArray, FloatArray
from linework.methods.radon.beside import close_beside
from linework.methods.radon.circles import Bins, CircleConfig
from linework.methods.radon.profile import Profile, ProfileConfig, offsets_of
from linework.methods.radon.rails import FittedRail, chainage_of
from linework.methods.radon.raised import raised_rails
from linework.methods.radon.stretches import barrier_stretches, guardrail_stretches
from linework.methods.radon.verdict import Verdict, classify
from linework.model.grid import Bounds
from linework.model.lines import LineSet
from linework.surface.road import RoadSurface, height_above_ground, height_above_road

#: The foot of a New Jersey profile stands 0.22 m before its top edge, and nodes are half a metre apart. [m]
FOOT_M = 0.35


@dataclass(frozen=True, slots=True)
class _Placed:
    """A fitted rail in the world: middle and edge [m], heights of the edge above road and ground [m]."""

    rail: FittedRail
    xyz: FloatArray
    edge_xyz: FloatArray
    height_m: FloatArray
    above_ground_m: FloatArray
    chainage: FloatArray


def _placed(rails: list[FittedRail], bins: Bins, surface: RoadSurface) -> list[_Placed]:
    """Return the rails in the world; heights are asked for at once."""
    if not rails:
        return []
    ends = list(pairwise(offsets_of([len(rail.xy) for rail in rails]).tolist()))
    top = np.concatenate([rail.top_m for rail in rails])
    xyz = np.column_stack([np.concatenate([rail.xy for rail in rails]), top]) + bins.origin
    edge = np.column_stack([np.concatenate([rail.edge_xy for rail in rails]), top]) + bins.origin
    height = height_above_road(surface, xyz).astype(np.float64)
    ground = height_above_ground(surface, xyz).astype(np.float64)
    return [
        _Placed(rail, xyz[a:b], edge[a:b], height[a:b], ground[a:b], chainage_of(rail.xy))
        for rail, (a, b) in zip(rails, ends, strict=True)
    ]


def _judged(placed: list[_Placed], paired: list[BoolArray], config: ProfileConfig) -> list[Verdict]:
    """Return the verdict on each; chains are many and short, and are judged at once."""
    if not placed:
        return []
    profile = Profile.joined([p.rail.profile for p in placed])
    columns = (
        np.concatenate([p.rail.wobble for p in placed]),
        np.concatenate([p.height_m for p in placed]),
        np.concatenate([p.above_ground_m for p in placed]),
        np.concatenate(paired),
    )
    return classify(profile, *columns, config).split(profile.offsets)


def _judged_again(
    placed: list[_Placed], first: list[Verdict], paired: list[BoolArray], config: ProfileConfig
) -> list[Verdict]:
    """Return the verdicts, given what runs beside some of the lines; the others' stay as they are."""
    changed = [i for i, own in enumerate(paired) if own.any()]
    again = _judged([placed[i] for i in changed], [paired[i] for i in changed], config)
    by_number = dict(zip(changed, again, strict=True))
    return [by_number.get(i, verdict) for i, verdict in enumerate(first)]


@dataclass(frozen=True, slots=True)
class _Stretch:
    """A run of nodes of a placed rail that is a line, the score of each, and what is judged of all nodes."""

    kind: str
    placed: _Placed
    run: slice
    score: FloatArray
    verdict: Verdict
    paired: BoolArray

    @property
    def xyz(self) -> FloatArray:
        """What a beam's line is, or a barrier's."""
        return (self.placed.xyz if self.kind == "guardrail" else self.placed.edge_xyz)[self.run]


def rail_lines(
    rails: list[FittedRail],
    bins: Bins,
    surface: RoadSurface,
    circles: CircleConfig,
    config: ProfileConfig,
    core: Bounds | None = None,
) -> LineSet:
    """Return the stretches that are guardrails or barriers, surely enough and long enough, as lines.

    Their height, confidence and whether they are double come from what lies in `core`, where a part does.
    """
    placed = _placed(rails, bins, surface)
    alone = [np.zeros(len(p.xyz), dtype=bool) for p in placed]
    first = _judged(placed, alone, config)
    # A second look at what runs close beside a guardrail
    beside = _beside(placed, _guardrails(placed, first, config), config)
    verdicts = _judged_again(placed, first, beside, config)
    # Barriers from where their sheet ends above; what is more surely one of them is no guardrail
    raised = _placed(raised_rails(rails, verdicts, bins, circles, config), bins, surface)
    barriers = _barriers(raised, config)
    found = _guardrails(placed, _without(placed, verdicts, barriers), config)
    found = _with_pairs(found, placed, _beside(placed, found, config))
    return _as_lines(found + barriers, core)


def _guardrails(placed: list[_Placed], verdicts: list[Verdict], config: ProfileConfig) -> list[_Stretch]:
    """Return the stretches that are guardrails, each as one that stands alone."""
    return [
        _Stretch("guardrail", p, *stretch, verdict, np.zeros(len(p.xyz), dtype=bool))
        for p, verdict in zip(placed, verdicts, strict=True)
        for stretch in guardrail_stretches(verdict, p.chainage, config)
    ]


def _barriers(placed: list[_Placed], config: ProfileConfig) -> list[_Stretch]:
    """Return the stretches that are barriers."""
    alone = [np.zeros(len(p.xyz), dtype=bool) for p in placed]
    return [
        _Stretch("barrier", p, *stretch, verdict, nothing)
        for p, nothing, verdict in zip(placed, alone, _judged(placed, alone, config), strict=True)
        for stretch in barrier_stretches(verdict, p.chainage, config)
    ]


def _without(placed: list[_Placed], verdicts: list[Verdict], barriers: list[_Stretch]) -> list[Verdict]:
    """Return the verdicts with no guardrail where a barrier is that is surer of itself, as far as its foot."""
    if not barriers:
        return verdicts
    tree = cKDTree(np.concatenate([stretch.xyz for stretch in barriers])[:, :2])
    score = np.append(np.concatenate([stretch.score for stretch in barriers]), 0.0)
    out = []
    for p, verdict in zip(placed, verdicts, strict=True):
        _, nearest = tree.query(p.xyz[:, :2], distance_upper_bound=FOOT_M)  # beyond: the last score
        is_barrier = score[nearest] > verdict.guardrail
        out.append(replace(verdict, guardrail=np.where(is_barrier, 0.0, verdict.guardrail)))
    return out


def _with_pairs(found: list[_Stretch], placed: list[_Placed], paired: list[BoolArray]) -> list[_Stretch]:
    """Return the stretches with which of their nodes have a guardrail beside them."""
    of = {id(p): own for p, own in zip(placed, paired, strict=True)}
    return [replace(stretch, paired=of[id(stretch.placed)]) for stretch in found]


def _beside(placed: list[_Placed], found: list[_Stretch], config: ProfileConfig) -> list[BoolArray]:
    return close_beside([p.xyz for p in placed], [stretch.xyz for stretch in found], config.pair_m)


def _as_lines(found: list[_Stretch], core: Bounds | None) -> LineSet:
    if not found:
        return LineSet.empty()
    own = [_in_core(s.xyz, core) for s in found]

    def of_vertices(name: str) -> AnyArray:
        return np.concatenate([getattr(s.placed.rail, name)[s.run] for s in found])

    return LineSet.from_lines(
        [s.xyz for s in found],
        kind=[s.kind for s in found],
        method=["radon"] * len(found),
        confidence=[float(np.mean(s.score[k])) for s, k in zip(found, own, strict=True)],
        height_m=[float(np.median(s.placed.height_m[s.run][k])) for s, k in zip(found, own, strict=True)],
        double=[bool(np.mean(s.paired[s.run][k]) > 0.5) for s, k in zip(found, own, strict=True)],
        sigma_xy_m=of_vertices("sigma_xy_m"),
        sigma_z_m=of_vertices("sigma_z_m"),
        bridged=np.logical_not(of_vertices("measured"))
        | np.concatenate([s.verdict.goes_on[s.run] < 0.5 for s in found]),
    )


def _in_core(line: FloatArray, core: Bounds | None) -> BoolArray:
    """Return which vertices lie in the core; all of them where none does, or there is no core."""
    everywhere = np.ones(len(line), dtype=bool)
    if core is None:
        return everywhere
    inside: BoolArray = (line[:, 0] >= core.west) & (line[:, 0] < core.east)
    inside &= (line[:, 1] >= core.south) & (line[:, 1] < core.north)
    return inside if inside.any() else everywhere
