"""The road image of a tile: each pixel from the image of the drive that sees its place on the road best.

Separate from `linework.workbench.views.tiles`, whose pictures are made from points.
"""

from __future__ import annotations

import io
from collections import OrderedDict
from dataclasses import dataclass, field

import numpy as np
import PIL.Image

from linework.arrays import AnyArray, FloatArray, IntArray
from linework.errors import InputError
from linework.files.images.read import decoded_image, most_bytes
from linework.files.images.screen import read_inside
from linework.imaging.ground_views import (
    LONGEST_FOOTPRINT_M,
    BestView,
    GroundView,
    field_of_view,
    ground_view,
    image_values,
    moved_poses,
    poses_near,
    with_neighbours,
)
from linework.methods.stereo.road_plane import RoadShape, fit_pair_road
from linework.runs.opened.pairs import OpenedStereo
from linework.runs.opened.surface import SurveySurface
from linework.workbench.views.pyramid import TILE_PX, MapTile
from linework.workbench.worker.session import SurveySession

#: Name of the image among those of the plan, and its title.
#: Coarsest level that is shown, of 12.5 cm a pixel: above it a tile takes hundreds of images.
COARSEST_ROAD_LEVEL = -1
#: Images and tiles that are kept in memory: 8 of 2 megapixels in colour are 50 MB.
_N_IMAGES, _N_TILES = 8, 96
#: A pose nearer to the last one that is looked at is left out: 10 m ahead, footprints, which grow with the square of the
#: distance, differ by less than 2 % then, and a van that waits has hundreds of poses at one place. [m]
MOVED_M = 0.1
#: Distance of the places from which it is told which poses are worth a look at all of a tile's: poses are about a metre apart,
#: and so are the bands that one sees best. [m]
_SPARSE_M = 0.25
#: Largest distance of those places. [pixels]
_MOST_SPARSE_PX = 8


def road_tile_png(session: SurveySession, tile: MapTile) -> bytes:
    """Return the PNG of a tile, transparent where no image sees the road; b"" where none does, or from too far."""
    stereo = session.recordings.stereo
    if stereo is None or tile.level > COARSEST_ROAD_LEVEL:
        return b""
    made: RoadImages = session.keep("road images", lambda: RoadImages(stereo, session.surface))
    return made.png(tile)


