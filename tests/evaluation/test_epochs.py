"""Changes between epochs: what was changed is found, what was only measured again is not, hidden places are said."""

import numpy as np
import pyogrio
import pytest
import shapely

import linework.evaluation.changes.registration as registration_of
from linework.crs import parse_crs
from linework.errors import CrsError
from linework.evaluation.changes.epochs import compare_epochs
from linework.evaluation.shifts import Chance, filters_of, shifted_runs
from linework.files.vectors.read_write import write_lines
from linework.lines.along import line_stretch
from linework.model.lines import LineSet

S = np.arange(0.0, 1000.1, 2.0)
TABLE = {"edge": ("lane_marking", 3.5), "middle": ("lane_marking", 0.0), "other": ("lane_marking", -3.5),
         "kerb": ("road_boundary", 4.2), "verge": ("road_boundary", -4.2), "rail": ("guardrail", 5.5)}  # fmt: skip
SIGMA_XY, SIGMA_Z = 0.008, 0.01


def epoch(seed, table=TABLE, moved=None, hidden=None, drift_m=0.05, related_m=40.0):
    """Return a survey of a road of 1 km: slow errors of navigation, an error per line, and changes.

    `moved` has distances across and up by line and stretch; `hidden` are bridged stretches.
    """
    rng = np.random.default_rng(seed)
    phase = rng.uniform(0, 2 * np.pi, 3)
    shapes, bridged = [], []
    for name, (_, offset) in table.items():
        heading = 0.3 * np.sin(S / 300)
        x, y = np.cumsum(2.0 * np.cos(heading)), np.cumsum(2.0 * np.sin(heading))
        left = np.column_stack([-np.sin(heading), np.cos(heading)])
        away, up = np.full(len(S), offset), 0.01 * S
        # The same error over some metres, or tens of them, as navigation and calibration leave it
        knots = rng.normal(0, 1, (2, int(S[-1] / related_m) + 2))
        wave = [np.interp(S, np.arange(knots.shape[1]) * related_m, k) for k in knots]
        away, up = away + SIGMA_XY * wave[0], up + SIGMA_Z * wave[1]
        for a, b, across, rise in (moved or {}).get(name, ()):
            inside = (a <= S) & (b >= S)
            away, up = away + across * inside, up + rise * inside
        drift = drift_m * np.sin(S[:, None] / 400 + phase)
        shapes.append(np.column_stack([np.column_stack([x, y]) + away[:, None] * left, up]) + drift)
        bridged.append(np.any([(a <= S) & (b >= S) for a, b in (hidden or {}).get(name, ((9, 0),))], axis=0))
    n = len(S) * len(table)
    return LineSet.from_lines(shapes, kind=[v[0] for v in table.values()], id=list(table), bridged=np.concatenate(bridged),
                              pattern=["solid" if v[0] == "lane_marking" else "" for v in table.values()],
                              sigma_xy_m=np.full(n, SIGMA_XY), sigma_z_m=np.full(n, SIGMA_Z), crs="EPSG:25832")  # fmt: skip


def found(old, new, status):
    return [c for c in compare_epochs(old, new)[0] if c.status == status]


def test_two_surveys_of_an_unchanged_road_differ_by_at_most_one_place_per_km():
    n = [len(compare_epochs(epoch(seed), epoch(100 + seed))[0]) for seed in range(10)]
    assert np.mean(n) <= 1.0, n


def test_the_only_marking_of_a_road_does_not_pass_its_own_move_for_chance():
    """Half of it lies 28 cm beside where it was: its differences are not what those of markings are by chance."""
    table = {name: TABLE[name] for name in ("middle", "kerb", "verge", "rail")}
    n_false = 0
    for seed in range(1, 5):
        new = epoch(100 + seed, table, moved={"middle": [(500, 1000, 0.28, 0.0)]})
        changes = found(epoch(seed, table), new, "moved")
        (middle,) = [c for c in changes if str(c.line.id[0]) == "middle"]
        assert middle.across_m == pytest.approx(0.28, abs=0.02)
        assert middle.from_m == pytest.approx(500.0, abs=10.0) and middle.to_m > 980.0
        n_false += len(changes) - 1
    assert n_false <= 4


