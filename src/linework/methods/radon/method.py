"""The radon method on a page: guardrails and cables from laser points.

D. Manandhar, R. Shibasaki (2002): Extraction of linear features from vehicle-borne laser data. docs/methods/radon.md
names what goes beyond the paper.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np

from linework.imaging.raster import grid_for, in_height_band
from linework.methods.cables.find import CableConfig, find_cables, least_height_m
from linework.methods.protocol import Recording, SurveyContext, extract_tile, surface_of_tile
from linework.methods.radon.peaks import PeakFinder
from linework.methods.radon.seeds import SeedConfig, find_seed_lines, split_into_segments
from linework.methods.rails.chains import chains_from_starts
from linework.methods.rails.circles import CircleConfig, bin_near, find_starts
from linework.methods.rails.profile import ProfileConfig
from linework.methods.rails.rail_lines import carry_into_ground, rail_lines
from linework.methods.rails.rails import fit_rails
from linework.methods.rails.stretches import with_times
from linework.methods.seams import across_seams, of_core
from linework.model.lines import LineSet
from linework.model.settings import Settings, group, setting
from linework.model.tile import TileData
from linework.surface.road import height_above_ground, height_above_road


@dataclass(frozen=True, slots=True, kw_only=True)
class RadonConfig(Settings):
    """Settings of the radon method: the raster image here, each step's own in a group."""

    cell_m: float = setting(0.20, unit="m", reason="the paper's raster cell", low=0.02, high=10)
    min_height_m: float = setting(
        0.20, unit="m", reason="the paper's band for guardrails: above kerbs", low=-10, high=100
    )
    max_height_m: float = setting(
        1.20, unit="m", reason="the paper's band for guardrails: they are about 1 m high", low=-10, high=100
    )
    seeds: SeedConfig = group(SeedConfig)
    circles: CircleConfig = group(CircleConfig)
    profile: ProfileConfig = group(ProfileConfig)
    cable: CableConfig = group(CableConfig)


RAIL_KINDS, CABLE_KINDS = ("guardrail", "barrier"), ("cable",)


@dataclass(frozen=True, slots=True)
class RailMethod:
    """Guardrails and concrete barriers: peaks of Radon transforms of an image of the points near the ground."""

    recording: ClassVar[Recording] = "points"
    evidence: ClassVar[type[LineSet]] = LineSet
    carry: ClassVar[tuple[str, ...]] = ()
    config: RadonConfig = field(default_factory=RadonConfig)
    kinds: tuple[str, ...] = RAIL_KINDS
    name: str = "radon"
    #: Sum of the reaches of the steps: a line is followed for 48 m, its kind is decided over 40 m, and windows and
    #: fits add to that; see docs/methods/radon.md, "Tiles".
    buffer_m: float = 64.0
    #: Rails stand on the ground: all points matter.
    least_height_m: float = -math.inf
    find_peaks: PeakFinder | None = None

    def extract(self, tile: TileData) -> LineSet:
        """Return the guardrails and concrete barriers of a tile that is a survey of its own."""
        return extract_tile(self, tile)

    def look(self, piece: TileData) -> LineSet:
        """Return the guardrails and concrete barriers of a tile, cut at the edges of its core."""
        points, surface, c = piece.points, surface_of_tile(piece), self.config
        # Height above the road, road = 0; above the ground where there is no road
        above_road = height_above_road(surface, points.xyz)
        above_ground = height_above_ground(surface, points.xyz)
        # Raster image: the cells that hold points of the height band; a bank beside the road is ground, not a rail
        height, grid = np.minimum(above_road, above_ground), grid_for(points, c.cell_m)
        binary = in_height_band(points.xyz, height, grid, c.min_height_m, c.max_height_m)
        # Prominent directions: peaks of the Radon transform after dilation, window by window
        seeds = find_seed_lines(binary, c.seeds, self.find_peaks)
        # Where along each seed line the feature really is
        segments = split_into_segments(seeds, binary, c.seeds)
        # Back to the points: circles about each seed settle on the beam, and follow it through bends
        bins = bin_near(points.xyz, above_ground, binary)
        starts = find_starts(segments, bins, c.circles)
        band_m = c.circles.min_height_m, c.max_height_m
        chains = chains_from_starts(starts, bins, band_m, c.profile.min_length_m, c.circles)
        # Local fits of the corrected centres; the height from the highest points
        rails = fit_rails(chains, bins, c.circles, c.profile)
        # The vertical profile tells guardrails and barriers from hedges, walls, cars and fences
        lines = rail_lines(rails, bins, surface, c.circles, c.profile, piece.core)
        # Ends that dip into the ground are extended down to it
        lines = carry_into_ground(lines, surface)
        # When the points on each line were measured
        lines = with_times(lines.take(np.isin(lines.kind, self.kinds)), points)
        return of_core(lines, piece.core, is_whole=piece.is_whole)

    def join(self, found: LineSet, survey: SurveyContext) -> LineSet:
        """Return the lines of a survey, pieces that meet at the edge of a core joined into one."""
        return across_seams(found, survey.cores)


