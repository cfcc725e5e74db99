"""`linework locate`: a smoothed trajectory with sigmas from GNSS, gyros and wheel counters."""

from __future__ import annotations

import contextlib
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from linework.cli.failures import warn
from linework.cli.options import AllowOutside, AllowRemote, AsJson, Crs, Overwrite, Quiet
from linework.cli.said import say, say_json

if TYPE_CHECKING:
    from linework.navigation.located import LocatedDrive


def locate_command(
    surveys: Annotated[
        list[Path], typer.Argument(metavar="SURVEY", help="Survey folder with [navigation] in survey.toml.")
    ],
    output: Annotated[Path, typer.Option("--output", "-o", metavar="FILE", help="Output trajectory: .csv.")],
    rate_hz: Annotated[float, typer.Option("--rate-hz", help="Output rate [Hz].")] = 50.0,
    longest_outage_s: Annotated[
        float,
        typer.Option(
            "--longest-outage-s",
            help="Longest GNSS outage bridged in full [s]; the middle of longer ones gets no poses.",
        ),
    ] = 180.0,
    plot: Annotated[
        Path | None,
        typer.Option("--plot", metavar="FILE", help="Also plot track, sigmas and residuals: .png or .html."),
    ] = None,
    crs: Crs = None,
    allow_outside: AllowOutside = False,
    allow_remote: AllowRemote = False,
    overwrite: Overwrite = False,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Compute a trajectory from GNSS, gyro and wheel logs.

    Writes smoothed poses with their standard deviations. GNSS outages are bridged by dead reckoning. Where an outage
    is too long for that, or the clock jumps, there are no poses, and the exit code is 4.
    """
    from linework.errors import PartialError
    from linework.files.output.locks import reserve_output
    from linework.library.progress import open_display

    _check_plot(plot)
    with contextlib.ExitStack() as held:
        for path in (output, *((plot,) if plot else ())):
            held.enter_context(reserve_output(path, overwrite=overwrite))
        display = held.enter_context(open_display(quiet=quiet))
        from linework.files.survey.open import open_survey
        from linework.files.trajectories.read import write_trajectory
        from linework.library.read import located_drive, spans_without_poses
        from linework.runs.steps import RunSteps

        steps = RunSteps(display)
        survey = open_survey(surveys, crs=crs, allow_outside=allow_outside, allow_remote=allow_remote)
        located, warnings = located_drive(
            survey, rate_hz=rate_hz, longest_outage_s=longest_outage_s, steps=steps
        )
        with steps.step("write the trajectory"):
            if plot is not None:
                _write_plot(located, plot, overwrite=overwrite)
            write_trajectory(located.trajectory, output, overwrite=overwrite)
    for text in warnings:
        warn(text)
    _print(located, output, as_json=as_json)
    if problem := spans_without_poses(located):
        raise PartialError(
            problem, where=output, advice="there the GNSS outage is too long or the clock jumps"
        )


def _check_plot(plot: Path | None) -> None:
    from linework.errors import UsageError, check_extra

    if plot is not None and plot.suffix.lower() not in (".png", ".html"):
        raise UsageError(
            f"cannot write a plot as '{plot.suffix}'", where="--plot", advice="use .png or .html"
        )
    if plot is not None:
        check_extra("reports", where="--plot")


def _write_plot(located: LocatedDrive, plot: Path, *, overwrite: bool) -> None:
    from linework.evaluation.report.scores_figure import plot_png
    from linework.evaluation.report.track import track_figure, track_page
    from linework.files.output.publish import write_bytes, write_page

    if plot.suffix.lower() == ".png":
        write_bytes(plot_png(track_figure(located)), plot, overwrite=overwrite)
    else:
        write_page(track_page(located, _rows(located)), plot, overwrite=overwrite)


def _results(located: LocatedDrive) -> dict[str, Any]:
    """Return the results as a document for JSON."""
    import numpy as np

    poses = located.trajectory
    assert poses.sigma_xyz_m is not None
    sigma = np.hypot(*poses.sigma_xyz_m[:, :2].T)
    length = located.outages_s[:, 1] - located.outages_s[:, 0]
    return {
        "n_poses": len(poses),
        "duration_s": float(poses.time_s[-1] - poses.time_s[0]),
        "distance_m": located.distance_m,
        "n_fixes": len(located.fix_time_s),
        "n_outliers": int(np.count_nonzero(located.is_outlier)),
        "outages_s": located.outages_s.tolist(),
        "longest_outage_s": float(length.max()) if len(length) else 0.0,
        "left_out_s": located.left_out_s.tolist(),
        "sigma_plan_median_m": float(np.median(sigma)),
        "sigma_plan_largest_m": float(sigma.max()),
        "sigma_plan_largest_at_s": float(poses.time_s[int(np.argmax(sigma))]),
        "stretches": [
            {
                "first_s": s.first_s,
                "last_s": s.last_s,
                "estimates": {k: {"value": v, "sigma": e} for k, (v, e) in s.estimates.items()},
            }
            for s in located.stretches
        ],
    }


def _rows(located: LocatedDrive) -> list[tuple[str, str]]:
    """Return the results as names and texts of a table."""
    r = _results(located)
    rows = [
        ("drive", f"{r['duration_s']:,.1f} s, {r['distance_m'] / 1000.0:,.3f} km, {r['n_poses']:,} poses"),
        ("fixes", f"{r['n_fixes']:,}, {r['n_outliers']:,} outliers"),
        ("outages", f"{len(r['outages_s'])}, longest {r['longest_outage_s']:.1f} s; "
                    f"{sum(b - a for a, b in r['left_out_s']):.1f} s without poses"),
        ("horizontal sigma", f"median {r['sigma_plan_median_m']:.3f} m, largest {r['sigma_plan_largest_m']:.3f} m "
                          f"(at {r['sigma_plan_largest_at_s']:.1f} s)"),
    ]  # fmt: skip
    for stretch in r["stretches"]:
        found = [f"{k} {v['value']:.6g} (sigma {v['sigma']:.2g})" for k, v in stretch["estimates"].items()]
        rows.append(
            (f"from {stretch['first_s']:.1f} s" if len(r["stretches"]) > 1 else "sensors", ", ".join(found))
        )
    return rows


def _print(located: LocatedDrive, output: Path, *, as_json: bool) -> None:
    if as_json:
        document = {**_results(located), "warnings": list(located.warnings), "output": str(output)}
        say_json(document)
        return
    for name, text in _rows(located):
        say(f"{name}: {text}")
