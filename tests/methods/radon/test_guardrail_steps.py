"""Every step of the guardrail part on small scenes made by hand, where the line is known to the millimetre."""

from dataclasses import replace

import numpy as np
import pytest
from tests.scenes import rail_scenes as made
from tests.scenes.rail_scenes import RADON, TOP_M, bend, extract, prepare, rail_scene, scene, straight

from linework.methods.radon.seeds import SeedConfig, SeedLines, find_seed_lines, split_into_segments
from linework.methods.rails.chains import chains_from_starts
from linework.methods.rails.circles import find_starts
from linework.methods.rails.forms import FormedStretch, fitted_again, formed_stretches, forms_along
from linework.methods.rails.placed import place_rails
from linework.methods.rails.rail_lines import rail_lines
from linework.methods.rails.rails import fit_rail
from linework.methods.rails.sections import Band, SectionForm
from linework.model.grid import Grid, Image

SEEDS, CIRCLES, PROFILE = RADON.seeds, RADON.circles, RADON.profile
#: A place in UTM; multiples of 3 m, on which the lattices of windows, cells and bins meet again.
FAR = np.array([500_001.0, 5_799_999.0, 201.0])


def rng_of(seed=1):
    return np.random.default_rng(seed)


def starts_in(p):
    return find_starts(
        split_into_segments(find_seed_lines(p.binary, SEEDS), p.binary, SEEDS), p.bins, CIRCLES
    )


def followed_in(p, starts=None):
    starts = starts_in(p) if starts is None else starts
    return chains_from_starts(starts, p.bins, (-1.0, RADON.max_height_m), PROFILE.min_length_m, CIRCLES)


def turn_between(a_rad, b_rad):
    """Angle between two undirected lines [deg]."""
    return np.degrees(np.abs((a_rad - b_rad + np.pi / 2) % np.pi - np.pi / 2))


def assert_one_rail(lines, length_m=36.0, u=5.0, top_m=TOP_M, height_within_m=0.03, length_within_m=1.5):
    """One guardrail along a straight road from s = 2 to 38, by default."""
    assert lines.kind.tolist() == ["guardrail"]
    assert lines.length_m[0] == pytest.approx(length_m, abs=length_within_m)
    assert np.abs(lines.xyz[:, 1] - u).max() < 0.03
    assert np.sqrt(np.mean((lines.xyz[:, 2] - top_m) ** 2)) < height_within_m
    assert lines.height_m[0] == pytest.approx(top_m, abs=height_within_m)


# ---------------------------------------------------------------- seed lines


def image_of(xy, bounds=(-2.0, 32.0)):
    """A binary image whose set cells hold the positions."""
    n = round((bounds[1] - bounds[0]) / 0.2)
    grid = Grid(bounds[0], bounds[1], 0.2, 0.2, n, n)
    values = np.zeros((n, n), dtype=bool)
    rows, cols = (np.floor(v).astype(int) for v in grid.to_cell(xy))
    inside = (rows >= 0) & (rows < n) & (cols >= 0) & (cols < n)
    values[rows[inside], cols[inside]] = True
    return Image(values, grid)


@pytest.mark.parametrize("degrees", [0.0, 1.5, 20.0, 45.0, 71.0, 90.0, 120.0, 178.0])
def test_seed_lines_have_the_direction_and_the_offset_of_what_is_there(degrees):
    angle = np.radians(degrees)
    along = np.array([np.cos(angle), np.sin(angle)])
    at = np.linspace(-9.0, 9.0, 400)
    line = np.array([15.07, 14.93]) + at[:, None] * along
    seeds = find_seed_lines(image_of(line), SEEDS)
    normal = np.column_stack([np.cos(seeds.theta_rad), np.sin(seeds.theta_rad)])
    good = turn_between(seeds.theta_rad + np.pi / 2, angle) <= 3.0
    for place in line[np.abs(at) < 6.0][::20]:
        holds = np.all(np.abs(place - seeds.centre_xy) <= SEEDS.window_m / 2, axis=1)
        beside = np.abs(np.sum((place - seeds.centre_xy) * normal, axis=1) - seeds.rho_m)
        assert np.any(holds & good & (beside <= 0.15)), place
    assert np.all(seeds.strength_m >= SEEDS.peak_threshold_m)


