"""`linework extract`: the main job, from laser points and stereo images to lines."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from linework.cli.ahead import import_ahead
from linework.cli.failures import warn
from linework.cli.first_run import tell_of_compiling

if TYPE_CHECKING:
    from linework.model.survey import Survey
    from linework.tiling.executors import Executor
    from linework.tiling.extraction import Extraction
    from linework.tiling.recordings import Recordings
    from linework.tiling.settings import RunSettings

#: More failures than this are counted, not listed: run.json has all.
MAX_LISTED = 3


def extract(
    surveys: Annotated[
        list[Path],
        typer.Argument(
            metavar="SURVEY...", help="Laser files, a folder of them, a survey folder, or a KITTI drive."
        ),
    ],
    output: Annotated[Path, typer.Option("--output", "-o", help="Lines to write: .gpkg, .geojson, .dxf ...")],
    features: Annotated[
        str,
        typer.Option("--features", help="Kinds to look for, for example guardrail,cable; all if not given."),
    ] = "",
    method: Annotated[
        str, typer.Option("--method", help="auto, obb, radon (laser points) or stereo (images).")
    ] = "auto",
    trajectory: Annotated[
        Path | None,
        typer.Option("--trajectory", help="Where the van was (CSV), its origin, not an antenna's."),
    ] = None,
    config: Annotated[
        Path | None, typer.Option("--config", help="Run file (TOML) with settings; see `linework config`.")
    ] = None,
    crs: Annotated[
        str, typer.Option("--crs", help="EPSG:... or local: the CRS where the files do not say.")
    ] = "",
    workers: Annotated[
        int | None,
        typer.Option("--workers", min=1, max=256, help="Processes to use; all cores if not given."),
    ] = None,
    work: Annotated[
        Path | None,
        typer.Option(
            "--work", help="Folder for points and unfinished runs; .linework beside the survey if not given."
        ),
    ] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Go on with a run that was killed.")] = False,
    report: Annotated[
        Path | None, typer.Option("--report", help="Page (.html) with pictures and tables of the lines.")
    ] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace the output.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print the record of the run as JSON.")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", help="No progress on stderr.")] = False,
) -> None:
    """Find the lines in SURVEY and write them.

    run.json beside them says what was read, with which settings, and how long it took. An output that exists is not touched without --overwrite. Nothing found is no error: the layers are there
    and empty. A run that was killed goes on where it was with --resume.
    """
    from linework.cli.progress import open_display
    from linework.files.reserve import reserved_output

    _check_report(report, output, overwrite=overwrite or resume)
    with contextlib.ExitStack() as held:
        held.enter_context(reserved_output(output, overwrite=overwrite or resume))
        display = held.enter_context(open_display(quiet=quiet))
        from linework.files.survey import open_survey
        from linework.files.vectors import check_format
        from linework.methods.kinds import check_method, kinds_of, parse_kinds
        from linework.tiling.steps import Steps
        from linework.tiling.work_folder import work_folder

        check_format(output)
        kinds = parse_kinds(features) if features else kinds_of(method)
        check_method(method, kinds)
        settings = read_settings(config)
        survey = with_trajectory(open_survey(surveys, crs=crs or None), trajectory)
        kinds = findable_kinds(survey, kinds, asked=bool(features))
        folder, n_workers, steps = work_folder(survey.root, work), workers or usable_cores(), Steps(display)
        executor = held.enter_context(executor_for(survey, n_workers, settings))
        ahead = import_ahead(
            "linework.tiling.extract_to", "linework.methods.choose", "linework.files.vectors_gpkg"
        )
        from linework.tiling.recordings import opened_recordings

        by_images = set(kinds) & set(kinds_of("stereo"))
        wanted = {"laser": method != "stereo", "images": method in ("auto", "stereo") and bool(by_images)}
        recordings = held.enter_context(
            opened_recordings(survey, folder, n_threads=n_workers, steps=steps, **wanted)
        )
        ahead.join()
        from linework.methods.choose import choose_methods, stereo_method
        from linework.tiling.extract_to import Order, extract_to

        tell_of_compiling(kinds, quiet=quiet)
        order = Order(
            output=output,
            methods=choose_methods(method, kinds, radon=settings.radon, obb=settings.obb),
            stereo=stereo_method(method, kinds, settings.stereo),
            settings=settings,
            parameters=_parameters(recordings.survey, kinds, method, crs, settings),
            overwrite=overwrite,
            resume=resume,
        )
        record, found = extract_to(order, recordings, folder, executor, steps)
        if report is not None and found is not None:
            with steps.step("write report"):
                _write_report(report, found, recordings, record, overwrite=overwrite or resume)
    for warning in record["warnings"]:
        warn(warning)
    _print_result(record, as_json=as_json)
    _tell_what_is_missing(record, output)


def findable_kinds(survey: Survey, kinds: tuple[str, ...], *, asked: bool) -> tuple[str, ...]:
    """Return those kinds that can be found in what the survey has; refuse others that were asked for by name."""
    from linework.errors import UsageError
    from linework.methods.kinds import KINDS_OF

    if survey.point_files:
        return kinds
    missing = [kind for kind in kinds if kind not in KINDS_OF["stereo"]]
    if missing and asked:
        raise UsageError(f"{', '.join(missing)}: only laser points show them, and the survey has none",
                         where="--features", advice=f"ask for {','.join(KINDS_OF['stereo'])}")  # fmt: skip
    return tuple(kind for kind in kinds if kind in KINDS_OF["stereo"])


def usable_cores() -> int:
    """Return the cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@contextlib.contextmanager
