"""Paint under two strips of an aircraft that overlap, one brighter than the other."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import linework
from linework.kernels.paint.paint_points import POINT_INTENSITY, sort_into_cells
from linework.kernels.paint.scan_rows import ROWS_REACH_M, evened_rows
from linework.methods.obb.kerbs_and_edges import BOUNDARY_REACH_M, STONES_REACH_M
from linework.methods.obb.marking import MARKING_CELL_M, MARKING_REACH_M
from linework.methods.obb.method import BOX_REACH_M, Obb
from linework.methods.protocol import tile_of, whole_tile
from linework.model.grid import holds
from linework.model.tile import LaserGains, local_origin
from linework.scanlines import sampled
from linework.scanlines.sampled import gains_of_points, timing_of_points

ORIGIN = np.array([500_000.0, 5_600_000.0, 100.0])
#: Scan lines run at this angle to the road; lines and points along them are this far apart. [rad, m]
TURNED, APART_M, ALONG_M = np.radians(40.0), 0.31, 0.19
LENGTH_M, HALF_M = 96.0, 4.0


def strip(rng: np.random.Generator, apart_m: float) -> np.ndarray:
    """Return the places (n, 2) of one strip's points on the road: straight scan lines, pulses evenly along them."""
    reach = int(LENGTH_M / ALONG_M)
    line, pulse = np.meshgrid(np.arange(-reach, reach), np.arange(-reach, reach))
    v = line * apart_m + rng.uniform(0.0, apart_m) + rng.normal(0.0, 0.005, line.shape)
    u = pulse * ALONG_M + rng.uniform(0.0, ALONG_M, line.shape[1]) + rng.normal(0.0, 0.01, line.shape)
    x, y = u * np.cos(TURNED) - v * np.sin(TURNED), u * np.sin(TURNED) + v * np.cos(TURNED)
    inside = (x >= 0.0) & (x < LENGTH_M) & (np.abs(y) < HALF_M)
    return np.column_stack([x[inside], y[inside]])


def dashed_road(seed: int, gain: float = 1.25, turned: float = 0.0) -> linework.Points:
    """Return a road with dashes of 4 m every 12 m along its middle under two strips, the second brighter by `gain`.

    turned: of the paint against the road. [rad]
    """
    rng = np.random.default_rng(seed)
    parts = [strip(rng, APART_M), strip(rng, 1.07 * APART_M)]
    xy = np.concatenate(parts)
    of_strip = np.concatenate([np.ones(len(parts[0])), np.full(len(parts[1]), gain)])
    # The spot of the laser is as wide as the paint
    spot = xy + rng.normal(0.0, 0.05, xy.shape)
    along = spot[:, 0] * np.cos(turned) + spot[:, 1] * np.sin(turned)
    across = spot[:, 1] * np.cos(turned) - spot[:, 0] * np.sin(turned)
    paint = (np.abs(across) < 0.12) & (along % 12.0 < 4.0)
    bright = 20_000.0 * np.where(paint, 1.6, 1.0) * of_strip * rng.normal(1.0, 0.06, len(xy))
    xyz = np.column_stack([xy, rng.normal(0.0, 0.01, len(xy))]) + ORIGIN
    return linework.Points(xyz, intensity=np.round(bright), crs="EPSG:25832")


def along_of(lines: linework.LineSet) -> list[float]:
    """Return the angle of each marking to the road [degrees]."""
    ends = [lines.xyz[[a, b - 1], :2] for a, b in zip(lines.offsets[:-1], lines.offsets[1:], strict=True)]
    return [abs(float(np.degrees(np.arctan2(*(e[1] - e[0])[::-1])) + 90.0) % 180.0 - 90.0) for e in ends]


def test_the_direction_of_scan_lines_is_found_in_any_order():
    points = dashed_road(71)
    rows = gains_of_points(points).rows
    assert len(rows) == 1
    assert np.degrees(np.arctan2(rows[0, 1], rows[0, 0])) % 180.0 == pytest.approx(40.0, abs=0.5)
    assert rows[0, 2] == pytest.approx(APART_M, rel=0.1)
    turned = points.take(np.arange(len(points))[::-1])
    assert gains_of_points(turned).rows.tobytes() == rows.tobytes()


def test_dense_points_have_no_rows(monkeypatch):
    # Lines 5 cm apart, of two strips
    rng = np.random.default_rng(72)
    xy = np.concatenate([strip(rng, APART_M / 6.0)[::2], strip(rng, APART_M / 6.0)[1::2]])
    xy = xy[(xy[:, 0] < 40.0)]
    points = linework.Points(np.column_stack([xy, np.zeros(len(xy))]) + ORIGIN)
    assert len(gains_of_points(points).rows) == 0
    monkeypatch.setattr(sampled, "ROWS_APART_M", 0.0)
    assert len(gains_of_points(points).rows) == 1


def test_rows_are_the_same_for_points_and_for_files():
    # The first piece is dense, the others are not
    rng = np.random.default_rng(77)
    dense = np.column_stack([rng.uniform(0.0, 20.0, (100_000, 2)), np.zeros(100_000)]) + ORIGIN
    road = dashed_road(77).xyz
    far = [road + np.array([128.0 * k, 0.0, 0.0]) for k in range(1, 16)]
    for parts in ([dense - np.array([992.0, 0.0, 0.0]), *far], far):
        points = linework.Points(np.concatenate(parts), intensity=np.ones(sum(map(len, parts))))
        rows = gains_of_points(points).rows
        assert rows.tobytes() == timing_of_points(points).gains.rows.tobytes()
    assert len(rows) == 1


