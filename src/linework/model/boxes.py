"""BoxSet: many oriented bounding boxes found in the points, as columns."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, fields
from enum import IntEnum
from typing import Any

import numpy as np

from linework.arrays import AnyArray, BoolArray, FloatArray, checked


class BoxForm(IntEnum):
    """What a box holds a piece of."""

    #: A stripe of paint, narrow enough for a line.
    STRIPE = 0
    #: Other paint: bars, arrows, letters.
    OTHER_PAINT = 1
    #: The foot of a kerb.
    KERB = 2
    #: The edge of the pavement, without a kerb.
    EDGE = 3
    #: The foot of a barrier or a wall that stands on the carriageway's edge.
    BARRIER = 4


def _column(dtype: Any, default: Any) -> Any:
    return field(default=None, metadata={"dtype": dtype, "default": default})


@dataclass(frozen=True, slots=True, kw_only=True)
class BoxSet:
    """n oriented boxes, in plan: centre, u-axis along the feature, v-axis to its left.

    Parameters
    ----------
    centre
        (n, 3) float64 [m, from the survey's local origin]: on the feature's reference line.
    u
        (n, 2) float64: unit vector along the feature. Boundaries: the carriageway is on its LEFT (+v side).
        Stripes: either way round.
    half_u_m
        (n,) float64 [m]: half the length along u over which there is evidence; the centre is its middle.
    half_v_m
        (n,) float64 [m]: half the width; of a stripe half the paint's width.
    sigma_v_m, sigma_z_m, sigma_u_rad
        (n,) float64: standard deviation of the centre across, of its height, and of the direction.
    score
        (n,) float64, 0 to 1: how sure it is that this is a piece of such a feature.
    form
        (n,) int8: see `BoxForm`.
    height_m
        (n,) float64 [m]: step from the foot up to the top (boundaries); NaN for paint.
    top_v_m
        (n,) float64 [m]: where the kerb's top edge is, along v from the centre (negative: away from the
        carriageway); NaN where there is none.
    contrast
        (n,) float64: mean intensity of the paint over that of the surface beside it; NaN for boundaries.
    n_points
        (n,) int64: points that the reference line was measured from.
    time_start_s, time_end_s
        (n,) float64 [s]: of these points; NaN where they have no time.
    """

    centre: FloatArray
    u: FloatArray
    half_u_m: FloatArray = _column(np.float64, np.nan)
    half_v_m: FloatArray = _column(np.float64, np.nan)
    sigma_v_m: FloatArray = _column(np.float64, np.nan)
    sigma_z_m: FloatArray = _column(np.float64, np.nan)
    sigma_u_rad: FloatArray = _column(np.float64, np.nan)
    score: FloatArray = _column(np.float64, 1.0)
    form: AnyArray = _column(np.int8, 0)
    height_m: FloatArray = _column(np.float64, np.nan)
    top_v_m: FloatArray = _column(np.float64, np.nan)
    contrast: FloatArray = _column(np.float64, np.nan)
    n_points: AnyArray = _column(np.int64, 0)
    time_start_s: FloatArray = _column(np.float64, np.nan)
    time_end_s: FloatArray = _column(np.float64, np.nan)

    def __post_init__(self) -> None:
        object.__setattr__(self, "centre", checked("centre", self.centre, np.float64, (None, 3)))
        n = len(self.centre)
        object.__setattr__(self, "u", checked("u", self.u, np.float64, (n, 2)))
        for name in BOX_COLUMNS:
            meta = self.__dataclass_fields__[name].metadata
            value = getattr(self, name)
            if value is None:
                value = np.full(n, meta["default"], dtype=meta["dtype"])
            object.__setattr__(self, name, checked(name, value, meta["dtype"], (n,)))

    def __len__(self) -> int:
        return len(self.centre)

    @classmethod
    def empty(cls) -> BoxSet:
        """Return a set of no boxes."""
        return cls(centre=np.zeros((0, 3)), u=np.zeros((0, 2)))

    @classmethod
    def concatenate(cls, sets: Iterable[BoxSet]) -> BoxSet:
        """Return all boxes of `sets` in order; they must share one local origin.

        >>> len(BoxSet.concatenate([BoxSet.empty(), BoxSet.empty()]))
        0
        """
        kept = list(sets)
        if not kept:
            return cls.empty()
        names = ("centre", "u", *BOX_COLUMNS)
        return cls(**{name: np.concatenate([getattr(s, name) for s in kept]) for name in names})

    def time_span(self, index: AnyArray) -> tuple[float, float]:
        """Return the first and the last time of some boxes [s]; NaN where none has times."""
        start, end = self.time_start_s[index], self.time_end_s[index]
        known = np.isfinite(start) & np.isfinite(end)
        return (float(start[known].min()), float(end[known].max())) if known.any() else (np.nan, np.nan)

    def along(self, index: AnyArray) -> FloatArray:
        """Return (k,) distances [m] along the centres of some boxes, in plan, from the first."""
        step = np.linalg.norm(np.diff(self.centre[index, :2], axis=0), axis=1)
        return np.concatenate([[0.0], np.cumsum(step)])

    def take(self, index: AnyArray | BoolArray) -> BoxSet:
        """Return the boxes chosen by a mask or an index array, in that order."""
        return BoxSet(**{name: getattr(self, name)[index] for name in ("centre", "u", *BOX_COLUMNS)})


BOX_COLUMNS = tuple(f.name for f in fields(BoxSet) if f.name not in ("centre", "u"))