def test_nothing_and_what_is_short_give_no_seed_line():
    assert len(find_seed_lines(image_of(np.zeros((0, 2))), SEEDS)) == 0
    short = np.column_stack([np.linspace(10, 11.2, 50), np.full(50, 7.1)])
    assert len(find_seed_lines(image_of(short), SEEDS)) == 0


def test_windows_sit_on_one_lattice_whatever_part_is_seen():
    line = np.column_stack([np.linspace(0, 30, 900), 12.3 + 0.2 * np.linspace(0, 30, 900)])
    whole, part = find_seed_lines(image_of(line), SEEDS), find_seed_lines(image_of(line, (4.0, 28.0)), SEEDS)

    def inner(seeds):
        chosen = np.all((seeds.centre_xy > 8.0) & (seeds.centre_xy < 24.0), axis=1)
        columns = [*seeds.centre_xy.T, seeds.theta_rad, seeds.rho_m, seeds.strength_m]
        return np.column_stack(columns)[chosen]

    assert len(inner(part)) > 3
    np.testing.assert_allclose(inner(part), inner(whole), atol=1e-9)


# ---------------------------------------------------------------- segments


def one_seed(y):
    """A seed line along x in the window about (3, 3)."""
    return SeedLines(np.array([[3.0, 3.0]]), np.array([np.pi / 2]), np.array([y - 3.0]), np.array([4.0]))


@pytest.mark.parametrize(("gap_m", "n_pieces"), [(0.0, 1), (0.6, 1), (0.8, 1), (1.4, 2), (2.0, 2)])
def test_segments_are_parted_at_gaps_longer_than_allowed(gap_m, n_pieces):
    x = np.arange(0.05, 6.0, 0.1)
    x = x[(x < 2.4) | (x > 2.4 + gap_m)]
    segments = split_into_segments(
        one_seed(3.1), image_of(np.column_stack([x, np.full(len(x), 3.1)])), SeedConfig(max_gap_m=1.0)
    )
    assert len(segments) == n_pieces
    ends = np.sort(np.concatenate([segments.start_xy[:, 0], segments.end_xy[:, 0]]))
    expected = [0.0, 6.0] if n_pieces == 1 else [0.0, 2.4, 2.4 + gap_m, 6.0]
    np.testing.assert_allclose(ends, expected, atol=0.3)  # a cell, and half a cell of the walk
    np.testing.assert_allclose(segments.start_xy[:, 1], 3.1, atol=1e-9)
    assert np.all(segments.strength_m == 4.0)


def test_short_pieces_are_dropped_and_empty_seed_lines_have_none():
    x = np.r_[np.arange(0.05, 3.0, 0.1), np.arange(5.05, 5.6, 0.1)]
    image = image_of(np.column_stack([x, np.full(len(x), 3.1)]))
    segments = split_into_segments(one_seed(3.1), image, SEEDS)
    assert len(segments) == 1
    assert segments.end_xy[0, 0] < 3.4
    assert len(split_into_segments(one_seed(4.5), image, SEEDS)) == 0


# ---------------------------------------------------------------- starts


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_starts_stand_on_the_beam_with_its_heading_and_top(seed):
    p = prepare(straight(rail_scene(rng_of(seed))))
    starts = starts_in(p)
    x, y = (starts[:, :2] + p.bins.origin[:2]).T
    clear = starts[:, 4] > 300  # a beam has 150 points per metre; at its ends there are also poor ones
    assert clear.sum() >= 10
    assert np.ptp(x[clear]) > 30.0
    assert np.abs(y[clear] - 5.0).max() < 0.04  # half a strip
    assert turn_between(starts[clear, 2], 0.0).max() < 1.0
    assert np.abs(starts[:, 3] + p.bins.origin[2] - TOP_M).max() <= 0.05  # a bin of height
    assert np.abs(y - 5.0).max() < 0.15


