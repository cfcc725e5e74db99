"""A picked edge: snapped to, followed in both images, carried through the pairs; or refused with the reason."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.scenes.edge_scenes import (
    RADIUS_M,
    asphalt,
    bend,
    circular_poses,
    drive_over,
    edge,
    followed,
    pixel_of,
    shaded,
)
from tests.scenes.road_images import straight_poses

from linework.errors import InputError
from linework.methods.picked_edge.follow import EdgeStop
from linework.methods.picked_edge.method import NoEdgeAtPixelError, PosedPairs, follow_picked
from linework.model.images import RectifiedPair


@pytest.fixture(scope="module")
def round_the_bend() -> PosedPairs:
    return drive_over(bend, circular_poses())


@pytest.fixture(scope="module")
def along_the_edge() -> PosedPairs:
    return drive_over(edge, straight_poses(3))


def place_in_bend(along_m: float) -> tuple[float, float, float]:
    turn = along_m / (RADIUS_M + 1.75)
    return (RADIUS_M + 1.75) * np.sin(turn), RADIUS_M - (RADIUS_M + 1.75) * np.cos(turn), 0.0


def test_paint_is_followed_round_a_bend(round_the_bend: PosedPairs) -> None:
    found, steps = followed(round_the_bend, pixel_of(round_the_bend, 1, place_in_bend(12.0)))
    xyz = found.lines.xyz
    across = np.hypot(xyz[:, 0], xyz[:, 1] - RADIUS_M) - (RADIUS_M + 1.75)
    near = found.lines.sigma_xy_m < 0.03
    assert found.kind == "lane_marking" and found.lines.pattern[0] == "solid"
    assert found.lines.width_m[0] == pytest.approx(0.12, abs=0.015)
    assert found.lines.length_m[0] > 20.0
    assert np.sqrt(np.mean(across[near] ** 2)) < 0.015 and near.sum() > 30
    assert np.sqrt(np.mean(xyz[near, 2] ** 2)) < 0.03
    assert {step.number for step in steps} == set(found.pixels) == {0, 1, 2, 3}
    assert found.stops[0] == EdgeStop.END_OF_IMAGES


def test_a_bare_edge_is_a_road_boundary(along_the_edge: PosedPairs) -> None:
    found, _ = followed(along_the_edge, pixel_of(along_the_edge, 0, (9.0, 2.0, 0.0)))
    line = found.lines
    assert found.kind == "road_boundary" and np.isnan(line.width_m[0]) and line.pattern[0] == ""
    near = line.xyz[:, 0] < 16.0
    assert line.length_m[0] > 10.0 and np.sqrt(np.mean((line.xyz[near, 1] - 2.0) ** 2)) < 0.03


def test_a_pick_beside_an_edge_snaps_to_it(along_the_edge: PosedPairs) -> None:
    i, col, row = pixel_of(along_the_edge, 0, (9.0, 2.0, 0.0))
    beside, _ = followed(along_the_edge, (i, col + 3.0, row))
    near = beside.lines.xyz[:, 0] < 16.0
    assert np.abs(beside.lines.xyz[near, 1] - 2.0).max() < 0.1


def test_a_line_goes_on_through_a_shadow() -> None:
    drive = drive_over(shaded(bend), circular_poses(1))
    found, steps = followed(drive, pixel_of(drive, 0, place_in_bend(6.5)))
    assert found.lines.xyz[:, 0].max() > 14.0
    inside = (steps[0].xyz[:, 0] > 8.5) & (steps[0].xyz[:, 0] < 10.5)
    assert inside.sum() >= 4  # measured there, not bridged


def test_nothing_there_is_refused_with_a_pixel_that_works(along_the_edge: PosedPairs) -> None:
    i, col, row = pixel_of(along_the_edge, 0, (9.0, 2.0, 0.0))
    with pytest.raises(NoEdgeAtPixelError, match="no edge within 4 pixels") as refused:
        followed(along_the_edge, (i, col + 30.0, row))
    works = refused.value.works
    assert works is not None
    found, _ = followed(along_the_edge, (i, *works))
    assert found.kind == "road_boundary"


def test_an_edge_is_no_lane_marking(along_the_edge: PosedPairs) -> None:
    with pytest.raises(NoEdgeAtPixelError, match="not a stripe of paint"):
        followed(along_the_edge, pixel_of(along_the_edge, 0, (9.0, 2.0, 0.0)), kind="lane_marking")


def test_sky_is_refused(along_the_edge: PosedPairs) -> None:
    with pytest.raises(NoEdgeAtPixelError, match="horizon"):
        followed(along_the_edge, (0, 300.0, 10.0))


def test_the_caller_may_stop_it(round_the_bend: PosedPairs) -> None:
    following = follow_picked(round_the_bend, pixel_of(round_the_bend, 1, place_in_bend(12.0)))
    first = next(following)
    with pytest.raises(StopIteration) as end:
        following.send(True)
    assert set(end.value.value.pixels) == {first.number}
    assert end.value.value.stops == (EdgeStop.CALLER, EdgeStop.CALLER)


def test_poses_that_err_by_centimetres_are_absorbed() -> None:
    true = circular_poses()
    off = np.array([[0.0, 0.0, 0.0], [0.0, 0.04, 0.0], [0.0, -0.03, 0.02], [0.0, 0.02, 0.0]])
    drive = drive_over(bend, true, said=replace(true, xyz=true.xyz + off))
    found, steps = followed(drive, pixel_of(drive, 1, place_in_bend(12.0)))
    assert len(steps) == 4
    across = np.hypot(found.lines.xyz[:, 0], found.lines.xyz[:, 1] - RADIUS_M) - (RADIUS_M + 1.75)
    # An error of the pose turns what is farther ahead; the line stays within twice the largest
    near = found.lines.xyz[:, 0] < 14.0
    assert near.sum() > 20 and np.abs(across[near]).max() < 0.1


def test_a_pair_that_cannot_be_read_is_told_and_left_out(round_the_bend: PosedPairs) -> None:
    def source(i: int) -> RectifiedPair:
        if i == 2:
            raise InputError("cut off", where="000002.png")
        return round_the_bend.source(i)

    drive = replace(round_the_bend, source=source)
    found, _ = followed(drive, pixel_of(round_the_bend, 1, place_in_bend(12.0)))
    assert found.failures == ("000002.png: cut off.",) and set(found.pixels) == {0, 1, 3}


def test_bare_asphalt_has_no_edges() -> None:
    drive = drive_over(asphalt, straight_poses(1))
    with pytest.raises(NoEdgeAtPixelError):
        followed(drive, (0, 300.0, 140.0))
