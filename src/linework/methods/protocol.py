"""What every method is to the one who runs it: kinds, a buffer, and lines out of a tile."""

from __future__ import annotations

from typing import Protocol, runtime_checkable

from linework.arrays import FloatArray
from linework.methods.sight import Sight
from linework.model.boxes import BoxSet
from linework.model.lines import LineSet
from linework.model.tile import TileData


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
