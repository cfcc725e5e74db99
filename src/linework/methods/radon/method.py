"""The radon method on a page: guardrails and cables from laser points.

D. Manandhar, R. Shibasaki (2002): Extraction of linear features from vehicle-borne laser data. What goes
beyond the paper is named in docs/methods/radon.md.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np

from linework.imaging.raster import grid_for, in_height_band
from linework.methods.cables.find import CableConfig, find_cables, least_height_m
from linework.methods.radon.seeds import SeedConfig, find_seed_lines, split_into_segments
from linework.methods.rails.chains import chains_from_starts
from linework.methods.rails.circles import CircleConfig, bin_near, find_starts
from linework.methods.rails.profile import ProfileConfig
from linework.methods.rails.rail_lines import carry_into_ground, rail_lines
from linework.methods.rails.rails import fit_rails
from linework.methods.rails.stretches import with_times
from linework.model.lines import LineSet
from linework.model.settings import group, setting
from linework.model.tile import TileData
from linework.surface.road import (
    RoadConfig,
    find_road,
    height_above_ground,
    height_above_road,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class RadonConfig:
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

    config: RadonConfig = field(default_factory=RadonConfig)
    kinds: tuple[str, ...] = RAIL_KINDS
    name: str = "radon"
    #: What is found at a place depends on the points as far as a line is followed (48 m), on what it is over 40 m,
    #: and on what windows and fits add to that; see docs/methods/radon.md, "Tiles".
    buffer_m: float = 64.0
    #: Rails stand on the ground: all points matter.
    least_height_m: float = -math.inf

    def extract(self, tile: TileData) -> LineSet:
        """Return the guardrails and concrete barriers of a tile."""
        points, c = tile.points, self.config
        if len(points) == 0:
            return LineSet.empty()
        # Height above the road, road = 0; above the ground where there is no road
        surface = tile.surface or find_road(points, tile.trajectory, RoadConfig())
        above_road = height_above_road(surface, points.xyz)
        above_ground = height_above_ground(surface, points.xyz)
        # Raster image: the cells that hold points of the height band; a bank beside the road is ground, no rail
        height, grid = np.minimum(above_road, above_ground), grid_for(points, c.cell_m)
        binary = in_height_band(points.xyz, height, grid, c.min_height_m, c.max_height_m)
        # Prominent directions: peaks of the Radon transform after dilation, window by window
        seeds = find_seed_lines(binary, c.seeds)
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
        lines = rail_lines(rails, bins, surface, c.circles, c.profile, tile.core)
        # What dips into the ground goes on until it reaches it
        lines = carry_into_ground(lines, surface)
        # When the points on each line were measured
        return with_times(lines.take(np.isin(lines.kind, self.kinds)), points)


@dataclass(frozen=True, slots=True)
class CableMethod:
    """Overhead cables: peaks of Radon transforms of an image of the points high above the ground."""

    config: RadonConfig = field(default_factory=RadonConfig)
    kinds: tuple[str, ...] = CABLE_KINDS
    name: str = "radon"
    #: Spans of up to 400 m are seen whole by the tile whose core holds their middle.
    buffer_m: float = 200.0
    #: What a wire passes over counts as its surroundings from here on; cars, rails and grass do not.
    least_height_m: float = 1.5

    def extract(self, tile: TileData) -> LineSet:
        """Return the wires of a tile, one line per wire and span."""
        points = tile.points
        if len(points) == 0:
            return LineSet.empty()
        # Height above the ground, of which the road is part
        surface = tile.surface or find_road(points, tile.trajectory, RoadConfig())
        above_ground = height_above_ground(surface, points.xyz)
        # Thin, alone in their column, straight in plan, hanging as catenaries between supports
        lines = find_cables(points.xyz, points.time_s, above_ground, self.config.cable, tile.origin)
        # When the points on each line were measured
        return with_times(lines, points)


@dataclass(frozen=True, slots=True)
class RadonMethod:
    """Guardrails, barriers and cables of one tile; runs over many tiles take the two methods apart."""

    config: RadonConfig = field(default_factory=RadonConfig)
    kinds: tuple[str, ...] = (*RAIL_KINDS, *CABLE_KINDS)
    name: str = "radon"
    buffer_m: float = 200.0
    least_height_m: float = -math.inf

    def extract(self, tile: TileData) -> LineSet:
        """Return the guardrails, concrete barriers and cables of a tile."""
        if len(tile.points) == 0:
            return LineSet.empty()
        # Road and ground, once for both
        surface = tile.surface or find_road(tile.points, tile.trajectory, RoadConfig())
        tile = replace(tile, surface=surface)
        # Each method looks for its own kinds
        return LineSet.concatenate([method.extract(tile) for method in parts_of(self)])


def parts_of(method: RadonMethod) -> tuple[RailMethod | CableMethod, ...]:
    """Return the methods that find the kinds that are asked for.

    >>> parts_of(RadonMethod(kinds=("barrier", "cable")))[0].kinds
    ('barrier',)
    """
    rails = tuple(kind for kind in RAIL_KINDS if kind in method.kinds)
    cables = tuple(kind for kind in CABLE_KINDS if kind in method.kinds)
    parts: list[RailMethod | CableMethod] = [RailMethod(method.config, rails)] if rails else []
    if cables:
        lowest_m = min(CableMethod().least_height_m, least_height_m(method.config.cable))
        parts.append(CableMethod(method.config, cables, least_height_m=lowest_m))
    return tuple(parts)
