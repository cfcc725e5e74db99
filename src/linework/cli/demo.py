"""`linework demo`: the whole job on a fresh machine, on a survey that is made up on the spot."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from collections.abc import Mapping

    from linework.evaluation.tolerance import KindMatch
    from linework.model.lines import LineSet
    from linework.model.points import Points
    from linework.runs.extraction import Extraction
    from linework.runs.steps import RunSteps

#: The survey: a street with every kind of line (kerbs that turn into a side street, dashed and solid markings,
#: a crossing with its stop line, arrows, a rail, cables), parked cars, hedges and walls, and few enough points
#: for half a minute. Chosen for what stands along it, not for how it comes out.
DEMO_ROAD, SEED, LENGTH_M, POINTS_PER_M = "urban", 108, 150.0, 6000.0


def demo(
    folder: Annotated[Path, typer.Argument(metavar="[DIR]", help="Folder to make.")] = Path("linework-demo"),
    seed: Annotated[int, typer.Option("--seed", help="Another number, another survey.")] = SEED,
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Replace files in a folder that is there.")
    ] = False,
    quiet: Annotated[bool, typer.Option("--quiet", help="No progress on stderr.")] = False,
) -> None:
    """Simulate a small survey, extract its lines, score them, and write lines and report: the whole job.

    The survey is made up from --seed: a street with kerbs, markings, parked cars, a guardrail and cables, and
    the exact lines beside the laser points. What is extracted never sees them; the report compares both.
    """
    from linework.cli.progress import open_display
    from linework.files.output.publish import check_output_folder

    check_output_folder(folder, overwrite=overwrite)
    with open_display(quiet=quiet) as display:
        from linework.cli.progress import announce_compilation
        from linework.methods.kinds import ALL_KINDS
        from linework.runs.steps import RunSteps

        announce_compilation(ALL_KINDS, quiet=quiet)
        steps = RunSteps(display)
        _simulate(folder / "survey", seed, steps, overwrite=overwrite)
        _extract_and_score(folder, steps, overwrite=overwrite)
    for name, what in (
        ("survey", "the survey: points, trajectory, truth.gpkg"),
        ("lines.gpkg", "the lines; open it in QGIS"),
        ("report.html", "pictures and figures; open it in a browser"),
        ("run.json", "the record of the run"),
    ):
        typer.echo(f"{folder / name}: {what}")


def _simulate(folder: Path, seed: int, steps: RunSteps, *, overwrite: bool) -> None:
    from linework.simulation.folder import write_survey_folder
    from linework.simulation.simulate import simulate_survey

    with steps.step("simulate"):
        survey = simulate_survey(DEMO_ROAD, seed, LENGTH_M, points_per_m=POINTS_PER_M)
        write_survey_folder(survey, folder, overwrite=overwrite)


def _extract_and_score(folder: Path, steps: RunSteps, *, overwrite: bool) -> None:
    """Do what `linework extract DIR/survey -o DIR/lines.gpkg` does, and score what it made."""
    from dataclasses import asdict

    from linework.cli.extract import executor_for, usable_cores
    from linework.files.survey.open import open_survey
    from linework.methods.choose import choose_methods
    from linework.methods.kinds import ALL_KINDS
    from linework.runs.extract import ExtractionRequest, extract_to
    from linework.runs.opened.points import points_for_pictures
    from linework.runs.opened.recordings import opened_recordings
    from linework.runs.opened.work_folder import work_folder
    from linework.runs.settings import RunSettings

    survey, settings = open_survey([folder / "survey"]), RunSettings()
    order = ExtractionRequest(
        output=folder / "lines.gpkg",
        methods=choose_methods("auto", ALL_KINDS, radon=settings.radon, obb=settings.obb),
        settings=settings,
        parameters={"features": list(ALL_KINDS), "method": "auto", "settings": asdict(settings)},
        overwrite=overwrite,
    )
    work, n_workers = work_folder(survey.root), usable_cores()
    with (
        executor_for(survey, n_workers, settings) as executor,
        opened_recordings(survey, work, images=False, n_threads=n_workers, steps=steps) as recordings,
    ):
        record, found = extract_to(order, recordings, work, executor, steps)
        # Only a run that is resumed may find itself finished; the demo's survey has points
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
    """Compare the lines with the truth, write the report and print its main tables."""
    from linework.cli.evaluate import print_tables
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
            title="A simulated survey, its lines, and how good they are",
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
    """Return the kinds that were looked for and are there to be found, or were found and are not there."""
    there = {str(kind) for lines in (found.lines, truth) for kind in lines.kind}
    return tuple(kind for kind in found.kinds if kind in there)
