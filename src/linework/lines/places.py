"""Places along lines, equally far apart, and the stretches between them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from linework.arrays import BoolArray, FloatArray, IntArray
from linework.model.lines import LINE_COLUMNS, VERTEX_COLUMNS, LineSet

#: Places compared are so far apart along a line. [m]
STEP_M = 0.25


@dataclass(frozen=True, slots=True)
class Places:
    """k places along lines, every `STEP_M`: (k, 3), unit directions in plan, the line, its sigma, chainage."""

    xyz: FloatArray
    way: FloatArray
    line: IntArray
    chainage_m: FloatArray
    sigma_m: FloatArray


def places_along(lines: LineSet) -> Places:
    """Return places every `STEP_M` along each line, its ends among them."""
    found = []
    for i in range(len(lines)):
        xyz, sigma = lines.line(i), lines.sigma_xy_m[lines.offsets[i] : lines.offsets[i + 1]]
        along = chainage_of(xyz)
        n = max(int(np.ceil(along[-1] / STEP_M)), 1) + 1
        at = np.linspace(0.0, along[-1], n)
        place = np.stack([np.interp(at, along, column) for column in xyz.T], axis=1)
        way = np.gradient(place[:, :2], axis=0)
        way /= np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-12)
        found.append((place, way, np.full(n, i), at, np.interp(at, along, sigma)))
    xyz, way, line, at, sigma = (np.concatenate(column) for column in zip(*found, strict=True))
    return Places(xyz, way, line.astype(np.int64), at, sigma)


def chainage_of(xyz: FloatArray) -> FloatArray:
    """Return (n,) the way to each vertex [m], in plan."""
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(xyz[:, :2], axis=0), axis=1))])


def runs_of(mask: BoolArray) -> list[tuple[int, int]]:
    """Return first and last index of each run of True.

    >>> runs_of(np.array([True, False, True, True]))
    [(0, 0), (2, 3)]
    """
    edges = np.flatnonzero(np.diff(np.concatenate([[0], mask.astype(np.int8), [0]])))
    return [(int(a), int(b) - 1) for a, b in edges.reshape(-1, 2)]


def stretch(line: LineSet, start_m: float, end_m: float) -> LineSet:
    """Return a line from one chainage to another, its vertices and new ones at both ends."""
    along = chainage_of(line.xyz)
    inside = np.flatnonzero((along > start_m + 1e-6) & (along < end_m - 1e-6))
    at = np.concatenate([[start_m], along[inside], [end_m]])
    xyz = np.stack([np.interp(at, along, column) for column in line.xyz.T], axis=1)
    nearest = np.clip(np.searchsorted(along, at), 0, len(along) - 1)
    columns = {name: getattr(line, name)[nearest] for name in VERTEX_COLUMNS}
    columns |= {name: getattr(line, name) for name in LINE_COLUMNS}
    return LineSet.from_lines([xyz], crs=line.crs, **columns)
