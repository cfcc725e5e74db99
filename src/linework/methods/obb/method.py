"""The obb method on a page: lane markings and road boundaries by tracking oriented bounding boxes.

W.-S. Kang, K.-H. Lee, J.-H. Lee (2023): Automatic extraction of road boundaries and lane markings by oriented
bounding boxes, doi:10.3390/rs15194656. What goes beyond the paper is named in docs/methods/obb.md.
"""

from __future__ import annotations

import math
from collections.abc import Generator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from linework.arrays import BoolArray, FloatArray
from linework.methods.obb.boundary import BoundaryConfig, find_boundary_boxes
from linework.methods.obb.marking import MarkingConfig, find_marking_boxes
from linework.methods.protocol import Sight, sight_of
from linework.methods.tracking import boundary_lines, marking_lines
from linework.methods.tracking.arrangement import (
    along_lines,
    behind_boundaries,
    beside_kerb,
    bounds_carriageway,
    is_double,
    paint_forms,
    roles,
)
from linework.methods.tracking.boundary_lines import SmoothBoundary
from linework.methods.tracking.guides import drop_unlikely_pieces, join_along
from linework.methods.tracking.marking_lines import SmoothMarking
from linework.methods.tracking.neighbours import LineAxis, axes_of_path
from linework.methods.tracking.track import TrackConfig, track_lines
from linework.model.boxes import BoxForm, BoxSet
from linework.model.grid import Bounds, holds
from linework.model.lines import LineSet
from linework.model.settings import group
from linework.model.tile import TileData, local_origin
from linework.surface.road import RoadConfig, find_road

OBB_KINDS = ("lane_marking", "lane_marking_dash", "road_marking_other", "road_boundary", "kerb_top")
#: Boxes this near a line, side by side with it, are the same feature. [m]
SAME_PAINT_BOXES_M, SAME_BOUNDARY_M = 0.06, 0.15
#: To either side of a kerb's foot: gutter, kerb stone and its bed look like edges of the pavement. [m]
KERB_SIDE_M = 1.0
#: Boundaries of this confidence are believed more than paint that they contradict: there is none on grass.
SURE = 0.9
#: Bars of crossings and stop lines are no wider: wider bright things are no paint. [m]
WIDEST_BAR_M = 1.0
#: Behind the foot: kerb stones are brighter than asphalt and up to 0.3 m wide. Paint keeps off the foot. [m]
KERB_STONE_M, ON_FOOT_M = 0.45, 0.04


@dataclass(frozen=True, slots=True, kw_only=True)
class ObbConfig:
    """Settings of the obb method, each step's own in a group."""

    marking: MarkingConfig = group(MarkingConfig)
    boundary: BoundaryConfig = group(BoundaryConfig)
    track: TrackConfig = group(TrackConfig)


