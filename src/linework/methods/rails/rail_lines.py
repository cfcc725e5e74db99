"""Guardrails, barriers and fences as lines, from the fitted rails."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from linework.arrays import AnyArray, BoolArray, FloatArray, distance_along
from linework.methods.rails import fitted
from linework.methods.rails.chains import long_runs
from linework.methods.rails.circles import Bins, CircleConfig
from linework.methods.rails.formed import Surroundings, with_forms
from linework.methods.rails.placed import NEW_JERSEY_FOOT_M, PlacedRail, Stretch, place_rails
from linework.methods.rails.profile import BIN_M, TOP_BIN, ProfileConfig, VerticalProfile
from linework.methods.rails.rails import FittedRail, fit_rails
from linework.methods.rails.stretches import barrier_stretches, guardrail_stretches, near_chosen
from linework.methods.rails.verdict import NodeScores, classify
from linework.model.grid import Bounds
from linework.model.lines import LINE_COLUMNS, VERTEX_COLUMNS, LineSet
from linework.surface.road import Ground, height_above_ground

#: Score of a guardrail that rules out a barrier: the foot of one never reaches it.
CLEAR_GUARDRAIL = 0.9
#: Height above the followed edge from which a sheet has its edge elsewhere: the circles look 3 cm above it. [m]
LEAST_RAISE_M = 2 * BIN_M
#: Rounds of fits from the new edge: the first moves it by a few centimetres, the second comes to rest.
ROUNDS = 2

#: Height of an end that may dip into the ground: beams end at half a metre or more. [m]
LOW_END_M = 0.30
#: Least fall of such an end: the gentlest dip in use is 0.7 m over 12 m.
LEAST_FALL = 0.05
#: Height of the top edge at which a beam has reached the ground: the noise of the ground and grass. [m]
SUNK_M = 0.06
#: Longest extension of a dipping end, two stations: the fall there is known from a smoothed edge. [m]
LONGEST_BURIED_M = 1.0
#: Vertices from the end over which its fall is taken, 1.5 m; a line needs one more.
_FALL_VERTICES = 3

#: Nodes abreast of each other are closer than this along the line: half of the spacing of nodes. [m]
_ABREAST_M = 0.3
#: Least distance across of two rails; the line's own nodes are nearer. [m]
_LEAST_ACROSS_M = 0.12
#: Difference in height of two level rails, at most: 10 cm, and a crossfall of 6 % between them. [m, 1]
_LEVEL_M, _CROSSFALL = 0.10, 0.06


def _judged(placed: list[PlacedRail], paired: list[BoolArray], config: ProfileConfig) -> list[NodeScores]:
    """Return the scores of each rail; rails are many and short, so all are classified at once."""
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
    placed: list[PlacedRail], first: list[NodeScores], paired: list[BoolArray], config: ProfileConfig
) -> list[NodeScores]:
    """Return the scores, recomputed for rails with another one beside them."""
    changed = [i for i, own in enumerate(paired) if own.any()]
    again = _judged([placed[i] for i in changed], [paired[i] for i in changed], config)
    by_number = dict(zip(changed, again, strict=True))
    return [by_number.get(i, verdict) for i, verdict in enumerate(first)]


def rail_lines(
    rails: list[FittedRail],
    bins: Bins,
    surface: Ground,
    circles: CircleConfig,
    config: ProfileConfig,
    core: Bounds | None = None,
) -> LineSet:
    """Return the stretches that are certain and long enough to be guardrails, barriers or fences, as lines.

    Parameters
    ----------
    rails
        Fitted rails.
    bins, circles, config
        What they were fitted to and with.
    surface
        Road and ground.
    core
        Height, confidence and whether a line is double come from its part in here, where there is one.
    """
    placed = place_rails(rails, bins, surface)
    alone = [np.zeros(len(p.xyz), dtype=bool) for p in placed]
    first = _judged(placed, alone, config)
    # Classify again what runs close beside a guardrail
    beside = _beside(placed, _guardrails(placed, first, config), config)
    verdicts = _judged_again(placed, first, beside, config)
    # Barriers, fitted where their sheet ends above; what scores higher as a barrier is not a guardrail
    raised = place_rails(raised_rails(rails, verdicts, bins, circles, config), bins, surface)
    barriers = _barriers(raised, config)
    found = _guardrails(placed, _without(placed, verdicts, barriers), config)
    found = _with_pairs(found, placed, _beside(placed, found, config))
    # What their cross-sections show, and what else has the cross-section of a rail
    around = Surroundings(bins, surface, circles, config)
    return _as_lines(with_forms(found, barriers, placed, verdicts, around), core)


def _guardrails(placed: list[PlacedRail], verdicts: list[NodeScores], config: ProfileConfig) -> list[Stretch]:
    """Return the stretches that are guardrails, each without a rail beside it."""
    return [
        Stretch("guardrail", p, *stretch, verdict, np.zeros(len(p.xyz), dtype=bool))
        for p, verdict in zip(placed, verdicts, strict=True)
        for stretch in guardrail_stretches(verdict, p.chainage, config)
    ]


def _barriers(placed: list[PlacedRail], config: ProfileConfig) -> list[Stretch]:
    """Return the stretches that are barriers."""
    alone = [np.zeros(len(p.xyz), dtype=bool) for p in placed]
    return [
        Stretch("barrier", p, *stretch, verdict, nothing)
        for p, nothing, verdict in zip(placed, alone, _judged(placed, alone, config), strict=True)
        for stretch in barrier_stretches(verdict, p.chainage, config)
    ]


def _without(
    placed: list[PlacedRail], verdicts: list[NodeScores], barriers: list[Stretch]
) -> list[NodeScores]:
    """Return the scores without guardrail where a barrier scores higher, as far as its foot."""
    if not barriers:
        return verdicts
    tree = cKDTree(np.concatenate([stretch.xyz for stretch in barriers])[:, :2])
    score = np.append(np.concatenate([stretch.score for stretch in barriers]), 0.0)
    out = []
    for p, verdict in zip(placed, verdicts, strict=True):
        # Nodes farther away get the last score, 0
        _, nearest = tree.query(p.xyz[:, :2], distance_upper_bound=NEW_JERSEY_FOOT_M)
        is_barrier = score[nearest] > verdict.guardrail
        out.append(replace(verdict, guardrail=np.where(is_barrier, 0.0, verdict.guardrail)))
    return out


def _with_pairs(found: list[Stretch], placed: list[PlacedRail], paired: list[BoolArray]) -> list[Stretch]:
    """Return the stretches with `paired` set to the nodes that have a guardrail beside them."""
    of = {id(p): own for p, own in zip(placed, paired, strict=True)}
    return [replace(stretch, paired=of[id(stretch.placed)]) for stretch in found]


def _beside(placed: list[PlacedRail], found: list[Stretch], config: ProfileConfig) -> list[BoolArray]:
    return close_beside([p.xyz for p in placed], [stretch.xyz for stretch in found], config.pair_m)


def _as_lines(found: list[Stretch], core: Bounds | None) -> LineSet:
    if not found:
        return LineSet.empty()
    own = [_in_core(s.xyz, core) for s in found]
    height = [float(np.median(s.placed.height_m[s.run][k])) for s, k in zip(found, own, strict=True)]

    def of_vertices(name: str) -> AnyArray:
        return np.concatenate([getattr(s.placed.rail, name)[s.run] for s in found])

    return LineSet.from_lines(
        [s.xyz for s in found],
        kind=[s.kind for s in found],
        method=["radon"] * len(found),
        confidence=[float(np.mean(s.score[k])) for s, k in zip(found, own, strict=True)],
        form=["concrete" if s.kind == "barrier" else s.form for s in found],
        height_m=height,
        # Concrete stands on the ground
        lower_m=[
            0.0 if s.kind == "barrier" else top - s.depth_m for s, top in zip(found, height, strict=True)
        ],
        n_beams=[s.n_beams for s in found],
        double=[bool(np.mean(s.paired[s.run][k]) > 0.5) for s, k in zip(found, own, strict=True)],
        sigma_xy_m=of_vertices("sigma_xy_m"),
        sigma_z_m=of_vertices("sigma_z_m"),
        bridged=np.logical_not(of_vertices("measured"))
        | np.concatenate([s.verdict.goes_on[s.run] < 0.5 for s in found]),
    )


def _in_core(line: FloatArray, core: Bounds | None) -> BoolArray:
    """Return which vertices (n, 3) lie in the core, (n,) bool; all where none does or there is no core."""
    everywhere = np.ones(len(line), dtype=bool)
    if core is None:
        return everywhere
    inside: BoolArray = (line[:, 0] >= core.west) & (line[:, 0] < core.east)
    inside &= (line[:, 1] >= core.south) & (line[:, 1] < core.north)
    return inside if inside.any() else everywhere


def raise_of(rail: FittedRail) -> FloatArray:
    """Return the height by which the sheet continues above the followed edge without a gap, (n,) [m]."""
    filled = rail.profile.all_rows[:, TOP_BIN - 1 :: -1] >= fitted.SHEET_FILLED
    return np.where(filled.all(axis=1), 0.0, np.argmin(filled, axis=1) * BIN_M)


def raised_rails(
    rails: list[FittedRail],
    verdicts: list[NodeScores],
    bins: Bins,
    circles: CircleConfig,
    config: ProfileConfig,
) -> list[FittedRail]:
    """Return the parts of rails that may be barriers, fitted again from the upper end of their sheet.

    Starts are found on the face of a barrier, too, at the height of a beam. A part reaches no farther than the
    shortest barrier from where it may be one.
    """
    chains = []
    for rail, verdict in zip(rails, verdicts, strict=True):
        higher = raise_of(rail)
        may_be = (verdict.barrier >= 0.5) | ((higher >= LEAST_RAISE_M) & (verdict.goes_on >= 0.5))
        near = near_chosen(
            may_be & (verdict.guardrail < CLEAR_GUARDRAIL),
            distance_along(rail.xy),
            config.min_closed_length_m,
        )
        chain = _chain_of(rail, rail.top_m + higher)
        chains += [
            chain[run] for run in long_runs(near, round(config.min_closed_length_m / circles.spacing_m))
        ]
    refitted = fit_rails(chains, bins, circles, config)
    for _ in range(ROUNDS - 1):
        refitted = fit_rails([_chain_of(rail, rail.top_m) for rail in refitted], bins, circles, config)
    return refitted


def _chain_of(rail: FittedRail, top_m: FloatArray) -> FloatArray:
    return np.column_stack([rail.xy, top_m, rail.profile.number, rail.measured])


def carry_into_ground(lines: LineSet, surface: Ground) -> LineSet:
    """Return the lines with guardrails extended to where their buried ends reach the ground, marked as bridged.

    The last few centimetres of a dipping beam cannot be told from the ground; they are extrapolated from its fall
    over the last 1.5 m.
    """
    parts = []
    for i in range(len(lines)):
        line = lines.take([i])
        if line.kind[0] == "guardrail" and len(line.xyz) > _FALL_VERTICES:
            height = height_above_ground(surface, line.xyz).astype(np.float64)
            line = _with_end(_with_end(line, height, first=True), height[::-1], first=False)
        parts.append(line)
    return LineSet.concatenate(parts) if parts else lines


def _with_end(line: LineSet, height: FloatArray, *, first: bool) -> LineSet:
    """Add a vertex where the first (or last) end of a line reaches the ground; `height` (n,) starts at that end."""
    xyz = line.xyz if first else line.xyz[::-1]
    back = xyz[0] - xyz[_FALL_VERTICES]
    run = float(np.hypot(back[0], back[1]))
    fall = (height[_FALL_VERTICES] - height[0]) / max(run, 1e-9)
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


def close_beside(xyz: list[FloatArray], found: list[FloatArray], pair_m: float) -> list[BoolArray]:
    """Return which nodes of each line have one of another line abreast, level and within `pair_m`, (n,) bool each.

    Parameters
    ----------
    xyz, found
        (n, 3) nodes of each line, and of the lines that may run beside them. [m]
    pair_m
        Largest distance across. [m]

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
    is_level = np.abs(d[:, 2]) < _LEVEL_M + _CROSSFALL * across
    is_pair = (np.abs(along) < _ABREAST_M) & (across > _LEAST_ACROSS_M) & is_level
    chosen = np.bincount(i[is_pair], minlength=len(places)) > 0
    return np.split(chosen, np.cumsum([len(v) for v in xyz])[:-1])
