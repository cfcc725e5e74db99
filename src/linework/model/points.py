"""Laser points as columns."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any, Self

import numpy as np

from linework.arrays import AnyArray, Float32Array, FloatArray, checked
from linework.errors import UsageError
from linework.model.columns import Columns, column, column_types, optional_column
from linework.model.grid import Bounds


@dataclass(frozen=True, slots=True, init=False, eq=False, repr=False)
class Points(Columns):
    """Laser points in a metric CRS, as columns of equal length, in any order.

    Parameters
    ----------
    xyz
        (n, 3) float64 [m, world]: east, north, up.
    intensity
        (n,) float32, as recorded, or None where there is none.
    time_s
        (n,) float64 [s], the survey's clock, or None.
    crs
        The (compound) CRS of the coordinates: WKT, "EPSG:25832+7837", the number of an EPSG code, or an object with
        `to_wkt`, such as a `pyproj.CRS`. "local": metres, no place on earth. It is kept as text, and checked where
        the points are used.
    **columns
        Further columns, (n,) float32, by name: results of a classifier, or fields of a LAS file. Names that are not
        Python words can be given as a mapping: ``columns={"Range deviation": values}``.

    Raises
    ------
    CrsError
        `crs` is of another type.
    ValueError
        A column of another shape, or that does not hold numbers; the message names it.

    Examples
    --------
    >>> points = Points(np.array([[0.0, 0.0, 5.0], [3.0, 1.0, 5.2]]), crs=25832, p_paint=[0.1, 0.9])
    >>> points
    Points(n=2, 3.0 x 1.0 m from 0.0, 0.0, columns xyz p_paint, crs EPSG:25832)
    >>> points["p_paint"].tolist()
    [0.10000000149011612, 0.8999999761581421]
    """

    xyz: FloatArray = column(np.float64, 3)
    intensity: Float32Array | None = optional_column(np.float32)
    time_s: FloatArray | None = optional_column()
    crs: str = "local"
    columns: Mapping[str, Float32Array] = field(default_factory=dict)

    def __init__(
        self, xyz: Any, *, intensity: Any = None, time_s: Any = None, crs: Any = "local", **columns: Any
    ) -> None:
        known = {"xyz": xyz, "intensity": intensity, "time_s": time_s}
        several = columns.pop("columns", {})
        if not isinstance(several, Mapping):
            raise TypeError(f"columns: expected a mapping of names to arrays, not {type(several).__name__}")
        types = column_types(type(self))
        found, n = dict[str, Any](), None
        for name, values in known.items():
            dtype, shape, _ = types[name]
            found[name] = (
                None if values is None and name != "xyz" else _column(name, values, dtype, (n, *shape))
            )
            n = len(found["xyz"]) if n is None else n
        extra = dict[str, AnyArray]()
        for name, values in (*columns.items(), *several.items()):
            if not isinstance(name, str) or not name or name in {*known, *extra, "crs", "columns"}:
                raise ValueError(f"columns: {name!r} cannot be the name of a further column")
            extra[name] = _column(name, values, np.float32, (n,))
        for name, value in (*found.items(), ("crs", _crs_text(crs)), ("columns", MappingProxyType(extra))):
            object.__setattr__(self, name, value)

    def __reduce__(self) -> tuple[Any, ...]:
        return _rebuilt, (self.xyz, self.intensity, self.time_s, self.crs, dict(self.columns))

    def __repr__(self) -> str:
        names = " ".join(self.by_name())
        crs = self.crs if len(self.crs) <= _LONGEST_CRS else f"{self.crs[:_LONGEST_CRS]}..."
        if len(self) == 0:
            return f"Points(n=0, columns {names}, crs {crs})"
        where = self.bounds
        size = f"{where.east - where.west:,.1f} x {where.north - where.south:,.1f} m"
        return f"Points(n={len(self):,}, {size} from {where.west:.1f}, {where.south:.1f}, columns {names}, crs {crs})"

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Points):
            return NotImplemented
        own, others = self.by_name(), other.by_name()
        return (
            self.crs == other.crs
            and own.keys() == others.keys()
            and all(np.array_equal(own[name], others[name], equal_nan=True) for name in own)
        )

    __hash__ = None  # type: ignore[assignment]

    def __getitem__(self, name: str) -> AnyArray:
        """Return a column by its name: xyz, intensity, time_s, or a further one.

        Raises
        ------
        KeyError
            There is none of this name.
        """
        found = self.by_name()
        if name not in found:
            raise KeyError(f"no column {name!r} in points with {', '.join(found)}")
        return found[name]

    def by_name(self) -> dict[str, AnyArray]:
        """Return the columns that are there, by name: xyz first, further columns last."""
        known = {"xyz": self.xyz, "intensity": self.intensity, "time_s": self.time_s, **self.columns}
        return {name: value for name, value in known.items() if value is not None}

    def take(self, index: AnyArray | Sequence[int] | slice) -> Self:
        """Return the points chosen by a mask, an index array or a slice, in that order, with all columns."""
        rows = index if isinstance(index, slice | np.ndarray) else np.asarray(index, dtype=np.int64)
        return self._of({name: value[rows] for name, value in self.by_name().items()} | {"crs": self.crs})

    @classmethod
    def concatenate(cls, sets: Iterable[Self]) -> Self:
        """Return the points of all sets in order; a column that one of them lacks is left out.

        Raises
        ------
        ValueError
            The sets have more than one CRS.
        """
        parts = list(sets)
        if not parts:
            return cls.empty()
        # A set without points has the CRS of no place
        found = list(dict.fromkeys(part.crs for part in parts if len(part))) or [parts[0].crs]
        if len(found) > 1:
            raise ValueError(f"points in {len(found)} CRSs, the first two {found[0]!r} and {found[1]!r}")
        columns = [part.by_name() for part in parts]
        names = [name for name in columns[0] if all(name in part for part in columns)]
        joined = {name: np.concatenate([part[name] for part in columns]) for name in names}
        return cls._of(joined | {"crs": found[0]})

    @classmethod
    def _of(cls, columns: Mapping[str, Any]) -> Self:
        known = {name: columns[name] for name in ("xyz", "intensity", "time_s", "crs") if name in columns}
        return cls(**known, columns={name: columns[name] for name in columns if name not in known})

    @property
    def bounds(self) -> Bounds:
        """Extent in plan [m, world].

        Raises
        ------
        ValueError
            There are no points.
        """
        if len(self) == 0:
            raise ValueError("no points: no extent")
        # Column by column: numpy's min(axis=0) over rows of 3 is ten times slower (0.2 s for 4 million points).
        east, north = self.xyz[:, 0], self.xyz[:, 1]
        return Bounds(float(east.min()), float(north.min()), float(east.max()), float(north.max()))


#: Farthest coordinate [m]: no projected CRS reaches beyond, and the tile store's lattice ends there.
FARTHEST_COORDINATE_M = 1e8


def refuse_unusable(points: Points) -> None:
    """Refuse points that no method can use.

    Raises
    ------
    UsageError
        A coordinate, time or intensity that is not a finite number, or a coordinate beyond 1e8 m; with how many.
    """
    for name in ("xyz", "time_s", "intensity"):
        values = points.by_name().get(name)
        # Extremes cost less than a mask, and are NaN where any value is
        if values is None or not values.size or np.isfinite([values.min(), values.max()]).all():
            continue
        bad = ~np.isfinite(values).reshape(len(values), -1).all(axis=1)
        raise UsageError(
            f"{np.count_nonzero(bad):,} of {len(points):,} points have NaN or infinity there",
            where=name,
            advice=f"leave them out, as points.take(np.isfinite(points.{name}){'.all(axis=1)' * (name == 'xyz')}) does",
        )
    if len(points) and max(-points.xyz.min(), points.xyz.max()) >= FARTHEST_COORDINATE_M:
        n_far = np.count_nonzero((np.abs(points.xyz) >= FARTHEST_COORDINATE_M).any(axis=1))
        raise UsageError(
            f"{n_far:,} of {len(points):,} points have coordinates of 1e8 m or more", where="xyz",
            advice="leave them out, or give coordinates of a projected CRS in metres",
        )  # fmt: skip


#: Characters of a CRS that are shown: names and codes are shorter, WKT fills a page.
_LONGEST_CRS = 40


def _column(name: str, values: Any, dtype: Any, shape: tuple[int | None, ...]) -> AnyArray:
    """Return a checked column; values that are not numbers are refused by its name."""
    try:
        array = np.asarray(values, dtype=dtype)
    except (TypeError, ValueError) as error:
        raise ValueError(f"{name}: expected numbers ({error})") from error
    return checked(name, array, dtype, shape)


def _crs_text(crs: object) -> str:
    """Return a CRS as text: WKT of objects, "EPSG:n" of numbers."""
    if isinstance(crs, str) and crs.strip():
        return crs.strip()
    from linework.crs import crs_text  # loads PROJ, which points of a known CRS do not need

    return crs_text(crs)


def _rebuilt(*values: Any) -> Points:
    """Return points as they were before pickling."""
    xyz, intensity, time_s, crs, columns = values
    return Points(xyz, intensity=intensity, time_s=time_s, crs=crs, columns=columns)
