"""Tile stores made of another: the points of one drive, and all points moved by a correction.

Separate from `adjusted`, which says what is made when: this reads and writes points, a block at a time.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
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


def write_changed_store(
    store: PointStore,
    folder: Path,
    change: Callable[[Points], Points],
    advance: Advance,
    near_xy: FloatArray | None = None,
) -> None:
    """Write a tile store of the points that a function makes of those of each area.

    Parameters
    ----------
    store
        With times.
    folder
        An existing, empty folder; the caller removes it if this fails.
    change
        Takes and returns points with the same columns.
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
    writer, times = StoreWriter(folder / f"0{POINTS_SUFFIX}"), TimeCounts()
    done, names = 0, store.columns
    try:
        for area in small_areas(store):
            if near_xy is not None and not holds(area.grown(MATTERS_M), near_xy).any():
                # At most so many: stretches of the store that reach into several areas are counted in each
                done = min(done + store.count_in(area), store.n_points)
                continue
            recorded = store.points(area)
            points = change(recorded)
            done = min(done + len(recorded), store.n_points)
            advance(done, store.n_points)
            if not len(points) or points.time_s is None:
                continue
            intensity = np.zeros(len(points)) if points.intensity is None else points.intensity
            columns = (
                np.stack([points.columns[name] for name in names]) if names else np.empty((0, 0), np.float32)
            )
            writer.append(points.xyz, np.rint(intensity).astype(np.uint16), points.time_s, columns)
            times.add(points.time_s)
        runs = writer.close()
    except BaseException:
        writer.abort()
        raise
    write_index(folder, runs, {**store.facts, "times": times.to_document()})


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
    change: Callable[[Points], Points],
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
    if not folder.is_dir():
        folder.parent.mkdir(parents=True, exist_ok=True)
        with replacing_folder(folder) as part, steps.step(step, unit="points") as advance:
            write_changed_store(opened.points, part, change, advance, near_xy)
    points = PointStore.open(folder)
    if not points.n_points:
        return None
    return replace(
        opened,
        points=points,
        facts=facts_of_store(points),
        key=fingerprint_of({"of": opened.key, "what": what}),
    )
