"""The ground's mesh, and the truth of boundaries and markings that lie on it.

Separate from `scene`, which puts a world together: this is the one mesh that all objects stand on.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from linework.arrays import AnyArray, FloatArray
from linework.simulation.roads.alignment import kerb_paths, mouth_path
from linework.simulation.roads.road import KERB_BATTER_M, Road, SideSection
from linework.simulation.roads.scenario import Island, Marking, Symbol
from linework.simulation.scene.materials import Material
from linework.simulation.scene.meshes import Mesh, sheet
from linework.simulation.scene.part import Part, TruthLine

#: Depth of a kerb stone behind its face.
_KERB_TOP_M = 0.15


def ground(road: Road) -> Part:
    """Return carriageway, mouths of side streets, kerbs, footways and land: sheets that meet at the kerbs."""
    s = road.stations_m
    right, left = -road.right.width_m, road.left.width_m
    across = np.unique(np.concatenate([_filled(right, 0.0, 1.0), _filled(0.0, left, 1.0)]))
    q = np.broadcast_to(across, (len(s), len(across)))
    height = road.carriageway_height(np.broadcast_to(s[:, None], q.shape), q)
    middle = _strip(road, s, q, height, road.surface)
    sides = [
        mesh for sign in (1, -1) for mesh in (*_extra(road, sign), *_mouths(road, sign), *_land(road, sign))
    ]
    return Part((middle, *sides))


def _extra(road: Road, sign: int) -> Iterator[Mesh]:
    """Yield the carriageway beyond its least width."""
    side = road.side(sign)
    most = float(side.extra_m.y.max())
    if most > 0.0:
        s, share = road.stations_m, _filled(0.0, 1.0, 1.0 / np.ceil(most))
        q = sign * (side.width_m + side.extra_m(s)[:, None] * share[None, :])
        height = road.carriageway_height(np.broadcast_to(s[:, None], q.shape), q)
        yield _strip(road, s, q, height, road.surface)


def _mouths(road: Road, sign: int) -> Iterator[Mesh]:
    """Yield the floor of each side street up to the land's edge."""
    side = road.side(sign)
    share = _filled(0.0, 1.0, 1.0 / np.ceil(side.reach_m))
    for mouth in side.mouths:
        s, wide = mouth_path(mouth, side.reach_m, road.stations_between).T
        q = sign * (side.width_m + wide[:, None] * share[None, :])
        height = road.carriageway_height(np.broadcast_to(s[:, None], q.shape), q)
        yield _strip(road, s, q, height, Material.ASPHALT)


def _land(road: Road, sign: int) -> Iterator[Mesh]:
    """Yield kerb, footway and land between mouths; at a mouth they end as a face along the side street."""
    side = road.side(sign)
    d, material = _bands(side)
    span = (road.alignment.start_m, road.alignment.end_m)
    for path in kerb_paths(side.mouths, span, side.reach_m, road.stations_between, side.reach_m):
        s, wide = path[:, 0], np.maximum(path[:, 1], side.extra_m(path[:, 0]))
        limit = np.maximum(road.furthest_offset(s, sign, side.width_m + side.reach_m), side.width_m)
        # Cut off at the land's edge, but never the kerb's own face
        beyond = np.minimum(d[None, :], np.maximum(side.reach_m - wide, KERB_BATTER_M)[:, None])
        q = sign * np.minimum(side.width_m + wide[:, None] + beyond, (limit + KERB_BATTER_M)[:, None])
        along = np.broadcast_to(s[:, None], q.shape)
        yield _strip(road, s, q, road.carriageway_height(along, q) + side.rise(along, beyond), material)


