"""The loops behind the guardrails against slow, obvious twins, compiled and as plain Python."""

import numpy as np
import pytest

from linework.kernels.cells import bins as binning
from linework.kernels.radon import corridor as kernels
from linework.kernels.radon import follow as following
from linework.kernels.radon import sections

CELL_M, N_X, N_Y = 0.5, 12, 8
BOTH = pytest.mark.parametrize("jit", [True, False], ids=["compiled", "python"])


def form_of(kernel, jit):
    return kernel if jit else kernel.py_func


def cloud(seed=1, n=3000):
    """Points of a slab along x at y = 2, some around it: x, y, z, height above road."""
    rng = np.random.default_rng(seed)
    x, y = (
        rng.uniform(0, 6, n),
        np.where(rng.uniform(size=n) < 0.6, rng.normal(2, 0.04, n), rng.uniform(0, 4, n)),
    )
    z = rng.uniform(0, 1.3, n)
    return np.column_stack([x, np.clip(y, 0, 3.99), z, z + rng.normal(0, 0.01, n)])


def binned(points, jit=True):
    """Points by bin, and the bins' starts; every second one first, then the others."""
    index = np.concatenate([np.arange(0, len(points), 2), np.arange(1, len(points), 2)])
    sort = form_of(binning.sort_into_bins, jit)
    return sort(points[:, :3].copy(), points[:, 3].astype(np.float32), index, np.zeros(3), CELL_M, N_X, N_Y)


def turned_into(points, x, y, heading):
    """Along, to the left, z, height of points about a node."""
    d = points[:, :2] - [x, y]
    cos, sin = np.cos(heading), np.sin(heading)
    return np.column_stack([d @ [cos, sin], d @ [-sin, cos], points[:, 2:]])


