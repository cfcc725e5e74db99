"""Own peak finder, paint, ground and method: the same lines in one tile and many, in workers, after kill and resume."""

import functools
import importlib
import itertools
import subprocess
import sys
import textwrap
import threading
import time
from types import SimpleNamespace

import numpy as np
import pytest
import shapely
from tests.laws.test_obb_splitting import assert_same, write_survey
from tests.scenes.places import ROOT

from linework.errors import OwnCodeError, UsageError
from linework.files.vectors.read_write import read_lines
from linework.methods.choose import choose_methods, selected_methods
from linework.methods.obb.method import Obb
from linework.methods.protocol import Method, extract_tile, tile_of
from linework.methods.radon.method import Radon
from linework.methods.radon.peaks import Peaks, find_peaks
from linework.model.grid import Grid
from linework.model.ground import Ground
from linework.model.lines import LineSet
from linework.model.points import Points
from linework.processes.executors import Serial
from linework.processes.identity import identity_of
from linework.processes.pool import Processes
from linework.runs.extract import extraction_request
from linework.runs.find import find_lines
from linework.runs.opened.from_points import opened_points
from linework.runs.opened.work_folder import work_folder
from linework.runs.own import check_own_code, sent_method
from linework.runs.resume import run_folder
from linework.runs.settings import RunSettings, TilingConfig
from linework.simulation.simulate import simulate_survey

MANY = TilingConfig(core_m=64.0, high_core_m=64.0, max_points=10_000)
ONE = TilingConfig(max_points=10**9)
PAINT = ("lane_marking", "lane_marking_dash", "road_marking_other")


def only_strong(values, angles_rad, rho_m, *, threshold, theta_window_rad, rho_window_m):
    """Return the peaks of half a metre more, as plain arrays, the weakest first."""
    windows = {"theta_window_rad": theta_window_rad, "rho_window_m": rho_window_m}
    peaks = find_peaks(values, angles_rad, rho_m, threshold=threshold + 0.5, **windows)
    return peaks.theta_rad[::-1], peaks.rho_m[::-1], peaks.strength_m[::-1]


def brightness(points):
    """Return the probability of paint from the intensity over the level of road in cells of 2 m."""
    cell = np.unique(np.floor(points.xyz[:, :2] / 2.0), axis=0, return_inverse=True)[1].ravel()
    order = np.argsort(cell, kind="stable")
    parts = np.split(order, np.flatnonzero(np.diff(cell[order])) + 1)
    level = np.empty(len(points))
    for part in parts:
        level[part] = np.quantile(points.intensity[part], 0.4)
    return 1.0 / (1.0 + np.exp(-8.0 * (points.intensity / level - 1.3)))


def bright_among_all(points):
    """Return brightness less a little that depends on every point that is given."""
    assert np.abs(points["above_road_m"]).max() <= 1.0
    return brightness(points) * (1.0 - 1e-3 * np.mean(points.intensity) / points.intensity.max())


def lowest_of_cells(points, trajectory):
    """Return the lowest point of every cell of 1 m as the ground, near the path as the road."""
    grid = Grid.covering(points.bounds, 1.0)
    rows, cols = (np.floor(v).astype(int).clip(0, n - 1)
                  for v, n in zip(grid.to_cell(points.xyz[:, :2]), grid.shape, strict=True))  # fmt: skip
    low = np.full(grid.shape, np.inf)
    np.minimum.at(low, (rows, cols), points.xyz[:, 2])
    at = grid.to_world(*np.divmod(np.arange(low.size), grid.n_cols)) + np.array([0.5, -0.5])
    away = shapely.distance(shapely.points(at), shapely.LineString(trajectory.xyz[:, :2])).reshape(low.shape)
    return Ground.from_heights(np.where(np.isfinite(low), low, np.nan), grid, is_road=away < 6.0)


class Trail(Method):
    """The path of the van as a line of an own kind."""

    name = "trail"
    kinds = ("trail",)

    def look(self, piece):
        return LineSet.from_lines([piece.trajectory.xyz], kind=["trail"])


CASES = {
    "peaks": ("bends", {"methods": selected_methods(Radon(find_peaks=only_strong))}),
    "paint": ("urban", {"methods": [Obb(kinds=PAINT, paint=bright_among_all)]}),
    "column": ("urban", {"methods": [Obb(kinds=PAINT, paint="p_paint")]}),
    "ground": ("urban", {"methods": [Obb(kinds=PAINT)], "ground": lowest_of_cells}),
    "method": ("bends", {"methods": [Trail()]}),
}
_number = itertools.count()
LOCK = threading.Lock()


