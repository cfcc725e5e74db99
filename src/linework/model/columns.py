"""Columns: the base of all values made of columns of equal length (points, boxes, sightings, trajectories ...)."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import MISSING, dataclass, field, fields, replace
from typing import Any, NamedTuple, Self, cast

import numpy as np

from linework.arrays import AnyArray, checked


class ColumnType(NamedTuple):
    """Type of a column.

    Parameters
    ----------
    dtype
        Type of its values.
    shape
        Shape of one row: () for numbers and texts, (3,) for positions.
    fill
        Value of all rows where the column is not given; None: the column stays None.
    """

    dtype: Any
    shape: tuple[int, ...]
    fill: Any


def column(dtype: Any = np.float64, *shape: int) -> Any:
    """Return a dataclass field of a column that must be given."""
    return field(metadata={"column": ColumnType(dtype, shape, None)})


def optional_column(dtype: Any = np.float64, *shape: int) -> Any:
    """Return a dataclass field of a column that may be None."""
    return field(default=None, metadata={"column": ColumnType(dtype, shape, None)})


def filled_column(dtype: Any, fill: Any) -> Any:
    """Return a dataclass field of a column of numbers or texts that holds `fill` where it is not given."""
    return field(default=None, metadata={"column": ColumnType(dtype, (), fill)})


@dataclass(frozen=True, slots=True)
class Columns:
    """Base of frozen dataclasses whose fields are all columns, one row each per thing; rows are along axis 0.

    Raises
    ------
    ValueError
        On construction: a column of another shape or length than the first; the message names it.
    """

    def __post_init__(self) -> None:
        check_columns(self, column_types(type(self)))

    def __len__(self) -> int:
        return len(getattr(self, next(iter(column_types(type(self))))))

    def by_name(self) -> dict[str, AnyArray]:
        """Return the columns that are there, by name."""
        values = {name: getattr(self, name) for name in column_types(type(self))}
        return {name: value for name, value in values.items() if value is not None}

    def take(self, index: AnyArray | Sequence[int] | slice) -> Self:
        """Return the rows chosen by a mask, an index array or a slice, in that order."""
        rows = index if isinstance(index, slice | np.ndarray) else np.asarray(index, dtype=np.int64)
        return replace(self, **{name: value[rows] for name, value in self.by_name().items()})

    @classmethod
    def empty(cls) -> Self:
        """Return columns without rows; optional ones are None."""
        needed = {f.name for f in fields(cls) if f.default is MISSING and f.default_factory is MISSING}
        types = {name: found for name, found in column_types(cls).items() if name in needed}
        return cls._of({name: np.zeros((0, *found.shape), found.dtype) for name, found in types.items()})

    @classmethod
    def concatenate(cls, sets: Iterable[Self]) -> Self:
        """Return the rows of all sets in order; a column that one of them lacks is None."""
        parts = [one.by_name() for one in sets]
        if not parts:
            return cls.empty()
        names = [name for name in parts[0] if all(name in part for part in parts)]
        return cls._of({name: np.concatenate([part[name] for part in parts]) for name in names})

    @classmethod
    def _of(cls, columns: dict[str, AnyArray]) -> Self:
        build = cast(Any, cls)
        return cast(Self, build(**columns))


#: Looked up once per class: methods build sets of a few rows by the thousand.
_TYPES: dict[type, dict[str, ColumnType]] = {}


def column_types(cls: type) -> dict[str, ColumnType]:
    """Return the types of the columns of a dataclass, by name, in the order of its fields."""
    if cls not in _TYPES:
        _TYPES[cls] = {f.name: f.metadata["column"] for f in fields(cls) if "column" in f.metadata}
    return _TYPES[cls]


def check_columns(owner: Any, types: dict[str, ColumnType], n: int | None = None) -> None:
    """Replace the columns of a frozen dataclass by checked, read-only arrays.

    Parameters
    ----------
    n
        Number of rows; None: that of the first column.

    Raises
    ------
    ValueError
        A column of another shape; the message names it.
    """
    for name, (dtype, shape, fill) in types.items():
        value = getattr(owner, name)
        if value is None:
            if fill is None:
                continue
            value = np.full(n or 0, fill, dtype)
        elif fill is not None and not isinstance(value, np.ndarray) and np.ndim(value) == 0:
            # One value for all rows
            value = np.full(n or 0, value)
        array = checked(name, value, dtype, (n, *shape))
        n = len(array)
        object.__setattr__(owner, name, array)
