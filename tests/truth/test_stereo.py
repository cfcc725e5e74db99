"""Lane markings from the images of a simulated drive against its exact lines."""

from __future__ import annotations

import numpy as np

from linework.evaluation.measures import match_lines, score
from linework.imaging.rectify import rectifier_of
from linework.methods.protocol import SurveyContext
from linework.methods.stereo.method import Stereo
from linework.model.images import RectifiedPair
from linework.model.sightings import Sightings
from linework.simulation.roads.draw import draw_scenario
from linework.simulation.sensors.cameras import images_of, stereo_survey, stereo_truth


def test_markings_of_a_straight_road_within_centimetres() -> None:
    drive = stereo_survey(draw_scenario("straight", 3, 40.0), every_m=5.0, rays_per_pixel=1)
    rectifier, method = rectifier_of(drive.rig), Stereo()
    pairs = [
        RectifiedPair(*rectifier.rectified(p.left, p.right), rectifier.rig, p.number, p.time_s)
        for p in images_of(drive)
    ]
    lines = method.join(
        Sightings.concatenate(map(method.look, pairs)), SurveyContext(poses=drive.poses, rig=rectifier.rig)
    )
    truth = stereo_truth(drive, kinds=("lane_marking",))
    assert truth.observed.any()
    part = match_lines(lines.with_columns(crs=truth.crs), truth, kinds=("lane_marking",))[0]
    at = score([part], "lane_marking", 0.15, ()).at
    assert at.completeness is not None and at.completeness > 0.93
    assert at.correctness is not None and at.correctness > 0.96
    assert at.lateral.rmse_m is not None and at.lateral.rmse_m < 0.02
    assert at.height.rmse_m is not None and at.height.rmse_m < 0.03
    assert np.isfinite(lines.sigma_xy_m).all() and (lines.sigma_xy_m > 0.0).all()
