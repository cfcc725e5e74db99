"""Lines across the seams of tiles: cut and joined they are as if never cut."""

from __future__ import annotations

import numpy as np
import pytest
from tests.conftest import CRS

from linework.files.las_write import write_las
from linework.files.survey import open_survey
from linework.model.grid import Bounds
from linework.model.lines import LineSet
from linework.model.points import Points
from linework.tiling import plan, run
from linework.tiling.plan import plan_tiles
from linework.tiling.seams import inside_core, join_seams

CORES = [Bounds(x, y, x + 50.0, y + 50.0) for y in (0.0, 50.0) for x in (0.0, 50.0)]


def winding() -> LineSet:
    """Return two winding rails over four cores, and a wire across the middle."""
    t = np.linspace(0, 1, 60)
    rail = np.stack([2 + 96 * t, 50 + 40 * np.sin(7 * t), 5 + t], axis=1)
    wire = np.array([[45.0, 20.0, 9.0], [52.0, 20.0, 8.0], [58.0, 20.0, 9.0]])
    return LineSet.from_lines(
        [rail, rail[::-1] + np.array([0, 3, 0]), wire],
        kind=["guardrail", "guardrail", "cable"],
        height_m=[0.7, 0.8, np.nan],
        bridged=np.arange(123) % 10 == 0,
        sigma_xy_m=np.linspace(0.01, 0.02, 123),
    )


def in_place(lines: LineSet) -> list[np.ndarray]:
    """Return the vertices of all lines, each from its western end, in a fixed order."""
    found = [lines.line(i) for i in range(len(lines))]
    found = [xyz if xyz[0, 0] < xyz[-1, 0] else xyz[::-1] for xyz in found]
    return sorted(found, key=lambda xyz: xyz[0].tolist())


def test_cut_and_joined_is_as_never_cut():
    lines = winding()
    parts = [inside_core(lines, core) for core in CORES]
    assert sum(map(len, parts)) > 8
    for part, core in zip(parts, CORES, strict=True):
        rails = part.of_kind("guardrail").xyz
        assert rails[:, 0].min() >= core.west
        assert rails[:, 1].max() <= core.north
    for order in ([0, 1, 2, 3], [3, 1, 0, 2]):
        joined = join_seams(LineSet.concatenate([parts[k] for k in order]), CORES)
        assert len(joined) == 3
        np.testing.assert_allclose(sorted(joined.length_m), sorted(lines.length_m), rtol=1e-9)
        np.testing.assert_allclose(sorted(joined.bridged_m), sorted(lines.bridged_m), rtol=1e-9)
        assert sorted(joined.height_m[joined.kind == "guardrail"]) == pytest.approx([0.7, 0.8])
        for one, two in zip(in_place(joined), in_place(lines), strict=True):
            at = np.cumsum(np.r_[0, np.linalg.norm(np.diff(two, axis=0), axis=1)])
            near = np.cumsum(np.r_[0, np.linalg.norm(np.diff(one, axis=0), axis=1)])
            for axis in range(3):
                np.testing.assert_allclose(np.interp(near, at, two[:, axis]), one[:, axis], atol=1e-9)


def test_a_wire_is_never_cut_and_belongs_to_one_core():
    wires = [inside_core(winding(), core).of_kind("cable") for core in CORES]
    assert [len(w) for w in wires] == [0, 1, 0, 0]
    assert len(wires[1].xyz) == 3


def test_ends_that_differ_by_a_little_meet_half_way_and_far_ones_do_not():
    def pieces(step_m: float) -> LineSet:
        west = np.array([[40.0, 10.0, 1.0], [50.0, 10.0, 1.0]])
        east = np.array([[50.0, 10.0 + step_m, 1.0], [60.0, 10.0 + step_m, 1.0]])
        return LineSet.from_lines([west, east], kind=["guardrail"] * 2, confidence=[0.5, 0.9])

    joined = join_seams(pieces(0.04), CORES)
    assert joined.xyz.tolist() == [[40, 10, 1], [50, 10.02, 1], [60, 10.04, 1]]
    assert joined.confidence.tolist() == pytest.approx([0.7])
    assert len(join_seams(pieces(0.2), CORES)) == 2


def test_lines_that_end_at_a_seam_but_do_not_go_on_stay_apart():
    side_by_side = [np.array([[40.0, y, 1.0], [50.0, y, 1.0]]) for y in (10.0, 10.05)]
    assert len(join_seams(LineSet.from_lines(side_by_side, kind=["guardrail"] * 2), CORES)) == 2
    other_kind = [np.array([[40.0, 10, 1], [50.0, 10, 1]]), np.array([[50.0, 10, 1], [60.0, 10, 1]])]
    assert len(join_seams(LineSet.from_lines(other_kind, kind=["guardrail", "fence"]), CORES)) == 2
    away_from_seams = [np.array([[40.0, 10, 1], [45.0, 10, 1]]), np.array([[45.0, 10, 1], [49.0, 10, 1]])]
    assert len(join_seams(LineSet.from_lines(away_from_seams, kind=["guardrail"] * 2), CORES)) == 2


def test_a_ring_comes_back_as_one_line():
    angle = np.linspace(0, 2 * np.pi, 80)
    ring = np.stack([50 + 20 * np.cos(angle), 50 + 20 * np.sin(angle), 0 * angle], axis=1)
    lines = LineSet.from_lines([ring], kind=["guardrail"])
    joined = join_seams(LineSet.concatenate([inside_core(lines, core) for core in CORES]), CORES)
    assert len(joined) == 1
    assert joined.length_m[0] == pytest.approx(lines.length_m[0])


def test_large_surveys_have_tiles_that_share_no_place():
    tiles = plan_tiles(Bounds(100.0, -300.0, 2600.0, 1500.0), 120.0)
    assert len({t.tile_id for t in tiles}) == len(tiles) == 9
    places = np.random.default_rng(2).uniform([100, -300], [2600, 1500], (500, 2))
    held = sum(
        ((places >= [t.core.west, t.core.south]) & (places < [t.core.east, t.core.north])).all(axis=1)
        for t in tiles
    )
    assert (held == 1).all()


class Kerb:
    """Finds the straight line y = 4 over the points it is given, a little off by where its tile is."""

    name, kinds, buffer_m = "kerb", ("guardrail",), 20.0

    def extract(self, tile):
        xyz = tile.points.xyz
        north = 5_400_004.0 + (0.01 if tile.core.west > 500_050 else 0.0)
        ends = np.array([[xyz[:, 0].min(), north, 100.0], [xyz[:, 0].max(), north, 100.0]])
        return LineSet.from_lines([ends], kind=["guardrail"], method=["kerb"])


def test_a_survey_in_tiles_gives_one_line_whatever_the_workers(tmp_path, monkeypatch):
    rng = np.random.default_rng(4)
    xyz = rng.uniform([0, 0, 0], [300, 10, 0.1], (3000, 3)) + np.array([500_000.0, 5_400_000.0, 100.0])
    write_las(Points(xyz), tmp_path / "a.laz", crs=CRS)
    survey = open_survey([tmp_path / "a.laz"])
    monkeypatch.setattr(plan, "MAX_SINGLE_M", 150.0)
    monkeypatch.setattr(plan, "CORE_M", 100.0)
    found = [run.extract_lines(survey, [Kerb()], n_workers=n) for n in (1, 3)]
    assert len(found[0].tiles) == 3
    assert len(found[0].lines) == 1
    assert found[0].lines.length_m[0] == pytest.approx(np.ptp(xyz[:, 0]), abs=0.01)
    np.testing.assert_array_equal(found[0].lines.xyz, found[1].lines.xyz)
