"""Lines drawn into stereo pairs."""

import numpy as np
import pytest

from linework.errors import InputError
from linework.evaluation.report.page import ReportContent, report_html
from linework.evaluation.report.stereo_views import StereoViews, chosen_numbers, in_image
from linework.model.camera import LOOKING_AHEAD, RectifiedRig
from linework.model.images import Poses, RectifiedPair
from linework.model.lines import LineSet
from linework.navigation.poses import rotations_of

RIG = RectifiedRig(
    focal_px=100.0, cx=79.5, cy=40.0, width=160, height=100, base_m=0.5,
    position_m=np.array([0.0, 0.25, 2.0]), R_vehicle_camera=LOOKING_AHEAD,
)  # fmt: skip
ORIGIN = np.array([5e5, 5.4e6, 100.0])


def poses(n=3):
    """Return a van that drives north, 10 m a pair."""
    xyz = ORIGIN + np.column_stack([np.zeros(n), 10.0 * np.arange(n), np.zeros(n)])
    nan = np.full((n, 3), np.nan)
    return Poses(np.arange(float(n)), xyz, rotations_of(np.zeros((n, 3))), nan, nan)


def line_ahead(kind="lane_marking"):
    xyz = ORIGIN + np.array([[0.0, 0.0, 0.0], [0.0, 60.0, 0.0]])
    return LineSet.from_lines([xyz], kind=[kind])


def read(number):
    image = np.full((100, 160), 90, dtype=np.uint8)
    return RectifiedPair(image, image, RIG, number, float(number))


def test_a_line_is_where_the_cameras_see_it():
    left, right, row = in_image(line_ahead()[0].xyz, poses(), 0, RIG)
    at = np.nanargmin(np.abs(row - 60.0))  # 2 m below the camera, 10 m ahead: 20 pixels under the horizon
    assert row[at] == pytest.approx(60.0, abs=0.6)
    assert left[at] == pytest.approx(RIG.cx + 2.5, abs=0.1)  # 0.25 m to the right of the left camera
    assert right[at] == pytest.approx(RIG.cx - 2.5, abs=0.1)
    assert np.isnan(row[0])  # under the van


def test_pairs_are_shown_where_a_line_is_ahead():
    views = StereoViews(poses(12), np.arange(12) + 5, read)
    assert set(chosen_numbers(line_ahead(), views)) <= set(range(5, 11))
    assert len(chosen_numbers(LineSet.empty(), views)) == 3


def test_the_report_shows_the_pairs():
    views = StereoViews(poses(), np.arange(3), read)
    page = report_html(ReportContent(title="t", lines=line_ahead(), views=views))
    assert "Lines in the images" in page
    both = LineSet.concatenate([line_ahead(), line_ahead("lane_marking_stereo")])
    assert "Lines in the images" in report_html(ReportContent(title="t", lines=both, views=views))


def test_pairs_that_cannot_be_read_are_left_out():
    def broken(number):
        raise InputError("cut off", where="a.png")

    page = report_html(
        ReportContent(title="t", lines=line_ahead(), views=StereoViews(poses(), np.arange(3), broken))
    )
    assert "Lines in the images" not in page
