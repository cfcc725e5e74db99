"""Tile stores made of another: the points of one drive, and all points moved by a correction.

Separate from `adjusted`, which says what is made when: this reads and writes points, a block at a time.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from linework.arrays import FloatArray
from linework.files.las.tally import TimeCounts
from linework.files.output.replace import replacing_folder
from linework.files.store.facts import facts_of_store
from linework.files.store.layout import POINTS_SUFFIX, STORE_BLOCK_M
from linework.files.store.read import PointStore
from linework.files.store.write import StoreWriter, write_index
from linework.model.grid import Bounds, holds
from linework.model.points import Points
from linework.runs.drives.separate import MATTERS_M
from linework.runs.opened.points import OpenedSurvey
from linework.runs.resume import fingerprint_of
from linework.runs.steps import Advance, RunSteps

#: Points of an area that are taken into memory at once, if they lie evenly: as many as of a large tile.
_MOST_POINTS = 5_000_000
#: Stores that are written at once: each holds the points of an area that it was given, 0.1 GB for the largest.
_MOST_STORES = 4
#: Takes and returns points with the same columns.
PointChange = Callable[[Points], Points]


def write_changed_stores(
    store: PointStore,
    changes: Mapping[Path, PointChange],
    advance: Advance,
    near_xy: FloatArray | None = None,
) -> None:
    """Write tile stores of the points that functions make of those of each area, which are read once for all of them.

    Parameters
    ----------
    store
        With times.
    changes
        Functions that take and return points with the same columns, by the folder of what they make: existing, empty
        ones; the caller removes them if this fails.
    near_xy
        (n, 2) places [m, world]: only areas with points that may matter there are read; None: all are.

    Raises
    ------
    MachineError
        Not enough space, or the disk failed.

    Notes
    -----
    Areas are read in their fixed order, and their points in canonical order: the same points give the same bytes. What the
    facts say of the files stays; times are counted again.
    """
    made = [_Made(StoreWriter(folder / f"0{POINTS_SUFFIX}"), TimeCounts()) for folder in changes]
    done = 0
    try:
        for area in small_areas(store):
            if near_xy is not None and not holds(area.grown(MATTERS_M), near_xy).any():
                # At most so many: stretches of the store that reach into several areas are counted in each
                done = min(done + store.count_in(area), store.n_points)
                continue
            recorded = store.points(area)
            for change, one in zip(changes.values(), made, strict=True):
                one.add(change(recorded), store.columns)
            done = min(done + len(recorded), store.n_points)
            advance(done, store.n_points)
        runs = [one.writer.close() for one in made]
    except BaseException:
        for one in made:
            one.writer.abort()
        raise
    for folder, one, run in zip(changes, made, runs, strict=True):
        write_index(folder, run, {**store.facts, "times": one.times.to_document()})


@dataclass(frozen=True, slots=True)
class _Made:
    """A store as it is written, and the times of its points."""

    writer: StoreWriter
    times: TimeCounts

    def add(self, points: Points, names: Sequence[str]) -> None:
        """Write points with the columns of these names."""
        if not len(points) or points.time_s is None:
            return
        intensity = np.zeros(len(points)) if points.intensity is None else points.intensity
        columns = (
            np.stack([points.columns[name] for name in names]) if names else np.empty((0, 0), np.float32)
        )
        self.writer.append(points.xyz, np.rint(intensity).astype(np.uint16), points.time_s, columns)
        self.times.add(points.time_s)


def small_areas(store: PointStore) -> Iterator[Bounds]:
    """Yield areas that together hold all points of a store: its blocks, quartered until few points are in a quarter.

    Their edges are whole multiples of 8 m, so that memory is bounded where a scanner stood for minutes.
    """
    blocks, counts = store.block_counts
    for (east, north), n in zip((blocks * STORE_BLOCK_M).tolist(), counts.tolist(), strict=True):
        n_side = next((k for k in (1, 2, 4) if n <= _MOST_POINTS * k**2), 8)
        side = STORE_BLOCK_M / n_side
        for i in range(n_side):
            for j in range(n_side):
                west, south = east + i * side, north + j * side
                yield Bounds(west, south, west + side, south + side)


def changed_points(
    opened: OpenedSurvey,
    folder: Path,
    change: PointChange,
    what: str,
    steps: RunSteps,
    step: str,
    near_xy: FloatArray | None = None,
) -> OpenedSurvey | None:
    """Return a survey with points that a function makes of its own, in a store of their own; None without any.

    Parameters
    ----------
    folder
        Of the store: used as it is if it exists, as it is only there when it is whole.
    what
        Was changed: part of the key of the new survey.
    step
        Name of the step that is shown meanwhile.
    near_xy
        (n, 2) places [m, world]: the function keeps points only that may matter there; None: anywhere.
    """
    make_missing_stores(opened.points, {folder: change}, steps, step, near_xy)
    points = PointStore.open(folder)
    if not points.n_points:
        return None
    return replace(
        opened,
        points=points,
        facts=facts_of_store(points),
        key=fingerprint_of({"of": opened.key, "what": what}),
    )


def make_missing_stores(
    store: PointStore,
    changes: Mapping[Path, PointChange],
    steps: RunSteps,
    step: str,
    near_xy: FloatArray | None = None,
) -> None:
    """Make the stores of changed points that are not there yet, `_MOST_STORES` of one reading; arguments as above.

    changes: functions by the folder of the store that each makes.
    """
    missing = [folder for folder in changes if not folder.is_dir()]
    for i in range(0, len(missing), _MOST_STORES):
        with contextlib.ExitStack() as held:
            parts = dict[Path, PointChange]()
            for folder in missing[i : i + _MOST_STORES]:
                folder.parent.mkdir(parents=True, exist_ok=True)
                parts[held.enter_context(replacing_folder(folder))] = changes[folder]
            with steps.step(step, unit="points") as advance:
                write_changed_stores(store, parts, advance, near_xy)
