"""Strands, chains and stretches: what holds at a place is known from what is about it."""

import numpy as np
import pytest
from tests.scenes import rail_scenes as made
from tests.scenes.rail_scenes import RADON, extract, prepare, rail_scene, scene, straight

from linework.methods.radon.seeds import find_seed_lines, split_into_segments
from linework.methods.rails.chains import chains_from_starts
from linework.methods.rails.circles import find_starts
from linework.methods.rails.rail_lines import close_beside
from linework.methods.rails.rails import fit_rail
from linework.methods.rails.stretches import barrier_stretches, guardrail_stretches
from linework.methods.rails.verdict import NodeScores

SEEDS, CIRCLES, PROFILE = RADON.seeds, RADON.circles, RADON.profile
LONG = (2.0, 118.0)


def chains_in(p):
    """Chains of a scene in its own coordinates, the longest first."""
    starts = find_starts(
        split_into_segments(find_seed_lines(p.binary, SEEDS), p.binary, SEEDS), p.bins, CIRCLES
    )
    band = (CIRCLES.min_height_m, RADON.max_height_m)
    found = chains_from_starts(starts, p.bins, band, PROFILE.min_length_m, CIRCLES)
    found = sorted(found, key=len, reverse=True)
    return [np.column_stack([chain[:, :3] + p.bins.origin, chain[:, 3:]]) for chain in found]


@pytest.fixture(scope="module")
def long_rail():
    """Points of a rail of 116 m with a bush in the middle, on ground."""
    rng = np.random.default_rng(4)
    bush = made.hedge(rng, (55.0, 63.0), (5.06, 5.8), (0.0, 1.0))
    return np.concatenate([made.ground(rng, s=(0.0, 120.0)), bush, made.rail(rng, LONG)])


def test_a_long_rail_is_one_chain_of_many_strands(long_rail):
    chain, *others = chains_in(prepare(straight(long_rail, 0.3)))
    assert all(len(other) < 40 for other in others)  # of the bush
    steps = np.hypot(*np.diff(chain[:, :2], axis=0).T)
    assert steps.sum() == pytest.approx(LONG[1] - LONG[0], abs=1.5)
    assert steps.min() > 0.8 * CIRCLES.spacing_m
    assert steps.max() < 1.2 * CIRCLES.spacing_m


def test_what_is_cut_off_far_away_does_not_move_a_chain(long_rail):
    whole, *_ = chains_in(prepare(straight(long_rail)))
    part, *_ = chains_in(prepare(straight(long_rail[long_rail[:, 0] < 100.0])))
    near = whole[whole[:, 0] < 100.0 - 60.0]
    apart = np.abs(near[:, None] - part).max(axis=2).min(axis=1)
    assert len(near) > 60
    assert apart.max() < 1e-9


def test_what_was_followed_at_the_same_height_is_left_out(long_rail):
    """Two bands of heights must not draw one beam twice; an edge above it is a line of its own."""
    p = prepare(straight(long_rail))
    starts = find_starts(
        split_into_segments(find_seed_lines(p.binary, SEEDS), p.binary, SEEDS), p.bins, CIRCLES
    )

    def found(followed):
        band = (CIRCLES.min_height_m, CIRCLES.max_sheet_m)
        return chains_from_starts(starts, p.bins, band, PROFILE.min_length_m, CIRCLES, followed=followed)

    alone = found([])
    higher = [chain + np.array([0.0, 0.0, 0.3, 0.0, 0.0]) for chain in alone]
    part = [chain[40:] for chain in alone]
    assert sum(map(len, alone)) > 200
    assert found(alone) == []
    assert sum(map(len, found(higher))) == sum(map(len, alone))
    assert 0 < sum(map(len, found(part))) < 60


def test_a_rail_between_starts_far_apart_is_followed_on():
    """Of two beams close together starts are rare; the one that is there leads on."""
    rng = np.random.default_rng(1)
    second = made.beam(rng, (2.0, 38.0), 5.45, faces=1)
    chains = chains_in(prepare(straight(rail_scene(rng, second))))
    lengths = sorted(np.ptp(chain[:, 0]) for chain in chains)
    assert lengths == pytest.approx([36.0, 36.0], abs=1.5)


def test_fits_are_the_same_whichever_way_a_chain_is_gone_through(long_rail):
    p = prepare(straight(long_rail, 0.7))
    chain, *_ = chains_in(p)
    chain[:, :3] -= p.bins.origin
    one, two = (fit_rail(c, p.bins, CIRCLES, PROFILE) for c in (chain, chain[::-1]))
    for name in ("xy", "edge_xy", "top_m", "sigma_xy_m", "sigma_z_m", "measured", "wobble"):
        np.testing.assert_allclose(getattr(one, name), getattr(two, name)[::-1], atol=1e-9)
    for name in ("top_m", "number", "spread_m", "above", "below", "beam_m", "front", "open_", "apron"):
        own, other = getattr(one.profile, name), getattr(two.profile, name)[::-1]
        np.testing.assert_allclose(own, other, atol=1e-9)


