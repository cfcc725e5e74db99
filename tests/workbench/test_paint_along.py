"""How bright the points along a line are, and where they show dashes: measured on a simulated drive."""

from __future__ import annotations

import numpy as np
import pytest

from linework.editing.edits.new_lines import line_beside
from linework.files.vectors.read_write import read_lines
from linework.workbench.review.paint import BRIGHTNESS_STATION_M, PaintOfLines, brightness_along
from linework.workbench.worker.order import SurveyOrder
from linework.workbench.worker.session import SurveySession


@pytest.fixture
def session(drive):
    return SurveySession(SurveyOrder((drive,)), lambda _: None)


def longest(lines):
    return lines.take([int(np.argmax(lines.length_m * (lines.kind == "lane_marking")))])


def test_paint_is_brighter_than_the_road_beside_it(session, drive_lines):
    line = longest(read_lines(drive_lines))
    brightness, weight = brightness_along(session, line.xyz, 0.12)
    assert len(brightness) == pytest.approx(line.length_m[0] / BRIGHTNESS_STATION_M, abs=2)
    assert np.mean(weight > 0) > 0.5
    left = np.array([-(line.xyz[-1, 1] - line.xyz[0, 1]), line.xyz[-1, 0] - line.xyz[0, 0]])
    aside = line_beside(line, "lane_marking", line.xyz[:1, :2] + 0.4 * left / np.hypot(*left))
    asphalt, n = brightness_along(session, aside.xyz, 0.12)
    on, off = np.average(brightness, weights=weight), np.average(asphalt, weights=n)
    assert off == pytest.approx(1.0, abs=0.35)
    assert on > 1.2 * off


def test_far_from_all_points_nothing_is_measured(session, drive_lines):
    line = longest(read_lines(drive_lines))
    _, weight = brightness_along(session, line.xyz + np.array([500.0, 500.0, 0.0]), np.nan)
    assert not weight.any()


def test_each_line_is_measured_once(session, drive_lines, monkeypatch):
    lines, asked = read_lines(drive_lines), []

    def measured(_, xyz, width_m):
        asked.append((len(xyz), width_m))
        return np.zeros((0, 2))

    monkeypatch.setattr("linework.workbench.review.paint.dash_spans", measured)
    paint, markings = PaintOfLines(), lines["lane_marking"]
    assert set(paint.of(session, lines)) == set(markings.id.tolist())
    assert len(asked) == len(markings)
    paint.of(session, lines)
    assert len(asked) == len(markings)
    moved = lines.with_columns(xyz=lines.xyz + 0.01, review=np.full(len(lines), "rejected"))
    assert paint.of(session, moved) == {}
