"""How many points were measured when: enough to say which share of a survey a trajectory covers."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from linework.arrays import FloatArray, IntArray

#: Buckets of a second at first; twice as wide whenever there would be more than this. An hour keeps its seconds,
#: a week of driving is told to a few minutes.
_MAX_BUCKETS = 4096


@dataclass(slots=True, eq=False)
class TimeCounts:
    """Points by time, in buckets that are 2**level seconds wide and begin at multiples of that.

    The result depends on the times alone, not on the order or the portions they come in.

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