@pytest.fixture(scope="module")
def surveys():
    found = {}
    for name, density in (("bends", 900.0), ("urban", 2000.0)):
        made = simulate_survey(name, 612, 80.0, points_per_m=density)
        p = made.points
        bright = brightness(p)
        points = Points(p.xyz, intensity=p.intensity, time_s=p.time_s, crs=made.crs, p_paint=bright)
        found[name] = points, made.trajectory
    return found


@pytest.fixture(scope="module")
def workers():
    with Processes(2, modules=("linework.runs.tasks",)) as processes:
        yield processes


@pytest.fixture
def found_in(surveys, tmp_path):
    """Extract a case in some tiling and executor."""

    def run(case, tiling, executor=None):
        name, given = CASES[case]
        points, trajectory = surveys[name]
        work = work_folder(tmp_path, tmp_path / f"{next(_number)}")
        with (
            opened_points(points, work, trajectory=trajectory) as recordings,
            run_folder(work, work / "lines", {}) as folder,
        ):
            settings = RunSettings(tiling=tiling)
            found = find_lines(recordings, run=folder, settings=settings, executor=executor, **given)
        assert not found.failures
        return found

    return run


@pytest.mark.parametrize("case", CASES)
def test_tiles_and_workers_change_nothing(found_in, workers, case):
    many = found_in(case, MANY)
    assert len(many.tiles) > 1
    assert len(many.lines) > 0
    assert_same(many.lines, found_in(case, MANY, workers).lines)
    one = found_in(case, ONE)
    assert len(one.tiles) == len(CASES[case][1]["methods"])
    if case in ("paint", "column", "ground"):
        assert_same(many.lines, one.lines)
    else:  # lines that are cut at the edges of tiles have a vertex there
        assert many.lines.kind.tolist() == one.lines.kind.tolist()
        for i in range(len(one.lines)):
            a, b = shapely.LineString(many.lines[i].xyz), shapely.LineString(one.lines[i].xyz)
            assert shapely.hausdorff_distance(a, b, densify=0.01) < 0.01


def test_own_code_is_what_finds_the_lines(found_in, surveys):
    points, trajectory = surveys["urban"]
    usual = extract_tile(Obb(kinds=PAINT), tile_of(points, trajectory))
    for case in ("paint", "column"):
        own = found_in(case, ONE).lines
        assert own.length_m.sum() > 0.7 * usual.length_m.sum()
        assert not np.array_equal(own.xyz[:5], usual.xyz[:5])
    nothing = extract_tile(
        Obb(kinds=PAINT, paint=lambda near: np.zeros(len(near))), tile_of(points, trajectory)
    )
    assert len(nothing) == 0
    points, trajectory = surveys["bends"]
    tile = tile_of(points, trajectory)
    assert len(extract_tile(Radon(find_peaks=lambda *_, **__: (np.zeros(0),) * 3), tile)) == 0
    same = extract_tile(Radon(find_peaks=find_peaks), tile)
    assert_same(same, extract_tile(Radon(), tile))


def test_own_kinds_have_layers_after_those_of_linework(found_in):
    found = found_in("method", ONE)
    assert found.kinds == ("trail",)
    assert found.lines.kind.tolist() == found.lines.method.tolist() == ["trail"]
    assert found.lines.id[0].startswith("trail-")


def test_an_own_ground_is_the_ground_of_the_methods(found_in, surveys):
    points, trajectory = surveys["urban"]
    whole = lowest_of_cells(points, trajectory)
    tile = tile_of(points, trajectory, whole)
    in_one = extract_tile(Obb(kinds=PAINT), tile)
    assert in_one.length_m.sum() == pytest.approx(found_in("ground", ONE).lines.length_m.sum(), rel=0.1)


# Refusals


@pytest.mark.parametrize(
    ("methods", "ground", "where"),
    [
        ([Radon(find_peaks=lambda *_, **__: LOCK)], None, "find_peaks"),
        ([Obb(paint=lambda points: LOCK)], None, "paint"),
        ([Trail()], lambda points, path: LOCK, "ground"),
    ],
)
def test_what_cannot_be_sent_is_refused_before_any_work(methods, ground, where):
    with pytest.raises(
        UsageError, match=rf"^{where}: cannot be sent to worker processes: cannot pickle .*lock"
    ):
        check_own_code(selected_methods(methods), ground)


def test_an_own_method_that_cannot_be_sent_is_refused():
    method = Trail()
    method.lock = LOCK
    with pytest.raises(
        UsageError, match=r"^methods: cannot be sent to worker processes: cannot pickle .*lock"
    ):
        check_own_code([method])