@dataclass(frozen=True, slots=True)
class ObbMethod:
    """Lane markings and road boundaries: oriented boxes in the points, tracked by collision."""

    config: ObbConfig = field(default_factory=ObbConfig)
    kinds: tuple[str, ...] = OBB_KINDS
    name: str = "obb"
    #: No box depends on points farther from its cell.
    buffer_m: float = 8.0
    #: Paint and kerbs are on the ground.
    least_height_m: float = -math.inf

    def extract(self, tile: TileData) -> LineSet:
        """Return the lane markings and road boundaries of a tile that is a survey of its own."""
        if len(tile.points) == 0:
            return LineSet.empty()
        surface = tile.surface or find_road(tile.points, tile.trajectory, RoadConfig())
        bounds = tile.points.bounds
        origin = tile.origin or local_origin(bounds.west, bounds.south, surface.z0_m)
        tile = TileData(
            tile.tile_id, tile.core, tile.points, tile.trajectory, tile.source, surface, origin
        )  # fmt: skip
        boxes = self.detect(tile)
        boxes = boxes.take(holds(tile.core, boxes.centre + origin))
        path = None if tile.trajectory is None else tile.trajectory.xyz
        return self.track(boxes, origin, sight_of(surface), path)

    def detect(self, tile: TileData, cores: Sequence[Bounds] = ()) -> BoxSet:
        """Return the boxes in a tile: pieces of paint by intensity, pieces of boundaries by normals.

        Parameters
        ----------
        cores
            Parts of the core that share nothing: what lies outside of them need not be looked at; none: all.
        """
        assert tile.surface is not None, "a tile of a survey comes with its surface"
        found = []
        if self._seeks_paint:
            found.append(find_marking_boxes(tile, tile.surface, self.config.marking, cores))
        if self._seeks_boundaries:
            found.append(find_boundary_boxes(tile, tile.surface, self.config.boundary, cores))
        return BoxSet.concatenate(found)

    def track(
        self,
        boxes: BoxSet,
        origin: tuple[float, float, float],
        seen: Sight,
        path: FloatArray | None = None,
    ) -> LineSet:
        """Return the lines through the boxes of a survey, in world coordinates (see `BoxMethod`)."""
        steps = self.tracking(boxes, origin, seen, path)
        while True:
            try:
                next(steps)
            except StopIteration as end:
                lines: LineSet = end.value
                return lines

    def tracking(
        self,
        boxes: BoxSet,
        origin: tuple[float, float, float],
        seen: Sight,
        path: FloatArray | None = None,
    ) -> Generator[None, None, LineSet]:
        """Return what `track` returns, yielding several times on the way: who waits may leave there."""
        # In an order of their own, whatever tiles they come from
        boxes = boxes.take(np.lexsort((boxes.centre[:, 1], boxes.centre[:, 0], boxes.form)))
        parts = {form: boxes.take(boxes.form == form) for form in BoxForm}

        def seen_here(xy: FloatArray) -> BoolArray:
            return seen(xy + origin[:2])

        # Boxes that collide, moved on by the search length, are joined: forward and backward, over gaps.
        # Kerbs first: what lies beside them, stone or gutter, is neither paint nor an edge of its own
        kerbs = self._boundaries(parts[BoxForm.KERB], seen_here)
        rims = list(kerbs)
        for form in (BoxForm.EDGE, BoxForm.BARRIER):
            yield
            away = ~beside_kerb(parts[form], axes_of_lines(kerbs), -KERB_SIDE_M, KERB_SIDE_M)
            rims += self._boundaries(parts[form].take(away), seen_here)
        yield
        # Paint: solid and dashed lines, and what is no line
        way = [] if path is None else axes_of_path(path - np.asarray(origin))
        markings, other = self._paint(parts, axes_of_lines(kerbs), [*axes_of_lines(rims), *way], seen_here)
        yield
        is_kerb = np.array([b.form == "kerb" for b in rims], dtype=np.bool_)
        is_sure = is_kerb | np.array([b.confidence >= SURE for b in rims], dtype=np.bool_)
        sure = [b for b, yes in zip(rims, is_sure, strict=True) if yes]
        behind = behind_boundaries(axes_of_lines(markings), axes_of_lines(sure), is_kerb[is_sure])
        markings = [m for m, yes in zip(markings, behind, strict=True) if not yes]
        # What has no carriageway in front of it, or has one behind it, bounds none
        kept = bounds_carriageway(axes_of_lines(rims), is_kerb, is_sure, [*axes_of_lines(markings), *way])
        rims = [b for b, yes in zip(rims, kept, strict=True) if yes]
        # Bars and arrows stand free: what runs along a line is a piece of it
        pieces = along_lines(
            axes_of_lines(other), [*axes_of_lines(markings), *axes_of_lines(rims)], KERB_STONE_M
        )
        other = [m for m, yes in zip(other, pieces, strict=True) if not yes and m.confidence >= SURE]
        yield
        # What each is, from how the lines lie to one another
        lines = as_line_set(markings, other, rims, way)
        lines = lines.take(np.isin(lines.kind, self.kinds))
        return lines.with_columns(xyz=lines.xyz + np.asarray(origin))

    def only(self, kind: str) -> ObbMethod:
        """Return the method with what it takes to find boxes of one kind only."""
        return replace(self, kinds=("kerb_top",) if kind == "road_boundary" else ("lane_marking_dash",))

    def _boundaries(self, boxes: BoxSet, seen: Sight) -> list[SmoothBoundary]:
        """Return the boundaries through boxes of one form."""
        tracks = track_lines(boxes, self.config.track, width_m=SAME_BOUNDARY_M)
        return boundary_lines.smooth_boundaries(boxes, tracks, seen)

    def _paint(
        self,
        parts: Mapping[BoxForm, BoxSet],
        kerbs: Sequence[LineAxis],
        guides: Sequence[LineAxis],
        seen: Sight,
    ) -> tuple[list[SmoothMarking], list[SmoothMarking]]:
        """Return the lane markings, and the paint that is none."""
        stripes, blobs = (
            parts[form].take(~beside_kerb(parts[form], kerbs, -KERB_STONE_M, ON_FOOT_M))
            for form in (BoxForm.STRIPE, BoxForm.OTHER_PAINT)
        )
        pieces = track_lines(stripes, self.config.track, width_m=SAME_PAINT_BOXES_M, least_boxes=1)
        pieces = drop_unlikely_pieces(pieces, stripes.score)
        # Worn pieces go on along the lines that are whole
        whole, _ = marking_lines.marking_lines(stripes, pieces.with_boxes(3), seen)
        gap_m = self.config.track.longest_gap_m
        lines = join_along(stripes, pieces, [*axes_of_lines(whole), *guides], gap_m).with_boxes(3)
        blobs = blobs.take(blobs.half_v_m <= 0.5 * WIDEST_BAR_M)
        bars = track_lines(blobs, self.config.track, width_m=SAME_BOUNDARY_M)
        markings, other = marking_lines.marking_lines(stripes, lines, seen)
        return markings, other + marking_lines.bar_lines(blobs, bars, seen)

    @property
    def _seeks_paint(self) -> bool:
        return any(kind.endswith(("marking", "dash", "other")) for kind in self.kinds)

    @property
    def _seeks_boundaries(self) -> bool:
        # Boundaries tell edge lines from others, too
        return any(kind in ("road_boundary", "kerb_top", "lane_marking") for kind in self.kinds)


def axes_of_lines(lines: Sequence[SmoothMarking] | Sequence[SmoothBoundary]) -> list[LineAxis]:
    """Return where lines run."""
    return [LineAxis.of(line.line.t_m, line.line.xyz) for line in lines]


def as_line_set(
    markings: Sequence[SmoothMarking],
    other: Sequence[SmoothMarking],
    rims: Sequence[SmoothBoundary],
    way: Sequence[LineAxis],
) -> LineSet:
    """Return all lines with their roles and forms, in local coordinates."""
    lanes, bounds = axes_of_lines(markings), axes_of_lines(rims)
    double = is_double(lanes)
    names = roles(lanes, bounds, way, double)
    forms = np.array(paint_forms(axes_of_lines(other), [*lanes, *bounds, *way]), dtype=np.str_)
    return LineSet.concatenate([
        marking_lines.marking_line_set(markings, "lane_marking").with_columns(
            double=double, role=np.array(names, dtype=np.str_)
        ),
        marking_lines.dash_lines(markings, names),
        marking_lines.marking_line_set(other, "road_marking_other").with_columns(
            form=forms, pattern=np.full(len(other), "", dtype=np.str_)
        ),
        boundary_lines.boundary_line_set(rims),
        boundary_lines.top_lines(rims),
    ])  # fmt: skip
