"""Fitted rails in world coordinates, and the runs of them that are lines."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.spatial import cKDTree

from linework.arrays import BoolArray, FloatArray, distance_along, offsets_of
from linework.methods.rails.circles import Bins
from linework.methods.rails.rails import FittedRail
from linework.methods.rails.verdict import NodeScores
from linework.surface.road import Ground, height_above_ground, height_above_road

#: Nodes within this distance of a barrier's edge are on its foot: that of a New Jersey profile stands 0.22 m before the
#: top edge, and nodes are half a metre apart. [m]
NEW_JERSEY_FOOT_M = 0.35


#: Distance aside at which the foot of a concrete barrier is no longer ground: it stands 0.25 m before the top edge, and
#: a cell of the ground is as wide. [m]
_BESIDE_FOOT_M = 0.5
#: Half of the square of ground that tells the noise of the survey beside a rail: the nearest lane. [m]
_NOISE_REACH_M = 8.0
#: Fewest cells of road in it whose scatter is known.
_LEAST_CELLS = 16


@dataclass(frozen=True, slots=True)
class PlacedRail:
    """A fitted rail in world coordinates.

    Parameters
    ----------
    xyz, edge_xyz
        (n, 3) middle and top edge. [m, world]
    height_m, above_ground_m
        (n,) height of the edge above the road and above the ground. [m]
    chainage
        (n,) distance along the rail. [m]
    """

    rail: FittedRail
    xyz: FloatArray
    edge_xyz: FloatArray
    height_m: FloatArray
    above_ground_m: FloatArray
    chainage: FloatArray


def place_rails(rails: list[FittedRail], bins: Bins, surface: Ground) -> list[PlacedRail]:
    """Return the rails in world coordinates, their heights looked up at once."""
    if not rails:
        return []
    ends = list(pairwise(offsets_of([len(rail.xy) for rail in rails]).tolist()))
    top = np.concatenate([rail.top_m for rail in rails])
    xyz = np.column_stack([np.concatenate([rail.xy for rail in rails]), top]) + bins.origin
    edge = np.column_stack([np.concatenate([rail.edge_xy for rail in rails]), top]) + bins.origin
    height = height_above_road(surface, xyz).astype(np.float64)
    ground = height_above_ground(surface, xyz).astype(np.float64)
    return [
        PlacedRail(rail, xyz[a:b], edge[a:b], height[a:b], ground[a:b], distance_along(rail.xy))
        for rail, (a, b) in zip(rails, ends, strict=True)
    ]


@dataclass(frozen=True, slots=True)
class Stretch:
    """A run of nodes of a placed rail that is a line.

    Parameters
    ----------
    kind
        "guardrail", "barrier" or "fence".
    run, score
        Its nodes, and the score (k,) of each.
    verdict, paired
        Scores of all nodes of the rail, and which (n,) have another rail beside them.
    form, depth_m, n_beams
        What it is, where known; how far its lower edge is below its upper one [m]; number of beams.
    """

    kind: str
    placed: PlacedRail
    run: slice
    score: FloatArray
    verdict: NodeScores
    paired: BoolArray
    form: str = ""
    depth_m: float = np.nan
    n_beams: float = np.nan

    @property
    def xyz(self) -> FloatArray:
        """Vertices (k, 3): the middle of a guardrail or a fence, or the edge of a barrier. [m, world]."""
        return (self.placed.edge_xyz if self.kind == "barrier" else self.placed.xyz)[self.run]


def in_plan(stretches: Sequence[Stretch]) -> cKDTree:
    """Return the nodes of stretches in plan, to look for those near a place."""
    return cKDTree(np.concatenate([np.zeros((0, 2)), *(s.xyz[:, :2] for s in stretches)]))


def near_nodes(xyz: FloatArray, nodes: cKDTree) -> BoolArray:
    """Return which vertices (n, 3) are within the foot of a barrier from one of the nodes in plan, (n,) bool."""
    return np.asarray(np.isfinite(nodes.query(xyz[:, :2], distance_upper_bound=NEW_JERSEY_FOOT_M)[0]))


def above_beside_m(surface: Ground, nodes: FloatArray) -> FloatArray:
    """Return the height of edges (n, 4) x, y, heading, z above the ground to the right and left of them, (n, 2) [m].

    The foot of a concrete barrier is taken for ground, which is then centimetres too high under its edge.
    """
    left = np.column_stack([-np.sin(nodes[:, 2]), np.cos(nodes[:, 2]), np.zeros(len(nodes))])
    edge = nodes[:, [0, 1, 3]]
    sides = [height_above_ground(surface, edge + s * _BESIDE_FOOT_M * left) for s in (-1.0, 1.0)]
    return np.column_stack(sides).astype(np.float64)


def road_noise_m(surface: Ground, xy: FloatArray) -> FloatArray:
    """Return the noise of the survey on the road beside places (n, 2), (n,) [m]; 0 where there is no road.

    That is the median scatter of the points of its cells: asphalt is smoother than scanners are.
    """
    reach = round(_NOISE_REACH_M / surface.grid.cell_width_m)
    column = np.floor((xy[:, 0] - surface.grid.east_m) / surface.grid.cell_width_m).astype(np.int64)
    row = np.floor((surface.grid.north_m - xy[:, 1]) / surface.grid.cell_height_m).astype(np.int64)
    noise = np.zeros(len(xy))
    for i, (r, c) in enumerate(zip(row.tolist(), column.tolist(), strict=True)):
        around = np.s_[max(r - reach, 0) : max(r + reach + 1, 0), max(c - reach, 0) : max(c + reach + 1, 0)]
        near = surface.sigma[around]
        known = near[surface.is_road[around] & np.isfinite(near)]
        noise[i] = np.median(known) if len(known) >= _LEAST_CELLS else 0.0
    return noise
