"""What guards the road's side: rails of every form, concrete barriers, fences; with their truth.

Separate from `scene`, which puts a world together: these objects stand upright on the road's height and have truth
lines.
"""

from __future__ import annotations

import numpy as np

from linework.arrays import FloatArray
from linework.simulation.roads.alignment import PiecewiseLinear
from linework.simulation.roads.road import Road
from linework.simulation.roads.scenario import Barrier, Fence, Rail
from linework.simulation.scene.materials import Material
from linework.simulation.scene.meshes import Mesh, boxes, columns, sheet
from linework.simulation.scene.part import Part, TruthLine

#: The W of the beam, from the lower edge up: height as a share of the beam's height, depth towards the
#: traffic as a share of its depth. Two crests, a valley between them and the lips at valley depth: the
#: shape of EN 1317 "profile A / B" and AASHTO M 180 beams (about 31 cm high, 8 cm deep), corners broken once.
_W_HEIGHT = np.array(
    [0.0, 0.05, 0.10, 0.20, 0.24, 0.34, 0.38, 0.46, 0.54, 0.62, 0.66, 0.76, 0.80, 0.90, 0.95, 1.0]
)
_W_DEPTH = np.array(
    [0.0, 0.02, 0.25, 0.90, 1.0, 1.0, 0.90, 0.08, 0.08, 0.90, 1.0, 1.0, 0.90, 0.25, 0.02, 0.0]
)

#: The same of a thrie beam: three crests, which stand 0.194 m apart at a height of 0.506 m (AASHTO M 180, MASH
#: drawing RTM08a; a W-beam's stand 0.194 m apart, too).
_THRIE_HEIGHT = np.array(
    [
        0.0,
        0.03,
        0.06,
        0.09,
        0.15,
        0.21,
        0.24,
        0.28,
        0.33,
        0.38,
        0.41,
        0.47,
        0.53,
        0.59,
        0.62,
        0.67,
        0.72,
        0.76,
        0.79,
        0.85,
        0.91,
        0.94,
        0.97,
        1.0,
    ]
)
_THRIE_DEPTH = np.array(
    [
        0.0,
        0.02,
        0.25,
        0.9,
        1.0,
        0.9,
        0.5,
        0.08,
        0.0,
        0.08,
        0.5,
        0.9,
        1.0,
        0.9,
        0.5,
        0.08,
        0.0,
        0.08,
        0.5,
        0.9,
        1.0,
        0.25,
        0.02,
        0.0,
    ]
)
#: Outlines of closed beams from the lower edge round the back, as heights and depths from 0 to 1: a square tube, and a
#: round pipe of 12 sides.
_TURN = np.linspace(0.0, 2.0 * np.pi, 13)
_OUTLINES = {
    "w_beam": (_W_HEIGHT, _W_DEPTH),
    "thrie_beam": (_THRIE_HEIGHT, _THRIE_DEPTH),
    "box_beam": (np.array([0.0, 0.0, 1.0, 1.0, 0.0]), np.array([1.0, 0.0, 0.0, 1.0, 1.0])),
    "tube": (0.5 - 0.5 * np.cos(_TURN), 0.5 - 0.5 * np.sin(_TURN)),
    "cable_barrier": (0.5 - 0.5 * np.cos(_TURN), 0.5 - 0.5 * np.sin(_TURN)),
}

#: Flared ends do so over this length.
_FLARE_RUN_M = 8.0


def rail_top(rail: Rail) -> PiecewiseLinear:
    """Return the height of the beam's top edge over the road; sloped ends dip to 6 cm."""
    s, h = [rail.start_m, rail.end_m], [rail.top_m, rail.top_m]
    if rail.dip_start_m:
        s, h = [rail.start_m, rail.start_m + rail.dip_start_m, *s[1:]], [0.06, rail.top_m, *h[1:]]
    if rail.dip_end_m:
        s, h = [*s[:-1], rail.end_m - rail.dip_end_m, rail.end_m], [*h[:-1], rail.top_m, 0.06]
    return PiecewiseLinear(np.array(s), np.array(h))