def test_lines_are_sorted_into_trees_once_however_many_they_are(monkeypatch):
    made = []
    tree = shapely.STRtree
    monkeypatch.setattr(shapely, "STRtree", lambda shapes: made.append(len(shapes)) or tree(shapes))
    few, many = {k: TABLE[k] for k in ("edge", "kerb")}, TABLE
    counts = []
    for table in (few, many):
        made.clear()
        compare_epochs(epoch(1, table), epoch(2, table))
        counts.append(sum(n > 300 for n in made))
    assert counts[0] == counts[1], counts


def test_edges_beside_boundaries_and_poles_are_not_compared():
    old, new = epoch(1), epoch(1)
    xyz = old[0].xyz
    pole = np.array([xyz[9], xyz[9] + [0.0, 0.0, 8.0]])
    more = LineSet.from_lines([xyz, pole], kind=["edge_other", "pole"], crs="EPSG:25832")
    assert compare_epochs(LineSet.concatenate([old, more]), new)[0] == []
    assert compare_epochs(old, LineSet.concatenate([new, more]))[0] == []


def test_pipes_one_above_another_are_told_apart_by_their_heights():
    def pipes(seed, names, raised_m=0.0):
        moved = {n: [(0, 1000, 0, float(n))] for n in names}
        moved["0.8"].append((400, 600, 0, raised_m))
        return epoch(seed, {**TABLE, **dict.fromkeys(names, ("guardrail", 6.5))}, moved).with_columns(
            form="tube"
        )

    (raised,) = found(pipes(1, ("0.4", "0.8")), pipes(2, ("0.8", "0.4"), 0.15), "moved")
    assert (raised.line.id[0], raised.up_m) == ("0.8", pytest.approx(0.15, abs=0.03))
    assert (raised.from_m, raised.to_m) == pytest.approx((400, 600), abs=10)


def test_the_registration_is_that_of_the_navigation():
    old, new = epoch(1), epoch(2)
    _, registration = compare_epochs(old, new)
    inside = registration.n_lines == 6
    assert inside.sum() >= 9
    # Mean difference of all lines: errors of lines are averaged over six of them
    shift = new.xyz.reshape(6, -1, 3).mean(axis=0) - old.xyz.reshape(6, -1, 3).mean(axis=0)
    middle = (registration.cells + 0.5) * 25.0
    at = [int(np.argmin(np.hypot(*(old.xyz[: len(S), :2] - m).T))) for m in middle]
    assert np.median(np.abs(registration.shift_m[:, 2] - shift[at, 2])[inside]) < 0.01
    assert np.median(registration.sigma_m[:, 0]) < 0.01


def test_of_two_lines_the_one_that_moved_is_told_by_where_both_agree_before():
    x = np.arange(0.0, 400.1, 2.0)

    def two_lines(move_m, seed):
        rng = np.random.default_rng(seed)
        marking = np.where(x > 200.0, move_m, 0.0)
        rows = [
            np.column_stack([x, y + 0.005 * rng.normal(size=len(x)), 0.0 * x]) for y in (-3.0, 3.0 + marking)
        ]
        return LineSet.from_lines(
            rows, kind=["road_boundary", "lane_marking"], id=["kerb", "marking"], sigma_xy_m=0.015, sigma_z_m=0.015,
            confidence=0.98,
        )  # fmt: skip

    changes, registration = compare_epochs(two_lines(0.0, 1), two_lines(-0.28, 2))
    moved = [c for c in changes if c.status == "moved"]
    assert {c.line.id[0] for c in moved} == {"marking"}
    assert sum(c.length_m for c in moved) > 180.0
    # Half-way between both is 14 cm from either: the shift is known better, from the cells before it
    near = registration.cells[:, 0] * 25.0 < 300.0
    assert np.abs(registration.shift_m[:, 1]).max() < 0.02
    assert registration.sigma_m[near, 0].max() < 0.08


