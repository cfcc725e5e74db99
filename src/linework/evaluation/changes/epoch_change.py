"""A change between two surveys, or what was hidden, and the stretches of a line that are one.

Separate from `epochs`, which finds them: what differs of lines that both surveys have is found apart from what only one has.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from linework.arrays import BoolArray, IntArray
from linework.evaluation.changes.epoch_stations import EpochStations
from linework.evaluation.changes.misses import LEAST_STRETCH_M
from linework.evaluation.changes.registration import Registration, differences_of
from linework.lines.along import line_stretch, runs_of
from linework.model.lines import LineSet

#: Borders of the classes of confidence: even odds, and two to three times as good from class to class.
_CONFIDENCES = (0.5, 0.7, 0.85, 0.95)


@dataclass(frozen=True, slots=True)
class EpochChange:
    """A change, or a stretch that was hidden.

    Parameters
    ----------
    status
        "new", "gone", "moved", "changed", "unsure" or "not visible".
    line
        The stretch: of the new survey's line for "new" and what is unsure of it, else of the old one's.
    from_m, to_m
        Distance of its ends from the start of that line. [m]
    across_m, up_m
        Mean difference new minus old after registration, positive to the left and up; NaN where there is none. [m]
    sigma_across_m, sigma_up_m
        Standard deviations of the differences, with that of the registration. [m]
    what
        What is different of a "changed" line; of dashes that are new, it is a stretch of the new survey's line. What an
        "unsure" one would be.
    probability
        That the road has changed, see `change_probabilities`; NaN of what is hidden and of paint.
    """

    status: str
    line: LineSet
    from_m: float
    to_m: float
    across_m: float
    up_m: float
    sigma_across_m: float
    sigma_up_m: float
    what: str
    probability: float = math.nan

    @property
    def length_m(self) -> float:
        """Return its length [m]."""
        return self.to_m - self.from_m

    def stations_of(self, stations: EpochStations, i: int) -> IntArray:
        """Return the numbers of the stations of its line, the i-th, at which it is."""
        first, end = np.searchsorted(stations.line, [i, i + 1]).tolist()
        low, high = np.searchsorted(stations.along_m[first:end], [self.from_m, self.to_m]).tolist()
        return np.arange(first + low, min(first + high + 1, end))


def stretches_of(
    lines: LineSet, stations: EpochStations, i: int, mask: BoolArray, status: str, registration: Registration | None = None,
    what: str = "",
) -> list[EpochChange]:  # fmt: skip
    """Return the changes: the stretches of a line whose stations are in the mask, those of 2 m and more."""
    own = np.flatnonzero(stations.line == i)
    found = []
    for a, b in runs_of(mask[own]):
        rows = own[a : b + 1]
        start, end = float(stations.along_m[rows[0]]), float(stations.along_m[rows[-1]])
        if end - start < LEAST_STRETCH_M:
            continue
        numbers = (math.nan, math.nan, math.nan, math.nan)
        if registration is not None:
            rows = rows[~stations.bridged[rows] & ~stations.partner_bridged[rows]]
            across, up, s_reg = differences_of(stations, rows, registration)
            sigma = np.sqrt(np.mean(stations.sigma_m[rows] ** 2 + s_reg**2, axis=0))
            numbers = (float(across.mean()), float(up.mean()), float(sigma[0]), float(sigma[1]))
        piece = line_stretch(lines.take([i]), start, end)
        found.append(EpochChange(status, piece, start, end, *numbers, what))
    return found


def joined(lines: LineSet, i: int, parts: list[EpochChange]) -> list[EpochChange]:
    """Return stretches of the i-th line, those as one between which no more is hidden than both are long."""
    found = parts[:1]
    for one in parts[1:]:
        before = found[-1]
        if one.from_m - before.to_m <= before.length_m + one.length_m:
            line = line_stretch(lines.take([i]), before.from_m, one.to_m)
            found[-1] = replace(before, line=line, to_m=one.to_m)
        else:
            found.append(one)
    return found


def existence_of(lines: LineSet, i: int) -> float:
    """Return the probability that there is such a line at all; one that states no confidence is there."""
    confidence = float(lines.confidence[i])
    return 1.0 if math.isnan(confidence) else confidence


def levels_of(lines: LineSet, i: int, *survey: str) -> tuple[str, ...]:
    """Return the classes of a line by which lines are missed, from the widest to the narrowest."""
    sure = str(int(np.searchsorted(_CONFIDENCES, existence_of(lines, i))))
    return str(lines.kind[i]), f"{lines.form[i]} {lines.pattern[i]}", *survey, sure
