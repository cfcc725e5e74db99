"""Sources of pieces: the laser points and the stereo pairs of a survey, in the same shape for every run.

Separate from `find`, which treats all sources alike: this holds what differs between laser points and stereo pairs.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar, Protocol

import numpy as np

from linework.errors import InputError, LineworkError, PartialError, UsageError, argument
from linework.files.output.parts import write_part
from linework.files.store.facts import StoreFacts
from linework.files.store.layout import STORE_BLOCK_M
from linework.methods.protocol import Method, SurveyContext
from linework.model.ground import Ground
from linework.model.lines import LineSet
from linework.model.tile import local_origin
from linework.processes.executors import Executor
from linework.runs.extraction import Failure, PairAccount, TileReport, with_sources
from linework.runs.opened.pairs import OpenedStereo
from linework.runs.opened.points import OpenedSurvey, surface_of
from linework.runs.opened.recordings import Recordings
from linework.runs.opened.surface import SurveySight, SurveySurface
from linework.runs.own import GroundFinder, sent_method
from linework.runs.pieces import TiledPoints, TilePiece, windows_of
from linework.runs.resume import RunFolder
from linework.runs.settings import RunSettings, TilingConfig
from linework.runs.steps import RunSteps
from linework.runs.tasks import RunTask, TasksDone
from linework.runs.tiles import Tile, plan_tiles
from linework.scanlines.sampled import sampled_timing
from linework.surface.aside import RoadAside


@dataclass(frozen=True, slots=True, kw_only=True)
class SourceAccount:
    """What was looked at in a source and what was left out.

    Parameters
    ----------
    failures
        Tiles or images that were left out.
    is_empty
        Whether nothing at all was looked at.
    read, tiles
        Of laser points: the account of their files, and of the tiles.
    pairs
        Of stereo pairs: how many there are, and how many were used.
    aside
        Of laser points: how much is road, and how much smooth ground beside it is not.
    """

    failures: tuple[Failure, ...]
    is_empty: bool
    read: StoreFacts | None = None
    tiles: tuple[TileReport, ...] = ()
    pairs: PairAccount | None = None
    aside: RoadAside | None = None


class Source(Protocol):
    """A recording of a survey, cut into pieces."""

    @property
    def methods(self) -> Sequence[Method]:
        """The methods that look at it, in the order in which their lines are listed."""
        ...

    @property
    def looking(self) -> tuple[str, str]:
        """Name of the step that does the tasks, and the unit its progress is counted in."""
        ...

    @property
    def joining(self) -> str:
        """Name of the step that joins what they find."""
        ...

    def tasks(self, results: Path) -> list[RunTask]:
        """Return the tasks of all methods, their results in a folder."""
        ...

    def context(self, method: Method) -> SurveyContext:
        """Return what a method must know of the survey to join what it found."""
        ...

    def with_sources(self, lines: LineSet) -> LineSet:
        """Return the lines with the names of the files that show them."""
        ...

    def account(self, done: TasksDone) -> SourceAccount:
        """Return what was looked at, and what was left out."""
        ...

    def refusal(self, account: SourceAccount) -> LineworkError:
        """Return the error of a survey of which nothing could be looked at."""
        ...


def open_sources(
    recordings: Recordings,
    methods: Sequence[Method],
    run: RunFolder,
    settings: RunSettings,
    executor: Executor,
    steps: RunSteps,
    ground: Ground | GroundFinder | None = None,
) -> list[Source]:
    """Return the sources that a survey has and that some method looks at; points come first."""
    of_points = [method for method in methods if method.recording == "points"]
    of_pairs = [method for method in methods if method.recording == "pairs"]
    found: list[Source] = []
    if recordings.points is not None and of_points:
        _check_columns(of_points, recordings.points.facts)
        surface = surface_of(recordings.points, settings.road, executor, steps, ground)
        found.append(LaserSource.of(recordings.points, surface, of_points, settings.tiling, run))
    if recordings.stereo is not None and of_pairs:
        found.append(StereoSource(recordings.stereo, of_pairs))
    return found


def _check_columns(methods: Sequence[Method], facts: StoreFacts) -> None:
    """Refuse points without the further columns that a method needs.

    Raises
    ------
    UsageError
        The message names the column and the method.
    """
    for method in methods:
        for name in getattr(method, "carry", ()):
            if name not in facts.columns:
                there = ", ".join(facts.columns) or "none"
                raise UsageError(
                    f"method {method.name} needs the column {name!r}; further columns of the points: {there}",
                    where=argument("carry"), advice="name an extra dimension that all laser files have",
                )  # fmt: skip


@dataclass(frozen=True, slots=True)
class LaserSource:
    """Laser points in tiles.

    Parameters
    ----------
    plans
        Tiles of each method, in the order of the methods.
    survey
        What all tiles share.
    """

    opened: OpenedSurvey
    surface: SurveySurface
    methods: Sequence[Method]
    plans: Sequence[tuple[Tile, ...]]
    survey: TiledPoints

    looking: ClassVar[tuple[str, str]] = ("find lines", "tiles")
    joining: ClassVar[str] = "join lines"

    @classmethod
    def of(
        cls,
        opened: OpenedSurvey,
        surface: SurveySurface,
        methods: Sequence[Method],
        tiling: TilingConfig,
        run: RunFolder,
    ) -> LaserSource:
        """Plan the tiles of each method, and write the path of the vehicle where every process can read it."""
        path, store = None, opened.points
        if opened.trajectory is not None:
            path = run.path / "trajectory.arrays"
            write_part(opened.trajectory, path)
        origin = local_origin(store.bounds.west, store.bounds.south, surface.z0_m)
        blocks, counts = store.block_counts
        times = opened.facts.times
        scanner = sampled_timing(blocks, counts, store.points, (times.low_s, times.high_s))
        survey = TiledPoints(store.folder, surface.tiles.folder, path, opened.survey.name, origin, scanner)
        plans = [
            plan_tiles(
                store.bounds, blocks, STORE_BLOCK_M, store.count_in, method.buffer_m, tiling,
                only_high=math.isfinite(method.least_height_m),
            )
            for method in methods
        ]  # fmt: skip
        return cls(opened, surface, methods, plans, survey)

    def tasks(self, results: Path) -> list[RunTask]:
        """Return the tiles of all methods."""
        sent = [sent_method(method) for method in self.methods]
        return [
            RunTask(
                self._tile_name(number, tile),
                self.methods[number],
                TilePiece(
                    tile, self.survey, self.methods[number].least_height_m, len(self.plans[number]) == 1
                ),
                results,
                sent[number],
            )
            for number, tile in self._tiles()
        ]

    def context(self, method: Method) -> SurveyContext:
        """Return origin, visibility, path and cores."""
        path = self.opened.trajectory
        return SurveyContext(
            origin=self.survey.origin,
            is_visible=SurveySight(self.surface),
            path=None if path is None else path.xyz,
            cores=tuple(tile.core for tile in self.plans[self._number(method)]),
            shows_paint=self.opened.facts.has_intensity,
        )

    def with_sources(self, lines: LineSet) -> LineSet:
        """Return the lines with the point files whose extents they reach into."""
        return with_sources(lines, self.opened.facts.files, self.opened.survey.name)

    def account(self, done: TasksDone) -> SourceAccount:
        """Return the account of files and tiles."""
        problems = {failure.name: failure.problem for failure in done.failures}
        tiles = []
        for number, tile in self._tiles():
            name = self._tile_name(number, tile)
            receipt = done.receipts.get(name)
            n_points, n_found = (receipt.n_seen, receipt.n_found) if receipt else (0, 0)
            tiles.append(TileReport(name, tile, n_points, n_found, problems.get(name, "")))
        of_surface = (Failure("tile", name, problem) for name, problem in self.surface.failures)
        return SourceAccount(
            failures=(*of_surface, *done.failures),
            is_empty=not done.receipts,
            read=self.opened.facts,
            tiles=tuple(tiles),
            aside=self.surface.aside
            if any("road_boundary" in m.kinds or "lane_marking" in m.kinds for m in self.methods)
            else None,
        )

    def refusal(self, account: SourceAccount) -> LineworkError:
        """Return the error of a survey of which all tiles failed."""
        problem = account.failures[0].problem.rstrip(".")
        return PartialError(f"none of {len(account.tiles)} tiles could be processed: {problem}",
                            where=self.opened.survey.name, advice="correct that and run again")  # fmt: skip

    def _tiles(self) -> list[tuple[int, Tile]]:
        """Return all tiles with the number of their method; those of methods with few (large) tiles come first.

        The last tasks of a run are then short.
        """
        plans = sorted(enumerate(self.plans), key=lambda plan: len(plan[1]))
        return [(number, tile) for number, tiles in plans for tile in tiles]

    def _number(self, method: Method) -> int:
        return next(i for i, other in enumerate(self.methods) if other is method)

    def _tile_name(self, number: int, tile: Tile) -> str:
        """Return the name of a method's tile; of two methods for the same kinds the second has its number in it."""
        kinds = self.methods[number].kinds
        first = next(i for i, method in enumerate(self.methods) if method.kinds == kinds)
        return f"{'+'.join(kinds)}-{f'{number}-' if first != number else ''}{tile.tile_id}"