@pytest.mark.parametrize(
    ("own", "message"),
    [
        (lambda values, *_, **__: 1 / 0, r"^find_peaks: ZeroDivisionError: .* \(test_own_code\.py, line \d+, in <lambda>\)"),
        (lambda values, *_, **__: values, r"^find_peaks: returned"),
        (lambda *_, **__: None, r"^find_peaks: returned NoneType, expected Peaks or three arrays"),
        (lambda *_, **__: ([0.0], [0.0, 1.0], [3.0]), r"^find_peaks: returned arrays of shapes"),
        (lambda *_, **__: Peaks(*np.array([[90.0], [0.0], [9.0]])), r"^find_peaks: returned angles outside"),
    ],
)  # fmt: skip
def test_wrong_peaks_are_named(surveys, own, message):
    points, trajectory = surveys["bends"]
    with pytest.raises(OwnCodeError, match=message):
        extract_tile(Radon(find_peaks=own), tile_of(points, trajectory))


@pytest.mark.parametrize(
    ("own", "message"),
    [
        (lambda points: points["no"], r"^paint: KeyError: .*\(test_own_code\.py, line \d+, in <lambda>\)"),
        (lambda points: points.intensity, r"^paint: what it returned has values from .*, expected probabilities"),
        (lambda points: points.intensity[1:], r"^paint: returned an array of shape"),
        ("p_wet", r"^paint: the points have no column 'p_wet'; further columns: p_paint\. Read it .* carry="),
    ],
)  # fmt: skip
def test_wrong_evidence_of_paint_is_named(surveys, own, message):
    points, trajectory = surveys["urban"]
    with pytest.raises((OwnCodeError, UsageError), match=message):
        extract_tile(Obb(kinds=PAINT, paint=own), tile_of(points, trajectory))


def test_a_ground_that_fails_ends_the_run(surveys, tmp_path):
    points, trajectory = surveys["urban"]
    with (
        opened_points(points, tmp_path, trajectory=trajectory) as recordings,
        run_folder(tmp_path, tmp_path / "lines", {}) as folder,
    ):
        with pytest.raises(OwnCodeError, match=r"^ground: TypeError: no heights \(test_own_code") as caught:
            find_lines(recordings, [Trail()], folder, ground=fails, executor=Serial())
        assert 'raise TypeError("no heights")' in caught.value.__notes__[0]
        with pytest.raises(OwnCodeError, match=r"^ground: returned NoneType, expected a linework\.Ground"):
            find_lines(recordings, [Trail()], folder, ground=lambda points, path: None)


def fails(points, trajectory):
    raise TypeError("no heights")


def test_methods_are_checked():
    for wrong, message in (
        ([Radon], "methods: Radon is a class"),
        ([3], "methods: int is not a method"),
        ([], "methods: no method is given"),
    ):
        with pytest.raises(UsageError, match=message):
            selected_methods(wrong)
    with pytest.raises(UsageError, match="kinds: no method finds cable"):
        selected_methods([Trail()], ["cable"])
    letters = type("Letters", (Trail,), {"kinds": "trail"})
    with pytest.raises(UsageError, match="kinds of 'trail' are 'trail', expected names"):
        selected_methods(letters())
    with pytest.raises(UsageError, match="paint: nothing that is looked for is paint"):
        choose_methods("auto", ("cable",), paint="p_paint")


def test_an_own_method_may_return_its_own_kinds_only(surveys):
    points, trajectory = surveys["bends"]
    other = type("Other", (Trail,), {"kinds": ("ridge",)})
    with pytest.raises(OwnCodeError, match="trail: look returned lines of kind 'trail'"):
        extract_tile(other(), tile_of(points, trajectory))


def test_a_kind_is_found_once():
    for twice in ([Trail(), Trail()], [Obb(), Obb()]):
        with pytest.raises(UsageError, match=r"methods: .* both find .* in points"):
            selected_methods(twice)


def test_own_code_of_a_radon_is_kept():
    own = type("OwnRadon", (Radon,), {"look": lambda self, piece: LineSet.from_lines([])})()
    assert selected_methods(own) == (own,)


def test_a_method_is_sent_as_it_is_now():
    method = Trail()
    for height in (1.0, 2.0):
        method.height = height
        assert sent_method(method).load().height == height


# Identity


def test_identity_is_that_of_code_and_values_not_of_the_object():
    def finder(limit):
        return lambda *arrays: only_strong(*arrays, threshold=limit)

    assert identity_of(finder(1.0)) == identity_of(finder(1.0))
    assert identity_of(finder(1.0)) != identity_of(finder(2.0))
    weights = np.arange(3.0)
    network = type("Network", (), {"__init__": lambda self, w: setattr(self, "w", w)})
    assert identity_of(network(weights)) == identity_of(network(weights.copy()))
    assert identity_of(network(weights)) != identity_of(network(weights + 1))
    assert identity_of(Radon()) == identity_of(Radon())
    assert identity_of(Radon(find_peaks=finder(1.0))) != identity_of(Radon())