def test_a_street_tells_nothing_of_shifts_along_itself():
    cells = np.array([[k, 0] for k in range(8)] + [[8, k] for k in range(8)])
    across = np.array([[0.0, 1.0]] * 8 + [[1.0, 0.0]] * 8)
    own = np.where(np.arange(16) < 8, 0.01, 0.2)
    known = registration_of._known_from_beside(own, cells, across)
    assert np.array_equal(known, own)
    # Nor of what does not hang together with it
    apart = np.where(np.arange(16)[:, None] < 8, cells, cells + 3)
    known = registration_of._known_from_beside(own, apart, np.tile([0.0, 1.0], (16, 1)))
    assert np.array_equal(known, own)


@pytest.mark.parametrize("seed", range(4))
def test_a_moved_kerb_and_a_raised_rail_are_found(seed):
    moved = {"kerb": [(200, 300, -0.08, 0.0)], "rail": [(500, 700, 0.0, 0.08)]}
    changes = found(epoch(seed), epoch(50 + seed, moved=moved), "moved")
    kerb = [c for c in changes if c.line.id[0] == "kerb"]
    assert 80 <= sum(c.length_m for c in kerb) <= 130
    assert abs(np.average([c.across_m for c in kerb], weights=[c.length_m for c in kerb]) + 0.08) < 0.02
    rail = [c for c in changes if c.line.id[0] == "rail"]
    assert 170 <= sum(c.length_m for c in rail) <= 230
    assert abs(np.average([c.up_m for c in rail], weights=[c.length_m for c in rail]) - 0.08) < 0.02
    assert len(changes) - len(kerb) - len(rail) <= 1
    assert all(0.008 < c.sigma_across_m < 0.03 for c in changes)


@pytest.mark.parametrize("related_m", [10.0, 40.0])
def test_shifts_of_two_deviations_are_found(related_m):
    """Evidence adds up over the stations of a stretch and its ends, as far as these are independent."""
    n_found, n_false, names = 0, 0, list(TABLE)
    for seed in range(8):
        name, start = names[seed % 6], 100.0 + 90.0 * seed
        size = (-1) ** seed * 2.0 * np.hypot(SIGMA_XY, SIGMA_XY)
        new = epoch(300 + seed, moved={name: [(start, start + 100.0, size, 0.0)]}, related_m=related_m)
        changes = compare_epochs(epoch(200 + seed, related_m=related_m), new)[0]
        own = [c for c in changes if c.line.id[0] == name and c.from_m < start + 100.0 and c.to_m > start]
        n_found += sum(c.length_m for c in own) >= 30.0
        n_false += len(changes) - len(own)
    assert n_found == 8
    assert n_false <= 8


def test_evidence_for_a_shift_is_that_of_generalised_least_squares():
    n, filters = 23, filters_of(np.array([0.9, 0.7, 0.5, 0.2]), 500)
    whitening = np.zeros((n, n))
    for i in range(n):
        for lag in range(min(i, 4) + 1):
            whitening[i, i - lag] = filters[min(i, 4), lag]
    precision = whitening.T @ whitening
    values = np.random.default_rng(1).normal(size=n)
    best = (0.0, -1, -1)
    for a in range(n):
        for b in range(a, n):
            run = np.zeros(n)
            run[a : b + 1] = 1.0
            best = max(best, (abs(run @ precision @ values) / np.sqrt(run @ precision @ run), a, b))
    assert shifted_runs(values, Chance(1.0, filters), best[0] - 1e-6)[:1] == [best[1:]]
    assert shifted_runs(values, Chance(1.0, filters), best[0] + 1e-6) == []


