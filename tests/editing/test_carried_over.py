"""What people said of lines stays when lines are found anew, and is not asked again."""

import numpy as np
import pytest

from linework.editing.queue.carried_over import carry_over_reviews, extraction_change, with_reviews
from linework.model.lines import LineSet


def line(kind: str, y: float, start: float = 0.0, end: float = 50.0, z: float = 0.0, **columns) -> LineSet:
    x = np.arange(start, end + 0.5, 1.0)
    xyz = np.stack([x, np.full_like(x, y), np.full_like(x, z)], axis=1)
    columns = {"review": "", "id": f"{kind}-{y:g}-{start:g}", "sigma_m": 0.02} | columns
    sigma = np.full(len(x), columns.pop("sigma_m"))
    texts = {name: [value] for name, value in columns.items()}
    return LineSet.from_lines([xyz], kind=[kind], sigma_xy_m=sigma, **texts)


def lines(*sets: LineSet) -> LineSet:
    return LineSet.concatenate([LineSet.empty(), *sets])


def spans(found: LineSet) -> list[tuple[str, float, float, float, str]]:
    """Return kind, y, start, end and review of each line."""
    return sorted(
        (str(found.kind[i]), *np.round([found[i].xyz[0, 1], found[i].xyz[0, 0], found[i].xyz[-1, 0]], 2), str(found.review[i]))
        for i in range(len(found))
    )  # fmt: skip


@pytest.mark.parametrize("review", ["accepted", "edited", "drawn", "rejected"])
def test_what_is_found_again_is_left_out_and_what_goes_beyond_stays(review):
    there = line("guardrail", 0.0, 10, 30, review=review, id="mine", note="seen")
    again = carry_over_reviews(line("guardrail", 0.1, 11, 30), there)
    assert (again.stays.tolist(), len(again.new), again.n_again) == ([True], 0, 1)
    longer = with_reviews(line("guardrail", 0.1, 0, 60), there)
    kept = longer.take(longer.review == review)
    assert np.array_equal(kept.xyz, there.xyz)
    assert (kept.id[0], kept.note[0]) == ("mine", "seen")
    beyond = longer.take(longer.review == "")
    assert [round(v) for v in beyond.length_m] == [10, 30]
    assert "" not in beyond.id and len(set(longer.id.tolist())) == 3
    assert np.allclose(beyond.sigma_xy_m, 0.02)


def test_of_a_line_mostly_rejected_nothing_comes_back():
    there = line("guardrail", 0.0, 0, 30, review="rejected")
    assert spans(with_reviews(line("guardrail", 0.1, 0, 45), there)) == [("guardrail", 0, 0, 30, "rejected")]
    # but a piece of it that nobody judged does
    free = line("guardrail", 0.0, 31, 45, id="free")
    both = spans(with_reviews(line("guardrail", 0.0, 0, 45), lines(there, free)))
    assert len(both) == 2
    assert both[1][2:4] == pytest.approx((31, 45), abs=1.0)


def test_lines_that_nobody_judged_are_replaced():
    there = lines(line("cable", 0.0), line("cable", 5.0, review="accepted"))
    found = lines(line("cable", 0.05, 3, 47), line("cable", 5.05), line("cable", 9.0))
    assert spans(with_reviews(found, there)) == [
        ("cable", 0.05, 3, 47, ""), ("cable", 5, 0, 50, "accepted"), ("cable", 9, 0, 50, ""),
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("distance_m", "sigma_m", "width_m", "is_same"),
    [
        (0.14, 0.01, np.nan, True),
        (0.20, 0.01, np.nan, False),
        (0.20, 0.01, 0.15, True),
        (0.30, 0.01, 0.15, False),
        (0.40, 0.10, np.nan, True),
        (0.60, 0.50, np.nan, False),
        (0.28, np.nan, np.nan, True),
    ],
)
def test_how_near_follows_from_sigmas_and_width(distance_m, sigma_m, width_m, is_same):
    there = line("lane_marking", 0.0, review="accepted", sigma_m=sigma_m, width_m=width_m)
    found = line("lane_marking", distance_m, sigma_m=sigma_m, width_m=width_m)
    assert len(carry_over_reviews(found, there).new) == (not is_same)


def test_other_kinds_ways_and_heights_are_other_things():
    there = lines(line("cable", 0.0, z=8.0, review="accepted"), line("fence", 20.0, review="rejected"))
    crossing = line("cable", 0.0, z=8.0)
    crossing = crossing.with_columns(xyz=crossing.xyz[:, [1, 0, 2]] + [25.0, -25.0, 0.0], id=["across"])
    found = lines(line("cable", 0.0, z=7.0, id="below"), crossing, line("guardrail", 20.0))
    assert len(carry_over_reviews(found, there).new) == 3


