"""Guardrails whose end dips into the ground go on until they reach it."""

from __future__ import annotations

import numpy as np

from linework.arrays import FloatArray
from linework.model.lines import LINE_COLUMNS, VERTEX_COLUMNS, LineSet
from linework.surface.road import RoadSurface, height_above_ground

#: An end lower than this, and falling, is on its way into the ground: beams end at half a metre or more.
LOW_END_M = 0.30
#: The gentlest dip in use: 0.7 m over 12 m.
LEAST_FALL = 0.05
#: Height of the top edge at which a beam counts as sunk: the ground's noise and grass.
SUNK_M = 0.06
#: No further than two stations beyond what was measured: the fall there is known from a smoothed edge.
LONGEST_M = 1.0


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
    further = min((height[0] - SUNK_M) / fall, LONGEST_M)
    end = xyz[0] + back / run * further
    end[2] = xyz[0, 2] - further * fall
    at = 0 if first else len(line.xyz)
    columns = {c: getattr(line, c) for c in LINE_COLUMNS}
    for name in VERTEX_COLUMNS:
        own = getattr(line, name)
        columns[name] = np.insert(own, at, True if name == "bridged" else own[0 if first else -1])
    vertices = np.insert(line.xyz, at, end, axis=0)
    return LineSet(xyz=vertices, offsets=np.array([0, len(vertices)]), crs=line.crs, **columns)
