"""Compare, byte by byte, the lines that two revisions write from the same surveys with the same settings.

    python -m benchmarks.same_lines BASE [--against REV] [--data DIR] [--cache DIR] [--only NAME ...]

Runs the command line of both revisions, `extract` and for single lines `trace`, on the demo's survey, on ten
simulated surveys and, with ``--data``, on recorded ones. The GeoJSON files that are compared hold every column in full
precision and no time stamp. BASE simulates the surveys; these and the lines of BASE are kept in the cache, with the
lines of the other revision beside them. Without ``--against``, BASE is compared with this checkout as it stands.
``--base-tree`` and ``--tree`` name checkouts to use whose kernels are compiled already; a fresh checkout, which is kept
in the cache too, compiles them first, for minutes. The seconds include starting Python and any compiling. The exit code
is 1 if a file differs or a command fails.
"""

from __future__ import annotations

import argparse
import hashlib
import io
import json
import os
import subprocess
import sys
import tarfile
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

#: Needs a revision to compare with: run only when named.
ON_REQUEST = True
HERE = Path(__file__).resolve().parents[1]
CACHE = Path(tempfile.gettempdir()) / "linework-same-lines"
#: Long enough for compiling all kernels on a busy machine. [s]
TIMEOUT_S = 3600.0


@dataclass(frozen=True)
class Survey:
    """A survey, by the arguments that simulate it or by its path in the data folder.

    Parameters
    ----------
    simulate
        Arguments of `linework simulate`.
    recorded
        File or folder in the data folder.
    path
        Its trajectory in the data folder: a CSV table of easting, northing and height [m].
    located
        Leave the simulated trajectory out, so that it is computed from the logs.
    """

    name: str
    simulate: str = ""
    recorded: str = ""
    path: str = ""
    located: bool = False


@dataclass(frozen=True)
class Run:
    """One file of lines: a survey and the command that writes it.

    Parameters
    ----------
    settings
        Contents of a run file.
    middle_of
        A kind: trace from the middle of the longest line of it that BASE extracts from the survey.
    """

    name: str
    survey: Survey
    arguments: str = "extract"
    settings: str = ""
    middle_of: str = ""


# Few points and few metres keep the whole to minutes; a pair of images takes 3 s to draw
POINTS = "--length-m 80 --points-per-m 3000 --no-images"
IMAGES = "--length-m 40 --points-per-m 1500 --image-size 732x484 --image-every-m 5"
DEMO = Survey("demo", "--road urban --seed 108 --length-m 150 --points-per-m 6000 --no-images")
MOTORWAY = Survey("motorway-images", f"--road motorway --seed 2101 {IMAGES}")
SIMULATED = (
    Survey("straight-1", f"--road straight --seed 2111 {POINTS}"),
    Survey("straight-2", f"--road straight --seed 2112 {POINTS}"),
    Survey("bends-1", f"--road bends --seed 2113 {POINTS}"),
    Survey("bends-2", f"--road bends --seed 2114 {POINTS}"),
    Survey("urban-1", f"--road urban --seed 2115 {POINTS}"),
    Survey("urban-2", f"--road urban --seed 2116 {POINTS}"),
    Survey("motorway-1", f"--road motorway --seed 2117 {POINTS}"),
    Survey("motorway-2", f"--road motorway --seed 2118 {POINTS}"),
    Survey("bends-images", f"--road bends --seed 2102 {IMAGES}"),
    MOTORWAY,
)
RECORDED = (
    Run(
        "here-a22",
        Survey(
            "here-a22",
            recorded="here-a22/here_a22_uniform_south.laz",
            path="here-a22/trajectory_utm32n.csv",
        ),
        "extract --crs EPSG:32632",
    ),
    Run("powerline", Survey("powerline", recorded="powerline"), "extract --crs EPSG:28992"),
    Run("stereo-ramp", Survey("stereo-ramp", recorded="stereo-ramp")),
)
#: Tiles of 64 m and at most 100,000 points: even the demo's survey has several.
SMALL_TILES = "[tiling]\ncore_m = 64.0\nhigh_core_m = 128.0\nmax_points = 100000\n"
#: Kinds traced from one place each, as by a click in the workbench.
CLICKED = ("lane_marking", "road_boundary", "guardrail", "cable")
#: Column and row on a marking in image 2 of the motorway. [px]
PIXELS = ("600,420", "310,327")
RUNS = (
    Run("demo", DEMO),
    Run("demo-tiles", DEMO, "extract --workers 2", settings=SMALL_TILES),
    *(Run(f"demo-click-{kind}", DEMO, f"trace --feature {kind}", middle_of=kind) for kind in CLICKED),
    *(Run(survey.name, survey) for survey in SIMULATED),
    Run("motorway-stereo", MOTORWAY, "extract --method stereo"),
    *(
        Run(f"motorway-pixel-{i}", MOTORWAY, f"trace --image left/000002.png --at-px {px}")
        for i, px in enumerate(PIXELS, 1)
    ),
    Run("motorway-located", replace(MOTORWAY, name="motorway-located", located=True)),
)


