"""`linework simulate`: a simulated survey with exact truth, for trials and for measuring accuracy."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from linework.cli.options import AsJson, Overwrite, Quiet
from linework.cli.said import say, say_json


def simulate_command(
    out: Annotated[Path, typer.Option("-o", "--out", help="Output folder.", metavar="DIR")],
    seed: Annotated[
        int, typer.Option("--seed", help="Random seed; determines everything that no option sets.")
    ] = 0,
    length_m: Annotated[float, typer.Option("--length-m", help="Length of the drive [m].")] = 200.0,
    road: Annotated[
        str,
        typer.Option(
            "--road",
            help="Kind of road: straight, bends, urban, motorway, rural, junction, gore, roundabout, village, rails or mixed; "
            "or land without one: forest, field or roofs.",
            metavar="KIND",
        ),
    ] = "straight",
    points_per_m: Annotated[
        float | None,
        typer.Option(
            "--points-per-m",
            help="Approximate number of points per metre of drive; default: drawn from the seed.",
        ),
    ] = None,
    scanner: Annotated[
        str,
        typer.Option(
            "--scanner",
            help="Scanner: default (one or two profile scanners), one, tilted, spinning16, spinning32, spinning64, "
            "spinning128, airborne or terrestrial.",
            metavar="KIND",
        ),
    ] = "default",
    conditions: Annotated[
        str,
        typer.Option(
            "--conditions",
            help="usual, or hard: calibration and navigation errors, poor intensities, noise, mirrored points, rain.",
            metavar="KIND",
        ),
    ] = "usual",
    holes: Annotated[
        bool, typer.Option("--holes", help="Leave stretches of 10 to 60 m without points.")
    ] = False,
    front_wheels: Annotated[
        bool,
        typer.Option("--front-wheels", help="Count the two front wheels in wheels.csv, not the rear ones."),
    ] = False,
    no_images: Annotated[
        bool, typer.Option("--no-images", help="Skip the stereo images, which take minutes.")
    ] = False,
    image_size: Annotated[
        str,
        typer.Option(
            "--image-size", help="Image size: 732x484 (van roof) or 1240x376 (car).", metavar="SIZE"
        ),
    ] = "1240x376",
    image_every_m: Annotated[
        float, typer.Option("--image-every-m", help="Approximate distance between stereo pairs [m].")
    ] = 3.0,
    like: Annotated[
        str,
        typer.Option(
            "--like",
            help="Road, scanner, density and images as in a paper, where not given: radon-2002, obb-2023 or stereo-1992.",
            metavar="PAPER",
        ),
    ] = "",
    overwrite: Overwrite = False,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Simulate a survey with ground truth.

    Writes points (LAZ), the trajectory, stereo images, and truth.gpkg with the exact lines. The same options give
    byte-identical files.
    """
    import numpy as np

    from linework.library.progress import open_display
    from linework.library.simulate import LIKE, simulate_to
    from linework.runs.steps import RunSteps

    # Without images it takes seconds: no progress is shown
    with open_display(quiet=quiet or no_images) as display:
        survey, n_pairs = simulate_to(
            out, RunSteps(display), road=road, seed=seed, length_m=length_m, points_per_m=points_per_m,
            scanner=scanner, conditions=conditions, holes=holes, front_wheels=front_wheels,
            images=not no_images, image_size=image_size, image_every_m=image_every_m, like=like, overwrite=overwrite,
        )  # fmt: skip
    kinds, counts = np.unique(survey.truth.kind, return_counts=True)
    result = {
        "survey": str(out),
        "like": like,
        "road": LIKE[like].road if like and road == "straight" else road,
        "scanner": LIKE[like].scanner if like and scanner == "default" else scanner,
        "conditions": conditions,
        "holes": holes,
        "front_wheels": front_wheels or bool(like and LIKE[like].front_wheels),
        "seed": seed,
        "length_m": length_m,
        "n_points": len(survey.points),
        "n_pairs": n_pairs,
        "n_truth_lines": {str(k): int(n) for k, n in zip(kinds, counts, strict=True)},
    }
    if as_json:
        say_json(result)
        return
    lines = ", ".join(f"{n} {k}" for k, n in result["n_truth_lines"].items())  # type: ignore[attr-defined]
    pairs = f"{n_pairs} stereo pairs, " if n_pairs else ""
    say(f"{out}: {len(survey.points):,} points, {pairs}truth: {lines}")