def with_dashes(lines, missing=()):
    """Return lines with the dashes of "middle", 3 m every 9 m, but for those that begin within stretches."""
    lines = lines.with_columns(pattern=np.where(lines.id == "middle", "dashed", lines.pattern))
    middle = lines.take(lines.id == "middle")
    starts = [s for s in np.arange(6.0, 980.0, 9.0) if not any(a <= s <= b for a, b in missing)]
    dashes = [
        line_stretch(middle, s, s + 3.0).with_columns(kind=["lane_marking_dash"], id=[f"d{s:.0f}"])
        for s in starts
    ]
    return LineSet.concatenate([lines, *dashes])


def test_dashes_that_are_worn_away_or_painted_are_found():
    old, new = with_dashes(epoch(21), [(500, 520)]), with_dashes(epoch(22), [(300, 330), (700, 704)])
    changes = found(old, new, "changed")
    assert [c.what for c in changes] == ["4 dashes gone", "3 dashes new"]
    assert all(c.line.id[0] == "middle" for c in changes)
    assert abs(changes[0].from_m - 303) < 4 and abs(changes[1].from_m - 500) < 6
    # Where the marking was hidden, nothing is known of its dashes
    hidden = with_dashes(epoch(22, hidden={"middle": [(280, 350)]}), [(300, 330)])
    assert not list(found(with_dashes(epoch(21)), hidden, "changed"))


def test_another_height_of_a_rail_is_a_change():
    heights = np.array([np.nan] * 5 + [0.75])
    old = epoch(31).with_columns(height_m=heights)
    (change,) = found(old, epoch(32).with_columns(height_m=heights - 0.10), "changed")
    assert change.what == "height 0.75 to 0.65 m" and change.line.id[0] == "rail"
    assert not found(old, epoch(33).with_columns(height_m=heights - 0.02), "changed")


def test_a_height_that_stayed_is_no_change():
    old = LineSet.from_lines([straight_line(0.0, 100.0)], kind="kerb_top", height_m=[0.10], sigma_z_m=0.005)
    ends = ((0.0, 30.0, 0.25), (30.0, 60.0, 0.10), (60.0, 100.0, 0.25))
    new = LineSet.from_lines(
        [straight_line(a, b) for a, b, _ in ends],
        kind="kerb_top",
        height_m=[h for *_, h in ends],
        sigma_z_m=0.005,
    )
    changes = [c for c in compare_epochs(old, new)[0] if c.status == "changed"]
    assert [(round(c.from_m, -1), round(c.to_m, -1)) for c in changes] == [(0.0, 30.0), (60.0, 100.0)]


def straight_line(start, end):
    x = np.arange(start, end + 0.1, 2.0)
    return np.column_stack([x, np.zeros(len(x)), np.zeros(len(x))])


def test_new_and_gone_lines_are_found():
    table = {**{k: v for k, v in TABLE.items() if k != "other"}, "fence": ("fence", -6.0)}
    changes = [c for c in compare_epochs(epoch(3), epoch(4, table))[0] if c.length_m > 30]
    assert {(c.status, str(c.line.kind[0])) for c in changes} == {("gone", "lane_marking"), ("new", "fence")}
    assert all(c.length_m > 950 for c in changes)


def test_hidden_places_are_said_and_not_gone():
    old = epoch(5)
    changes = compare_epochs(old, epoch(6, hidden={"rail": [(400, 480)]}))[0]
    rail = [c for c in changes if c.line.id[0] == "rail" and c.status != "moved"]
    assert [c.status for c in rail] == ["not visible"] and 75 <= rail[0].length_m <= 90
    assert abs(rail[0].from_m - 400) < 20 and abs(rail[0].to_m - 480) < 20
    # Where the new survey has nothing at all, nothing is gone
    new = epoch(7)
    half = LineSet.concatenate([line_stretch(new.take([i]), 0.0, 600.0) for i in range(6)])
    changes = compare_epochs(old, half)[0]
    assert not [c for c in changes if c.status == "gone" and c.length_m > 12]
    assert sum(c.length_m for c in changes if c.status == "not visible") > 6 * 380


