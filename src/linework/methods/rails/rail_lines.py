"""Lines of what was followed and fitted: the stretches that are guardrails, and those that are barriers."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from scipy.spatial import cKDTree

from linework.arrays import AnyArray, BoolArray, FloatArray
from linework.methods.rails.chains import long_runs
from linework.methods.rails.circles import Bins, CircleConfig
from linework.methods.rails.profile import BIN_M, TOP_BIN, ProfileConfig, VerticalProfile, offsets_of
from linework.methods.rails.rails import FittedRail, fit_rails, node_chainage
from linework.methods.rails.stretches import barrier_stretches, guardrail_stretches, near_chosen
from linework.methods.rails.verdict import NodeScores, classify
from linework.model.grid import Bounds
from linework.model.lines import LINE_COLUMNS, VERTEX_COLUMNS, LineSet
from linework.surface.road import RoadSurface, height_above_ground, height_above_road

#: The foot of a New Jersey profile stands 0.22 m before its top edge, and nodes are half a metre apart. [m]
NEW_JERSEY_FOOT_M = 0.35


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
        _Placed(rail, xyz[a:b], edge[a:b], height[a:b], ground[a:b], node_chainage(rail.xy))
        for rail, (a, b) in zip(rails, ends, strict=True)
    ]


def _judged(placed: list[_Placed], paired: list[BoolArray], config: ProfileConfig) -> list[NodeScores]:
    """Return the verdict on each; chains are many and short, and are judged at once."""
    if not placed:
        return []
    profile = VerticalProfile.joined([p.rail.profile for p in placed])
    columns = (
        np.concatenate([p.rail.wobble for p in placed]),
        np.concatenate([p.height_m for p in placed]),
        np.concatenate([p.above_ground_m for p in placed]),
        np.concatenate(paired),
    )
    return classify(profile, *columns, config).split(profile.offsets)


def _judged_again(
    placed: list[_Placed], first: list[NodeScores], paired: list[BoolArray], config: ProfileConfig
) -> list[NodeScores]:
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
    verdict: NodeScores
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


def _guardrails(placed: list[_Placed], verdicts: list[NodeScores], config: ProfileConfig) -> list[_Stretch]:
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


def _without(placed: list[_Placed], verdicts: list[NodeScores], barriers: list[_Stretch]) -> list[NodeScores]:
    """Return the verdicts with no guardrail where a barrier is that is surer of itself, as far as its foot."""
    if not barriers:
        return verdicts
    tree = cKDTree(np.concatenate([stretch.xyz for stretch in barriers])[:, :2])
    score = np.append(np.concatenate([stretch.score for stretch in barriers]), 0.0)
    out = []
    for p, verdict in zip(placed, verdicts, strict=True):
        _, nearest = tree.query(
            p.xyz[:, :2], distance_upper_bound=NEW_JERSEY_FOOT_M
        )  # beyond: the last score
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


# Sheets that go on above the edge that was followed: concrete barriers, measured again from their top

#: A sheet goes on where it has this share of its density: the limit below which a beam ends.
FILLED = 0.4
#: What is a guardrail as surely as this is no barrier: the foot of one never is.
CLEAR_GUARDRAIL = 0.9
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
    verdicts: list[NodeScores],
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
        near = near_chosen(
            may_be & (verdict.guardrail < CLEAR_GUARDRAIL), node_chainage(rail.xy), config.min_closed_length_m
        )
        chain = _chain_of(rail, rail.top_m + higher)
        chains += [
            chain[run] for run in long_runs(near, round(config.min_closed_length_m / circles.spacing_m))
        ]
    fitted = fit_rails(chains, bins, circles, config)
    for _ in range(ROUNDS - 1):
        fitted = fit_rails([_chain_of(rail, rail.top_m) for rail in fitted], bins, circles, config)
    return fitted


def _chain_of(rail: FittedRail, top_m: FloatArray) -> FloatArray:
    return np.column_stack([rail.xy, top_m, rail.profile.number, rail.measured])


# Guardrails whose end dips into the ground go on until they reach it

#: An end lower than this, and falling, is on its way into the ground: beams end at half a metre or more.
LOW_END_M = 0.30
#: The gentlest dip in use: 0.7 m over 12 m.
LEAST_FALL = 0.05
#: Height of the top edge at which a beam counts as sunk: the ground's noise and grass.
SUNK_M = 0.06
#: No further than two stations beyond what was measured: the fall there is known from a smoothed edge.
LONGEST_BURIED_M = 1.0


def carry_into_ground(lines: LineSet, surface: RoadSurface) -> LineSet:
    """Return the lines with the last stretch of buried ends added, marked as bridged.

    The last few centimetres of a dipping beam cannot be told from the ground. Its fall over the last
    1.5 m that were measured says where it reaches it.
    """
    parts = []
    for i in range(len(lines)):
        line = lines.take([i])
        if line.kind[0] == "guardrail" and len(line.xyz) >= 4:
            height = height_above_ground(surface, line.xyz).astype(np.float64)
            line = _with_end(_with_end(line, height, first=True), height[::-1], first=False)
        parts.append(line)
    return LineSet.concatenate(parts) if parts else lines


def _with_end(line: LineSet, height: FloatArray, *, first: bool) -> LineSet:
    """Add a vertex where the line's first (or last) end is sunk; `height` starts at that end."""
    xyz = line.xyz if first else line.xyz[::-1]
    back = xyz[0] - xyz[3]
    run = float(np.hypot(back[0], back[1]))
    fall = (height[3] - height[0]) / max(run, 1e-9)
    if height[0] > LOW_END_M or height[0] <= SUNK_M or fall < LEAST_FALL:
        return line
    further = min((height[0] - SUNK_M) / fall, LONGEST_BURIED_M)
    end = xyz[0] + back / run * further
    end[2] = xyz[0, 2] - further * fall
    at = 0 if first else len(line.xyz)
    columns = {c: getattr(line, c) for c in LINE_COLUMNS}
    for name in VERTEX_COLUMNS:
        own = getattr(line, name)
        columns[name] = np.insert(own, at, True if name == "bridged" else own[0 if first else -1])
    vertices = np.insert(line.xyz, at, end, axis=0)
    return LineSet(xyz=vertices, offsets=np.array([0, len(vertices)]), crs=line.crs, **columns)


