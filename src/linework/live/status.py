"""How a drive goes, for the operator's page, for a line of progress, and for the record beside the lines."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from linework.live.kept import Kept


@dataclass(frozen=True, slots=True, kw_only=True)
class LiveStatus:
    """The state of a drive at one moment.

    Parameters
    ----------
    counts
        Number of pairs by what was done with them.
    saved_pairs
        Number of pairs looked at that the journal on the disk has.
    waiting
        Number of pairs that arrived and were not looked at.
    pairs_per_s
        Over the last ten seconds. [1/s]
    lag_s
        From the time of the newest pair to the result of the last one that was looked at. [s]
    newest_s
        Time of the newest position on the survey's clock [s]; None while there is none.
    position, sigma_m
        East, north, up, and the standard deviation in plan; None while it is not known. [m]
    chainage_m
        Distance driven. [m]
    saved_s_ago
        Since the journal was saved last. [s]
    notices
        Lines for the operator, and whether their trouble lasts.
    """

    counts: dict[str, int]
    saved_pairs: int
    waiting: int
    pairs_per_s: float
    lag_s: float
    newest_s: float | None
    position: tuple[float, float, float] | None
    sigma_m: float | None
    chainage_m: float
    saved_s_ago: float
    notices: tuple[tuple[str, bool], ...] = ()

    def line(self) -> str:
        """Return how it goes in one line."""
        sigma = "no position" if self.sigma_m is None else f"sigma {self.sigma_m:.2f} m"
        return (
            f"{self.counts['looked']:,} pairs, {self.pairs_per_s:.1f} pairs/s, {self.lag_s:.1f} s behind, "
            f"{self.counts['skipped']:,} skipped, {self.chainage_m:,.0f} m, {sigma}"
        )


def live_summary(kept: Kept, n_keys: int) -> dict[str, Any]:
    """Return what was done in a drive so far, for JSON."""
    return {
        "pairs": dict(kept.counts),
        "driven_m": round(kept.chainage_m, 1),
        "keys": n_keys,
        "skipped": list(kept.skipped),
        "failed": [{"file": name, "problem": problem} for name, problem in kept.failed],
    }
