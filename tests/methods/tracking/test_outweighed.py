"""Of parallel edges on one side of a carriageway, the one that ends it."""

from __future__ import annotations

import numpy as np
from tests.methods.tracking.test_lines import axis

from linework.methods.tracking.arrangement import outweighed


def refused(axes, evidence, *, shades=None, known=None, channel=(), bank=(), lanes=(), path=()):
    m = len(axes)
    shades = np.zeros(m, np.int64) if shades is None else np.array(shades)
    known = np.zeros(m, np.bool_) if known is None else np.array(known)
    channel, bank = (np.isin(np.arange(m), which) for which in (channel, bank))
    evidence = np.array(evidence, dtype=float)
    return [why != "" for why in outweighed(axes, evidence, shades, known, channel, bank, lanes, path)]


def test_what_is_known_outweighs_a_channel_but_for_the_back_of_its_footway():
    # By evidence alone the channel is the end: a kerb, a gutter, an edge, an edge at the back of a footway, a wall
    behind = ((-2.0, np.inf), (-1.4, np.inf), (-3.5, 90.0), (-1.4, 9000.0), (-3.5, 0.0))
    both = [refused([axis(0.0), axis(y)], [900.0, w], known=[False, True], channel=(0,)) for y, w in behind]
    assert both == [[True, False], [True, False], [True, False], [False, False], [False, False]]


def test_a_step_that_may_be_a_bank_yields_to_the_edge_in_front_of_it_alone():
    # The edge of a pavement, and the back of a footway
    step, front, back = axis(0.0), axis(1.5), axis(-1.5)
    assert refused([step, front], [100.0, 900.0], known=[False, True], bank=(0,)) == [True, False]
    assert refused([step, back], [100.0, 900.0], known=[False, True], bank=(0,)) == [False, False]
    assert refused([step, front], [900.0, 100.0], known=[False, True], bank=(0,)) == [False, False]
    # The kerb of a narrow median has the paint of the other carriageway close behind it
    assert refused([step], [100.0], bank=(0,), lanes=[axis(-1.0)]) == [False]


def test_of_parallel_changes_the_one_with_most_evidence_ends_the_carriageway():
    # A short patch within the carriageway, its edge, and the back of the footway
    patch, edge, back = axis(1.5, length=12.0), axis(0.0), axis(-2.0)
    assert refused([patch, edge, back], [300.0, 4000.0, 900.0]) == [True, False, True]
    # One that looks back, and one far away, are of another side or another road
    assert refused([edge, axis(7.0, turned=True), axis(-30.0)], [4000.0, 10.0, 10.0]) == [False, False, False]
    # What is known stays, and outweighs brightness alone however little it weighs itself
    assert refused([edge, back], [4000.0, 100.0], known=[False, True]) == [False, False]
    assert refused([edge, back], [4000.0, 100.0], shades=[1, 0], known=[False, True]) == [True, False]
    # A wall at the back of the footway weighs nothing
    assert refused([edge, back], [4000.0, 0.0], shades=[1, 0], known=[False, True]) == [False, False]


def test_strips_and_seams_of_the_asphalt_end_no_carriageway():
    edge = axis(0.0)
    assert refused([edge], [100.0], lanes=[axis(-1.0)]) == [True]
    # The bright stone of the edge itself is taken for paint
    assert refused([edge], [100.0], lanes=[axis(-0.2)]) == [False]
    assert refused([edge], [100.0], path=[axis(0.5)]) == [True]
    assert refused([edge], [100.0], path=[axis(2.0)]) == [False]
    # Asphalt is darker than what lies beside it, on one side only
    assert refused([edge], [100.0], shades=[-1]) == [True]
    assert refused([edge, axis(7.0, turned=True)], [100.0, 100.0], shades=[1, 1]) == [False, False]
    assert refused([edge, axis(1.0, turned=True)], [100.0, 100.0], shades=[1, 1]) == [True, True]
    assert refused([edge, axis(-1.0)], [100.0, 100.0], shades=[1, -1]) == [True, True]
