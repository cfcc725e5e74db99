"""The obb method on a page: lane markings and road boundaries by tracking oriented bounding boxes.

S. Kang, J. Lee, J. Lee (2023): Developing a method to automatically extract road boundary and linear road markings from
a mobile mapping system point cloud using oriented bounding box collision-detection techniques, Remote Sensing 15(19),
4656, doi:10.3390/rs15194656. docs/methods/obb.md names what goes beyond the paper.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np

from linework.methods.obb import joining
from linework.methods.obb.kerbs_and_edges import BoundaryConfig, find_boundary_boxes
from linework.methods.obb.marking import MarkingConfig, find_marking_boxes
from linework.methods.obb.own_paint import WHOLE_PIECES_M, PaintClassifier, paint_probability
from linework.methods.protocol import (
    Recording,
    StepResult,
    SurveyContext,
    context_of_tile,
    extract_tile,
    origin_of_tile,
    surface_of_tile,
    tile_of,
    whole_tile,
)
from linework.methods.tracking.track import TrackConfig
from linework.model.boxes import BoxSet
from linework.model.grid import Bounds, holds
from linework.model.ground import Ground
from linework.model.lines import CANDIDATE, LineSet
from linework.model.points import Points
from linework.model.settings import Settings, group
from linework.model.tile import TileData
from linework.model.trajectory import Trajectory

#: A box depends on the points within this distance of its cell only. [m]
BOX_REACH_M = 10.0
#: What `Obb.steps` calls the steps of the join.
_NAMES_OF_STEPS = (
    "kerbs",
    "edges",
    "barriers",
    "changes of the ground",
    "sides of the road",
    "paint",
    "consistent lines",
)
OBB_KINDS = (
    "lane_marking", "lane_marking_dash", "road_marking_other", "road_boundary", "kerb_top", "edge_other",
)  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class ObbConfig(Settings):
    """Settings of the obb method, each step's own in a group."""

    marking: MarkingConfig = group(MarkingConfig)
    boundary: BoundaryConfig = group(BoundaryConfig)
    track: TrackConfig = group(TrackConfig)