def test_dashes_are_found_and_no_line_along_the_scan_lines(monkeypatch):
    points = dashed_road(74)
    lines = linework.extract(points, kinds=("lane_marking",), adjust=False)
    assert lines.kind.tolist() == ["lane_marking"]
    assert along_of(lines)[0] < 0.5
    assert np.abs(lines.xyz[:, 1] - ORIGIN[1]).max() <= 0.1
    assert np.ptp(lines.xyz[:, 0]) >= LENGTH_M - 16.0
    # Without the rows it is different: the test is of them
    monkeypatch.setattr(sampled, "_rows_of_pieces", lambda _: LaserGains().rows)
    before = linework.extract(points, kinds=("lane_marking",), adjust=False)
    assert max(along_of(before)) > 20.0


def evened(points: linework.Points, rows: np.ndarray, start_m: float = 0.0, end_m: float = LENGTH_M) -> dict:
    """Return evened intensities by place, of the points between two distances along the road."""
    xyz = points.xyz - ORIGIN
    chosen = (xyz[:, 0] >= start_m) & (xyz[:, 0] < end_m)
    xyz, intensity = xyz[chosen], points.intensity[chosen]
    lattice = (0.5, -20, 2 * int(start_m), 40, 2 * int(np.ceil(end_m - start_m)))
    col, row = (np.floor(xyz[:, k] / 0.5).astype(np.int32) - (lattice[2], lattice[1])[k] for k in (0, 1))
    cells = (row * lattice[4] + col).astype(np.int32)
    sorted_points, starts = sort_into_cells(
        xyz, intensity, np.zeros(0), np.zeros(3), cells, lattice[3] * lattice[4]
    )
    out = evened_rows(sorted_points, starts, lattice, rows)
    places = map(tuple, sorted_points[:, :2].tolist())
    return dict(zip(places, zip(sorted_points[:, POINT_INTENSITY], out, strict=True), strict=True))


def test_a_point_depends_on_what_is_near():
    points = dashed_road(74)
    rows = gains_of_points(points).rows
    whole, part = evened(points, rows), evened(points, rows, 20.0, 60.0)
    inner = [place for place in part if 20.0 + ROWS_REACH_M <= place[0] < 60.0 - ROWS_REACH_M]
    assert len(inner) > 5_000
    assert all(whole[place] == part[place] for place in inner)


def test_boxes_are_the_same_in_every_tile():
    points = dashed_road(78)
    whole = whole_tile(tile_of(points))
    method = Obb(kinds=("lane_marking", "road_boundary"))
    whole = replace(whole, origin=local_origin(*points.xyz.min(axis=0)))
    found = method.find_boxes(whole)
    x = whole.points.xyz[:, 0]
    for start_m in (20.0, 33.3, 47.9):
        core = whole.core._replace(west=ORIGIN[0] + start_m, east=ORIGIN[0] + start_m + 13.0)
        held = (x >= core.west - BOX_REACH_M) & (x < core.east + BOX_REACH_M)
        part = method.find_boxes(replace(whole, core=core, points=whole.points.take(held), is_whole=False))
        own, others = (b.take(holds(core, b.centre + np.asarray(whole.origin))) for b in (part, found))
        assert len(own) > 5
        assert own.centre.tobytes() == others.centre.tobytes()
        assert own.score.tobytes() == others.score.tobytes()


def test_a_box_reaches_no_farther_than_its_parts():
    across_cells = np.sqrt(2.0) * MARKING_CELL_M
    assert STONES_REACH_M + across_cells + MARKING_REACH_M <= BOX_REACH_M
    assert BOUNDARY_REACH_M <= BOX_REACH_M


def test_saturated_points_stay_alike():
    points = dashed_road(79)
    full = np.minimum(points.intensity, 30_500.0)
    cut = linework.Points(points.xyz, intensity=full, crs=points.crs)
    before, after = np.array(list(evened(cut, gains_of_points(cut).rows).values())).T
    assert np.all(after[before == 30_500.0] == 30_500.0)
    assert np.count_nonzero(before == 30_500.0) > 100


def noise(values: np.ndarray) -> float:
    return float(np.median(np.abs(values - np.median(values))))


def test_rows_are_evened_and_one_strip_is_left_as_it_is():
    rows = gains_of_points(dashed_road(75)).rows
    before, after = np.array(list(evened(dashed_road(75), rows).values())).T
    assert noise(after) < 0.75 * noise(before)
    # What is left scatters as the points of one strip do, nearly
    before, after = np.array(list(evened(dashed_road(75, gain=1.0), rows).values())).T
    assert noise(after) < 1.03 * noise(before)


def test_paint_along_the_scan_lines_stays():
    points = dashed_road(76, turned=TURNED + np.radians(2.0))
    values = evened(points, gains_of_points(points).rows)
    places = np.array(list(values))
    before, after = np.array(list(values.values())).T
    turned = TURNED + np.radians(2.0)
    across = places[:, 1] * np.cos(turned) - places[:, 0] * np.sin(turned)
    along = places[:, 0] * np.cos(turned) + places[:, 1] * np.sin(turned)
    on = (np.abs(across) < 0.1) & (along % 12.0 < 4.0) & (np.abs(places[:, 1]) < 3.5)
    beside = (np.abs(across) > 0.4) & (np.abs(across) < 1.0)
    assert on.sum() > 20
    contrast = [np.median(v[on]) - np.median(v[beside]) for v in (before, after)]
    assert contrast[1] > 0.6 * contrast[0]
