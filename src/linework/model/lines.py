"""LineSet: georeferenced 3-D lines as ragged columns."""

from __future__ import annotations

import operator
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, overload

import numpy as np

from linework.arrays import AnyArray, BoolArray, FloatArray, IntArray, checked, offsets_of
from linework.errors import UnknownKindError, argument
from linework.model.columns import check_columns, column_types, filled_column
from linework.model.grid import Bounds
from linework.model.lineset.for_others import ForOtherLibraries
from linework.model.lineset.line import Line, line_number
from linework.model.lineset.report import Report

#: The kinds of line, in the order of their layers.
KINDS = (
    "lane_marking", "lane_marking_dash", "road_marking_other", "road_boundary", "kerb_top", "guardrail", "barrier",
    "fence", "cable", "edge_other",
)  # fmt: skip
#: The kind of what stands at a place: in a `LineSet` a vertical line from its foot to its top, in files a point.
POLE = "pole"

#: The form of rails that are a line per pipe, one above another: only heights tell such lines apart.
STACKED_FORM = "tube"

#: Kind of the lines that were measured and not taken, which are only written on request: see `candidate_kind`.
CANDIDATE = "candidate"

#: Review decisions: right as it is, corrected, drawn by hand, or no such feature.
REVIEWS = ("accepted", "edited", "drawn", "rejected")
REJECTED_REVIEW = "rejected"
#: Condition of the feature itself, as the reviewer sees it.
CONDITIONS = ("good", "worn", "damaged", "missing")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class LineSet(ForOtherLibraries):
    """m lines over n vertices: line i is ``xyz[offsets[i]:offsets[i + 1]]``.

    A container: ``len(lines)``, ``for line in lines``, ``lines[3]`` (a `Line`), ``lines["guardrail"]`` (the lines of a
    kind), ``lines[lines.confidence > 0.9]`` and ``lines[10:20]`` (sets). Two sets are equal if all their columns are;
    NaN equals NaN. DuckDB, polars, pyarrow and GeoPandas read it as an Arrow stream.

    Per-line and per-vertex columns that are not given take the column's default; one value stands for all rows.

    Parameters
    ----------
    xyz
        (n, 3) float64 [m, world]: east, north, up.
    offsets
        (m + 1,) int64: first vertex of each line, and n at the end.
    crs
        WKT2, or "local"; given as "EPSG:25832+7837", an EPSG code or a `pyproj.CRS`, it is converted.
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
    width_m, height_m, lower_m, clearance_m
        (m,) float64 [m]; NaN where it does not apply. `lower_m`: height of the lower edge of a rail, as `height_m` is
        that of its upper edge.
    n_beams
        (m,) float64: number of beams or ropes of a rail that the line stands for; NaN where it does not apply.
    network, span, circuit
        (m,) str, of cables and poles; "" where it does not apply. `network`: shared by all wires that hang together over
        their poles; `circuit`: by the wires that run on from pole to pole side by side; `span`: by those between the same
        two poles.
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
    candidate_kind, reason
        (m,) str, of candidates: the kind that the line would be, and why it was not taken; else "".
    report
        What was looked at and what was left out, for lines that `extract` returned; else None.

    Examples
    --------
    >>> lines = LineSet.from_lines([[[0, 0, 5], [100, 0, 5]], [[0, 9, 5], [30, 9, 5]]], kind=["guardrail", "cable"])
    >>> lines
    LineSet: 2 lines, 130.0 m
      guardrail  1 line  100.0 m
      cable      1 line   30.0 m
      crs: local
      extent: east 0.0 to 100.0, north 0.0 to 9.0 (100.0 x 9.0 m)
      bridged: 0.0 % of the length
    >>> lines["cable"].length_m.tolist(), lines[-1].kind, [line.kind for line in lines]
    ([30.0], 'cable', ['guardrail', 'cable'])
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
    lower_m: FloatArray = filled_column(np.float64, np.nan)
    n_beams: FloatArray = filled_column(np.float64, np.nan)
    clearance_m: FloatArray = filled_column(np.float64, np.nan)
    network: AnyArray = filled_column(np.str_, "")
    span: AnyArray = filled_column(np.str_, "")
    circuit: AnyArray = filled_column(np.str_, "")
    disagreement_mean_m: FloatArray = filled_column(np.float64, np.nan)
    disagreement_rms_m: FloatArray = filled_column(np.float64, np.nan)
    confidence: FloatArray = filled_column(np.float64, 1.0)
    time_start_s: FloatArray = filled_column(np.float64, np.nan)
    time_end_s: FloatArray = filled_column(np.float64, np.nan)
    review: AnyArray = filled_column(np.str_, "")
    condition: AnyArray = filled_column(np.str_, "")
    note: AnyArray = filled_column(np.str_, "")
    candidate_kind: AnyArray = filled_column(np.str_, "")
    reason: AnyArray = filled_column(np.str_, "")
    report: Report | None = field(default=None, compare=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "crs", _crs_text(self.crs))
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

    def __iter__(self) -> Iterator[Line]:
        return (Line(self, i) for i in range(len(self)))

    @overload
    def __getitem__(self, index: int | np.integer[Any]) -> Line: ...
    @overload
    def __getitem__(self, index: str | slice | AnyArray | Sequence[int] | Sequence[bool]) -> LineSet: ...
    def __getitem__(self, index: Any) -> Line | LineSet:
        """Return a line by its number, or a set: the lines of a kind, of a slice, a mask or an index array.

        Raises
        ------
        IndexError
            There is no such line, or a mask has another length than the set.
        UnknownKindError
            Neither a kind that linework knows nor one of the set; it is a `KeyError`.
        """
        if isinstance(index, str):
            known = (*KINDS, *self.kinds)
            if index not in known:
                raise UnknownKindError(index, known, self.kinds)
            return self.take(self.kind == index)
        if isinstance(index, slice):
            return self.take(np.arange(len(self))[index])
        if not isinstance(index, bool | np.bool_):
            try:
                return Line(self, line_number(operator.index(index), len(self)))
            except TypeError:
                pass
        # A tuple would be several axes to NumPy, and lines have one
        chosen = np.asarray(None if isinstance(index, tuple) else index)
        if chosen.ndim != 1 or (chosen.size and chosen.dtype.kind not in "iub"):
            raise TypeError(
                f"lines are chosen by a number, a kind, a slice, a mask or an index array, not {index!r}"
            )
        return self.take(chosen)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, LineSet):
            return NotImplemented
        return self.crs == other.crs and all(
            np.array_equal(a, b, equal_nan=a.dtype.kind == "f")
            for a, b in (
                (getattr(self, name), getattr(other, name))
                for name in ("offsets", "xyz", *VERTEX_COLUMNS, *LINE_COLUMNS)
            )
        )

    __hash__ = None  # type: ignore[assignment]

    @classmethod
    def empty(cls, crs: Any = "local") -> LineSet:
        """Return a set of no lines."""
        return cls(xyz=np.zeros((0, 3)), offsets=np.zeros(1, dtype=np.int64), crs=crs)

    @classmethod
    def from_lines(cls, lines: Sequence[Any], *, crs: Any = "local", **columns: Any) -> LineSet:
        """Return a set of the lines in a sequence of (n_i, 3) vertex arrays.

        Parameters
        ----------
        lines
            Vertices of each line: east, north, up. [m, world]
        crs
            "EPSG:25832+7837", an EPSG code, a `pyproj.CRS`, WKT, or "local".
        **columns
            Columns by name; those of vertices are concatenated already.

        Examples
        --------
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
        reports = [s.report for s in kept]
        report = reports[0] if all(r is reports[0] for r in reports) else None
        if len(names) > 1:
            raise ValueError(f"line sets in {len(names)} different CRSs cannot be joined")
        starts = offsets_of([len(s.xyz) for s in kept])
        offsets = np.concatenate(
            [[0], *[s.offsets[1:] + start for s, start in zip(kept, starts, strict=False)]]
        )
        columns = {c: np.concatenate([getattr(s, c) for s in kept]) for c in VERTEX_COLUMNS + LINE_COLUMNS}
        xyz = np.concatenate([s.xyz for s in kept])
        return cls(xyz=xyz, offsets=offsets, crs=kept[0].crs, report=report, **columns)

    def take(self, index: AnyArray | Sequence[int]) -> LineSet:
        """Return the lines chosen by a mask or an index array, in that order: what ``lines[index]`` does.

        Raises
        ------
        IndexError
            There is no such line, or a mask has another length than the set.
        """
        chosen = np.asarray(index)
        if chosen.dtype == np.bool_:
            if len(chosen) != len(self):
                raise IndexError(f"mask of {len(chosen)} values for {len(self)} lines")
            chosen = np.flatnonzero(chosen)
        chosen = chosen.astype(np.int64)
        if len(chosen) and not -len(self) <= chosen.min() <= chosen.max() < len(self):
            raise IndexError(f"lines {chosen.min()} to {chosen.max()} of {len(self)}")
        chosen %= max(len(self), 1)
        runs = [np.arange(self.offsets[i], self.offsets[i + 1]) for i in chosen]
        vertices = np.concatenate(runs) if runs else np.zeros(0, dtype=np.int64)
        offsets = offsets_of(np.diff(self.offsets)[chosen])
        columns = {c: getattr(self, c)[vertices] for c in VERTEX_COLUMNS}
        columns |= {c: getattr(self, c)[chosen] for c in LINE_COLUMNS}
        return LineSet(xyz=self.xyz[vertices], offsets=offsets, crs=self.crs, report=self.report, **columns)

    def with_columns(self, **columns: Any) -> LineSet:
        """Return the same lines with some columns replaced."""
        return replace(self, **columns)

    def with_crs(self, crs: Any) -> LineSet:
        """Return the same coordinates, declared to be in a CRS; nothing is transformed.

        Parameters
        ----------
        crs
            "EPSG:25832+7837", an EPSG code, a `pyproj.CRS`, WKT, or "local".

        Raises
        ------
        CrsError
            Unknown, in degrees, or not a CRS.

        Examples
        --------
        >>> LineSet.empty().with_crs(25832) == LineSet.empty("EPSG:25832")
        True
        """
        from linework.crs import parse_crs

        return replace(self, crs=parse_crs(crs, where=argument("crs")))

    @property
    def kinds(self) -> tuple[str, ...]:
        """The kinds of the lines, each once: known kinds in the order of `KINDS`, then others by name."""
        present = set(self.kind.tolist())
        return tuple(k for k in KINDS if k in present) + tuple(sorted(present - set(KINDS)))

    @property
    def bounds(self) -> Bounds:
        """Extent in plan: west, south, east, north [m, world].

        Raises
        ------
        ValueError
            There are no vertices.
        """
        if len(self.xyz) == 0:
            raise ValueError("no lines: no extent")
        west, south = self.xyz[:, :2].min(axis=0).tolist()
        east, north = self.xyz[:, :2].max(axis=0).tolist()
        return Bounds(west, south, east, north)

    @property
    def line_of_vertex(self) -> IntArray:
        """(n,) int64: the line each vertex belongs to."""
        return np.repeat(np.arange(len(self), dtype=np.int64), np.diff(self.offsets))

    @property
    def length_m(self) -> FloatArray:
        """(m,) float64 [m]: length of each line, in space for cables and poles, in plan for all else."""
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
        in_space = np.isin(self.kind, ("cable", POLE))[owner[:-1]]
        length = np.sqrt(step[:, 0] ** 2 + step[:, 1] ** 2 + np.where(in_space, step[:, 2], 0.0) ** 2)
        inside = owner[:-1] == owner[1:]
        total = np.bincount(owner[:-1], weights=length * (inside & counted), minlength=len(self))
        return np.asarray(total, dtype=np.float64)


#: Columns of vertices and of lines, in order.
VERTEX_COLUMNS = ("sigma_xy_m", "sigma_z_m", "bridged", "observed")
LINE_COLUMNS = tuple(name for name in column_types(LineSet) if name not in VERTEX_COLUMNS)
_VERTEX_TYPES = {name: column_types(LineSet)[name] for name in VERTEX_COLUMNS}
_LINE_TYPES = {name: column_types(LineSet)[name] for name in LINE_COLUMNS}


def _crs_text(crs: Any) -> str:
    """Return a CRS as WKT2 or "local"; texts that are either already stay as they are."""
    if isinstance(crs, str) and (crs == "local" or "[" in crs):
        return crs
    from linework.crs import parse_crs

    return parse_crs(crs, where=argument("crs"))
