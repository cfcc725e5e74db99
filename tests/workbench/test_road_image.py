"""The road image: paint appears where it is, each pixel from the nearest image, nothing where no image sees the road."""

from __future__ import annotations

import io
import weakref

import numpy as np
import PIL.Image
import pytest

from linework.arrays import distance_along
from linework.files.vectors.read_write import read_lines
from linework.imaging.ground_views import BestView, field_of_view, ground_view, image_values, moved_poses
from linework.model.camera import Camera
from linework.model.images import Poses
from linework.workbench.road_image import picture
from linework.workbench.road_image.picture import COARSEST_ROAD_LEVEL, RoadImages, road_tile_png
from linework.workbench.views.pyramid import TILE_PX, MapTile
from linework.workbench.worker.order import SurveyOrder
from linework.workbench.worker.session import SurveySession

#: Tiles of 4 m: 1.6 cm a pixel.
FINE = -4


@pytest.fixture(scope="module")
def session(made_drive, tmp_path_factory):
    return SurveySession(SurveyOrder((made_drive,), work=tmp_path_factory.mktemp("work")), lambda _: None)


def level_camera():
    return Camera(width=640, height=480, fx=500.0, fy=500.0, cx=320.0, cy=240.0, position_m=[0.0, 0.0, 2.0])


def poses_at(*east):
    n = len(east)
    xyz = np.column_stack([east, np.zeros(n), np.zeros(n)])
    turn = np.repeat(np.eye(3)[None], n, axis=0)
    return Poses(time_s=np.arange(float(n)), xyz=xyz, R_world_vehicle=turn,
                 sigma_xyz_m=np.full((n, 3), np.nan), sigma_attitude_rad=np.full((n, 3), np.nan))  # fmt: skip


def stripe_offsets(images, line):
    """How far the middle of the brightest stripe in the image is from the middle of a line of truth, every 5 m. [m]"""
    along = distance_along(line[:, :2])
    found = []
    # Nearer than the other stripe of a double line
    across = np.arange(-0.14, 0.141, 0.01)
    for s in np.arange(2.0, along[-1] - 1.0, 5.0):
        middle = np.array([np.interp(s, along, line[:, k]) for k in (0, 1)])
        way = np.array(
            [np.interp(s + 0.5, along, line[:, k]) - np.interp(s - 0.5, along, line[:, k]) for k in (0, 1)]
        )
        way /= np.hypot(*way)
        places = middle + across[:, None] * [way[1], -way[0]]
        size = 64.0 * 2.0**FINE
        values = []
        for east, north in places:
            tile = MapTile(FINE, int(np.floor(east / size)), int(np.floor(north / size)))
            col = int((east - tile.bounds.west) / tile.cell_m)
            row = int((tile.bounds.north - north) / tile.cell_m)
            values.append(images(tile)[row, col])
        values = np.array(values, dtype=float)
        if (values[:, 3] == 0).any():
            continue
        bright = values[:, 0] - np.median(values[:, 0])
        weight = np.where(bright > 0.5 * bright.max(), 1.0, 0.0)
        if bright.max() > 60.0:
            found.append(float((weight * across).sum() / weight.sum()))
    return np.array(found)


@pytest.mark.parametrize("with_points", [True, False])
def test_paint_is_within_two_pixels_of_the_truth(session, made_drive, with_points):
    truth = read_lines(made_drive / "truth.gpkg")["lane_marking"]
    made = RoadImages(session.recordings.stereo, session.surface if with_points else None)
    kept = {}

    def images(tile):
        if tile not in kept:
            kept[tile] = made.values(tile)
        return kept[tile]

    off = np.concatenate([stripe_offsets(images, truth[i].xyz) for i in range(len(truth))])
    assert len(off) >= 10
    cell_m = MapTile(FINE, 0, 0).cell_m
    assert np.median(np.abs(off)) <= cell_m
    # Without points a pair knows its road as a plane and a little more: far to the sides that is off
    assert np.mean(np.abs(off) <= 2.0 * cell_m) >= (0.9 if with_points else 0.75)


