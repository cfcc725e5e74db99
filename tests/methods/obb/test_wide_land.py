"""Edges of ground too wide for a road on which nothing is painted: meadows between hedges."""

from dataclasses import replace

import numpy as np
import pytest

from linework.methods.obb.candidates import WIDE_LAND
from linework.methods.obb.method import Obb
from linework.methods.obb.open_land import unpainted_width_m, weighed_by_width
from linework.methods.protocol import context_of_tile, tile_of, whole_tile
from linework.methods.tracking.boundary_lines import SmoothBoundary
from linework.methods.tracking.neighbours import LineAxis
from linework.model.lines import CANDIDATE
from linework.model.points import Points
from linework.model.trajectory import Trajectory


def axis(y, *, east=True):
    """A line along the x-axis; with its left side to the north where it runs east."""
    t = np.linspace(0.0, 60.0, 31)
    return LineAxis.of(t, np.column_stack([t if east else t[::-1], np.full(31, y)]))


def test_the_width_ends_at_paint_or_at_a_line_that_faces():
    south, north, path = axis(0.0), axis(18.0, east=False), axis(4.0)
    behind = axis(10.0)  # faces north as the southern one does
    assert unpainted_width_m([south, north], [], [path]) == pytest.approx([18.0, 18.0])
    assert unpainted_width_m([south, north, behind], [], []) == pytest.approx([18.0, 8.0, 8.0])
    assert unpainted_width_m([south, north], [axis(7.0)], [path]) == pytest.approx([7.0, 11.0])
    # An edge line on the edge, and paint far behind it
    assert unpainted_width_m([south], [axis(-0.2)], [path]) == pytest.approx([0.0])
    assert unpainted_width_m([south], [axis(-3.0)], [path]) == pytest.approx([4.9])


def test_without_a_line_that_faces_it_reaches_as_far_as_the_vehicle_drove():
    assert unpainted_width_m([axis(0.0)], [], [axis(9.0)]) == pytest.approx([9.9])
    assert unpainted_width_m([axis(0.0)], [], [axis(-9.0)]) == pytest.approx([0.0])
    assert unpainted_width_m([axis(0.0)], [], []) == pytest.approx([0.0])
    assert len(unpainted_width_m([], [], [])) == 0


def test_the_more_width_the_less_likely_a_road_and_kerbs_stay():
    nothing = np.zeros(0)
    edge = SmoothBoundary(
        None, None, nothing, "edge", nothing, 0.9, (0.0, 1.0), nothing, nothing, nothing, on_road=0.99
    )
    kerb = replace(edge, form="kerb", on_road=1.0)
    chances = []
    for width_m in (6.0, 9.0, 12.0, 18.0):
        facing = axis(width_m, east=False)
        wide, built, _ = weighed_by_width([edge, kerb, edge], [axis(0.0), axis(0.0), facing], [], [])
        assert built.on_road == 1.0
        chances.append(wide.on_road)
    assert chances[0] == edge.on_road
    assert np.all(np.diff(chances) < 0.0)
    assert chances[-1] < 0.05


def meadow(*, lines_at=()):
    """Points of an even meadow, 18 m wide between banks of 10 cm with rough feet, with painted lines or none, and a path."""
    rng = np.random.default_rng(3)
    n = 400_000
    x, y = rng.uniform(0.0, 60.0, n), rng.uniform(-11.0, 11.0, n)
    outside = np.abs(y) > 9.0
    z = np.where(outside, 0.1 + rng.normal(0.0, 0.03, n), rng.normal(0.0, 0.004, n))
    intensity = np.where(outside, 160.0, 100.0) + rng.normal(0.0, 6.0, n)
    # Something bright lies in the grass
    intensity[(np.abs(x - 20.0) < 0.4) & (np.abs(y - 5.0) < 0.075)] += 250.0
    for at in lines_at:
        intensity[np.abs(y - at) < 0.075] += 250.0
    points = Points(np.column_stack([x, y, z]), intensity=intensity.astype(np.float32))
    s = np.linspace(0.0, 60.0, 61)
    return points, Trajectory(s / 10.0, np.column_stack([s, np.full(61, -1.0), np.full(61, 2.0)]))


@pytest.mark.parametrize(("lines_at", "finds_edges"), [((), False), ((-3.5, 0.0, 3.5), True)])
def test_a_wide_meadow_has_no_boundaries_and_a_painted_road_has(lines_at, finds_edges):
    points, path = meadow(lines_at=lines_at)
    method = replace(Obb(), kinds=(*Obb().kinds, CANDIDATE))
    tile = whole_tile(tile_of(points, path))
    lines = method.join(method.look(tile), context_of_tile(tile))
    edges = lines.take(lines.kind == "road_boundary")
    reasons = lines.reason[lines.candidate_kind == "road_boundary"].tolist()
    assert (edges.length_m.sum() > 100.0) == finds_edges
    assert (WIDE_LAND in reasons) != finds_edges


def test_points_that_are_all_equally_bright_say_nothing_of_paint():
    points, path = meadow()
    points = replace(points, intensity=np.full(len(points), 100.0, dtype=np.float32))
    tile = whole_tile(tile_of(points, path))
    lines = Obb().join(Obb().look(tile), context_of_tile(tile))
    assert lines.take(lines.kind == "road_boundary").length_m.sum() > 100.0