def _bands(side: SideSection) -> tuple[FloatArray, AnyArray]:
    """Return the distances beyond the kerb that get nodes, and the material between them."""
    breaks = [0.0, KERB_BATTER_M]
    if side.form == "kerb":
        breaks += [_KERB_TOP_M, 0.4, 0.65, 0.9, 1.15]
    for a, b in itertools.pairwise(side.land_d_m):
        breaks += _filled(a, b, 2.5).tolist()
    d = np.unique(np.round(breaks, 6))
    middle = 0.5 * (d[1:] + d[:-1])
    i = np.clip(np.searchsorted(side.land_d_m, middle) - 1, 0, len(side.land_material) - 1)
    material = np.array(side.land_material, dtype=np.uint8)[i]
    if side.form == "kerb":
        material[middle < _KERB_TOP_M] = Material.KERB
    return d, material


def _strip(
    road: Road, s: FloatArray, q: FloatArray, height: FloatArray, material: AnyArray | Material
) -> Mesh:
    along = np.broadcast_to(s[:, None], q.shape)
    place = np.stack([along, q], axis=-1).reshape(-1, 2)
    return sheet(road.place(along, q, height), material).on_road(place)


def _filled(a: float, b: float, step: float) -> FloatArray:
    return np.linspace(a, b, int(np.ceil((b - a) / step)) + 1)


def boundary_truth(road: Road, far_edges_m: tuple[float, ...]) -> Part:
    """Return the truth of the carriageway's ends: foot of the kerb's face or edge of the pavement, and kerb tops.

    At a side street the kerb turns, and its lines with it, to the edge of what is modelled.
    """
    if road.surface != Material.ASPHALT:
        return Part(())
    span = (road.alignment.start_m, road.alignment.end_m)
    s = road.truth_chainages(*span)
    lines = []
    for sign in (1, -1):
        side = road.side(sign)
        # Median over chainage: the step along most of the kerb, not where it is dropped
        step = float(np.median(side.step_m(s)))
        for path in kerb_paths(side.mouths, span, side.reach_m, _with_nodes(road, side), 0.5):
            at = path[:, 0]
            q = sign * (side.width_m + np.maximum(path[:, 1], side.extra_m(at)))
            level = road.carriageway_height(at, q)
            foot = road.place(at, q, level)
            lines.append(TruthLine(kind="road_boundary", xyz=foot, form=side.form, height_m=step))
            if side.form == "kerb":
                rise = side.rise(at, np.full(len(at), KERB_BATTER_M))
                top = road.place(at, q + sign * KERB_BATTER_M, level + rise)
                lines.append(TruthLine(kind="kerb_top", xyz=top, form="kerb", height_m=step))
    for q_far in far_edges_m:
        step = float(np.median(road.left.step_m(s)))
        edge = road.on_ground(s, q_far)
        lines.append(TruthLine(kind="road_boundary", xyz=edge, form="edge", height_m=step))
    return Part((), tuple(lines))


def _with_nodes(road: Road, side: SideSection) -> Callable[[float, float], FloatArray]:
    """Return what gives the chainages of truth vertices between two, those where the width bends included."""

    def chainages(start_m: float, end_m: float) -> FloatArray:
        node = side.extra_m.x
        inside = node[(node > start_m + 1e-6) & (node < end_m - 1e-6)]
        even = road.truth_chainages(start_m, end_m)
        return np.union1d(even, np.round(inside, 4)) if len(node) > 1 else even

    return chainages


