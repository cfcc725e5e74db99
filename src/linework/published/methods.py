"""The published methods over whole surveys, with what the papers leave to a person.

The steps themselves are in the modules of the papers; nothing of linework's own methods uses them.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
from scipy.spatial import cKDTree

from linework.arrays import BoolArray, Float32Array, FloatArray
from linework.methods.kinds import PUBLISHED_KINDS_OF
from linework.methods.protocol import Method, Recording, StepResult, SurveyContext, surface_of_tile
from linework.methods.seams import across_seams, of_core
from linework.model.grid import Bounds, holds
from linework.model.ground import Ground
from linework.model.images import RectifiedPair
from linework.model.lines import LineSet
from linework.model.sightings import Sightings
from linework.model.tile import TileData
from linework.published import radon_2002, stereo_1992
from linework.published.bounding_volumes import OBB
from linework.published.obb_2023 import (
    NoBoxError,
    Obb2023Config,
    PointsAbout,
    box_at,
    follow,
    with_range,
)
from linework.published.radon_2002 import Radon2002Config
from linework.published.stereo_1992 import Stereo1992Config
from linework.surface.road import height_above_road

#: Confidence of lines of methods that give none. [1]
NO_CONFIDENCE = 0.5
#: Fewest boxes of a line that no person picked: two collisions. [boxes]
FEWEST_BOXES = 3
#: Least share of the bright points of a search area that lie on one line where a person would start it. [1]
PICKED_SHARE = 0.9


def published_method(
    name: str,
    kinds: tuple[str, ...],
    *,
    radon: Radon2002Config | None = None,
    obb: Obb2023Config | None = None,
    stereo: Stereo1992Config | None = None,
) -> Method:
    """Return a published method by its name, "radon-2002", "obb-2023" or "stereo-1992".

    Parameters
    ----------
    kinds
        Those of `linework.methods.kinds.PUBLISHED_KINDS_OF` that it shall find.
    radon, obb, stereo
        Settings; None: defaults, the published ones where the papers give them.

    Examples
    --------
    >>> published_method("obb-2023", ("lane_marking",)).kinds
    ('lane_marking',)
    """
    own = tuple(kind for kind in PUBLISHED_KINDS_OF[name] if kind in kinds)
    method: Method
    if name == "radon-2002":
        method = Radon2002(radon or Radon2002Config(), own)
    elif name == "obb-2023":
        method = Obb2023(obb or Obb2023Config(), own)
    else:
        method = Stereo1992(stereo or Stereo1992Config(), own)
    return method


@dataclass(frozen=True, slots=True)
class Radon2002:
    """Guardrails in laser points as published in 2002: straight lines of images of a survey, which are not joined."""

    recording: ClassVar[Recording] = "points"
    evidence: ClassVar[type[LineSet]] = LineSet
    carry: ClassVar[tuple[str, ...]] = ()
    config: Radon2002Config = field(default_factory=Radon2002Config)
    kinds: tuple[str, ...] = ("guardrail",)
    name: str = "radon-2002"
    least_height_m: float = -math.inf

    @property
    def buffer_m(self) -> float:
        """Width of the margin of points around a tile's core [m]: an image whose middle is in the core is whole."""
        return self.config.image_m

    def look(self, piece: TileData) -> LineSet:
        """Return the guardrails of the images whose middle lies in the core of a tile."""
        lines = (result for name, result in self.steps(piece) if name == "lines")
        return LineSet.concatenate([LineSet.empty(), *lines])

    def steps(self, piece: TileData) -> Iterator[StepResult]:
        """Yield name and result of each step, image by image.

        Yields
        ------
        name, result
            ``corner`` (2,) of the image [m, world]; ``images`` (`HeightImages`); ``binary image``; ``Radon image``
            (its values, theta [rad] and x' [m]); ``peaks`` (`Candidates`); ``segments``, a list of (2, 2) ends
            [m, world]; ``corrected centres``, a list of (k, 3) [m, world; above the road]; ``lines`` (`LineSet`).
        """
        c, xyz = self.config, piece.points.xyz
        surface = surface_of_tile(piece)
        height = height_above_road(surface, xyz).astype(np.float64)
        n_cells = math.ceil(c.image_m / c.cell_m - 1e-9)
        for corner in radon_2002.image_corners(xyz[:, :2], piece.core, c.image_m, is_whole=piece.is_whole):
            inside = holds(Bounds(*corner, *(corner + c.image_m)), xyz[:, :2])
            xyh = np.column_stack([xyz[inside, :2] - corner, height[inside]])
            yield "corner", corner
            # Raster images of the points
            images = radon_2002.height_images(xyh, np.zeros(2), n_cells, c.cell_m)
            yield "images", images
            # Cells whose highest point is between the thresholds
            binary = radon_2002.binary_image(images.maximum, c.min_height_m, c.max_height_m)
            yield "binary image", binary
            # Peaks of its Radon transform are the seed lines
            radon, theta, x = radon_2002.radon_image(binary, c.cell_m, c.step_deg)
            yield "Radon image", (radon, theta, x)
            seeds = radon_2002.radon_peaks(radon, theta, x, c)
            yield "peaks", seeds
            # The lines themselves, on the image
            parts = [
                (share, *radon_2002.ends_of(theta_rad, rho, low, high, 0.5 * n_cells * c.cell_m))
                for theta_rad, rho in zip(seeds.theta_rad.tolist(), seeds.rho_m.tolist(), strict=True)
                for low, high, share in radon_2002.segments(binary, theta_rad, rho, c)
            ]
            yield "segments", [np.stack([start, end]) + corner for _, start, end in parts]
            # Circles along them, back to the points, and straight lines fitted to their centres
            band = xyh[(xyh[:, 2] >= c.min_height_m) & (xyh[:, 2] <= c.max_height_m)]
            centres = [
                (share, start, end, radon_2002.corrected_centres(band, start, end, c))
                for share, start, end in parts
            ]
            centres = [one for one in centres if len(one[3]) > 1]
            yield "corrected centres", [one[3] + np.append(corner, 0.0) for one in centres]
            lines = [
                radon_2002.fitted_locally(one, start, end, c.fit_m) + np.append(corner, 0.0)
                for _, start, end, one in centres
            ]
            # Heights are above the road: back to the world
            road = [line[:, 2] - height_above_road(surface, line) for line in lines]
            yield "lines", LineSet.from_lines(
                [np.column_stack([line[:, :2], line[:, 2] + z]) for line, z in zip(lines, road, strict=True)],
                kind=["guardrail"] * len(lines), method=[self.name] * len(lines),
                confidence=np.array([share for share, *_ in centres]),
                height_m=np.array([float(line[:, 2].mean()) for line in lines]),
            )  # fmt: skip

    def join(self, found: LineSet, survey: SurveyContext) -> LineSet:  # noqa: ARG002
        """Return the lines of all images: the paper joins none."""
        return found


