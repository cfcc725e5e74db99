"""The shape of every method: look at each piece of a survey, then join the evidence of all pieces into lines."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import Any, Literal, Protocol, Self, runtime_checkable

import numpy as np

from linework.arrays import BoolArray, FloatArray, IntArray
from linework.crs import parse_crs
from linework.errors import OwnCodeError, argument
from linework.methods.point_order import in_fixed_order
from linework.methods.seams import across_seams, of_core
from linework.model.camera import RectifiedRig
from linework.model.grid import Bounds
from linework.model.ground import Ground
from linework.model.images import Poses
from linework.model.lines import LineSet
from linework.model.points import Points
from linework.model.tile import ScannerTiming, TileData, local_origin
from linework.model.trajectory import Trajectory
from linework.processes.identity import is_installed
from linework.processes.own_code import call_own
from linework.scanlines.sampled import gains_of_points, timing_of_points
from linework.surface.cells import CellWindow
from linework.surface.road import RoadConfig, find_ground

#: Interval at which the straight line between two places is tested for visibility, half a surface cell. [m]
VISIBLE_STEP_M = 0.25
#: Margin of points around the core of a tile for methods that do not state theirs: that of guardrails. [m]
OWN_BUFFER_M = 64.0
#: The recordings that a method may look at: laser points in tiles, or stereo pairs.
Recording = Literal["points", "pairs"]
#: Returns for (n, 2) places [m] whether road or ground was measured there: (n,).
Sight = Callable[[FloatArray], BoolArray]


#: Name and result of a step of a method.
StepResult = tuple[str, Any]


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
    shows_paint
        Whether paint can be seen everywhere: the points have brightness, and all of the survey is looked at.
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
    shows_paint: bool = False
    poses: Poses | None = None
    rig: RectifiedRig | None = None
    pair_numbers: IntArray | None = None


@runtime_checkable
class Method(Protocol):
    """A method of finding lines: `look` at every piece of a survey, `join` once over all of them.

    A class of your own that inherits from it needs a `name`, the `kinds` of line that it finds, and `look`: that
    is a whole method, which runs on arrays and on surveys of any size, in tiles and worker processes.

    Notes
    -----
    A method may be used for many pieces, at the same time, in any order and in other processes: it has no state,
    and the same piece always gives the same evidence.

    The rest has defaults, for methods that find lines in the points of a tile: the lines of each tile are cut at the
    edges of its core, and those that meet there are joined. They meet if a line does not depend on points farther
    from it than `buffer_m`.

    Kinds of line may be your own: each gets a layer of its name in the output.

    Examples
    --------
    >>> class HighestPoints(Method):
    ...     name = "highest"
    ...     kinds = ("ridge",)
    ...
    ...     def look(self, piece):
    ...         xyz = piece.points.xyz
    ...         highest = xyz[np.argsort(xyz[:, 2])[-2:]]
    ...         return LineSet.from_lines([highest[np.argsort(highest[:, 0])]], kind=["ridge"])
    >>> points = Points([[0.0, 0.0, 5.0], [4.0, 0.0, 1.0], [8.0, 0.0, 6.0]])
    >>> lines = extract_tile(HighestPoints(), tile_of(points))
    >>> lines.xyz[:, 0].tolist(), lines.method.tolist()
    ([0.0, 8.0], ['highest'])
    """

    @property
    @abstractmethod
    def name(self) -> str:
        """Name that users type: radon, obb, stereo."""
        ...

    @property
    @abstractmethod
    def kinds(self) -> tuple[str, ...]:
        """Kinds of line it looks for: names of `linework.model.lines.KINDS`, or its own."""
        ...

    @property
    def recording(self) -> Recording:
        """What its pieces are: tiles of laser points (`TileData`), or stereo pairs (`RectifiedPair`)."""
        return "points"

    @property
    def evidence(self) -> type[Any]:
        """Type of what it finds in a piece."""
        return LineSet

    @property
    def buffer_m(self) -> float:
        """Width of the margin of points that a tile needs around its core [m]; 0 for stereo pairs."""
        return OWN_BUFFER_M

    @property
    def least_height_m(self) -> float:
        """Lowest height above ground that matters to it [m]: lower points are not loaded; -inf: all are."""
        return -math.inf

    @property
    def carry(self) -> tuple[str, ...]:
        """Names of the further columns of the points that it needs: extra dimensions of laser files."""
        return ()

    @abstractmethod
    def look(self, piece: Any) -> Any:
        """Return the evidence in a piece: for most methods the lines in a tile of points (`TileData`)."""
        ...

    def join(self, found: Any, survey: SurveyContext) -> LineSet:
        """Return the lines of a survey in world coordinates.

        Parameters
        ----------
        found
            Evidence of all pieces, in the order of the pieces.
        survey
            What is known of the survey as a whole.

        Notes
        -----
        By default, lines that meet at the edges of tiles are joined.
        """
        lines: LineSet = across_seams(found, survey.cores)
        return lines


def look_at(method: Method, piece: Any) -> Any:
    """Return the evidence of a method in a piece; of lines that an own method finds, those of the core.

    Raises
    ------
    OwnCodeError
        `look` of an own method failed, or returned something else than it says.
    """
    if not is_own(method):
        return method.look(piece)
    found = call_own(method.look, method.name, piece)
    problem = None
    if not isinstance(found, method.evidence):
        problem = f"look returned {type(found).__name__}, expected {method.evidence.__name__}"
    elif isinstance(found, LineSet):
        others = sorted(set(found.kind.tolist()) - set(method.kinds))
        if others:
            problem = (
                f"look returned lines of kind {', '.join(map(repr, others))}, its kinds are {method.kinds}"
            )
    if problem:
        raise OwnCodeError(problem, where=method.name)
    if isinstance(found, LineSet):
        names = np.where(found.method == "", method.name, found.method)
        found = found.with_columns(method=names.astype(np.str_), crs="local")
        if isinstance(piece, TileData):
            found = of_core(found, piece.core, is_whole=piece.is_whole)
    return found


def is_own(method: Method) -> bool:
    """Return whether a method is not one of linework's."""
    own = type(method)
    return not (own.__module__.startswith("linework.") and is_installed(own))