def rail_offset(rail: Rail) -> PiecewiseLinear:
    """Return the offset of the middle of the corrugation: flared ends leave the road on a parabola."""
    run = np.linspace(0.0, 1.0, int(_FLARE_RUN_M / 0.5) + 1)
    away = -rail.faces * (1.0 - run) ** 2
    s, q = [np.array([rail.start_m, rail.end_m])], [np.full(2, rail.q_m)]
    if rail.flare_start_m:
        s.append(rail.start_m + _FLARE_RUN_M * run)
        q.append(rail.q_m + rail.flare_start_m * away)
    if rail.flare_end_m:
        s.append(rail.end_m - _FLARE_RUN_M * run)
        q.append(rail.q_m + rail.flare_end_m * away)
    # Of equal chainages the last given counts: an end that flares
    nodes, last = np.unique(np.concatenate(s)[::-1], return_index=True)
    return PiecewiseLinear(nodes, np.concatenate(q)[::-1][last])


def guardrail(road: Road, rail: Rail) -> Part:
    """Return a rail on posts; truth: the middle of its depth in plan, the top edge in height.

    W-beams and thrie beams are midway between crest and valley there, a box beam has its face towards the traffic half
    its depth before the line. Of a rail of pipes each pipe is a line; a cable barrier is one line, its highest rope.
    """
    top = rail_top(rail)
    offset = rail_offset(rail)
    s = np.unique(np.concatenate([road.stations_between(rail.start_m, rail.end_m), top.x, offset.x]))
    height, depth = _OUTLINES[rail.form]
    q = offset(s)[:, None] + rail.faces * rail.depth_m * (depth - 0.5)
    base = road.carriageway_height(s, rail.q_m)[:, None]
    at = np.unique(np.concatenate([road.truth_chainages(rail.start_m, rail.end_m), top.x, offset.x]))
    beams: list[Mesh] = []
    lines: list[TruthLine] = []
    for i in range(rail.n_beams):
        lower = i * rail.pitch_m
        above = np.maximum(top(s)[:, None] - lower, 0.0) + rail.beam_height_m * (height - 1.0)
        is_line = rail.form == "tube" or i == 0
        target = len(lines) if is_line else 0
        beams.append(sheet(road.place(s[:, None], q, base + above), Material.STEEL, target=target))
        if is_line:
            edge = road.carriageway_height(at, rail.q_m) + np.maximum(top(at) - lower, 0.0)
            lowest = rail.lower_m if rail.form != "tube" else rail.top_m - lower - rail.beam_height_m
            lines.append(
                TruthLine(
                    kind="guardrail",
                    form=rail.form,
                    xyz=road.place(at, offset(at), edge),
                    height_m=rail.top_m - lower,
                    lower_m=lowest,
                    n_beams=float(rail.n_beams) if rail.form == "cable_barrier" else 1.0,
                    width_m=rail.beam_height_m,
                )
            )
    return Part((*beams, *_rail_posts(road, rail, top, offset)), tuple(lines))


def _rail_posts(road: Road, rail: Rail, top: PiecewiseLinear, offset: PiecewiseLinear) -> tuple[Mesh, ...]:
    if not rail.has_posts:
        return ()
    s = np.arange(rail.start_m + 0.3, rail.end_m, rail.post_every_m)
    back = offset(s) - rail.faces * 0.5 * rail.depth_m
    q = back - rail.faces * (rail.post_behind_m + 0.055)
    foot = road.on_ground(s, q)
    crown = road.carriageway_height(s, rail.q_m) + top(s) - 0.03
    kept = crown - foot[:, 2] > 0.05
    size = np.stack([np.full(len(s), 0.06), np.full(len(s), 0.10), crown - foot[:, 2]], axis=1)
    posts = [boxes(foot[kept], road.alignment.heading(s)[kept], size[kept], Material.STEEL)]
    if rail.post_behind_m > 0.02:  # the spacer between post and beam
        block = road.place(s, back - rail.faces * 0.5 * rail.post_behind_m, crown - 0.22)
        spacer = (0.06, rail.post_behind_m, 0.18)
        posts.append(boxes(block[kept], road.alignment.heading(s)[kept], spacer, Material.STEEL))
    return tuple(posts)


