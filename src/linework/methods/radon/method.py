"""The radon method on a page: guardrails and cables from laser points.

D. Manandhar, R. Shibasaki (2002): Extraction of linear features from vehicle-borne laser data. What goes
beyond the paper is named in docs/methods/radon.md.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from linework.imaging.binary import in_height_band
from linework.imaging.raster import grid_for
from linework.methods.radon.buried_ends import carry_into_ground
from linework.methods.radon.cables import CableConfig, find_cables
from linework.methods.radon.circles import CircleConfig, bin_near, find_starts
from linework.methods.radon.line_times import with_times
from linework.methods.radon.profile import ProfileConfig
from linework.methods.radon.rails import fit_rail, follow_all, rail_lines
from linework.methods.radon.seeds import SeedConfig, find_seed_lines, split_into_segments
from linework.model.arrays import Float32Array
from linework.model.lines import LineSet
from linework.model.points import Points
from linework.model.settings import group, setting
from linework.model.tile import TileData
from linework.surface.road import (
    RoadConfig,
    RoadSurface,
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
    road: RoadConfig = group(RoadConfig)
    seeds: SeedConfig = group(SeedConfig)
    circles: CircleConfig = group(CircleConfig)
    profile: ProfileConfig = group(ProfileConfig)
    cable: CableConfig = group(CableConfig)


@dataclass(frozen=True, slots=True)
class RadonMethod:
    """Guardrails, barriers and cables: peaks of Radon transforms of height-band images of the points."""

    config: RadonConfig = field(default_factory=RadonConfig)
    kinds: tuple[str, ...] = ("guardrail", "barrier", "cable")
    name: str = "radon"
    #: Half the longest span that is sure to be seen whole (240 m) by the tile whose core holds its middle. Of a
    #: longer one tiles see parts: it may come out shorter, or twice. One tile alone loses nothing.
    buffer_m: float = 120.0
    #: Rails stand on the ground: all points matter.
    least_height_m: float = -math.inf

    def extract(self, tile: TileData) -> LineSet:
        """Return the guardrails, concrete barriers and cables of a tile."""
        points = tile.points
        if len(points) == 0:
            return LineSet.empty()
        # Height above the road, road = 0; above the ground where there is no road
        surface = tile.surface or find_road(points, tile.trajectory, self.config.road)
        above_road = height_above_road(surface, points.xyz)
        above_ground = height_above_ground(surface, points.xyz)
        found = []
        if {"guardrail", "barrier"} & set(self.kinds):
            found.append(find_guardrails(points, above_road, above_ground, surface, self.config))
        if "cable" in self.kinds:
            found.append(find_cables(points.xyz, points.time_s, above_ground, self.config.cable))
        lines = LineSet.concatenate(found)
        # When the points on each line were measured
        return with_times(lines.take(np.isin(lines.kind, self.kinds)), points)


def find_guardrails(
    points: Points,
    above_road: Float32Array,
    above_ground: Float32Array,
    surface: RoadSurface,
    config: RadonConfig,
) -> LineSet:
    """Return the guardrails and barriers among points of known heights (n,) float32 [m]."""
    # Raster image: the cells that hold points of the height band; a bank beside the road is ground, no rail
    grid = grid_for(points, config.cell_m)
    height = np.minimum(above_road, above_ground)
    binary = in_height_band(points.xyz, height, grid, config.min_height_m, config.max_height_m)
    # Prominent directions: peaks of the Radon transform after dilation, window by window
    seeds = find_seed_lines(binary, config.seeds)
    # Where along each seed line the feature really is
    segments = split_into_segments(seeds, binary, config.seeds)
    # Back to the points: circles about each seed settle on the beam, and follow it through bends
    bins = bin_near(points.xyz, above_ground, binary)
    starts = find_starts(segments, bins, config.circles)
    chains = follow_all(
        starts,
        bins,
        (config.circles.min_height_m, config.max_height_m),
        config.profile.min_length_m,
        config.circles,
    )
    # Local straight fits of the corrected centres; the height from the highest points
    rails = [fit_rail(chain, bins, config.circles, config.profile) for chain in chains]
    # The vertical profile tells guardrails and barriers from hedges, walls, cars and fences
    lines = rail_lines(rails, bins, surface, config.profile)
    # What dips into the ground goes on until it reaches it
    return carry_into_ground(lines, surface)
