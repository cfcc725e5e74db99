"""Dashes in reports by chainage: lengths of whole ones, whatever wear and scan lines made of the others."""

import numpy as np
import pytest
from tests.scenes.chainage_scenes import ROAD, rows_of, straight

from linework.evaluation.chainage.rows import chainage_report
from linework.lines.dashes import rhythm_of_whole


def test_dashes_gaps_and_missing_dashes():
    starts = [s for s in range(0, 90, 9) if s != 36]
    dashes = [(f"dash {s}", "lane_marking_dash", 0.0, 0.0, "dashed", (s, s + 3)) for s in starts]
    lines, axis = straight([*ROAD[:4], *dashes])
    report = chainage_report(lines, [axis], every_m=90.0, standard="uk")
    (length,), (gap,) = (rows_of(report, name, from_m=0.0) for name in ("dash_length", "gap_length"))
    assert abs(length.value - 3) < 1e-6 and abs(gap.value - 6) < 1e-6 and length.n == 9 and gap.n == 7
    assert (length.limit_source, length.verdict) == ("TSM 5: 3/6", "ok")
    assert [r.value for r in rows_of(report, "missing_dashes", "sum")] == [1.0]
    # Where the marking was bridged, the missing dash may have been hidden
    s = np.linalg.norm(lines.xyz[:, :2] - [500_000, 5_400_000], axis=1)
    hidden = (lines.id[lines.line_of_vertex] == "middle") & (s > 34) & (s < 42)
    report = chainage_report(lines.with_columns(bridged=hidden), [axis], every_m=90.0)
    (row,) = rows_of(report, "missing_dashes", "sum")
    assert row.value == 0.0 and row.n == 7 and row.measured_share == 0.875


def dashed_road(dashes):
    return straight(
        [
            *ROAD[:4],
            *((f"dash {a}", "lane_marking_dash", 0.0, 0.0, "dashed", ends) for a, ends in enumerate(dashes)),
        ]
    )


def along_of(dashes):
    """Return a dashed marking as long as its dashes need, and its axis."""
    rows = [(f"dash {a}", "lane_marking_dash", 0.0, 0.0, "dashed", ends) for a, ends in enumerate(dashes)]
    length_m = dashes[-1][1] + 4.0
    marking = ("middle", "lane_marking", 0.0, 0.0, "dashed", (0.0, length_m))
    lines, axis = straight([marking, *rows], length_m=length_m)
    return lines, [axis]


def test_worn_dashes_do_not_shorten_the_rhythm():
    # A third of the dashes is worn at one end, and single ends are off by up to half the distance of scan lines
    rng = np.random.default_rng(3)
    starts = 9.0 * np.arange(11.0) + rng.uniform(-0.04, 0.04, 11)
    ends = 9.0 * np.arange(11.0) + 3.0 + rng.uniform(-0.04, 0.04, 11)
    ends[1::3] -= rng.uniform(0.5, 2.0, 4)
    lines, axis = dashed_road(zip(starts, ends, strict=True))
    report = chainage_report(lines, [axis], every_m=10.0, standard="uk")
    lengths, gaps = rows_of(report, "dash_length"), rows_of(report, "gap_length")
    assert len(lengths) >= 9 and len(gaps) >= 9
    for rows, true in ((lengths, 3.0), (gaps, 6.0)):
        assert all(abs(r.value - true) < 0.04 and 0.01 <= r.sigma < 0.05 for r in rows)
    assert {r.verdict for r in lengths[:-1]} == {"ok"}
    # What two dashes of nine left says nothing of their length
    few = [
        (9.0 * k, 9.0 * k + length) for k, length in enumerate((0.6, 1.4, 2.9, 2.2, 1.0, 1.8, 3.0, 0.9, 2.5))
    ]
    lines, axis = dashed_road(few)
    report = chainage_report(lines, [axis], every_m=10.0)
    assert {r.value for r in rows_of(report, "dash_length")} == {None}
    # A dash that was drawn through a gap is none of the rhythm
    long = [(9.0 * k, 9.0 * k + (6.5 if k == 4 else 3.0)) for k in range(10)]
    lines, axis = dashed_road(long)
    report = chainage_report(lines, [axis], every_m=9.0)
    assert [r.value for r in rows_of(report, "dash_length", from_m=36.0)] == [None]
    assert len([r for r in rows_of(report, "dash_length") if r.value is not None]) == 9


