"""Boxes of an opened survey, found on demand."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence

import numpy as np

from linework.arrays import FloatArray
from linework.files.store.read import PointStore
from linework.methods.obb.method import Obb
from linework.model.boxes import BoxSet
from linework.model.grid import Bounds
from linework.model.tile import TileData
from linework.runs.opened.surface import SurveySurface
from linework.scanlines.sampled import sampled_gains

#: Side of the blocks in which boxes are found: the width of the buffer of points around each, so that few points are
#: read twice, and few that are not near the line. [m]
BOX_BLOCK_M = 8.0
#: Blocks that are kept, some kilobytes each: 25 km of a line and its surroundings. [blocks]
MOST_BLOCKS = 20_000
Block = tuple[int, int]
#: First and last block.
Rectangle = tuple[Block, Block]


class SurveyBoxes:
    """The boxes of a survey, as far as they were needed so far.

    Parameters
    ----------
    detectors
        Methods that find boxes, by the kind of line.
    origin
        Local origin of the survey [m, world].
    """

    def __init__(
        self,
        store: PointStore,
        surface: SurveySurface,
        detectors: Mapping[str, Obb],
        origin: tuple[float, float, float],
    ) -> None:
        self._store, self._surface, self._origin = store, surface, origin
        self.detectors = detectors
        self._gains = sampled_gains(*store.block_counts, store.points)
        self._found: dict[tuple[str, Block], BoxSet] = {}

    def of(self, kind: str, blocks: Iterable[Block]) -> list[BoxSet]:
        """Return the boxes of each block that has any [m, from the local origin]."""
        wanted = list(blocks)
        missing = rectangles({block for block in wanted if (kind, block) not in self._found})
        is_near = _is_near(missing, self.detectors[kind].buffer_m)
        for parts in [missing] if is_near else [[one] for one in missing]:
            self._find(kind, parts)
        found = [self._found[kind, block] for block in wanted]
        while len(self._found) > MOST_BLOCKS:
            del self._found[next(iter(self._found))]
        return [boxes for boxes in found if len(boxes)]

    def _find(self, kind: str, parts: Sequence[Rectangle]) -> None:
        """Find the boxes of some blocks, all in the same points."""
        cores = [_bounds(part) for part in parts]
        boxes = BoxSet.empty()
        if any(self._store.count_in(core) for core in cores):
            boxes = self._detect(kind, cores)
        number = np.floor((boxes.centre[:, :2] + self._origin[:2]) / BOX_BLOCK_M).astype(np.int64)
        for col, row in (block for part in parts for block in _blocks(part)):
            inside = (number[:, 0] == col) & (number[:, 1] == row)
            self._found[kind, (col, row)] = boxes.take(inside)

    def _detect(self, kind: str, cores: list[Bounds]) -> BoxSet:
        whole = _about(cores)
        detector = self.detectors[kind]
        extent = whole.grown(detector.buffer_m)
        points = self._store.points(extent)
        if len(points) == 0:
            return BoxSet.empty()
        surface = self._surface.over(extent)
        tile = TileData("trace", whole, points, None, "", surface, self._origin, gains=self._gains)
        return detector.find_boxes(tile, cores)


class Corridor:
    """The boxes along one line, as far as they were looked for.

    Boxes that were found for other lines are not in it: so a line is the same whatever was followed before.
    """

    def __init__(self, survey: SurveyBoxes) -> None:
        self._survey = survey
        self._asked: dict[str, set[Block]] = {kind: set() for kind in survey.detectors}
        self._boxes = BoxSet.empty()

    @property
    def boxes(self) -> BoxSet:
        """All boxes found so far [m, from the local origin]."""
        return self._boxes

    @property
    def bounds(self) -> Bounds:
        """Extent of the blocks that were looked at [m, world]."""
        blocks = np.array([block for asked in self._asked.values() for block in asked], dtype=np.float64)
        (west, south), (east, north) = blocks.min(axis=0), blocks.max(axis=0) + 1.0
        return Bounds(west * BOX_BLOCK_M, south * BOX_BLOCK_M, east * BOX_BLOCK_M, north * BOX_BLOCK_M)

    def load(self, places: FloatArray, reach_m: float | FloatArray, kind: str = "") -> bool:
        """Find all boxes within `reach_m` of places (n, 2) [m, world]; return whether any were added.

        Parameters
        ----------
        kind
            Of line; "": all of them.
        """
        reach = np.broadcast_to(np.asarray(reach_m, dtype=np.float64), len(places))[:, None]
        low = np.floor((places - reach) / BOX_BLOCK_M).astype(np.int64)
        high = np.floor((places + reach) / BOX_BLOCK_M).astype(np.int64)
        asked = {
            (col, row)
            for (west, south), (east, north) in zip(low.tolist(), high.tolist(), strict=True)
            for row in range(south, north + 1)
            for col in range(west, east + 1)
        }
        found: list[BoxSet] = []
        for one in (kind,) if kind else self._asked:
            # In an order that depends on the places only
            found += self._survey.of(one, sorted(asked - self._asked[one]))
            self._asked[one] |= asked
        self._boxes = BoxSet.concatenate([self._boxes, *found])
        return bool(found)


def rectangles(blocks: set[Block]) -> list[Rectangle]:
    """Return disjoint rectangles (first and last block) that hold all blocks and no others.

    >>> rectangles({(0, 0), (1, 0), (0, 1), (1, 1), (5, 1)})
    [((0, 0), (1, 1)), ((5, 1), (5, 1))]
    """
    left, found = set(blocks), []
    for col, row in sorted(blocks, key=lambda block: (block[1], block[0])):
        if (col, row) not in left:
            continue
        east = col
        while (east + 1, row) in left:
            east += 1
        north = row
        while all((c, north + 1) in left for c in range(col, east + 1)):
            north += 1
        left -= {(c, r) for c in range(col, east + 1) for r in range(row, north + 1)}
        found.append(((col, row), (east, north)))
    return found


def _is_near(parts: Sequence[Rectangle], buffer_m: float) -> bool:
    """Return whether rectangles are so near one another that reading their points at once is cheaper."""
    if not parts:
        return False
    cores = [_bounds(part) for part in parts]
    return _area(_about(cores).grown(buffer_m)) <= sum(_area(core.grown(buffer_m)) for core in cores)


def _bounds(part: Rectangle) -> Bounds:
    (west, south), (east, north) = part
    return Bounds(
        west * BOX_BLOCK_M, south * BOX_BLOCK_M, (east + 1) * BOX_BLOCK_M, (north + 1) * BOX_BLOCK_M
    )


def _blocks(part: Rectangle) -> Iterator[Block]:
    (west, south), (east, north) = part
    return ((col, row) for col in range(west, east + 1) for row in range(south, north + 1))


def _about(cores: Sequence[Bounds]) -> Bounds:
    west, south, east, north = np.array(cores).T
    return Bounds(float(west.min()), float(south.min()), float(east.max()), float(north.max()))


def _area(bounds: Bounds) -> float:
    return (bounds.east - bounds.west) * (bounds.north - bounds.south)
