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
        bool, typer.Option("--no-images", help="Leave out camera images (this version makes none).")
    ] = False,
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Replace files in a folder that is there.")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print what was made as JSON.")] = False,
) -> None:
    """Simulate a survey: points (LAZ), trajectory, and truth.gpkg with the exact lines.

    The same options make the same bytes.
    """
    import json

    import numpy as np

    from linework.files.publish import check_output_folder
    from linework.simulation.folder import write_survey_folder
    from linework.simulation.simulate import simulate_survey

    del no_images
    check_output_folder(out, overwrite=overwrite)
    survey = simulate_survey(road, seed, length_m, points_per_m=points_per_m)
    write_survey_folder(survey, out, overwrite=overwrite)
    kinds, counts = np.unique(survey.truth.kind, return_counts=True)
    made = {
        "survey": str(out),
        "road": road,
        "seed": seed,
        "length_m": length_m,
        "n_points": len(survey.points),
        "n_truth_lines": {str(k): int(n) for k, n in zip(kinds, counts, strict=True)},
    }
    if as_json:
        typer.echo(json.dumps(made, indent=1))
        return
    lines = ", ".join(f"{n} {k}" for k, n in made["n_truth_lines"].items())  # type: ignore[attr-defined]
    typer.echo(f"{out}: {len(survey.points):,} points, truth: {lines}")