def island(road: Road, spec: Island) -> Part:
    """Return a raised island with its kerb stones, and the lines around its kerb's foot and top."""
    corner = np.asarray(spec.outline)
    middle = corner.mean(axis=0)
    n = int(np.ceil(np.linalg.norm(np.roll(corner, -1, axis=0) - corner, axis=1).max() / 0.5))
    share = np.linspace(0.0, 1.0, n, endpoint=False)[None, :, None]
    foot = (corner[:, None] + share * (np.roll(corner, -1, axis=0) - corner)[:, None]).reshape(-1, 2)
    foot = np.concatenate([foot, foot[:1]])
    inward = (middle - foot) / np.linalg.norm(middle - foot, axis=1, keepdims=True)
    rows = [foot, foot + KERB_BATTER_M * inward, foot + _KERB_TOP_M * inward, np.tile(middle, (len(foot), 1))]
    place = np.stack(rows, axis=1)
    up = np.array([0.0, spec.height_m, spec.height_m, spec.height_m])
    level = road.carriageway_height(place[..., 0], place[..., 1])
    xyz = road.place(place[..., 0], place[..., 1], level + up)
    materials = np.array([Material.KERB, Material.KERB, Material.FOOTWAY], dtype=np.uint8)
    mesh = sheet(xyz, materials).on_road(place.reshape(-1, 2))
    return Part(
        (mesh,),
        (
            TruthLine(kind="road_boundary", xyz=xyz[:, 0], form="kerb", height_m=spec.height_m),
            TruthLine(kind="kerb_top", xyz=xyz[:, 1], form="kerb", height_m=spec.height_m),
        ),
    )


def marking_truth(road: Road, marking: Marking) -> Part:
    """Return a marking's centreline, from the start of its first dash to the end of its last, and its dashes."""
    dashes = dash_ends(marking) if marking.pattern == "dashed" else np.zeros((0, 2))
    start = float(dashes[0, 0]) if len(dashes) else marking.start_m
    end = float(dashes[-1, 1]) if len(dashes) else marking.end_m
    whole = _painted(road, marking, start, end)
    pieces = [
        replace(_painted(road, marking, a, b), kind="lane_marking_dash", pattern="dashed")
        for a, b in dashes.tolist()
    ]
    return Part((), (whole, *pieces))


def symbol_truth(road: Road, symbol: Symbol) -> Part:
    """Return a symbol's centreline along its longer side; a piece of another symbol has none."""
    if not symbol.form:
        return Part(())
    length, width = symbol.end_m - symbol.start_m, symbol.left_m - symbol.right_m
    s, q = 0.5 * (symbol.start_m + symbol.end_m), 0.5 * (symbol.right_m + symbol.left_m)
    if length >= width:
        xyz = road.on_ground(road.truth_chainages(symbol.start_m, symbol.end_m), q)
    else:
        xyz = road.on_ground(s, _filled(symbol.right_m, symbol.left_m, 0.5))
    wide = min(length, width)
    if symbol.role:
        line = TruthLine(kind="lane_marking", xyz=xyz, role=symbol.role, pattern="solid", width_m=wide)
        return Part((), (line,))
    form = "" if symbol.form == "other" else symbol.form
    line = TruthLine(kind="road_marking_other", xyz=xyz, form=form, width_m=wide)
    return Part((), (line,))


def dash_ends(marking: Marking) -> FloatArray:
    """Return (n, 2) starts and ends of the dashes; a last piece under 0.5 m is not painted.

    >>> m = Marking(q_m=0.0, start_m=0.0, end_m=10.0, width_m=0.1, role="lane", pattern="dashed", dash_m=3.0, gap_m=4.0)
    >>> dash_ends(m).tolist()
    [[0.0, 3.0], [7.0, 10.0]]
    """
    start = np.arange(marking.start_m, marking.end_m, marking.dash_m + marking.gap_m)
    end = np.minimum(start + marking.dash_m, marking.end_m)
    kept = end - start >= 0.5
    return np.stack([start[kept], end[kept]], axis=1)


def _painted(road: Road, marking: Marking, start: float, end: float) -> TruthLine:
    s, q = road.truth_chainages(start, end), np.array(marking.q_m)
    if marking.shift_m is not None:
        node = marking.shift_m.x
        s = np.union1d(s, node[(node > start) & (node < end)])
        q = marking.q_m + marking.shift_m(s)
    return TruthLine(
        kind="lane_marking",
        xyz=road.on_ground(s, q),
        role=marking.role,
        pattern=marking.pattern,
        double=marking.double,
        width_m=marking.width_m,
        note=marking.generation,
    )
