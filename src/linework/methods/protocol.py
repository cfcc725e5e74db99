"""What every method is to the one who runs it: kinds, a buffer, and lines out of a tile."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol, runtime_checkable

import numpy as np

from linework.arrays import BoolArray, FloatArray
from linework.model.boxes import BoxSet
from linework.model.lines import LineSet
from linework.model.tile import RoadSurface, TileData


class Method(Protocol):
    """A way to find lines in a tile.

    A method may be used for many tiles, at the same time, in any order: it keeps nothing from one to the
    next, and the same tile gives the same lines.
    """

    @property
    def name(self) -> str:
        """Name that users type: radon, obb, stereo."""
        ...

    @property
    def kinds(self) -> tuple[str, ...]:
        """Kinds of line it looks for, names of `linework.model.lines.KINDS`."""
        ...

    @property
    def buffer_m(self) -> float:
        """Width of the margin of points around a core that makes the lines in the core whole, in metres."""
        ...

    @property
    def least_height_m(self) -> float:
        """How high above the ground points must be to matter to it, in metres; lower ones are not loaded."""
        ...

    def extract(self, tile: TileData) -> LineSet:
        """Return the lines that the tile's core answers for."""
        ...


@runtime_checkable
class BoxMethod(Method, Protocol):
    """A method whose lines have a memory: it finds boxes in tiles, and tracks lines through those of all tiles."""

    def detect(self, tile: TileData) -> BoxSet:
        """Return the boxes in a tile; those whose centre lies in the core are kept."""
        ...

    def track(
        self,
        boxes: BoxSet,
        origin: tuple[float, float, float],
        seen: Sight,
        path: FloatArray | None = None,
    ) -> LineSet:
        """Return the lines through the boxes of a survey, in world coordinates.

        Parameters
        ----------
        origin
            The local origin of the boxes. [m, world]
        seen
            Says where road or ground was measured.
        path
            (n, 3) where the vehicle was [m, world], or None.
        """
        ...


# Was there anything to see: gaps in a line where the ground was measured, and gaps where it was hidden

#: Says for (n, 2) places [m] whether road or ground was measured there: (n,).
Sight = Callable[[FloatArray], BoolArray]


def sight_of(surface: RoadSurface) -> Sight:
    """Return the sight of a surface: places in the world in a cell of road or ground that was measured."""
    measured, grid = surface.is_road | surface.is_ground, surface.grid

    def seen(xy: FloatArray) -> BoolArray:
        rows, cols = (np.floor(v).astype(np.int64) for v in grid.to_cell(xy))
        inside = (rows >= 0) & (rows < grid.n_rows) & (cols >= 0) & (cols < grid.n_cols)
        out = np.zeros(len(xy), dtype=np.bool_)
        out[inside] = measured[rows[inside], cols[inside]]
        return out

    return seen


def visible_share(seen: Sight, start: FloatArray, end: FloatArray) -> float:
    """Return the share of the straight way between two places, 0 to 1, that was seen."""
    n = max(int(np.hypot(*(end[:2] - start[:2])) / 0.25), 1)
    along = (np.arange(n) + 0.5)[:, None] / n
    return float(np.mean(seen(start[:2] + along * (end[:2] - start[:2]))))