def test_neighbouring_dashes_that_were_cut_alike_have_the_length_of_their_marking():
    """The first half is cut to 3.12 m by scan lines that pass over each dash alike, the other half to 2.88 m."""
    cut = np.repeat([3.12, 2.88], 12) + 0.05 * np.tile([1.0, -1.0, 0.0, 0.0], 6)
    dashes = [(9.0 * k, 9.0 * k + length) for k, length in enumerate(cut.tolist())]
    lengths = rows_of(chainage_report(*along_of(dashes), every_m=10.0), "dash_length")
    assert [row.value for row in lengths] == pytest.approx([3.0] * len(lengths), abs=0.04)
    # A marking may have two rhythms, too: that is no chance
    one, other = (
        [(9.0 * k, 9.0 * k + 3.0) for k in range(12)],
        [(6.0 * k, 6.0 * k + 4.0) for k in range(18, 36)],
    )
    values = [r.value for r in rows_of(chainage_report(*along_of(one + other), every_m=10.0), "dash_length")]
    assert values[:6] == pytest.approx([3.0] * 6) and values[-6:] == pytest.approx([4.0] * 6)


def test_dashes_that_scan_lines_cut_alike_are_known_no_better_than_one():
    # Scan lines 0.3 m apart and a period of nearly 30 of them: all dashes of 3.0 m become 3.12 m, some earlier than others
    shift = 0.08 * np.array([1, -1, 1, 1, -1, 1, -1, -1, 1, -1])
    lines, axis = dashed_road([(9.0 * k + a, 9.0 * k + a + 3.12) for k, a in enumerate(shift.tolist())])
    lengths = rows_of(chainage_report(lines, [axis], every_m=10.0), "dash_length")
    assert len(lengths) == 9
    assert all(0.12 < r.sigma < 0.25 for r in lengths), [r.sigma for r in lengths]


RHYTHM = [(9.0 * k, 9.0 * k + 3.0) for k in range(10)]


@pytest.mark.parametrize(
    "stray",
    [
        (27.0, 30.0),  # one dash twice
        (27.03, 30.03),  # the same, 3 cm apart
        (31.5, 34.5),  # one in a space
    ],
)
def test_a_stray_dash_makes_no_shorter_rhythm(stray):
    lines, axis = dashed_road(sorted([*RHYTHM, stray]))
    report = chainage_report(lines, [axis], every_m=100.0)
    for row in rows_of(report, "gap_length"):
        assert row.value is None or row.value > 4.0
    # Before, thousands were missing in a space of -3 m
    assert all(
        row.value is None or row.value <= len(RHYTHM) for row in rows_of(report, "missing_dashes", "sum")
    )


def test_the_period_is_not_twice_as_long_where_every_second_dash_was_cut_longer():
    """To 6.2 m, and those between to 5.92 m and less: the gap of a motorway was 30 m long instead of 12."""
    half = [3.1, 2.96, 3.1, 2.9, 3.1, 2.84, 3.1]
    dashes = [(18.0 * k + 3.0 - h, 18.0 * k + 3.0 + h) for k, h in enumerate(half)]
    rhythm = rhythm_of_whole(np.array(dashes))
    assert (rhythm.dash_m, rhythm.gap_m) == pytest.approx((6.2, 11.8))
    # What is less than half as long may be anything: patches, or an older marking
    patches = [(18.0 * k + 2.0, 18.0 * k + 4.0) for k in (1, 3)]
    rhythm = rhythm_of_whole(np.array(sorted([*dashes[::2], *patches])))
    assert (rhythm.dash_m, rhythm.gap_m) == pytest.approx((6.2, 29.8))
    # A single dash is a stray
    rhythm = rhythm_of_whole(np.array(sorted([*dashes[::2], dashes[1]])))
    assert (rhythm.dash_m, rhythm.gap_m) == pytest.approx((6.2, 29.8))


def test_three_whole_dashes_with_worn_ones_between_are_no_rhythm_of_their_own():
    """The first 80 m have whole dashes every 27 m, and two worn ones between; the marking has one every 9 m."""
    length = {1: 3.0, 2: 1.0, 4: 3.0, 5: 1.3, 7: 3.0} | dict.fromkeys(range(12, 40), 3.0)
    dashes = [(9.0 * k, 9.0 * k + length_m) for k, length_m in length.items()]
    report = chainage_report(*along_of(dashes), every_m=10.0)
    gaps = [row.value for row in rows_of(report, "gap_length") if row.value is not None]
    assert len(gaps) > 10 and gaps == pytest.approx([6.0] * len(gaps), abs=0.1)
