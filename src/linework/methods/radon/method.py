"""The radon method on a page: guardrails and cables from laser points.

D. Manandhar, R. Shibasaki (2002): Extraction of linear features from vehicle-borne laser data. docs/methods/radon.md
names what goes beyond the paper.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

import numpy as np

from linework.imaging.raster import grid_for, in_height_band, rasterise
from linework.methods.cables.find import CableConfig, find_cables, least_height_m
from linework.methods.cables.lines import with_known_clearance
from linework.methods.cables.networks import with_networks
from linework.methods.cables.poles import without_repeats
from linework.methods.protocol import (
    Recording,
    StepResult,
    SurveyContext,
    context_of_tile,
    extract_tile,
    scanner_of_tile,
    surface_of_tile,
    tile_of,
    whole_tile,
)
from linework.methods.radon.peaks import PeakFinder
from linework.methods.radon.seeds import (
    SeedConfig,
    find_seed_lines,
    peaks_of_window,
    split_into_segments,
    strongest_window,
)
from linework.methods.rails.chains import chains_from_starts
from linework.methods.rails.circles import CircleConfig, bin_near, find_starts, places_of
from linework.methods.rails.profile import ProfileConfig
from linework.methods.rails.rail_lines import carry_into_ground, rail_lines
from linework.methods.rails.rails import fit_rails
from linework.methods.rails.stretches import drawn_often, with_times
from linework.methods.seams import across_seams, of_core
from linework.model.grid import Image
from linework.model.ground import Ground
from linework.model.lines import POLE, LineSet
from linework.model.points import Points
from linework.model.settings import Settings, group, setting
from linework.model.tile import UNORDERED, TileData
from linework.model.trajectory import Trajectory
from linework.scanlines.fields import laser_column
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


RAIL_KINDS, CABLE_KINDS = ("guardrail", "barrier", "fence"), ("cable",)


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
        *_, (_, lines) = self.look_steps(piece)
        found: LineSet = lines
        return found

    def look_steps(self, piece: TileData) -> Iterator[StepResult]:
        """Yield name and result of each step of `look`, the lines at last."""
        points, surface, c = piece.points, surface_of_tile(piece), self.config
        # Height above the road, road = 0; above the ground where there is no road
        above_road = height_above_road(surface, points.xyz)
        above_ground = height_above_ground(surface, points.xyz)
        # Raster image: the cells that hold points of the height band; a bank beside the road is ground, not a rail
        height, grid = np.minimum(above_road, above_ground), grid_for(points, c.cell_m)
        yield "height above the road", height
        binary = in_height_band(points.xyz, height, grid, c.min_height_m, c.max_height_m)
        yield "binary image", binary
        # Prominent directions: peaks of the Radon transform after dilation, window by window
        seeds = find_seed_lines(binary, c.seeds, self.find_peaks)
        yield "seed lines", seeds
        # Where along each seed line the feature really is
        segments = split_into_segments(seeds, binary, c.seeds)
        yield "segments", segments
        # Back to the points: circles about each seed settle on the beam, and follow it through bends
        bins = bin_near(points.xyz, above_ground, binary)
        starts = find_starts(segments, bins, c.circles)
        # Sheets that are higher than rails are followed by themselves: what grows over a rail does not lead it away
        is_high = height_above_ground(surface, places_of(starts, bins)) > c.circles.max_top_m
        length_m, low_m = c.profile.min_length_m, c.circles.min_height_m
        low = chains_from_starts(starts[~is_high], bins, (low_m, c.max_height_m), length_m, c.circles)
        sheet_m = (low_m, c.circles.max_sheet_m)
        high = chains_from_starts(starts[is_high], bins, sheet_m, length_m, c.circles, followed=low)
        chains = low + high
        yield "corrected centres", [chain[:, :3] + bins.origin for chain in chains]
        # Local fits of the corrected centres; the height from the highest points
        rails = fit_rails(chains, bins, c.circles, c.profile)
        yield "local fits", [np.column_stack([rail.xy, rail.top_m]) + bins.origin for rail in rails]
        # The vertical profile tells guardrails and barriers from hedges, walls, cars and fences
        lines = rail_lines(rails, bins, surface, c.circles, c.profile, piece.core)
        # One scan line draws a line on anything
        lines = drawn_often(lines, points, scanner_of_tile(piece))
        # Ends that dip into the ground are extended down to it
        lines = carry_into_ground(lines, surface)
        # When the points on each line were measured
        lines = with_times(lines.take(np.isin(lines.kind, self.kinds)), points)
        yield "guardrails and barriers", of_core(lines, piece.core, is_whole=piece.is_whole)

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
    #: The tile whose core holds the middle of a span of up to 600 m has all of its points, and the 60 m of the next that
    #: its supports follow from.
    buffer_m: float = 360.0
    #: From this height on, what stands below a wire counts as its surroundings; cars, rails and grass do not.
    least_height_m: float = 1.5
    find_peaks: PeakFinder | None = None

    def extract(self, tile: TileData) -> LineSet:
        """Return the wires of a tile that is a survey of its own, one line per wire and span."""
        return extract_tile(self, tile)

    def look(self, piece: TileData) -> LineSet:
        """Return the wires of a tile whose middle lies in its core, one line per wire and span."""
        *_, (_, lines) = self.look_steps(piece)
        found: LineSet = lines
        return found

    def look_steps(self, piece: TileData) -> Iterator[StepResult]:
        """Yield name and result of each step of `look`, the lines at last."""
        points = piece.points
        # Height above the ground, of which the road is part
        surface = surface_of_tile(piece)
        above_ground = height_above_ground(surface, points.xyz)
        yield "height above the ground", above_ground
        # Thin, alone in their column, straight in plan, hanging as catenaries between supports
        scanner, laser = scanner_of_tile(piece), laser_column(points)
        lines = find_cables(
            points.xyz, None if scanner.kind == UNORDERED else points.time_s, above_ground, self.config.cable, piece.origin,
            self.find_peaks, laser=points.columns[laser] if laser else None, scanner=scanner,
        )  # fmt: skip
        lines = with_known_clearance(lines, surface)
        # When the points on each line were measured
        yield "cables", of_core(with_times(lines, points), piece.core, is_whole=piece.is_whole)

    def join(self, found: LineSet, survey: SurveyContext) -> LineSet:
        """Return the wires of a survey, each span found whole by one tile, followed from pole to pole."""
        lines = across_seams(found, survey.cores)
        is_pole = lines.kind == POLE
        poles = without_repeats(lines.take(is_pole))
        return with_networks(LineSet.concatenate([lines.take(~is_pole), poles]))


@dataclass(frozen=True, slots=True)
class Radon:
    """Guardrails, barriers and cables of one tile; a run over many tiles takes its `parts` one by one."""

    recording: ClassVar[Recording] = "points"
    evidence: ClassVar[type[LineSet]] = LineSet
    carry: ClassVar[tuple[str, ...]] = ()
    config: RadonConfig = field(default_factory=RadonConfig)
    kinds: tuple[str, ...] = (*RAIL_KINDS, *CABLE_KINDS)
    name: str = "radon"
    buffer_m: float = 360.0
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
        """Return the lines of a survey: pieces of rails joined at the edges of cores, wires followed from pole to pole."""
        is_rail = np.isin(found.kind, RAIL_KINDS)
        rails, wires = (
            RailMethod().join(found.take(is_rail), survey),
            CableMethod().join(found.take(~is_rail), survey),
        )
        return LineSet.concatenate([rails, wires])

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
            ``ground`` (`Ground`); ``points`` (`Points`, in the fixed order that later arrays are in); ``height above
            the road`` (n,) float32 [m]; ``density image``, ``maximum height image`` and ``binary image`` (`Image`,
            figures 3 to 5); ``Radon image`` and ``peaks`` of the window with the strongest peak (`RadonImage`,
            `Peaks`; figures 6 and 7); ``seed lines`` and ``segments`` of all windows (`SeedLines`, `SeedSegments`);
            ``corrected centres`` and ``local fits``, lists of (k, 3) float64 [m, world]; ``guardrails and barriers``;
            for cables ``height above the ground`` and ``cables``; and ``lines``, what `linework.extract` returns.
            All but plain arrays have `plot`.

        References
        ----------
        D. Manandhar, R. Shibasaki (2002): Extraction of linear features from vehicle-borne laser data.

        Examples
        --------
        >>> rng = np.random.default_rng(1)
        >>> road = np.column_stack([*rng.uniform(0.0, 40.0, (2, 40_000)), rng.normal(0.0, 0.01, 40_000)])
        >>> beam = np.column_stack([np.linspace(0, 40, 4000), np.full(4000, 20.0), rng.uniform(0.4, 0.7, 4000)])
        >>> results = dict(Radon(kinds=("guardrail",)).steps(Points(np.concatenate([road, beam]))))
        >>> list(results)[:4], results["peaks"].theta_rad.round(2).tolist()
        (['ground', 'points', 'height above the road', 'density image'], [1.57])
        """
        if len(points) == 0:
            yield "lines", LineSet.empty()
            return
        tile = whole_tile(tile_of(points, trajectory, ground))
        yield "ground", tile.surface
        yield "points", tile.points
        found = []
        for method in self.parts:
            result: Any = LineSet.empty()
            for name, result in method.look_steps(tile):
                if name == "binary image":
                    images = rasterise(tile.points, result.grid)
                    yield from (("density image", images.density), ("maximum height image", images.maximum))
                yield name, result
                if name == "binary image":
                    yield from self._strongest(result)
            found.append(result)
        yield "lines", self.join(LineSet.concatenate(found), context_of_tile(tile))

    def _strongest(self, binary: Image) -> Iterator[StepResult]:
        """Yield the Radon image of the window with the strongest peak, and its peaks."""
        radon = strongest_window(binary, self.config.seeds)
        if radon is not None:
            yield "Radon image", radon
            yield "peaks", peaks_of_window(radon, self.config.seeds, self.find_peaks)