# A tile that is a survey of its own


def tile_of(points: Points, trajectory: Trajectory | None = None, ground: Ground | None = None) -> TileData:
    """Return points as a tile that is a survey of its own."""
    core = points.bounds if len(points) else Bounds(0.0, 0.0, 0.0, 0.0)
    return TileData("points", core, points, trajectory, surface=ground, gains=gains_of_points(points))


def extract_tile(method: Method, tile: TileData) -> LineSet:
    """Return the lines of a tile that is a survey of its own: one look, then the join.

    The points are put into a fixed order first: the lines do not depend on the order in which they come.

    Raises
    ------
    UsageError
        A coordinate, time or intensity is not a finite number.
    CrsError
        The CRS of the points is not known, or not one in which lengths can be measured.
    """
    crs = parse_crs(tile.points.crs, where=argument("crs"))
    if len(tile.points) == 0:
        return LineSet.empty().with_columns(crs=crs)
    tile = whole_tile(tile)
    return method.join(look_at(method, tile), context_of_tile(tile)).with_columns(crs=crs)


def whole_tile(tile: TileData) -> TileData:
    """Return a tile with its points in a fixed order, and its surface, found in them where it brings none.

    Raises
    ------
    UsageError
        A coordinate, time or intensity is not a finite number.
    """
    tile = replace(tile, points=in_fixed_order(tile.points))
    return replace(tile, surface=surface_of_tile(tile))


def context_of_tile(tile: TileData) -> SurveyContext:
    """Return what is known of a survey that is one tile, with its surface."""
    return SurveyContext(
        origin=origin_of_tile(tile),
        is_visible=sight_of(surface_of_tile(tile)),
        path=None if tile.trajectory is None else tile.trajectory.xyz,
        cores=(tile.core,),
        shows_paint=tile.points.intensity is not None and bool(tile.points.intensity.any()),
    )


def surface_of_tile(tile: TileData) -> Ground:
    """Return road and ground of a tile: the survey's, or found in the tile's points.

    Own ground on a grid that is not on the lattice of its cells is brought to that of the default cells.
    """
    if tile.surface is None:
        return find_ground(tile.points, tile.trajectory)
    if tile.surface.is_on_lattice:
        return tile.surface
    cell_m = RoadConfig().cell_m
    return tile.surface.on_grid(CellWindow.over(tile.points.bounds, cell_m).grid(cell_m))


def scanner_of_tile(tile: TileData) -> ScannerTiming:
    """Return what is known of the scanner of a tile: the survey's, or found in the tile's points."""
    return timing_of_points(tile.points) if tile.scanner is None else tile.scanner


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