def test_identity_follows_modules_and_cached_functions(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(tmp_path)
    file = tmp_path / "plane_of_test.py"
    file.write_text("def plane(): return 1")
    module = importlib.import_module("plane_of_test")
    own = eval("lambda: plane_of_test.plane()", {"plane_of_test": module})
    before = identity_of(own)
    file.write_text("def plane(): return 2")
    assert identity_of(own) != before
    one, other = (functools.lru_cache(eval(f"lambda: {n}")) for n in (1, 2))
    assert identity_of(one) != identity_of(other)


SCRIPT = """
    import sys
    from pathlib import Path
    import numpy as np
    from linework.files.survey.open import open_survey
    from linework.methods.obb.method import Obb
    from linework.methods.protocol import Method
    from linework.model.ground import Ground
    from linework.model.grid import Grid
    from linework.model.lines import LineSet
    from linework.processes.pool import Processes
    from linework.runs.extract import extract_to, extraction_request
    from linework.runs.opened.recordings import opened_recordings
    from linework.runs.opened.work_folder import work_folder
    from linework.runs.settings import RunSettings, TilingConfig
    from linework.runs.steps import RunSteps

    LEVELS = {0.9, 0.5, 0.1}

    def level_of(points):
        return np.quantile(points.intensity, max(LEVELS))

    def paint(points):
        return points.intensity > level_of(points) * FACTOR

    def ground(points, trajectory):
        grid = Grid.covering(points.bounds, 2.0)
        return Ground.from_heights(np.full(grid.shape, np.quantile(points.xyz[:, 2], 0.2)), grid)

    class Trail(Method):
        name, kinds = "trail", ("trail",)
        def look(self, piece):
            return LineSet.from_lines([piece.trajectory.xyz], kind=["trail"])

    out = Path(sys.argv[2])
    work = work_folder(out, out / "work")
    survey = open_survey([Path(sys.argv[1])])
    with opened_recordings(survey, work) as recordings, Processes(2) as executor:
        settings = RunSettings(tiling=TilingConfig(core_m=64.0, max_points=10_000))
        methods = [Obb(kinds=("lane_marking",), paint=paint), Trail()]
        order = extraction_request(
            out / "lines.gpkg", recordings.survey, ("lane_marking",), "auto", settings,
            methods=methods, ground=ground, resume="--resume" in sys.argv,
        )
        extract_to(order, recordings, work, executor, RunSteps())
"""


def test_a_killed_run_with_own_code_is_resumed_to_the_same_lines(surveys, tmp_path):
    points, trajectory = surveys["urban"]
    write_survey(SimpleNamespace(points=points, trajectory=trajectory, crs=points.crs), tmp_path / "survey")
    text = textwrap.dedent(SCRIPT)
    for name, factor in (("same.py", "1.0"), ("other.py", "1.25")):
        (tmp_path / name).write_text(f"FACTOR = {factor}\n{text}")

    def command(script, out, *more):
        out.mkdir(exist_ok=True)
        return [sys.executable, str(tmp_path / script), str(tmp_path / "survey"), str(out), *more]

    def run(script, out, *more):
        return subprocess.run(command(script, out, *more), capture_output=True, text=True, cwd=ROOT)

    undisturbed = run("same.py", tmp_path / "one")
    assert undisturbed.returncode == 0, undisturbed.stderr
    with subprocess.Popen(command("same.py", tmp_path / "two"), stderr=subprocess.DEVNULL) as process:
        killed = False
        while process.poll() is None:
            if list((tmp_path / "two").glob("work/runs/*/tiles/*.arrays")):
                process.kill()
                killed = True
            time.sleep(0.005)
    assert killed
    assert process.returncode != 0
    refused = run("other.py", tmp_path / "two", "--resume")
    assert "begun with methods" in refused.stderr.splitlines()[-1] or "begun with own" in refused.stderr
    resumed = run("same.py", tmp_path / "two", "--resume")
    assert resumed.returncode == 0, resumed.stderr
    one, two = (read_lines(tmp_path / name / "lines.gpkg") for name in ("one", "two"))
    assert {"lane_marking", "trail"} <= set(one.kind.tolist())
    assert_same(one, two)


def test_the_description_of_a_run_names_own_code(surveys, tmp_path):
    points, trajectory = surveys["urban"]
    with opened_points(points, tmp_path, trajectory=trajectory) as recordings:

        def request(**own):
            order = extraction_request(
                tmp_path / "l.gpkg", recordings.survey, PAINT, "auto", RunSettings(), **own
            )
            return order.parameters

        assert "own" not in request()
        own = request(methods=[Obb(paint=bright_among_all)], ground=lowest_of_cells)["own"]
        assert list(own) == [f"obb {'+'.join(Obb().kinds)} paint", "ground"]
        assert all("test_own_code" in text for text in own.values())