@dataclass(frozen=True, slots=True)
class Obb2023:
    """Markings and road boundaries in laser points as published in 2023.

    In the paper a person places the first search area of each line. Here search areas cover all road, on a lattice,
    and each that gives a box and is not on a line yet starts one.
    """

    recording: ClassVar[Recording] = "points"
    evidence: ClassVar[type[LineSet]] = LineSet
    carry: ClassVar[tuple[str, ...]] = ()
    #: Lines are followed to the end of a tile's points, and cut at the edges of its core.
    buffer_m: ClassVar[float] = 16.0
    least_height_m: ClassVar[float] = -math.inf
    config: Obb2023Config = field(default_factory=Obb2023Config)
    kinds: tuple[str, ...] = ("lane_marking", "road_boundary")
    name: str = "obb-2023"

    def look(self, piece: TileData) -> LineSet:
        """Return the lines of a tile, cut at the edges of its core."""
        points_about = discs_of(piece.points.xyz, piece.points.intensity, self.config.radius_m)
        places = search_places(surface_of_tile(piece), piece.core, self.config.radius_m)
        lines, kinds = [], []
        for kind in self.kinds:
            starts, ends = np.zeros((0, 2)), np.zeros((0, 2))
            for place in places:
                if _is_on(place, starts, ends, self.config.radius_m):
                    continue
                try:
                    config = self.config
                    if kind == "lane_marking":
                        config = with_range(points_about, place, config)
                    first = box_at(points_about, place, kind, config)
                    if _is_on(first.centre[:2], starts, ends, float(first.half_m[1])):
                        continue
                    if kind == "lane_marking" and not _would_be_picked(points_about, place, first, config):
                        continue
                    found = follow(points_about, first, kind, config)
                except NoBoxError:
                    continue
                if len(found.boxes) < FEWEST_BOXES:
                    continue
                lines.append(found.xyz)
                kinds.append(kind)
                starts = np.concatenate([starts, found.xyz[:-1, :2]])
                ends = np.concatenate([ends, found.xyz[1:, :2]])
        if not lines:
            return LineSet.empty()
        found_lines = LineSet.from_lines(
            lines, kind=kinds, method=[self.name] * len(lines), confidence=np.full(len(lines), NO_CONFIDENCE)
        )
        return of_core(found_lines, piece.core, is_whole=piece.is_whole)

    def join(self, found: LineSet, survey: SurveyContext) -> LineSet:
        """Return the lines of a survey, pieces that meet at the edge of a core joined into one."""
        return across_seams(found, survey.cores)


