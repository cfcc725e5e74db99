"""What no measure may depend on."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.scenes.effort import examples

from linework.evaluation.measures import evaluate
from linework.model.lines import LineSet

KINDS = ("lane_marking", "guardrail", "cable")


@st.composite
def line_sets(draw):
    """A truth of gently bending lines, and lines extracted from it: offset, cut short, broken, doubled."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    kind = draw(st.sampled_from(KINDS))
    truth, found = [], []
    for i in range(draw(st.integers(1, 3))):
        curvature = rng.uniform(-0.02, 0.02)
        length = rng.uniform(5, 60)
        s = np.linspace(0, length, rng.integers(2, 40))
        heading = rng.uniform(0, 2 * math.pi) + curvature * s
        step = np.diff(s, prepend=0.0)
        x, y = np.cumsum(step * np.cos(heading)), np.cumsum(step * np.sin(heading)) + 100 * i
        line = np.stack([x, y, 5 + 0.03 * s], axis=1)
        truth.append(line)
        for _ in range(rng.integers(0, 3)):
            first = rng.integers(0, max(len(line) // 2, 1))
            part = line[first:]
            if len(part) > 1:
                found.append(part + rng.normal(0, 0.06, 3))
    found = found or [truth[0] + [0.0, 0.03, 0.0]]
    confidence = rng.uniform(0, 1, len(found))
    return (
        LineSet.from_lines(found, kind=[kind] * len(found), confidence=confidence),
        LineSet.from_lines(truth, kind=[kind] * len(truth)),
    )


def figures(scores):
    """Every figure that must stay, by name; None becomes -1."""
    s = scores.overall
    values = {}
    for at in (s.at, *s.curve):
        b = at.tolerance_m
        for name in (
            "completeness", "completeness_all", "correctness", "quality", "redundancy", "gaps_per_km",
            "pieces_per_line", "n_missed",
        ):  # fmt: skip
            values[f"{name} {b}"] = getattr(at, name)
        for name in ("lateral", "height", "space"):
            for figure in ("n", "rmse_m", "median_m", "p95_m"):
                values[f"{name} {figure} {b}"] = getattr(getattr(at, name), figure)
        values[f"height bias {b}"] = at.height.bias_m
    values |= {"far": s.hausdorff_m, "far95": s.hausdorff_p95_m, "auc": s.confidence.auc}
    values |= {f"AP {limit}": ap for limit, ap in s.chamfer_ap.items()}
    return {name: -1.0 if v is None else float(v) for name, v in values.items()}


def reversed_lines(lines):
    flipped = [lines[i].xyz[::-1] for i in range(len(lines))]
    return LineSet.from_lines(flipped, kind=lines.kind, confidence=lines.confidence)


def resampled(lines, rng):
    """The same lines with more vertices on their segments."""
    more = []
    for i in range(len(lines)):
        line = lines[i].xyz
        place = np.arange(len(line), dtype=float)
        extra = np.sort(np.concatenate([place, rng.uniform(0, len(line) - 1, 17)]))
        more.append(np.stack([np.interp(extra, place, line[:, k]) for k in range(3)], axis=1))
    return LineSet.from_lines(more, kind=lines.kind, confidence=lines.confidence)


@given(line_sets())
@settings(max_examples=examples(25), deadline=None)
def test_truth_scores_perfectly_against_itself(sets):
    _, truth = sets
    at = evaluate(truth, truth).overall.at
    assert (at.completeness, at.correctness, at.quality, at.redundancy) == (1, 1, 1, 0)
    assert at.lateral.rmse_m == pytest.approx(0, abs=1e-9)
    assert at.n_missed == 0


@given(line_sets())
@settings(max_examples=examples(25), deadline=None)
def test_drawing_direction_does_not_matter(sets):
    found, truth = sets
    before = evaluate(found, truth)
    assert figures(evaluate(reversed_lines(found), truth)) == pytest.approx(figures(before), abs=1e-6)
    back = evaluate(found, reversed_lines(truth))
    assert figures(back) == pytest.approx(figures(before), abs=1e-6)
    # But for the sign of the lateral bias, which follows the reference
    old, new = before.overall.at.lateral.bias_m, back.overall.at.lateral.bias_m
    assert (old is None and new is None) or new == pytest.approx(-old, abs=1e-6)


@given(line_sets(), st.integers(0, 2**32 - 1))
@settings(max_examples=examples(25), deadline=None)
def test_more_vertices_on_the_same_line_change_nothing(sets, seed):
    found, truth = sets
    rng = np.random.default_rng(seed)
    before = figures(evaluate(found, truth))
    assert figures(evaluate(resampled(found, rng), truth)) == pytest.approx(before, abs=1e-6)
    assert figures(evaluate(found, resampled(truth, rng))) == pytest.approx(before, abs=1e-6)


@given(line_sets())
@settings(max_examples=examples(25), deadline=None)
def test_swapping_the_sides_swaps_completeness_and_correctness(sets):
    found, truth = sets
    there, back = evaluate(found, truth).overall, evaluate(truth, found).overall
    for a, b in zip((there.at, *there.curve), (back.at, *back.curve), strict=True):
        assert a.completeness == b.correctness
        assert a.correctness == b.completeness
    assert there.hausdorff_m == back.hausdorff_m


@given(line_sets(), st.integers(100_000, 900_000), st.integers(0, 9_000_000), st.integers(0, 999_999))
@settings(max_examples=examples(25), deadline=None)
def test_a_shift_of_both_changes_nothing(sets, east, north, micrometres):
    shift = np.array([east, north, 100.0]) + micrometres * 1e-6
    found, truth = sets
    moved = [
        LineSet(xyz=s.xyz + shift, offsets=s.offsets, kind=s.kind, confidence=s.confidence) for s in sets
    ]
    before, after = figures(evaluate(found, truth)), figures(evaluate(*moved))
    assert after == pytest.approx(before, abs=1e-6)


@given(line_sets())
@settings(max_examples=examples(25), deadline=None)
def test_a_wider_tolerance_never_finds_less(sets):
    at = evaluate(*sets).overall.curve
    for name in ("completeness", "correctness"):
        values = [getattr(a, name) for a in at]
        assert values == sorted(values)
    assert [a.n_missed for a in at] == sorted((a.n_missed for a in at), reverse=True)
    for a in at:
        limit = a.lateral.rmse_m if a.lateral.rmse_m is not None else 0
        assert limit <= a.tolerance_m + 1e-6


@given(line_sets(), st.integers(0, 2**32 - 1))
@settings(max_examples=examples(25), deadline=None)
def test_the_order_of_lines_does_not_matter(sets, seed):
    found, truth = sets
    rng = np.random.default_rng(seed)
    mixed = evaluate(found.take(rng.permutation(len(found))), truth.take(rng.permutation(len(truth))))
    assert figures(mixed) == pytest.approx(figures(evaluate(found, truth)), abs=1e-6)
