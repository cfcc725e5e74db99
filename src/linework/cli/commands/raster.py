"""`linework raster`: a survey as raster images, GeoTIFF for GIS and PNG for viewing."""

from __future__ import annotations

import math
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from linework.cli.failures import warn
from linework.cli.options import (
    AllowOutside,
    AllowRemote,
    AsJson,
    Crs,
    Overwrite,
    Quiet,
    SurveyArgument,
    TrajectoryFile,
    WorkFolder,
)
from linework.cli.said import say, say_json

if TYPE_CHECKING:
    from collections.abc import Mapping

    from linework.arrays import Float32Array
    from linework.files.store.in_memory import SurveyPoints
    from linework.methods.radon.figures import CandidateLines, FigureConfig
    from linework.model.grid import Grid
    from linework.model.ground import Ground
    from linework.model.points import Points
    from linework.model.survey import Survey
    from linework.model.trajectory import Trajectory
    from linework.runs.opened.points import SurveyInMemory
    from linework.runs.steps import RunSteps

#: Cell sizes allowed [m]. Cells below a millimetre show nothing more, and a square kilometre has 10^12 of them.
_CELL_RANGE_M = (0.001, 1000.0)
#: Longest candidate line that can be asked for [m].
_LONGEST_M = 10_000.0


def raster(
    surveys: SurveyArgument,
    output: Annotated[Path, typer.Option("--output", "-o", metavar="DIR", help="Output folder.")],
    cell_m: Annotated[float, typer.Option("--cell-m", help="Cell size of the north-up grid [m].")] = 0.20,
    cell_along_m: Annotated[
        str,
        typer.Option(
            "--cell-along-m",
            help="Cell size along the main direction [m], with the grid rotated to it; auto: scan-line spacing.",
        ),
    ] = "",
    cell_across_m: Annotated[
        float,
        typer.Option(
            "--cell-across-m",
            show_default=False,
            help="Cell size across the main direction [m]; default: --cell-m.",
        ),
    ] = math.nan,
    min_height_m: Annotated[
        float, typer.Option("--min-height-m", help="Binary image: minimum height above the road [m].")
    ] = 0.2,
    max_height_m: Annotated[
        float, typer.Option("--max-height-m", help="Binary image: maximum height above the road [m].")
    ] = 1.2,
    peaks: Annotated[
        str,
        typer.Option(
            "--peaks",
            help="Radon image: peaks of its narrow ridges (ours), or of itself in the maximum image (published).",
        ),
    ] = "ours",
    threshold_m: Annotated[
        float,
        typer.Option("--threshold", metavar="M", help="Radon image: least occupied length of a line [m]."),
    ] = 8.0,
    candidates: Annotated[
        Path | None,
        typer.Option(
            "--candidates",
            metavar="FILE",
            help="Also write the candidate lines with theta, rho and strength: .gpkg or .csv.",
        ),
    ] = None,
    pair: Annotated[
        int | None,
        typer.Option(
            "--pair",
            metavar="N",
            help="Instead of points: the steps of detection in stereo pair N, as published.",
        ),
    ] = None,
    trajectory: TrajectoryFile = None,
    crs: Crs = None,
    allow_outside: AllowOutside = False,
    allow_remote: AllowRemote = False,
    work: WorkFolder = None,
    overwrite: Overwrite = False,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Rasterise SURVEY to GeoTIFF and PNG images.

    The images show density, heights, intensity, road, the binary image and its Radon image. run.json is written beside
    them. With --pair they show what bright lines of one stereo pair become, step by step.
    """
    from linework.errors import PartialError, check_extra

    if pair is not None:
        _publish_pair(surveys, pair, output, crs=crs, allow_outside=allow_outside, allow_remote=allow_remote, work=work,
                      overwrite=overwrite, as_json=as_json, quiet=quiet)  # fmt: skip
        return

    check_extra("reports", where="raster")
    from linework.files.output.locks import reserve_folder, reserve_output
    from linework.files.survey.open import open_survey
    from linework.library.progress import open_display
    from linework.runs.steps import RunSteps

    cells = _cells(cell_m, cell_along_m, cell_across_m)
    config = _config((min_height_m, max_height_m), peaks, threshold_m)
    _check_band(config)
    _check_candidates(candidates)
    with (
        reserve_folder(output, overwrite=overwrite, inputs=[trajectory]),
        reserve_output(candidates, overwrite=overwrite, inputs=[trajectory]) if candidates else nullcontext(),
        open_display(quiet=quiet) as display,
    ):
        steps = RunSteps(display)
        survey = open_survey(surveys, crs=crs, allow_outside=allow_outside, allow_remote=allow_remote)
        if trajectory is not None:
            survey = survey.with_trajectory(trajectory)
        opened = _read(survey, work, steps)
        read, path = opened.points, opened.trajectory
        grid = _grid(survey, read.points, path, cells)
        lines: list[CandidateLines] = []
        record = _publish(
            survey, read, path, (grid, config), output, overwrite=overwrite, steps=steps, candidates=lines,
            hashes=opened.hashes,
        )  # fmt: skip
        if candidates is not None:
            _write_candidates(lines[0], survey.crs, candidates, overwrite=overwrite)
    for warning in opened.warnings:
        warn(warning)
    if as_json:
        say_json(record)
    else:
        say(*_summary(record, output))
    if read.failures:
        listed = "; ".join(problem.rstrip(".") for _, problem in read.failures)
        raise PartialError(
            f"{len(read.failures)} files left out: {listed}", where=output, advice="see run.json"
        )


def _cells(cell_m: float, along: str, across_m: float) -> tuple[float | None, float, float]:
    """Return the north-up cell size (None: a rotated grid), and the cell sizes along and across the main direction [m].

    NaN along the main direction stands for the scan-line spacing, which is measured later.
    """
    from linework.errors import UsageError

    def checked(name: str, value: float) -> float:
        low_m, high_m = _CELL_RANGE_M
        if not low_m <= value <= high_m:
            raise UsageError(f"{name} is {value:g}, expected {low_m:g} to {high_m:g} m", where="raster")
        return value

    cell_m = checked("--cell-m", cell_m)
    turned = bool(along) or not math.isnan(across_m)
    if not turned:
        return cell_m, cell_m, cell_m
    across = cell_m if math.isnan(across_m) else checked("--cell-across-m", across_m)
    if along == "auto":
        return None, math.nan, across
    try:
        value = float(along) if along else cell_m
    except ValueError:
        raise UsageError(
            f"--cell-along-m is {along!r}, expected a number of metres or auto", where="raster"
        ) from None
    return None, checked("--cell-along-m", value), across


def _config(band_m: tuple[float, float], peaks: str, threshold_m: float) -> FigureConfig:
    """Return the settings of the figures.

    Raises
    ------
    UsageError
        There is no such rule for peaks, or the threshold is no length.
    """
    from linework.errors import UsageError, did_you_mean
    from linework.methods.radon.figures import FigureConfig

    if peaks not in ("ours", "published"):
        raise UsageError(
            f"unknown rule {peaks!r}" + did_you_mean([peaks], ("ours", "published")), where="--peaks",
            advice="choose ours or published",
        )  # fmt: skip
    if not 0.0 <= threshold_m <= _LONGEST_M:
        raise UsageError(f"--threshold is {threshold_m:g}, expected 0 to {_LONGEST_M:g} m", where="raster")
    config = FigureConfig(low_m=band_m[0], high_m=band_m[1], min_length_m=threshold_m)
    return replace(config, ridge_m=0.0, by_maximum=True) if peaks == "published" else config


def _check_candidates(path: Path | None) -> None:
    from linework.errors import UsageError

    if path is not None and path.suffix.lower() not in (".gpkg", ".csv"):
        raise UsageError(
            f"cannot write candidate lines as '{path.suffix}'", where=path, advice="use .gpkg or .csv"
        )


def _write_candidates(found: CandidateLines, crs: str, path: Path, *, overwrite: bool) -> None:
    """Write candidate lines across the image, the strongest first, with their place in the Radon image."""
    import numpy as np

    from linework.files.maps.row_tables import write_rows
    from linework.methods.radon.figures import line_ends

    peaks = found.peaks
    rows = [
        [rank + 1, round(float(np.degrees(theta)), 4), round(float(rho), 4), round(float(strength), 3)]
        for rank, (theta, rho, strength) in enumerate(
            zip(peaks.theta_rad, peaks.rho_m, peaks.strength_m, strict=True)
        )
    ]
    pieces = [np.column_stack([ends, np.zeros(2)]) for ends in line_ends(peaks, found.radon)]
    names = ("rank", "theta_deg", "rho_m", "strength_m")
    write_rows(names, rows, pieces, crs, path, layer="candidate", by="rank", overwrite=overwrite)


def _publish_pair(
    surveys: list[Path], number: int, output: Path, *, crs: str | None, allow_outside: bool, allow_remote: bool, work: Path | None,
    overwrite: bool, as_json: bool, quiet: bool,
) -> None:  # fmt: skip
    """Write the images of each step of detection in a stereo pair, and the chain codes of its lines."""
    import json

    from linework.errors import InputError
    from linework.files.images.read import write_grey_png
    from linework.files.output.locks import reserve_folder
    from linework.files.output.publish import publish_folder
    from linework.files.survey.open import open_survey
    from linework.library.progress import open_display
    from linework.published import stereo_1992
    from linework.runs.opened.recordings import opened_recordings
    from linework.runs.opened.work_folder import work_folder
    from linework.runs.steps import RunSteps

    with reserve_folder(output, overwrite=overwrite), open_display(quiet=quiet) as display:
        survey = open_survey(surveys, crs=crs, allow_outside=allow_outside, allow_remote=allow_remote)
        folder = work_folder(survey.root, work)
        with opened_recordings(survey, folder, laser=False, steps=RunSteps(display)) as recordings:
            stereo = recordings.stereo
            if stereo is None:
                raise InputError("no stereo images in this survey", where=survey.name)
            numbers = stereo.numbers
            if number not in numbers:
                raise InputError(
                    f"no stereo pair {number} with a pose", where=survey.name,
                    advice=f"choose from {numbers.min()} to {numbers.max()}",
                )  # fmt: skip
            pair = stereo.pair(number)
        window = stereo_1992.search_window(pair.rig)
        images = {
            f"{side}_{name}": image
            for side, own in (("left", pair.left), ("right", pair.right))
            for name, image in stereo_1992.images_of_steps(own, window).items()
        }
        chains = {}
        for side in ("left", "right"):
            found = stereo_1992.chain_code(images[f"{side}_thinned"] > 0)
            lines = [found.line(i) for i in range(len(found))]
            chains[side] = [
                {"start": line[0].tolist(), "codes": stereo_1992.codes_of(line)} for line in lines
            ]

        def write(part: Path) -> None:
            for name, image in images.items():
                write_grey_png(image, part / f"{name}.png")
            (part / "chains.json").write_text(json.dumps(chains, indent=1) + "\n", encoding="utf-8")

        def verify(part: Path) -> None:
            json.loads((part / "chains.json").read_text(encoding="utf-8"))

        publish_folder(output, write, verify, overwrite=overwrite)
    if as_json:
        say_json({"pair": number, "images": list(images), "lines": {k: len(v) for k, v in chains.items()}})
    else:
        say(f"{len(images)} images of pair {number} in {output}, {len(chains['left'])} lines in the left one")


def _check_band(config: FigureConfig) -> None:
    from linework.errors import UsageError

    if not config.low_m < config.high_m:
        raise UsageError(
            f"--min-height-m {config.low_m:g} is not below --max-height-m {config.high_m:g}", where="raster"
        )


def _read(survey: Survey, work: Path | None, steps: RunSteps) -> SurveyInMemory:
    """Return the points and trajectory of the survey, in memory."""
    from linework.processes.system import usable_cores
    from linework.runs.opened.points import opened_survey, read_into_memory
    from linework.runs.opened.work_folder import work_folder

    folder = work_folder(survey.root, work)
    with opened_survey(survey, folder, n_threads=usable_cores(), steps=steps) as opened:
        return read_into_memory(opened)


def _grid(
    survey: Survey, points: Points, path: Trajectory | None, cells: tuple[float | None, float, float]
) -> Grid:
    from linework.errors import InputError
    from linework.imaging.raster import grid_for, main_direction_grid
    from linework.imaging.scan_lines import scan_line_spacing_m

    cell_m, along_m, across_m = cells
    try:
        if cell_m is not None:
            return grid_for(points, cell_m)
        if math.isnan(along_m):
            along_m = scan_line_spacing_m(points, path)
        return main_direction_grid(points, along_m, across_m, trajectory=path)
    except InputError as error:
        raise InputError(error.problem, where=survey.name, advice=error.advice) from error


def _publish(
    survey: Survey,
    read: SurveyPoints,
    path: Trajectory | None,
    what: tuple[Grid, FigureConfig],
    output: Path,
    *,
    overwrite: bool,
    steps: RunSteps,
    candidates: list[CandidateLines],
    hashes: Mapping[Path, str],
) -> dict[str, Any]:
    """Write all images and run.json to a folder atomically, and return the record."""
    from linework.crs import describe_crs, epsg_text
    from linework.files.images.geotiff import write_geotiff
    from linework.files.output.publish import publish_folder
    from linework.files.output.record import write_json
    from linework.methods.radon.figures import raster_figures
    from linework.surface.road import RoadConfig, find_ground, height_above_road, is_road_point

    grid, config = what
    with steps.step("find the road"):
        surface = find_ground(read.points, path, RoadConfig())
        height_m = height_above_road(surface, read.points.xyz)
        is_road = is_road_point(surface, read.points.xyz)
        normal = _normalised(read.points, surface, path)
    crs_name = (
        "local coordinates" if survey.crs == "local" else epsg_text(survey.crs) or describe_crs(survey.crs)
    )
    record: dict[str, Any] = {}
    names: list[str] = []

    def write(folder: Path) -> None:
        with steps.step("draw images", unit="images"):
            for figure in raster_figures(
                read.points, height_m, is_road, grid, config, crs_name=crs_name, normal=normal,
                candidates=candidates,
            ):  # fmt: skip
                crs = survey.crs if figure.in_world else "local"
                write_geotiff(figure.image, folder / f"{figure.name}.tif", crs=crs)
                (folder / f"{figure.name}.png").write_bytes(figure.png)
                names.append(figure.name)
        record.update(_record(survey, read, what, names, steps, hashes))
        write_json(record, folder / "run.json")

    def verify(folder: Path) -> None:
        for name in names:
            picture = (folder / f"{name}.png").read_bytes()
            if not (picture.startswith(b"\x89PNG") and picture.endswith(b"IEND\xaeB`\x82")):
                raise OSError(f"{name}.png cannot be read back")

    publish_folder(output, write, verify, overwrite=overwrite)
    return record


def _normalised(points: Points, surface: Ground, path: Trajectory | None) -> Float32Array | None:
    from linework.scanlines.fields import laser_column
    from linework.surface.intensity import normalised_intensity

    if points.intensity is None:
        return None
    laser = laser_column(points)
    return normalised_intensity(points, surface, path, points.columns[laser] if laser else None)[0]


def _record(
    survey: Survey, read: SurveyPoints, what: tuple[Grid, FigureConfig], names: list[str], steps: RunSteps,
    hashes: Mapping[Path, str],
) -> dict[str, Any]:  # fmt: skip
    """Return the content of run.json."""
    from dataclasses import asdict

    from linework.crs import describe_crs
    from linework.runs.extraction import input_record
    from linework.runs.record import versions

    grid, config = what
    return {
        "command": "raster",
        "versions": versions(),
        "crs": {"name": describe_crs(survey.crs), "wkt": survey.crs},
        "parameters": {"grid": asdict(grid), **asdict(config)},
        "inputs": [
            {**input_record(facts.path, hashes[facts.path]), "points": facts.n_points} for facts in read.files
        ],
        "counts": {
            "points_used": len(read.points),
            "points_rejected": dict(read.rejected),
            "cells": grid.n_rows * grid.n_cols,
        },
        "images": names,
        "warnings": list(read.warnings),
        "failures": [{"file": str(path), "problem": problem} for path, problem in read.failures],
        "timings_s": {name: round(seconds, 3) for name, seconds in steps.timings_s.items()},
    }


def _summary(record: dict[str, Any], output: Path) -> tuple[str, str]:
    grid, counts = record["parameters"]["grid"], record["counts"]
    turned = f", rotated {grid['rotation_deg']:.2f} deg" if grid["rotation_deg"] else ""
    return (
        f"{counts['points_used']:,} points on {grid['n_rows']:,} x {grid['n_cols']:,} cells of "
        f"{grid['cell_width_m']:.3g} x {grid['cell_height_m']:.3g} m{turned}",
        f"{len(record['images'])} images in {output}: {', '.join(record['images'])}",
    )
