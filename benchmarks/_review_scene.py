"""Simulated streets to review: few points, worn paint, parked cars; their automatic lines; and how wrong lines are."""

import shutil
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from linework.cli.app import main as linework
from linework.evaluation.chains import Chains
from linework.evaluation.match import TIE_M, match_chains
from linework.files.vectors.read_write import read_lines
from linework.methods.kinds import KINDS_OF
from linework.simulation.folder import write_survey_folder
from linework.simulation.roads.draw import draw_scenario
from linework.simulation.simulate import survey_of

LENGTH_M = 1000.0
#: Seeds draw streets of 2,000 to 19,000 points per metre: these are fewer. Half of the paint is gone everywhere.
POINTS_PER_M, WEAR = 1500.0, 0.5
#: Lines are right within this. [m]
WITHIN_M = 0.10
#: What extraction from points looks for, and the truth of a survey has: edges beside a boundary are in no truth.
KINDS = tuple(kind for kind in (*KINDS_OF["obb"], *KINDS_OF["radon"]) if kind != "edge_other")


@dataclass(frozen=True)
class Scene:
    """A street on disk: its survey, the work folder, and the lines that extraction found."""

    survey: Path
    work: Path
    lines: Path


def scene_of(road, seed, folder, options):
    """Simulate and extract a drive, once for a folder."""
    name = f"{road}{seed}"
    scene = Scene(folder / f"survey-{name}", folder / f"work-{name}", folder / f"lines-{name}.gpkg")
    if not scene.survey.exists():
        scenario = draw_scenario(road, seed, options.length_m, points_per_m=options.points_per_m)
        worn = tuple(replace(m, wear=max(m.wear, options.wear)) for m in scenario.layout.markings)
        layout = replace(scenario.layout, markings=worn)
        write_survey_folder(survey_of(replace(scenario, layout=layout)), scene.survey)
    if not scene.lines.exists():
        wanted = ["-o", str(scene.lines), "--work", str(scene.work), "--method", "auto", "--quiet"]
        if linework(["extract", str(scene.survey), *wanted]) != 0:
            raise RuntimeError(f"{name} could not be extracted")
    return scene


def truth_of(scene):
    """The right lines of a scene."""
    return read_lines(scene.survey / "truth.gpkg")


def copied(scene):
    """A copy of the scene's lines that can be edited, in a folder of its own."""
    folder = Path(tempfile.mkdtemp(prefix="linework-review-"))
    return Path(shutil.copy(scene.lines, folder / "lines.gpkg"))


@dataclass(frozen=True)
class Errors:
    """Length in error of one kind: observed truth without a line, and lines without truth. [m]"""

    missing_m: float
    wrong_m: float

    @property
    def total_m(self):
        return self.missing_m + self.wrong_m


def matched(lines, truth, kind):
    """Pieces of the lines and of the truth of one kind: their `Match`, which are right, which found."""
    origin = _origin(lines, truth)
    n_dims = 3 if kind == "cable" else 2
    e, r = (Chains.of(some[kind], origin, n_dims) for some in (lines, truth))
    match = match_chains(e, r, 0.5)
    return (
        match,
        match.e_nearest.distance_m <= WITHIN_M + TIE_M,
        match.r_nearest.distance_m <= WITHIN_M + TIE_M,
    )


def _origin(lines, truth):
    """South-west corner of the truth, rounded; of the lines where no line is right, as in a forest. [m]"""
    xyz = truth.xyz if len(truth.xyz) else lines.xyz
    return np.floor(xyz.min(axis=0)) if len(xyz) else np.zeros(3)


def errors_of(lines, truth):
    """Errors by kind."""
    there = lines.take(lines.review != "rejected").with_columns(crs=truth.crs)
    found = {}
    for kind in KINDS:
        match, is_right, is_found = matched(there, truth, kind)
        missing = match.r_pieces.length_m[match.r_observed & ~is_found].sum()
        found[kind] = Errors(float(missing), float(match.e_pieces.length_m[~is_right].sum()))
    return found


def right_share(lines, truth):
    """Share of the length of some lines, each of its kind, that is right."""
    right = whole = 0.0
    for kind in dict.fromkeys(lines.kind.tolist()):
        match, is_right, _ = matched(lines.with_columns(crs=truth.crs), truth, kind)
        right += float(match.e_pieces.length_m[is_right].sum())
        whole += float(match.e_pieces.length_m.sum())
    return right / max(whole, 1e-9)


def missing_runs(lines, truth, kind, box, *, least_m=1.0, whole=False, beyond=False):
    """Stretches of observed truth in a box that no line covers, longest first: length, places (k, 3), what each lacks.

    `whole`: those of one line as one, with what is between them. `beyond`: to their ends, also outside the box: who sees
    that a line is missing goes along it.
    """
    there = lines.take(lines.review != "rejected").with_columns(crs=truth.crs)
    match, _, is_found = matched(there, truth, kind)
    pieces = match.r_pieces
    if len(pieces) == 0:
        return []
    xyz = pieces.xyz + _origin(there, truth)
    inside = (
        (xyz[:, 0] >= box.west)
        & (xyz[:, 0] <= box.east)
        & (xyz[:, 1] >= box.south)
        & (xyz[:, 1] <= box.north)
    )
    lacks = ~is_found & (inside | beyond)
    new = np.concatenate([[True], (pieces.line[1:] != pieces.line[:-1]) | (lacks[1:] != lacks[:-1])])
    runs = np.split(np.arange(len(pieces)), np.flatnonzero(new)[1:])
    runs = [run for run in runs if len(run) and lacks[run[0]] and inside[run].any()]
    if whole:
        of_line = {int(pieces.line[run[0]]): [] for run in runs}
        for run in runs:
            of_line[int(pieces.line[run[0]])].append(run)
        runs = [np.arange(some[0][0], some[-1][-1] + 1) for some in of_line.values()]
    lacks_m = np.where(match.r_observed & lacks, pieces.length_m, 0.0)
    found = [(float(lacks_m[run].sum()), xyz[run], lacks_m[run]) for run in runs]
    return sorted((run for run in found if run[0] >= least_m), key=lambda run: -run[0])
