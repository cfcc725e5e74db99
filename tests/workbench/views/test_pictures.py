"""Tiles, points, cross-sections and heights as the page asks for them."""

from __future__ import annotations

import io
import json
import struct
import time

import numpy as np
import PIL.Image
import pytest
from shapely import LineString, Point
from websockets.sync.client import connect

from linework.editing.edits.new_lines import places_beside
from linework.files.vectors.read_write import read_lines
from linework.model.grid import Bounds
from linework.workbench.views import tiles as pictures
from linework.workbench.views.heights import heights_at, heights_from_path
from linework.workbench.worker.order import SurveyOrder
from linework.workbench.worker.session import SurveySession

IMAGES = ("density", "height", "above_road", "intensity")


@pytest.fixture
def session(drive):
    """Return the session of a worker, here in this process: the drive opened."""
    session = SurveySession(SurveyOrder(inputs=(drive,)), lambda _value: None)
    yield session
    session._held.close()


@pytest.fixture(scope="module")
def truth(made_drive):
    return read_lines(made_drive / "truth.gpkg")


def tile_at(survey, resolution, place):
    """Return z, column and row of the tile at a place, as a page counts them."""
    z = survey["tiles"]["resolutions"].index(resolution)
    size = resolution * survey["tiles"]["tile_px"]
    west, north = survey["tiles"]["origin"]
    return z, int((place[0] - west) // size), int((north - place[1]) // size)


def picture(answer):
    assert answer.status_code == 200, answer.text
    assert answer.headers["content-type"] == "image/png"
    image = PIL.Image.open(io.BytesIO(answer.content))
    assert image.size == (256, 256)
    return np.asarray(image.convert("RGBA"))


def unpacked(content):
    """Return n, origin, xyz, above, intensity as the page's `unpacked` does."""
    (n,), origin = struct.unpack_from("<I", content), struct.unpack_from("<3d", content, 8)
    assert len(content) == 32 + 15 * n
    xyz = np.frombuffer(content, "<f4", 3 * n, 32).reshape(-1, 3)
    above = np.frombuffer(content, "<i2", n, 32 + 12 * n)
    return n, np.array(origin), xyz, above, np.frombuffer(content, np.uint8, n, 32 + 14 * n)


def made_ahead(served):
    """Wait until the server has made all coarse tiles, which it does while nobody asks."""
    survey = served.get("/api/survey")
    z, col, row = tile_at(survey, 0.25, survey["path"][0])
    served.client.get(f"/api/tiles/density/{z}/{col}/{row}")
    coarsest = int(np.log2(survey["tiles"]["resolutions"][0] / 0.25))
    until = time.monotonic() + 120.0
    while time.monotonic() < until:
        if list((served.survey / ".linework").glob(f"stores/*/tiles-*/level{coarsest}.*.arrays")):
            return survey
        time.sleep(0.1)
    raise AssertionError("no coarse tiles after two minutes")


@pytest.mark.parametrize("image", IMAGES)
def test_tiles_of_all_zooms(served, image):
    survey = made_ahead(served)
    place = survey["path"][len(survey["path"]) // 2]
    for resolution in survey["tiles"]["resolutions"]:
        z, col, row = tile_at(survey, resolution, place)
        pixels = picture(served.client.get(f"/api/tiles/{image}/{z}/{col}/{row}"))
        assert pixels[..., 3].any()
        # The same again, byte for byte
        again = picture(served.client.get(f"/api/tiles/{image}/{z}/{col}/{row}"))
        np.testing.assert_array_equal(pixels, again)


def test_where_nothing_is_there_is_no_tile(served):
    for path in (
        "density/0/40/40",
        "density/9999/0/0",
        "height/-1/0/0",
        "density/3/-7/0",
        "density/0/2147483648/0",
    ):
        answer = served.client.get(f"/api/tiles/{path}")
        assert (answer.status_code, answer.content) == (204, b"")


def test_paint_is_brighter_than_the_road_beside_it(served, truth):
    survey = served.get("/api/survey")
    lines = truth.take((truth.kind == "lane_marking") & (truth.pattern == "solid"))
    bright, dark = [], []
    for i in range(len(lines)):
        seen = lines.observed[lines.offsets[i] : lines.offsets[i + 1]]
        if seen.sum() < 2:
            continue
        line = LineString(lines[i].xyz[seen, :2])
        for along in np.linspace(0.1, 0.9, 9) * line.length:
            at, ahead = line.interpolate(along), line.interpolate(along + 0.1)
            left = np.array([at.y - ahead.y, ahead.x - at.x]) / 0.1
            values = [grey(served, survey, np.array([at.x, at.y]) + s * left) for s in (-0.5, 0.0, 0.5)]
            if None not in values:
                bright.append(values[1])
                dark.append(min(values[0], values[2]))
    assert len(bright) >= 10
    # Some of it is worn; a footway beside it is brighter than the road
    assert np.median(np.array(bright) - np.array(dark)) > 60


def grey(served, survey, place):
    z, col, row = tile_at(survey, 0.0625, place)
    pixels = picture_once(served, f"/api/tiles/intensity/{z}/{col}/{row}")
    if pixels is None:
        return None
    size = 0.0625 * 256
    x = int((place[0] - survey["tiles"]["origin"][0] - col * size) / 0.0625)
    y = int((survey["tiles"]["origin"][1] - row * size - place[1]) / 0.0625)
    value = pixels[y, x]
    return int(value[0]) if value[3] else None


_SEEN: dict[str, object] = {}


def picture_once(served, path):
    if path not in _SEEN:
        answer = served.client.get(path)
        _SEEN[path] = picture(answer) if answer.status_code == 200 else None
    return _SEEN[path]


def test_a_tile_is_where_its_points_are(session):
    points = session.recordings.points.points.points()
    cells = pictures.tile_cells(session)
    for level in (2, 0, -2):
        tile = next(t for t in _tiles(cells, level))
        layers, is_whole = cells.layers(tile, np.inf)
        b, margin = tile.bounds, (layers.density.shape[0] - 256) // 2
        inside = (points.xyz[:, 0] >= b.west) & (points.xyz[:, 0] < b.east)
        inside &= (points.xyz[:, 1] >= b.south) & (points.xyz[:, 1] < b.north)
        x, y = points.xyz[inside, 0], points.xyz[inside, 1]
        expected = np.zeros((256, 256))
        rows = 255 - np.floor((y - b.south) / tile.cell_m).astype(int)
        np.add.at(expected, (rows, np.floor((x - b.west) / tile.cell_m).astype(int)), 1.0 / tile.cell_m**2)
        inner = slice(margin, margin + 256)
        assert is_whole
        np.testing.assert_allclose(layers.density[inner, inner], expected, rtol=2e-3)


def _tiles(cells, level):
    counts = cells.reader.counts
    east, north = max(counts, key=counts.get)
    tile = pictures.MapTile(0, east, north)
    while tile.level < level:
        tile = tile.parent
    while tile.level > level:
        tile = tile.children[3]
    yield tile


def test_coarse_tiles_are_kept_and_made_anew_when_damaged(session):
    cells = pictures.tile_cells(session)
    while cells.go_on():
        pass
    assert cells.n_done >= cells.n_all >= 2
    folder = cells._disk.folder
    files = sorted(folder.glob("level*.arrays"))
    assert len(files) == cells.n_all
    before = {file.name: file.read_bytes() for file in files}
    (folder / "scale.arrays").write_bytes(b"")
    files[0].write_bytes(before[files[0].name][:1000])
    files[1].unlink()
    fresh = pictures.TileCells(cells.reader, folder, cells.coarsest)
    for tile in sorted(set().union(*(tiles for level, tiles in fresh._occupied.items() if level > 0))):
        layers, is_whole = fresh.layers(tile, np.inf)
        assert is_whole
        assert layers is not None
    assert {file.name: file.read_bytes() for file in sorted(folder.glob("level*.arrays"))} == before


def test_neighbouring_tiles_show_one_picture(session):
    """A fine tile knows the points beyond its edge: no seam shows in what is filled and lit."""
    cells = pictures.tile_cells(session)
    tile = next(_tiles(cells, -2))
    beside = pictures.MapTile(tile.level, tile.east + 1, tile.north)
    one, other = (cells.layers(t)[0] for t in (tile, beside))
    margin = (one.density.shape[0] - 256) // 2
    for a, b in zip(one, other, strict=True):
        np.testing.assert_array_equal(a[:, 256 : 256 + 2 * margin], b[:, : 2 * margin])


def test_points_of_a_place(served):
    survey = served.get("/api/survey")
    east, north = survey["path"][len(survey["path"]) // 2][:2]
    query = f"/api/points?west={east - 10}&south={north - 8}&east={east + 10}&north={north + 8}"
    n, origin, xyz, above, intensity = unpacked(served.client.get(f"{query}&most=1000000").content)
    assert n > 5000
    world = xyz + origin
    assert np.abs(world[:, 0] - east).max() <= 10.001
    assert np.abs(world[:, 1] - north).max() <= 8.001
    assert np.mean(np.abs(above) <= 3) > 0.3
    assert intensity.max() > 200
    few = unpacked(served.client.get(f"{query}&most=500").content)
    assert 250 <= few[0] <= 500
    assert few[0] == unpacked(served.client.get(f"{query}&most=500").content)[0]
    # Between two heights there are the points between them
    low = float(np.median(world[:, 2])) + 0.5
    high = unpacked(served.client.get(f"{query}&most=1000000&low={low}&high={low + 2.0}").content)
    assert high[0] == np.sum((world[:, 2] >= low) & (world[:, 2] < low + 2.0))


def test_a_section_shows_the_kerb_to_its_side(served, truth):
    line = truth["kerb_top"][0].xyz
    vertex = len(line) // 2
    place, ahead = line[vertex], line[vertex + 1] - line[vertex]
    heading = np.degrees(np.arctan2(ahead[0], ahead[1]))
    answer = served.client.get(
        f"/api/section?east={place[0]}&north={place[1]}&heading_deg={heading}&half_width_m=2&thickness_m=0.5"
    )
    n, origin, xyz, _, _ = unpacked(answer.content)
    assert n > 100
    np.testing.assert_allclose(origin[:2], place[:2])
    assert np.abs(xyz[:, 0]).max() <= 2.0
    assert np.abs(xyz[:, 1]).max() <= 0.25
    # Of the two sides the one with the road is lower by the kerb
    left = np.median(xyz[(xyz[:, 0] < -0.1) & (xyz[:, 0] > -0.5), 2])
    right = np.median(xyz[(xyz[:, 0] > 0.1) & (xyz[:, 0] < 0.5), 2])
    assert 0.05 < abs(left - right) < 0.3


@pytest.mark.parametrize(
    ("kind", "within_m"),
    [
        ("lane_marking", 0.01),
        ("road_boundary", 0.04),
        ("kerb_top", 0.04),
        ("guardrail", 0.05),
        ("fence", 0.2),
    ],
)
def test_heights_are_those_of_the_truth(served, truth, kind, within_m):
    lines = truth[kind]
    xyz = lines.xyz[lines.observed][::5]
    if len(xyz) < 3:
        pytest.skip("none in this drive")
    found = served.post("/api/heights", {"kind": kind, "places": xyz[:300, :2].tolist()})
    height = np.array([np.nan if v is None else v for v in found["heights"]])
    error = np.abs(height - xyz[:300, 2])
    assert np.isfinite(error).mean() > 0.9
    assert np.nanmedian(error) < within_m / 2
    assert np.nanquantile(error, 0.8) < within_m


def test_a_cable_keeps_its_own_height_among_others(served, truth):
    cables = truth["cable"]
    xyz = cables.xyz[cables.observed][::7]
    if len(xyz) < 3:
        pytest.skip("none in this drive")
    found = served.post(
        "/api/heights", {"kind": "cable", "places": (xyz + np.array([0.0, 0.0, 0.1])).tolist()}
    )
    error = [abs(v - z) for v, z in zip(found["heights"], xyz[:, 2], strict=True) if v is not None]
    assert len(error) > 0.5 * len(xyz)
    assert np.median(error) < 0.05


@pytest.mark.parametrize("kind", ["road_boundary", "kerb_top", "guardrail", "fence", "cable"])
def test_a_line_dragged_aside_keeps_its_level_and_says_how_sure_it_is(session, truth, kind):
    rng = np.random.default_rng(1)
    lines = truth[kind]
    xyz = lines.xyz[lines.observed]
    if len(xyz) < 3:
        pytest.skip("none in this drive")
    at = np.repeat(xyz, 200 // len(xyz) + 1, axis=0)
    aside_m, way = rng.uniform(0.0, 0.4, len(at)), rng.uniform(0.0, 2.0 * np.pi, len(at))
    beside = at + np.column_stack([aside_m * np.cos(way), aside_m * np.sin(way), np.zeros(len(at))])
    height, sigma = heights_at(session, kind, beside.tolist())
    error = height - at[:, 2]
    assert np.isfinite(error).mean() > 0.7
    if kind in ("road_boundary", "kerb_top"):
        assert np.nanmax(np.abs(error)) < 0.15
    assert np.nanquantile(np.abs(error / sigma), 0.95) < 2.5


@pytest.mark.parametrize("kind", ["kerb_top", "guardrail"])
def test_what_stands_is_as_high_as_itself_where_it_is_put_beside_a_boundary(session, truth, kind):
    """Near the height of the boundary the points show the road, which was taken for a kerb's top, and no rail."""
    feet, error = truth["road_boundary"], []
    for line in truth[kind]:
        end = line.xyz[[0, -1], :2]
        away = [np.hypot(*(foot.xyz[:, :2] - end.mean(axis=0)).T).min() for foot in feet]
        at = places_beside(feet.take([int(np.argmin(away))]), kind, end)
        true = [line.xyz[np.argmin(np.hypot(*(line.xyz[:, :2] - place[:2]).T)), 2] for place in at]
        error.append(heights_at(session, kind, at.tolist())[0] - true)
    error_m = np.concatenate(error)
    assert np.isfinite(error_m).mean() > 0.6
    assert np.nanmedian(np.abs(error_m)) < 0.02
    assert np.nanquantile(np.abs(error_m), 0.9) < 0.15


def test_far_from_all_points_no_height_is_known(served):
    found = served.post("/api/heights", {"kind": "lane_marking", "places": [[0.0, 0.0], [1e7, -1e7]]})
    assert found == {"heights": [None, None], "sigmas": [None, None]}
    assert served.post("/api/heights", {"kind": "cable", "places": []}) == {"heights": [], "sigmas": []}


def test_without_points_the_path_tells_the_ground(session, monkeypatch):
    path = session.recordings.trajectory
    middle = path.xyz[len(path) // 2]
    places = middle[:2] + np.array([[0.0, 0.0], [2.0, 0.0], [400.0, 400.0]])
    height, sigma = heights_from_path(path, places)
    assert height[0] == pytest.approx(middle[2], abs=0.01)
    assert sigma[0] < sigma[1] < 0.15
    assert np.isnan(height[2])
    assert np.isnan(sigma[2])
    monkeypatch.setattr("linework.workbench.views.heights.patch_reader", lambda _table: None)
    assert heights_at(session, "road_boundary", [middle[:2]])[0][0] == pytest.approx(middle[2], abs=0.01)
    assert np.isnan(heights_at(session, "cable", [middle[:2]])[0][0])


POINTS = {"west": 0, "south": 0, "east": 10, "north": 10, "most": 100}
SECTION = {"east": 0, "north": 0, "heading_deg": 0, "half_width_m": 5, "thickness_m": 1}


@pytest.mark.parametrize(
    ("path", "query"),
    [
        ("points", POINTS | {"west": "nan"}),
        ("points", POINTS | {"east": "inf"}),
        ("points", POINTS | {"most": 0}),
        ("points", POINTS | {"most": 10**12}),
        ("points", POINTS | {"west": 20}),
        ("points", POINTS | {"east": 5000}),
        ("points", POINTS | {"low": "-inf"}),
        ("points", {"west": 0}),
        ("section", SECTION | {"half_width_m": 1e6}),
        ("section", SECTION | {"thickness_m": 0}),
        ("section", SECTION | {"thickness_m": "nan"}),
        ("section", SECTION | {"heading_deg": "1e300"}),
        ("section", SECTION | {"east": 1e300}),
        ("tiles/no such/0/0/0", {}),
        ("tiles/density/a/0/0", {}),
    ],
)
def test_what_makes_no_sense_is_refused(served, path, query):
    answer = served.client.get(f"/api/{path}", params=query)
    assert answer.status_code in (400, 404, 422), answer.text
    assert answer.json()["problem"]


@pytest.mark.parametrize(
    "body",
    [
        {"kind": "lane_marking"},
        {"kind": "house", "places": [[0, 0]]},
        {"kind": "lane_marking", "places": [[0]]},
        {"kind": "lane_marking", "places": [[1e12, 0]]},
        {"kind": "lane_marking", "places": [["a", 0]]},
        {"kind": "lane_marking", "places": [[0, 0]] * 2001},
        {"kind": "lane_marking", "places": [[0, 0]], "file": "/etc/passwd"},
    ],
)
def test_what_is_no_place_has_no_height(served, body):
    answer = served.client.post("/api/heights", json=body)
    assert answer.status_code in (400, 404, 422), answer.text
    assert answer.json()["problem"]


def test_a_tile_shown_in_part_is_told_of_when_it_is_whole(served_alone):
    with connect(
        f"{served_alone.socket_url}/api/live",
        additional_headers={"Cookie": served_alone.cookie_header},
        origin=served_alone.url,
    ) as live:
        made_ahead(served_alone)
        news = {}
        while news.get("type") != "pictures" or news["done"] < news["total"]:
            news = json.loads(live.recv(timeout=60.0))
        assert news["done"] == news["total"] >= 2


def test_place_and_bounds_agree(served):
    """The lattice holds the whole survey: also its farthest points are in a tile."""
    survey = served.get("/api/survey")
    bounds = Bounds(*survey["bounds"])
    z0 = survey["tiles"]["resolutions"][0] * 256
    west, north = survey["tiles"]["origin"]
    for place in ((bounds.west, bounds.south), (bounds.east, bounds.north)):
        assert 0 <= (place[0] - west) // z0 <= 1
        assert 0 <= (north - place[1]) // z0 <= 1
    assert Point(survey["path"][0][:2]).within(LineString([bounds[:2], bounds[2:]]).envelope.buffer(30.0))
