"""Real surveys, extracted with default settings and scored against their references."""

from __future__ import annotations

import time
import warnings
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import linework
from benchmarks._moved import MovedRuns, moved
from benchmarks._references import Reference, data_folder, read_references, within
from linework.errors import LineworkError
from linework.evaluation.measures import match_lines, score
from linework.evaluation.report.tables import ReportTable, centimetres, number, percent
from linework.evaluation.tolerance import KindMatch
from linework.evaluation.values import KindScores
from linework.model.lines import LineSet
from linework.model.points import Points


@dataclass(frozen=True)
class WorldResult:
    """What came out for one real survey; `problem` says why there is nothing."""

    reference: Reference
    scores: tuple[KindScores, ...] = ()
    absent_m: tuple[tuple[str, float], ...] = ()
    seconds: float = 0.0
    problem: str = ""


def real_worlds(
    data: Path, names: tuple[str, ...] = (), n_moved: int = 0, moved_runs: MovedRuns | None = None
) -> list[WorldResult]:
    """Extract and score every survey that there is a reference for; a survey that is missing says so.

    n_moved, moved_runs: times that it is done again with moved points, and where what comes out is entered.
    """
    results: list[WorldResult] = []
    # Several references may lie in one file
    seen: dict[tuple[str, int], tuple[LineSet, float]] = {}
    for reference in read_references(data):
        if names and reference.name not in names:
            continue
        result = scored_survey(reference, data, seen)
        results.append(result)
        for k in range(n_moved + 1 if moved_runs is not None and not result.problem else 0):
            again = result if k == 0 else scored_survey(reference, data, seen, k)
            for one in again.scores:
                moved_runs.add(reference.name, one)
        print(f"{reference.name}: {result.problem or f'{result.seconds:.1f} s'}", flush=True)
    return results


def scored_survey(
    reference: Reference,
    data: Path,
    seen: dict[tuple[str, int], tuple[LineSet, float]] | None = None,
    seed: int = 0,
) -> WorldResult:
    """Extract and score one survey; `seen` keeps what was extracted from a file, and its time.

    seed: of the points' move, see `moved`.
    """
    seen, key = {} if seen is None else seen, (reference.file, seed)
    if not (data / reference.file).exists():
        return WorldResult(reference, problem=f"{reference.file} is not in {data.name or data}")
    start = time.perf_counter()
    try:
        if key not in seen:
            found = extracted(data / reference.file, reference.crs, seed)
            seen[key] = found, time.perf_counter() - start
    except LineworkError as problem:
        return WorldResult(
            reference, seconds=time.perf_counter() - start, problem=str(problem).splitlines()[0]
        )
    return judged(seen[key][0], reference, seen[key][1])


def extracted(path: Path, crs: str, seed: int = 0) -> LineSet:
    """Return the lines of a file of points with default settings; a text of x y z is read as it is.

    seed: of the points' move, see `moved`.
    """
    source: str | Points = str(path)
    with warnings.catch_warnings():
        # That a cloud has no intensity or no trajectory is what it is here for
        warnings.simplefilter("ignore")
        if path.suffix == ".log":
            source = Points(np.loadtxt(path), crs=crs)
        elif seed:
            source = linework.read_points(str(path), crs=crs)
        if isinstance(source, Points):
            source = moved(source, seed)
        return linework.extract(
            source, crs=None if isinstance(source, Points) else crs, workers=1, on_problem="warn"
        )


def judged(found: LineSet, reference: Reference, seconds: float = 0.0) -> WorldResult:
    """Score the lines within the area of a reference, and measure those of kinds that are not there."""
    lines = within(found, reference.judged)
    scores = []
    for kind in reference.kinds:
        parts = matched(lines, reference, kind)
        scores.append(score(parts, kind, reference.tolerance_m))
    lengths = [(kind, length_m(lines, kind)) for kind in reference.absent]
    return WorldResult(reference, tuple(scores), tuple(lengths), seconds)


def matched(lines: LineSet, reference: Reference, kind: str) -> tuple[KindMatch, ...]:
    same = LineSet.from_lines(
        [lines.xyz[a:b] for a, b in zip(lines.offsets[:-1], lines.offsets[1:], strict=True)],
        kind=list(lines.kind),
        crs=reference.lines.crs,
    )
    return match_lines(same, reference.lines, tolerance_m=reference.tolerance_m, kinds=(kind,))


def length_m(lines: LineSet, kind: str) -> float:
    """Length in plan of the lines of a kind. [m]"""
    total = 0.0
    for i in np.flatnonzero(lines.kind == kind):
        part = lines.xyz[lines.offsets[i] : lines.offsets[i + 1], :2]
        total += float(np.linalg.norm(np.diff(part, axis=0), axis=1).sum())
    return total


def false_m(scores: KindScores) -> float:
    """Length of what was found of a kind and is not right. [m]"""
    return scores.extracted_m - scores.at.matched_extracted_m


def real_table(results: list[WorldResult]) -> ReportTable:
    """One row per survey and kind; kinds of which there is nothing are one row with their metres of false line."""
    rows = []
    for result in results:
        reference = result.reference
        name, size = reference.name, reference.hectares
        if result.problem:
            rows.append((name, result.problem, *[""] * 8))
            continue
        first = number(result.seconds, 1)
        for one in result.scores:
            wrong = false_m(one)
            rows.append(
                (
                    name, one.kind, number(reference.tolerance_m, 2), number(one.reference_m, 0),
                    number(one.extracted_m, 0), percent(one.at.completeness), percent(one.at.correctness),
                    centimetres(one.at.lateral.rmse_m), number(wrong / size, 0), first,
                )
            )  # fmt: skip
            name, first = "", ""
        if reference.absent:
            wrong = sum(metres for _, metres in result.absent_m)
            there = ", ".join(kind for kind, metres in result.absent_m if metres > 0) or "any other"
            rows.append(
                (
                    name,
                    f"none: {there}",
                    "",
                    "0",
                    number(wrong, 0),
                    "",
                    "",
                    "",
                    number(wrong / size, 0),
                    first,
                )
            )
    columns = (
        "survey", "kind", "within\nm", "truth\nm", "found\nm", "complete", "correct", "lateral\ncm",
        "false\nm/ha", "time\ns",
    )  # fmt: skip
    return ReportTable(
        "Real surveys",
        columns,
        tuple(rows),
        "none: kinds of which there is nothing within the area of the reference",
    )


def checked_data(given: str | None) -> Path:
    """Return the folder of real data.

    Raises
    ------
    SystemExit
        It is not there.
    """
    data = data_folder(given)
    if not data.is_dir():
        raise SystemExit(f"{data}: no folder of real data; name it with --data")
    return data
