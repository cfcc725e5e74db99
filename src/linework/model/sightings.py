"""Sightings: places on lines as stereo pairs saw them, as columns."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np

from linework.arrays import AnyArray, FloatArray, checked


def _column(dtype: Any, default: Any) -> Any:
    return field(default=None, metadata={"dtype": dtype, "default": default})


@dataclass(frozen=True, slots=True, kw_only=True)
class Sightings:
    """n places on lines, each seen in both images of one pair; in order of pair, line, and nearest first.

    Parameters
    ----------
    xyz
        (n, 3) float64 [m, vehicle at the time of the pair].
    pair
        (n,) int64: number of the pair (`ImagePair.number`).
    line
        (n,) int64: which line of that pair, from 0.
    col, row, disparity
        (n,) float64 [pixels, rectified left image]: where it was seen.
    sigma_px
        (n,) float64 [pixels]: standard deviation of `col`, across the line, from the image noise.
    sigma_disparity_px
        (n,) float64 [pixels].
    width_m
        (n,) float64 [m]: width of the paint; NaN where it is no stripe.
    contrast
        (n,) float64 [grey values]: paint over the road beside it, or the step across an edge.
    score
        (n,) float64, 0 to 1: how sure it is that this is such a line.
    """

    xyz: FloatArray
    pair: AnyArray = _column(np.int64, 0)
    line: AnyArray = _column(np.int64, 0)
    col: FloatArray = _column(np.float64, np.nan)
    row: FloatArray = _column(np.float64, np.nan)
    disparity: FloatArray = _column(np.float64, np.nan)
    sigma_px: FloatArray = _column(np.float64, np.nan)
    sigma_disparity_px: FloatArray = _column(np.float64, np.nan)
    width_m: FloatArray = _column(np.float64, np.nan)
    contrast: FloatArray = _column(np.float64, np.nan)
    score: FloatArray = _column(np.float64, 1.0)

    def __post_init__(self) -> None:
        object.__setattr__(self, "xyz", checked("xyz", self.xyz, np.float64, (None, 3)))
        for name in SIGHTING_COLUMNS:
            meta = self.__dataclass_fields__[name].metadata
            value = getattr(self, name)
            if value is None:
                value = np.full(len(self.xyz), meta["default"], dtype=meta["dtype"])
            object.__setattr__(self, name, checked(name, value, meta["dtype"], (len(self.xyz),)))

    def __len__(self) -> int:
        return len(self.xyz)

    @classmethod
    def empty(cls) -> Sightings:
        """Return a set of no sightings."""
        return cls(xyz=np.zeros((0, 3)))

    @classmethod
    def concatenate(cls, sets: Iterable[Sightings]) -> Sightings:
        """Return all sightings of `sets` in order.

        >>> len(Sightings.concatenate([Sightings.empty(), Sightings.empty()]))
        0
        """
        kept = list(sets)
        if not kept:
            return cls.empty()
        names = ("xyz", *SIGHTING_COLUMNS)
        return cls(**{name: np.concatenate([getattr(s, name) for s in kept]) for name in names})

    def take(self, index: AnyArray) -> Sightings:
        """Return the sightings chosen by a mask or an index array, in that order."""
        return Sightings(**{name: getattr(self, name)[index] for name in ("xyz", *SIGHTING_COLUMNS)})


SIGHTING_COLUMNS = tuple(f.name for f in fields(Sightings) if f.name != "xyz")
