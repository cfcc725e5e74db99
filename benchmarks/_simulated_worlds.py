"""Today's methods on simulated scenes, kind by kind and seed by seed, with their failures by cause."""

from __future__ import annotations

import inspect
import time
import warnings
from collections import Counter, defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

import linework
from benchmarks._edge_roles import role_lengths
from benchmarks._failures import Cause, Stages, failures
from benchmarks._real_worlds import false_m
from linework.errors import LineworkWarning
from linework.evaluation.measures import match_lines, score
from linework.evaluation.report.tables import ReportTable, centimetres, number, percent
from linework.evaluation.tolerance import KindMatch
from linework.evaluation.values import KindScores
from linework.methods.obb.method import OBB_KINDS, Obb
from linework.model.boxes import BoxSet
from linework.model.lines import KINDS, LineSet
from linework.simulation.scene.parallel_edges import parallel_edges
from linework.simulation.simulate import SimulatedSurvey, simulate_survey
from linework.surface.road import find_ground

TOLERANCE_M = 0.10
#: Cells by which the area of a survey is counted: wider than scan lines are apart. [m]
AREA_CELL_M = 5.0


@dataclass
class SceneResult:
    """Matches and failures of all seeds of one kind of scene."""

    scene: str
    parts: list[KindMatch] = field(default_factory=list)
    causes: list[Cause] = field(default_factory=list)
    #: Metres of edges beside boundaries by true and found role, and of boundaries by form.
    roles: Counter[tuple[str, str]] = field(default_factory=Counter)
    forms: Counter[tuple[str, str]] = field(default_factory=Counter)
    seconds: float = 0.0
    hectares: float = 0.0


def simulated(road: str, seed: int, length_m: float, **choices: Any) -> SimulatedSurvey:
    """Simulate one survey.

    `choices` are arguments of `simulate_survey` by name: those that are None are left to it.
    """
    wanted = {name: value for name, value in choices.items() if value is not None}
    unknown = set(wanted) - set(inspect.signature(simulate_survey).parameters)
    if unknown:
        raise SystemExit(f"the simulator has no {', '.join(sorted(unknown))}")
    return simulate_survey(road, seed, length_m, **wanted)


def scored_scene(
    survey: SimulatedSurvey, kinds: Sequence[str], into: SceneResult, name: str, *, causes: bool = True
) -> list[KindScores]:
    """Extract one simulated survey, add what came out and return its scores; say them in one line.

    What the methods had in hand on the way is looked up in all passes at once, where `extract` takes drive by
    drive: it only names the causes.
    """
    start = time.perf_counter()
    found = extracted(survey, kinds)
    seconds = time.perf_counter() - start
    # The edges beside boundaries have roles, but no complete truth
    into.roles += role_lengths(found["edge_other"], parallel_edges(survey.scenario), "role")
    into.forms += role_lengths(found["road_boundary"], survey.truth["road_boundary"], "form")
    kinds = [kind for kind in kinds if kind != "edge_other"]
    parts = match_lines(found, survey.truth, kinds=kinds)
    into.parts += parts
    if causes:
        into.causes += failures(found, survey.truth, stages_of(survey, kinds), kinds, TOLERANCE_M)
    into.seconds += seconds
    into.hectares += hectares_of(survey)
    told, scores = [], [score([part], part.kind, TOLERANCE_M, ()) for part in parts]
    for part, one in zip(parts, scores, strict=True):
        at = one.at
        if at.completeness is not None or at.correctness is not None:
            told.append(f"{part.kind} {percent(at.completeness)} / {percent(at.correctness)}")
    print(f"{name}: {len(survey.points) / 1e6:.2f} M points, {seconds:.1f} s; {'; '.join(told)}", flush=True)
    return scores