@pytest.mark.parametrize("thing", [made.wall, made.kerb])
def test_what_reaches_the_ground_or_ends_below_the_band_gives_no_start(thing):
    rng = rng_of()
    assert len(starts_in(prepare(straight(scene(rng, thing(rng)))))) == 0


# ---------------------------------------------------------------- following


def test_a_rail_is_followed_once_from_end_to_end():
    p = prepare(straight(rail_scene(rng_of())))
    chains = followed_in(p)
    assert len(chains) == 1
    xy = chains[0][:, :2] + p.bins.origin[:2]
    assert min(xy[0, 0], xy[-1, 0]) < 2.6
    assert max(xy[0, 0], xy[-1, 0]) > 37.4
    assert np.abs(xy[:, 1] - 5.0).max() < 0.04
    steps = np.hypot(*np.diff(xy, axis=0).T)
    np.testing.assert_allclose(steps, CIRCLES.spacing_m, atol=0.05)
    assert np.mean(chains[0][:, 4]) > 0.95  # measured, not predicted


@pytest.mark.parametrize("turns", [-1, 1])
def test_a_rail_through_a_bend_of_18_m_is_followed_whole(turns):
    suh = rail_scene(rng_of(), u=5.0 if turns < 0 else -5.0, faces=-1 if turns < 0 else 1)
    # Seen from the bend's centre the rail's own radius is 18 m
    p = prepare(bend(suh, 23.0) if turns < 0 else bend(suh, 13.0))
    radius = 18.0
    chains = followed_in(p)
    assert len(chains) == 1
    xy = chains[0][:, :2] + p.bins.origin[:2]
    centre = np.array([0.0, 23.0 if turns < 0 else 13.0])
    assert np.abs(np.hypot(*(xy - centre).T) - radius).max() < 0.06
    length = np.sum(np.hypot(*np.diff(xy, axis=0).T))
    assert length == pytest.approx(36.0 * radius / centre[1], abs=1.5)


@pytest.mark.parametrize(("gap_m", "n_chains"), [(1.9, 1), (5.0, 2)])
def test_short_gaps_are_bridged_and_marked_and_long_ones_end_a_line(gap_m, n_chains):
    rng = rng_of()
    p = prepare(straight(scene(rng, made.rail(rng, (2.0, 18.0)), made.rail(rng, (18.0 + gap_m, 38.0)))))
    chains = followed_in(p)
    assert len(chains) == n_chains
    x = np.concatenate([c[:, 0] for c in chains]) + p.bins.origin[0]
    inside = (x > 18.51) & (x < 18.0 + gap_m - 0.51)  # a circle's station reaches half a metre
    measured = np.concatenate([c[:, 4] for c in chains])
    assert not measured[inside].any()
    lines = extract(p.points.xyz)
    assert len(lines) == n_chains
    # The gap is marked where it is bridged; a line's end may lie just beyond its last point
    assert lines.bridged.sum() >= 2 if n_chains == 1 else lines.bridged.sum() <= 4


def test_following_does_not_depend_on_the_order_of_the_starts_and_leaves_them_alone():
    p = prepare(straight(rail_scene(rng_of(2))))
    starts = starts_in(p)
    kept = starts.copy()
    chains = followed_in(p, starts)
    again = followed_in(p, starts[rng_of(5).permutation(len(starts))])
    np.testing.assert_array_equal(starts, kept)
    assert len(chains) == len(again)
    for a, b in zip(chains, again, strict=True):
        np.testing.assert_array_equal(a, b)


# ---------------------------------------------------------------- fitting


