"""What the points of a survey show on its markings, and of the ground beside lines, for commands on lines.

Separate from the commands, as `report` and `compare` both need it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from linework.arrays import IntArray
    from linework.evaluation.chainage.paint_points import PaintPieces
    from linework.evaluation.changes.ground_seen import LookAtPlaces, Places
    from linework.model.grid import Bounds
    from linework.model.lines import LineSet
    from linework.model.points import Points
    from linework.runs.steps import RunSteps


def points_of_both(
    old: tuple[Path, LineSet, list[Path]], new: tuple[Path, LineSet, list[Path]], *, crs: str | None,
    allow_outside: bool, allow_remote: bool, work: Path | None, quiet: bool,
) -> tuple[tuple[PaintPieces, PaintPieces] | None, float, tuple[LookAtPlaces, LookAtPlaces]]:  # fmt: skip
    """Return what the points of two surveys show on their markings, how much of it can be compared at most [m], and looks.

    Without markings in one of them there is no paint to compare.

    Parameters
    ----------
    old, new
        File of lines, its lines, and the points of the survey.

    Raises
    ------
    InputError
        As for `paint_of_survey`, or a survey shows no paint of any of its markings.
    """
    from functools import partial

    import numpy as np

    from linework.errors import InputError
    from linework.evaluation.chainage.paint_along import paint_left
    from linework.evaluation.changes.ground_seen import fewest_points

    def look(places: Places, lines: LineSet, paths: list[Path]) -> IntArray:
        with _opened_points(
            lines, paths, ("old_survey", "new_survey"), crs=crs, allow_outside=allow_outside, allow_remote=allow_remote,
            work=work, quiet=quiet, seeks_paint=False,
        ) as (points_in, steps, _), steps.step("look at the ground", unit="tiles") as advance:  # fmt: skip
            return fewest_points(places, points_in, advance)

    looks = partial(look, lines=old[1], paths=old[2]), partial(look, lines=new[1], paths=new[2])
    if not all("lane_marking" in lines.kind for _, lines, _ in (old, new)):
        return None, 0.0, looks
    found, known_m = [], []
    for path, lines, survey in (old, new):
        shown = paint_of_survey(
            lines,
            survey,
            ("old_survey", "new_survey"),
            crs=crs,
            allow_outside=allow_outside,
            allow_remote=allow_remote,
            work=work,
            quiet=quiet,
        )
        is_known = np.isfinite(paint_left(shown)[0])
        if not is_known.any():
            raise InputError(
                f"shows no paint of any marking of {path}", where=survey[0],
                advice="give the points from which these lines are",
            )  # fmt: skip
        found.append(shown)
        known_m.append(float(shown.length_m[is_known].sum()))
    return (found[0], found[1]), min(known_m), looks


def paint_of_survey(
    lines: LineSet,
    paths: list[Path],
    options: tuple[str, ...],
    *,
    crs: str | None,
    allow_outside: bool,
    allow_remote: bool,
    work: Path | None,
    quiet: bool,
) -> PaintPieces:
    """Return what the points of a survey show on the markings.

    Parameters
    ----------
    lines
        Lines of the survey.
    paths
        Its points.
    options
        What to leave out where they show no paint.

    Raises
    ------
    InputError
        It is in another CRS than the lines, or has no intensities.
    """
    from linework.cli.failures import warn
    from linework.evaluation.chainage.paint_points import paint_pieces

    with _opened_points(
        lines, paths, options, crs=crs, allow_outside=allow_outside, allow_remote=allow_remote, work=work, quiet=quiet,
        seeks_paint=True,
    ) as opened:  # fmt: skip
        points_in, steps, warnings = opened
        for warning in warnings:
            warn(warning)
        with steps.step("look at the paint", unit="tiles") as advance:
            return paint_pieces(lines, points_in, advance)


@contextmanager
def _opened_points(
    lines: LineSet,
    paths: list[Path],
    options: tuple[str, ...],
    *,
    crs: str | None,
    allow_outside: bool,
    allow_remote: bool,
    work: Path | None,
    quiet: bool,
    seeks_paint: bool,
) -> Iterator[tuple[Callable[[Bounds], Points], RunSteps, Sequence[str]]]:
    """Open the points of a survey, yield what reads them, the steps of the run, and warnings; as for `paint_of_survey`."""
    import contextlib

    from linework.crs import describe_crs, same_plan
    from linework.errors import InputError, argument
    from linework.files.survey.open import open_survey
    from linework.library.progress import open_display
    from linework.model.tile import LaserGains
    from linework.processes.system import usable_cores
    from linework.runs.opened.recordings import opened_recordings
    from linework.runs.opened.work_folder import work_folder
    from linework.runs.steps import RunSteps
    from linework.scanlines.sampled import sampled_gains

    with contextlib.ExitStack() as held:
        steps = RunSteps(held.enter_context(open_display(quiet=quiet)))
        survey = open_survey(paths, crs=crs, allow_outside=allow_outside, allow_remote=allow_remote)
        if lines.crs != survey.crs and not same_plan(survey.crs, lines.crs):
            raise InputError(
                f"is in {describe_crs(survey.crs)}, the lines in {describe_crs(lines.crs)}", where=paths[0],
                advice="name the survey from which the lines are",
            )  # fmt: skip
        folder = work_folder(survey.root, work)
        recordings = held.enter_context(
            opened_recordings(survey, folder, images=False, n_threads=usable_cores(), steps=steps)
        )
        if recordings.points is None or (seeks_paint and not recordings.points.facts.has_intensity):
            raise InputError(
                "has no points with intensities" if seeks_paint else "has no points",
                where=paths[0],
                advice=f"leave {' and '.join(argument(o) for o in options)} out",
            )
        store = recordings.points.points
        gains = sampled_gains(*store.block_counts, store.points) if seeks_paint else LaserGains()
        yield (
            lambda area: gains.without(store.points(area, ordered=False, with_columns=bool(gains.column))),
            steps,
            recordings.warnings,
        )
