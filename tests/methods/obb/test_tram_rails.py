"""A paler strip of stone beside the rail of a tram, and paint that is none."""

from __future__ import annotations

import numpy as np
import pytest

import linework

ORIGIN = np.array([500_000.0, 5_600_000.0, 100.0])
LENGTH_M = 40.0
#: Offsets of the heads of two grooved rails of normal gauge, and their width: that of the head of 60R2. [m]
RAILS_M, HEAD_M = (-0.72, 0.72), 0.056


def tram_road(seed: int, strip_m: float, *, has_rails: bool) -> linework.Points:
    """Return a road with or without rails, and a strip 0.2 m wide and 1.35 times as bright `strip_m` from its middle."""
    rng = np.random.default_rng(seed)
    n = int(LENGTH_M * 8.0 * 1500)
    x, y = rng.uniform(0.0, LENGTH_M, n), rng.uniform(-4.0, 4.0, n)
    bright = np.where(np.abs(y - strip_m) < 0.1, 1.35, 1.0)
    if has_rails:
        for rail in RAILS_M:
            bright[np.abs(y - rail) < 0.5 * HEAD_M] = 3.0
    xyz = np.column_stack([x, y, rng.normal(0.0, 0.004, n)]) + ORIGIN
    return linework.Points(
        xyz,
        intensity=np.round(2000.0 * bright * rng.lognormal(0.0, 0.1, n)),
        time_s=x / 10.0,
        crs="EPSG:25832",
    )


def markings(points: linework.Points, *, candidates: bool = False) -> linework.LineSet:
    return linework.extract(points, kinds=("lane_marking",), adjust=False, candidates=candidates)


@pytest.mark.parametrize("seed", [31, 32])
def test_a_strip_beside_a_rail_is_stone(seed):
    strip_m = RAILS_M[1] + 0.25
    beside = markings(tram_road(seed, strip_m, has_rails=True), candidates=True)
    assert "lane_marking" not in beside.kind.tolist()
    assert any(reason.startswith("strip of stone") for reason in beside.reason.tolist())
    # Alone it may be paint, and so may one that is farther from the rails than their bed is wide
    alone = markings(tram_road(seed, strip_m, has_rails=False))
    assert alone.kind.tolist() == ["lane_marking"]
    for far_m in (0.7, 2.2):
        far = markings(tram_road(seed, RAILS_M[1] + far_m, has_rails=True))
        assert far.kind.tolist() == ["lane_marking"]
