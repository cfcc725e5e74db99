"""Lines of rails that have a form: each once, in an order of their own, with what is known of their pair."""

from __future__ import annotations

import itertools
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from linework.methods.rails import formed
from linework.methods.rails.forms import FormedStretch
from linework.methods.rails.placed import PlacedRail, Stretch
from linework.methods.rails.sections import Band, SectionForm
from linework.methods.rails.verdict import NodeScores

#: Fewest nodes of a line.
LEAST = 9
#: What rails were fitted to is not looked at here.
NOWHERE: Any = None


def placed(start_m, n, north_m=0.0):
    """Return a rail of nodes half a metre apart towards the east."""
    along = 0.5 * np.arange(n)
    xyz = np.column_stack([start_m + along, np.full(n, north_m), np.full(n, 0.8)])
    return PlacedRail(NOWHERE, xyz, xyz, xyz[:, 2], xyz[:, 2], along)


def scores(n):
    return NodeScores(*np.ones((3, n)), steady=np.ones(n), open_=np.ones(n))


def barrier(start_m, n, north_m=0.0):
    return Stretch(
        "barrier", placed(start_m, n, north_m), slice(0, n), np.ones(n), scores(n), np.zeros(n, bool)
    )


def shown(start_m, n, run, paired=None):
    section = SectionForm("guardrail", "thrie_beam", (Band(-0.5, 0.0, "flat", 0.0, 1.0, 0.0),), hangs=True)
    stretch = FormedStretch(run, section, 1.0, *np.zeros((2, run.stop - run.start)))
    return formed._Shown(
        placed(start_m, n), scores(n), stretch, np.zeros(n, bool) if paired is None else paired
    )


def spans(found):
    return [(float(s.xyz[0, 0]), float(s.xyz[-1, 0])) for s in found]


def test_a_long_barrier_that_meets_a_piece_found_before_keeps_the_rest_of_its_length():
    # 12 m by form, of which 5 m are on a barrier of 150 m by profile
    by_profile, by_form = barrier(0.0, 301), barrier(145.0, 25)
    found = formed._barriers_once([by_form], [by_profile], LEAST)
    assert spans(found) == [(145.0, 157.0), (0.0, 144.5)]
    assert [len(s.score) for s in found] == [len(s.xyz) for s in found]


def test_barriers_found_by_form_keep_their_line():
    """They go on to the ends, which by profile are too short."""
    long, short, apart = barrier(0.0, 101), barrier(5.0, 41), barrier(0.0, 41, north_m=2.0)
    assert spans(formed._barriers_once([short], [long], LEAST)) == [(5.0, 25.0), (0.0, 4.5), (25.5, 50.0)]
    assert spans(formed._barriers_once([long], [short], LEAST)) == spans([long])
    assert spans(formed._barriers_once([apart], [long], LEAST)) == spans([apart, long])


def test_a_wall_whose_foot_is_hidden_is_no_deep_beam():
    def seen(top_share):
        one = shown(0.0, 20, slice(0, 20))
        band = replace(one.stretch.section.bands[0], top_share=top_share)
        section = replace(one.stretch.section, bands=(band,))
        return one._replace(stretch=replace(one.stretch, section=section))

    assert np.mean(seen(0.25).score) == 1.0
    assert np.mean(seen(0.64).score) < 0.5


def test_stretches_of_equal_length_have_an_order_of_their_own():
    some = [shown(start, 20, slice(0, 20)) for start in (40.0, 0.0, 20.0)] + [shown(60.0, 30, slice(0, 30))]
    for order in itertools.permutations(some):
        inside = sorted(order, key=formed._longest_first)
        assert [float(s.xyz[0, 0]) for s in inside] == [60.0, 0.0, 20.0, 40.0]


def test_a_formed_line_keeps_what_is_known_of_its_pair(monkeypatch: pytest.MonkeyPatch):
    run = slice(5, 25)
    own = shown(0.0, 30, run, paired=np.arange(30) >= 15)
    monkeypatch.setattr(formed, "fitted_again", lambda *_: [NOWHERE])
    monkeypatch.setattr(formed, "place_rails", lambda *_: [placed(2.5, 20)])
    (line,) = formed._lines_of(own, formed.Surroundings(*[NOWHERE] * 4))
    assert line.paired.tolist() == [False] * 10 + [True] * 10