@dataclass(frozen=True, slots=True)
class CableMethod:
    """Overhead cables: peaks of Radon transforms of an image of the points high above the ground."""

    recording: ClassVar[Recording] = "points"
    evidence: ClassVar[type[LineSet]] = LineSet
    carry: ClassVar[tuple[str, ...]] = ()
    config: RadonConfig = field(default_factory=RadonConfig)
    kinds: tuple[str, ...] = CABLE_KINDS
    name: str = "radon"
    #: The tile whose core holds the middle of a span of up to 400 m has all of its points.
    buffer_m: float = 200.0
    #: From this height on, what stands below a wire counts as its surroundings; cars, rails and grass do not.
    least_height_m: float = 1.5
    find_peaks: PeakFinder | None = None

    def extract(self, tile: TileData) -> LineSet:
        """Return the wires of a tile that is a survey of its own, one line per wire and span."""
        return extract_tile(self, tile)

    def look(self, piece: TileData) -> LineSet:
        """Return the wires of a tile whose middle lies in its core, one line per wire and span."""
        points = piece.points
        # Height above the ground, of which the road is part
        above_ground = height_above_ground(surface_of_tile(piece), points.xyz)
        # Thin, alone in their column, straight in plan, hanging as catenaries between supports
        lines = find_cables(
            points.xyz, points.time_s, above_ground, self.config.cable, piece.origin, self.find_peaks
        )
        # When the points on each line were measured
        return of_core(with_times(lines, points), piece.core, is_whole=piece.is_whole)

    def join(self, found: LineSet, survey: SurveyContext) -> LineSet:
        """Return the wires of a survey: each span was found whole, by one tile."""
        return across_seams(found, survey.cores)


@dataclass(frozen=True, slots=True)
class Radon:
    """Guardrails, barriers and cables of one tile; a run over many tiles takes its `parts` one by one."""

    recording: ClassVar[Recording] = "points"
    evidence: ClassVar[type[LineSet]] = LineSet
    carry: ClassVar[tuple[str, ...]] = ()
    config: RadonConfig = field(default_factory=RadonConfig)
    kinds: tuple[str, ...] = (*RAIL_KINDS, *CABLE_KINDS)
    name: str = "radon"
    buffer_m: float = 200.0
    least_height_m: float = -math.inf
    find_peaks: PeakFinder | None = None

    @property
    def parts(self) -> tuple[RailMethod | CableMethod, ...]:
        """The methods that find the kinds that are asked for, each with the points that it needs.

        >>> Radon(kinds=("barrier", "cable")).parts[0].kinds
        ('barrier',)
        """
        rails = tuple(kind for kind in RAIL_KINDS if kind in self.kinds)
        cables = tuple(kind for kind in CABLE_KINDS if kind in self.kinds)
        parts: list[RailMethod | CableMethod] = []
        if rails:
            parts.append(RailMethod(self.config, rails, find_peaks=self.find_peaks))
        if cables:
            lowest_m = min(CableMethod().least_height_m, least_height_m(self.config.cable))
            parts.append(
                CableMethod(self.config, cables, least_height_m=lowest_m, find_peaks=self.find_peaks)
            )
        return tuple(parts)

    def extract(self, tile: TileData) -> LineSet:
        """Return the guardrails, concrete barriers and cables of a tile that is a survey of its own."""
        return extract_tile(self, tile)

    def look(self, piece: TileData) -> LineSet:
        """Return the guardrails, barriers and wires of a tile (see `RailMethod`, `CableMethod`)."""
        # Road and ground, found once for both
        piece = replace(piece, surface=surface_of_tile(piece))
        return LineSet.concatenate([method.look(piece) for method in self.parts])

    def join(self, found: LineSet, survey: SurveyContext) -> LineSet:
        """Return the lines of a survey, pieces that meet at the edge of a core joined into one."""
        return across_seams(found, survey.cores)