def test_each_place_is_seen_from_the_nearest_image_that_sees_it():
    camera, poses = level_camera(), poses_at(0.0, 4.0, 8.0)
    places = np.column_stack([np.arange(0.0, 22.0), np.zeros(22), np.zeros(22)])
    views = [ground_view(camera, field_of_view(camera), poses, i, places) for i in range(3)]
    found, turned = BestView.of(len(places)), BestView.of(len(places))
    for i in range(3):
        found.look(i, views[i])
        turned.look(2 - i, views[2 - i])
    best = found.pose
    assert turned.pose.tolist() == best.tolist()
    own = np.flatnonzero(best >= 0)
    assert found.pixels[own].tolist() == [views[best[k]].pixels[k].tolist() for k in own]
    assert np.isnan(found.pixels[best < 0]).all()
    # The lower edge of the image is 4.2 m ahead
    assert best[:5].tolist() == [-1] * 5
    assert best[5:9].tolist() == [0] * 4
    assert best[9:13].tolist() == [1] * 4
    assert set(best[13:].tolist()) <= {2, -1}
    # 10 cm a pixel at a height of 2 m and 500 pixels: 10 m
    assert best[8 + 9] == 2 and best[8 + 11] == -1
    assert np.allclose(views[0].pixels[10], [320.0, 240.0 + 500.0 * 2.0 / 10.0])


def test_of_a_van_that_waits_one_pose_is_looked_at():
    poses = poses_at(0.0, 2.0, *(4.0 + 0.01 * np.sin(np.arange(600.0))), 6.0, 6.05, 6.11)
    assert moved_poses(poses, np.arange(len(poses.time_s)), 0.1).tolist() == [0, 1, 2, 602, 604]
    assert moved_poses(poses, np.arange(0), 0.1).tolist() == []


