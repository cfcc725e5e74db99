"""The evidence of an item of the queue: what the points of the drive show of its lines."""

from __future__ import annotations

import numpy as np
import pytest


def _evidence(served, line, **more):
    xyz = np.array(line["xyz"])
    east, north, _ = xyz[len(xyz) // 2]
    query = {"kind": line["kind"], "east": east, "north": north, "line": line["id"]} | more
    answer = served.client.get("/api/evidence", params=query)
    assert answer.status_code == 200, answer.text
    return answer.json()


def _longest(served, kind):
    lines = [line for line in served.get("/api/lines")["lines"] if line["kind"] == kind]
    return max(lines, key=lambda line: line["length_m"])


def test_a_kerb_shows_its_step_where_the_line_is(served):
    line = _longest(served, "kerb_top")
    found = _evidence(served, line)
    fit = np.array(found["across"]["fit"])
    break_at = fit[np.argmax(np.abs(np.diff(fit[:, 1]))), 0]
    assert abs(break_at) < 0.06
    steps = np.array(found["along"]["values"])
    assert len(steps) >= 15
    assert np.median(np.abs(steps[:, 1])) == pytest.approx(line["height_m"], abs=0.04)
    residuals = np.array(found["across"]["residuals"])
    np.testing.assert_allclose(
        residuals[:, 1], np.array(found["across"]["bins"])[:, 1] - fit[:, 1], atol=2e-4
    )
    assert dict(found["facts"])["Step"].endswith("the line")


def test_a_marking_shows_its_stripe_and_bare_road_beside_it_none(served):
    line = _longest(served, "lane_marking")
    found = _evidence(served, line)
    fit = np.array(found["across"]["fit"])
    on = fit[:, 1] > fit[:, 1].min() + 1e-6
    assert abs(fit[on, 0].mean()) < 0.04
    assert np.ptp(fit[on, 0]) + 0.02 == pytest.approx(line["width_m"], abs=0.05)
    # In words what the chart shows, as a ratio is huge where dark points have no intensity
    said = f"{fit[:, 1].max():.2f} on it, {fit[:, 1].min():.2f} beside it (asphalt: 1)"
    assert dict(found["facts"])["Contrast"] == said
    assert fit[:, 1].max() > 1.15 * fit[:, 1].min()


def test_of_a_missing_line_the_road_is_shown_about_the_place(served):
    path = np.array(served.get("/api/survey")["path"])
    east, north, _ = path[len(path) // 2]
    found = served.get(f"/api/evidence?kind=road_boundary&east={east}&north={north}")
    assert found["across"]["label"].startswith("Height")
    step_m = float(dict(found["facts"])["Step"].split()[0]) / 100
    assert step_m < 0.03, "the middle of the road has no kerb"


def test_beyond_the_end_of_a_line_the_points_there_are_shown(served):
    line = _longest(served, "lane_marking")
    east, north, _ = line["xyz"][-1]
    found = _evidence(served, line, east=east, north=north, beyond=True)
    length_m = float(np.hypot(*np.diff(np.array(line["xyz"])[:, :2], axis=0).T).sum())
    if found["along"] is not None:
        assert found["along"]["stretch"] == pytest.approx([length_m, length_m + 15.0], abs=0.01)


def test_a_line_that_is_gone_is_said(served):
    answer = served.client.get("/api/evidence?kind=cable&east=0&north=0&line=none")
    assert answer.status_code == 404
    assert "no line" in answer.json()["problem"]