@pytest.mark.parametrize("noise_m", [0.003, 0.02])
def test_the_fit_is_the_middle_of_the_corrugation_and_the_top_edge(noise_m):
    p = prepare(straight(rail_scene(rng_of(), noise_m=noise_m)))
    (chain,) = followed_in(p)
    rail = fit_rail(chain, p.bins, CIRCLES, PROFILE)
    across = rail.xy[:, 1] + p.bins.origin[1] - 5.0
    up = rail.top_m + p.bins.origin[2] - TOP_M
    assert abs(np.mean(across)) < 0.015
    assert np.std(across) < 0.01
    assert abs(np.mean(up)) < 0.02
    assert np.std(up) < 0.02
    assert np.mean(rail.measured) > 0.95
    assert np.all((rail.sigma_xy_m >= 0.01) & (rail.sigma_xy_m < 0.03))
    assert np.all((rail.sigma_z_m >= 0.01) & (rail.sigma_z_m < 0.04))


def test_an_edge_that_lies_far_below_what_is_followed_at_an_end_is_found():
    """Where an end dips, what is followed may go on level: the fit is looked at once more about where it ends."""
    p = prepare(straight(rail_scene(rng_of())))
    (chain,) = followed_in(p)
    rail = fit_rail(chain, p.bins, CIRCLES, PROFILE)
    n = len(chain)
    off = rail.top_m + np.where(np.arange(n) >= n - 5, 0.45, 0.0)
    whole = SectionForm("guardrail", "thrie_beam", (Band(-0.31, 0.0, "flat", 0.0, 1.0, 0.0),), hangs=True)
    stretch = FormedStretch(slice(0, n), whole, 1.0, *np.zeros((2, n)))
    (fit,) = fitted_again(replace(rail, top_m=off), stretch, p.bins, CIRCLES, PROFILE)
    assert np.abs(fit.top_m - rail.top_m).max() < 0.05


def in_plain(section):
    """What a section shows, to the micrometre, as values that compare."""
    bands = [
        [round(m, 6) for m in (b.low_m, b.high_m, b.axis_m, b.explained, b.top_share)] for b in section.bands
    ]
    return section.kind, section.form, section.hangs, bands


@pytest.mark.parametrize("angle_rad", [0.0, 0.3, np.pi / 2])
@pytest.mark.parametrize("thing", [made.rail, made.new_jersey, made.boards])
def test_windows_show_the_same_whichever_way_a_rail_is_followed(thing, angle_rad):
    """A tile may follow a rail the other way than the next one: that is no reason for another form or edge."""
    rng = rng_of(3)
    p = prepare(
        straight(scene(rng, thing(rng), behind=[made.hedge(rng, (10.0, 20.0), (5.1, 5.6))]), angle_rad)
    )
    chain = max(followed_in(p), key=len)
    found = []
    for rail in (fit_rail(c, p.bins, CIRCLES, PROFILE) for c in (chain, chain[::-1])):
        (placed,) = place_rails([rail], p.bins, p.surface)
        at, sections = forms_along(placed, p.bins, p.surface, CIRCLES)
        steady = np.ones(len(rail.xy), dtype=bool)
        found.append(
            (at, sections, formed_stretches(at, sections, steady, placed.height_m, CIRCLES, PROFILE))
        )
    (at, one, runs), (at_back, other, runs_back) = found
    last = len(chain) - 1
    assert at.tolist() == (last - at_back)[::-1].tolist()
    assert any(s.form for s in one)
    assert [in_plain(s) for s in one] == [in_plain(s.mirrored()) for s in other[::-1]]
    ends = [(r.run.start, r.run.stop - 1) for r in runs]
    assert ends == [(last + 1 - r.run.stop, last - r.run.start) for r in runs_back[::-1]]


def test_the_fit_in_a_bend_of_18_m_does_not_cut_it():
    p = prepare(bend(rail_scene(rng_of()), 23.0))
    (chain,) = followed_in(p)
    rail = fit_rail(chain, p.bins, CIRCLES, PROFILE)
    radius = np.hypot(*(rail.xy + p.bins.origin[:2] - [0.0, 23.0]).T)
    assert abs(np.mean(radius) - 18.0) < 0.015
    assert np.abs(radius[2:-2] - 18.0).max() < 0.04