def test_another_pattern_is_a_change():
    new = epoch(9).with_columns(pattern=["solid", "dashed", "solid", "", "", ""])
    (change,) = found(epoch(8), new, "changed")
    assert (
        change.what == "pattern solid to dashed" and change.line.id[0] == "middle" and change.length_m > 950
    )


def test_nothing_compared_with_nothing():
    assert compare_epochs(LineSet.empty(), LineSet.empty())[0] == []
    old = epoch(1)
    changes, registration = compare_epochs(old, LineSet.empty(old.crs))
    assert {c.status for c in changes} == {"not visible"} and len(registration.cells) == 0
    # What was not surveyed before may have been there
    changes = compare_epochs(LineSet.empty(old.crs), old)[0]
    assert {(c.status, c.what) for c in changes} == {("not visible", "in the old survey")}
    with pytest.raises(CrsError, match="two different CRSs"):
        compare_epochs(old, old.with_columns(crs=parse_crs("EPSG:25833")))


def test_the_command_writes_the_changes(linework, tmp_path):
    write_lines(epoch(1), tmp_path / "old.gpkg")
    write_lines(epoch(2, moved={"kerb": [(200, 300, -0.1, 0.0)]}), tmp_path / "new.gpkg")
    for suffix in ("gpkg", "csv", "xlsx"):
        done = linework(
            "compare", tmp_path / "old.gpkg", tmp_path / "new.gpkg", "-o", tmp_path / f"c.{suffix}"
        )
        assert done.code == 0, done.stderr
        assert "moved        road_boundary" in done.stdout and "registered in " in done.stdout
    rows = (tmp_path / "c.csv").read_text().splitlines()
    assert rows[0].startswith("status,kind,line,length_m,across_m") and any(
        r.startswith("moved,road_boundary,kerb,") for r in rows
    )
    assert pyogrio.read_info(tmp_path / "c.gpkg", layer="change")["features"] == len(rows) - 1
    page = tmp_path / "c.html"
    done = linework(
        "compare", tmp_path / "old.gpkg", tmp_path / "new.gpkg", "-o", tmp_path / "r.csv", "--report", page
    )
    assert done.code == 0, done.stderr
    text = page.read_text()
    assert text.count("data:image/png;base64,") == 3
    assert "By line and station" in text and "<td>kerb</td><td>road_boundary</td><td>moved</td>" in text
    assert "http" not in text.replace("http-equiv", "")
    done = linework(
        "compare", tmp_path / "old.gpkg", tmp_path / "new.gpkg", "-o", tmp_path / "s.csv", "--report", "p.pdf"
    )
    assert done.code == 2 and not (tmp_path / "s.csv").exists()
    done = linework("compare", tmp_path / "old.gpkg", tmp_path / "old.gpkg", "-o", tmp_path / "none.gpkg")
    assert done.code == 0 and "0 changes" in done.stdout
    assert (
        linework("compare", tmp_path / "old.gpkg", tmp_path / "new.gpkg", "-o", tmp_path / "c.pdf").code == 2
    )


def test_a_kerb_that_moved_behind_parked_cars_is_one_move():
    """Places that one survey could not see between others that have moved are no ends of the move."""
    hidden = {"kerb": [(a, a + 6.0) for a in range(520, 800, 40)]}
    changes = found(epoch(41), epoch(42, moved={"kerb": [(500, 800, -0.28, 0.0)]}, hidden=hidden), "moved")
    assert [c.line.id[0] for c in changes] == ["kerb"]
    assert changes[0].length_m == pytest.approx(300, abs=15)
    assert changes[0].across_m == pytest.approx(-0.28, abs=0.03)