@dataclass(frozen=True)
class Tree:
    """A checkout of one revision, and the folder that keeps its lines."""

    root: Path
    lines: Path

    def run(self, arguments: list[object], *, cwd: Path) -> None:
        """Run the command line of this checkout.

        Raises
        ------
        RuntimeError
            It fails; the last line of its messages.
        """
        environment = os.environ | {"PYTHONPATH": str(self.root / "src")}
        done = subprocess.run(
            [sys.executable, "-m", "linework", *map(str, arguments)],
            cwd=cwd, env=environment, capture_output=True, text=True, timeout=TIMEOUT_S, check=False,
        )  # fmt: skip
        if done.returncode:
            raise RuntimeError(f"exit code {done.returncode}: {done.stderr.strip().splitlines()[-1:]}")


@dataclass(frozen=True)
class Lines:
    """A file of lines and how long it took to make."""

    path: Path
    seconds: float

    @property
    def sha256(self) -> str:
        return hashlib.sha256(self.path.read_bytes()).hexdigest()

    @property
    def n_lines(self) -> int:
        return sum(feature["geometry"]["type"] == "LineString" for feature in self.features())

    def features(self) -> list[dict[str, Any]]:
        features: list[dict[str, Any]] = json.loads(self.path.read_text(encoding="utf-8"))["features"]
        return features


def main(arguments: tuple[str, ...] = ()) -> int:
    """Compare all runs, print a row for each, and return the exit code."""
    options = parsed(arguments)
    cache = options.cache / commit_of(options.base)
    base = base_tree(options, cache)
    other = other_tree(options, cache)
    runs = [run for run in (*RUNS, *(RECORDED if options.data else ())) if wanted(run, options.only)]
    n_different = 0
    print(f"{'run':26} {'lines':>5}  {'base':>6} {'other':>6} [s]  bytes", flush=True)
    for run in runs:
        try:
            row, same = compared(run, base, other, cache, options.data)
        except (RuntimeError, subprocess.TimeoutExpired) as error:
            row, same = f"FAILED: {error}", False
        print(f"{run.name:26} {row}", flush=True)
        n_different += not same
    print(
        f"{len(runs) - n_different} of {len(runs)} files are the same; lines are in {base.lines} and {other.lines}"
    )
    return int(n_different > 0)