@BOTH
def test_bins_hold_their_points_in_the_order_they_came(jit):
    came = cloud()
    points, starts = binned(came, jit)
    came = np.concatenate([came[::2], came[1::2]])
    key = (came[:, 1] // CELL_M * N_X + came[:, 0] // CELL_M).astype(int)
    order = np.argsort(key, kind="stable")
    np.testing.assert_array_equal(points[:, :3], came[order, :3])
    np.testing.assert_array_equal(points[:, 3], came[order, 3].astype(np.float32))
    np.testing.assert_array_equal(np.diff(starts), np.bincount(key, minlength=N_X * N_Y))


@BOTH
def test_layers_part_the_points_of_a_bin_by_height(jit):
    points, starts = binned(cloud())
    layered = points.copy()
    slot, floor, layers = form_of(binning.sort_into_layers, jit)(layered, starts)
    assert np.array_equal(slot >= 0, np.diff(starts) > 0)
    for b in np.flatnonzero(slot >= 0):
        own = points[starts[b] : starts[b + 1]]
        number = np.minimum((own[:, 2] - own[:, 2].min()) // binning.BIN_LAYER_M, binning.N_LAYERS - 1)
        order = np.argsort(number, kind="stable")
        np.testing.assert_array_equal(layered[starts[b] : starts[b + 1]], own[order])
        assert floor[slot[b]] == own[:, 2].min()
        bounds = starts[b] + np.searchsorted(number[order], np.arange(binning.N_LAYERS + 1))
        np.testing.assert_array_equal(layers[slot[b]], bounds)


@BOTH
def test_the_nearest_cells_are_counted_in_steps(jit):
    rng = np.random.default_rng(1)
    image = rng.uniform(size=(20, 30)) < 0.02
    steps = form_of(binning.steps_to_set, jit)(image, 5)
    rows, cols = np.nonzero(image)
    r, c = np.indices(image.shape)
    nearest = np.min(np.abs(r[..., None] - rows) + np.abs(c[..., None] - cols), axis=-1)
    np.testing.assert_array_equal(steps, np.minimum(nearest, 6))


@BOTH
@pytest.mark.parametrize("heading", [0.0, 0.7, 2.0, -1.3, np.pi])
@pytest.mark.parametrize("middle", [(3.0, 2.0), (0.1, 0.2), (5.9, 3.9), (7.5, 2.0)])
def test_a_box_gathers_the_points_inside_it(jit, heading, middle):
    points, starts = binned(cloud(2))
    box = kernels.TurnedBox(*middle, np.cos(heading), np.sin(heading), 1.4, 0.45, 0.2, 1.1)
    out = np.empty((len(points), 4))
    n = form_of(kernels.gather_in_box, jit)(points, starts, N_X, N_Y, CELL_M, box, out)
    local = turned_into(points, *middle, heading)
    inside = (np.abs(local[:, 0]) <= 1.4) & (np.abs(local[:, 1]) <= 0.45)
    inside &= (local[:, 3] >= 0.2) & (local[:, 3] <= 1.1)
    assert n == inside.sum()
    np.testing.assert_allclose(by_place(out[:n]), by_place(local[inside]), atol=1e-12)


def by_place(rows):
    return rows[np.lexsort(rows.T)]


@BOTH
@pytest.mark.parametrize("heading", [0.0, 0.7, -2.3])
@pytest.mark.parametrize("level", [(0.3, 0.9), (-5.0, 0.1), (1.25, 9.0), (3.0, 4.0)])
def test_a_box_gathers_the_points_between_two_heights(jit, heading, level):
    points, starts = binned(cloud(2))
    layers = binning.sort_into_layers(points, starts)
    box = kernels.TurnedBox(2.6, 1.9, np.cos(heading), np.sin(heading), 1.4, 0.45, 0.2, 1.1)
    out = np.empty((len(points), 4))
    n = form_of(following.gather_level, jit)(points, layers, (N_X, N_Y, CELL_M), box, level, out)
    local = turned_into(points, 2.6, 1.9, heading)
    inside = (np.abs(local[:, 0]) <= 1.4) & (np.abs(local[:, 1]) <= 0.45)
    inside &= (local[:, 3] >= 0.2) & (local[:, 3] <= 1.1)
    inside &= (local[:, 2] >= level[0]) & (local[:, 2] <= level[1])
    assert n == inside.sum()
    np.testing.assert_allclose(by_place(out[:n]), by_place(local[inside]), atol=1e-12)


def test_a_full_buffer_is_not_overrun():
    points, starts = binned(cloud(3))
    out = np.full((60, 4), np.nan)
    box = kernels.TurnedBox(3.0, 2.0, 1.0, 0.0, 3.0, 2.0, -1.0, 2.0)
    assert 49 <= kernels.gather_in_box(points, starts, N_X, N_Y, CELL_M, box, out[:50]) <= 50
    assert np.isnan(out[50:]).all()


def mean_shift(local, u, radius, low, high):
    """What a circle about `u` comes to rest on."""
    v = local[(local[:, 2] >= low) & (local[:, 2] <= high), 1]
    held = v[:0]
    for _ in range(6):
        held = v[np.abs(v - u) <= radius]
        if not len(held):
            return u, 0, 0.0
        shift = np.mean(held) - u
        u = np.mean(held)
        if abs(shift) < 0.001:
            break
    return u, len(held), np.std(held)


@BOTH
@pytest.mark.parametrize("u", [-0.3, -0.05, 0.0, 0.06, 0.9])
def test_a_circle_settles_on_the_mean_of_what_it_holds(jit, u):
    local = turned_into(cloud(4), 3.0, 2.0, 0.02)
    got = form_of(following.circle_centre, jit)(local, len(local), u, 0.08, 0.4, 0.75)
    np.testing.assert_allclose(got, mean_shift(local, u, 0.08, 0.4, 0.75), atol=1e-12)


@BOTH
def test_a_circle_finds_the_sheet_beside_it_and_nothing_in_the_void(jit):
    rng = np.random.default_rng(5)
    local = np.column_stack(
        [rng.uniform(-1, 1, 400), rng.normal(0.05, 0.01, 400), rng.uniform(0, 1, 400), np.zeros(400)]
    )
    settle = form_of(following.circle_centre, jit)
    u, number, spread = settle(local, 400, 0.0, 0.08, 0.0, 1.0)
    assert (u, spread) == (pytest.approx(0.05, abs=0.003), pytest.approx(0.01, abs=0.002))
    assert number > 395
    assert settle(local, 400, 0.5, 0.08, 0.0, 1.0) == (0.5, 0, 0.0)
    assert settle(local, 0, 0.0, 0.08, 0.0, 1.0)[1] == 0


def slow_top_edge(local, u, half_width, top, reach):
    """Every edge tried one by one."""
    z = local[np.abs(local[:, 1] - u) <= half_width, 2]
    best, edge = 0.0, np.nan
    for i in range(round(2 * reach / 0.02) + 1):
        d = (top - reach + 0.02 * i) - z
        inside = (d >= 0) & (d < 0.30)
        outside = ((d < 0) & (d >= -0.10)) | ((d >= 0.36) & (d < 0.46))
        score = inside.sum() - 3 * outside.sum()
        if score > best:
            best, edge = score, z[inside].max()
    return edge


@BOTH
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_the_top_edge_is_the_best_of_all(jit, seed):
    rng = np.random.default_rng(seed)
    beam = np.column_stack(
        [np.zeros(200), rng.normal(0, 0.02, 200), rng.uniform(0.4, 0.71, 200), np.zeros(200)]
    )
    bush = np.column_stack(
        [np.zeros(40), rng.uniform(-0.1, 0.5, 40), rng.uniform(0.0, 1.2, 40), np.zeros(40)]
    )
    local = np.concatenate([beam, bush])
    got = form_of(sections.top_edge, jit)(local, len(local), 0.0, 0.06, 0.73, 0.08, sections.W_BEAM_EDGE)
    assert got == slow_top_edge(local, 0.0, 0.06, 0.73, 0.08)
    assert got == pytest.approx(0.71, abs=0.03)


@BOTH
def test_a_wall_has_no_top_edge_in_its_middle(jit):
    rng = np.random.default_rng(1)
    local = np.column_stack([np.zeros(4000), np.zeros(4000), rng.uniform(0, 2, 4000), np.zeros(4000)])
    assert np.isnan(form_of(sections.top_edge, jit)(local, 4000, 0.0, 0.06, 1.0, 0.08, sections.W_BEAM_EDGE))
    assert np.isnan(form_of(sections.top_edge, jit)(local, 0, 0.0, 0.06, 1.0, 0.08, sections.W_BEAM_EDGE))


def slow_fit(s, v, weight, half):
    """One weighted least-squares quadratic per node."""
    value, slope, rms, effective = v.copy(), np.zeros(len(s)), np.zeros(len(s)), np.ones(len(s))
    for i in range(len(s)):
        d = (s - s[i]) / half
        w = np.where(np.abs(d) <= 1, weight * (1 - np.minimum(np.abs(d), 1) ** 3) ** 3, 0.0)
        if w.sum() <= 0:
            continue
        basis = np.column_stack([np.ones(len(s)), d, d * d])
        normal = basis.T @ (w[:, None] * basis) + 1e-6 * w.sum() * np.eye(3)
        c = np.linalg.solve(normal, basis.T @ (w * (v - v[i])))
        value[i], slope[i] = v[i] + c[0], c[1] / half
        rms[i] = np.sqrt(np.sum(w * (v - v[i] - basis @ c) ** 2) / w.sum())
        effective[i] = w.sum() ** 2 / np.sum(w**2)
    return value, slope, rms, effective


@BOTH
def test_local_fits_are_weighted_least_squares(jit):
    rng = np.random.default_rng(6)
    s = np.cumsum(rng.uniform(0.3, 0.7, 60))
    v = np.sin(0.2 * s) + rng.normal(0, 0.02, 60)
    weight = np.where(rng.uniform(size=60) < 0.2, 0.0, rng.uniform(0.5, 3, 60))
    for got, expected in zip(
        form_of(sections.fit_locally, jit)(s, v, weight, 3.0), slow_fit(s, v, weight, 3.0), strict=True
    ):
        np.testing.assert_allclose(got, expected, atol=1e-9)


@BOTH
def test_local_fits_keep_parabolas_and_nodes_without_weight(jit):
    s = np.arange(0.0, 20.0, 0.5)
    v = 0.3 + 0.1 * s - 0.02 * s**2
    value, slope, rms, effective = form_of(sections.fit_locally, jit)(s, v, np.ones(len(s)), 3.0)
    np.testing.assert_allclose(value, v, atol=2e-4)  # a ridge of 1e-6 keeps it from exactness
    np.testing.assert_allclose(slope, 0.1 - 0.04 * s, atol=1e-3)
    assert rms.max() < 1e-3
    assert np.all(effective > 3)
    value, slope, *_ = form_of(sections.fit_locally, jit)(s, v, np.zeros(len(s)), 3.0)
    np.testing.assert_array_equal(value, v)
    np.testing.assert_array_equal(slope, 0.0)


def slow_profile(points, node, half_s, radius, reach):
    """Sheet, depth, sides and edge of one node from all points."""
    local = turned_into(points, *node[:3])
    local = local[(np.abs(local[:, 0]) <= half_s) & (np.abs(local[:, 1]) <= reach)]
    u, below, height = local[:, 1], node[3] - local[:, 2], local[:, 3]
    is_near, is_sheet = (
        np.abs(u) <= radius,
        (below > -0.03) & (below < 0.33) & (height >= sections.BEAM_FLOOR_M),
    )
    held = is_near & is_sheet
    sheet = np.array(
        [held.sum(), u[held].mean(), u[held].std(), slow_top_edge(local, 0.0, 0.75 * radius, node[3], 0.06)]
    )
    bins = np.floor((below + sections.DEPTH_ABOVE_M) / sections.DEPTH_BIN_M).astype(int)
    depth, sides = np.zeros((2, sections.DEPTH_BINS)), np.zeros((4, 2))
    for side, on_side in enumerate((u > 0, u <= 0)):
        for b in range(sections.DEPTH_BINS):
            depth[side, b] = np.sum(on_side & is_near & (height >= sections.BEAM_FLOOR_M) & (bins == b))
        apart = on_side & ~is_near
        sides[0, side] = np.sum(apart & is_sheet)
        sides[1, side] = np.sum(apart & (below >= 0.36))
        sides[2, side] = np.sum(apart & (height < 0.12))
        sides[3, side] = np.sum(
            on_side & (np.abs(u) <= 0.40) & (below >= 0.36) & (below <= 0.62) & (height >= 0.12)
        )
    edge = u[is_near & (below >= 0.02) & (below <= 0.10)].mean()
    return sheet, depth, sides, edge


@BOTH
def test_the_profile_counts_what_stands_where(jit):
    points, starts = binned(cloud(7, 20_000))
    nodes = np.array([[2.0, 2.0, 0.0, 0.75], [3.0, 2.02, 0.05, 0.90], [4.0, 1.99, np.pi, 0.60]])
    got = form_of(sections.profile_along, jit)(
        points,
        starts,
        N_X,
        N_Y,
        CELL_M,
        nodes,
        0.25,
        0.10,
        1.0,
        sections.W_BEAM_EDGE,
        np.empty((len(points), 4)),
    )
    for i, node in enumerate(nodes):
        sheet, depth, sides, edge = slow_profile(points, node, 0.25, 0.10, 1.0)
        np.testing.assert_allclose(got[0][i], sheet, atol=1e-9)
        np.testing.assert_array_equal(got[1][i], depth)
        np.testing.assert_array_equal(got[2][i], sides)
        assert got[3][i] == pytest.approx(edge, abs=1e-9)


@BOTH
def test_the_profile_of_nothing_is_empty(jit):
    points, starts = binned(cloud(8))
    nodes = np.array([[100.0, 100.0, 0.0, 0.75]])
    sheet, depth, sides, edge = form_of(sections.profile_along, jit)(
        points, starts, N_X, N_Y, CELL_M, nodes, 0.25, 0.10, 1.0, sections.W_BEAM_EDGE, np.empty((50, 4))
    )
    assert sheet[0, 0] == 0
    assert np.isnan(sheet[0, 3])
    assert np.isnan(edge[0])
    assert depth.sum() == sides.sum() == 0
