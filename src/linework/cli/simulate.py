"""`linework simulate`: a made-up survey with exact truth, to try things on and to measure them."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def simulate(
    out: Annotated[Path, typer.Option("-o", "--out", help="Folder to make.", metavar="DIR")],
    seed: Annotated[int, typer.Option("--seed", help="Decides everything that is not given.")] = 0,
    length_m: Annotated[float, typer.Option("--length-m", help="How far the van drives.")] = 200.0,
    road: Annotated[
        str, typer.Option("--road", help="straight, bends, urban or motorway.", metavar="KIND")
    ] = "straight",
    points_per_m: Annotated[
        float | None,
        typer.Option(
            "--points-per-m", help="About how many points per metre; as the seed draws it if not given."
        ),
    ] = None,
    no_images: Annotated[
        bool, typer.Option("--no-images", help="Leave out the stereo images, which take minutes.")
    ] = False,
    image_size: Annotated[
        str,
        typer.Option("--image-size", help="732x484 (a van's roof) or 1240x376 (a car's).", metavar="SIZE"),
    ] = "1240x376",
    image_every_m: Annotated[
        float, typer.Option("--image-every-m", help="About how far the van drives between pairs.")
    ] = 3.0,
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Replace files in a folder that is there.")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print what was made as JSON.")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", help="No progress on stderr.")] = False,
) -> None:
    """Simulate a survey: points (LAZ), trajectory, stereo images, and truth.gpkg with the exact lines.

    The same options make the same bytes.
    """
    import json

    import numpy as np

    from linework.cli.progress import open_display
    from linework.files.output.publish import check_output_folder
    from linework.runs.steps import RunSteps
    from linework.simulation.folder import write_survey_folder
    from linework.simulation.roads.draw import draw_scenario
    from linework.simulation.sensors.cameras import stereo_survey
    from linework.simulation.simulate import survey_of

    check_output_folder(out, overwrite=overwrite)
    scenario = draw_scenario(road, seed, length_m, points_per_m=points_per_m)
    cameras = None if no_images else stereo_survey(scenario, size=image_size, every_m=image_every_m)
    # Without images it takes seconds: nothing is said
    with open_display(quiet=quiet or no_images) as display:
        steps = RunSteps(display)
        with steps.step("scan"):
            survey = survey_of(scenario)
        with steps.step("take images", unit="pairs") as advance:
            write_survey_folder(survey, out, overwrite=overwrite, cameras=cameras, advance=advance)
    kinds, counts = np.unique(survey.truth.kind, return_counts=True)
    made = {
        "survey": str(out),
        "road": road,
        "seed": seed,
        "length_m": length_m,
        "n_points": len(survey.points),
        "n_pairs": len(cameras) if cameras else 0,
        "n_truth_lines": {str(k): int(n) for k, n in zip(kinds, counts, strict=True)},
    }
    if as_json:
        typer.echo(json.dumps(made, indent=1))
        return
    lines = ", ".join(f"{n} {k}" for k, n in made["n_truth_lines"].items())  # type: ignore[attr-defined]
    pairs = f"{len(cameras)} stereo pairs, " if cameras else ""
    typer.echo(f"{out}: {len(survey.points):,} points, {pairs}truth: {lines}")