@dataclass(slots=True)
class RoadImages:
    """Makes the road image of tiles, and keeps images, surfaces and tiles that were needed last.

    Parameters
    ----------
    surface
        The ground from points; None: each pair's own road surface.
    """

    stereo: OpenedStereo
    surface: SurveySurface | None
    _images: OrderedDict[int, AnyArray | None] = field(default_factory=OrderedDict)
    _tiles: OrderedDict[MapTile, bytes] = field(default_factory=OrderedDict)
    _shapes: dict[int, RoadShape | None] = field(default_factory=dict)
    _field: FloatArray = field(init=False)

    def __post_init__(self) -> None:
        self._field = field_of_view(self.stereo.series.rig.left)

    def png(self, tile: MapTile) -> bytes:
        """Return the PNG of a tile; b"" where no image sees the road."""
        if tile not in self._tiles:
            values = self.values(tile)
            self._tiles[tile] = b"" if not values[..., 3].any() else _encoded(values)
        self._tiles.move_to_end(tile)
        while len(self._tiles) > _N_TILES:
            self._tiles.popitem(last=False)
        return self._tiles[tile]

    def values(self, tile: MapTile) -> AnyArray:
        """Return (rows, cols, 4) uint8 red, green, blue and opacity of a tile, row 0 north."""
        out = np.zeros((TILE_PX * TILE_PX, 4), np.uint8)
        places = _cell_middles(tile)
        poses = self.stereo.poses
        rig = self.stereo.series.rig
        low, high = places.min(axis=0), places.max(axis=0)
        # The footprint of a pixel grows with the square of the distance
        eye_m = max(float(rig.left.position_m[2]), 1.0) + 3.0
        reach_m = float(np.sqrt(LONGEST_FOOTPRINT_M * rig.left.fy * eye_m))
        near = moved_poses(poses, poses_near(poses, low, high, reach_m), MOVED_M)
        ground = None if self.surface is None else self._ground(tile, places)
        # Which image sees a place best hardly depends on its height: one pair's surface, carried along, decides that
        guess = (
            next((shape for i in near.tolist() if (shape := self._shape(i))), None)
            if ground is None
            else None
        )
        sparse = _sparse_cells(tile)
        few = None if ground is None else ground[sparse]
        near = with_neighbours(near, self._best(near, places[sparse], few, guess).pose)
        best = self._best(near, places, ground, guess)
        if ground is None:
            best = self._on_own_ground(near, places, best)
        for i in np.unique(best.pose[best.pose >= 0]).tolist():
            own = np.flatnonzero(best.pose == i)
            image, pixels = self._image(i), best.pixels[own]
            if image is None:
                continue
            colours = np.rint(image_values(image, pixels)).astype(np.uint8)
            out[own, :3] = colours if colours.ndim == 2 else colours[:, None]
            out[own, 3] = 255
        return out.reshape(TILE_PX, TILE_PX, 4)

    def _best(
        self, poses: IntArray, places: FloatArray, ground: FloatArray | None, guess: RoadShape | None
    ) -> BestView:
        """Return which of the poses sees each place (n, 2) [m, world] best: on the ground, or on a guessed shape of the road."""
        best = BestView.of(len(places))
        for i in poses.tolist():
            height = ground if ground is not None else self._own_ground(i, places, guess)
            best.look(i, self._view(i, places, height))
        return best

    def _on_own_ground(self, poses: IntArray, places: FloatArray, guessed: BestView) -> BestView:
        """Return the best views of places (n, 2) [m, world], each on the surface of its own pair.

        By that, a place at the lower edge of its image may lie below it: it is then seen from another pose. Such places are
        stripes across the road, one before each pose.
        """
        best = BestView.of(len(places))
        for i in np.unique(guessed.pose[guessed.pose >= 0]).tolist():
            self._look_on_own_ground(best, i, places, np.flatnonzero(guessed.pose == i))
        lost = np.flatnonzero((guessed.pose >= 0) & (best.pose < 0))
        for i in poses.tolist() if len(lost) else ():
            self._look_on_own_ground(best, i, places, lost)
        return best

    def _look_on_own_ground(self, best: BestView, i: int, places: FloatArray, at: IntArray) -> None:
        ground = self._own_ground(i, places[at], self._shape(i))
        best.look(i, self._view(i, places[at], ground), at)

    def _view(self, i: int, places: FloatArray, ground: FloatArray) -> GroundView:
        xyz = np.column_stack([places, ground])
        return ground_view(self.stereo.series.rig.left, self._field, self.stereo.poses, i, xyz)

    def _ground(self, tile: MapTile, places: FloatArray) -> FloatArray:
        """Return the height of the ground at places (n, 2) [m, world]; NaN where it is not known."""
        assert self.surface is not None
        found = self.surface.over(tile.bounds.grown(2.0 * self.surface.cell_m))
        height = np.asarray(found.height_m(places), dtype=np.float64)
        grid = found.grid
        col = np.floor((places[:, 0] - grid.east_m) / grid.cell_width_m).astype(np.int64)
        row = np.floor((grid.north_m - places[:, 1]) / grid.cell_height_m).astype(np.int64)
        return np.where(found.is_known[row, col], height, np.nan)

    def _own_ground(self, i: int, places: FloatArray, shape: RoadShape | None) -> FloatArray:
        """Return the height of the road at places (n, 2) by its shape before pair i [m, world]; NaN where it has none."""
        if shape is None:
            return np.full(len(places), np.nan)
        poses, rig = self.stereo.poses, self.stereo.rectifier.rig
        turn = poses.R_world_vehicle[i] @ rig.R_vehicle_camera
        eye = poses.xyz[i] + poses.R_world_vehicle[i] @ rig.position_m
        up = turn @ shape.plane.up(rig)
        flat = places - eye[:2]
        z = (-shape.plane.camera_height_m(rig) - flat @ up[:2]) / up[2]
        seen = np.column_stack([flat, z]) @ turn
        return np.asarray(eye[2] + z + shape.heights_m(seen[:, 0], seen[:, 2]))

    def _shape(self, i: int) -> RoadShape | None:
        if i not in self._shapes:
            try:
                self._shapes[i] = fit_pair_road(self.stereo.pair(self.stereo.pairs[i].number))
            except InputError:
                self._shapes[i] = None
        return self._shapes[i]

    def _image(self, i: int) -> AnyArray | None:
        """Return the left image of a pair in its colours; None where it cannot be read."""
        if i not in self._images:
            camera, path = self.stereo.series.rig.left, self.stereo.pairs[i].left
            try:
                data = read_inside(path, self.stereo.survey.root, most_bytes(camera))
                self._images[i] = decoded_image(data, path, camera, in_colour=True)
            except InputError:
                self._images[i] = None
        self._images.move_to_end(i)
        while len(self._images) > _N_IMAGES:
            self._images.popitem(last=False)
        return self._images[i]


def _cell_middles(tile: MapTile) -> FloatArray:
    """Return (n, 2) the middles of a tile's pixels, row by row from the north. [m, world]"""  # noqa: D400
    at = (np.arange(TILE_PX) + 0.5) * tile.cell_m
    east, north = np.meshgrid(tile.bounds.west + at, tile.bounds.north - at)
    return np.column_stack([east.ravel(), north.ravel()])


def _sparse_cells(tile: MapTile) -> IntArray:
    """Return the numbers (k,) of some of a tile's pixels, evenly spread over it and on its edges."""
    step = int(np.clip(_SPARSE_M / tile.cell_m, 1, _MOST_SPARSE_PX))
    one = np.unique(np.append(np.arange(0, TILE_PX, step), TILE_PX - 1))
    return np.asarray((one[:, None] * TILE_PX + one).ravel())


def _encoded(values: AnyArray) -> bytes:
    kept = io.BytesIO()
    PIL.Image.fromarray(values).save(kept, format="PNG", compress_level=1)
    return kept.getvalue()