@dataclass(frozen=True, slots=True)
class Obb:
    """Lane markings and road boundaries: oriented boxes in the points, tracked by collision.

    Parameters
    ----------
    paint
        Evidence of paint instead of the intensity: the name of a column of the points with probabilities from 0
        to 1, or a function from `Points` near the road to such probabilities, see
        `linework.methods.obb.own_paint.paint_probability`. None: the intensity.
    beside_boundaries
        Whether boundaries are looked for to weigh markings against, though no boundary is asked for. Without them
        markings take less than half of the time, and edge lines are not told from lane lines.

    Examples
    --------
    >>> Obb(paint="p_paint").carry
    ('p_paint',)
    """

    recording: ClassVar[Recording] = "points"
    evidence: ClassVar[type[BoxSet]] = BoxSet
    config: ObbConfig = field(default_factory=ObbConfig)
    kinds: tuple[str, ...] = OBB_KINDS
    name: str = "obb"
    #: Paint and kerbs are on the ground: all points matter.
    least_height_m: float = -math.inf
    paint: str | PaintClassifier | None = None
    beside_boundaries: bool = True

    @property
    def buffer_m(self) -> float:
        """A box depends on the points within 10 m of its cell only, an own function on those of whole pieces."""
        return WHOLE_PIECES_M if callable(self.paint) else BOX_REACH_M

    @property
    def carry(self) -> tuple[str, ...]:
        """Names of the further columns of the points that it needs."""
        return (self.paint,) if isinstance(self.paint, str) else ()

    def extract(self, tile: TileData) -> LineSet:
        """Return the lane markings and road boundaries of a tile that is a survey of its own."""
        return extract_tile(self, tile)

    def look(self, piece: TileData) -> BoxSet:
        """Return the boxes in a tile [m, from the survey's local origin] whose centres lie in the core."""
        origin = origin_of_tile(piece)
        boxes = self.find_boxes(replace(piece, surface=surface_of_tile(piece), origin=origin))
        return boxes.take(holds(piece.core, boxes.centre + origin))

    def find_boxes(self, tile: TileData, cores: Sequence[Bounds] = ()) -> BoxSet:
        """Return all boxes in a tile: pieces of paint by intensity, pieces of boundaries by normals.

        Parameters
        ----------
        tile
            With its surface and its local origin.
        cores
            Disjoint parts of the core: places outside them may be left out; none: the whole core.
        """
        steps = self._box_steps(tile, cores)
        return BoxSet.concatenate([found for _, found in steps if isinstance(found, BoxSet)])

    def _box_steps(self, tile: TileData, cores: Sequence[Bounds] = ()) -> Iterator[StepResult]:
        """Yield name and result of each step of `find_boxes`."""
        surface = tile.surface
        assert surface is not None, "a tile of a survey comes with its surface"
        probability = None
        if self.seeks_paint and self.paint is not None:
            probability = paint_probability(tile.points, surface, self.paint)
            yield "probability of paint", probability
        # What lasers see differently is not paint
        tile = replace(tile, points=tile.gains.without(tile.points))
        # Boundaries are sought along stripes, too, whether or not these are asked for
        stripes = find_marking_boxes(tile, surface, self.config.marking, cores, probability)
        if self.seeks_paint:
            yield "marking boxes", stripes
        if self._seeks_boundaries:
            yield "boundary boxes", find_boundary_boxes(tile, surface, self.config.boundary, cores, stripes)

    def join(self, found: BoxSet, survey: SurveyContext) -> LineSet:
        """Return the lines through the boxes of a survey, in world coordinates."""
        now = self.begin_join(found, survey)
        for step in self.join_steps:
            now = step(now)
        return self.end_join(now, survey)

    #: Boxes that collide when moved on by the search length are joined, forward and backward, over gaps.
    join_steps: ClassVar[tuple[joining.JoinStep, ...]] = (
        # Kerbs first: stone and gutter beside them are neither paint nor edges of their own
        joining.find_kerbs,
        # What else bounds the road: the edge of the pavement, then barriers and walls
        joining.find_edges,
        joining.find_barriers,
        joining.find_changes,
        # The lower side of a step is not always the road
        joining.face_the_road,
        # Paint, which goes on along boundaries where it is worn
        joining.find_paint,
        # A road is painted between its boundaries: lines that contradict others are dropped
        joining.keep_consistent,
    )

    def begin_join(self, boxes: BoxSet, survey: SurveyContext) -> joining.Joining:
        """Return the boxes of a survey as the first of `join_steps` takes them."""
        return joining.begin(
            boxes, survey, self.config.track, shows_paint=survey.shows_paint and self.seeks_paint,
            keeps_candidates=CANDIDATE in self.kinds,
        )  # fmt: skip

    def end_join(self, now: joining.Joining, survey: SurveyContext) -> LineSet:
        """Return the lines that the last of `join_steps` leaves, in world coordinates."""
        lines = joining.line_set(now)
        is_asked = np.isin(lines.kind, self.kinds) & np.isin(lines.candidate_kind, ("", *self.kinds))
        lines = lines.take(is_asked)
        return lines.with_columns(xyz=lines.xyz + np.asarray(survey.origin))

    def steps(
        self, points: Points, trajectory: Trajectory | None = None, ground: Ground | None = None
    ) -> Iterator[StepResult]:
        """Yield name and result of each step that leads from points to lines, in the order of the paper.

        Parameters
        ----------
        points
            A survey that fits into memory; in any order.
        trajectory
            Path of the vehicle: the road is below it.
        ground
            Your own; None: it is found.

        Yields
        ------
        name, result
            ``ground`` (`Ground`); ``points`` (`Points`, in the fixed order that later arrays are in); with own
            evidence ``probability of paint`` (n,) float32; ``marking boxes`` (step 2) and ``boundary boxes``
            (step 1, `BoxSet` in world coordinates); then the lines so far after each step of tracking (step 3,
            `LineSet`): ``kerbs``, ``edges``, ``barriers``, ``changes of the
            ground``, ``sides of the road``, ``paint``, ``consistent lines``; and ``lines``, what
            `linework.extract` returns. All but plain arrays have `plot`.

        References
        ----------
        S. Kang, J. Lee, J. Lee (2023), doi:10.3390/rs15194656.

        Examples
        --------
        >>> rng = np.random.default_rng(1)
        >>> xyz = np.column_stack([*rng.uniform(0.0, 12.0, (2, 60_000)), rng.normal(0.0, 0.005, 60_000)])
        >>> on_line = np.abs(xyz[:, 1] - 6.0) < 0.06
        >>> points = Points(xyz, intensity=np.where(on_line, 90.0, 40.0) + rng.normal(0.0, 4.0, 60_000))
        >>> results = dict(Obb(kinds=("lane_marking",)).steps(points))
        >>> len(results["marking boxes"]) > 20, results["lines"].kind.tolist()
        (True, ['lane_marking'])
        """
        if len(points) == 0:
            yield "lines", LineSet.empty()
            return
        tile = whole_tile(tile_of(points, trajectory, ground))
        yield "ground", tile.surface
        yield "points", tile.points
        survey, found = context_of_tile(tile), list[BoxSet]()
        tile = replace(tile, origin=survey.origin)
        origin = np.asarray(survey.origin)
        for name, result in self._box_steps(tile):
            if not isinstance(result, BoxSet):
                yield name, result
                continue
            boxes = result.take(holds(tile.core, result.centre + origin))
            found.append(boxes)
            yield name, replace(boxes, centre=boxes.centre + origin)
        now = self.begin_join(BoxSet.concatenate(found), survey)
        for name, step in zip(_NAMES_OF_STEPS, self.join_steps, strict=True):
            now = step(now)
            lines = joining.line_set(now)
            yield name, lines.with_columns(xyz=lines.xyz + origin)
        yield "lines", self.end_join(now, survey)

    def only(self, kind: str) -> Obb:
        """Return the method with what it takes to find boxes of one kind of line only."""
        return replace(self, kinds=("kerb_top",) if kind == "road_boundary" else ("lane_marking_dash",))

    @property
    def seeks_paint(self) -> bool:
        """Whether one of its kinds is paint."""
        return any(kind.endswith(("marking", "dash", "other")) for kind in self.kinds)

    @property
    def _seeks_boundaries(self) -> bool:
        # Edge lines are told from lane lines by the boundary beside them
        wanting = {"road_boundary", "kerb_top", "edge_other"} | (
            {"lane_marking"} if self.beside_boundaries else set()
        )
        return not wanting.isdisjoint(self.kinds)