def test_what_was_moved_trimmed_or_made_another_kind_is_not_found_again_where_it_was():
    before = line("road_boundary", 0.0, 0, 50)
    moved = line("road_boundary", 0.45, 0, 30, review="edited")
    found = line("road_boundary", 0.02, 0, 50)
    assert len(carry_over_reviews(found, moved).new) == 1
    assert len(carry_over_reviews(found, moved, before).new) == 0
    other = before.with_columns(kind=["guardrail"], review=["edited"])
    assert len(carry_over_reviews(found, other).new) == 1
    assert len(carry_over_reviews(found, other, before).new) == 0


def test_what_was_judged_and_set_free_again_is_found_again():
    before = line("road_boundary", 0.0)
    accepted = before.with_columns(review=["accepted"])
    kept = carry_over_reviews(line("road_boundary", 0.01), before, lines(before, accepted))
    assert (kept.stays.tolist(), len(kept.new)) == ([False], 1)


def test_dashes_are_left_out_or_whole_and_go_with_their_line():
    dashes = lines(*(line("lane_marking_dash", 0.0, x, x + 4) for x in (0, 12, 24, 36)))
    marking = line("lane_marking", 0.0)
    gone = with_reviews(lines(dashes, marking), marking.with_columns(review=["rejected"]))
    assert [kind for kind, *_ in spans(gone)] == ["lane_marking"]
    stays = with_reviews(lines(dashes, marking), marking.with_columns(review=["accepted"]), marking)
    assert [kind for kind, *_ in spans(stays)] == ["lane_marking"] + ["lane_marking_dash"] * 4
    # A line that is not found any more keeps the dashes it has
    old = with_reviews(LineSet.empty(), lines(dashes, marking.with_columns(review=["accepted"])))
    assert len(old) == 5
    one = line("lane_marking_dash", 0.0, 12.3, 16.3, review="edited", id="one")
    assert len(with_reviews(lines(dashes, marking), one)["lane_marking_dash"]) == 4


def test_kerb_tops_go_with_their_kerb():
    kerb, top = line("road_boundary", 0.0), line("kerb_top", 0.15, z=0.12)
    other, other_top = line("road_boundary", 8.0), line("kerb_top", 8.15, z=0.12)
    found = lines(top, other_top, kerb, other)
    kept = spans(with_reviews(found, kerb.with_columns(review=["rejected"], id=["k"])))
    assert kept == [("kerb_top", 8.15, 0, 50, ""), ("road_boundary", 0, 0, 50, "rejected"),
                    ("road_boundary", 8, 0, 50, "")]  # fmt: skip


def test_neither_the_order_of_lines_nor_their_way_matters():
    rng = np.random.default_rng(4)
    there = lines(
        *(line("fence", 3.0 * k, 5, 30, review=r) for k, r in enumerate(["accepted", "rejected", ""]))
    )
    found = lines(*(line("fence", 3.0 * k + 0.05, 0, 40, id=f"f{k}") for k in range(4)))
    want = spans(with_reviews(found, there))
    assert len(want) == 6
    for _ in range(4):
        shuffled = with_reviews(found.take(rng.permutation(4)), there.take(rng.permutation(3)))
        assert spans(shuffled) == want
    turned = found.with_columns(xyz=found.xyz[::-1], id=found.id[::-1])
    assert [sorted(s[2:4]) for s in spans(with_reviews(turned, there))] == [sorted(s[2:4]) for s in want]


def test_a_note_is_kept_with_its_line():
    there = line("fence", 0.0, note="gap at 12 m")
    assert spans(with_reviews(line("fence", 0.02), there)) == [("fence", 0, 0, 50, "")]


def test_nothing_found_and_nothing_there():
    none = LineSet.empty()
    assert len(with_reviews(none, none)) == 0
    some = line("fence", 0.0, review="drawn")
    assert len(with_reviews(none, some)) == len(with_reviews(some, none)) == 1


def test_an_extraction_is_one_change_of_the_kinds_that_were_looked_for():
    there = lines(
        line("fence", 0.0, review="accepted", id="a"), line("fence", 5.0, id="b"), line("fence", 9.0, id="c"),
        line("cable", 0.0, id="d"),
    )  # fmt: skip
    found = lines(line("fence", 0.0, id="a"), line("fence", 5.01, id="b"), line("fence", 9.0, id="c"),
                  line("fence", 12.0, id="d"))  # fmt: skip
    change = extraction_change(there, found, ["fence"])
    assert change.action == "extract"
    assert change.before.id.tolist() == ["b"]
    assert change.after.id[0] == "b"
    assert change.after.id[1] not in ("a", "b", "c", "d", "")
    assert spans(change.after) == [("fence", 5.01, 0, 50, ""), ("fence", 12, 0, 50, "")]
