"""Walls, facades with windows, bridges."""

from __future__ import annotations

import itertools

import numpy as np

from linework.simulation.materials import Material
from linework.simulation.meshes import boxes, columns, prism, sheet
from linework.simulation.part import Part
from linework.simulation.road import Road
from linework.simulation.scenario import Bridge, Gantry, Wall

_WALL_THICK_M = 0.25


def wall(road: Road, spec: Wall) -> Part:
    """Return a wall (face, top, back) or a facade with rows of windows set 12 cm back."""
    s = road.stations_between(spec.start_m, spec.end_m)
    outward = np.sign(spec.q_m)
    base = road.ground_height(s, spec.q_m) - 0.1
    if not spec.is_facade:
        out = outward * np.array([0.0, 0.0, _WALL_THICK_M, _WALL_THICK_M])
        # A wall's top is level in steps of its own length: here it follows the ground
        up = np.array([0.0, spec.height_m + 0.1, spec.height_m + 0.1, 0.0])
        points = road.place(s[:, None], spec.q_m + out[None], base[:, None] + up[None])
        return Part((sheet(points, Material.WALL),))
    level = float(base.min())
    meshes = []
    edges = np.arange(spec.start_m, spec.end_m + 1e-6, 1.4)
    for i, (a, b) in enumerate(itertools.pairwise(edges)):
        is_bay = i % 2 == 1
        rows = np.unique(np.concatenate([[0.0, spec.height_m], np.arange(1.0, spec.height_m, 1.5)]))
        for j, (low, high) in enumerate(itertools.pairwise(rows)):
            is_window = is_bay and j % 2 == 1
            q = spec.q_m + outward * (0.12 if is_window else 0.0)
            corner = road.place(np.array([[a, a], [b, b]]), q, np.array([[level + low, level + high]] * 2))
            meshes.append(sheet(corner, Material.GLASS if is_window else Material.WALL))
    return Part(tuple(meshes))


def bridge(road: Road, spec: Bridge) -> Part:
    """Return a bridge's deck over the road and its columns."""
    reach = max(road.left.width_m, road.right.width_m) + 14.0
    half = 0.5 * spec.width_m
    s = spec.s_m + np.array([-half, half, half, -half])
    q = np.array([reach, reach, -reach, -reach])
    across = np.linspace(-road.right.width_m, road.left.width_m, 9)
    top_of_road = float(np.max(road.carriageway_height(spec.s_m + np.array([[-half], [half]]), across)))
    low = road.place(s, q, top_of_road + spec.clearance_m)
    deck = prism(low, low + np.array([0.0, 0.0, 1.2]), Material.CONCRETE)
    feet = np.concatenate(
        [
            road.on_ground(
                np.array([spec.s_m - 0.3 * half, spec.s_m + 0.3 * half]),
                sign * (road.side(sign).width_m + 3.0),
            )
            for sign in (1, -1)
        ]
    )
    return Part((deck, columns(feet, spec.clearance_m + 1.0, 0.45, Material.CONCRETE)))


def gantry(road: Road, spec: Gantry) -> Part:
    """Return a sign gantry: two columns, four thin straight chords across the road, a panel on them."""
    across = np.linspace(spec.right_m, spec.left_m, 9)
    level = float(np.max(road.carriageway_height(spec.s_m, across))) + spec.clearance_m
    middle, span = 0.5 * (spec.right_m + spec.left_m), spec.left_m - spec.right_m
    heading = np.full(1, float(road.alignment.heading(spec.s_m)))
    chords = [
        boxes(
            road.place(spec.s_m + ahead, middle, level + up)[None],
            heading,
            (0.12, span, 0.12),
            Material.STEEL,
        )
        for ahead in (-0.4, 0.4)
        for up in (0.0, 0.9)
    ]
    feet = road.on_ground(spec.s_m, np.array([spec.right_m, spec.left_m]))
    posts = columns(feet, level + 1.1 - feet[:, 2], 0.25, Material.STEEL)
    panel = road.place(spec.s_m - 0.6, spec.right_m + 0.3 * span, level - 0.2)[None]
    return Part((*chords, posts, boxes(panel, heading, (0.05, 3.5, 2.2), Material.SIGN)))