# ---------------------------------------------------------------- whole scenes: rails


@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize("beam", [{}, {"noise_m": 0.02}, {"per_m": 24}], ids=["plain", "noisy", "sparse"])
def test_a_guardrail_is_found_whole(seed, beam):
    assert_one_rail(extract(straight(rail_scene(rng_of(seed), **beam))))


def test_a_single_rail_is_not_one_of_a_pair():
    assert not extract(straight(rail_scene(rng_of()))).double.any()


@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize("s", [(2.0, 38.0), (12.0, 24.0)], ids=["all along", "part"])
@pytest.mark.parametrize("top_m", [0.7, 1.1, 1.6])
def test_a_rail_with_a_hedge_touching_behind_it_is_found_at_the_beams_height(seed, s, top_m):
    rng = rng_of(seed)
    hedge = made.hedge(rng, s, (5.05, 5.9), (0.0, top_m))
    # One of these 36 ends is lost for another 2 m once coordinates are rounded to 0.1 mm
    assert_one_rail(extract(straight(rail_scene(rng, behind=[hedge]))), length_within_m=2.1)


@pytest.mark.parametrize("apart_m", [0.30, 0.45, 1.2])
def test_two_beams_back_to_back_are_two_lines_and_a_pair(apart_m):
    rng = rng_of()
    second = made.beam(rng, (2.0, 38.0), 5.0 + apart_m, faces=1)
    lines = extract(straight(rail_scene(rng, second)))
    assert lines.kind.tolist() == ["guardrail", "guardrail"]
    assert lines.double.all()
    means = sorted(np.mean(lines[i].xyz[:, 1]) for i in range(2))
    np.testing.assert_allclose(means, [5.0, 5.0 + apart_m], atol=0.02)
    np.testing.assert_allclose(lines.length_m, 36.0, atol=2.0)


def test_a_rail_runs_on_down_to_its_buried_end():
    rng = rng_of()
    suh = made.rail(rng)
    dip = np.interp(suh[:, 0], [30.0, 38.0], [0.0, TOP_M - 0.06])
    suh[:, 2] -= dip
    suh = suh[suh[:, 2] > 0.0]
    lines = extract(straight(scene(rng, suh, screen=(5.0, (TOP_M - 0.31, TOP_M)))))
    assert lines.kind.tolist() == ["guardrail"]
    assert lines.xyz[:, 0].max() > 34.0
    low = lines.xyz[np.argmax(lines.xyz[:, 0])]
    assert low[2] == pytest.approx(TOP_M - np.interp(low[0], [30.0, 38.0], [0.0, TOP_M - 0.06]), abs=0.08)


def test_a_rail_shorter_than_the_least_length_is_none():
    end = 10.0 + PROFILE.min_length_m
    assert len(extract(straight(rail_scene(rng_of(), s=(10.0, end - 1.0))))) == 0
    assert len(extract(straight(rail_scene(rng_of(), s=(10.0, end + 1.5))))) == 1


# ---------------------------------------------------------------- whole scenes: all else


def parked(rng):
    """Six cars in a row, as well aligned as drivers do: within 15 cm."""
    places = zip(2.0 + 5.6 * np.arange(6), rng.uniform(2.85, 3.15, 6), rng.uniform(0.95, 1.1, 6), strict=True)
    cars = [made.car(rng, s, u) * [1.0, 1.0, taller] for s, u, taller in places]
    return scene(rng, *cars, screen=(3.0, (0.2, 0.85)))


