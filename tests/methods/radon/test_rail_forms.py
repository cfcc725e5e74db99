"""Forms of rails from their cross-sections, drawn as points on the outlines of each type."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from linework.methods.radon.method import Radon
from linework.methods.rails import forms
from linework.methods.rails.circles import CircleConfig
from linework.methods.rails.forms import form_of_run, formed_stretches
from linework.methods.rails.outlines import SECTION_CELL_M, OutlineFit
from linework.methods.rails.placed import road_noise_m
from linework.methods.rails.profile import ProfileConfig
from linework.methods.rails.sections import (
    DEPTHS_M,
    HALF_SECTION_M,
    NOTHING,
    Band,
    SectionForm,
    form_of_bars,
    form_of_section,
)
from linework.model.grid import Bounds, Grid
from linework.model.ground import Ground
from linework.model.points import Points
from linework.model.tile import TileData

#: Height of the followed edge above the ground. [m]
TOP_M = 0.80


def section(parts):
    """Counts of a section of points (u, z), z from the followed edge, with 8 mm of noise."""
    rng = np.random.default_rng(3)
    u, z = np.concatenate(parts, axis=0).T
    u, z = u + rng.normal(0.0, 0.008, len(u)), z + rng.normal(0.0, 0.002, len(z))
    edges = (
        np.arange(DEPTHS_M[0], DEPTHS_M[1] + 0.5 * SECTION_CELL_M, SECTION_CELL_M),
        np.arange(-HALF_SECTION_M, HALF_SECTION_M + 0.5 * SECTION_CELL_M, SECTION_CELL_M),
    )
    return np.histogram2d(z, u, bins=edges)[0]


def plane(low, high, u=0.0):
    z = np.linspace(low, high, int((high - low) * 3000))
    return np.column_stack([np.full(len(z), u), z])


def folded(low, crests):
    """A beam of crests 0.194 m apart, 8 cm deep."""
    z = np.linspace(low, 0.0, 1500)
    return np.column_stack([0.04 * np.cos(2 * np.pi * crests * z / low), z])


def pipe(top, size):
    """What is seen of a pipe from the left and above."""
    turn = np.linspace(0.5 * np.pi, 1.2 * np.pi, 400)
    return np.column_stack([0.5 * size * np.cos(turn), top - 0.5 * size + 0.5 * size * np.sin(turn)])


def box(size):
    """Face and top of a square tube."""
    across = np.linspace(-0.5 * size, 0.5 * size, 120)
    return np.concatenate([plane(-size, 0.0, -0.5 * size), np.column_stack([across, 0.0 * across])])


def concrete():
    """Lid, upper face, slope and toe of a New Jersey profile; its top edge at 0."""
    lid = np.column_stack([np.linspace(0.0, 0.18, 200), np.zeros(200)])
    face = np.column_stack([np.linspace(0.0, -0.07, 1300), np.linspace(0.0, -0.47, 1300)])
    slope = np.column_stack([np.linspace(-0.07, -0.20, 800), np.linspace(-0.47, -0.72, 800)])
    return [lid, face, slope]


@pytest.mark.parametrize(
    ("parts", "expected", "n"),
    [
        ([folded(-0.31, 2)], ("guardrail", "w_beam"), 1),
        ([folded(-0.506, 3)], ("guardrail", "thrie_beam"), 1),
        ([box(0.16)], ("guardrail", "box_beam"), 1),
        ([pipe(0.0, 0.12), pipe(-0.3, 0.12)], ("guardrail", "tube"), 2),
        ([plane(-0.03 - 0.11 * i, -0.11 * i) for i in range(3)], ("guardrail", "cable_barrier"), 3),
        ([plane(-0.13, 0.0), plane(-0.48, -0.35)], ("fence", "boards"), 2),
        ([plane(-0.78, 0.0)], ("fence", "mesh"), 1),
        (concrete(), ("barrier", "concrete"), 1),
    ],
)
def test_each_type_is_told_by_its_outline(parts, expected, n):
    found = form_of_section(section(parts), TOP_M)
    assert (found.kind, found.form) == expected
    assert len(found.bands) == n


def test_hedges_walls_and_few_points_have_no_form():
    rng = np.random.default_rng(5)
    hedge = np.column_stack([rng.uniform(-0.25, 0.25, 4000), rng.uniform(-0.8, 0.0, 4000)])
    lid = np.column_stack([np.linspace(0.0, 0.25, 300), np.zeros(300)])
    assert form_of_section(section([hedge]), TOP_M).form == ""
    assert form_of_section(section([plane(-0.78, 0.0), lid]), TOP_M).form == ""
    assert form_of_section(section([plane(-0.01, 0.0)]), TOP_M).form == ""


@pytest.mark.parametrize("height_m", [0.30, 0.50])
def test_what_a_car_leaves_of_a_fence_is_no_beam(height_m):
    # As high as a W-beam or a thrie beam, and clear of the ground, but flat, whatever the scanner's noise across
    rng = np.random.default_rng(7)
    for noise_m in (0.0, 0.015, 0.025):
        sheet, beam = plane(-height_m, 0.0)[::8], folded(-0.506, 3)[::4]
        sheet[:, 0] += noise_m * rng.normal(size=len(sheet))
        beam[:, 0] += noise_m * rng.normal(size=len(beam))
        assert form_of_section(section([sheet]), 1.30, noise_m=0.3 * noise_m).form == ""
        assert form_of_section(section([beam]), 0.95, noise_m=0.3 * noise_m).form == "thrie_beam"


def scanned(outline, down_deg, noise_m=0.018, side=1.0, half=0.06, n=300):
    """Points of an outline that evenly spaced beams from one side meet, their noise in height a third of that across."""
    rng = np.random.default_rng(11)
    height, down = rng.uniform(-1.0, 1.0, n), np.radians(down_deg)
    if outline == "pipe":
        # Beams from this far up meet the circle this far from its middle
        turn = np.arcsin(height) + down
        u, z = half * np.cos(turn), half * np.sin(turn)
    elif outline == "box":
        on_top = rng.random(n) < np.sin(down) / (np.sin(down) + np.cos(down))
        u, z = np.where(on_top, half * height, half), np.where(on_top, half, half * height)
    else:
        u, z = np.zeros(n), half * height
    return np.column_stack([side * u, z]) + rng.normal(0.0, noise_m, (n, 2)) * [1.0, 0.33]


def test_the_axis_of_a_pipe_is_its_middle_not_its_visible_side():
    (band,) = form_of_section(
        section([scanned("pipe", 20.0, 0.002, -1.0, half=0.07) - [0.0, 0.07]]), TOP_M
    ).bands
    assert band.outline == "pipe"
    assert abs(band.axis_m) <= 0.01
    assert band.height_m == pytest.approx(0.14, abs=0.03)


@pytest.mark.parametrize("across_m", [-0.04, 0.0, 0.06])
@pytest.mark.parametrize("down_deg", [4.0, 20.0])
@pytest.mark.parametrize("noise_m", [0.008, 0.018, 0.03])
@pytest.mark.parametrize("both_sides", [False, True])
def test_bars_are_told_apart_under_noise(across_m, down_deg, noise_m, both_sides):
    """Distances from an outline forgive noise where it is level or has two sides; how a scanner sees it does not."""
    edges = (
        np.arange(DEPTHS_M[0], DEPTHS_M[1] + 0.5 * SECTION_CELL_M, SECTION_CELL_M),
        np.arange(-HALF_SECTION_M, HALF_SECTION_M + 0.5 * SECTION_CELL_M, SECTION_CELL_M),
    )
    for outline, form, tops in (
        ("plate", "boards", (-0.07, -0.50)),
        ("pipe", "tube", (-0.07, -0.50)),
        ("box", "box_beam", (-0.07,)),
    ):
        sides = (1.0, -1.0) if both_sides else (1.0,)
        bars = [
            scanned(outline, down_deg, noise_m, side) + np.array([across_m, top])
            for top in tops
            for side in sides
        ]
        u, z = np.concatenate(bars).T
        found = form_of_section(np.histogram2d(z, u, bins=edges)[0], 1.1)
        assert found.form == form
        assert abs(found.bands[0].axis_m - across_m) <= 0.015


def bar(low, flat, pipe):
    """Return a bar of 0.14 m with what a flat outline and a pipe cost."""
    fits = OutlineFit("flat", 0.0, 1.0, flat), OutlineFit("pipe", 0.07, 1.0, pipe)
    chosen = min(fits, key=lambda fit: fit.cost)
    return Band(low, low + 0.14, chosen.outline, chosen.axis_m, chosen.explained, 0.0, fits)


def test_bars_are_judged_together():
    upper, lower = bar(-0.14, 20.0, 18.0), bar(-0.62, 20.0, 26.0)
    section = form_of_bars((upper, lower), [upper.fits, lower.fits], hangs=True)
    assert (section.kind, section.form) == ("fence", "boards")
    assert [band.outline for band in section.bands] == ["flat", "flat"]
    # The windows beside this one say that both are pipes
    beside = bar(-0.14, 30.0, 18.0)
    section = form_of_bars((upper, lower), [upper.fits, lower.fits, beside.fits], hangs=True)
    assert (section.kind, section.form) == ("guardrail", "tube")
    assert [band.axis_m for band in section.bands] == [0.07, 0.07]


def test_a_mesh_is_a_fence_though_a_plinth_hides_its_foot():
    # 1.30 m high, seen from 0.35 m up; the top of what hides the rest is a band of its own
    mesh, plinth = plane(-0.95, 0.0), plane(-1.10, -1.0, 0.05)[::3]
    for parts in ([mesh], [mesh, plinth]):
        found = form_of_section(section(parts), 1.30)
        assert (found.kind, found.form) == ("fence", "mesh")
    assert form_of_section(section([plane(-0.80, 0.0)]), 1.30).form == ""


def test_concrete_is_told_by_the_noise_of_the_survey():
    lid, face, slope = concrete()
    rng = np.random.default_rng(2)
    noisy = [part + rng.normal(0.0, 0.032, part.shape) for part in (lid, face, slope)]
    assert form_of_section(section(noisy), TOP_M).form == ""
    assert form_of_section(section(noisy), TOP_M, 0.032).form == "concrete"


def test_the_noise_is_that_of_the_road_beside_a_place():
    is_road = np.zeros((60, 200), dtype=bool)
    is_road[20:30, :100] = True
    sigma = np.where(is_road, 0.03, 0.10).astype(np.float32)
    zeros = np.zeros(is_road.shape, dtype=np.float32)
    ground = Ground(
        Grid(0.0, 30.0, 0.5, 0.5, 60, 200), 0.0, zeros, zeros, is_road, np.ones_like(is_road), sigma
    )
    # Of the third, 10 cells of road are within reach: too few
    places = np.array([[25.0, 18.0], [57.0, 18.0], [57.5, 18.0], [80.0, 18.0], [25.0, 500.0], [-300.0, 18.0]])
    assert road_noise_m(ground, places) == pytest.approx([0.03, 0.03, 0.0, 0.0, 0.0, 0.0])


def test_a_bar_on_the_ground_is_none_whatever_the_bars_beside_it_are():
    counts = section([scanned("box", 10.0, 0.004, n=900) - [0.0, 0.06]])
    assert form_of_section(counts, 0.9).form == "box_beam"
    low = form_of_section(counts, 0.20)
    assert (low.form, low.hangs) == ("", False)
    assert form_of_bars(low.bands, [b.fits for b in low.bands], hangs=low.hangs).form == ""


def test_what_goes_on_above_the_section_has_no_upper_edge():
    wall, fence = plane(-0.40, DEPTHS_M[1]), plane(-0.40, 1.10)
    assert form_of_section(section([wall]), 0.45).form == ""
    assert form_of_section(section([fence]), 0.45).form == "mesh"
    # Nor has what ends where points are no longer taken, 2.2 m above the ground
    assert form_of_section(section([plane(-0.30, 1.20)]), 1.0).form == ""
    assert form_of_section(section([plane(-0.70, 0.70)]), 1.0).form == "mesh"


@pytest.mark.parametrize(("size", "kind"), [(0.05, "fence"), (0.10, "guardrail")])
def test_two_tubes_are_a_handrail_and_two_pipes_a_rail(size, kind):
    # Seen 1 cm higher by their noise at either edge
    parts = [plane(top - size - 0.02, top, u) for top in (0.0, -0.45) for u in (0.0, 0.01)]
    found = form_of_section(section(parts if kind == "fence" else [pipe(0.0, size), pipe(-0.45, size)]), 0.9)
    assert found.kind == kind


def windows(*names):
    """Sections of windows 2 m apart, by the first letter of what they show, and their stations."""
    shown = {
        "b": SectionForm("fence", "boards", tuple(Band(low, low + 0.12, "flat", 0.0, 1.0, 0.0) for low in (-0.12, -0.5)), hangs=True),
        "m": SectionForm("fence", "mesh", (Band(-0.8, 0.0, "flat", 0.0, 1.0, 0.0),), hangs=False),
        "t": SectionForm("guardrail", "thrie_beam", (Band(-0.5, 0.0, "flat", 0.0, 1.0, 0.0),), hangs=True),
        "-": NOTHING,
    }  # fmt: skip
    letters = "".join(names)
    return np.arange(len(letters)) * 4 + 2, [shown[letter] for letter in letters]


def stretches(letters):
    at, forms = windows(letters)
    n = 4 * len(letters)
    steady, level_m = np.ones(n, dtype=bool), np.zeros(n)
    found = formed_stretches(at, forms, steady, level_m, CircleConfig(), ProfileConfig())
    return [
        (s.section.form, s.run.start * 0.5, s.run.stop * 0.5, round(s.agreeing, 2))
        for s in sorted(found, key=lambda s: s.run.start)
    ]


def test_windows_of_boards_and_of_mesh_are_one_fence():
    assert stretches("bbbbmmbb") == [("boards", 0.0, 16.0, 1.0)]


def test_a_fence_ends_where_its_windows_end_and_bridges_one_window_length():
    ((form, start, stop, agreeing),) = stretches("-----bbbb--bb------")
    assert form == "boards"
    assert (start, stop) == pytest.approx((10.0, 26.0), abs=0.6)
    assert agreeing == pytest.approx(0.75, abs=0.01)
    assert len(stretches("bbbb-----bbbb")) == 2
    # What shows something else is not bridged
    assert [form for form, *_ in stretches("bbbbttbbbb")] == ["boards", "boards"]


def test_a_rail_goes_on_to_its_ends_that_dip():
    ((form, start, stop, _),) = stretches("---ttttttttt---")
    assert (form, start, stop) == ("thrie_beam", 0.0, 30.0)


def test_thin_layers_far_apart_are_nothing():
    """Single rows of cells 5 cm apart, as stalks and leaves give: no band is as high as two cells."""
    counts = np.zeros_like(section([plane(-0.2, 0.0)]))
    counts[100:300:5, counts.shape[1] // 2] = 20.0
    assert form_of_section(counts, TOP_M) == NOTHING


def test_a_barrier_whose_foot_was_taken_for_ground_is_one():
    """An F-shape of 0.98 m: where its foot raises the ground by 14 cm, the ground beside it shows how high it stands."""
    lid = np.column_stack([np.linspace(0.0, 0.2, 200), np.zeros(200)])
    face = np.column_stack([np.linspace(0.0, -0.055, 2000), np.linspace(0.0, -0.725, 2000)])
    slope = np.column_stack([np.linspace(-0.055, -0.17, 500), np.linspace(-0.725, -0.905, 500)])
    counts = section([lid, face, slope])
    assert form_of_section(counts, 0.84).form == ""
    assert form_of_section(counts, 0.84, above_beside_m=(0.98, 0.50)).kind == "barrier"
    # The foot is on the right: what the land on the left is like says nothing
    assert form_of_section(counts, 0.84, above_beside_m=(0.84, 0.98)).form == ""
    assert form_of_section(section([plane(-0.97, 0.0), lid]), 0.84, above_beside_m=(0.98, 0.98)).form == ""


def f_shape(height_m, buried_m):
    """Lid, face and what a verge of `buried_m` leaves of the slope and the toe of an F-shape; the foot on the right."""
    z = np.array([0.0, 0.255 - height_m, 0.075 - height_m, -height_m])
    at = np.linspace(buried_m - height_m, 0.0, 2600)
    lid = np.column_stack([np.linspace(0.0, 0.2, 200), np.zeros(200)])
    return [lid, np.column_stack([np.interp(at, z[::-1], [-0.2, -0.2, -0.055, 0.0]), at])]


def test_a_barrier_whose_foot_a_verge_hides_is_one():
    """What is left of the slope is one surface down to the verge; grass before a wall is not, and a kerb leaves it upright."""
    assert form_of_section(section(f_shape(0.83, 0.10)), 0.73).form == "concrete"
    rng = np.random.default_rng(4)
    lid, wall = f_shape(0.83, 0.10)[0], plane(-0.73, 0.0)
    grass = np.column_stack([rng.uniform(-0.25, 0.0, 300), rng.uniform(-0.72, -0.60, 300)])
    kerb = plane(-0.72, -0.61, -0.15)
    for before in ([], [grass], [kerb]):
        assert form_of_section(section([lid, wall, *before]), 0.73).kind != "barrier"


def test_a_mesh_in_the_grass_is_as_high_as_its_top_is_over_the_ground():
    assert form_of_section(section([plane(-0.70, 0.0)]), 0.72).form == "mesh"
    assert form_of_section(section([plane(-0.50, 0.0)]), 0.52).form == ""
    # A verge before it that is higher than the ground under it is not of its plane
    verge = np.column_stack([np.linspace(-0.3, -0.06, 600), np.linspace(-0.66, -0.72, 600)])
    parts = section([plane(-0.85, 0.0)[::4], verge])
    assert form_of_section(parts, 0.95).form == ""
    assert form_of_section(parts, 0.95, above_beside_m=(0.70, 1.10)).form == "mesh"


def test_what_is_seen_on_a_lid_says_nothing_about_the_face():
    """A scanner close by sees much of the lid of a wide barrier."""
    lid = np.column_stack([np.linspace(0.0, 0.28, 700), np.zeros(700)])
    found = form_of_section(section([lid, *concrete()[1:]]), TOP_M)
    assert (found.kind, found.form) == ("barrier", "concrete")


def test_mesh_is_as_thin_as_the_noise_allows():
    rng = np.random.default_rng(7)
    mesh = plane(-0.78, 0.0)
    mesh[:, 0] += rng.normal(0.0, 0.028, len(mesh))
    assert form_of_section(section([mesh]), TOP_M).form == ""
    assert form_of_section(section([mesh]), TOP_M, noise_m=0.03).form == "mesh"


def test_pipes_are_level_where_the_followed_edge_changes_between_them():
    """From the upper to the lower one of two pipes: the line stays on the upper one, and dips where the edge does."""
    pipes = form_of_section(section([pipe(0.0, 0.12), pipe(-0.3, 0.12)]), TOP_M)
    lower = replace(
        pipes, bands=tuple(replace(b, low_m=b.low_m + 0.3, high_m=b.high_m + 0.3) for b in pipes.bands)
    )
    at = np.array([2, 6, 10])
    followed = np.interp(np.arange(14), [0, 2, 4, 10, 13], [0.6, 0.8, 0.8, 0.5, 0.5])
    changing = replace(pipes, is_level=True)
    changing = replace(changing, bands=tuple(replace(b, high_m=b.high_m + 0.1) for b in pipes.bands))
    stretch = form_of_run(at, [pipes, changing, lower], slice(0, 14), followed)
    top = followed + stretch.rise_m - pipes.bands[0].high_m
    assert np.allclose(top[2:], 0.8)
    assert np.allclose(top[:2], followed[:2])


def test_the_top_of_a_fence_is_not_above_its_points():
    """Few points on a high sheet: only those that are counted say how far its edge is above the highest one."""
    rng = np.random.default_rng(1)
    road = np.column_stack([*rng.uniform(0.0, 40.0, (2, 40_000)), rng.normal(0.0, 0.005, 40_000)])
    mesh = np.column_stack(
        [rng.uniform(0.0, 40.0, 1500), rng.normal(20.0, 0.005, 1500), rng.uniform(0.05, 1.3, 1500)]
    )
    tile = TileData("fence", Bounds(-1.0, -1.0, 41.0, 41.0), Points(np.concatenate([road, mesh])))
    (fence,) = Radon(kinds=("fence",)).extract(tile)
    assert fence.form == "mesh"
    assert np.max(fence.xyz[:, 2]) < 1.35
    assert abs(np.median(fence.xyz[:, 2]) - 1.3) < 0.05


def levelled(monkeypatch, letters, first=0):
    """Which windows of a line from the window `first` on are looked at along the road; their numbers on the whole line.

    Windows show two beams ("g") or nothing ("-"); the edge that is followed falls and rises by 0.3 m all along.
    """
    two = tuple(Band(low, low + 0.3, "folded", 0.0, 1.0, 0.0) for low in (-0.3, -0.8))
    show = {"g": SectionForm("guardrail", "thrie_beam", two, hangs=True), "-": NOTHING}
    nodes = np.arange(4 * first, 4 * len(letters))
    x = 0.5 * nodes
    line = np.column_stack([x, np.zeros(len(x)), np.ones(len(x))])
    followed: Any = SimpleNamespace(
        rail=SimpleNamespace(xy=line[:, :2], top_m=line[:, 2], measured=np.ones(len(x), dtype=bool),
                             profile=SimpleNamespace(window=13)),
        xyz=line, height_m=0.8 + 0.15 * (nodes // 6 % 2), above_ground_m=np.ones(len(x)),
    )  # fmt: skip
    seen: list[int] = []

    def told(counts, *_):
        number, is_level = counts
        if is_level:
            seen.append(number)
        return show[letters[number]]

    def sections(nodes, windows, *_):
        # The same window is told by its place; those at the ends are cut off
        is_level = np.ptp(nodes[:, 3]) > 0.0
        middle = [a + 6 if b - a == 13 else (b - 7 if a == 0 else a + 6) for a, b in windows.tolist()]
        return [(int(nodes[i, 0] // 2.0), is_level) for i in middle]

    monkeypatch.setattr(forms, "sections_at", sections)
    monkeypatch.setattr(forms, "_turned", lambda counts, _: counts)
    monkeypatch.setattr(forms, "form_of_section", told)
    monkeypatch.setattr(forms, "above_beside_m", lambda _, xyz: np.zeros((len(xyz), 2)))
    monkeypatch.setattr(forms, "road_noise_m", lambda _, xyz: np.zeros(len(xyz)))
    nowhere: Any = SimpleNamespace(origin=np.zeros(3))
    forms.forms_along(followed, nowhere, nowhere, CircleConfig())
    return seen


def test_what_is_between_rails_does_not_depend_on_where_a_tile_begins(monkeypatch: pytest.MonkeyPatch):
    """Rails far away say nothing, so that all windows have the same neighbours in any tile with a buffer of 12 m."""
    letters = "g" + "-" * 48 + "ggg--gg------ggg" + "-" * 34 + "g"
    whole = levelled(monkeypatch, letters)
    for first in (1, 20, 43):
        assert levelled(monkeypatch, letters, first) == [i for i in whole if i >= first]
    # Windows with a rail near on both sides
    assert whole == [52, 53, *range(56, 62)]