def extracted(survey: SimulatedSurvey, kinds: Sequence[str]) -> LineSet:
    """Return the lines that `linework.extract` finds with default settings, in the CRS of the truth."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", LineworkWarning)
        found = linework.extract(survey.points, trajectory=survey.trajectory, kinds=kinds)
    return found.with_columns(crs=survey.truth.crs)


def stages_of(survey: SimulatedSurvey, kinds: Sequence[str]) -> Stages:
    """Return what the methods have in hand on the way, all points looked at as one window."""
    points, trajectory = survey.points, survey.trajectory
    ground = find_ground(points, trajectory)
    path = np.zeros((0, 3)) if trajectory is None else trajectory.xyz
    boxes, tracked = list[BoxSet](), LineSet.empty()
    if any(kind in OBB_KINDS for kind in kinds):
        for name, result in Obb().steps(points, trajectory, ground):
            if name in ("marking boxes", "boundary boxes"):
                boxes.append(result)
            elif name == "paint":
                tracked = result
    return Stages(BoxSet.concatenate(boxes), tracked, ground, points, scan_line_s(survey), path)


def scan_line_s(survey: SimulatedSurvey) -> float:
    """Time of one scan line of the first scanner; 0 where it is not known."""
    first = survey.scenario.scanners[0] if survey.scenario.scanners else None
    rate = getattr(first, "turns_per_s", None) or getattr(first, "lines_per_s", None)
    return 1.0 / rate if rate else 0.0


def hectares_of(survey: SimulatedSurvey) -> float:
    """Area in which points were measured. [ha]"""
    cells = np.unique(np.floor(survey.points.xyz[:, :2] / AREA_CELL_M).astype(np.int64), axis=0)
    return len(cells) * AREA_CELL_M**2 / 10_000.0


def scores_table(results: Sequence[SceneResult]) -> ReportTable:
    """One row per scene and kind, all seeds pooled."""
    rows = []
    for result in results:
        first = result.scene
        for kind in dict.fromkeys(part.kind for part in result.parts):
            one = score([part for part in result.parts if part.kind == kind], kind, TOLERANCE_M)
            if not one.observed_m and not one.extracted_m:
                continue
            rows.append(
                (
                    first, kind, number(one.observed_m, 0), number(one.extracted_m, 0),
                    percent(one.at.completeness), percent(one.at.correctness),
                    centimetres(one.at.lateral.rmse_m),
                    number(false_m(one), 0), number(false_m(one) / result.hectares, 1),
                )
            )  # fmt: skip
            first = ""
    columns = ("scene", "kind", "truth\nm", "found\nm", "complete", "correct", "lateral\ncm", "false\nm",
        "false\nm/ha",
    )  # fmt: skip
    return ReportTable(
        "Simulated scenes, within 10 cm", columns, tuple(rows), "truth: what the sensors saw of it"
    )


def causes_table(results: Sequence[SceneResult]) -> ReportTable:
    """Metres missed and false by cause, the largest first."""
    rows = []
    for result in results:
        metres: dict[tuple[str, str], dict[str, float]] = defaultdict(lambda: defaultdict(float))
        for cause in result.causes:
            metres[cause.kind, cause.failure][cause.cause] += cause.metres
        for (kind, failure), of_cause in sorted(metres.items(), key=_in_order):
            whole = sum(of_cause.values())
            for why, length_m in sorted(of_cause.items(), key=lambda item: (-item[1], item[0])):
                rows.append(
                    (result.scene, kind, failure, why, number(length_m, 1), percent(length_m / whole))
                )
    columns = ("scene", "kind", "failure", "cause", "m", "share")
    return ReportTable("Failures by cause", columns, tuple(rows), "the first cause that fits, every 0.5 m")


def _in_order(item: tuple[tuple[str, str], dict[str, float]]) -> tuple[int, str]:
    """Sort by kind, in the order of the layers, and missed before false."""
    (kind, failure), _ = item
    return KINDS.index(kind), "" if failure == "missed" else failure


def summed(results: Sequence[SceneResult]) -> SceneResult:
    """Return the results of all scenes as one."""
    whole = SceneResult("all scenes")
    for result in results:
        whole.parts += result.parts
        whole.causes += result.causes
        whole.roles += result.roles
        whole.forms += result.forms
        whole.seconds += result.seconds
        whole.hectares += result.hectares
    return whole