def executor_for(survey: Survey, n_workers: int, settings: RunSettings) -> Iterator[Executor]:
    """Give what works the tiles: processes, started now, where there will be several tiles and workers."""
    from linework.tiling.executors import Serial
    from linework.tiling.processes import Processes
    from linework.tiling.stores import promised_points

    # Images are many small windows of work: they are worth workers as soon as there are any
    is_small = promised_points(survey) <= settings.tiling.max_points and not survey.settings.get("cameras")
    if n_workers == 1 or is_small:
        yield Serial()
        return
    with Processes(
        n_workers, modules=("linework.tiling.tile_task", "linework.tiling.window_task")
    ) as processes:
        yield processes


def read_settings(path: Path | None) -> RunSettings:
    """Return the settings of a run file; what it does not name keeps its default."""
    import tomllib

    from linework.errors import ConfigError
    from linework.files.las_header import regular_file_bytes
    from linework.model.settings import settings_from
    from linework.tiling.settings import RunSettings

    if path is None:
        return RunSettings()
    regular_file_bytes(path)
    try:
        values = tomllib.loads(path.read_text(encoding="utf-8-sig"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ConfigError(f"not TOML: {error}", where=path, advice="see linework config") from error
    return settings_from(RunSettings, values, where=path)


def with_trajectory(survey: Survey, path: Path | None) -> Survey:
    """Return the survey with this trajectory in the place of its own, whose lever arm goes with it."""
    from dataclasses import replace

    if path is None:
        return survey
    none = (0.0, 0.0, 0.0)
    return replace(survey, trajectory_file=path, trajectory_lever_m=none, trajectory_boresight_deg=none)


def _parameters(
    survey: Survey, kinds: tuple[str, ...], method: str, crs: str, settings: RunSettings
) -> dict[str, Any]:
    """Return everything that was asked for, as it goes into the record."""
    from dataclasses import asdict

    return {
        "features": list(kinds),
        "method": method,
        "crs": crs or None,
        "trajectory": str(survey.trajectory_file) if survey.trajectory_file else None,
        "lever_m": list(survey.trajectory_lever_m),
        "cameras": survey.settings.get("cameras"),
        "settings": asdict(settings),
    }


def _check_report(report: Path | None, output: Path, *, overwrite: bool) -> None:
    """Refuse, before any work, a report that could not be written at the end."""
    from linework.errors import UsageError
    from linework.files.publish import check_output

    if report is None:
        return
    if report.suffix.lower() not in (".html", ".htm"):
        raise UsageError("reports are .html files", where=report, advice="name it something.html")
    if report.absolute() == output.absolute():
        raise UsageError("report and lines are one file", where=report, advice="name two files")
    check_output(report, overwrite=overwrite)


def _write_report(
    report: Path, found: Extraction, recordings: Recordings, record: dict[str, Any], *, overwrite: bool
) -> None:
    """Draw the lines over the points, and list them."""
    from linework.evaluation.report import Report, report_html
    from linework.evaluation.stereo_views import StereoViews
    from linework.files.pages import write_page
    from linework.tiling.overview import points_for_pictures
    from linework.tiling.record import facts_of

    store, stereo = recordings.points.points if recordings.points else None, recordings.stereo
    page = Report(
        title=f"Lines of {found.source}",
        lines=found.lines,
        points=points_for_pictures(store) if store else None,
        points_in=store.points if store else None,
        views=StereoViews(stereo.poses, stereo.numbers, stereo.pair) if stereo else None,
        facts=facts_of(record),
    )
    write_page(report_html(page), report, overwrite=overwrite)


def _print_result(record: dict[str, Any], *, as_json: bool) -> None:
    """Print what was found, by kind."""
    if as_json:
        import json

        typer.echo(json.dumps(record, indent=1, allow_nan=False))
        return
    counts = record["counts"]
    for kind, n_lines in counts["lines"].items():
        typer.echo(f"{kind:14} {n_lines:6,} lines {counts['length_m'][kind]:12,.1f} m")


def _tell_what_is_missing(record: dict[str, Any], output: Path) -> None:
    """Warn where nothing was found; end as unfinished where files or tiles were left out."""
    from linework.errors import PartialError

    if not any(record["counts"]["lines"].values()):
        warn(f"{output}: nothing found: its layers are there and empty")
    failures = record["failures"]
    if failures:
        counts = record["counts"]
        totals = {"file": counts["files"], "tile": counts["tiles"], "stereo pair": counts["stereo_pairs"]}
        left_out = {
            "file": sum("file" in failure for failure in failures),
            "tile": sum("tile" in failure for failure in failures),
            "stereo pair": sum("image" in failure for failure in failures),
        }
        parts = [f"{left_out[name]} of {of} {name}s" for name, of in totals.items() if left_out[name]]
        n_recordings = sum("recording" in failure for failure in failures)
        parts += [f"{n_recordings} recording{'s' * (n_recordings > 1)}"] * bool(n_recordings)
        what = " and ".join(parts)
        listed = "; ".join(
            f"tile {failure['tile']}: {failure['problem']}"
            if "tile" in failure
            else failure["problem"].rstrip(".")
            for failure in failures[:MAX_LISTED]
        )
        more = f" and {len(failures) - MAX_LISTED} more" if len(failures) > MAX_LISTED else ""
        raise PartialError(f"{what} left out: {listed}{more}", where=output, advice="see run.json")
