"""What the batches of a laser file add up to: points used and left out, extent, times."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import numpy as np

from linework.arrays import AnyArray, BoolArray, FloatArray
from linework.errors import InputError
from linework.files.las_batches import LasBatch
from linework.files.las_header import LasHeader
from linework.files.time_counts import TimeCounts

TimeKind = Literal["week", "adjusted", "gps", "none"]

_WEEK_S = 604_800.0
#: As adjusted standard time this is the year 2043, as GPS seconds 2011: larger numbers are the latter.
_LEAST_GPS_S = 1e9
#: Where more than this share of the times is none, they are in milliseconds, nanoseconds or no unit at all; fewer
#: are damaged, and their points with them.
_ODD_SHARE = 0.5
_IMPOSSIBLE_TIME = "impossible time"


@dataclass(frozen=True, slots=True)
class Verdict:
    """Which kind of time a file has, and what is odd about the file."""

    gps_time_kind: TimeKind
    warnings: tuple[str, ...]


@dataclass(slots=True)
class LasTally:
    """The account of one file while its batches come.

    Parameters
    ----------
    uses_time
        Whether points whose time is none are left out.
    n_read, n_kept
        Points so far, and those of them that are used.
    n_rejected
        Points left out, by reason, each counted once; with `n_kept` they add up to `n_read`.
    has_intensity
        Whether any point's intensity is above 0.
    low, high
        (3,) float64 [m]: extent of the points used.
    time_low_s, time_high_s
        Of all times that can be, also of points left out.
    n_odd, odd_low_s, odd_high_s
        Times that cannot be, and the extent of those that are numbers.
    time_counts
        Points used, by time.
    in_time_order
        Whether the times of the points used never run backwards.
    """

    uses_time: bool = True
    n_read: int = 0
    n_kept: int = 0
    n_rejected: Counter[str] = field(default_factory=Counter)
    has_intensity: bool = False
    low: FloatArray = field(default_factory=lambda: np.full(3, np.inf))
    high: FloatArray = field(default_factory=lambda: np.full(3, -np.inf))
    time_low_s: float = np.inf
    time_high_s: float = -np.inf
    n_odd: int = 0
    odd_low_s: float = np.inf
    odd_high_s: float = -np.inf
    time_counts: TimeCounts = field(default_factory=TimeCounts)
    in_time_order: bool = True
    _last_s: float = -np.inf

    def add(self, batch: LasBatch) -> tuple[FloatArray, AnyArray, FloatArray | None]:
        """Count a batch in, and return coordinates, intensities and times of the points that are used."""
        self.n_read += len(batch)
        self.has_intensity = self.has_intensity or bool(batch.intensity.any())
        xyz, intensity, time = batch.xyz, batch.intensity, batch.time_s if self.uses_time else None
        if time is not None:
            self._add_all_times(time, batch.is_untimed)
        kept = self._kept(batch)
        if kept is not None:
            xyz, intensity, time = xyz[kept], intensity[kept], None if time is None else time[kept]
        self.n_kept += len(xyz)
        if len(xyz):
            for axis in range(3):  # column by column: ten times as fast as along the first axis of all
                self.low[axis] = min(self.low[axis], xyz[:, axis].min())
                self.high[axis] = max(self.high[axis], xyz[:, axis].max())
            if time is not None:
                self._add_used_times(time)
        return xyz, intensity, time

    def _kept(self, batch: LasBatch) -> BoolArray | None:
        """Return which points are used (None: all), and count the others by the first reason that holds."""
        kept: BoolArray | None = None
        for reason, mask in (
            ("noise class", batch.is_noise),
            ("absurd coordinates", batch.is_absurd),
            (_IMPOSSIBLE_TIME, batch.is_untimed if self.uses_time else None),
        ):
            if mask is None:
                continue
            counted = mask if kept is None else mask & kept
            if counted.any():
                self.n_rejected[reason] += int(np.count_nonzero(counted))
            kept = ~mask if kept is None else kept & ~mask
        return kept

    def _add_all_times(self, time: FloatArray, is_untimed: BoolArray | None) -> None:
        if is_untimed is not None:
            odd, time = time[is_untimed], time[~is_untimed]
            self.n_odd += len(odd)
            numbers = odd[np.isfinite(odd)]
            self.odd_low_s = float(np.min(numbers, initial=self.odd_low_s))
            self.odd_high_s = float(np.max(numbers, initial=self.odd_high_s))
        if len(time):
            self.time_low_s = min(self.time_low_s, float(time.min()))
            self.time_high_s = max(self.time_high_s, float(time.max()))

    def _add_used_times(self, time: FloatArray) -> None:
        self.in_time_order = (
            self.in_time_order and bool(time[0] >= self._last_s) and bool(np.all(time[1:] >= time[:-1]))
        )
        self._last_s = float(time[-1])
        self.time_counts.add(time)

    @property
    def must_go_without_time(self) -> bool:
        """Whether points were left out for their times, though no time of the file can be used."""
        return self.n_rejected[_IMPOSSIBLE_TIME] > 0 and not self._times_are_usable

    @property
    def _times_are_zero(self) -> bool:
        return self.time_low_s == 0.0 and self.time_high_s == 0.0

    @property
    def _times_are_usable(self) -> bool:
        is_any = self.time_low_s <= self.time_high_s and not self._times_are_zero
        return is_any and self.n_odd <= _ODD_SHARE * self.n_read

    def verdict(self, header: LasHeader) -> Verdict:
        """Return what the whole file turned out to be, after its last batch."""
        warnings = () if self.has_intensity else ("no intensity (0 for all points)",)
        if not header.has_time:
            return Verdict("none", warnings)
        kind, warning = self._time_kind(has_adjusted_bit=header.has_adjusted_time)
        return Verdict(kind, (*warnings, warning) if warning else warnings)

    def _time_kind(self, *, has_adjusted_bit: bool) -> tuple[TimeKind, str]:
        """Return the kind of the times and what is odd about them; the values decide, the header's bit is often wrong."""
        low, high = self.time_low_s, self.time_high_s
        if self._times_are_zero:
            return "none", "no GPS time (0 for all points)"
        if not self._times_are_usable:
            low, high = self.odd_low_s, self.odd_high_s
            what = (
                f"GPS times from {low:g} to {high:g} are not in seconds"
                if low <= high
                else "GPS times are no numbers"
            )
            return "none", f"{what}: left out"
        in_week = low >= 0.0 and high <= _WEEK_S
        kind: TimeKind = "week" if in_week else "gps" if low > _LEAST_GPS_S else "adjusted"
        if kind == "gps" or (kind == "adjusted") != has_adjusted_bit:
            said = "adjusted standard time" if has_adjusted_bit else "seconds of the week"
            text = f"GPS times from {low:.0f} to {high:.0f}, though the header says {said}: taken as '{kind}'"
            return kind, text
        return kind, ""

    def check(self, path: Path, header: LasHeader) -> None:
        """Refuse a file of which not all promised points came, or none can be used.

        Raises
        ------
        InputError
            With the numbers.
        """
        if self.n_read != header.n_points:
            raise InputError(
                f"{self.n_read:,} points read, the header promises {header.n_points:,}", where=path,
                advice="copy the file again, or leave it out",
            )  # fmt: skip
        if self.n_kept == 0:
            reasons = ", ".join(f"{n:,} {reason}" for reason, n in self.n_rejected.items())
            raise InputError(
                f"no usable points among {header.n_points:,} ({reasons})", where=path, advice="leave the file out"
            )  # fmt: skip
