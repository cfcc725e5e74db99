"""One line of a LineSet.

Separate from `linework.model.lines`, which would be too long with it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Generic, TypeVar, overload

import numpy as np

from linework.arrays import BoolArray, FloatArray

if TYPE_CHECKING:
    from linework.model.lines import LineSet

ValueT = TypeVar("ValueT")


class _OfLine(Generic[ValueT]):
    """The value of the line in the column of the same name."""

    def __init__(self, convert: Callable[[Any], ValueT]) -> None:
        self._convert = convert

    def __set_name__(self, owner: type, name: str) -> None:
        self._name = name

    @overload
    def __get__(self, line: None, owner: type) -> _OfLine[ValueT]: ...
    @overload
    def __get__(self, line: Line, owner: type) -> ValueT: ...
    def __get__(self, line: Line | None, owner: type) -> ValueT | _OfLine[ValueT]:
        if line is None:
            return self
        return self._convert(getattr(line._lines, self._name)[line._number])

    def __set__(self, line: Line, value: object) -> None:
        raise AttributeError(f"{self._name}: a line cannot be changed; see LineSet.with_columns")


class _OfVertices(Generic[ValueT]):
    """The values at the vertices of the line in the column of the same name."""

    def __init__(self, doc: str) -> None:
        self.__doc__ = doc

    def __set_name__(self, owner: type, name: str) -> None:
        self._name = name

    @overload
    def __get__(self, line: None, owner: type) -> _OfVertices[ValueT]: ...
    @overload
    def __get__(self, line: Line, owner: type) -> ValueT: ...
    def __get__(self, line: Line | None, owner: type) -> ValueT | _OfVertices[ValueT]:
        if line is None:
            return self
        offsets = line._lines.offsets
        values: ValueT = getattr(line._lines, self._name)[offsets[line._number] : offsets[line._number + 1]]
        return values

    def __set__(self, line: Line, value: object) -> None:
        raise AttributeError(f"{self._name}: a line cannot be changed; see LineSet.with_columns")


class Line:
    """One line: its vertices, what is known at each of them, and its attributes.

    It is what ``lines[3]`` returns and what a loop over a `LineSet` yields: a view, nothing is copied.

    Attributes
    ----------
    xyz
        (n, 3) float64 [m, world]: east, north, up.
    sigma_xy_m, sigma_z_m
        (n,) float64 [m]: standard deviation across the line in plan, and in height.
    bridged, observed
        (n,) bool, as in `LineSet`.
    crs
        WKT2, or "local".
    length_m, bridged_m
        Length, in space for cables and poles, in plan for all else; and the part of it without measurement. [m]
    id, kind, role, pattern, form, method, source, double, width_m, height_m, lower_m, n_beams, clearance_m, network, \
span, circuit, disagreement_mean_m, disagreement_rms_m, confidence, time_start_s, time_end_s, review, condition, \
note, candidate_kind, reason
        As the columns of `LineSet`, but one value each.

    Examples
    --------
    >>> from linework import LineSet
    >>> lines = LineSet.from_lines([[[0, 0, 5], [3, 4, 5]]], kind=["guardrail"], sigma_xy_m=[0.01, 0.02])
    >>> lines[0]
    Line(kind='guardrail', 2 vertices, 5.0 m)
    >>> lines[0].sigma_xy_m.tolist(), lines[0].kind, lines[0].length_m
    ([0.01, 0.02], 'guardrail', 5.0)
    """

    __slots__ = ("_lines", "_number")

    def __init__(self, lines: LineSet, number: int) -> None:
        self._lines = lines
        self._number = number

    xyz = _OfVertices[FloatArray]("(n, 3) float64 [m, world]")
    sigma_xy_m = _OfVertices[FloatArray]("(n,) float64 [m]")
    sigma_z_m = _OfVertices[FloatArray]("(n,) float64 [m]")
    bridged = _OfVertices[BoolArray]("(n,) bool")
    observed = _OfVertices[BoolArray]("(n,) bool")
    id = _OfLine(str)
    kind = _OfLine(str)
    role = _OfLine(str)
    pattern = _OfLine(str)
    form = _OfLine(str)
    method = _OfLine(str)
    source = _OfLine(str)
    double = _OfLine(bool)
    width_m = _OfLine(float)
    height_m = _OfLine(float)
    lower_m = _OfLine(float)
    n_beams = _OfLine(float)
    clearance_m = _OfLine(float)
    network = _OfLine(str)
    span = _OfLine(str)
    circuit = _OfLine(str)
    disagreement_mean_m = _OfLine(float)
    disagreement_rms_m = _OfLine(float)
    confidence = _OfLine(float)
    time_start_s = _OfLine(float)
    time_end_s = _OfLine(float)
    review = _OfLine(str)
    condition = _OfLine(str)
    note = _OfLine(str)
    candidate_kind = _OfLine(str)
    reason = _OfLine(str)

    @property
    def crs(self) -> str:
        """WKT2, or "local"."""
        return self._lines.crs

    @property
    def length_m(self) -> float:
        """Length [m]: in space for cables, in plan for all else."""
        return float(self.as_set().length_m[0])

    @property
    def bridged_m(self) -> float:
        """Length without measurement [m]."""
        return float(self.as_set().bridged_m[0])

    @property
    def __geo_interface__(self) -> dict[str, Any]:
        """The line as a GeoJSON-like feature with 3-D coordinates; see `LineSet.__geo_interface__`."""
        feature: dict[str, Any] = self.as_set().__geo_interface__["features"][0]
        return feature

    def to_shapely(self) -> Any:
        """Return the line as a shapely LineString Z."""
        return self.as_set().to_shapely()[0]

    def as_set(self) -> LineSet:
        """Return a LineSet of this one line."""
        return self._lines.take([self._number])

    def __len__(self) -> int:
        """Return the number of vertices."""
        return len(self.xyz)

    def __eq__(self, other: object) -> bool:
        return self.as_set() == other.as_set() if isinstance(other, Line) else NotImplemented

    __hash__ = None  # type: ignore[assignment]

    def __reduce__(self) -> tuple[Any, ...]:
        # Only the line itself goes to another process
        return Line, (self.as_set(), 0)

    def __repr__(self) -> str:
        named = [f"{name}={getattr(self, name)!r}" for name in ("kind", "id") if getattr(self, name)]
        n = len(self)
        return f"Line({', '.join([*named, f'{n} vertices' if n != 1 else '1 vertex', f'{self.length_m:,.1f} m'])})"

    def _repr_html_(self) -> str:
        return self.as_set()._repr_html_()


def line_number(index: Any, n: int) -> int:
    """Return the number of a line from an index, which may count from the end.

    Raises
    ------
    IndexError
        There is no such line.

    >>> line_number(-1, 3)
    2
    """
    number = int(np.int64(index))
    if not -n <= number < n:
        raise IndexError(f"line {number} of {n}")
    return number % n
