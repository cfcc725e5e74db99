"""Boundaries that were found by different signs, one behind the other, are one line."""

from dataclasses import replace

import numpy as np
import pytest
from tests.scenes.box_scenes import boxes_on, everything_seen, straight

from linework.methods.obb.method import Obb
from linework.methods.protocol import SurveyContext
from linework.methods.tracking.boundary_lines import continued, smooth_boundaries
from linework.methods.tracking.track import TrackConfig, track_lines
from linework.model.boxes import BoxForm, BoxSet


def stretch(start_m, end_m, form, *, y=0.0, heading_deg=0.0):
    """Boxes along a line from x = start_m on, with the carriageway to its left."""
    course = straight(end_m - start_m, x=start_m, y=y, heading=np.deg2rad(heading_deg))
    boxes = boxes_on(course, form=form, noise=0.005)
    return replace(boxes, contrast=np.full(len(boxes), np.nan), height_m=np.nan_to_num(boxes.height_m))


def boundaries(*parts):
    """Return the road boundaries through the boxes of a road whose van drives 3 m to their left."""
    path = np.column_stack([np.arange(0.0, 60.0), np.full(60, 3.0), np.zeros(60)])
    lines = Obb().join(BoxSet.concatenate(parts), SurveyContext(origin=(0.0, 0.0, 0.0), path=path))
    return lines.take(lines.kind == "road_boundary")


def test_an_edge_is_one_line_whatever_shows_it():
    line = boundaries(
        stretch(0.0, 20.0, BoxForm.EDGE),
        stretch(21.0, 35.0, BoxForm.CHANGE),
        stretch(42.0, 60.0, BoxForm.EDGE),
    )
    assert len(line) == 1
    assert line.xyz[[0, -1], 0] == pytest.approx([0.0, 60.0], abs=0.1)
    assert np.all(np.diff(line.xyz[:, 0]) > 0.0)
    assert np.allclose(line.xyz[:, 1], 0.0, atol=0.02)
    # Where nothing was seen the line is bridged, and less sure
    hidden = (line.xyz[:, 0] > 35.2) & (line.xyz[:, 0] < 41.9)
    assert np.all(line.bridged[hidden])
    assert not np.any(line.bridged[(line.xyz[:, 0] < 19.0) | (line.xyz[:, 0] > 43.0)])
    assert line.sigma_xy_m[hidden].max() > 2.0 * line.sigma_xy_m[~hidden].max()


@pytest.mark.parametrize(
    "second",
    [
        stretch(21.0, 35.0, BoxForm.CHANGE, y=0.6),
        stretch(31.0, 45.0, BoxForm.CHANGE),
        stretch(21.0, 35.0, BoxForm.CHANGE, heading_deg=-40.0),
        stretch(20.5, 35.0, BoxForm.KERB),
    ],
    ids=["beside it", "11 m on", "in another direction", "of another form"],
)
def test_what_does_not_continue_an_edge_stays_a_line_of_its_own(second):
    lines = boundaries(stretch(0.0, 20.0, BoxForm.EDGE), second)
    assert len(lines) >= 1
    assert max(lines.length_m) < 20.5


def test_pieces_that_overlap_run_on_without_going_back():
    for y in (0.05, 0.13):
        line = boundaries(stretch(0.0, 20.0, BoxForm.EDGE), stretch(19.4, 40.0, BoxForm.CHANGE, y=y))
        assert len(line) == 1
        step = np.diff(line.xyz, axis=0)
        assert np.all(step[:, 0] > 0.0)
        assert np.abs(np.arctan2(step[:, 1], step[:, 0])).max() < 0.3


def test_the_order_of_the_boxes_does_not_matter():
    parts = [
        stretch(0.0, 20.0, BoxForm.EDGE),
        stretch(21.0, 35.0, BoxForm.CHANGE),
        stretch(36.0, 60.0, BoxForm.EDGE),
    ]
    boxes = BoxSet.concatenate(parts)
    mixed = boxes.take(np.random.default_rng(2).permutation(len(boxes)))
    assert boundaries(boxes).xyz.tobytes() == boundaries(mixed).xyz.tobytes()
    turned = replace(boxes, u=np.where(boxes.form[:, None] == BoxForm.CHANGE, -boxes.u, boxes.u))
    assert len(boundaries(turned)) == 1


def test_a_step_down_goes_on_as_a_change_of_the_ground():
    # The verge lies to the south, 12 cm lower than the pavement: seen from it the edge is a kerb
    step = boxes_on(straight(20.0, x=20.0, heading=np.pi), form=BoxForm.KERB, noise=0.005)
    line = boundaries(step, stretch(20.5, 40.0, BoxForm.CHANGE))
    assert line.form.tolist() == ["edge"]
    assert line.length_m[0] > 39.0


@pytest.mark.parametrize(("heading_deg", "expected"), [(0.0, 1), (15.0, 1), (45.0, 2), (90.0, 2), (180.0, 2)])
def test_ends_that_touch_are_joined_where_the_line_turns_by_little(heading_deg, expected):
    lines = []
    for part in (
        stretch(0.0, 20.0, BoxForm.CHANGE),
        stretch(20.0, 40.0, BoxForm.CHANGE, y=0.05, heading_deg=heading_deg),
    ):
        lines += smooth_boundaries(part, track_lines(part, TrackConfig(), width_m=0.15), everything_seen)
    assert len(lines) == 2
    assert len(continued(lines)) == expected
