"""The shape of every method: look at each piece of a survey, then join the evidence of all pieces into lines."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import Any, Literal, Protocol, Self, TypeVar

import numpy as np

from linework.arrays import BoolArray, FloatArray, IntArray
from linework.methods.point_order import in_fixed_order
from linework.model.camera import RectifiedRig
from linework.model.grid import Bounds
from linework.model.ground import Ground
from linework.model.images import Poses
from linework.model.lines import LineSet
from linework.model.tile import TileData, local_origin
from linework.surface.road import RoadConfig, find_ground

#: Interval at which the straight line between two places is tested for visibility, half a surface cell. [m]
VISIBLE_STEP_M = 0.25
#: The recordings that a method may look at: laser points in tiles, or stereo pairs.
Recording = Literal["points", "pairs"]
#: Returns for (n, 2) places [m] whether road or ground was measured there: (n,).
Sight = Callable[[FloatArray], BoolArray]


class Evidence(Protocol):
    """What a method finds in pieces of a survey: a frozen dataclass of columns (`linework.files.output.parts`)."""

    def __len__(self) -> int:
        """Return the number of boxes, lines or sightings."""
        ...

    @classmethod
    def empty(cls) -> Self:
        """Return evidence of nothing."""
        ...

    @classmethod
    def concatenate(cls, sets: Iterable[Self], /) -> Self:
        """Return the evidence of several pieces, in their order."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class SurveyContext:
    """What is known of the whole survey when the evidence of its pieces is joined.

    Parameters
    ----------
    origin
        Local origin that all tiles share. [m, world]
    is_visible
        Returns for (n, 2) places [m, world] whether road or ground was measured there; None: everywhere.
    path
        (n, 3) positions of the vehicle [m, world], or None.
    cores
        Cores of the method's tiles, also of those that failed.
    poses
        Of the vehicle when the stereo pairs were taken.
    rig
        Geometry of the rectified pairs.
    pair_numbers
        (n,) int64: the pair that each pose belongs to, ascending; None: pose i belongs to pair i.
    """

    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)
    is_visible: Sight | None = None
    path: FloatArray | None = None
    cores: tuple[Bounds, ...] = ()
    poses: Poses | None = None
    rig: RectifiedRig | None = None
    pair_numbers: IntArray | None = None


PieceT = TypeVar("PieceT", contravariant=True)
EvidenceT = TypeVar("EvidenceT", bound=Evidence)


class Method(Protocol[PieceT, EvidenceT]):
    """A method of finding lines: `look` at every piece of a survey, `join` once over all of them.

    A method may be used for many pieces, at the same time and in any order: it has no state, and the same piece
    always gives the same evidence.
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
    def recording(self) -> Recording:
        """What its pieces are: tiles of laser points (`TileData`), or stereo pairs (`RectifiedPair`)."""
        ...

    @property
    def evidence(self) -> type[EvidenceT]:
        """Type of what it finds in a piece."""
        ...

    @property
    def buffer_m(self) -> float:
        """Width of the margin of points that a tile needs around its core [m]; 0 for stereo pairs."""
        ...

    @property
    def least_height_m(self) -> float:
        """Lowest height above ground that matters to it [m]: lower points are not loaded; -inf: all are."""
        ...

    def look(self, piece: PieceT) -> EvidenceT:
        """Return the evidence in a piece."""
        ...

    def join(self, found: EvidenceT, survey: SurveyContext) -> LineSet:
        """Return the lines of a survey in world coordinates.

        Parameters
        ----------
        found
            Evidence of all pieces, in the order of the pieces.
        survey
            What is known of the survey as a whole.
        """
        ...


#: A method of any kind of piece and evidence.
AnyMethod = Method[Any, Any]


# A tile that is a survey of its own


def extract_tile(method: Method[TileData, EvidenceT], tile: TileData) -> LineSet:
    """Return the lines of a tile that is a survey of its own: one look, then the join.

    The points are put into a fixed order first: the lines do not depend on the order in which they come.

    Raises
    ------
    UsageError
        A coordinate, time or intensity is not a finite number.
    """
    if len(tile.points) == 0:
        return LineSet.empty()
    tile = replace(tile, points=in_fixed_order(tile.points))
    surface = surface_of_tile(tile)
    tile = replace(tile, surface=surface)
    survey = SurveyContext(
        origin=origin_of_tile(tile),
        is_visible=sight_of(surface),
        path=None if tile.trajectory is None else tile.trajectory.xyz,
        cores=(tile.core,),
    )
    return method.join(method.look(tile), survey)


def surface_of_tile(tile: TileData) -> Ground:
    """Return road and ground of a tile: the survey's, or found in the tile's points."""
    return tile.surface or find_ground(tile.points, tile.trajectory, RoadConfig())


def origin_of_tile(tile: TileData) -> tuple[float, float, float]:
    """Return the local origin of a tile [m, world]: the survey's, or made from the tile's points."""
    if tile.origin is not None:
        return tile.origin
    bounds = tile.points.bounds
    return local_origin(bounds.west, bounds.south, surface_of_tile(tile).z0_m)


# Visibility: a gap in a line either was measured and is empty, or was hidden from the sensor


def sight_of(surface: Ground) -> Sight:
    """Return the visibility of a surface: true in cells where road or ground was measured."""
    measured, grid = surface.is_road | surface.is_ground, surface.grid

    def is_visible(xy: FloatArray) -> BoolArray:
        rows, cols = (np.floor(v).astype(np.int64) for v in grid.to_cell(xy))
        inside = (rows >= 0) & (rows < grid.n_rows) & (cols >= 0) & (cols < grid.n_cols)
        out = np.zeros(len(xy), dtype=np.bool_)
        out[inside] = measured[rows[inside], cols[inside]]
        return out

    return is_visible


def visible_share(is_visible: Sight, start: FloatArray, end: FloatArray) -> float:
    """Return the visible share of the straight line between two places (2,) or (3,) [m], 0 to 1."""
    n = max(int(np.hypot(*(end[:2] - start[:2])) / VISIBLE_STEP_M), 1)
    along = (np.arange(n) + 0.5)[:, None] / n
    return float(np.mean(is_visible(start[:2] + along * (end[:2] - start[:2]))))
