"""Classes in the plan view: the lines that a tile depends on, and cells that hold several classes."""

from __future__ import annotations

import numpy as np

from linework.methods.classes.point_class import PointClass
from linework.model.lines import LineSet
from linework.workbench.server.pictures import CLASS_COLOURS, class_image
from linework.workbench.views.point_classes import lines_near_tile
from linework.workbench.views.pyramid import MapTile


def test_every_class_has_a_colour_of_its_own():
    classes = class_image()["classes"]
    assert {kind for kind, _, _ in CLASS_COLOURS} == set(PointClass)
    assert len({one["colour"] for one in classes}) == len(classes) == len(PointClass)


def test_a_tile_depends_on_the_lines_around_its_block_that_are_not_rejected():
    lines = LineSet.from_lines(
        [
            [[10.0, 10.0, 0.0], [20.0, 10.0, 0.0]],
            [[-20.0, 10.0, 0.0], [-10.0, 10.0, 0.0]],  # of the block beside
            [[900.0, 10.0, 0.0], [910.0, 10.0, 0.0]],
            [[12.0, 10.0, 0.0], [22.0, 10.0, 0.0]],
            [[-2000.0, 30.0, 0.0], [30.0, 30.0, 0.0], [2000.0, 30.0, 0.0]],
        ],
        kind=["road_boundary"] * 5,
        id=["here", "beside", "far", "rejected", "long"],
        review=["", "", "", "rejected", ""],
    )
    for tile in (MapTile(0, 0, 0), MapTile(-2, 1, 3), MapTile(1, 0, 0)):
        assert lines_near_tile(lines, tile).id.tolist() == ["here", "beside", "long"]
    assert lines_near_tile(lines, MapTile(0, 14, 0)).id.tolist() == ["far"]
    assert len(lines_near_tile(LineSet.empty(), MapTile(0, 0, 0))) == 0


def test_tiles_of_all_levels_show_the_same(served):
    """What a coarse tile shows is the highest class of each square of cells of the finer ones."""
    survey = served.get("/api/survey")
    assert "class" in [image["name"] for image in survey["images"]]
    resolutions, (west, north) = survey["tiles"]["resolutions"], survey["tiles"]["origin"]
    east_m, north_m = survey["middle"][:2]
    shown = {}
    for z in range(len(resolutions)):
        size = 256 * resolutions[z]
        col, row = int((east_m - west) // size), int((north - north_m) // size)
        answer = served.client.get(f"/api/tiles/class/{z}/{col}/{row}")
        if answer.status_code == 200:
            shown[resolutions[z]] = answer.content
    assert len(shown) >= 4
    assert all(png.startswith(b"\x89PNG") for png in shown.values())
    assert np.isclose(max(shown) / min(shown), 2.0 ** (len(shown) - 1))
