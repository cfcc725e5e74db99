"""Totals of a LAS file over its batches: points used and left out, extent, times."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np

from linework.arrays import AnyArray, BoolArray, Float32Array, FloatArray, IntArray
from linework.errors import InputError
from linework.files.las.batches import LasBatch
from linework.files.las.header import LasHeader
from linework.files.logs.clock import WEEK_S

#: Largest number of buckets: they start at 1 s and double in width when more would be needed. An hour keeps its
#: seconds, a week of driving is resolved to a few minutes.
_MAX_BUCKETS = 4096


@dataclass(slots=True, eq=False)
class TimeCounts:
    """Histogram of points over time, in buckets of 2**level seconds that begin at multiples of that.

    The result depends on the times alone, not on their order or batches.

    >>> counts = TimeCounts()
    >>> counts.add(np.array([10.0, 10.5, 11.5, 12.0]))
    >>> counts.share_within(11.0, 100.0)
    0.5

    Parameters
    ----------
    level
        Width of the buckets.
    first
        Number of the first bucket: it begins at ``first * 2**level`` seconds.
    counts
        (n,) int64: points per bucket.
    low_s, high_s
        First and last time.
    """

    level: int = 0
    first: int = 0
    counts: IntArray = field(default_factory=lambda: np.zeros(0, np.int64))
    low_s: float = math.inf
    high_s: float = -math.inf

    def add(self, time_s: FloatArray) -> None:
        """Count times in; they are finite and at least one."""
        low, high = float(time_s.min()), float(time_s.max())
        level = 0
        while _n_buckets(low, high, level) > _MAX_BUCKETS:
            level += 1
        first = math.floor(low) >> level
        buckets = np.floor(time_s).astype(np.int64) >> level
        self.merge(TimeCounts(level, first, np.bincount(buckets - first), low, high))

    def merge(self, other: TimeCounts) -> None:
        """Count in what another has counted."""
        if other.low_s > other.high_s:
            return
        low, high = min(self.low_s, other.low_s), max(self.high_s, other.high_s)
        level = max(self.level, other.level)
        while _n_buckets(low, high, level) > _MAX_BUCKETS:
            level += 1
        first = math.floor(low) >> level
        counts = np.zeros(_n_buckets(low, high, level), np.int64)
        for part in (self, other):
            at = ((part.first + np.arange(len(part.counts))) >> (level - part.level)) - first
            np.add.at(counts, at, part.counts)
        self.level, self.first, self.counts, self.low_s, self.high_s = level, first, counts, low, high

    def measured_at(self, time_s: FloatArray) -> BoolArray:
        """Return which times (n,) are of buckets with points, (n,) bool.

        >>> counts = TimeCounts()
        >>> counts.add(np.array([10.0, 12.0]))
        >>> counts.measured_at(np.array([9.9, 10.9, 11.5, 12.5])).tolist()
        [False, True, False, True]
        """
        at = (np.floor(time_s).astype(np.int64) >> self.level) - self.first
        has_points = np.append(self.counts > 0, False)
        return np.asarray(has_points[np.where((at >= 0) & (at < len(self.counts)), at, -1)])

    def share_within(self, start_s: float, end_s: float) -> float:
        """Return the share of the points measured from `start_s` to `end_s`.

        Within a bucket points are taken as evenly spread; exactly 0 where no bucket is touched.
        """
        width = 2.0**self.level
        edges = (self.first + np.arange(len(self.counts) + 1)) * width
        begin, end = np.maximum(edges[:-1], self.low_s), np.minimum(edges[1:], self.high_s)
        inside = np.clip(np.minimum(end, end_s) - np.maximum(begin, start_s), 0.0, end - begin)
        share = np.divide(inside, end - begin, out=np.zeros_like(inside), where=end > begin)
        share[(begin >= start_s) & (end <= end_s)] = 1.0
        return float(np.sum(share * self.counts) / max(int(self.counts.sum()), 1))

    def share_in_gap(self, start_s: float, end_s: float) -> float:
        """Return the share of the points measured in a gap of something else, from `start_s` to `end_s`.

        As `share_within`, but points that stop with the bucket in which the gap begins, or start with the one in which
        it ends, are taken to be outside.

        >>> counts = TimeCounts()
        >>> counts.add(np.array([0.0, 0.1, 400.0, 400.1]))
        >>> counts.share_in_gap(0.11, 399.9)
        0.0
        >>> counts.share_in_gap(-1.0, 200.0)
        0.5
        """
        width = 2.0**self.level
        edges = (self.first + np.arange(len(self.counts) + 1)) * width
        whole = (edges[:-1] >= start_s) & (edges[1:] <= end_s)
        if whole.any() and not self.counts[whole][0]:
            start_s = max(start_s, float(edges[:-1][whole][0]))
        if whole.any() and not self.counts[whole][-1]:
            end_s = min(end_s, float(edges[1:][whole][-1]))
        return self.share_within(start_s, end_s)

    def ends_a_week(self) -> bool:
        """Return whether all times are within a day of the end of a GPS week, on both sides of it.

        >>> counts = TimeCounts()
        >>> counts.add(np.array([3.0, 604798.0]))
        >>> counts.ends_a_week()
        True
        """
        if not (0.0 <= self.low_s < DAY_S and WEEK_S - DAY_S < self.high_s <= WEEK_S):
            return False
        begins = (self.first + np.arange(len(self.counts))) * 2.0**self.level
        between = (begins >= DAY_S) & (begins + 2.0**self.level <= WEEK_S - DAY_S)
        return not self.counts[between].any()

    def to_document(self) -> dict[str, Any]:
        """Return it as JSON."""
        if self.low_s > self.high_s:
            return {}
        return {
            "level": self.level, "first": self.first, "counts": " ".join(map(str, self.counts.tolist())),
            "low_s": self.low_s, "high_s": self.high_s,
        }  # fmt: skip

    @classmethod
    def from_document(cls, document: dict[str, Any]) -> TimeCounts:
        """Read what `to_document` returned."""
        if not document:
            return cls()
        return cls(**(document | {"counts": np.array(document["counts"].split(), np.int64)}))

    def __eq__(self, other: object) -> bool:
        return isinstance(other, TimeCounts) and self.to_document() == other.to_document()

    __hash__ = None  # type: ignore[assignment]


def _n_buckets(low: float, high: float, level: int) -> int:
    return (math.floor(high) >> level) - (math.floor(low) >> level) + 1


TimeKind = Literal["week", "adjusted", "gps", "none"]

DAY_S = 86_400.0
#: As adjusted standard time this is the year 2043, as GPS seconds 2011: larger numbers are the latter.
_LEAST_GPS_S = 1e9
#: Above this share of impossible times, all of them are in another unit; below it, those points are damaged.
_ODD_SHARE = 0.5
#: Reasons for which points are left out.
NOISE_CLASS, WITHHELD, NO_RETURN = "noise class", "withheld", "without a return"
_IMPOSSIBLE_TIME = "impossible time"


def time_kind_of(low_s: float, high_s: float) -> TimeKind:
    """Return the kind of times with this range.

    >>> time_kind_of(0.0, 3600.0), time_kind_of(3e8, 3e8 + 60.0), time_kind_of(1.3e9, 1.3e9 + 60.0)
    ('week', 'adjusted', 'gps')
    """
    if low_s >= 0.0 and high_s <= WEEK_S:
        return "week"
    return "gps" if low_s > _LEAST_GPS_S else "adjusted"


@dataclass(frozen=True, slots=True)
class TimeVerdict:
    """Kind of time of a file, and warnings about the file."""

    gps_time_kind: TimeKind
    warnings: tuple[str, ...]


@dataclass(slots=True)
class LasTally:
    """Totals of one file while its batches are read.

    Parameters
    ----------
    uses_time
        Whether points with an impossible time are left out.
    keeps_noise
        Whether points of noise classes are used.
    continues_week
        Whether seconds of the week that begin anew at 0 are continued past the end of the week before.
    n_read, n_kept
        Points so far, and how many of them are used.
    n_rejected
        Points left out, by reason, each counted once; with `n_kept` they add up to `n_read`.
    has_intensity
        Whether any point's intensity is above 0.
    low, high
        (3,) float64 [m]: extent of the points used.
    time_low_s, time_high_s
        Range of all possible times, also of points left out.
    n_odd, odd_low_s, odd_high_s
        Number of impossible times, and the range of those that are numbers.
    time_counts
        Points used, by time.
    in_time_order
        Whether the times of the points used never run backwards.
    """

    uses_time: bool = True
    keeps_noise: bool = False
    continues_week: bool = False
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

    def add(self, batch: LasBatch) -> tuple[FloatArray, AnyArray, FloatArray | None, Float32Array]:
        """Add a batch, and return the points used.

        Returns
        -------
        tuple
            Coordinates (n, 3) [m], intensities (n,), times (n,) [s] and further columns (k, n).
        """
        self.n_read += len(batch)
        self.has_intensity = self.has_intensity or bool(batch.intensity.any())
        xyz, intensity, time = batch.xyz, batch.intensity, batch.time_s if self.uses_time else None
        columns = batch.columns
        if time is not None and self.continues_week:
            time = np.where(time < 0.5 * WEEK_S, time + WEEK_S, time)
        if time is not None:
            self._add_all_times(time, batch.is_untimed)
        kept = self._kept(batch)
        if kept is not None:
            xyz, intensity, time = xyz[kept], intensity[kept], None if time is None else time[kept]
            columns = columns[:, kept]
        self.n_kept += len(xyz)
        if len(xyz):
            for axis in range(3):  # column by column: ten times as fast as along the first axis of all
                self.low[axis] = min(self.low[axis], xyz[:, axis].min())
                self.high[axis] = max(self.high[axis], xyz[:, axis].max())
            if time is not None:
                self._add_used_times(time)
        return xyz, intensity, time, columns

    def _kept(self, batch: LasBatch) -> BoolArray | None:
        """Return which points are used (None: all), and count the others by the first reason that applies."""
        kept: BoolArray | None = None
        for reason, mask in (
            (NO_RETURN, batch.is_missing),
            (NOISE_CLASS, None if self.keeps_noise else batch.is_noise),
            (WITHHELD, batch.is_withheld),
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
        """Whether points were left out for their times although no time of the file is usable."""
        return self.n_rejected[_IMPOSSIBLE_TIME] > 0 and not self._times_are_usable

    @property
    def _times_are_zero(self) -> bool:
        return self.time_low_s == 0.0 and self.time_high_s == 0.0

    @property
    def _times_are_usable(self) -> bool:
        is_any = self.time_low_s <= self.time_high_s and not self._times_are_zero
        return is_any and self.n_odd <= _ODD_SHARE * self.n_read

    def verdict(self, header: LasHeader) -> TimeVerdict:
        """Return the kind of time of the whole file and its warnings, after the last batch."""
        warnings = () if self.has_intensity else ("no intensity (0 for all points)",)
        if not header.has_time:
            return TimeVerdict("none", warnings)
        kind, warning = self._time_kind(has_adjusted_bit=header.has_adjusted_time)
        if header.cloud is not None and kind != "none":
            # Other formats do not state the kind of their times: nothing to disagree with
            warning = ""
        return TimeVerdict(kind, (*warnings, warning) if warning else warnings)

    def _time_kind(self, *, has_adjusted_bit: bool) -> tuple[TimeKind, str]:
        """Return the kind of the times and a warning; the values decide, because the header's bit is often wrong."""
        low, high = self.time_low_s, self.time_high_s
        if self._times_are_zero:
            return "none", "no GPS time (0 for all points)"
        if not self._times_are_usable:
            low, high = self.odd_low_s, self.odd_high_s
            what = (
                f"GPS times from {low:g} to {high:g} are not in seconds"
                if low <= high
                else "GPS times are not numbers"
            )
            return "none", f"{what}: left out"
        if self.continues_week:
            return "week", "the GPS week ends within the survey: its seconds are continued"
        kind = time_kind_of(low, high)
        if not has_adjusted_bit and 0.0 <= low <= WEEK_S < high <= WEEK_S + DAY_S:
            return "week", ""
        if kind == "gps" or (kind == "adjusted") != has_adjusted_bit:
            stated = "adjusted standard time" if has_adjusted_bit else "seconds of the week"
            text = (
                f"GPS times from {low:.0f} to {high:.0f}, though the header says {stated}: read as '{kind}'"
            )
            return kind, text
        return kind, ""

    def check(self, path: Path, header: LasHeader) -> None:
        """Refuse a file with fewer points than promised, or without a usable one.

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


class HeaderBox:
    """Counts the points outside the bounding box in the header: a wrong header, or damaged points.

    Parameters
    ----------
    factors
        Metres per unit of the file, in plan and in height.
    """

    def __init__(self, header: LasHeader, factors: tuple[float, float]) -> None:
        horizontal, vertical = factors
        metres = np.array([horizontal, horizontal, vertical])
        is_stated = header.low is not None and header.high is not None
        # Some writers state the box before rounding to the file's steps
        margin = np.abs(header.scales) * metres
        self._low = np.array(header.low) * metres - margin if is_stated else np.full(3, -np.inf)
        self._high = np.array(header.high) * metres + margin if is_stated else np.full(3, np.inf)
        self._n_outside = 0

    def add(self, xyz: FloatArray, low: FloatArray, high: FloatArray) -> None:
        """Add a batch.

        Parameters
        ----------
        low, high
            (3,) extent [m] of all points including this batch: while it is inside, no point is tested.
        """
        if np.all(low >= self._low) and np.all(high <= self._high):
            return
        inside = np.ones(len(xyz), dtype=bool)
        for axis in range(3):
            inside &= (xyz[:, axis] >= self._low[axis]) & (xyz[:, axis] <= self._high[axis])
        self._n_outside += len(xyz) - int(np.count_nonzero(inside))

    def warnings(self, n_points: int) -> tuple[str, ...]:
        """Return a warning about points outside, or none.

        Parameters
        ----------
        n_points
            Number of points tested.
        """
        if not self._n_outside:
            return ()
        return (f"{self._n_outside:,} of {n_points:,} points lie outside the bounding box in its header",)
