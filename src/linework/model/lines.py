"""LineSet: georeferenced 3-D lines as ragged columns."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from linework.arrays import AnyArray, BoolArray, FloatArray, IntArray, checked, offsets_of
from linework.model.columns import check_columns, column_types, filled_column

#: The kinds of line, in the order of their layers.
KINDS = (
    "lane_marking", "lane_marking_dash", "road_marking_other", "road_boundary", "kerb_top", "guardrail",
    "barrier", "fence", "cable",
)  # fmt: skip

#: Review decisions: right as it is, corrected, drawn by hand, or no such feature.
REVIEWS = ("accepted", "edited", "drawn", "rejected")
#: Condition of the feature itself, as the reviewer sees it.
CONDITIONS = ("good", "worn", "damaged", "missing")


@dataclass(frozen=True, slots=True, kw_only=True)
class LineSet:
    """m lines over n vertices: line i is ``xyz[offsets[i]:offsets[i + 1]]``.

    Per-line and per-vertex columns that are not given take the column's default.

    Parameters
    ----------
    xyz
        (n, 3) float64 [m, world]: east, north, up.
    offsets
        (m + 1,) int64: first vertex of each line, and n at the end.
    crs
        WKT2, or "local".
    sigma_xy_m, sigma_z_m
        (n,) float64 [m]: standard deviation across the line in plan, and in height. NaN: unknown.
    bridged
        (n,) bool: no measurement here although the feature should be visible.
    observed
        (n,) bool, of truth lines: within reach of the scanner and not hidden. True for other lines.
    id, kind, role, pattern, form, method, source
        (m,) str; "" where it does not apply.
    double
        (m,) bool: one of a pair of lines.
    width_m, height_m, clearance_m
        (m,) float64 [m]; NaN where it does not apply.
    disagreement_mean_m, disagreement_rms_m
        (m,) float64 [m]: mean and rms offset of another method's line of the same feature, positive to the left
        of this one's direction; NaN where only one method found it.
    confidence
        (m,) float64, 0 to 1.
    time_start_s, time_end_s
        (m,) float64 [s]; NaN where the survey has no time.
    review
        (m,) str: review decision, one of `REVIEWS`; "" before review.
    condition, note
        (m,) str: condition, one of `CONDITIONS`, and a remark in words.
    """

    xyz: FloatArray
    offsets: IntArray
    crs: str = "local"
    sigma_xy_m: FloatArray = filled_column(np.float64, np.nan)
    sigma_z_m: FloatArray = filled_column(np.float64, np.nan)
    bridged: BoolArray = filled_column(np.bool_, False)
    observed: BoolArray = filled_column(np.bool_, True)
    id: AnyArray = filled_column(np.str_, "")
    kind: AnyArray = filled_column(np.str_, "")
    role: AnyArray = filled_column(np.str_, "")
    pattern: AnyArray = filled_column(np.str_, "")
    form: AnyArray = filled_column(np.str_, "")
    method: AnyArray = filled_column(np.str_, "")
    source: AnyArray = filled_column(np.str_, "")
    double: BoolArray = filled_column(np.bool_, False)
    width_m: FloatArray = filled_column(np.float64, np.nan)
    height_m: FloatArray = filled_column(np.float64, np.nan)
    clearance_m: FloatArray = filled_column(np.float64, np.nan)
    disagreement_mean_m: FloatArray = filled_column(np.float64, np.nan)
    disagreement_rms_m: FloatArray = filled_column(np.float64, np.nan)
    confidence: FloatArray = filled_column(np.float64, 1.0)
    time_start_s: FloatArray = filled_column(np.float64, np.nan)
    time_end_s: FloatArray = filled_column(np.float64, np.nan)
    review: AnyArray = filled_column(np.str_, "")
    condition: AnyArray = filled_column(np.str_, "")
    note: AnyArray = filled_column(np.str_, "")

    def __post_init__(self) -> None:
        object.__setattr__(self, "xyz", checked("xyz", self.xyz, np.float64, (None, 3)))
        offsets = checked("offsets", self.offsets, np.int64, (None,))
        if (
            len(offsets) < 1
            or offsets[0] != 0
            or offsets[-1] != len(self.xyz)
            or np.any(np.diff(offsets) < 0)
        ):
            raise ValueError(f"offsets: must rise from 0 to {len(self.xyz)}, got {offsets}")
        object.__setattr__(self, "offsets", offsets)
        check_columns(self, _VERTEX_TYPES, len(self.xyz))
        check_columns(self, _LINE_TYPES, len(self))

    def __len__(self) -> int:
        return len(self.offsets) - 1

    @classmethod
    def empty(cls, crs: str = "local") -> LineSet:
        """Return a set of no lines."""
        return cls(xyz=np.zeros((0, 3)), offsets=np.zeros(1, dtype=np.int64), crs=crs)

    @classmethod
    def from_lines(cls, lines: Sequence[AnyArray], *, crs: str = "local", **columns: Any) -> LineSet:
        """Build a set from a sequence of (n_i, 3) vertex arrays; per-vertex columns are concatenated already.

        >>> s = LineSet.from_lines([np.zeros((2, 3)), np.ones((3, 3))], kind=["cable", "cable"])
        >>> len(s), s.offsets.tolist()
        (2, [0, 2, 5])
        """
        offsets = offsets_of([len(line) for line in lines])
        xyz = (
            np.concatenate([np.asarray(line, dtype=np.float64) for line in lines])
            if len(lines)
            else np.zeros((0, 3))
        )
        return cls(xyz=xyz, offsets=offsets, crs=crs, **columns)

    @classmethod
    def concatenate(cls, sets: Iterable[LineSet]) -> LineSet:
        """Return all lines of `sets` in order; they must share one CRS."""
        kept = list(sets)
        if not kept:
            return cls.empty()
        names = {s.crs for s in kept}
        if len(names) > 1:
            raise ValueError(f"line sets in {len(names)} different CRSs cannot be joined")
        starts = offsets_of([len(s.xyz) for s in kept])
        offsets = np.concatenate(
            [[0], *[s.offsets[1:] + start for s, start in zip(kept, starts, strict=False)]]
        )
        columns = {c: np.concatenate([getattr(s, c) for s in kept]) for c in VERTEX_COLUMNS + LINE_COLUMNS}
        return cls(xyz=np.concatenate([s.xyz for s in kept]), offsets=offsets, crs=kept[0].crs, **columns)

    def line(self, i: int) -> FloatArray:
        """Return the (n_i, 3) vertices of line i."""
        return self.xyz[self.offsets[i] : self.offsets[i + 1]]

    def take(self, index: AnyArray | Sequence[int]) -> LineSet:
        """Return the lines chosen by a mask or an index array, in that order."""
        chosen = np.asarray(index)
        if chosen.dtype == np.bool_:
            chosen = np.flatnonzero(chosen)
        chosen = chosen.astype(np.int64)
        runs = [np.arange(self.offsets[i], self.offsets[i + 1]) for i in chosen]
        vertices = np.concatenate(runs) if runs else np.zeros(0, dtype=np.int64)
        offsets = offsets_of(np.diff(self.offsets)[chosen])
        columns = {c: getattr(self, c)[vertices] for c in VERTEX_COLUMNS}
        columns |= {c: getattr(self, c)[chosen] for c in LINE_COLUMNS}
        return LineSet(xyz=self.xyz[vertices], offsets=offsets, crs=self.crs, **columns)

    def of_kind(self, kind: str) -> LineSet:
        """Return the lines of one kind."""
        return self.take(self.kind == kind)

    def with_columns(self, **columns: Any) -> LineSet:
        """Return the same lines with some columns replaced."""
        return replace(self, **columns)

    @property
    def line_of_vertex(self) -> IntArray:
        """(n,) int64: the line each vertex belongs to."""
        return np.repeat(np.arange(len(self), dtype=np.int64), np.diff(self.offsets))

    @property
    def length_m(self) -> FloatArray:
        """(m,) float64 [m]: length of each line, in space for cables, in plan for all else."""
        return self._sum_segments(np.ones(max(len(self.xyz) - 1, 0), dtype=bool))

    @property
    def bridged_m(self) -> FloatArray:
        """(m,) float64 [m]: length of each line without measurement (a segment is bridged if an end is)."""
        return self._sum_segments(self.bridged[:-1] | self.bridged[1:])

    def _sum_segments(self, counted: BoolArray) -> FloatArray:
        if len(self.xyz) < 2:
            return np.zeros(len(self))
        owner = self.line_of_vertex
        step = np.diff(self.xyz, axis=0)
        in_space = (self.kind == "cable")[owner[:-1]]
        length = np.sqrt(step[:, 0] ** 2 + step[:, 1] ** 2 + np.where(in_space, step[:, 2], 0.0) ** 2)
        inside = owner[:-1] == owner[1:]
        total = np.bincount(owner[:-1], weights=length * (inside & counted), minlength=len(self))
        return np.asarray(total, dtype=np.float64)


#: Columns of vertices and of lines, in order.
VERTEX_COLUMNS = ("sigma_xy_m", "sigma_z_m", "bridged", "observed")
LINE_COLUMNS = tuple(name for name in column_types(LineSet) if name not in VERTEX_COLUMNS)
_VERTEX_TYPES = {name: column_types(LineSet)[name] for name in VERTEX_COLUMNS}
_LINE_TYPES = {name: column_types(LineSet)[name] for name in LINE_COLUMNS}
