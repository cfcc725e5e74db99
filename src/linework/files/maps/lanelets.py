"""Lanelets: lines cut where lanes begin and end, and the lanes between the pieces.

Separate from `lanelet2`, which writes them: here is how a map of ways becomes one of lanes, and what its validator asks of
vertices.
"""

from __future__ import annotations

from collections import defaultdict
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from linework.arrays import BoolArray, FloatArray, distance_along, offsets_of
from linework.lines.along import line_stretch
from linework.lines.lane_sections import lane_roads
from linework.model.lines import LINE_COLUMNS, VERTEX_COLUMNS, LineSet

#: Nearer vertices are reported by the validator of Lanelet2. [m]
NEAREST_M = 0.05


class Lanelet(NamedTuple):
    """A lane between two pieces of lines: their numbers, to the left and right, and its mean width [m]."""

    left: int
    right: int
    width_m: float


class LaneletMap(NamedTuple):
    """Lines in pieces, the lanelets between them, and the middles (east, north) [m] of stretches of lanes left out."""

    lines: LineSet
    lanelets: tuple[Lanelet, ...]
    left_out: tuple[tuple[float, float], ...]


def lanelet_map(lines: LineSet) -> LaneletMap:
    """Return lines cut where the lanes between them begin or end, and a lanelet per lane and stretch.

    A lanelet has one way on each side, and neighbours share it: on a stretch of a road all lanes begin and end at the
    same station. The pieces of a line that is cut have its id with a number.

    Parameters
    ----------
    lines
        With ids. [m, world]
    """
    length = [float(distance_along(line.xyz)[-1]) for line in lines]
    taken: dict[int, list[tuple[float, float]]] = defaultdict(list)
    wanted: list[tuple[tuple[int, float, float], tuple[int, float, float], float]] = []
    left_out: list[tuple[float, float]] = []
    for road in lane_roads(lines):
        for section in road.sections:
            spans = []
            for b, line in enumerate(section.bounds):
                a, z = sorted(section.along_m[[0, -1], b].tolist())
                spans.append((line, _snapped(a, length[line]), _snapped(z, length[line])))
            used = {k for j, is_lane in enumerate(section.is_lane) if is_lane for k in (j, j + 1)}
            # A line bounds two roads in one place only where its ends are uncertain: then the first has it
            if any(_overlaps(taken[spans[k][0]], spans[k]) for k in used):
                line, low, high = spans[min(used)]
                along = distance_along(lines[line].xyz)
                east, north = (
                    float(np.interp(0.5 * (low + high), along, v)) for v in lines[line].xyz[:, :2].T
                )
                left_out.append((east, north))
                continue
            for k in used:
                taken[spans[k][0]].append(spans[k][1:])
            for j in np.flatnonzero(section.is_lane).tolist():
                width = section.offset_m[:, j + 1] - section.offset_m[:, j]
                wanted.append((spans[j + 1], spans[j], float(width.mean())))
    pieces, number = _cut(lines, length, taken)
    lanelets = tuple(Lanelet(number[left], number[right], width) for left, right, width in wanted)
    return LaneletMap(pieces, lanelets, tuple(left_out))


def _snapped(at_m: float, length_m: float) -> float:
    """Return a distance along a line, at its end where a piece beyond would be shorter than vertices are apart."""
    return 0.0 if at_m < NEAREST_M else length_m if length_m - at_m < NEAREST_M else at_m


def _overlaps(taken: list[tuple[float, float]], span: tuple[int, float, float]) -> bool:
    _, low, high = span
    return high - low < NEAREST_M or any(a < high - 1e-9 and low < b - 1e-9 for a, b in taken)


def _cut(
    lines: LineSet, length: list[float], taken: dict[int, list[tuple[float, float]]]
) -> tuple[LineSet, dict[tuple[int, float, float], int]]:
    """Return the pieces of all lines in order, and the number of each span among them."""
    found: list[LineSet] = []
    number: dict[tuple[int, float, float], int] = {}
    for i in range(len(lines)):
        own = lines.take([i])
        cuts = sorted({0.0, length[i], *(at for span in taken.get(i, []) for at in span)})
        for k, (a, b) in enumerate(pairwise(cuts)):
            if len(cuts) == 2:
                piece = own
            else:
                name = f"{own.id[0]}.{k + 1}"
                piece = line_stretch(own, a, b).with_columns(id=[name])
            number[i, a, b] = len(found)
            found.append(piece)
    return LineSet.concatenate(found) if found else lines, number


def set_apart(lines: LineSet) -> LineSet:
    """Return the lines without vertices nearer than `NEAREST_M` to the one before; the ends of a line stay.

    >>> lines = LineSet.from_lines([[[0, 0, 0], [0.01, 0, 0], [1, 0, 0], [1.02, 0, 0]]])
    >>> set_apart(lines).xyz[:, 0].tolist()
    [0.0, 1.02]
    """
    kept = np.zeros(len(lines.xyz), dtype=bool)
    for first, last in zip(lines.offsets[:-1], lines.offsets[1:], strict=True):
        kept[first:last] = _kept(lines.xyz[first:last])
    counts = np.add.reduceat(kept, lines.offsets[:-1]) if len(lines) else np.zeros(0, dtype=np.int64)
    offsets = offsets_of(counts)
    columns = {name: getattr(lines, name)[kept] for name in VERTEX_COLUMNS}
    columns |= {name: getattr(lines, name) for name in LINE_COLUMNS}
    return LineSet(xyz=lines.xyz[kept], offsets=offsets, crs=lines.crs, **columns)


def _kept(xyz: FloatArray) -> BoolArray:
    """Return (n,) bool: the first vertex, each at least `NEAREST_M` from the one kept before it, and the last."""
    kept = np.zeros(len(xyz), dtype=bool)
    before = xyz[0]
    kept[0] = kept[-1] = True
    for i in range(1, len(xyz) - 1):
        is_far = np.linalg.norm(xyz[i] - before) >= NEAREST_M
        if is_far and np.linalg.norm(xyz[-1] - xyz[i]) >= NEAREST_M:
            kept[i], before = True, xyz[i]
    return kept
