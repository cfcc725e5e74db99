"""The pairs that wait to be looked at: the oldest are skipped where the machine does not keep up.

Separate from `drive`, because what is skipped must be testable without images.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass

from linework.model.images import ImagePair

#: Time for which an image that cannot be read is tried again: cameras write one within a second. [s]
UNFINISHED_S = 5.0
#: Time between two tries. [s]
_AGAIN_S = 0.2


@dataclass(slots=True)
class _Tried:
    """A pair whose images are not complete: when it was tried first and shall be again [s, monotonic]."""

    pair: ImagePair
    first_s: float
    again_s: float


class PairQueue:
    """Pairs in the order of their time.

    Parameters
    ----------
    longest_lag_s
        A pair that is older than the newest one by more is skipped. [s]
    """

    def __init__(self, longest_lag_s: float) -> None:
        self._longest_lag_s = longest_lag_s
        self._waiting: deque[ImagePair] = deque()
        self._tried: dict[int, _Tried] = {}
        #: Time of the newest pair that arrived. [s]
        self.newest_s = -float("inf")

    def __len__(self) -> int:
        return len(self._waiting) + len(self._tried)

    def add(self, pairs: Iterable[ImagePair]) -> None:
        """Add pairs that arrived, in any order."""
        new = list(pairs)
        if not new:
            return
        is_late = bool(self._waiting) and min(p.time_s for p in new) < self._waiting[-1].time_s
        self._waiting.extend(new)
        if is_late or len(new) > 1:
            self._waiting = deque(sorted(self._waiting, key=lambda pair: pair.time_s))
        self.newest_s = max(self.newest_s, *(pair.time_s for pair in new))

    def skipped(self) -> list[ImagePair]:
        """Remove the pairs that are too far behind, and return them."""
        found = []
        while self._waiting and self.newest_s - self._waiting[0].time_s > self._longest_lag_s:
            found.append(self._waiting.popleft())
        return found

    def next(self, now_s: float) -> ImagePair | None:
        """Return the next pair to look at: one to be tried again first; None where none is due.

        Parameters
        ----------
        now_s
            Time of this machine. [s, monotonic]
        """
        for tried in self._tried.values():
            if tried.again_s <= now_s:
                return tried.pair
        return self._waiting.popleft() if self._waiting else None

    def try_again(self, pair: ImagePair, now_s: float) -> bool:
        """Put back a pair whose images cannot be read; False if that has lasted too long."""
        tried = self._tried.setdefault(pair.number, _Tried(pair, now_s, now_s))
        if now_s - tried.first_s >= UNFINISHED_S:
            del self._tried[pair.number]
            return False
        tried.again_s = now_s + _AGAIN_S
        return True

    def done(self, pair: ImagePair) -> None:
        """Forget a pair that was looked at."""
        self._tried.pop(pair.number, None)