# ---------------------------------------------------------------- stretches


def verdict_of(sure, *, goes_on=True, open_=True):
    """A verdict that is sure of a guardrail where `sure` says so."""
    n = len(sure)
    return NodeScores(
        guardrail=np.where(sure, 0.9, 0.1),
        barrier=np.zeros(n),
        goes_on=np.full(n, 0.9 if goes_on else 0.1),
        steady=np.ones(n),
        open_=np.full(n, open_),
    )


def guardrails(sure, **how):
    sure = np.asarray(sure, dtype=bool)
    chainage = 0.5 * np.arange(len(sure))
    return [run for run, _ in guardrail_stretches(verdict_of(sure, **how), chainage, PROFILE)]


def nodes(*metres):
    """Nodes that are sure, then not, in turn, over so many metres each."""
    return np.concatenate([np.full(round(2 * m), i % 2 == 0) for i, m in enumerate(metres)])


def test_a_stretch_needs_its_length_and_more_where_it_is_closed():
    assert guardrails(nodes(6.5)) == [slice(0, 13)]
    assert guardrails(nodes(5.5)) == []
    assert guardrails(nodes(20.5), open_=False) == [slice(0, 41)]
    assert guardrails(nodes(19.0), open_=False) == []


def test_a_stretch_runs_on_so_far_and_joins_over_a_gap():
    (run,) = guardrails(nodes(20.0, 40.0))
    assert run == slice(0, 40 + 24)
    assert guardrails(nodes(20.0, 40.0), goes_on=False) == [slice(0, 40)]
    assert len(guardrails(nodes(20.0, 11.0, 20.0), goes_on=False)) == 1
    assert len(guardrails(nodes(20.0, 13.0, 20.0), goes_on=False)) == 2


def test_what_is_sure_here_and_there_is_none():
    assert guardrails(nodes(*[1.0, 3.0] * 20)) == []
    assert guardrails(nodes(*[3.0, 1.0] * 20)) == [slice(0, 160 - 2 + 2)]


def test_stretches_do_not_look_further_than_the_buffer():
    rng = np.random.default_rng(3)
    for _ in range(40):
        sure = np.repeat(rng.uniform(size=60) < 0.5, rng.integers(4, 20, 60))
        goes_on = np.repeat(rng.uniform(size=60) < 0.9, rng.integers(4, 20, 60))[: len(sure)]
        sure, on = sure[: len(goes_on)], np.where(goes_on, 0.9, 0.1)
        chosen = []
        for cut in (len(sure), len(sure) - 100):
            verdict = NodeScores(
                np.where(sure, 0.9, 0.1), np.zeros(len(sure)), on, on, np.ones(len(sure), dtype=bool)
            )
            part = NodeScores(
                *(
                    getattr(verdict, name)[:cut]
                    for name in ("guardrail", "barrier", "goes_on", "steady", "open_")
                )
            )
            mask = np.zeros(len(sure), dtype=bool)
            for run, _ in guardrail_stretches(part, 0.5 * np.arange(cut), PROFILE):
                mask[run] = True
            chosen.append(mask)
        inner = slice(0, len(sure) - 100 - 128)  # 64 m before the cut
        np.testing.assert_array_equal(chosen[0][inner], chosen[1][inner])


def test_barriers_are_long():
    def found(metres):
        n = round(2 * metres)
        verdict = NodeScores(np.zeros(n), np.full(n, 0.8), np.ones(n), np.ones(n), np.zeros(n, dtype=bool))
        return barrier_stretches(verdict, 0.5 * np.arange(n), PROFILE)

    assert len(found(19.0)) == 0
    ((run, score),) = found(21.0)
    assert (run, score.tolist()) == (slice(0, 42), [0.8] * 42)


# ---------------------------------------------------------------- barriers, and what runs beside


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_concrete_barrier_is_found_at_its_top_edge(seed):
    rng = np.random.default_rng(seed)
    lines = extract(straight(scene(rng, made.new_jersey(rng), screen=(5.0, (0.0, 0.81)))))
    assert lines.kind.tolist() == ["barrier"]
    assert np.abs(lines.xyz[:, 1] - 5.0).max() < 0.05
    assert np.abs(lines.xyz[2:-2, 2] - 0.81).max() < 0.05
    assert lines.length_m[0] == pytest.approx(36.0, abs=2.5)


def test_beside_is_abreast_level_and_near():
    x = np.arange(0.0, 10.0, 0.5)
    line = np.column_stack([x, 0 * x, 0 * x])

    def beside(dx, dy, dz):
        return close_beside([line], [line + np.array([dx, dy, dz])], 3.0)[0]

    assert beside(0.0, 1.0, 0.1).all()
    assert not beside(0.0, 3.2, 0.0).any()
    assert not beside(0.0, 1.0, 0.5).any()
    assert beside(5.0, 1.0, 0.0).sum() == 10
    assert [own.any() for own in close_beside([line, line], [], 3.0)] == [False, False]
    assert close_beside([], [line], 3.0) == []
