"""`linework demo`: simulate a small survey, extract its lines, score them, and write a report."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from linework.cli.options import Overwrite, Quiet
from linework.cli.said import say

if TYPE_CHECKING:
    from collections.abc import Mapping

    from linework.evaluation.tolerance import KindMatch
    from linework.model.lines import LineSet
    from linework.model.points import Points
    from linework.runs.extraction import Extraction
    from linework.runs.steps import RunSteps

#: The simulated survey: kind of road, seed, length [m] and points per metre. A street with every kind of line
#: (kerbs that turn into a side street, dashed and solid markings, a crossing with its stop line, arrows, a
#: guardrail, cables), parked cars, hedges and walls, and few enough points for half a minute. Chosen for what
#: stands along the street, not for how well its lines come out.
_ROAD, _SEED, _LENGTH_M, _POINTS_PER_M = "urban", 108, 150.0, 6000.0


def demo(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Output folder.")] = Path("linework-demo"),
    seed: Annotated[int, typer.Option("--seed", help="Random seed of the survey.")] = _SEED,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
) -> None:
    """Simulate a survey, extract its lines and report the scores.

    The survey is simulated from --seed: a street with kerbs, markings, parked cars, a guardrail and cables,
    with the exact lines (the truth) beside the laser points. The extraction does not use the truth; the report
    compares the two.
    """
    from linework.errors import check_extra
    from linework.files.output.locks import reserve_folder
    from linework.library.progress import open_display

    for extra in ("simulate", "reports"):
        check_extra(extra, where="demo")
    with reserve_folder(folder, overwrite=overwrite, reads_it=True), open_display(quiet=quiet) as display:
        from linework.methods.kinds import ALL_KINDS
        from linework.runs.compile import compile_stage
        from linework.runs.steps import RunSteps

        steps = RunSteps(display)
        compile_stage(ALL_KINDS, steps)
        _simulate(folder / "survey", seed, steps, overwrite=overwrite)
        _extract_and_score(folder, steps, overwrite=overwrite)
    for name, content in (
        ("survey", "simulated survey: points, trajectory, truth.gpkg"),
        ("lines.gpkg", "extracted lines; open in QGIS"),
        ("report.html", "report with figures and tables; open in a browser"),
        ("run.json", "record of the run"),
    ):
        say(f"{folder / name}: {content}")


def _simulate(folder: Path, seed: int, steps: RunSteps, *, overwrite: bool) -> None:
    from linework.simulation.folder import write_survey_folder
    from linework.simulation.simulate import simulate_survey

    with steps.step("simulate"):
        survey = simulate_survey(_ROAD, seed, _LENGTH_M, points_per_m=_POINTS_PER_M)
        write_survey_folder(survey, folder, overwrite=overwrite)


def _extract_and_score(folder: Path, steps: RunSteps, *, overwrite: bool) -> None:
    """Extract as `linework extract DIR/survey -o DIR/lines.gpkg` does, and score the result."""
    from dataclasses import asdict

    from linework.files.survey.open import open_survey
    from linework.methods.choose import choose_methods
    from linework.methods.kinds import ALL_KINDS
    from linework.processes.system import usable_cores
    from linework.runs.extract import ExtractionRequest, extract_to
    from linework.runs.opened.points import points_for_pictures
    from linework.runs.opened.recordings import opened_recordings
    from linework.runs.opened.store import executor_for, promised_points
    from linework.runs.opened.work_folder import work_folder
    from linework.runs.settings import RunSettings

    survey, settings = open_survey([folder / "survey"]), RunSettings()
    request = ExtractionRequest(
        output=folder / "lines.gpkg",
        methods=choose_methods("auto", ALL_KINDS, radon=settings.radon, obb=settings.obb),
        settings=settings,
        parameters={"features": list(ALL_KINDS), "method": "auto", "settings": asdict(settings)},
        overwrite=overwrite,
    )
    work, n_workers = work_folder(survey.root), usable_cores()
    with (
        executor_for(promised_points(survey), n_workers, settings, has_images=survey.has_pairs) as executor,
        opened_recordings(survey, work, images=False, n_threads=n_workers, steps=steps) as recordings,
    ):
        record, found = extract_to(request, recordings, work, executor, steps)
        # Nothing is returned only where a resumed run had finished already; the survey of the demo has points
        assert found is not None and recordings.points is not None
        points = points_for_pictures(recordings.points.points)
    _score_and_report(folder, found, points, record, steps, overwrite=overwrite)


def _score_and_report(
    folder: Path,
    found: Extraction,
    points: Points,
    record: Mapping[str, Any],
    steps: RunSteps,
    *,
    overwrite: bool,
) -> None:
    """Score the lines against the truth, write the report and print its two main tables."""
    from linework.cli.commands.of_lines.evaluate import print_tables
    from linework.evaluation.measures import match_lines, scores_of
    from linework.evaluation.report.page import ReportContent, report_html
    from linework.evaluation.report.tables import score_tables
    from linework.files.output.publish import write_page
    from linework.files.vectors.read_write import read_lines
    from linework.runs.record import facts_of_run

    with steps.step("evaluate"):
        truth = read_lines(folder / "survey" / "truth.gpkg")
        parts: tuple[KindMatch, ...] = match_lines(found.lines, truth, kinds=_scored(found, truth))
        scores = scores_of(parts)
    with steps.step("write report"):
        report = ReportContent(
            title="Simulated survey: extracted lines and their accuracy",
            lines=found.lines,
            points=points,
            facts=facts_of_run(record),
            reference=truth,
            parts=parts,
            scores=scores,
        )
        write_page(report_html(report), folder / "report.html", overwrite=overwrite)
    print_tables(list(score_tables(scores))[:2])


def _scored(found: Extraction, truth: LineSet) -> tuple[str, ...]:
    """Return the kinds searched for that the lines or the truth hold."""
    from linework.evaluation.measures import scored_unasked

    present = {str(kind) for lines in (found.lines, truth) for kind in lines.kind}
    return scored_unasked([kind for kind in found.kinds if kind in present], truth)
