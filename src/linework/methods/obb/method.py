"""The obb method on a page: lane markings and road boundaries by tracking oriented bounding boxes.

W.-S. Kang, K.-H. Lee, J.-H. Lee (2023): Automatic extraction of road boundaries and lane markings by oriented
bounding boxes, doi:10.3390/rs15194656. docs/methods/obb.md names what goes beyond the paper.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np

from linework.methods.obb import joining
from linework.methods.obb.kerbs_and_edges import BoundaryConfig, find_boundary_boxes
from linework.methods.obb.marking import MarkingConfig, find_marking_boxes
from linework.methods.obb.own_paint import WHOLE_PIECES_M, PaintClassifier, paint_probability
from linework.methods.protocol import (
    Recording,
    SurveyContext,
    extract_tile,
    origin_of_tile,
    surface_of_tile,
)
from linework.methods.tracking.track import TrackConfig
from linework.model.boxes import BoxSet
from linework.model.grid import Bounds, holds
from linework.model.lines import LineSet
from linework.model.settings import Settings, group
from linework.model.tile import TileData

#: A box depends on the points within this distance of its cell only. [m]
BOX_REACH_M = 8.0
OBB_KINDS = ("lane_marking", "lane_marking_dash", "road_marking_other", "road_boundary", "kerb_top")


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

    @property
    def buffer_m(self) -> float:
        """A box depends on the points within 8 m of its cell only, an own function on those of whole pieces."""
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
        assert tile.surface is not None, "a tile of a survey comes with its surface"
        found = []
        if self.seeks_paint:
            probability = None
            if self.paint is not None:
                probability = paint_probability(tile.points, tile.surface, self.paint)
            found.append(find_marking_boxes(tile, tile.surface, self.config.marking, cores, probability))
        if self._seeks_boundaries:
            found.append(find_boundary_boxes(tile, tile.surface, self.config.boundary, cores))
        return BoxSet.concatenate(found)

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
        # Paint, which goes on along boundaries where it is worn
        joining.find_paint,
        # A road is painted between its boundaries: lines that contradict others are dropped
        joining.keep_consistent,
    )

    def begin_join(self, boxes: BoxSet, survey: SurveyContext) -> joining.Joining:
        """Return the boxes of a survey as the first of `join_steps` takes them."""
        return joining.begin(boxes, survey, self.config.track)

    def end_join(self, now: joining.Joining, survey: SurveyContext) -> LineSet:
        """Return the lines that the last of `join_steps` leaves, in world coordinates."""
        lines = joining.line_set(now)
        lines = lines.take(np.isin(lines.kind, self.kinds))
        return lines.with_columns(xyz=lines.xyz + np.asarray(survey.origin))

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
        return any(kind in ("road_boundary", "kerb_top", "lane_marking") for kind in self.kinds)