@dataclass(frozen=True, slots=True)
class StereoSource:
    """Stereo pairs in time windows.

    What a pair shows depends on that pair alone: windows are units of processing only.
    """

    opened: OpenedStereo
    methods: Sequence[Method]

    looking: ClassVar[tuple[str, str]] = ("look at stereo pairs", "windows")
    joining: ClassVar[str] = "join stereo lines"

    def tasks(self, results: Path) -> list[RunTask]:
        """Return the windows of all methods."""
        opened = self.opened
        return [
            RunTask(f"{self._name(n)}-{number:06d}", method, window, results, sent)
            for n, method in enumerate(self.methods)
            for sent in [sent_method(method)]
            for number, window in windows_of(opened.pairs, opened.series.rig)
        ]

    def _name(self, number: int) -> str:
        """Return a method's name in those of its tasks; of two of one name the second has its number in it."""
        names = [method.name for method in self.methods]
        return names[number] + (f"-{number}" if names.index(names[number]) != number else "")

    def context(self, method: Method) -> SurveyContext:  # noqa: ARG002 - tiles need it
        """Return poses and geometry of the pairs."""
        opened = self.opened
        return SurveyContext(poses=opened.poses, rig=opened.rectifier.rig, pair_numbers=opened.numbers)

    def with_sources(self, lines: LineSet) -> LineSet:
        """Return the lines with the images that show them: the first and the last by time."""
        times = np.array([pair.time_s for pair in self.opened.pairs])
        sources = []
        for span in zip(lines.time_start_s.tolist(), lines.time_end_s.tolist(), strict=True):
            if not np.isfinite(span).all():
                sources.append(self.opened.survey.name)
                continue
            first, last = (self.opened.pairs[int(np.argmin(np.abs(times - t)))].left.name for t in span)
            sources.append(first if first == last else f"{first} to {last}")
        return lines.with_columns(source=np.array(sources, dtype=np.str_)) if len(lines) else lines

    def account(self, done: TasksDone) -> SourceAccount:
        """Return the account of all pairs, those that were left out before the run among them."""
        series = self.opened.series
        before = [Failure("image", name, problem) for name, problem in self.opened.failures]
        n_used = sum(receipt.n_seen for receipt in done.receipts.values())
        n_pairs = len(series.pairs) + len(series.unpaired) + len(series.left_out)
        return SourceAccount(
            failures=tuple(sorted([*before, *done.failures])),
            is_empty=n_used == 0,
            pairs=PairAccount(n_pairs=n_pairs, n_used=n_used),
        )

    def refusal(self, account: SourceAccount) -> LineworkError:
        """Return the error of a survey of whose pairs not one could be used."""
        n_pairs = account.pairs.n_pairs if account.pairs else 0
        problem = account.failures[0].problem.rstrip(".")
        return InputError(f"none of {n_pairs} stereo pairs can be used, the first: {problem}",
                          where=self.opened.survey.name, advice="correct that and run again")  # fmt: skip