def discs_of(xyz: FloatArray, intensity: Float32Array | None, radius_m: float) -> PointsAbout:
    """Return a function that gives the points (n, 3) [m] within a radius of a place, with their intensities (n,)."""
    origin = xyz[0, :2] if len(xyz) else np.zeros(2)
    tree = cKDTree(xyz[:, :2] - origin)

    def points_about(place: FloatArray) -> tuple[FloatArray, FloatArray | None]:
        index = np.array(sorted(tree.query_ball_point(place - origin, radius_m)), dtype=np.int64)
        return xyz[index], None if intensity is None else intensity[index].astype(np.float64)

    return points_about


def search_places(surface: Ground, core: Bounds, radius_m: float) -> FloatArray:
    """Return the middles of search areas that cover all road of a core, (n, 2) [m, world]: a square lattice, in rows.

    The lattice is spaced by the side of the square in the disc, so that every place is in a search area, and is the
    same for all tiles. Search areas beside the road, which may hold its boundary, count as on it.
    """
    step = math.sqrt(2.0) * radius_m
    east = np.arange(math.ceil(core.west / step), math.ceil(core.east / step)) * step
    north = np.arange(math.ceil(core.south / step), math.ceil(core.north / step)) * step
    places = np.stack(np.meshgrid(east, north), axis=-1).reshape(-1, 2)
    near = np.zeros(len(places), dtype=np.bool_)
    for aside in ((0.0, 0.0), (step, 0.0), (-step, 0.0), (0.0, step), (0.0, -step)):
        near |= _is_road(surface, places + np.array(aside))
    return places[near]


def _is_road(surface: Ground, places: FloatArray) -> BoolArray:
    row, col = (np.floor(v).astype(np.int64) for v in surface.grid.to_cell(places))
    inside = (row >= 0) & (row < surface.grid.n_rows) & (col >= 0) & (col < surface.grid.n_cols)
    found = np.zeros(len(places), dtype=np.bool_)
    found[inside] = surface.is_road[row[inside], col[inside]]
    return found


def _is_on(place: FloatArray, starts: FloatArray, ends: FloatArray, within_m: float) -> bool:
    """Return whether a place (2,) lies within a distance of segments between places (n, 2), all in metres."""
    way = ends - starts
    length2 = np.maximum((way**2).sum(axis=1), 1e-12)
    t = np.clip(((place - starts) * way).sum(axis=1) / length2, 0.0, 1.0)
    return bool(np.any(np.hypot(*(starts + t[:, None] * way - place).T) <= within_m))


def _would_be_picked(points_about: PointsAbout, place: FloatArray, box: OBB, config: Obb2023Config) -> bool:
    """Return whether a person would see a line in a search area: its box holds nearly all bright points."""
    xyz, intensity = points_about(place)
    if intensity is None:
        return False
    is_bright = (intensity >= config.min_intensity) & (intensity <= config.max_intensity)
    off = (xyz[is_bright] - box.centre) @ box.v
    return bool(np.mean(np.abs(off) <= box.half_m[1]) >= PICKED_SHARE)


@dataclass(frozen=True, slots=True)
class Stereo1992:
    """Bright line markers in stereo pairs as published in 1992: straight lines of each pair, which are not joined."""

    recording: ClassVar[Recording] = "pairs"
    evidence: ClassVar[type[Sightings]] = Sightings
    carry: ClassVar[tuple[str, ...]] = ()
    buffer_m: ClassVar[float] = 0.0
    least_height_m: ClassVar[float] = -math.inf
    config: Stereo1992Config = field(default_factory=Stereo1992Config)
    kinds: tuple[str, ...] = ("lane_marking",)
    name: str = "stereo-1992"

    def look(self, piece: RectifiedPair) -> Sightings:
        """Return the straight bright lines of a pair, in the vehicle frame at its time."""
        return stereo_1992.straight_lines_of_pair(piece, self.config)

    def join(self, found: Sightings, survey: SurveyContext) -> LineSet:
        """Return the lines of all pairs in the world: each by its ends, as all between is straight."""
        if len(found) == 0:
            return LineSet.empty()
        poses, numbers = survey.poses, survey.pair_numbers
        assert poses is not None, "sightings are placed by the poses of their pairs"
        first = np.flatnonzero(np.append(True, (np.diff(found.pair) != 0) | (np.diff(found.line) != 0)))
        last = np.append(first[1:], len(found)) - 1
        kept = last > first
        first, last = first[kept], last[kept]
        pose = found.pair[first] if numbers is None else np.searchsorted(numbers, found.pair[first])
        lines = [poses.to_world(int(k), found.xyz[[i, j]]) for k, i, j in zip(pose, first, last, strict=True)]
        share = found.score[first]
        return LineSet.from_lines(
            lines, kind=["lane_marking"] * len(lines), method=[self.name] * len(lines), confidence=share,
            pattern=np.where(share >= stereo_1992.SOLID_SHARE, "solid", "dashed"),
        )  # fmt: skip
