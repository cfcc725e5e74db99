"""What the points of a survey show beside its lines: the paint of markings, and the ground that was measured.

Separate from the commands on lines, of which `report`, `compare` and `publish` need it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from linework.evaluation.chainage.dash_ends import DashEnds
    from linework.evaluation.chainage.paint_points import PaintPieces
    from linework.evaluation.changes.ground_seen import GroundAtPlaces, LookAtPlaces, Places
    from linework.model.grid import Bounds
    from linework.model.lines import LineSet
    from linework.model.points import Points
    from linework.runs.steps import RunSteps


#: Places on markings at which it is asked whether a survey has any points.
_SOME = 200


@dataclass(frozen=True, slots=True, kw_only=True)
class LinesAndPoints:
    """The points of a survey, and its lines.

    Parameters
    ----------
    lines
        Lines of the survey.
    paths
        Its points.
    options
        What to leave out where they show no paint.
    crs, allow_outside, allow_remote, work, quiet
        As the command was given.
    """

    lines: LineSet
    paths: list[Path]
    options: tuple[str, ...]
    crs: str | None
    allow_outside: bool
    allow_remote: bool
    work: Path | None
    quiet: bool

    def paint(self) -> PaintPieces:
        """Return what the points show on the markings.

        Raises
        ------
        InputError
            The survey is in another CRS than the lines, or has no intensities.
        """
        from linework.evaluation.chainage.paint_points import paint_pieces

        with (
            self._with_paint() as (points_in, steps),
            steps.step("look at the paint", unit="tiles") as advance,
        ):
            return paint_pieces(self.lines, points_in, advance)

    def paint_and_dashes(self) -> tuple[PaintPieces, DashEnds]:
        """Return what the points show on the markings, and at the ends of their dashes.

        Raises
        ------
        InputError
            As for `paint`.
        """
        from linework.evaluation.chainage.dash_ends import ends_of_dashes
        from linework.evaluation.chainage.paint_along import least_paint_ratios
        from linework.evaluation.chainage.paint_points import paint_pieces

        with self._with_paint() as (points_in, steps):
            with steps.step("look at the paint", unit="tiles") as advance:
                paint = paint_pieces(self.lines, points_in, advance)
            with steps.step("look at the dashes", unit="tiles") as advance:
                return paint, ends_of_dashes(self.lines, least_paint_ratios(paint), points_in, advance)

    @contextmanager
    def _with_paint(self) -> Iterator[tuple[Callable[[Bounds], Points], RunSteps]]:
        """Open the survey for its paint, and say what is wrong with it."""
        from linework.cli.failures import warn

        with self._opened(seeks_paint=True) as (points_in, steps, warnings):
            for warning in warnings:
                warn(warning)
            yield points_in, steps

    def look(self, places: Places) -> GroundAtPlaces:
        """Return what the points show of the ground around each of the places, see `look_at_ground`.

        Raises
        ------
        InputError
            The survey is in another CRS than the lines, or has no points.
        """
        from linework.evaluation.changes.ground_seen import look_at_ground

        with (
            self._opened(seeks_paint=False) as (points_in, steps, _),
            steps.step("look at the ground", unit="tiles") as advance,
        ):
            return look_at_ground(places, points_in, advance)

    @contextmanager
    def _opened(
        self, *, seeks_paint: bool
    ) -> Iterator[tuple[Callable[[Bounds], Points], RunSteps, Sequence[str]]]:
        """Open the survey, yield what reads its points, the steps of the run, and warnings."""
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
            steps = RunSteps(held.enter_context(open_display(quiet=self.quiet)))
            survey = open_survey(
                self.paths, crs=self.crs, allow_outside=self.allow_outside, allow_remote=self.allow_remote
            )
            if self.lines.crs != survey.crs and not same_plan(survey.crs, self.lines.crs):
                raise InputError(
                    f"is in {describe_crs(survey.crs)}, the lines in {describe_crs(self.lines.crs)}", where=self.paths[0],
                    advice="name the survey from which the lines are",
                )  # fmt: skip
            folder = work_folder(survey.root, self.work)
            recordings = held.enter_context(
                opened_recordings(survey, folder, images=False, n_threads=usable_cores(), steps=steps)
            )
            if recordings.points is None or (seeks_paint and not recordings.points.facts.has_intensity):
                raise InputError(
                    "has no points with intensities" if seeks_paint else "has no points",
                    where=self.paths[0],
                    advice=f"leave {' and '.join(argument(o) for o in self.options)} out",
                )
            store = recordings.points.points
            has_intensity = recordings.points.facts.has_intensity
            gains = sampled_gains(*store.block_counts, store.points) if has_intensity else LaserGains()
            yield (
                lambda area: gains.without(
                    store.points(area, ordered=False, with_columns=bool(gains.column))
                ),
                steps,
                recordings.warnings,
            )


def points_of_both(
    old: LinesAndPoints, new: LinesAndPoints, lines_files: tuple[Path, Path]
) -> tuple[tuple[PaintPieces, PaintPieces] | None, float, tuple[LookAtPlaces, LookAtPlaces]]:
    """Return what the points of two surveys show on their markings, how much of it can be compared at most [m], and looks.

    Without markings in one of them, or paint that its points show, there is no paint to compare.

    Parameters
    ----------
    old, new
        The surveys.
    lines_files
        The files of their lines.

    Raises
    ------
    InputError
        As for `LinesAndPoints.paint`, or a survey has no points beside any of its markings.
    """
    import numpy as np

    from linework.cli.failures import warn
    from linework.errors import InputError
    from linework.evaluation.chainage.paint_along import paint_left
    from linework.evaluation.changes.ground_seen import marking_places

    looks = old.look, new.look
    if not all("lane_marking" in survey.lines.kind for survey in (old, new)):
        return None, 0.0, looks
    found, known_m = [], []
    for path, survey in zip(lines_files, (old, new), strict=True):
        shown = survey.paint()
        is_known = np.isfinite(paint_left(shown)[0])
        if not is_known.any():
            if not survey.look(marking_places(survey.lines, _SOME)).number.any():
                raise InputError(
                    f"has no points beside any marking of {path}", where=survey.paths[0],
                    advice="give the points from which these lines are",
                )  # fmt: skip
            warn(
                f"{survey.paths[0]}: too few points on the markings of {path} to tell their paint: it is not compared."
            )
        found.append(shown)
        known_m.append(float(shown.length_m[is_known].sum()))
    return ((found[0], found[1]) if all(known_m) else None), min(known_m), looks
