"""From one rail of a median to the other: which one it is, and how it is saved."""

from __future__ import annotations

import numpy as np
import pytest

from linework.editing.edits.continued import SAME_LINE_M
from linework.errors import UsageError
from linework.model.lines import LineSet
from linework.tracing.medians import MOST_APART_M, partners_among
from linework.workbench.edits.median_rails import partner_change

ORIGIN = np.array([500_000.0, 5_800_000.0, 100.0])


def bend(start, end, off_m, *, radius=300.0, drift=0.0):
    """A line along a bend, to the left of its axis, drawing away by a share of its length."""
    s = np.arange(start, end + 0.5)
    turn, left = s / radius, off_m + drift * (s - start)
    xy = np.stack([(radius - left) * np.sin(turn), radius - (radius - left) * np.cos(turn)], axis=1)
    return np.column_stack([xy, np.full(len(s), 0.7)]) + ORIGIN


def rails(*lines, kind="guardrail"):
    n = len(lines)
    return LineSet.from_lines(list(lines), kind=[kind] * n, id=[f"r{k}" for k in range(n)])


OWN = bend(0, 120, 0.0)


def names(found):
    return found.id.tolist()


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("apart_m", [0.3, -0.3, 2.8, -2.8])
def test_the_nearest_rail_that_runs_along_is_the_partner(turned, apart_m):
    other, far = bend(-10, 130, apart_m), bend(0, 120, 1.15 * apart_m + 0.6 * np.sign(apart_m))
    lines = rails(OWN, other[::-1] if turned else other, far)
    assert names(partners_among(lines, OWN, None)) == ["r1"]


def test_pieces_of_one_rail_are_found_together_whatever_stands_on_the_other_side():
    lines = rails(OWN, bend(0, 40, 1.0), bend(50, 120, 1.2), bend(0, 120, -2.0))
    assert names(partners_among(lines, OWN, None)) == ["r1", "r2"]


@pytest.mark.parametrize("order", [[0, 1, 2], [2, 1, 0]])
def test_a_second_beam_beside_the_nearest_is_no_piece_of_it(order):
    beams = rails(OWN, bend(0, 120, 0.4), bend(0, 120, 0.85)).take(order)
    assert names(partners_among(beams, OWN, None)) == ["r1"]
    # Nor where it is beside another piece of the nearest; ends that were measured twice are of one rail
    pieces = rails(bend(0, 50, 0.4), bend(48, 120, 0.5), bend(60, 120, 0.85)).take(order)
    assert sorted(names(partners_among(pieces, OWN, None))) == ["r0", "r1"]


@pytest.mark.parametrize(
    "other",
    [
        bend(0, 120, 0.1),  # the rail itself, measured again
        bend(0, 120, MOST_APART_M + 0.3),
        bend(30, 60, 0.5, drift=0.09),  # leads away
        bend(121, 160, 0.5),  # beyond its end
        bend(0, 2, 1.0),
    ],
)
def test_what_is_no_partner(other):
    assert names(partners_among(rails(OWN, other), OWN, None)) == []


def test_a_fence_is_no_partner_and_a_barrier_is():
    assert names(partners_among(rails(bend(0, 120, 1.0), kind="fence"), OWN, None)) == []
    assert names(partners_among(rails(bend(0, 120, 1.0), kind="barrier"), OWN, None)) == ["r0"]


def test_what_the_van_drove_between_is_no_median():
    lines = rails(OWN, bend(0, 120, 3.2))
    assert names(partners_among(lines, OWN, bend(-50, 200, 1.6))) == []
    assert names(partners_among(lines, OWN, bend(-50, 200, -2.0))) == ["r1"]
    assert names(partners_among(lines, OWN, bend(130, 200, 1.6))) == ["r1"]


def test_the_van_drove_between_the_positions_of_its_path():
    """Once a second at 100 km/h positions are 28 m apart, more than this rail is long; a jump is no drive."""
    own, lane = bend(0, 25, 0.0), bend(-50, 200, 1.6)
    lines = rails(own, bend(0, 25, 3.2))
    for first in range(28):
        assert names(partners_among(lines, own, lane[first::28])) == []
    assert names(partners_among(lines, own, lane[[5, 15, 85, 95]])) == ["r1"]
    assert names(partners_among(lines, own, bend(-50, 200, -2.0)[22::28])) == ["r1"]
    assert names(partners_among(lines, own, lane[:0])) == ["r1"]


def test_the_partner_is_added_joined_with_what_is_there_or_refused():
    own, found = rails(OWN), rails(bend(0, 120, 0.5))
    new = partner_change("partner", own, own, found)
    assert (new.before.id.tolist(), new.after.review.tolist()) == ([], ["drawn"])
    part = rails(bend(0, 60, 0.5)).with_columns(id=np.array(["part"]))
    joined = partner_change("partner", LineSet.concatenate([own, part]), own, found)
    assert joined.before.id.tolist() == ["part"] and joined.after.id.tolist() == ["part"]
    assert joined.after.length_m[0] == pytest.approx(found.length_m[0], rel=0.01)
    for review in ("accepted", "rejected"):
        there = found.with_columns(id=np.array(["there"]), review=np.array([review]))
        with pytest.raises(UsageError, match="there already"):
            partner_change("partner", LineSet.concatenate([own, there]), own, found)
    with pytest.raises(UsageError, match="no other rail"):
        partner_change("partner", own, own, found.take([]))


def test_beams_back_to_back_stay_two_lines():
    near = rails(bend(0, 120, SAME_LINE_M))
    own = rails(OWN)
    change = partner_change("partner", own, own, near)
    assert change.before.id.tolist() == [] and len(change.after) == 1
