"""The ground's mesh, and the truth of boundaries and markings that lie on it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from linework.model.arrays import FloatArray
from linework.simulation.materials import Material
from linework.simulation.meshes import Mesh, sheet
from linework.simulation.part import Part, TruthLine
from linework.simulation.road import KERB_BATTER_M, Road
from linework.simulation.scenario import Marking

#: Depth of a kerb stone behind its face.
_KERB_TOP_M = 0.15


def ground(road: Road) -> Part:
    """Return carriageway, kerbs, footways and land as three sheets that meet at the carriageway's ends."""
    s = road.stations_m
    right, left = -road.right.width_m, road.left.width_m
    across = np.unique(np.concatenate([_filled(right, 0.0, 1.0), _filled(0.0, left, 1.0)]))
    q = np.broadcast_to(across, (len(s), len(across)))
    middle = sheet(_placed(road, s, q), Material.ASPHALT).on_road(_chainage_offset(s, q))
    return Part((middle, *(_land(road, sign) for sign in (1, -1))))


def _land(road: Road, sign: int) -> Mesh:
    side, s = road.side(sign), road.stations_m
    breaks = [0.0, KERB_BATTER_M]
    if side.form == "kerb":
        breaks += [_KERB_TOP_M, 0.4, 0.65, 0.9, 1.15]
    for a, b in zip(side.land_d_m[:-1], side.land_d_m[1:], strict=True):
        breaks += _filled(a, b, 2.5).tolist()
    d = np.unique(np.round(breaks, 6))
    middle = 0.5 * (d[1:] + d[:-1])
    i = np.clip(np.searchsorted(side.land_d_m, middle) - 1, 0, len(side.land_material) - 1)
    material = np.array(side.land_material, dtype=np.uint8)[i]
    if side.form == "kerb":
        material[middle < _KERB_TOP_M] = Material.KERB
    limit = road.furthest_offset(s, sign, side.width_m + float(d[-1]))
    q = sign * np.minimum(side.width_m + d[None, :], np.maximum(limit, side.width_m)[:, None])
    return sheet(_placed(road, s, q), material).on_road(_chainage_offset(s, q))


def _filled(a: float, b: float, step: float) -> FloatArray:
    return np.linspace(a, b, int(np.ceil((b - a) / step)) + 1)


def _placed(road: Road, s: FloatArray, q: FloatArray) -> FloatArray:
    return road.on_ground(np.broadcast_to(s[:, None], q.shape), q)


def _chainage_offset(s: FloatArray, q: FloatArray) -> FloatArray:
    return np.stack([np.broadcast_to(s[:, None], q.shape), q], axis=-1).reshape(-1, 2)


def boundaries(road: Road, far_edges_m: tuple[float, ...]) -> Part:
    """Return the truth of the carriageway's ends: foot of the kerb's face or edge of the pavement, and kerb tops."""
    s = road.truth_chainages(road.alignment.start_m, road.alignment.end_m)
    lines = []
    for sign in (1, -1):
        side = road.side(sign)
        q = sign * side.width_m
        # Median over chainage: the step along most of the kerb, not where it is dropped
        step = float(np.median(side.step_m(s)))
        foot = road.place(s, q, road.carriageway_height(s, q))
        lines.append(TruthLine(kind="road_boundary", xyz=foot, form=side.form, height_m=step))
        if side.form == "kerb":
            top = road.on_ground(s, q + sign * KERB_BATTER_M)
            lines.append(TruthLine(kind="kerb_top", xyz=top, form="kerb", height_m=step))
    for q in far_edges_m:
        step = float(np.median(road.left.step_m(s)))
        lines.append(TruthLine(kind="road_boundary", xyz=road.on_ground(s, q), form="edge", height_m=step))
    return Part((), tuple(lines))


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
    return TruthLine(
        kind="lane_marking",
        xyz=road.on_ground(road.truth_chainages(start, end), marking.q_m),
        role=marking.role,
        pattern=marking.pattern,
        double=marking.double,
        width_m=marking.width_m,
    )