NOT_RAILS = {
    "wall": lambda rng: scene(rng, made.wall(rng), screen=(5.0, (0.0, 2.0))),
    "low wall": lambda rng: scene(rng, made.wall(rng, top_m=0.8), screen=(5.0, (0.0, 0.8))),
    "low wall seen from both sides": lambda rng: scene(rng, made.wall(rng, top_m=0.8)),
    "hedge": lambda rng: scene(rng, made.hedge(rng), screen=(5.0, (0.0, 1.1))),
    "sparse hedge": lambda rng: scene(rng, made.hedge(rng, per_m3=250), screen=(5.0, (0.0, 1.1))),
    "narrow low hedge": lambda rng: scene(rng, made.hedge(rng, u=(5.0, 5.3), h=(0.0, 0.7))),
    "parked cars": parked,
    "board fence": lambda rng: scene(rng, made.boards(rng)),
    "New Jersey": lambda rng: scene(rng, made.new_jersey(rng), screen=(5.0, (0.0, 0.81))),
    "kerb": lambda rng: scene(rng, made.kerb(rng)),
    "nothing": scene,
}


@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize("name", NOT_RAILS)
def test_nothing_but_rails_is_called_a_guardrail(name, seed):
    assert "guardrail" not in extract(straight(NOT_RAILS[name](rng_of(seed)))).kind.tolist()


# ---------------------------------------------------------------- the whole of it


def full_scene(seed=3):
    rng = rng_of(seed)
    hedge = made.hedge(rng, (15.0, 25.0), (5.05, 5.9))
    return rail_scene(rng, made.rail(rng, (2.0, 30.0), -4.5, faces=1), behind=[hedge])


def test_the_steps_one_by_one_give_the_lines_of_the_method():
    p = prepare(straight(full_scene()))
    rails = [fit_rail(chain, p.bins, CIRCLES, PROFILE) for chain in followed_in(p)]
    by_step = rail_lines(rails, p.bins, p.surface, CIRCLES, PROFILE)
    method = extract(p.points.xyz)
    assert by_step.kind.tolist() == method.kind.tolist() == ["guardrail", "guardrail"]
    for side in (-1, 1):
        own, whole = (lines.xyz[side * lines.xyz[:, 1] > 0] for lines in (by_step, method))
        whole = whole[np.argsort(whole[:, 0])]
        inner = own[(own[:, 0] > 4.0) & (own[:, 0] < 28.0)]
        assert len(inner) > 40
        for k in (1, 2):
            there = np.interp(inner[:, 0], whole[:, 0], whole[:, k])
            assert np.abs(inner[:, k] - there).max() < 0.01


def test_shuffled_points_give_the_same_lines():
    xyz = straight(full_scene(), 0.3, FAR)
    lines = extract(xyz)
    again = extract(xyz[rng_of(9).permutation(len(xyz))])
    assert len(lines) == 2
    assert np.array_equal(again.offsets, lines.offsets)
    assert np.abs(again.xyz - lines.xyz).max() < 1e-9
    np.testing.assert_allclose(again.confidence, lines.confidence, atol=1e-9)


def test_far_from_the_origin_the_lines_are_the_same():
    suh = full_scene()
    near = extract(straight(suh, 0.3))
    far = extract(straight(suh, 0.3, FAR))
    assert len(near) == 2
    assert np.array_equal(near.offsets, far.offsets)
    assert np.abs(far.xyz - FAR - near.xyz).max() < 1e-4


@pytest.mark.parametrize("shift", [[0.37, 1.11, 0.0], [1.6, 0.07, 5.0]])
def test_where_the_lattices_lie_does_not_move_the_lines(shift):
    suh = full_scene()
    lines, moved = extract(straight(suh)), extract(straight(suh, origin=shift))
    assert len(lines) == len(moved) == 2
    for side in (-1, 1):
        own, other = (
            v[np.argsort(v[:, 0])]
            for v in (lines.xyz[side * lines.xyz[:, 1] > 0], (moved.xyz - shift)[side * moved.xyz[:, 1] > 0])
        )
        inner = own[3:-3]
        for k, within in ((1, 0.01), (2, 0.02)):
            there = np.interp(inner[:, 0], other[:, 0], other[:, k])
            assert np.abs(there - inner[:, k]).max() < within


def test_points_without_a_rail_give_no_lines():
    assert len(extract(np.array([[1.0, 2.0, 3.0]]))) == 0
    assert len(extract(np.tile([[1.0, 2.0, 3.0]], (50, 1)))) == 0
