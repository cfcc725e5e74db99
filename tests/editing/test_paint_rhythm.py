"""Dashes from worn paint: made-up brightness along a line, where it is known which dashes were painted."""

import numpy as np
import pytest

from linework.editing.edits.dashes import dashes_by_paint, dashes_in_paint
from linework.errors import UsageError
from linework.model.lines import LineSet

STEP = 0.1


def paint(starts, dash, *, length=300.0, wear=0.5, contrast=1.0, seed=0, seen=lambda s: s >= 0.0):
    """Brightness and points at stations, half of the paint gone in patches, and noise."""
    rng = np.random.default_rng(seed)
    s = (np.arange(round(length / STEP)) + 0.5) * STEP
    painted = np.any((s[:, None] >= starts) & (s[:, None] < starts + dash), axis=1)
    left = np.repeat(rng.random(len(s) // 5 + 1) >= wear, 5)[: len(s)]
    weight = np.where(seen(s), rng.poisson(1.0, len(s)), 0).astype(float)
    noise = rng.normal(0.0, 0.3, len(s)) / np.sqrt(np.maximum(weight, 1.0))
    return STEP, np.where(weight > 0, 1.0 + contrast * (painted & left) + noise, 0.0), weight


def missed(spans, starts):
    """How far the nearest dash found begins from each painted one."""
    return np.abs(spans[None, :, 0] - starts[:, None]).min(axis=1)


@pytest.mark.parametrize(("period", "dash"), [(3.0, 1.5), (6.0, 3.0), (9.0, 3.0), (12.0, 4.0)])
def test_dashes_of_which_half_is_gone_are_seen_together(period, dash):
    starts = np.arange(1.7, 296.0, period)
    spans = dashes_in_paint(*paint(starts, dash))
    off = missed(spans, starts[1:-1])
    assert np.median(off) < 0.4
    assert off.max() < 0.8
    assert np.median(np.diff(spans, axis=1)) == pytest.approx(dash, abs=0.45)
    assert abs(len(spans) - len(starts)) <= 2


@pytest.mark.parametrize(("period", "dash"), [(18.0, 6.0), (16.0, 4.0)])
@pytest.mark.parametrize("length", [60.0, 90.0, 120.0])
def test_long_dashes_far_apart_are_a_rhythm_on_short_lines(period, dash, length):
    starts = np.arange(1.7, length - dash, period)
    right = 0
    for seed in range(10):
        spans = dashes_in_paint(*paint(starts, dash, length=length, wear=0.0, seed=seed))
        right += len(spans) > 1 and abs(np.median(np.diff(spans.mean(axis=1))) - period) < 0.05 * period
    assert right >= 7


def test_a_rhythm_that_stretches_is_followed():
    # A bend of 50 m radius, 4 m outside the axis that was measured along
    s = np.arange(0.0, 320.0, 6.0)
    starts = np.interp(s, [0.0, 100.0, 200.0, 320.0], [0.0, 100.0, 208.0, 328.0])
    starts = starts[starts < 294.0]
    spans = dashes_in_paint(*paint(starts, 3.0, wear=0.4))
    assert np.quantile(missed(spans, starts[1:-1]), 0.9) < 0.5


def test_nothing_is_seen_in_solid_paint_and_in_none():
    for starts, dash in ((np.array([0.0]), 300.0), (np.array([400.0]), 1.0)):
        for seed in range(5):
            assert len(dashes_in_paint(*paint(starts, dash, seed=seed))) == 0
    assert len(dashes_in_paint(STEP, np.zeros(30), np.zeros(30))) == 0
    assert len(dashes_in_paint(STEP, np.zeros(3000), np.zeros(3000))) == 0


@pytest.mark.parametrize("patch_m", [0.5, 1.0, 2.0])
def test_solid_paint_that_is_worn_in_patches_has_no_rhythm(patch_m):
    n = 3000
    for seed in range(20):
        rng = np.random.default_rng(seed)
        sizes = rng.geometric(STEP / patch_m, n)
        left = np.repeat(rng.random(n) >= 0.5, sizes)[:n]
        weight = rng.poisson(1.0, n).astype(float)
        noise = rng.normal(0.0, 0.3, n) / np.sqrt(np.maximum(weight, 1.0))
        assert len(dashes_in_paint(STEP, np.where(weight > 0, 1.0 + left + noise, 0.0), weight)) == 0


def test_dashes_go_on_over_a_short_gap_and_not_over_a_long_one():
    starts = np.arange(1.7, 396.0, 6.0)
    short = dashes_in_paint(*paint(starts, 3.0, length=400.0, seen=lambda s: (s < 150) | (s > 180)))
    assert missed(short, starts[1:-1]).max() < 0.5
    long = dashes_in_paint(*paint(starts, 3.0, length=400.0, seen=lambda s: (s < 110) | (s > 290)))
    middle = long.mean(axis=1)
    assert not np.any((middle > 160) & (middle < 240))


def line_with(dashes, **columns):
    line = LineSet.from_lines(
        [np.array([[0.0, 0.0, 0.0], [60.0, 0.0, 0.6]])], kind=["lane_marking"], role=["lane"]
    )
    pieces = [np.array([[a, 0.0, 0.0], [b, 0.0, 0.0]]) for a, b in dashes]
    n = len(pieces)
    return line, LineSet.from_lines(
        pieces, kind=["lane_marking_dash"] * n, id=[f"d{a}" for a, _ in dashes], **columns
    )


def test_whole_dashes_stay_and_pieces_give_way():
    spans = np.array([[0.0, 3.0], [9.0, 12.0], [18.0, 21.0]])
    line, there = line_with([(0.1, 3.0), (9.0, 10.2)])
    gone, new = dashes_by_paint(line, there, spans)
    assert gone.id.tolist() == ["d9.0"]
    assert new.xyz[::2, 0].tolist() == pytest.approx([9.0, 18.0])
    assert new.bridged.all()
    assert new.role.tolist() == ["lane", "lane"]


def test_a_dash_that_is_longer_than_worn_paint_shows_stays_and_one_over_two_does_not():
    spans = np.array([[0.5, 3.5], [9.0, 12.0], [18.0, 21.0], [27.0, 30.0], [36.0, 39.0]])
    line, there = line_with([(0.0, 6.0), (8.0, 13.5), (18.0, 30.0)])
    gone, new = dashes_by_paint(line, there, spans)
    assert gone.id.tolist() == ["d18.0"]
    assert new.xyz[::2, 0].tolist() == pytest.approx([18.0, 27.0, 36.0])


def test_what_somebody_judged_stays():
    line, there = line_with([(9.0, 10.2)], review=["accepted"])
    gone, new = dashes_by_paint(line, there, np.array([[9.0, 12.0], [18.0, 21.0]]))
    assert len(gone) == 0
    assert new.xyz[::2, 0].tolist() == pytest.approx([18.0])
    with pytest.raises(UsageError, match="no dash is missing"):
        dashes_by_paint(line, there, np.array([[9.0, 12.0]]))