def parsed(arguments: tuple[str, ...]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.same_lines")
    parser.add_argument("base", help="the revision to compare with; it simulates the surveys")
    parser.add_argument("--against", help="the other revision; this checkout as it stands if not given")
    parser.add_argument("--base-tree", type=Path, help="a checkout of BASE, without changes")
    parser.add_argument("--tree", type=Path, help="the other checkout, as it stands")
    parser.add_argument("--data", type=Path, help="folder of recorded surveys")
    parser.add_argument(
        "--cache", type=Path, default=CACHE, help="folder of surveys, lines and fresh checkouts"
    )
    parser.add_argument("--only", nargs="+", default=(), metavar="NAME", help="runs whose names begin so")
    options = parser.parse_args(list(arguments))
    if options.against and options.tree:
        parser.error("give --against or --tree")
    options.cache = options.cache.resolve()
    return options


def wanted(run: Run, names: tuple[str, ...]) -> bool:
    return not names or run.name.startswith(tuple(names))


def git(*arguments: str, root: Path = HERE) -> bytes:
    return subprocess.run(["git", "-C", root, *arguments], capture_output=True, check=True).stdout


def commit_of(revision: str) -> str:
    return git("rev-parse", "--short=12", f"{revision}^{{commit}}").decode().strip()


def base_tree(options: argparse.Namespace, cache: Path) -> Tree:
    """Return the checkout of BASE, refused if it is not exactly BASE: its lines are kept under that name."""
    if options.base_tree is None:
        return Tree(fresh_tree(options.base, options.cache), cache / "lines")
    root = options.base_tree.resolve()
    head = git("rev-parse", "--short=12", "HEAD", root=root).decode().strip()
    if head != cache.name or git("status", "--porcelain", "--", "src", root=root):
        sys.exit(f"{root} is at {head} or changed; --base-tree has to be {cache.name} without changes")
    return Tree(root, cache / "lines")


def other_tree(options: argparse.Namespace, cache: Path) -> Tree:
    if options.against:
        return Tree(
            fresh_tree(options.against, options.cache), cache / f"lines-of-{commit_of(options.against)}"
        )
    root = (options.tree or HERE).resolve()
    return Tree(root, cache / f"lines-of-{root.name}-{digest(str(root))}")


def fresh_tree(revision: str, cache: Path) -> Path:
    """Return a checkout of a revision, kept because compiled kernels lie in it."""
    root = cache / "trees" / commit_of(revision)
    if not root.is_dir():
        root.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=root.parent) as folder:
            with tarfile.open(fileobj=io.BytesIO(git("archive", revision, "src"))) as archive:
                archive.extractall(Path(folder) / "tree", filter="data")
            (Path(folder) / "tree").rename(root)
    return root


def digest(what: object) -> str:
    return hashlib.sha256(repr(what).encode()).hexdigest()[:8]


def compared(run: Run, base: Tree, other: Tree, cache: Path, data: Path | None) -> tuple[str, bool]:
    """Return the table row of a run, and whether both files are the same."""
    survey = surveyed(run.survey, base, cache, data)
    arguments = [*run.arguments.split(), *survey]
    if run.middle_of:
        whole = lines_of(Run(run.survey.name, run.survey), base, ["extract", *survey], kept=True)
        arguments += ["--at", middle_of_longest(whole, run.middle_of)]
    before = lines_of(run, base, arguments, kept=True)
    after = lines_of(run, other, arguments, kept=False)
    same = before.sha256 == after.sha256
    verdict = f"same {before.sha256[:12]}" if same else "; ".join(differences(before, after))
    return f"{before.n_lines:5}  {before.seconds:6.1f} {after.seconds:6.1f}      {verdict}", same


def surveyed(survey: Survey, base: Tree, cache: Path, data: Path | None) -> list[object]:
    """Return the command-line arguments for a survey, simulating it first if the cache lacks it."""
    if survey.recorded:
        assert data is not None
        arguments: list[object] = [data.resolve() / survey.recorded]
        if survey.path:
            arguments += [
                "--trajectory",
                timed_path(data / survey.path, cache / "surveys" / f"{survey.name}.csv"),
            ]
        return arguments
    folder = cache / "surveys" / f"{survey.name}-{digest(survey)}"
    if not folder.is_dir():
        folder.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=folder.parent) as part:
            made = Path(part) / "survey"
            base.run(["simulate", "-o", made, *survey.simulate.split(), "--quiet"], cwd=folder.parent)
            if survey.located:
                (made / "trajectory.csv").unlink()
                text = (made / "survey.toml").read_text(encoding="utf-8")
                text = text.replace('[trajectory]\nfile = "trajectory.csv"\n', "")
                (made / "survey.toml").write_text(text, encoding="utf-8")
            made.rename(folder)
    return [folder]