def barrier(road: Road, wall: Barrier) -> Part:
    """Return a concrete barrier; truth: the top edge on each side that traffic passes."""
    s = road.stations_between(wall.start_m, wall.end_m)
    meshes: list[Mesh] = []
    lines: list[TruthLine] = []
    for side in (1, -1):
        out, up = _barrier_face(wall)
        points = _over_road(road, s, wall.q_m, side * out, up)
        target = len(lines) if side in wall.traffic else -1
        meshes.append(sheet(points, Material.CONCRETE, target))
        if side in wall.traffic:
            at = road.truth_chainages(wall.start_m, wall.end_m)
            edge = _over_road(road, at, wall.q_m, np.array([side * out[-1]]), up[-1:])[:, 0]
            lines.append(
                TruthLine(kind="barrier", form="concrete", xyz=edge, height_m=wall.height_m, lower_m=0.0)
            )
    half = 0.5 * wall.top_width_m
    lid = _over_road(road, s, wall.q_m, np.array([-half, half]), np.full(2, wall.height_m))
    meshes.append(sheet(lid, Material.CONCRETE))
    ends = np.array([wall.start_m, wall.end_m])
    feet = road.over_carriageway(ends, wall.q_m, -0.05)
    cap = (0.02, wall.top_width_m, wall.height_m + 0.05)
    meshes.append(boxes(feet, road.alignment.heading(ends), cap, Material.CONCRETE))
    return Part(tuple(meshes), tuple(lines))


def _barrier_face(wall: Barrier) -> tuple[FloatArray, FloatArray]:
    """Return distance from the middle and height of one face, from the foot up.

    The slopes of a New Jersey profile meet 0.33 m above the road, those of an F-shape 0.255 m (MASH; EN 1317-2 tests
    both), a step barrier (BS 6579-7) has its step at 0.25 m.
    """
    foot, half, h = 0.5 * wall.foot_width_m, 0.5 * wall.top_width_m, wall.height_m
    if wall.profile == "step":
        return np.array([foot, foot, foot - 0.06, half]), np.array([-0.05, 0.25, 0.27, h])
    if wall.profile == "f_shape":
        return np.array([foot, foot, half + 0.055, half]), np.array([-0.05, 0.075, 0.255, h])
    return np.array([foot, foot, half + 0.07, half]), np.array([-0.05, 0.08, 0.33, h])


def _over_road(road: Road, s: FloatArray, q: float, out: FloatArray, up: FloatArray) -> FloatArray:
    """Return (rows, cols, 3) points of a profile that stands at `q`, upright on the road's height there."""
    base = road.carriageway_height(s, q)[:, None]
    return road.place(s[:, None], q + out[None, :], base + up[None, :])


def fence(road: Road, spec: Fence) -> Part:
    """Return a fence of wire mesh, boards or tubes between posts; truth: its top edge."""
    s = road.stations_between(spec.start_m, spec.end_m)
    base = road.ground_height(s, spec.q_m)
    if spec.form == "mesh":
        bands = [(0.05, spec.height_m)]
        material = Material.MESH
    elif spec.form == "tubes":
        bands = [(0.5 * spec.height_m - 0.05, 0.5 * spec.height_m), (spec.height_m - 0.05, spec.height_m)]
        material = Material.STEEL
    else:
        n = max(2, int(spec.height_m / 0.35))
        bands = [(spec.height_m * (i + 1) / n - 0.12, spec.height_m * (i + 1) / n) for i in range(n)]
        material = Material.WOOD
    meshes = [
        sheet(
            np.stack([road.place(s, spec.q_m, base + low), road.place(s, spec.q_m, base + high)], axis=1),
            material,
            target=0,
        )
        for low, high in bands
    ]
    at = np.arange(spec.start_m, spec.end_m, spec.post_every_m)
    post = Material.WOOD if spec.form == "boards" else Material.STEEL
    radius = 0.05 if spec.form == "boards" else 0.03
    meshes.append(columns(road.on_ground(at, spec.q_m, -0.05), spec.height_m + 0.05, radius, post))
    top = road.on_ground(road.truth_chainages(spec.start_m, spec.end_m), spec.q_m, spec.height_m)
    return Part(tuple(meshes), (TruthLine(kind="fence", form=spec.form, xyz=top, height_m=spec.height_m),))