def test_the_memory_of_a_tile_does_not_grow_with_its_poses(session, monkeypatch):
    made = RoadImages(session.recordings.stereo, session.surface)
    middle = made.stereo.poses.xyz[len(made.stereo.poses) // 2, :2]
    tile = MapTile(-2, *(int(v) for v in np.floor(middle / 16.0)))
    views, alive = [], []

    def noted(*given):
        alive.append(sum(view() is not None for view in views))
        found = ground_view(*given)
        views.append(weakref.ref(found.pixels))
        return found

    monkeypatch.setattr(picture, "ground_view", noted)
    values = made.values(tile)
    assert len(views) >= 5 and max(alive) <= 1
    # The same picture with every pose many times over
    near = picture.poses_near
    monkeypatch.setattr(picture, "poses_near", lambda *given: np.repeat(near(*given), 20))
    n_views = len(views)
    assert made.values(tile).tobytes() == values.tobytes()
    assert len(views) == 2 * n_views and max(alive) <= 1


def test_the_images_that_were_needed_last_are_kept(session, monkeypatch):
    made = RoadImages(session.recordings.stereo, session.surface)
    monkeypatch.setattr(picture, "_N_IMAGES", 2)
    for i in (0, 1, 0, 2):
        made._image(i)
    assert list(made._images) == [0, 2]


def test_a_place_without_a_height_is_not_seen():
    camera = level_camera()
    places = np.array([[6.0, 0.0, 0.0], [6.0, 0.0, np.nan], [6.0, 0.0, 3.0]])
    view = ground_view(camera, field_of_view(camera), poses_at(0.0), 0, places)
    assert np.isfinite(view.footprint_m).tolist() == [True, False, False]


def test_what_a_lens_folds_back_is_not_seen():
    camera = Camera(width=640, height=480, fx=500.0, fy=500.0, cx=320.0, cy=240.0,
                    distortion=(-0.3, 0.0, 0.0, 0.0, 0.0), position_m=[0.0, 0.0, 2.0])  # fmt: skip
    places = np.array([[1.2, y, 0.0] for y in np.linspace(-6.0, 6.0, 40)])
    view = ground_view(camera, field_of_view(camera), poses_at(0.0), 0, places)
    assert not np.isfinite(view.footprint_m).any()


def test_values_between_pixels_are_interpolated():
    image = np.array([[0, 10, 20], [100, 110, 120], [0, 0, 0]], dtype=np.uint8)
    assert image_values(image, np.array([[0.5, 0.0], [1.0, 0.5]])).tolist() == [5.0, 60.0]
    colour = np.stack([image, image, image], axis=-1)
    assert image_values(colour, np.array([[0.5, 0.0]])).tolist() == [[5.0, 5.0, 5.0]]


def test_tiles_are_transparent_where_no_image_sees_the_road(session):
    poses = session.recordings.stereo.poses
    middle = poses.xyz[len(poses) // 2, :2]
    size = 64.0 * 2.0**-2
    tile = MapTile(-2, *(int(v) for v in np.floor(middle / size)))
    shown = np.asarray(PIL.Image.open(io.BytesIO(road_tile_png(session, tile))))
    assert shown.shape == (TILE_PX, TILE_PX, 4)
    assert 0.02 < (shown[..., 3] == 255).mean() < 0.98
    assert set(np.unique(shown[..., 3]).tolist()) == {0, 255}
    # Behind the first image, far away, and where a tile would take hundreds of images
    assert road_tile_png(session, MapTile(-2, tile.east + 50, tile.north)) == b""
    coarse = COARSEST_ROAD_LEVEL + 1
    up = coarse + 2
    assert road_tile_png(session, MapTile(coarse, tile.east >> up, tile.north >> up)) == b""


def test_the_server_offers_the_road_image(served):
    survey = served.get("/api/survey")
    assert [image["name"] for image in survey["images"]][-1] == "road"
    z = len(survey["tiles"]["resolutions"]) - 1
    size = survey["tiles"]["tile_px"] * survey["tiles"]["resolutions"][z]
    east, north, _ = survey["path"][len(survey["path"]) // 2]
    col, row = (
        int((east - survey["tiles"]["origin"][0]) / size),
        int((survey["tiles"]["origin"][1] - north) / size),
    )
    answers = [
        served.client.get(f"/api/tiles/road/{z}/{col + i}/{row + j}") for i in (-1, 0, 1) for j in (-2, -1, 0)
    ]
    assert {answer.status_code for answer in answers} <= {200, 204}
    pictures = [answer.content for answer in answers if answer.status_code == 200]
    assert pictures and all(content.startswith(b"\x89PNG") for content in pictures)


def test_without_points_the_road_is_seen_without_gaps_before_each_pose(session):
    """A place at the lower edge of its image is seen from the pose behind where its own pair's road lies below it."""
    made = RoadImages(session.recordings.stereo, None)
    path = session.recordings.stereo.poses.xyz[:, :2]
    size = 64.0 * 2.0**FINE
    seen = {}
    for east, north in path[2:5]:
        tile = MapTile(FINE, int(np.floor(east / size)), int(np.floor(north / size)))
        seen[tile] = made.values(tile)[..., 3] > 0
    assert min(each.mean() for each in seen.values()) > 0.99


def test_looking_from_few_poses_gives_what_looking_from_all_gives(session, monkeypatch):
    """Which poses are worth a look is told from some of a tile's places."""
    place = session.recordings.stereo.poses.xyz[3, :2]
    tiles = [
        MapTile(level, *(int(np.floor(v / (64.0 * 2.0**level))) for v in place))
        for level in (COARSEST_ROAD_LEVEL, FINE)
    ]
    few = RoadImages(session.recordings.stereo, session.surface)
    found = [few.values(tile) for tile in tiles]
    monkeypatch.setattr(picture, "with_neighbours", lambda numbers, _: numbers)
    whole = RoadImages(session.recordings.stereo, session.surface)
    for tile, values in zip(tiles, found, strict=True):
        np.testing.assert_array_equal(values, whole.values(tile))