def timed_path(table: Path, target: Path) -> Path:
    """Write a table of eastings, northings and heights as a trajectory with one pose per second."""
    rows = [line.split(",")[:3] for line in table.read_text(encoding="utf-8").splitlines()[1:]]
    head = "time_s,easting_m,northing_m,height_m\n"
    target.parent.mkdir(parents=True, exist_ok=True)
    target.write_text(
        head + "".join(f"{i},{','.join(row)}\n" for i, row in enumerate(rows)), encoding="utf-8"
    )
    return target


def lines_of(run: Run, tree: Tree, arguments: list[object], *, kept: bool) -> Lines:
    """Return the lines of a run made with an empty work folder, or those kept from an earlier time."""
    target = tree.lines / f"{run.name}-{digest((run, run.survey))}.geojson"
    seconds = target.with_suffix(".seconds")
    if kept and seconds.is_file():
        return Lines(target, float(seconds.read_text()))
    tree.lines.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=tree.lines) as name:
        folder = Path(name)
        output = folder / "lines.geojson"
        arguments = [*arguments, "-o", output, "--work", folder / "work", "--quiet"]
        if run.settings:
            (folder / "run.toml").write_text(run.settings, encoding="utf-8")
            arguments += ["--config", folder / "run.toml"]
        start = time.perf_counter()
        tree.run(arguments, cwd=folder)
        took = time.perf_counter() - start
        output.replace(target)
        seconds.write_text(f"{took:.2f}\n")
    return Lines(target, took)


def middle_of_longest(lines: Lines, kind: str) -> str:
    """Return the middle vertex of the longest line of a kind, as `trace --at` takes it."""
    of_kind = [feature for feature in lines.features() if feature["properties"]["kind"] == kind]
    if not of_kind:
        raise RuntimeError(f"no {kind} to follow")
    vertices = max(of_kind, key=lambda feature: feature["properties"]["length_m"])["geometry"]["coordinates"]
    east, north, _ = vertices[len(vertices) // 2]
    return f"{east!r},{north!r}"


def differences(before: Lines, after: Lines) -> Iterator[str]:
    """Yield, for each kind with a difference, how many lines differ and the first difference."""
    old, new = before.features(), after.features()
    kinds = sorted({feature["properties"]["kind"] for feature in (*old, *new)})
    n_kinds = 0
    for kind in kinds:
        was = [feature for feature in old if feature["properties"]["kind"] == kind]
        now = [feature for feature in new if feature["properties"]["kind"] == kind]
        if was == now:
            continue
        n_kinds += 1
        if len(was) != len(now):
            yield f"{kind}: {len(now)} lines instead of {len(was)}"
            continue
        wrong = [i for i, (a, b) in enumerate(zip(was, now, strict=True)) if a != b]
        yield f"{kind}: {len(wrong)} of {len(was)} differ, line {wrong[0]}: " + first_difference(
            was[wrong[0]], now[wrong[0]]
        )
    if not n_kinds:
        yield "the same lines in another order, or another head"


def first_difference(was: dict[str, Any], now: dict[str, Any]) -> str:
    """Return what differs first in one line: a vertex, or a property."""
    a, b = was["geometry"]["coordinates"], now["geometry"]["coordinates"]
    if len(a) != len(b):
        return f"{len(b)} vertices instead of {len(a)}"
    for i, (p, q) in enumerate(zip(a, b, strict=True)):
        if p != q:
            return f"vertex {i} is {max(abs(x - y) for x, y in zip(p, q, strict=True)):.3g} m off"
    names = {**was["properties"], **now["properties"]}
    for name in names:
        old, new = was["properties"].get(name), now["properties"].get(name)
        if old != new:
            return f"{name} is {str(new)[:40]} instead of {str(old)[:40]}"
    return "in the order of its properties"


if __name__ == "__main__":
    sys.exit(main(tuple(sys.argv[1:])))
