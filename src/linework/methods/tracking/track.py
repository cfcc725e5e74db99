"""Tracking: oriented boxes that collide are joined into lines, forward and backward (steps 2.4 and 2.5).

Box A is moved by the search length along the line to A'; box B is what was found in the points there. Where A' and B
collide (separating axes), and B lies and points as the boxes so far predict, their centres are joined.

Seokchan Kang, Jeongwon Lee, Jiyeong Lee (2023), doi:10.3390/rs15194656. Beyond the paper, the prediction (a parabola
through the last boxes, with its covariance) determines the length and the width of the search, carries it over gaps,
and every line of a survey is tracked once.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from linework.arrays import BoolArray, FloatArray, IntArray, offsets_of
from linework.kernels.tracking import track as kernels
from linework.kernels.tracking.track_all import track_all
from linework.model.boxes import BoxForm, BoxSet
from linework.model.settings import Settings, setting

#: Side of the cells that boxes are looked up in: a step of the search touches few. [m]
LOOKUP_CELL_M = 2.0
#: Cells around the boxes, so that a search beyond their edge needs no test.
MARGIN_CELLS = 20
#: Length along a box, to either side, in which others support it. [m]
SUPPORT_M = 2.0


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackConfig(Settings):
    """Settings of the search for the next box."""

    longest_gap_m: float = setting(
        32.0,
        unit="m",
        reason="a dash that is worn off where they come every 18 m leaves 30 m; so do a few parked cars",
        low=0.5,
        high=100,
    )
    widest_m: float = setting(
        1.5,
        unit="m",
        reason="half the search width at most: half a lane; an arc to the box decides",
        low=0.02,
        high=5,
    )
    least_support: float = setting(
        0.18,
        unit="",
        reason="a line continues beyond a gap where 3 of 16 places within 2 m continue it",
        low=0,
        high=1,
    )


@dataclass(frozen=True, slots=True)
class BoxTable:
    """Boxes sorted by the cells they are looked up in, as kernels take them.

    Parameters
    ----------
    order
        (n,) int64: the index in the set of each row's box.
    rows
        (n, 8) float64: see `linework.kernels.tracking.track`.
    codes
        (n,) int64, ascending: cells.
    lattice
        West and south edge, size [m] and number of columns of the cells.
    support
        (n,) float64, 0 to 1: share of the 2 m on either side of a box where others continue it.
    score
        (n,) float64, 0 to 1.
    """

    order: IntArray
    rows: FloatArray
    codes: IntArray
    lattice: tuple[float, float, float, int]
    support: FloatArray
    score: FloatArray

    @classmethod
    def of(cls, boxes: BoxSet) -> BoxTable:
        """Return boxes sorted by cell, and by place within a cell."""
        west, south = (
            boxes.centre[:, :2].min(axis=0) // LOOKUP_CELL_M * LOOKUP_CELL_M - MARGIN_CELLS * LOOKUP_CELL_M
        ).tolist()
        cell = np.floor((boxes.centre[:, :2] - (west, south)) / LOOKUP_CELL_M).astype(np.int64)
        n_cols = int(cell[:, 0].max()) + MARGIN_CELLS + 1
        codes = cell[:, 1] * n_cols + cell[:, 0]
        order = np.lexsort((boxes.centre[:, 0], boxes.centre[:, 1], codes))
        columns = (
            boxes.centre[:, :2],
            boxes.u,
            boxes.half_u_m,
            boxes.half_v_m,
            boxes.sigma_v_m,
            boxes.sigma_u_rad,
        )
        rows = np.column_stack(columns)[order]
        lattice = (west, south, LOOKUP_CELL_M, n_cols)
        codes = codes[order]
        return cls(
            order, rows, codes, lattice, kernels.support(rows, codes, lattice, SUPPORT_M), boxes.score[order]
        )


@dataclass(frozen=True, slots=True)
class Tracks:
    """Tracked lines, as the boxes that they pass through.

    Parameters
    ----------
    box
        (n,) int64: boxes of a set, line after line.
    sense
        (n,) float64: +1 where the line runs along the box's u-axis, -1 against it.
    offsets
        (m + 1,) int64: first box of each line, and n at the end.
    """

    box: IntArray
    sense: FloatArray
    offsets: IntArray

    def __len__(self) -> int:
        return len(self.offsets) - 1

    def with_boxes(self, least: int) -> Tracks:
        """Return the lines through at least `least` boxes."""
        return self.take(np.diff(self.offsets) >= least)

    def take(self, chosen: BoolArray) -> Tracks:
        """Return the lines chosen by a mask (m,) bool."""
        n = np.diff(self.offsets)
        kept = np.repeat(chosen, n)
        return Tracks(self.box[kept], self.sense[kept], offsets_of(n[chosen]))

    def line(self, i: int) -> tuple[IntArray, FloatArray]:
        """Return the boxes of line i, (k,) int64, and their senses, (k,): +1 along the line, -1 against it."""
        part = slice(self.offsets[i], self.offsets[i + 1])
        return self.box[part], self.sense[part]


def track_lines(boxes: BoxSet, config: TrackConfig, *, width_m: float, least_boxes: int = 3) -> Tracks:
    """Return all lines through the boxes, each tracked once.

    Parameters
    ----------
    width_m
        Boxes within this of a line are the same feature in other cells. [m]
    least_boxes
        Lines through fewer boxes are left out.

    Notes
    -----
    Lines begin at the boxes with the most support, ties by place: the same boxes give the same lines.
    """
    if len(boxes) == 0:
        return Tracks(np.zeros(0, np.int64), np.zeros(0), np.zeros(1, np.int64))
    table = BoxTable.of(boxes)
    least = config.least_support if least_boxes > 1 else 0.0
    seeds = np.flatnonzero(table.support >= least)
    seeds = seeds[np.argsort(-table.support[seeds] * table.score[seeds], kind="stable")]
    sided = bool(boxes.form[0] >= BoxForm.KERB)
    limits = (config.longest_gap_m, config.widest_m, config.least_support, sided, width_m)
    path, sense, offsets, _, joins = track_all(
        table.rows, table.codes, table.lattice, seeds, limits, table.support, least_boxes
    )
    return _joined(table.order[path], sense, offsets, joins)


def _joined(box: IntArray, sense: FloatArray, offsets: IntArray, joins: IntArray) -> Tracks:
    """Return the lines, those whose ends met joined into one."""
    partner: dict[int, int] = {}
    for own, other in enumerate(joins.ravel().tolist()):
        if other:
            partner[own], partner[other - 1] = other - 1, own
    done: BoolArray = np.zeros(len(joins), dtype=np.bool_)
    boxes, senses, lengths = [], [], []
    # Ends without a partner first: only rings are left for the second round
    for start in [e for e in range(2 * len(joins)) if e not in partner] + list(range(2 * len(joins))):
        end: int | None = start
        total = 0
        while end is not None and not done[end // 2]:
            line, turned = divmod(end, 2)
            done[line] = True
            part = slice(offsets[line], offsets[line + 1])
            boxes.append(box[part][::-1] if turned else box[part])
            senses.append(-sense[part][::-1] if turned else sense[part])
            total += len(boxes[-1])
            end = partner.get(end ^ 1)
        if total:
            lengths.append(total)
    no_box, no_sense = np.zeros(0, np.int64), np.zeros(0)
    return Tracks(np.concatenate([no_box, *boxes]), np.concatenate([no_sense, *senses]), offsets_of(lengths))
