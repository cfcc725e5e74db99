"""Stripes, steps and what stands, found again across a line where they were put."""

from __future__ import annotations

import numpy as np
import pytest

from linework.workbench.review.fits import middle_of_points, step_across, stripe_across


@pytest.mark.parametrize(("middle_m", "width_m"), [(0.0, 0.12), (0.08, 0.12), (-0.1, 0.30)])
def test_a_stripe_is_found_where_it_was_painted(middle_m, width_m):
    noise = np.random.default_rng(5)
    offset = noise.uniform(-0.6, 0.6, 3000)
    bright = np.where(np.abs(offset - middle_m) < width_m / 2, 2.5, 1.0) + noise.normal(0.0, 0.2, 3000)
    fit = stripe_across(offset, bright)
    assert fit.at_m == pytest.approx(middle_m, abs=0.02)
    assert fit.width_m == pytest.approx(width_m, abs=0.03)
    assert fit.size == pytest.approx(2.5, rel=0.1)
    assert fit.explained > 0.8
    # The residuals are those of the means of bins: noise by the root of the points in one
    assert fit.residual < 0.2


def test_bare_asphalt_has_no_stripe_worth_the_name():
    noise = np.random.default_rng(6)
    fit = stripe_across(noise.uniform(-0.6, 0.6, 3000), 1.0 + noise.normal(0.0, 0.2, 3000))
    assert fit is None or (fit.size < 1.1 and fit.explained < 0.5)
    assert stripe_across(np.zeros(0), np.zeros(0)) is None
    dark = noise.uniform(-0.6, 0.6, 3000)
    groove = stripe_across(dark, np.where(np.abs(dark) < 0.1, 0.3, 1.0))
    assert groove is None or abs(groove.at_m) > 0.1, "a dark joint is no stripe"


def test_the_other_stripe_of_a_double_line_is_not_taken_for_the_line():
    noise = np.random.default_rng(9)
    offset = noise.uniform(-0.6, 0.6, 4000)
    for stronger in (0.5, 1.0, 3.0):
        bright = 1.0 + 0.5 * (np.abs(offset) < 0.06) + 0.5 * stronger * (np.abs(offset - 0.24) < 0.06)
        fit = stripe_across(offset, bright)
        assert (fit.at_m, fit.width_m) == pytest.approx((0.0, 0.12), abs=0.03), stronger


def test_a_hedge_behind_a_kerb_is_not_taken_for_it():
    noise = np.random.default_rng(10)
    offset = noise.uniform(-0.75, 0.75, 4000)
    height = np.where(offset > 0.0, 0.12, 0.0) + noise.normal(0.0, 0.004, 4000)
    hedge = (offset > 0.38) & (offset < 0.5) & (noise.uniform(size=4000) < 0.7)
    height[hedge] += noise.uniform(0.0, 0.4, hedge.sum())
    fit = step_across(offset, height)
    assert (fit.at_m, fit.size) == pytest.approx((0.0, 0.12), abs=0.02)
    assert np.abs(fit.value - fit.fitted).max() > 0.1, "what the hedge adds is left over, and shown"


def test_a_kerb_is_a_step_where_it_was_built():
    noise = np.random.default_rng(7)
    offset = noise.uniform(-0.75, 0.75, 3000)
    height = np.where(offset > 0.05, 0.12, 0.0) - 0.025 * offset + noise.normal(0.0, 0.004, 3000)
    fit = step_across(offset, height)
    assert fit.at_m == pytest.approx(0.05, abs=0.02)
    assert fit.size == pytest.approx(0.12, abs=0.01)
    assert fit.explained > 0.95
    assert fit.residual < 0.01
    turned = step_across(-offset, height)
    assert turned.size == pytest.approx(-0.12, abs=0.01)
    # The fall of a road is no step
    even = step_across(offset, -0.05 * offset + noise.normal(0.0, 0.004, 3000))
    assert abs(even.size) < 0.005


def test_a_wire_is_found_beside_the_line_without_the_road_below_it():
    noise = np.random.default_rng(8)
    wire = noise.normal([0.08, -0.05], 0.01, (40, 2))
    other = noise.uniform([-0.6, -0.6], [0.6, -0.45], (200, 2))
    points = np.vstack([wire, other])
    own, off_m, up_m = middle_of_points(points[:, 0], points[:, 1], 0.2)
    assert own.sum() == 40
    assert (off_m, up_m) == pytest.approx((0.08, -0.05), abs=0.01)
    assert not middle_of_points(other[:, 0], other[:, 1], 0.2)[0].any()