# What runs close beside a line: the two rails of a median


def close_beside(xyz: list[FloatArray], found: list[FloatArray], pair_m: float) -> list[BoolArray]:
    """Return which nodes of each line have a node of a found one abreast, within `pair_m`, and level with them.

    >>> x = np.arange(0.0, 5.0, 0.5)
    >>> one = np.column_stack([x, 0 * x, 0 * x])
    >>> close_beside([one], [one + [0.0, 0.4, 0.0]], 3.0)[0].all(), close_beside([one], [one], 3.0)[0].any()
    (np.True_, np.False_)
    """
    if not found or not xyz:
        return [np.zeros(len(v), dtype=bool) for v in xyz]
    places, nodes = np.concatenate(xyz), np.concatenate(found)
    step = np.concatenate([np.gradient(v[:, :2], axis=0) for v in xyz])
    ahead = step / np.maximum(np.hypot(step[:, :1], step[:, 1:]), 1e-9)
    near = cKDTree(places[:, :2]).sparse_distance_matrix(cKDTree(nodes[:, :2]), pair_m, output_type="ndarray")
    i, d = near["i"], nodes[near["j"]] - places[near["i"]]
    along = np.sum(d[:, :2] * ahead[i], axis=1)
    across = np.abs(d[:, 1] * ahead[i, 0] - d[:, 0] * ahead[i, 1])
    # Abreast: to half the spacing of the nodes. Level: to 10 cm, and a crossfall of 6 % in between
    is_level = np.abs(d[:, 2]) < 0.10 + 0.06 * across
    # The line's own nodes lie before and behind it
    is_pair = (np.abs(along) < 0.3) & (across > 0.12) & is_level
    chosen = np.bincount(i[is_pair], minlength=len(places)) > 0
    return np.split(chosen, np.cumsum([len(v) for v in xyz])[:-1])
